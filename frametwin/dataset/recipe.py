"""Recipes: TOML files that say what a dataset is drawn from. Every number may be a value or a ``[low, high]`` range."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from frametwin.dataset.recipe_looks import Calibration, Errors, Lens, Look
from frametwin.dataset.recipe_values import (
    Count,
    Degrees,
    Millimetres,
    Range,
    Refused,
    Share,
    Side,
    Table,
    Weight,
    limits,
)
from frametwin.errors import InputError
from frametwin.files import PathLike, read_text

FORMAT = "frametwin-recipe"
VERSION = 1
LIBRARY_RENDERER = "silhouette"
"""The style that needs no Blender: the library's own exact silhouettes."""


class FrameChoice(Table):
    """``[[frames]]``: a frame that samples may show.

    Attributes
    ----------
    frame : one of the project's own by name, or a file, relative to the recipe.
    weight : how often it is drawn, relative to the others.
    radius : strut radius in mm in place of the file's own.
    """

    frame: str = Field(min_length=1)
    weight: Weight = 1.0
    radius: float | None = Field(default=None, gt=0.0, le=1e3)


class Deformation(Table):
    """``[[deformations]]``: a way in which prints differ from their plans.

    Attributes
    ----------
    kind : ``sag`` (gravity, finite elements, some struts soft), ``tip-load`` (the top pushed sideways), ``warp`` (a
        random smooth field), ``none`` (only what drifts), or ``blend`` (an object that was bent in Blender).
    weight : how often it is drawn, relative to the others.
    peak_fraction : largest displacement as a share of the longest side of what is printed.
    unhardened : share of the struts that are soft.
    drift_mm, drift_deg : how far the base slides sideways and turns about the vertical, with the whole print.
    file, object : the .blend file, relative to the recipe, and the object in it, for ``blend``: its rest state is the
        plan, its evaluated state (modifiers, shape keys) the truth.
    timeline : first and last frame of the animation from which one is drawn, for ``blend``.
    engine : who solves the equations of ``sag`` and ``tip-load``. There is one; recipes may still name it, and the
        hashes of samples still count it.
    """

    kind: Literal["sag", "tip-load", "warp", "none", "blend"]
    weight: Weight = 1.0
    peak_fraction: Annotated[Range, limits(1e-4, 0.5)] = (0.03, 0.10)
    unhardened: Share = (0.25, 0.25)
    drift_mm: Millimetres = (0.0, 0.0)
    drift_deg: Degrees = (0.0, 0.0)
    file: str | None = None
    object: str | None = None
    timeline: tuple[int, int] | None = None
    engine: Literal["sparse"] = "sparse"

    @model_validator(mode="after")
    def _blend_names_a_file(self) -> Deformation:
        if self.kind == "blend" and not (self.file and self.object):
            raise Refused("name the .blend and the object in it", "the kind 'blend' needs file and object")
        if self.kind != "blend" and (self.file or self.object or self.timeline):
            raise Refused(f"file, object and timeline belong to the kind 'blend', not {self.kind!r}")
        if self.timeline is not None and self.timeline[0] > self.timeline[1]:
            raise Refused("give two rising numbers", "timeline is a first and a last frame")
        return self


class Printing(Table):
    """``[printing]``: how far the print has come, and what went wrong with single struts.

    Attributes
    ----------
    printed : share of the struts that is printed, from the ground up; without it, what the frame says.
    missing : how many printed struts broke off or stopped short.
    missing_share : how much of each of those is missing, of its length.
    thin : how many struts are under-extruded over about half of their length ("half-extruded").
    thin_to : what share of its radius such a stretch keeps.
    thickness_variation : standard deviation of the radius along every strut, as a share of it.
    """

    printed: Annotated[Range, limits(1e-6, 1.0)] | None = None
    missing: Count = (0, 0)
    missing_share: Annotated[Range, limits(1e-3, 1.0)] = (0.5, 0.5)
    thin: Count = (0, 0)
    thin_to: Annotated[Range, limits(0.05, 1.0)] = (0.5, 0.5)
    thickness_variation: Annotated[Range, limits(0.0, 0.3)] = (0.0, 0.0)


class Rig(Table):
    """``[rig]``: the cameras.

    Attributes
    ----------
    kind : ``ring``, ``dome``, or ``file`` (the cameras of a transforms.json, such as those of a real rig).
    views : number of cameras; several numbers give several samples of the same print, one for each.
    size : [height, width] of the pictures in pixels.
    elevation_deg : angles above the horizon; of a ring taken in turn, of a dome the lowest and highest.
    fov_deg : vertical field of view.
    margin : free share of the picture on each side.
    start_deg : azimuth of the first camera.
    jitter_mm, jitter_deg : how far each camera is off its place and its aim, at most; truth knows it.
    lens : of the cameras; without it they do not distort.
    file : the transforms.json, relative to the recipe.
    """

    kind: Literal["ring", "dome", "file"] = "ring"
    views: tuple[Annotated[int, Field(ge=2, le=1000, strict=True)], ...] = (8,)
    size: tuple[Side, Side] = (1200, 1600)
    elevation_deg: tuple[Annotated[float, Field(ge=-90.0, le=90.0)], ...] | None = None
    fov_deg: Annotated[Range, limits(1.0, 150.0)] = (40.0, 40.0)
    margin: float = Field(default=0.08, ge=0.0, lt=0.5)
    start_deg: Degrees = (0.0, 0.0)
    jitter_mm: float = Field(default=0.0, ge=0.0, le=1e3)
    jitter_deg: float = Field(default=0.0, ge=0.0, le=45.0)
    lens: Lens | None = None
    file: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_number_of_views(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("views"), int):
            return {**data, "views": [data["views"]]}
        return data

    @model_validator(mode="after")
    def _parts_fit(self) -> Rig:
        if not self.views:
            raise Refused("give a number of cameras, 8 are usual", "views is empty")
        if (self.kind == "file") != (self.file is not None):
            raise Refused("give both or neither", "the kind 'file' and the field file belong together")
        given = sorted(self.model_fields_set - {"kind", "file"})
        if self.kind == "file" and given:
            raise Refused(f"remove {', '.join(given)}", "the kind 'file' has all of the cameras from the file")
        if self.elevation_deg is not None and not self.elevation_deg:
            raise Refused("give angles, as [20, 45]", "elevation_deg is empty")
        if self.kind == "dome" and self.elevation_deg is not None and len(self.elevation_deg) != 2:
            raise Refused("give elevation_deg = [10, 70]", "a dome needs two elevations, the lowest and the highest")
        return self


class Render(Table):
    """``[render]``: what the pictures are.

    Attributes
    ----------
    style : ``mask`` (Blender, white on black), ``photo`` (Blender, with the same views without the frame), or
        ``silhouette`` (the library's own exact silhouettes, where there is no Blender).
    engine : of masks: ``workbench``, ``cycles``, or ``auto``, the faster one that is there.
    passes : also write depth, normals and strut indices of every view as multi-layer EXR.
    look : of photos.
    """

    style: Literal["mask", "photo", "silhouette"] = "mask"
    engine: Literal["auto", "workbench", "cycles"] = "auto"
    passes: bool = Field(default=False, strict=True)
    look: Look = Look()

    @model_validator(mode="after")
    def _passes_need_blender(self) -> Render:
        if self.passes and self.style == LIBRARY_RENDERER:
            raise Refused("take the style 'mask' or 'photo', or leave passes out", "passes are made by Blender")
        return self


class Recipe(Table):
    """A whole recipe; see the tables."""

    format: Literal["frametwin-recipe"]
    version: Literal[1]
    name: str = Field(min_length=1, max_length=100, pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]*$")
    description: str = ""
    licence: str = "CC0-1.0"
    count: int = Field(ge=1, le=1_000_000, strict=True)
    seed: int = Field(default=0, ge=0, strict=True)
    frames: tuple[FrameChoice, ...] = ()
    deformations: tuple[Deformation, ...] = Field(default=(Deformation(kind="sag"),), min_length=1)
    printing: Printing = Printing()
    rig: Rig = Rig()
    errors: Errors | None = None
    calibration: Calibration | None = None
    render: Render = Render()

    @model_validator(mode="after")
    def _boards_need_blender(self) -> Recipe:
        if self.calibration is not None and self.render.style == LIBRARY_RENDERER:
            raise Refused("take the style 'mask' or 'photo', or leave it out", "[calibration] is made by Blender")
        return self

    @model_validator(mode="after")
    def _lens_is_rendered(self) -> Recipe:
        if self.errors is not None and self.errors.lens_ignored and self.rig.lens is None and self.rig.file is None:
            raise Refused("give [rig.lens], or leave it out", "errors.lens_ignored needs a lens that distorts")
        return self

    @model_validator(mode="after")
    def _frames_are_named(self) -> Recipe:
        if not self.frames and any(deformation.kind != "blend" for deformation in self.deformations):
            raise Refused("name at least one frame under [[frames]]", "frames is missing")
        return self

    @property
    def needs_blender(self) -> bool:
        """Whether samples cannot be made without Blender."""
        return self.render.style != LIBRARY_RENDERER or any(d.kind == "blend" for d in self.deformations)


@dataclass(frozen=True)
class RecipeFile:
    """A recipe and the file that it was read from, to which its paths are relative."""

    recipe: Recipe
    path: Path

    def resolve(self, name: str) -> Path:
        """A path of the recipe, as it is on this machine."""
        return (self.path.parent / name).resolve()

    @property
    def digest(self) -> str:
        """SHA-256 of what is in the recipe, whatever the layout of its file."""
        return hashlib.sha256(self.recipe.model_dump_json().encode()).hexdigest()


def read_recipe(path: PathLike) -> RecipeFile:
    """Read a recipe.

    Raises
    ------
    InputError
        If the file is missing, no TOML, or a field is missing, unknown or out of range.
    """
    text = read_text(path)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError.at(path, "file", f"is not TOML ({error})", "correct the text there") from error
    return RecipeFile(parse_recipe(data, path), Path(path))


def parse_recipe(data: dict[str, Any], path: PathLike) -> Recipe:
    """Check the content of a recipe; ``path`` is named in errors."""
    try:
        return Recipe.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise InputError.at(path, _field(first["loc"]), *_problem(first)) from error


def as_noted(table: Table, noted: Mapping[str, Any], apart: Collection[str] = ()) -> bool:
    """Whether a recipe, or a table of it, is the one that a dataset has noted as JSON.

    Parameters
    ----------
    table
        What is wanted now.
    noted
        What was written, maybe by a version that lacked some fields: those are as if they stood there by default.
    apart
        Fields that do not count.
    """
    plain, kinds = table.model_dump(mode="json"), type(table).model_fields
    for name, kind in kinds.items():
        value = getattr(table, name)
        if name in apart:
            continue
        if name not in noted:
            same = value == kind.get_default(call_default_factory=True)
        elif isinstance(value, Table) and isinstance(noted[name], Mapping):
            same = as_noted(value, noted[name])
        else:
            same = plain[name] == noted[name]
        if not same:
            return False
    return noted.keys() <= kinds.keys()


def _field(location: Sequence[int | str]) -> str:
    """The name of a field as it would be written: ``deformations[1].kind``."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text or "file"


def _problem(error: Any) -> tuple[str, str]:
    """Problem and remedy in words."""
    kind, value = error["type"], error["input"]
    if kind == "missing":
        return "is missing", "add it"
    if kind == "extra_forbidden":
        return "is not known", "remove it, or correct its name"
    if kind == "value_error":
        refused: Refused = error["ctx"]["error"]
        return refused.problem or ("is wrong" if isinstance(value, dict) else f"is {value!r}"), refused.remedy
    message = str(error["msg"])
    shown = repr(value) if len(repr(value)) <= 60 else repr(value)[:57] + "..."
    return f"is {shown}", message[0].lower() + message[1:]
