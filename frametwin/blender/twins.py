"""Digital twins in a scene: the ghosted plan and the curves found, in a collection of their own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from frametwin.blender.collections import new_collection, remove_collection
from frametwin.blender.colours import Legend, colour_twin, remove_unused_colours
from frametwin.blender.curves import wireframe_to_curve
from frametwin.blender.statistics import StrutValues, strut_values
from frametwin.files import PathLike
from frametwin.findings import missing_struts, uncertain_struts
from frametwin.runs import Truth, load_run
from frametwin.twin import Twin
from frametwin.wireframe import Wireframe

RUN_KEY = "frametwin_run"


@dataclass(frozen=True, eq=False)
class TwinObjects:
    """A twin in the scene: its collection and objects, values of every strut, findings, and what the colours mean."""

    collection: bpy.types.Collection
    plan: bpy.types.Object
    twin: bpy.types.Object
    values: dict[str, StrutValues]
    missing: np.ndarray
    uncertain: np.ndarray
    legend: Legend


def import_twin(
    run_folder: PathLike,
    collection_name: str | None = None,
    scene: bpy.types.Scene | None = None,
    truth: Truth | None = None,
) -> TwinObjects:
    """Read a run folder and show it; see `show_twin`.

    Raises
    ------
    InputError
        If a file is missing or damaged; the scene is left as it was.
    """
    folder = Path(run_folder).absolute()
    twin, frame = load_run(folder)
    return show_twin(twin, frame, collection_name, scene, truth, run_folder=str(folder))


def show_twin(
    twin: Twin,
    frame: Wireframe,
    collection_name: str | None = None,
    scene: bpy.types.Scene | None = None,
    truth: Truth | None = None,
    run_folder: str = "",
) -> TwinObjects:
    """Make a collection with the plan (thin lines, not selectable, not rendered) and the twin, coloured.

    Raises
    ------
    InputError
        If the twin is not one of the frame.
    """
    thickness = twin.thickness.mean(axis=1)
    curves = twin.as_wireframe(frame).replace(radius=np.where(thickness > 0.0, thickness, frame.radius))
    values = strut_values(twin, frame, truth)
    missing = missing_struts(twin, frame.printed)
    collection = new_collection(collection_name or f"{frame.name} twin", scene)
    plan = wireframe_to_curve(frame, name=f"{frame.name} plan", collection=collection, scene=scene)
    plan.data.bevel_depth = 0.0  # lines; the radius is remembered
    plan.display_type, plan.hide_select, plan.hide_render = "WIRE", True, True
    obj = wireframe_to_curve(curves, name=f"{frame.name} twin", collection=collection, scene=scene)
    collection[RUN_KEY] = plan[RUN_KEY] = obj[RUN_KEY] = run_folder
    legend = colour_twin(obj, values["displacement"], missing=missing)
    uncertain = uncertain_struts(twin, frame.printed)
    return TwinObjects(collection, plan, obj, values, missing, uncertain, legend)


def remove_twin(collection: bpy.types.Collection) -> None:
    """Remove a twin's collection with all in it, and the colours that no other twin uses."""
    remove_collection(collection)
    remove_unused_colours()
