"""What a sample holds as arrays: names, shapes, types and units, in one table for code, tests and documentation."""

from __future__ import annotations

from dataclasses import dataclass

PARTS = ("images", "backgrounds", "masks", "cameras", "true_cameras", "curves", "visibility", "passes")
"""What can be asked for by itself."""

COUNTED = {"N": "is_view", "E": "is_strut", "V": "is_joint"}
"""Axes whose length differs from sample to sample, and what tells in a batch which places are filled."""


@dataclass(frozen=True)
class TensorKind:
    """One array of a sample.

    Attributes
    ----------
    name : str
        Its key.
    part : str
        The one of `PARTS` that it belongs to.
    shape : tuple of str or int
        N views of H rows and W columns in C channels, E struts, V joints, S samples along a strut.
    dtype : str
        As numpy and torch both call it.
    unit : str
        ``mm``, ``px``, or what else the numbers mean.
    what : str
        What it is, for the documentation.
    """

    name: str
    part: str
    shape: tuple[str | int, ...]
    dtype: str
    unit: str
    what: str


_KINDS = (
    ("images", "images", "N C H W", "uint8", "0 to 255", "pictures: C is 1 (masks), or 3 (red, green, blue)"),
    ("backgrounds", "backgrounds", "N C H W", "uint8", "0 to 255", "the same views before printing"),
    ("masks", "masks", "N H W", "float32", "0 to 1", "true share of each pixel that the print covers"),
    ("K", "cameras", "N 3 3", "float32", "px", "intrinsics; pixel centres at +0.5"),
    ("distortion", "cameras", "N 5", "float32", "", "of the lens: k1 k2 p1 p2 k3; k1 k2 k3 k4 0 where it is a fisheye"),
    ("fisheye", "cameras", "N", "bool", "", "whether the lens is a fisheye"),
    ("camera_to_world", "cameras", "N 4 4", "float32", "mm", "pose, OpenCV axes: x right, y down, z forward"),
    ("world_to_camera", "cameras", "N 4 4", "float32", "mm", "its inverse"),
    ("true_K", "true_cameras", "N 3 3", "float32", "px", "intrinsics of the cameras that took the pictures"),
    ("true_distortion", "true_cameras", "N 5", "float32", "", "of their lenses"),
    ("true_fisheye", "true_cameras", "N", "bool", "", "whether these are fisheyes"),
    ("true_camera_to_world", "true_cameras", "N 4 4", "float32", "mm", "their poses"),
    ("true_world_to_camera", "true_cameras", "N 4 4", "float32", "mm", "the inverse"),
    ("edges", "curves", "E 2", "int64", "joint", "joints at the ends of each strut"),
    ("printed", "curves", "E", "bool", "", "whether the plan says that the strut is printed"),
    ("radius", "curves", "E", "float32", "mm", "strut radius of the plan"),
    ("vertices", "curves", "V 3", "float32", "mm", "joints of the plan"),
    ("control_points", "curves", "E 4 3", "float32", "mm", "cubic Bezier curves of the plan"),
    ("truth_vertices", "curves", "V 3", "float32", "mm", "where the joints really are"),
    ("truth_control_points", "curves", "E 4 3", "float32", "mm", "where the struts really are"),
    ("present", "curves", "E 2", "float32", "0 to 1", "interval of the curve parameter at which the strut is there"),
    ("points", "curves", "E S 3", "float32", "mm", "samples along the true struts at even parameters, S = 33"),
    ("tangents", "curves", "E S 3", "float32", "unit vector", "direction of the true strut"),
    ("point_radius", "curves", "E S", "float32", "mm", "real radius"),
    ("point_present", "curves", "E S", "bool", "", "whether the strut is there"),
    ("pixels", "visibility", "N E S 2", "float32", "px", "where a view sees the samples, with its lens; NaN behind"),
    ("pixel_tangents", "visibility", "N E S 2", "float32", "unit vector", "direction in the picture, or 0"),
    ("pixel_depth", "visibility", "N E S", "float32", "mm", "of the samples, along the optical axis"),
    ("visible", "visibility", "N E S", "bool", "", "in the picture, and nothing stands in front"),
    ("depth", "passes", "N H W", "float32", "mm", "of each pixel, along the optical axis; infinite where nothing is"),
    ("normal", "passes", "N 3 H W", "float32", "unit vector", "of the surface, world axes; 0 where nothing is"),
    ("strut", "passes", "N H W", "int32", "strut", "which strut a pixel sees; -1 where nothing is"),
)  # fmt: skip

KINDS: dict[str, TensorKind] = {
    name: TensorKind(
        name, part, tuple(int(axis) if axis.isdigit() else axis for axis in shape.split()), dtype, unit, what
    )
    for name, part, shape, dtype, unit, what in _KINDS
}
"""Every array by its name; a sample has those of the parts that are asked for."""

POSES = ("camera_to_world", "world_to_camera", "true_camera_to_world", "true_world_to_camera")
"""Matrices of which only the last column is a length."""
