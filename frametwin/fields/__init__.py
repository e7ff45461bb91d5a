"""Deformation fields: displacements in mm of every point of space, behind one small interface.

`load_field` and `save_field` need numpy and safetensors only; torch is imported when a field that needs it is
loaded.
"""

from frametwin.fields.base import DeformationField, enlarged_box
from frametwin.fields.store import load_field, save_field

__all__ = ["DeformationField", "enlarged_box", "load_field", "save_field"]
