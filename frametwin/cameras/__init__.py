"""Cameras: the pinhole model with OpenCV distortion and every conversion from and to other programs.

One convention inside FrameTwin: millimetres, world z up, camera axes as in OpenCV (x right, y down, z
forward), and pixel centres at +0.5, so the pixel in row i and column j has its centre at ``(j + 0.5, i +
0.5)``.
"""

from frametwin.cameras.camera import Camera, look_at, packed
from frametwin.cameras.colmap import read_colmap_text, write_colmap_text
from frametwin.cameras.colmap_binary import read_colmap, read_colmap_binary
from frametwin.cameras.conversions import (
    BlenderCamera,
    from_blender,
    to_blender,
)
from frametwin.cameras.nerfstudio import from_nerfstudio, to_nerfstudio, transforms_of

__all__ = [
    "BlenderCamera",
    "Camera",
    "from_blender",
    "from_nerfstudio",
    "look_at",
    "packed",
    "read_colmap",
    "read_colmap_binary",
    "read_colmap_text",
    "to_blender",
    "to_nerfstudio",
    "transforms_of",
    "write_colmap_text",
]
