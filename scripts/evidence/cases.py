"""Which runs there are: each a frame, what is simulated of it, a way of fitting, and the settings that differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from scripts.evidence.scenes import frame_files

QUICK_CHANGES = {"samples": 6, "image_scale": 0.25, "bending_samples": 512}
"""What makes the paper's method quick: fewer samples on a strut, and pictures of a quarter of their width."""

RIVAL_CHANGES: dict[str, dict[str, Any]] = {
    "curve-driven": {"image_scale": 0.25, "iterations": 5000},
    "deformation-driven": {"image_scale": 0.25, "iterations": 3000},
}
"""What makes the methods quick that the paper compares with: smaller pictures, and fewer steps than their own."""

CUBE_STEPS = {"curve-driven": 1500, "deformation-driven": 600}
"""Of these methods on the cube, which has 12 struts."""

PRESETS = ("paper", "fast")
RIVALS = tuple(RIVAL_CHANGES)
WEIGHTS = (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5)
POWERS = (0.0, 1.0, 2.0, float("inf"))
VIEWS = (4, 6, 8, 10)
SHARES = (0.25, 0.5, 1.0)
"""Of the struts, that are printed."""

PARTIAL_FRAMES: dict[str, tuple[str, dict[str, Any]]] = {
    "bunny_head": ("bunny_full_tri_dense", {"uppermost": 165}),
    "bridge": ("bridge", {}),
    "half_bowl": ("half_bowl", {}),
}
"""Of the partial prints: the frame, and of how many of its uppermost struts it is the largest piece. The paper's bunny
head is published nowhere; the head of this bunny has as many struts, 154, and one joint less, 58."""

CAMERA_SIZE = [3000, 4000]
"""Height and width of the pictures of the paper's real prints."""

WAYS: dict[str, dict[str, Any]] = {"plain": {"adapt": False}, "adapted": {"reprint": True, "compensate": False}}
"""Of printing: changes of `PlanOptions`."""


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes
    ----------
    experiment : the table or figure that it belongs to.
    name : its own, also of its file.
    kind : ``fit``, ``cube`` or ``print``; see `scripts.evidence.measure`.
    frame : path of the frame's file; empty for the cube.
    preset : way of fitting, or of printing.
    changes : of the preset's settings.
    simulation : settings of the simulation that differ.
    quick : whether its settings are reduced.
    """

    experiment: str
    name: str
    kind: str = "fit"
    frame: str = ""
    preset: str = "fast"
    changes: Mapping[str, Any] = field(default_factory=dict)
    simulation: Mapping[str, Any] = field(default_factory=dict)
    quick: bool = False

    @property
    def conditions(self) -> dict[str, Any]:
        """All of it but the place of the frame's file, which is another on every machine."""
        return {**asdict(self), "frame": frame_name(self.frame)}


@dataclass(frozen=True)
class Plan:
    """What is to be run.

    Attributes
    ----------
    quick : whether in half an hour, with reduced settings.
    frames : files of frames by name; those that are missing are left out.
    """

    quick: bool
    frames: Mapping[str, Path]

    def fit(self, experiment: str, name: str, frame: str, preset: str, **more: Any) -> Iterator[Case]:
        """A fit of a frame, if it is here; the paper's kinds with reduced settings where it shall be quick."""
        if frame not in self.frames:
            return
        changes = {**self.reduced(preset), **more.get("changes", {})}
        simulation = more.get("simulation", {})
        path = str(self.frames[frame])
        yield Case(experiment, name, "fit", path, preset, changes, simulation, self.quick)

    def reduced(self, preset: str) -> dict[str, Any]:
        """Changes of a preset's settings where it shall be quick."""
        return RIVAL_CHANGES.get(preset, QUICK_CHANGES) if self.quick and preset != "fast" else {}


def plan_of(quick: bool, pavilion: Path | None = None) -> Plan:
    """What can be run here; the Pavilion is known by its path alone."""
    frames = frame_files()
    return Plan(quick, frames if pavilion is None else {**frames, "Pavilion": pavilion})


def frame_name(path: str) -> str:
    """The name of a frame by its file, as in the tables."""
    return Path(path).stem.removeprefix("Node").removesuffix("_wireframe") if path else "cube"


PAPER_FRAMES = ("Femur", "Coral", "Lounge", "Pavilion")
"""Of table I."""


def table1(plan: Plan) -> Iterator[Case]:
    """The paper's frames, by its method and by ours."""
    for frame in PAPER_FRAMES:
        for preset in PRESETS:
            yield from plan.fit("table1", f"{frame}-{preset}", frame, preset)


def rivals(plan: Plan) -> Iterator[Case]:
    """The paper's frames by the methods that it compares with; Femur alone where it shall be quick."""
    for frame in ("Femur",) if plan.quick else PAPER_FRAMES:
        for preset in RIVALS:
            yield from plan.fit("rivals", f"{frame}-{preset}", frame, preset)


def partial(plan: Plan) -> Iterator[Case]:
    """Partial prints, in pictures as large as the paper's cameras take."""
    for name, (frame, part) in PARTIAL_FRAMES.items():
        for share in SHARES:
            for preset in PRESETS:
                simulation = {"printed": share, "size": CAMERA_SIZE, **part}
                yield from plan.fit("partial", f"{name}-{share:g}-{preset}", frame, preset, simulation=simulation)


def views(plan: Plan) -> Iterator[Case]:
    """Fewer cameras and more."""
    frame = "Pavilion" if "Pavilion" in plan.frames else "Femur"
    for count in VIEWS:
        for preset in PRESETS:
            yield from plan.fit("views", f"{count}-{preset}", frame, preset, simulation={"views": count})


def bending(plan: Plan) -> Iterator[Case]:
    """A half-printed frame without the bending term and with five weights of it."""
    for weight in WEIGHTS:
        changes, simulation = {"bending_weight": weight}, {"printed": 0.5}
        frame = "Femur" if plan.quick else "Coral"
        yield from plan.fit("bending", f"{weight:g}", frame, "paper", changes=changes, simulation=simulation)


def power(plan: Plan) -> Iterator[Case]:
    """How the bending term's weight grows with distance.

    With ever larger powers the weight vanishes wherever the distance to the print is below the unit of length, half
    the longest side, which is everywhere in a frame that is printed whole: then there is no bending term.
    """
    for p in POWERS:
        changes: dict[str, float] = {"bending_power": p} if p < float("inf") else {"bending_weight": 0.0}
        yield from plan.fit("power", f"{p:g}", "Femur", "paper", changes=changes)


def opacity(plan: Plan) -> Iterator[Case]:
    """Struts of which half is missing, with opacity learnt and not."""
    for learnt in (True, False):
        name, changes = "learnt" if learnt else "fixed", {"learn_opacity": learnt}
        yield from plan.fit("opacity", name, "Femur", "paper", changes=changes, simulation={"missing": 20})
    yield from plan.fit("opacity", "fast", "Femur", "fast", simulation={"missing": 20})


def cube(plan: Plan) -> Iterator[Case]:
    """A cube with one bent strut, judged from views that no fit has seen."""
    for preset in (*PRESETS, *RIVALS):
        changes: dict[str, Any] = {"image_scale": 0.25} if plan.quick and preset != "fast" else {}
        if plan.quick and preset in RIVALS:
            changes["iterations"] = CUBE_STEPS[preset]
        yield Case("cube", preset, "cube", "", preset, changes, quick=plan.quick)


def prints(plan: Plan) -> Iterator[Case]:
    """Simulated prints with adaptation and without."""
    for frame in ("bridge", "half_bowl"):
        for way in WAYS:
            path = str(plan.frames[frame])
            yield Case("prints", f"{frame}-{way}", "print", path, way, quick=plan.quick)


EXPERIMENTS = {
    "table1": table1,
    "rivals": rivals,
    "partial": partial,
    "views": views,
    "power": power,
    "bending": bending,
    "opacity": opacity,
    "cube": cube,
    "prints": prints,
}
"""By name, in the order in which they run."""


def cases_of(plan: Plan, only: tuple[str, ...] = ()) -> list[Case]:
    """All cases, or those of some experiments; of frames that are here."""
    wanted = only or tuple(EXPERIMENTS)
    return [case for name, cases in EXPERIMENTS.items() if name in wanted for case in cases(plan)]
