"""Frames out of mesh files that Blender itself imports."""

from __future__ import annotations

from pathlib import Path

import bpy

from frametwin.blender.frames.plans import plan_from_object
from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe

IMPORTERS = {".stl": "stl_import", ".ply": "ply_import"}
"""Blender's operators by the suffix of a file; these formats state no unit."""


def read_mesh_file(path: PathLike, scene: bpy.types.Scene | None = None) -> Wireframe:
    """Read the edges of a mesh file as struts; a unit of the file is a millimetre, and z is up.

    Parameters
    ----------
    path
        A file with a suffix of `IMPORTERS`.
    scene
        The scene to import it into for a moment; the current one by default.

    Raises
    ------
    InputError
        If it is missing or damaged, or has no edges.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError.at(path, "file", "the file does not exist", "check the name, or put the file there")
    scene = bpy.context.scene if scene is None else scene
    before = set(bpy.data.objects), set(bpy.data.meshes), set(bpy.data.materials)
    chosen, active = list(bpy.context.selected_objects), bpy.context.view_layer.objects.active
    try:
        _import(file, 1.0 / mm_per_unit(scene))
        made = [obj for obj in bpy.data.objects if obj not in before[0] and obj.type == "MESH"]
        if not made or not any(len(obj.data.edges) for obj in made):
            raise InputError.at(path, "file", "holds no edges", "give a mesh with faces, or with lines")
        frame = plan_from_object(made[0], scene=scene)
    finally:
        for kind, old in zip((bpy.data.objects, bpy.data.meshes, bpy.data.materials), before, strict=True):
            for item in [item for item in kind if item not in old]:
                kind.remove(item)
        for obj in chosen:
            obj.select_set(True)
        bpy.context.view_layer.objects.active = active
    return frame.replace(name=file.stem)


def _import(file: Path, scale: float) -> None:
    """Have Blender import a file, in its own axes.

    Raises
    ------
    InputError
        If Blender cannot read it.
    """
    importer = getattr(bpy.ops.wm, IMPORTERS[file.suffix.lower()])
    try:
        done = importer(filepath=str(file), global_scale=scale, use_scene_unit=False, forward_axis="Y", up_axis="Z")
    except RuntimeError as error:
        reason = " ".join(str(error).removeprefix("Error:").split())
        raise InputError.at(file, "file", f"Blender cannot read it ({reason})", "export the mesh again") from error
    if done != {"FINISHED"}:
        raise InputError.at(file, "file", "Blender cannot read it", "export the mesh again")
