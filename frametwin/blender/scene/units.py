"""Millimetres and Blender units."""

from __future__ import annotations

import bpy
import numpy as np

FLOAT32 = float(np.finfo(np.float32).eps)
"""Relative resolution of Blender's coordinates."""


def mm_per_unit(scene: bpy.types.Scene) -> float:
    """Millimetres in one Blender unit of the scene: 1000 times its unit scale (Scene > Units > Unit Scale).

    With the unit scale 1 a strut of 200 mm is 0.2 units long; with 0.001 a unit is a millimetre. Blender keeps
    the unit scale in single precision; the shortest decimal number that rounds to it is taken, so 0.001 means
    0.001.
    """
    return 1000.0 * float(str(np.float32(scene.unit_settings.scale_length)))
