"""What is drawn for one sample, part by part."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, SerializerFunctionWrapHandler, model_serializer


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


class LensValues(_Values):
    """Of one sample: the model, and the coefficients of every camera in the order of `Camera.distortion`."""

    model: str
    coefficients: tuple[tuple[float, ...], ...]


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
    lens: LensValues | None = None

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return _without_none(handler(self), "lens")


class ErrorValues(_Values):
    """Of one sample; see `frametwin.dataset.recipe_looks.Errors`. ``bumped`` are numbers of views."""

    turned_deg: float
    moved_mm: float
    focal: float
    centre_px: float
    lens_ignored: bool
    bumped: tuple[int, ...]
    bumped_deg: float
    seed: int


class CalibrationValues(_Values):
    """Of one sample; see `frametwin.dataset.recipe_looks.Calibration`."""

    board: str
    block: str
    turn_deg: float
    lens_pictures: int
    moments: int
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
    calibration : pictures of boards beside the print's, where the recipe wants them.
    errors : how the stated cameras differ from the true ones, where the recipe wants that.
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
    errors: ErrorValues | None = None
    calibration: CalibrationValues | None = None

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return _without_none(_without_none(handler(self), "errors"), "calibration")


def _without_none(values: dict[str, Any], name: str) -> dict[str, Any]:
    """Values without one that is not there, as they were before there was such a field."""
    return {key: value for key, value in values.items() if key != name or value is not None}
