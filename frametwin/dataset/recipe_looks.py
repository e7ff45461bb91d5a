"""Tables of recipes on how pictures vary: looks of photos, lenses, and errors of cameras."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from frametwin.calibration.boards import parse_board
from frametwin.dataset.recipe_values import Count, Degrees, Millimetres, Range, Refused, Share, Table, limits
from frametwin.errors import InputError

PLASTICS: dict[str, tuple[float, float, float]] = {
    "white": (0.80, 0.80, 0.78),
    "grey": (0.30, 0.30, 0.30),
    "dark": (0.012, 0.012, 0.013),
    "orange": (0.70, 0.20, 0.03),
    "red": (0.45, 0.03, 0.03),
    "green": (0.08, 0.35, 0.10),
    "blue": (0.05, 0.12, 0.50),
    "yellow": (0.75, 0.55, 0.05),
}
"""Reflectance of filaments, linear RGB."""

TABLES: dict[str, tuple[float, float, float]] = {
    "blue": (0.006, 0.035, 0.20),
    "black": (0.01, 0.01, 0.01),
    "grey": (0.18, 0.18, 0.18),
    "white": (0.70, 0.70, 0.68),
    "wood": (0.30, 0.16, 0.07),
    "green": (0.03, 0.12, 0.05),
}
"""Reflectance of tables, linear RGB."""

Plastic = Literal["natural", "white", "grey", "dark", "orange", "red", "green", "blue", "yellow"]
TableName = Literal["blue", "black", "grey", "white", "wood", "green"]
Coefficient = Annotated[Range, limits(-1.0, 1.0)]
Stops = Annotated[Range, limits(-5.0, 5.0)]


class Look(Table):
    """``[render.look]``: how photos vary; samples draw from these ranges. See `frametwin.capture.scene.PhotoLook`.

    Attributes
    ----------
    plastics : filaments, of which each sample has one; ``natural`` is a warm white of the grey ``strut_grey``.
    tables : tables, of which each sample has one.
    clutter : how many things stand on the table beside the print; seen in the pictures without it as well.
    exposure_spread : standard deviation of the exposures of single views, stops.
    layered, samples : how photos are rendered.
    """

    plastics: tuple[Plastic, ...] = Field(default=("natural",), min_length=1)
    strut_grey: Annotated[Range, limits(0.3, 1.0)] = (0.72, 0.82)
    strut_roughness: Share = (0.55, 0.55)
    layer_bump: Share = (0.1, 0.4)
    layer_colour: Annotated[Range, limits(0.0, 0.5)] = (0.02, 0.08)
    tables: tuple[TableName, ...] = Field(default=("blue",), min_length=1)
    clutter: Annotated[Count, limits(0, 40)] = (0, 0)
    key: Annotated[Range, limits(0.0, 10.0)] = (1.4, 1.8)
    rim: Annotated[Range, limits(0.0, 10.0)] = (0.7, 0.7)
    fill: Annotated[Range, limits(0.0, 3.0)] = (0.5, 0.6)
    light_azimuth: Degrees = (0.0, 360.0)
    light_elevation: Annotated[Range, limits(5.0, 90.0)] = (55.0, 55.0)
    light_side: Annotated[Range, limits(0.02, 4.0)] = (2.0, 2.0)
    exposure: Stops = (-0.1, 0.1)
    exposure_spread: Annotated[Range, limits(0.0, 2.0)] = (0.0, 0.0)
    reference_exposure: Stops = (0.0, 0.0)
    reference_turn: Annotated[Range, limits(-180.0, 180.0)] = (0.0, 0.0)
    defocus: Annotated[Range, limits(0.0, 10.0)] = (0.0, 0.0)
    vignetting: Annotated[Range, limits(0.0, 0.9)] = (0.0, 0.0)
    electrons: Annotated[Range, limits(100.0, 1e6)] = (6000.0, 12000.0)
    read_noise: Annotated[Range, limits(0.0, 1000.0)] = (8.0, 16.0)
    samples: int = Field(default=6, ge=1, le=4096, strict=True)
    layered: bool = Field(default=True, strict=True)


class Lens(Table):
    """``[rig.lens]``: lenses that distort; every camera draws its own coefficients.

    Attributes
    ----------
    model : ``OPENCV`` or ``OPENCV_FISHEYE``.
    k1, k2, k3, k4, p1, p2 : OpenCV's coefficients; ``k4`` is a fisheye's, ``p1`` and ``p2`` are not.
    """

    model: Literal["OPENCV", "OPENCV_FISHEYE"] = "OPENCV"
    k1: Coefficient = (0.0, 0.0)
    k2: Coefficient = (0.0, 0.0)
    k3: Coefficient = (0.0, 0.0)
    k4: Coefficient = (0.0, 0.0)
    p1: Annotated[Range, limits(-0.1, 0.1)] = (0.0, 0.0)
    p2: Annotated[Range, limits(-0.1, 0.1)] = (0.0, 0.0)

    @model_validator(mode="after")
    def _coefficients_belong_to_the_model(self) -> Lens:
        strange = {"k4"} if self.model == "OPENCV" else {"p1", "p2"}
        given = sorted(strange & self.model_fields_set)
        if given:
            raise Refused(f"remove {', '.join(given)}", f"the model {self.model} has no {' and '.join(given)}")
        return self


class Calibration(Table):
    """``[calibration]``: photographs of a board and a block by the sample's own cameras, made by Blender.

    Attributes
    ----------
    board, block : as ``frametwin calibrate`` has them on its command line; the block is a cuboid.
    block_turn_deg : how the block is turned about the vertical; it stands in the middle of the print's place.
    lens_pictures : of the board before each camera.
    moments : at which all cameras see the board.
    """

    board: str = "charuco:7x5:24:18:4X4_250"
    block: str = "cuboid:50x60x70:14:10:4X4_100"
    block_turn_deg: Degrees = (0.0, 360.0)
    lens_pictures: int = Field(default=16, ge=3, le=200, strict=True)
    moments: int = Field(default=12, ge=1, le=200, strict=True)

    @model_validator(mode="after")
    def _boards_are_boards(self) -> Calibration:
        for field, text in (("board", self.board), ("block", self.block)):
            try:
                board = parse_board(text)
            except InputError as error:
                raise Refused(error.remedy, f"{field} {text!r} {error.problem}") from error
            if (board.kind == "cuboid") != (field == "block"):
                wanted = "a cuboid, as cuboid:50x60x70" if field == "block" else "a flat board, as charuco:7x5:24:18"
                raise Refused(f"give {wanted}", f"{field} is {text!r}")
        return self


class Errors(Table):
    """``[errors]``: how the cameras that a sample states differ from the true ones, which it states beside.

    Attributes
    ----------
    turned_deg, moved_mm : how far each camera is turned about its centre, and moved, in a direction of its own.
    focal : share by which each focal length is off, up or down.
    centre_px : how far each principal point is off, in a direction of its own.
    lens_ignored : whether the cameras are stated as if they did not distort.
    bumped, bumped_deg : how many cameras were turned by so much more.
    """

    turned_deg: Annotated[Range, limits(0.0, 45.0)] = (0.0, 0.0)
    moved_mm: Millimetres = (0.0, 0.0)
    focal: Annotated[Range, limits(0.0, 0.5)] = (0.0, 0.0)
    centre_px: Annotated[Range, limits(0.0, 1e3)] = (0.0, 0.0)
    lens_ignored: bool = Field(default=False, strict=True)
    bumped: Annotated[Count, limits(0, 100)] = (0, 0)
    bumped_deg: Annotated[Range, limits(0.0, 45.0)] = (2.0, 2.0)
