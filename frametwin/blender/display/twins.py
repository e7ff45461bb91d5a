"""Digital twins in a scene: one Curves object each, with its plan as a ghost, in a collection of its own."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from frametwin.blender.background.stepwise import TURN, run_steps
from frametwin.blender.display.colouring import colour_struts, legend_of
from frametwin.blender.display.colours import Legend
from frametwin.blender.display.display_group import add_display, display_group_steps, remove_unused_display
from frametwin.blender.display.display_inputs import GHOST, SIDES, sides_for
from frametwin.blender.display.point_values import farthest, twin_attributes, twin_sampling
from frametwin.blender.display.statistics import StrutValues, strut_values
from frametwin.blender.display.twin_records import load_values, store_values, store_verdict
from frametwin.blender.frames.strut_curves import StrutCurves, recorded_curves, recorded_frame, strut_curves_steps
from frametwin.blender.scene.collections import home_collection, remove_collection
from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.findings import missing_struts, uncertain_struts
from frametwin.twin.handing_over import taken_over
from frametwin.twin.runs import Truth, load_run, read_truth
from frametwin.twin.twin import Twin
from frametwin.twin.verdict import Verdict

RUN_KEY = "frametwin_run"
ROLE_KEY = "frametwin_role"

UNKNOWN = "it is not known"

GHOSTS = 1000
"""Most struts of a twin that comes with its plan as a ghost: on a larger one it would only be in the way."""


@dataclass(frozen=True, eq=False)
class TwinContent:
    """A twin made ready for a scene, without Blender.

    Attributes
    ----------
    frame
        The plan.
    struts
        The twin as curves with attributes, radius from its thickness.
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
    struts: StrutCurves
    values: dict[str, StrutValues]
    missing: np.ndarray
    uncertain: np.ndarray
    run_folder: str = ""
    verdict: Verdict = Verdict()

    @property
    def title(self) -> str:
        """What to call it: whose twin it is, and of which run."""
        run = Path(self.run_folder).name if self.run_folder else ""
        return f"{self.frame.name} twin, {run}" if run else f"{self.frame.name} twin"

    @classmethod
    def of(cls, twin: Twin, frame: Wireframe, truth: Truth | None = None, run_folder: str = "") -> TwinContent:
        """Prepare a twin of a frame.

        Raises
        ------
        InputError
            If the twin is not one of the frame.
        """
        thickness = np.where(twin.thickness > 0.0, twin.thickness, frame.radius[:, None])
        curves = twin.as_wireframe(frame).replace(radius=thickness.mean(axis=1))
        missing = missing_struts(twin, frame.printed)
        sampling = twin_sampling(twin, missing, curves.radius)
        values = strut_values(twin, frame, truth)
        attributes = twin_attributes(twin, frame, sampling, missing, values)
        height = np.where(frame.printed, farthest(attributes["distance"].values, sampling), np.nan)
        values["distance"] = StrutValues("distance", "mm", height)
        numbers = np.arange(frame.strut_count)
        struts = StrutCurves(curves, frame, sampling, attributes, numbers, sampling.between(thickness), twin.bent)
        assert len(struts.points[0])  # worked out here, where a thread may do it, and not as the twin is shown
        return cls(
            frame,
            struts,
            values,
            missing,
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

    @classmethod
    def handed_over(cls, answer: Mapping[str, Any]) -> TwinContent:
        """Take it from the answer of a fit that was asked to hand over its twin: quicker than reading the folder.

        Raises
        ------
        InputError
            If it is damaged.
        """
        twin, frame, truth = taken_over(answer["run"])
        return cls.of(twin, frame, truth, str(answer["out"]))


@dataclass(frozen=True)
class Colours:
    """Which quantity the colours show, from where to where, and on which map: what suits the values by default."""

    quantity: str = "displacement"
    low: float | None = None
    high: float | None = None
    map_name: str | None = None


@dataclass(frozen=True, eq=False)
class TwinObjects:
    """A twin in the scene: its collection and object, values of every strut, findings, and what the colours mean."""

    collection: bpy.types.Collection
    twin: bpy.types.Object
    values: dict[str, StrutValues]
    missing: np.ndarray
    uncertain: np.ndarray
    legend: Legend

    def frame(self) -> Wireframe:
        """The twin as its run holds it, whatever became of the object; in mm.

        Raises
        ------
        InputError
            If the object has lost it.
        """
        return recorded_frame(self.twin)

    def curves(self) -> np.ndarray:
        """(E, n + 1, 3) mm: the curves of the twin, of a higher degree where a strut is bent as no cubic can be."""
        return recorded_curves(self.twin)

    def plan(self) -> Wireframe:
        """The plan of the twin; see `frame`."""
        return recorded_frame(self.twin, plan=True)


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
    """Make a collection with the twin, coloured, and its plan as a ghost.

    In steps of some milliseconds; if they fail or are not gone on with, nothing is left in the scene. It comes into
    the scene when all of it is there, and locked: what was measured is not to be moved by accident.

    Raises
    ------
    InputError
        If the twin has no such quantity as ``colours`` says, or the range is empty.
    """
    frame = content.frame
    scene = bpy.context.scene if scene is None else scene
    collection = bpy.data.collections.new(collection_name or content.title)
    try:
        obj = yield from strut_curves_steps(content.struts, f"{frame.name} twin", collection, mm_per_unit(scene))
        for owner, role in ((collection, "collection"), (obj, "twin")):
            owner[RUN_KEY], owner[ROLE_KEY] = content.run_folder, role
        store_values(collection, content.values, content.missing, content.uncertain)
        store_verdict(collection, content.verdict)
        yield None
        yield from display_group_steps()
        add_display(obj, **{GHOST: frame.strut_count <= GHOSTS, SIDES: sides_for(frame.strut_count)})
        yield None
        values = content.values[colours.quantity]
        legend = colour_struts(obj, values, colours.low, colours.high, colours.map_name)
        yield None
        home_collection(scene).children.link(collection)
        yield TURN
    except BaseException:
        remove_twin(collection)
        raise
    return TwinObjects(collection, obj, content.values, content.missing, content.uncertain, legend)


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
    twin = twin_object(collection)
    legend = None if twin is None else legend_of(twin)
    if twin is None or legend is None:
        problem = "lacks the curves of its twin, or their display"
        raise InputError.at(f"collection {collection.name}", "objects", problem, "import the run again")
    return TwinObjects(collection, twin, values, missing, uncertain, legend)


def twin_object(collection: bpy.types.Collection) -> bpy.types.Object | None:
    """The Curves object of a twin's collection; ``None`` if the user deleted it."""
    return next((obj for obj in collection.objects if obj.get(ROLE_KEY) == "twin"), None)


def recolour_twin(
    collection: bpy.types.Collection,
    quantity: str,
    low: float | None = None,
    high: float | None = None,
    map_name: str | None = None,
) -> Legend:
    """Colour a twin by another quantity, over another range or on another map; see `colour_struts`.

    Raises
    ------
    InputError
        If it has no such quantity, the range is empty, or the collection shows no twin.
    """
    shown = find_twin(collection)
    if quantity not in shown.values:
        reasons = {"difference": "it has not been compared with another twin"}
        what = "the capture has no truth.json" if quantity.startswith("error") else reasons.get(quantity, UNKNOWN)
        remedy = f"choose one of {', '.join(shown.values)}"
        raise InputError.at(f"collection {collection.name}", quantity, f"cannot be shown, {what}", remedy)
    return colour_struts(shown.twin, shown.values[quantity], low, high, map_name)


def remove_twin(collection: bpy.types.Collection) -> None:
    """Remove a twin's collection with all in it, and the display if nothing else is drawn by it."""
    remove_collection(collection)
    remove_unused_display()
