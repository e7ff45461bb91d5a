"""Digital twins in a scene: the ghosted plan and the curves found, in a collection of their own."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from frametwin.blender.background.stepwise import TURN, run_steps
from frametwin.blender.display.colours import Legend, colour_twin, materials_steps, remove_unused_colours
from frametwin.blender.display.statistics import StrutValues, strut_values
from frametwin.blender.display.twin_records import (
    load_legend,
    load_values,
    store_legend,
    store_values,
    store_verdict,
)
from frametwin.blender.frames.curves import wireframe_to_curve_steps
from frametwin.blender.scene.collections import remove_collection
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.findings import missing_struts, uncertain_struts
from frametwin.twin.runs import Truth, load_run, read_truth
from frametwin.twin.twin import Twin
from frametwin.twin.verdict import Verdict

RUN_KEY = "frametwin_run"
ROLE_KEY = "frametwin_role"


@dataclass(frozen=True, eq=False)
class TwinContent:
    """A twin made ready for a scene, without Blender.

    Attributes
    ----------
    frame
        The plan.
    curves
        The twin as a frame, radius from its thickness.
    values
        Quantities of every strut.
    missing, uncertain
        Rising strut indices.
    run_folder
        Where it was read, or empty.
    verdict
        Of the fit on its twin.
    """

    frame: Wireframe
    curves: Wireframe
    values: dict[str, StrutValues]
    missing: np.ndarray
    uncertain: np.ndarray
    run_folder: str = ""
    verdict: Verdict = Verdict()

    @classmethod
    def of(cls, twin: Twin, frame: Wireframe, truth: Truth | None = None, run_folder: str = "") -> TwinContent:
        """Prepare a twin of a frame.

        Raises
        ------
        InputError
            If the twin is not one of the frame.
        """
        thickness = twin.thickness.mean(axis=1)
        return cls(
            frame,
            twin.as_wireframe(frame).replace(radius=np.where(thickness > 0.0, thickness, frame.radius)),
            strut_values(twin, frame, truth),
            missing_struts(twin, frame.printed),
            uncertain_struts(twin, frame.printed),
            run_folder,
            twin.verdict,
        )

    @classmethod
    def read(cls, run_folder: PathLike, truth: PathLike | None = None) -> TwinContent:
        """Read a run folder, and where one is given a capture or frame file with the truth.

        Raises
        ------
        InputError
            If a file is missing or damaged, or they do not belong together.
        """
        folder = Path(run_folder).absolute()
        twin, frame = load_run(folder)
        return cls.of(twin, frame, None if truth is None else read_truth(Path(truth), frame), str(folder))


@dataclass(frozen=True)
class Colours:
    """Which quantity the colours show, and from where to where: 0 and the highest value by default."""

    quantity: str = "displacement"
    low: float | None = None
    high: float | None = None


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
    truth: PathLike | None = None,
) -> TwinObjects:
    """Read a run folder and show it; see `TwinContent.read` and `show_twin_steps`.

    Raises
    ------
    InputError
        If a file is missing or damaged; the scene is left as it was.
    """
    return run_steps(show_twin_steps(TwinContent.read(run_folder, truth), collection_name, scene))


def show_twin(
    twin: Twin,
    frame: Wireframe,
    collection_name: str | None = None,
    scene: bpy.types.Scene | None = None,
    truth: Truth | None = None,
    run_folder: str = "",
) -> TwinObjects:
    """Show a twin in memory; see `show_twin_steps`.

    Raises
    ------
    InputError
        If the twin is not one of the frame.
    """
    content = TwinContent.of(twin, frame, truth, run_folder)
    return run_steps(show_twin_steps(content, collection_name, scene))


def show_twin_steps(
    content: TwinContent,
    collection_name: str | None = None,
    scene: bpy.types.Scene | None = None,
    colours: Colours = Colours(),
) -> Generator[str | None, None, TwinObjects]:
    """Make a collection with the plan (thin lines, not selectable, not rendered) and the twin, coloured.

    In steps of some milliseconds; if they fail or are not gone on with, nothing is left in the scene. It comes into
    the scene when all of it is there: Blender, which works out the geometry of thousands of struts in a tenth of a
    second, then does so once, between two steps.

    Raises
    ------
    InputError
        If the twin has no such quantity as ``colours`` says, or the range is empty.
    """
    frame = content.frame
    scene = bpy.context.scene if scene is None else scene
    collection = bpy.data.collections.new(collection_name or f"{frame.name} twin")
    try:
        plan = yield from wireframe_to_curve_steps(frame, name=f"{frame.name} plan", collection=collection, scene=scene)
        ghost(plan)
        obj = yield from wireframe_to_curve_steps(
            content.curves, name=f"{frame.name} twin", collection=collection, scene=scene
        )
        for owner, role in ((collection, "collection"), (plan, "plan"), (obj, "twin")):
            owner[RUN_KEY], owner[ROLE_KEY] = content.run_folder, role
        yield None
        store_values(collection, content.values, content.missing, content.uncertain)
        store_verdict(collection, content.verdict)
        yield None
        yield from materials_steps()
        numbers = np.arange(frame.strut_count)
        values = content.values[colours.quantity]
        legend = colour_twin(obj, values, colours.low, colours.high, missing=content.missing, strut=numbers)
        store_legend(collection, legend)
        yield None
        scene.collection.children.link(collection)
        yield TURN
    except BaseException:
        remove_twin(collection)
        raise
    return TwinObjects(collection, plan, obj, content.values, content.missing, content.uncertain, legend)


def ghost(plan: bpy.types.Object) -> None:
    """Draw a frame's curve object as thin lines that are in nobody's way; its radius is remembered."""
    plan.data.bevel_depth = 0.0
    plan.display_type, plan.hide_select, plan.hide_render = "WIRE", True, True


def is_twin(collection: bpy.types.Collection | None) -> bool:
    """Whether a collection was made by `show_twin_steps`."""
    return collection is not None and collection.get(ROLE_KEY) == "collection"


def find_twin(collection: bpy.types.Collection) -> TwinObjects:
    """Read what a collection shows, also in a file that was saved and opened again.

    Raises
    ------
    InputError
        If it shows no twin (any more).
    """
    values, missing, uncertain = load_values(collection)
    legend = load_legend(collection)
    roles = {obj.get(ROLE_KEY): obj for obj in collection.objects}
    if legend is None or not {"plan", "twin"} <= roles.keys():
        problem = "lacks the curves of its twin"
        raise InputError.at(f"collection {collection.name}", "objects", problem, "import the run again")
    return TwinObjects(collection, roles["plan"], roles["twin"], values, missing, uncertain, legend)


def recolour_twin(
    collection: bpy.types.Collection, quantity: str, low: float | None = None, high: float | None = None
) -> Legend:
    """Colour a twin by another quantity, or over another range; see `colour_twin`.

    Raises
    ------
    InputError
        If it has no such quantity, the range is empty, or the collection shows no twin.
    """
    shown = find_twin(collection)
    if quantity not in shown.values:
        what = "the capture has no truth.json" if quantity.startswith("error") else "it is not known"
        remedy = f"choose one of {', '.join(shown.values)}"
        raise InputError.at(f"collection {collection.name}", quantity, f"cannot be shown, {what}", remedy)
    legend = colour_twin(shown.twin, shown.values[quantity], low, high, missing=shown.missing)
    store_legend(collection, legend)
    return legend


def remove_twin(collection: bpy.types.Collection) -> None:
    """Remove a twin's collection with all in it, and the colours that no other twin uses."""
    remove_collection(collection)
    remove_unused_colours()
