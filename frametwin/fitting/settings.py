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
KERNEL_KINDS = ("anchored", "free")
IMAGE_LOSSES = ("mean", "sum", "absolute-ssim", "balanced-ssim")
NODE_MOTIONS = ("free", "network")

Rate = Annotated[float, within(1e-12, 10.0)]
Weight = Annotated[float, within(0.0, 1e12)]


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
    views_per_step : how many views a step looks at, in a random order that takes each in turn; 0 for all of them.
    kernels : ``anchored`` to the curves, or ``free`` to leave them, which only the nodes can move along.
    kernels_per_strut : K; the largest number where it adapts.
    adaptive_kernels : whether short or thin struts take fewer kernels.
    spread : sigma_t as a multiple of the spacing of the kernels.
    pixel_variance : low-pass of the pictures in pixel^2.
    field : what carries the deformation, one of `FIELD_KINDS`.
    share_ends : whether struts that meet at a joint stay joined, for free control points.
    encoding : positional encoding of the network, one of `frametwin.fields.network_options.ENCODINGS`.
    initial_weights : of the network's hidden layers, one of `frametwin.fields.network_options.INITIAL_WEIGHTS`.
    domain_margin : how far the computational domain reaches beyond the frame, as a share of its longest side.
    learning_rate, learning_rate_end : of the field, at the first and the last step.
    learning_rate_scale : by which both are multiplied.
    decay : how it falls between them, one of `DECAYS`.
    image_loss : of each view, one of `IMAGE_LOSSES`: the mean or the sum over its pixels, or with a share of 1 - SSIM
        (see `frametwin.fitting.similarity`); views are added.
    learn_thickness, thickness_rate : whether tau is learnt for each kernel, and how fast; of free kernels also their
        length and their directions.
    learn_opacity, opacity_rate : whether alpha is learnt for each kernel, and how fast.
    values_by_strut : whether all kernels of a strut have one tau and one alpha.
    opacity_start : alpha at the start, above 0 and below 1.
    bending_weight, bending_power, bending_samples : omega, p and the random points a step of the bending
        term.
    lattice_cells : cells along the longest side in each level, for the lattice.
    node_count, node_neighbours : control nodes, and how many of them a point follows, for the nodes.
    node_motion : whether the motion of each node is learnt by itself, or all by a network of the nodes' places.
    rigidity_weight : of the nodes' as-rigid-as-possible energy.
    smoothness_weight, opacity_weight, width_weight, connection_weight : of the terms of what kernels are anchored to
        in `frametwin.fitting.curve_terms`.

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
    views_per_step: Annotated[int, within(0, 1000)] = 0
    kernels: Annotated[str, one_of(KERNEL_KINDS)] = "anchored"
    kernels_per_strut: Annotated[int, within(1, 1000)] = 20
    adaptive_kernels: bool = False
    spread: Annotated[float, within(0.05, 10.0)] = 1.0
    pixel_variance: Annotated[float, within(0.0, 1e4)] = 1.0 / 12.0
    field: Annotated[str, one_of(FIELD_KINDS)] = "network"
    share_ends: bool = True
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
    values_by_strut: bool = False
    bending_weight: Weight = 1e-7
    bending_power: Annotated[float, within(0.0, 16.0)] = 2.0
    bending_samples: Annotated[int, within(1, 10_000_000)] = 2048
    lattice_cells: Annotated[
        tuple[Annotated[int, within(1, 64)], ...],
        some("one level or more"),
        in_words("the cells of one level or more, from 1 to 64, such as 1, 3, 6"),
    ] = (1, 3, 6)
    node_count: Annotated[int, within(1, 100_000)] = 256
    node_neighbours: Annotated[int, within(1, 64)] = 4
    node_motion: Annotated[str, one_of(NODE_MOTIONS)] = "free"
    rigidity_weight: Weight = 0.0
    smoothness_weight: Weight = 0.0
    opacity_weight: Weight = 0.0
    width_weight: Weight = 0.0
    connection_weight: Weight = 0.0

    def __post_init__(self) -> None:
        check_settings(self)
        if self.learning_rate_end > self.learning_rate:
            raise InputError.at("settings", "learning_rate_end", "is above learning_rate", "give a rate that falls")
        if self.kernels == "free" and (self.field != "nodes" or self.adaptive_kernels or self.kernels_per_strut < 4):
            problem = "are free, but not moved by nodes, or not of an equal number of 4 or more on each strut"
            raise InputError.at(
                "settings", "kernels", problem, "use the preset deformation-driven, or anchored kernels"
            )


PAPER_LETTER: dict[str, Any] = {
    "encoding": "with_pi",
    "learning_rate_scale": 1.0,
    "initial_weights": "he",
    "image_loss": "sum",
}
"""The four choices as the paper's text has them, or as one would make them where it is silent (the weights)."""

CURVE_DRIVEN: dict[str, Any] = {
    "field": "free",
    "share_ends": False,
    "iterations": 10_000,
    "views_per_step": 1,
    "kernels_per_strut": 12,
    "spread": 0.5,
    "values_by_strut": True,
    "learning_rate": 5e-4,
    "learning_rate_end": 1.077e-4,
    "learning_rate_scale": 1.0,
    "decay": "geometric",
    "image_loss": "balanced-ssim",
    "bending_weight": 0.0,
    "smoothness_weight": 1e-2,
    "opacity_weight": 1e-3,
    "width_weight": 1e-3,
    "connection_weight": 1e-2,
}
"""Curve-Gaussian by its published figures (the project's `arguments/__init__.py` and `train.py`): 12 kernels a curve,
spread along by half their spacing; width and opacity a curve; ends of its own; one view a step; a rate that falls from
5e-4 to 5e-6 in 30,000 steps, of which 10,000 are made. Weights are those of its regularisers over that of its image
loss, 10. Without what changes the number of curves: splitting, merging and pruning."""

DEFORMATION_DRIVEN: dict[str, Any] = {
    "kernels": "free",
    "field": "nodes",
    "iterations": 40_000,
    "views_per_step": 1,
    "learning_rate_end": 1.6e-6,
    "decay": "geometric",
    "initial_weights": "he",
    "thickness_rate": 1e-3,
    "opacity_rate": 5e-2,
    "image_loss": "absolute-ssim",
    "bending_weight": 0.0,
    "node_count": 512,
    "node_neighbours": 3,
    "node_motion": "network",
    "rigidity_weight": 1e-4,
}
"""SC-GS by its published figures (the paper, and the project's `arguments/__init__.py`, `utils/time_utils.py` and
command lines): 512 nodes, of which a kernel follows 3, with radii that are learnt and motions from a network of 8
layers of 256; free kernels; L1 with a fifth of 1 - SSIM; one view a step; an as-rigid-as-possible energy weighed 1e-4.
The rates fall in 40,000 steps; its other 40,000 run at the lowest. Without densification: the kernels at the start are
ours."""

PRESETS: dict[str, dict[str, Any]] = {
    "paper": {},
    "paper-letter": PAPER_LETTER,
    "paper-lattice": {
        "field": "lattice",
        "learning_rate": 4e-3,
        "learning_rate_end": 4e-4,
        "learning_rate_scale": 1.0,
    },
    "curve-driven": CURVE_DRIVEN,
    "deformation-driven": DEFORMATION_DRIVEN,
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
