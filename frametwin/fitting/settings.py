"""Settings of a fit, in one frozen dataclass, and the presets that name useful sets of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from frametwin.errors import InputError
from frametwin.fitting.changes import Changeable

FIELD_KINDS = ("network", "lattice", "free", "nodes")
DECAYS = ("cosine", "geometric")


@dataclass(frozen=True)
class FitSettings(Changeable):
    """Settings of a fit by splatting; the defaults are the paper's (sections V.C and V.D).

    Learning rates and displacements are in units of half the longest side of the computational domain, as the
    network's output is; angles are in radians, opacity is learnt as a logit and thickness as a logarithm.

    Attributes
    ----------
    preset : the name of the set these settings come from.
    seed : of everything random: first weights of the network, points of the bending term.
    iterations : steps of Adam.
    image_scale : share of the pictures' own width and height that is used, above 0, at most 1.
    samples : m, intervals between samples on each strut, from which its control points are fitted.
    kernels_per_strut : K; the largest number where it adapts.
    adaptive_kernels : whether short or thin struts take fewer kernels.
    spread : sigma_t as a multiple of the spacing of the kernels.
    pixel_variance : low-pass of the pictures in pixel^2.
    field : what carries the deformation, one of `FIELD_KINDS`.
    domain_margin : how far the computational domain reaches beyond the frame, as a share of its longest side.
    learning_rate, learning_rate_end : of the field, at the first and the last step.
    decay : how it falls between them, one of `DECAYS`.
    learn_thickness, thickness_rate : whether tau is learnt for each kernel, and how fast.
    learn_opacity, opacity_rate : whether alpha is learnt for each kernel, and how fast.
    opacity_start : alpha at the start, above 0 and below 1.
    bending_weight, bending_power, bending_samples : omega, p and the random points a step of the bending
        term.
    lattice_cells : cells along the longest side in each level, for the lattice.
    node_count, node_neighbours : control nodes, and how many of them a point follows, for the nodes.

    Raises
    ------
    InputError
        If a value is out of its range; the message names the setting.
    """

    preset: str = "paper"
    seed: int = 0
    iterations: int = 150
    image_scale: float = 1.0
    samples: int = 50
    kernels_per_strut: int = 20
    adaptive_kernels: bool = False
    spread: float = 1.0
    pixel_variance: float = 1.0 / 12.0
    field: str = "network"
    domain_margin: float = 0.1
    learning_rate: float = 1.6e-4
    learning_rate_end: float = 1.6e-5
    decay: str = "cosine"
    learn_thickness: bool = True
    thickness_rate: float = 5e-3
    learn_opacity: bool = True
    opacity_rate: float = 2.5e-2
    opacity_start: float = 0.9
    bending_weight: float = 1e-7
    bending_power: float = 2.0
    bending_samples: int = 2048
    lattice_cells: tuple[int, ...] = (1, 3, 6)
    node_count: int = 256
    node_neighbours: int = 4

    def __post_init__(self) -> None:
        for name, (low, high) in _WHOLE.items():
            _check_whole(name, getattr(self, name), low, high)
        for name, (least, most) in _REAL.items():
            _check_real(name, getattr(self, name), least, most)
        for name in ("adaptive_kernels", "learn_thickness", "learn_opacity"):
            if not isinstance(getattr(self, name), bool):
                raise _wrong(name, f"is {getattr(self, name)!r}", "give true or false")
        for name, choices in (("field", FIELD_KINDS), ("decay", DECAYS)):
            if getattr(self, name) not in choices:
                raise _wrong(name, f"is {getattr(self, name)!r}", f"give one of {', '.join(choices)}")
        if not isinstance(self.lattice_cells, tuple | list) or not self.lattice_cells:
            problem = f"is {self.lattice_cells!r}"
            raise _wrong("lattice_cells", problem, "give the cells of one level or more, such as 1, 3, 6")
        for cells in self.lattice_cells:
            _check_whole("lattice_cells", cells, 1, 64)
        if self.learning_rate_end > self.learning_rate:
            raise _wrong("learning_rate_end", "is above learning_rate", "give a rate that falls")
        object.__setattr__(self, "lattice_cells", tuple(self.lattice_cells))


PRESETS: dict[str, dict[str, Any]] = {
    "paper": {},
    "paper-lattice": {"field": "lattice", "learning_rate": 4e-3, "learning_rate_end": 4e-4},
    "curve-driven": {
        "field": "free",
        "learning_rate": 2e-3,
        "learning_rate_end": 2e-4,
        "bending_weight": 0.0,
    },
    "deformation-driven": {
        "field": "nodes",
        "learning_rate": 2e-3,
        "learning_rate_end": 2e-4,
        "bending_weight": 0.0,
    },
}
"""Changes to the paper's settings by name: none, a lattice, and the two methods it compares with."""


def preset(name: str, **changes: Any) -> FitSettings:
    """Settings by name.

    Parameters
    ----------
    name : one of `PRESETS`.
    **changes : settings that shall differ.

    Raises
    ------
    InputError
        If the name or a setting is unknown, or a value is out of its range.
    """
    if name not in PRESETS:
        raise _wrong("preset", f"{name!r} is unknown", f"give one of {', '.join(PRESETS)}")
    return FitSettings().replace(**{"preset": name, **PRESETS[name], **changes})


_WHOLE = {
    "seed": (0, 2**63 - 1),
    "iterations": (1, 1_000_000),
    "samples": (3, 1000),
    "kernels_per_strut": (1, 1000),
    "bending_samples": (1, 10_000_000),
    "node_count": (1, 100_000),
    "node_neighbours": (1, 64),
}
_REAL = {
    "image_scale": (1e-3, 1.0),
    "spread": (0.05, 10.0),
    "pixel_variance": (0.0, 1e4),
    "domain_margin": (1e-3, 10.0),
    "learning_rate": (1e-12, 10.0),
    "learning_rate_end": (1e-12, 10.0),
    "thickness_rate": (1e-12, 10.0),
    "opacity_rate": (1e-12, 10.0),
    "opacity_start": (0.01, 0.99),
    "bending_weight": (0.0, 1e12),
    "bending_power": (1e-3, 16.0),
}


def _wrong(name: str, problem: str, remedy: str) -> InputError:
    return InputError.at("settings", name, problem, remedy)


def _check_whole(name: str, value: Any, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise _wrong(name, f"is {value!r}", f"give a whole number from {low} to {high}")


def _check_real(name: str, value: Any, low: float, high: float) -> None:
    fine = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not fine or not low <= value <= high:
        raise _wrong(name, f"is {value!r}", f"give a number from {low:g} to {high:g}")
