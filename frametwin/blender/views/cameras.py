"""FrameTwin's cameras as Blender's camera objects, exact both ways.

Blender knows the size of a picture and the shape of its pixels for a whole scene only, and no lens distortion. These
are kept as custom properties of the camera data, where they can be seen and changed: ``frametwin_size`` (width and
height in pixels), ``frametwin_pixel_aspect`` (x and y, as in the render settings) and ``frametwin_distortion``
(OpenCV's k1, k2, p1, p2, k3). Lens, sensor and shift are the camera's own and count as they are, and so does the pose
of the object.

Distortion: in Blender the camera is the pinhole camera without it, with the same focal lengths and principal point,
so pictures rendered there are undistorted ones. The coefficients ride along and come back with the camera.

Blender's numbers are single precision. The camera's own are kept beside them (custom property ``frametwin`` of the
object) and come back as long as Blender's still say the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import bpy
import idprop
import mathutils
import numpy as np

from frametwin.blender.scene.placement import Placement, current_depsgraph, label, scene_of
from frametwin.blender.scene.units import mm_per_unit
from frametwin.cameras import BlenderCamera, Camera, from_blender, to_blender
from frametwin.cameras.camera import DISTORTION_KEYS, FISHEYE, PERSPECTIVE
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

KEY = "frametwin"
SIZE = "frametwin_size"
PIXEL_ASPECT = "frametwin_pixel_aspect"
DISTORTION = "frametwin_distortion"

SENSOR_WIDTH = 36.0  # mm
SMALLEST_LENS = 1.0  # mm, Blender allows no less
NEAR_ORIGIN = 100.0  # mm, what a camera that stands nearer to the origin is taken to see
DISPLAY_SHARE = 0.05  # size of the drawn camera in the viewport as a share of its distance from the origin

_SAME = 2e-6  # how far apart numbers may be that single precision has been through, relative
_INTRINSICS = ("fl_x", "fl_y", "cx", "cy")


def camera_to_blender(
    camera: Camera,
    scene: bpy.types.Scene | None = None,
    collection: bpy.types.Collection | None = None,
    *,
    target: Wireframe | None = None,
) -> bpy.types.Object:
    """Make a camera object.

    Parameters
    ----------
    camera
        The camera; its lens distortion rides along without effect (see the module).
    scene
        Whose unit scale holds; the current one by default.
    collection
        Where to link it; the scene's own by default.
    target
        The frame that shall be inside of the clip range; without it, the range goes from a thousandth to ten times
        the distance from the origin.

    Returns
    -------
    An object named like the camera (Blender numbers it if the name is taken). `activate` makes the scene render it.
    """
    scene = bpy.context.scene if scene is None else scene
    unit = mm_per_unit(scene)
    # A wide lens gets a larger sensor: the angle of view is the same, and the focal length one that Blender takes.
    sensor = max(SENSOR_WIDTH, 1.01 * SMALLEST_LENS * camera.width / camera.fl_x)
    settings = to_blender(camera.without_distortion(), sensor_width=sensor)
    data = bpy.data.cameras.new(camera.name)
    for name in ("sensor_fit", "sensor_width", "sensor_height", "lens", "shift_x", "shift_y"):
        setattr(data, name, getattr(settings, name))
    near, far = _clip_range(camera, target)
    data.clip_start, data.clip_end = near / unit, far / unit
    data.display_size = DISPLAY_SHARE * max(float(np.linalg.norm(camera.centre)), NEAR_ORIGIN) / unit
    data[SIZE] = [camera.width, camera.height]
    data[PIXEL_ASPECT] = [settings.pixel_aspect_x, settings.pixel_aspect_y]
    data[DISTORTION] = camera.distortion.tolist()
    obj = bpy.data.objects.new(camera.name, data)
    obj.rotation_mode = "QUATERNION"  # Euler angles lose digits where the camera looks straight down
    matrix = settings.matrix_world.copy()
    matrix[:3, 3] /= unit
    obj.matrix_world = mathutils.Matrix(matrix.tolist())
    obj[KEY] = {
        "name": camera.name,
        "object": obj.name,
        "camera_to_world": camera.camera_to_world.ravel(),
        **{name: getattr(camera, name) for name in _INTRINSICS},
    }
    (scene.collection if collection is None else collection).objects.link(obj)
    return obj


def _clip_range(camera: Camera, target: Wireframe | None) -> tuple[float, float]:
    """Nearest and farthest depth in mm that is drawn."""
    if target is None:
        far = 10.0 * max(float(np.linalg.norm(camera.centre)), NEAR_ORIGIN)
        return 1e-4 * far, far
    depth = camera.project(target.control_points, distort=False)[1]
    radius = float(target.radius.max())
    far = 2.0 * max(float(depth.max()) + radius, radius)
    return max(0.5 * (float(depth.min()) - radius), 1e-4 * far), far


def camera_from_blender(obj: bpy.types.Object, scene: bpy.types.Scene | None = None) -> Camera:
    """Read a camera object.

    Parameters
    ----------
    obj
        A perspective camera. Its scale is left out, as Blender does when it renders.
    scene
        Whose unit scale holds, see `scene_of`; and, for cameras without ``frametwin_size``, the size and shape of
        whose pictures are taken, at the percentage that is set there.

    Returns
    -------
    Mm, world, with parents and constraints. The name is that of the object; of a camera made by
    `camera_to_blender` and not renamed since, the one it had.

    Raises
    ------
    InputError
        If the object is no camera, its lens is not a perspective one, it is mirrored or sheared, or a custom
        property does not hold what it should.
    """
    where = label(obj)
    if obj.type != "CAMERA":
        raise InputError.at(where, "type", f"is {obj.type}, not a camera", "select a camera")
    if obj.data.type != "PERSP":
        raise InputError.at(where, "lens type", f"is {obj.data.type}", "set the lens type to Perspective")
    scene = scene_of(obj, scene)
    size, aspect = picture_size(obj, scene)
    values = {name: getattr(obj.data, name) for name in ("lens", "sensor_width", "sensor_height", "shift_x", "shift_y")}
    settings = BlenderCamera(
        matrix_world=_rigid_pose(obj, scene),
        sensor_fit=obj.data.sensor_fit,
        resolution_x=size[0],
        resolution_y=size[1],
        pixel_aspect_x=aspect[0],
        pixel_aspect_y=aspect[1],
        **values,
    )
    pinhole = _with_kept_digits(from_blender(settings, obj.name), obj)
    fisheye = len(obj.data.get(DISTORTION) or ()) == len(DISTORTION_KEYS[FISHEYE])
    model = FISHEYE if fisheye else PERSPECTIVE
    coefficients = _numbers(obj, DISTORTION, len(DISTORTION_KEYS[model])) or [0.0] * 5
    return replace(pinhole, distortion=np.array(coefficients), model=model, source=where)


def picture_size(obj: bpy.types.Object, scene: bpy.types.Scene) -> tuple[tuple[int, int], tuple[float, float]]:
    """Width and height in pixels of a camera's pictures, and the pixel aspect x and y.

    Those of the custom properties count; a camera without them has those that the scene would render, at its
    percentage.

    Raises
    ------
    InputError
        If a custom property does not hold two positive numbers.
    """
    render = scene.render
    size, aspect = _numbers(obj, SIZE, 2), _numbers(obj, PIXEL_ASPECT, 2)
    if size is None:
        share = render.resolution_percentage
        size = [render.resolution_x * share // 100, render.resolution_y * share // 100]
        aspect = aspect or [render.pixel_aspect_x, render.pixel_aspect_y]
    aspect = aspect or [1.0, 1.0]
    for name, pair in ((SIZE, size), (PIXEL_ASPECT, aspect)):
        if min(pair) <= 0.0:
            raise InputError.at(label(obj), f'custom property "{name}"', "is not positive", "give numbers above 0")
    return (round(size[0]), round(size[1])), (float(aspect[0]), float(aspect[1]))


def _numbers(obj: bpy.types.Object, name: str, count: int) -> list[float] | None:
    """The numbers of a custom property of the camera data, or ``None`` if it has none of this name."""
    value: Any = obj.data.get(name)
    if value is None:
        return None
    if isinstance(value, idprop.types.IDPropertyArray) and len(value) == count:
        return [float(number) for number in value]
    raise InputError.at(
        label(obj), f'custom property "{name}"', f"does not hold {count} numbers", "correct it, or delete it"
    )


def _rigid_pose(obj: bpy.types.Object, scene: bpy.types.Scene) -> np.ndarray:
    """(4, 4) camera to world, mm, Blender's axes, without scale."""
    matrix = Placement.of(obj, current_depsgraph(obj, scene)).matrix
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if lengths.min() <= 0.0:
        raise InputError.at(label(obj), "scale", "is zero", "apply the scale of the camera and its parents")
    axes = matrix[:3, :3] / lengths
    if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-4:
        raise InputError.at(label(obj), "scale", "its parents shear it", "apply the scale of its parents")
    if np.linalg.det(axes) < 0.0:
        raise InputError.at(label(obj), "scale", "mirrors the picture", "make the scale positive")
    left, _, right = np.linalg.svd(axes)  # single precision: the nearest rotation
    matrix[:3, :3] = left @ right
    return matrix


def _with_kept_digits(camera: Camera, obj: bpy.types.Object) -> Camera:
    """The camera under the name and with the digits it once had, as far as Blender still says the same."""
    kept = obj.get(KEY)
    if not isinstance(kept, idprop.types.IDPropertyGroup):
        return camera
    try:
        if kept["object"] == obj.name:
            camera = replace(camera, name=str(kept["name"]))
        pose = np.array(kept["camera_to_world"], dtype=np.float64).reshape(4, 4)
        digits = [float(kept[name]) for name in _INTRINSICS]
    except (KeyError, TypeError, ValueError):
        return camera
    side = max(camera.width, camera.height, camera.fl_x, camera.fl_y)
    if all(abs(getattr(camera, name) - value) <= _SAME * side for name, value in zip(_INTRINSICS, digits, strict=True)):
        fl_x, fl_y, cx, cy = digits
        camera = replace(camera, fl_x=fl_x, fl_y=fl_y, cx=cx, cy=cy)
    turn = np.abs(camera.camera_to_world[:3, :3] - pose[:3, :3]).max()
    shift = np.abs(camera.centre - pose[:3, 3]).max()
    if turn <= _SAME and shift <= _SAME * float(np.abs(pose[:3, 3]).max()):
        camera = replace(camera, camera_to_world=pose)
    return camera


def activate(obj: bpy.types.Object, scene: bpy.types.Scene | None = None) -> None:
    """Make the scene render this camera: its picture's size at 100 % and its pixel aspect, see `picture_size`.

    Raises
    ------
    InputError
        If the object is no camera, or a custom property does not hold what it should.
    """
    if obj.type != "CAMERA":
        raise InputError.at(label(obj), "type", f"is {obj.type}, not a camera", "select a camera")
    scene = scene_of(obj, scene)
    render = scene.render
    (width, height), (aspect_x, aspect_y) = picture_size(obj, scene)
    scene.camera = obj
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.pixel_aspect_x, render.pixel_aspect_y = aspect_x, aspect_y


def cameras_in(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """The camera objects among others, in their order."""
    return [obj for obj in objects if obj.type == "CAMERA"]
