"""What one sample is: drawn from the recipe by the dataset's seed and the sample's index, and by nothing else.

Every part of a sample has a stream of random numbers of its own, spawned from the seed and the number of the scene, so
that a recipe that asks for other cameras still shows the same prints.
"""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from frametwin.capture.transforms import read_cameras
from frametwin.dataset.recipe import Deformation, RecipeFile, Render, Rig
from frametwin.errors import InputError
from frametwin.files import PathLike, dump_json, file_hash
from frametwin.formats import find_frame, frame_json
from frametwin.geometry.parametric import FRAMES
from frametwin.geometry.wireframe import Wireframe

PARTS = ("frame", "deformation", "printing", "rig", "look")
"""The streams, in the order in which they are spawned."""

LOOKS = ("layer_bump", "layer_colour", "key", "fill", "light_azimuth", "exposure", "electrons", "read_noise")
"""Of photos, in the order in which they are drawn."""

TINT = 0.975
"""Blue of the plastic relative to its red and green: natural PLA is a little warm."""

DIGITS = 6
"""Significant digits of what is drawn: enough for everything, and the same text on every machine."""


class _Values(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class DeformationValues(_Values):
    """Of one sample; see `frametwin.dataset.recipe.Deformation`."""

    kind: str
    peak_fraction: float
    unhardened: float
    direction_deg: float
    drift_mm: tuple[float, float]
    drift_deg: float
    seed: int
    object: str | None = None
    timeline_frame: int | None = None
    engine: str = "sparse"


class PrintingValues(_Values):
    """Of one sample; see `frametwin.dataset.recipe.Printing`."""

    printed: float | None
    missing: int
    missing_share: float
    thin: int
    thin_to: float
    thickness_variation: float
    seed: int


class RigValues(_Values):
    """Of one sample; see `frametwin.dataset.recipe.Rig`."""

    kind: str
    views: int
    size: tuple[int, int]
    elevation_deg: tuple[float, ...] | None
    fov_deg: float
    margin: float
    start_deg: float
    jitter_mm: float
    jitter_deg: float
    seed: int


class RenderValues(_Values):
    """Of one sample; see `frametwin.dataset.recipe.Render`."""

    style: str
    engine: str
    passes: bool
    look: dict[str, Any] = {}


class Specification(_Values):
    """Everything about a sample that is decided before it is made. Sources are named by file name and content hash.

    Attributes
    ----------
    index, scene : number of the sample, and of the print that it shows (several samples may show one print).
    frame, frame_sha256 : the plan (or the .blend file that holds it) and the hash of its content.
    radius : strut radius in mm in place of the frame's own.
    rig_sha256 : hash of the file with the cameras, where there is one.
    """

    index: int
    scene: int
    frame: str
    frame_sha256: str
    radius: float | None
    deformation: DeformationValues
    printing: PrintingValues
    rig: RigValues
    rig_sha256: str | None
    render: RenderValues


class Sampler:
    """Draws the specifications of a recipe's samples.

    Parameters
    ----------
    source
        The recipe.
    seed
        In place of the recipe's own.

    Raises
    ------
    InputError
        If a file that the recipe names is missing or damaged.
    """

    def __init__(self, source: RecipeFile, seed: int | None = None) -> None:
        self.source = source
        self.recipe = source.recipe
        self.seed = self.recipe.seed if seed is None else seed
        self.frames = [self._frame(choice.frame, i) for i, choice in enumerate(self.recipe.frames)]
        self._blends = {
            d.file: (self.source.resolve(d.file), _sha256(self.source.resolve(d.file), source.path, "deformations"))
            for d in self.recipe.deformations
            if d.file is not None
        }

        if self.rig_file is not None:
            read_cameras(self.rig_file[0])  # told now, and not once a sample

    @cached_property
    def rig_file(self) -> tuple[Path, str] | None:
        """The file with the cameras, and its hash."""
        if self.recipe.rig.file is None:
            return None
        path = self.source.resolve(self.recipe.rig.file)
        return path, _sha256(path, self.source.path, "rig.file")

    def _frame(self, name: str, i: int) -> tuple[Wireframe, str]:
        if name not in FRAMES and not self.source.resolve(name).exists():
            problem = f"there is no frame {name!r} beside the recipe, nor one of the project's own of that name"
            remedy = f"correct the path, or name one of {', '.join(FRAMES)}"
            raise InputError.at(self.source.path, f"frames[{i}].frame", problem, remedy)
        frame = find_frame(name, self.source.path.parent.resolve())
        return frame, hashlib.sha256(dump_json(frame_json.to_dict(frame)).encode()).hexdigest()

    def specification(self, index: int) -> Specification:
        """What the sample of this index is."""
        variants = len(self.recipe.rig.views)
        scene = index // variants
        streams = np.random.SeedSequence([self.seed, scene]).spawn(len(PARTS))
        rng = {part: np.random.Generator(np.random.Philox(s)) for part, s in zip(PARTS, streams, strict=True)}
        choice = _weighted(rng["deformation"], self.recipe.deformations)
        deformation = self.recipe.deformations[choice]
        frame, digest, radius = self._choose_frame(rng["frame"], deformation)
        return Specification(
            index=index,
            scene=scene,
            frame=frame,
            frame_sha256=digest,
            radius=radius,
            deformation=_draw_deformation(rng["deformation"], deformation),
            printing=self._draw_printing(rng["printing"]),
            rig=_draw_rig(rng["rig"], self.recipe.rig, self.recipe.rig.views[index % variants]),
            rig_sha256=None if self.rig_file is None else self.rig_file[1],
            render=_draw_render(rng["look"], self.recipe.render),
        )

    def plan(self, specification: Specification) -> Wireframe:
        """The plan that a specification names, with its radius; not for those that come from a .blend."""
        for frame, digest in self.frames:
            if digest == specification.frame_sha256:
                radius = specification.radius
                return frame if radius is None else frame.replace(radius=np.full(frame.strut_count, radius))
        raise LookupError(specification.frame)

    def blend_file(self, specification: Specification) -> Path | None:
        """The .blend that holds plan and truth of a sample, if it comes from one."""
        if specification.deformation.kind != "blend":
            return None
        return next(path for path, digest in self._blends.values() if digest == specification.frame_sha256)

    def _choose_frame(self, rng: np.random.Generator, deformation: Deformation) -> tuple[str, str, float | None]:
        if deformation.file is not None:
            path, digest = self._blends[deformation.file]
            return path.name, digest, None
        i = _weighted(rng, self.recipe.frames)
        choice = self.recipe.frames[i]
        return Path(choice.frame).name, self.frames[i][1], choice.radius

    def _draw_printing(self, rng: np.random.Generator) -> PrintingValues:
        table = self.recipe.printing
        printed = _uniform(rng, table.printed or (1.0, 1.0))
        return PrintingValues(
            printed=None if table.printed is None else printed,
            missing=_whole(rng, table.missing),
            missing_share=_uniform(rng, table.missing_share),
            thin=_whole(rng, table.thin),
            thin_to=_uniform(rng, table.thin_to),
            thickness_variation=_uniform(rng, table.thickness_variation),
            seed=_seed(rng),
        )


def _draw_deformation(rng: np.random.Generator, table: Deformation) -> DeformationValues:
    peak, unhardened = _uniform(rng, table.peak_fraction), _uniform(rng, table.unhardened)
    way, far = _uniform(rng, (0.0, 360.0)), _uniform(rng, table.drift_mm)
    low, high = table.drift_deg
    turn = _uniform(rng, (low, high)) * (1.0 if rng.random() < 0.5 else -1.0)
    seed, angle = _seed(rng), np.radians(_uniform(rng, (0.0, 360.0)))
    moment = int(rng.integers(table.timeline[0], table.timeline[1] + 1)) if table.timeline else None
    return DeformationValues(
        kind=table.kind,
        peak_fraction=peak,
        unhardened=unhardened,
        direction_deg=way,
        drift_mm=(_rounded(far * np.cos(angle)), _rounded(far * np.sin(angle))),
        drift_deg=_rounded(turn),
        seed=seed,
        object=table.object,
        timeline_frame=moment,
        engine=table.engine,
    )


def _draw_rig(rng: np.random.Generator, table: Rig, views: int) -> RigValues:
    return RigValues(
        kind=table.kind,
        views=views,
        size=table.size,
        elevation_deg=table.elevation_deg,
        fov_deg=_uniform(rng, table.fov_deg),
        margin=table.margin,
        start_deg=_uniform(rng, table.start_deg),
        jitter_mm=table.jitter_mm,
        jitter_deg=table.jitter_deg,
        seed=_seed(rng),
    )


def _draw_render(rng: np.random.Generator, table: Render) -> RenderValues:
    look: dict[str, Any] = {}
    if table.style == "photo":
        grey = _uniform(rng, table.look.strut_grey)
        look["strut_colour"] = [grey, grey, _rounded(TINT * grey)]
        look |= {name: _uniform(rng, getattr(table.look, name)) for name in LOOKS}
        look |= {"samples": table.look.samples, "seed": _seed(rng)}
    return RenderValues(style=table.style, engine=table.engine, passes=table.passes, look=look)


def _weighted(rng: np.random.Generator, choices: Any) -> int:
    """Index of one of several tables with a ``weight``."""
    weights = np.array([choice.weight for choice in choices])
    return int(
        np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right").clip(0, len(weights) - 1)
    )


def _uniform(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    """A number of a range, always at the cost of one draw."""
    return _rounded(bounds[0] + (bounds[1] - bounds[0]) * rng.random())


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") + 0.0  # no minus before a zero


def _whole(rng: np.random.Generator, bounds: tuple[int, int]) -> int:
    return int(rng.integers(bounds[0], bounds[1] + 1))


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def _sha256(path: Path, recipe: PathLike, field: str) -> str:
    if not path.is_file():
        remedy = "correct the path, which counts from the recipe"
        raise InputError.at(recipe, field, f"there is no file {path}", remedy)
    return file_hash(path, "make it readable")
