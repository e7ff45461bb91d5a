"""Plans out of what is drawn in Blender: curve objects, the edges of meshes, and the user's own .blend files."""

from __future__ import annotations

from pathlib import Path

import bpy

from frametwin.blender.frames.curve_reading import CurveDrawing, read_curve
from frametwin.blender.frames.joints import Reading
from frametwin.blender.frames.meshes import MeshDrawing, read_mesh
from frametwin.blender.scene.placement import label, scene_of
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe

READABLE = ("CURVE", "MESH")
"""Types of objects that can be read as a plan."""

_REMEDIES = {
    "CURVES": "convert it to a curve object (Object > Convert)",
    "FONT": "convert it to a curve object (Object > Convert)",
    "GREASEPENCIL": "convert it to a curve object (Object > Convert)",
    "META": "convert it to a mesh (Object > Convert)",
    "SURFACE": "convert it to a mesh (Object > Convert)",
}


def plan_from_object(
    obj: bpy.types.Object,
    *,
    evaluated: bool = False,
    reading: Reading | None = None,
    scene: bpy.types.Scene | None = None,
) -> Wireframe:
    """Read an object as a plan, in mm of the world: its own position, rotation and scale are applied.

    Parameters
    ----------
    obj
        A mesh, whose edges are straight struts; or a curve object, with a strut for each segment of its Bezier and
        polygon splines. One made by `wireframe_to_curve` gives its frame back.
    evaluated
        Whether modifiers count. A mesh may then have other edges than without, such as both halves of a mirror.
    reading
        Tolerance of joints, radius where the object has none, what to do about joints that were pulled open.
    scene
        Whose unit scale holds; see `scene_of`.

    Returns
    -------
    Ends within the tolerance are one joint; loose vertices and struts drawn twice are left out. All are printed, and
    stand on their lowest joints. The radius is that of the bevel, or of a mesh's attribute ``radius`` of vertices or
    edges, times the object's scale.

    Raises
    ------
    InputError
        If the object is of another type, empty, without edges, scaled to nothing along an axis, holds NURBS splines
        (whose points say nothing about joints) or a closed strut, or `Wireframe` refuses what is drawn.
    """
    if obj.type == "MESH":
        return read_mesh(obj, reading, evaluated=evaluated, scene=scene).plan()
    drawing = _drawing(obj, reading, scene)
    return drawing.deformed() if evaluated else drawing.plan()


def plan_and_deformed(
    obj: bpy.types.Object,
    frame_number: float | None = None,
    *,
    reading: Reading | None = None,
    scene: bpy.types.Scene | None = None,
) -> tuple[Wireframe, Wireframe]:
    """The plan that an object shows without modifiers, and the same struts as modifiers and shape keys bend them.

    Parameters
    ----------
    obj
        A curve or mesh object.
    frame_number
        The time at which to read it; the scene's present frame by default, to which it returns.
    reading, scene
        See `plan_from_object`.

    Returns
    -------
    plan, deformed
        With the same edges and properties. Both have the object's position, rotation and scale at that time:
        moving the object moves the plan as well, and is no deformation.

    Raises
    ------
    InputError
        As `plan_from_object`; if the object is not evaluated (disabled, or in an excluded collection); if modifiers
        add or remove struts or pull them apart at a joint.
    """
    scene = scene_of(obj, scene)
    before = scene.frame_current, scene.frame_subframe
    if frame_number is not None:
        whole = int(frame_number // 1)
        scene.frame_set(whole, subframe=float(frame_number - whole))
    try:
        drawing = _drawing(obj, reading, scene)
        return drawing.plan(), drawing.deformed()
    finally:
        if frame_number is not None:
            scene.frame_set(before[0], subframe=before[1])


def _drawing(
    obj: bpy.types.Object, reading: Reading | None, scene: bpy.types.Scene | None
) -> CurveDrawing | MeshDrawing:
    if obj.type == "MESH":
        return read_mesh(obj, reading, scene=scene)
    if obj.type == "CURVE":
        return read_curve(obj, reading, scene=scene)
    remedy = _REMEDIES.get(obj.type, "select a mesh or a curve object")
    raise InputError.at(label(obj), "type", f"{obj.type} objects have no struts", remedy)


def read_blend(
    path: PathLike, object_name: str, frame_number: float | None = None, *, reading: Reading | None = None
) -> tuple[Wireframe, Wireframe]:
    """Open a .blend file and read one of its objects, as `plan_and_deformed`.

    The file takes the place of what is open in this Blender. Scripts in it are not run, so drivers that need one
    stand still.

    Parameters
    ----------
    path
        The file.
    object_name
        The object in it.
    frame_number, reading
        See `plan_and_deformed`; by default the time at which the file was saved.

    Raises
    ------
    InputError
        If the file is missing or damaged, has no such object, or it cannot be read.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError.at(file, "file", "the file does not exist", "check the name, or put the file there")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(file.resolve()), load_ui=False, use_scripts=False)
    except RuntimeError as error:  # what Blender reports as an error
        raise InputError.at(
            file, "file", "Blender cannot open it", "save it again, with this Blender or an older one"
        ) from error
    obj = bpy.data.objects.get(object_name)
    if obj is None:
        there = sorted(candidate.name for candidate in bpy.data.objects if candidate.type in READABLE)
        raise InputError.at(
            file,
            f"object {object_name!r}",
            "is not in the file",
            f"give one of {', '.join(there)}" if there else "draw the frame as a mesh or a curve object",
        )
    try:
        return plan_and_deformed(obj, frame_number, reading=reading)
    except InputError as error:
        raise error.inside(file) from error
