"""Drawing the parts of a sample from a recipe's tables; every part has a stream of random numbers of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frametwin.cameras.camera import DISTORTION_KEYS
from frametwin.dataset.recipe import Deformation, Printing, Render, Rig
from frametwin.dataset.recipe_looks import PLASTICS, TABLES, Calibration, Errors, Lens, Look
from frametwin.dataset.specification_values import (
    CalibrationValues,
    DeformationValues,
    ErrorValues,
    LensValues,
    PrintingValues,
    RenderValues,
    RigValues,
)

MORE_LOOKS = (
    "strut_roughness", "rim", "light_elevation", "light_side", "reference_exposure", "reference_turn", "defocus",
    "vignetting",
)  # fmt: skip
"""Of photos too, drawn after those, for these came later."""

LOOKS = ("layer_bump", "layer_colour", "key", "fill", "light_azimuth", "exposure", "electrons", "read_noise")
"""Of photos, in the order in which they are drawn."""

TINT = 0.975
"""Blue of the plastic relative to its red and green: natural PLA is a little warm."""

THING_WIDTH, THING_HEIGHT, THING_REACH = (0.05, 0.3), (0.05, 0.4), 0.8
"""Of clutter, and how far beyond the print it may stand; in sizes of the frame."""

DIGITS = 6
"""Significant digits of what is drawn: enough for everything, and the same text on every machine."""


def draw_deformation(rng: np.random.Generator, table: Deformation) -> DeformationValues:
    """How the print is bent, and where its base drifts."""
    peak, unhardened = uniform(rng, table.peak_fraction), uniform(rng, table.unhardened)
    way, far = uniform(rng, (0.0, 360.0)), uniform(rng, table.drift_mm)
    low, high = table.drift_deg
    turn = uniform(rng, (low, high)) * (1.0 if rng.random() < 0.5 else -1.0)
    seed, angle = seed_of(rng), np.radians(uniform(rng, (0.0, 360.0)))
    moment = int(rng.integers(table.timeline[0], table.timeline[1] + 1)) if table.timeline else None
    return DeformationValues(
        kind=table.kind,
        peak_fraction=peak,
        unhardened=unhardened,
        direction_deg=way,
        drift_mm=(rounded(far * np.cos(angle)), rounded(far * np.sin(angle))),
        drift_deg=rounded(turn),
        seed=seed,
        object=table.object,
        timeline_frame=moment,
        engine=table.engine,
    )


def draw_rig(streams: Mapping[str, np.random.Generator], table: Rig, views: int) -> RigValues:
    """The cameras."""
    rng = streams["rig"]
    return RigValues(
        kind=table.kind,
        views=views,
        size=table.size,
        elevation_deg=table.elevation_deg,
        fov_deg=uniform(rng, table.fov_deg),
        margin=table.margin,
        start_deg=uniform(rng, table.start_deg),
        jitter_mm=table.jitter_mm,
        jitter_deg=table.jitter_deg,
        seed=seed_of(rng),
        lens=None if table.lens is None else _draw_lens(streams["lens"], table.lens, views),
    )


def _draw_lens(rng: np.random.Generator, table: Lens, views: int) -> LensValues:
    keys = DISTORTION_KEYS[table.model]
    drawn = tuple(tuple(uniform(rng, getattr(table, key)) for key in keys) for _ in range(views))
    return LensValues(model=table.model, coefficients=drawn)


def draw_calibration(rng: np.random.Generator, table: Calibration) -> CalibrationValues:
    """The boards that are photographed."""
    return CalibrationValues(
        board=table.board,
        block=table.block,
        turn_deg=float(f"{uniform(rng, table.block_turn_deg):.1f}"),
        lens_pictures=table.lens_pictures,
        moments=table.moments,
        seed=seed_of(rng),
    )


def draw_errors(rng: np.random.Generator, table: Errors, views: int) -> ErrorValues:
    """How the stated cameras differ from the true ones."""
    sizes = {name: uniform(rng, getattr(table, name)) for name in ("turned_deg", "moved_mm", "focal", "centre_px")}
    count, bumped_deg, seed = min(whole(rng, table.bumped), views), uniform(rng, table.bumped_deg), seed_of(rng)
    return ErrorValues(
        **sizes,
        lens_ignored=table.lens_ignored,
        bumped=tuple(sorted(int(view) for view in rng.choice(views, count, replace=False))),
        bumped_deg=bumped_deg,
        seed=seed,
    )


def draw_render(rng: np.random.Generator, table: Render, views: int) -> RenderValues:
    """What the pictures are, and of photos their look."""
    look: dict[str, Any] = {}
    if table.style == "photo":
        grey = uniform(rng, table.look.strut_grey)
        look["strut_colour"] = [grey, grey, rounded(TINT * grey)]
        look |= {name: uniform(rng, getattr(table.look, name)) for name in LOOKS}
        look |= {"samples": table.look.samples, "seed": seed_of(rng), "layered": table.look.layered}
        look |= {name: uniform(rng, getattr(table.look, name)) for name in MORE_LOOKS}
        look |= _draw_choices(rng, table.look, look["strut_colour"], views)
    return RenderValues(style=table.style, engine=table.engine, passes=table.passes, look=look)


def _draw_choices(rng: np.random.Generator, table: Look, natural: list[float], views: int) -> dict[str, Any]:
    """What is chosen from lists, or drawn several times: plastic, table, exposures of single views, clutter."""
    plastic, painted = (names[int(rng.integers(len(names)))] for names in (table.plastics, table.tables))
    spread = uniform(rng, table.exposure_spread)
    stops = [rounded(float(np.clip(spread * rng.normal(), -5.0, 5.0))) for _ in range(views)]
    return {
        "strut_colour": natural if plastic == "natural" else list(PLASTICS[plastic]),
        "table_colour": list(TABLES[painted]),
        "view_exposures": stops if spread else [],
        "clutter": [_draw_thing(rng) for _ in range(whole(rng, table.clutter))],
    }


def _draw_thing(rng: np.random.Generator) -> list[float]:
    """A `Piece` of clutter, clear of the print, which stands within half a size of the middle."""
    width, height = uniform(rng, THING_WIDTH), uniform(rng, THING_HEIGHT)
    way, far = uniform(rng, (0.0, 2.0 * np.pi)), 0.5 + 0.75 * width + uniform(rng, (0.0, THING_REACH))
    shape, turn = whole(rng, (0, 2)), uniform(rng, (0.0, 360.0))
    place = [rounded(far * np.cos(way)), rounded(far * np.sin(way))]
    return [shape, *place, width, width if shape == 2 else height, turn, *(uniform(rng, (0.02, 0.8)) for _ in "rgb")]


def weighted(rng: np.random.Generator, choices: Any) -> int:
    """Index of one of several tables with a ``weight``."""
    weights = np.array([choice.weight for choice in choices])
    return int(
        np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right").clip(0, len(weights) - 1)
    )


def uniform(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    """A number of a range, always at the cost of one draw."""
    return rounded(bounds[0] + (bounds[1] - bounds[0]) * rng.random())


def rounded(value: float) -> float:
    """A number with the digits that are kept."""
    return float(f"{value:.{DIGITS}g}") + 0.0  # no minus before a zero


def whole(rng: np.random.Generator, bounds: tuple[int, int]) -> int:
    """A whole number of a range."""
    return int(rng.integers(bounds[0], bounds[1] + 1))


def seed_of(rng: np.random.Generator) -> int:
    """A seed for what is drawn later."""
    return int(rng.integers(2**31))


def draw_printing(rng: np.random.Generator, table: Printing) -> PrintingValues:
    """How far the print has come, and what is wrong with it."""
    printed = uniform(rng, table.printed or (1.0, 1.0))
    return PrintingValues(
        printed=None if table.printed is None else printed,
        missing=whole(rng, table.missing),
        missing_share=uniform(rng, table.missing_share),
        thin=whole(rng, table.thin),
        thin_to=uniform(rng, table.thin_to),
        thickness_variation=uniform(rng, table.thickness_variation),
        seed=seed_of(rng),
    )
