"""Settings of a fit, in one frozen dataclass, and the presets that name useful sets of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from frametwin.errors import InputError
from frametwin.fields.network_options import ENCODINGS, INITIAL_WEIGHTS
from frametwin.fitting.changes import Changeable
from frametwin.ranges import check_settings, in_words, one_of, some, within

FIELD_KINDS = ("network", "lattice", "free", "nodes")
DECAYS = ("cosine", "geometric")
IMAGE_LOSSES = ("mean", "sum")

Rate = Annotated[float, within(1e-12, 10.0)]


@dataclass(frozen=True)
class FitSettings(Changeable):
    """Settings of a fit by splatting; the defaults are the paper's (sections V.C and V.D).

    Four of them, `encoding`, `learning_rate_scale`, `initial_weights` and `image_loss`, follow the published code that
    the paper's network and loss resemble, not the letter of its text, which does not reach the paper's own figures. The
    letter is the preset ``paper-letter``; see `PAPER_LETTER`.

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
    encoding : positional encoding of the network, one of `frametwin.fields.network_options.ENCODINGS`.
    initial_weights : of the network's hidden layers, one of `frametwin.fields.network_options.INITIAL_WEIGHTS`.
    domain_margin : how far the computational domain reaches beyond the frame, as a share of its longest side.
    learning_rate, learning_rate_end : of the field, at the first and the last step.
    learning_rate_scale : by which both are multiplied.
    decay : how it falls between them, one of `DECAYS`.
    image_loss : of each view, one of `IMAGE_LOSSES`: the mean or the sum over its pixels; views are added.
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
    seed: Annotated[int, within(0, 2**63 - 1)] = 0
    iterations: Annotated[int, within(1, 1_000_000)] = 150
    image_scale: Annotated[float, within(1e-3, 1.0)] = 1.0
    samples: Annotated[int, within(3, 1000)] = 50
    kernels_per_strut: Annotated[int, within(1, 1000)] = 20
    adaptive_kernels: bool = False
    spread: Annotated[float, within(0.05, 10.0)] = 1.0
    pixel_variance: Annotated[float, within(0.0, 1e4)] = 1.0 / 12.0
    field: Annotated[str, one_of(FIELD_KINDS)] = "network"
    encoding: Annotated[str, one_of(tuple(ENCODINGS))] = "without_pi"
    initial_weights: Annotated[str, one_of(INITIAL_WEIGHTS)] = "torch"
    domain_margin: Annotated[float, within(1e-3, 10.0)] = 0.1
    learning_rate: Rate = 1.6e-4
    learning_rate_end: Rate = 1.6e-5
    learning_rate_scale: Annotated[float, within(1e-6, 1e6)] = 5.0
    decay: Annotated[str, one_of(DECAYS)] = "cosine"
    image_loss: Annotated[str, one_of(IMAGE_LOSSES)] = "mean"
    learn_thickness: bool = True
    thickness_rate: Rate = 5e-3
    learn_opacity: bool = True
    opacity_rate: Rate = 2.5e-2
    opacity_start: Annotated[float, within(0.01, 0.99)] = 0.9
    bending_weight: Annotated[float, within(0.0, 1e12)] = 1e-7
    bending_power: Annotated[float, within(0.0, 16.0)] = 2.0
    bending_samples: Annotated[int, within(1, 10_000_000)] = 2048
    lattice_cells: Annotated[
        tuple[Annotated[int, within(1, 64)], ...],
        some("one level or more"),
        in_words("the cells of one level or more, from 1 to 64, such as 1, 3, 6"),
    ] = (1, 3, 6)
    node_count: Annotated[int, within(1, 100_000)] = 256
    node_neighbours: Annotated[int, within(1, 64)] = 4

    def __post_init__(self) -> None:
        check_settings(self)
        if self.learning_rate_end > self.learning_rate:
            raise InputError.at("settings", "learning_rate_end", "is above learning_rate", "give a rate that falls")


PAPER_LETTER: dict[str, Any] = {
    "encoding": "with_pi",
    "learning_rate_scale": 1.0,
    "initial_weights": "he",
    "image_loss": "sum",
}
"""The four choices as the paper's text has them, or as one would make them where it is silent (the weights)."""

PRESETS: dict[str, dict[str, Any]] = {
    "paper": {},
    "paper-letter": PAPER_LETTER,
    "paper-lattice": {
        "field": "lattice",
        "learning_rate": 4e-3,
        "learning_rate_end": 4e-4,
        "learning_rate_scale": 1.0,
    },
    "curve-driven": {
        "field": "free",
        "learning_rate": 2e-3,
        "learning_rate_end": 2e-4,
        "learning_rate_scale": 1.0,
        "bending_weight": 0.0,
    },
    "deformation-driven": {
        "field": "nodes",
        "learning_rate": 2e-3,
        "learning_rate_end": 2e-4,
        "learning_rate_scale": 1.0,
        "bending_weight": 0.0,
    },
}
"""Changes to the paper's settings by name: none, the letter of its text, a lattice, and the two methods it compares
with."""


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
        raise InputError.at("settings", "preset", f"{name!r} is unknown", f"give one of {', '.join(PRESETS)}")
    return FitSettings().replace(**{"preset": name, **PRESETS[name], **changes})
