"""How far each strut has hardened: the stiffness of the single struts of a sagging print.

A hot strut of a polymer is a thousand times softer than a cold one. How much its own weight then bends it
depends on the fourth power of its length, on its radius and on how far the whole frame sags, so one range of
stiffness gives no visible droop on one frame and torn struts on the next. What is drawn here is the droop
itself, as a share of the strut's length, and the stiffness follows from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.stiffness import FrameBeams, Material
from frametwin.ranges import Share, above, between, check_settings, in_words, rising

CLAMPED = 1.0 / 384.0
"""Middle deflection of a beam clamped at both ends under an even load, in q L^4 / (E I)."""
CANTILEVER = 1.0 / 8.0
"""End deflection of a beam clamped at one end."""


@dataclass(frozen=True)
class Hardening:
    """What share of the struts is unhardened, and how soft those are.

    Attributes
    ----------
    unhardened_fraction
        Share of the printed struts that have not hardened, 0..1.
    unhardened_sag
        How far an unhardened strut of average slope sags by itself between its joints, as a share of its
        length (that of a level beam with clamped ends, in the scaled result): drawn between these two, evenly
        in the logarithm.
    unhardened_stiffness
        Least and greatest stiffness of an unhardened strut relative to a hardened one, whatever the drawn sag
        asks for. PLA above its glass transition keeps about a thousandth.
    softest_axial
        Least stiffness along the strut relative to a hardened one. The nozzle has laid the strut's length
        down; an unhardened strut droops, it does not shrink by a third.
    longest_span
        A strut longer than this many median lengths is stiffened until it sags by itself no more than one of
        just this length, as the tension in a long sagging span would stiffen it, which a linear analysis
        leaves out. A single strut of 286 mm in a frame of 24 mm struts would otherwise have the whole
        displacement to itself.
    """

    unhardened_fraction: Share = 0.25
    unhardened_sag: Annotated[
        tuple[Annotated[float, between(0.0, 1.0)], Annotated[float, between(0.0, 1.0)]],
        rising,
        in_words("two rising shares between 0 and 1"),
    ] = (0.02, 0.08)
    unhardened_stiffness: Annotated[
        tuple[Annotated[float, above(0.0, up_to=1.0)], Annotated[float, above(0.0, up_to=1.0)]],
        rising,
        in_words("two rising numbers above 0 and up to 1"),
    ] = (1e-3, 0.2)
    softest_axial: Annotated[float, above(0.0, up_to=1.0)] = 0.1
    longest_span: Annotated[float, above(0.0)] = 2.0

    def __post_init__(self) -> None:
        check_settings(self)

    def draw(self, frame: Wireframe, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Draw which struts are unhardened and how far those sag.

        Returns
        -------
        unhardened, sag
            (E,) bool, never True for unprinted struts, and (E,) share of the strut's length.
        """
        rng = np.random.default_rng(seed)
        order = rng.permutation(frame.strut_count)
        order = order[frame.printed[order]]
        unhardened = np.zeros(frame.strut_count, dtype=bool)
        unhardened[order[: round(self.unhardened_fraction * len(order))]] = True
        low, high = np.log(self.unhardened_sag)
        return unhardened, np.exp(rng.uniform(low, high, frame.strut_count))

    def axial(self, stiffness: np.ndarray) -> np.ndarray:
        """Stiffness along the struts that goes with ``stiffness`` (E,) across them."""
        return np.maximum(stiffness, self.softest_axial)


def strut_stiffness(
    frame: Wireframe,
    hardening: Hardening,
    *,
    peak: float,
    seed: int,
    material: Material,
    pieces: int = 4,
    rounds: int = 30,
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness of every strut relative to a hardened one, such that the frame sags as ``hardening`` says.

    The scaled weight that brings the frame to ``peak`` depends on the stiffnesses and they on it, so both are
    found in turn; five rounds do for most frames.

    Parameters
    ----------
    frame
        The frame at rest, grounded.
    hardening, seed
        What to draw, and the seed of the drawing.
    peak
        Largest displacement in mm that the result will be scaled to.
    material
        Of hardened struts.
    pieces
        Straight beams along a curved strut.
    rounds
        Most rounds.

    Returns
    -------
    stiffness, unhardened
        (E,) factors and (E,) bool.
    """
    unhardened, share = hardening.draw(frame, seed)
    lengths = frame.lengths
    longest = hardening.longest_span * float(np.median(lengths[frame.printed]))
    hardened = np.maximum(1.0, lengths / longest) ** 4  # the own sag goes with the fourth power of the length
    low, high = hardening.unhardened_stiffness
    wanted = np.minimum(share * lengths, peak / 3.0)
    alone = _own_sag(frame, material)
    stiffness = hardened
    scale = 0.0
    for _ in range(rounds):
        beams = FrameBeams.build(
            frame, stiffness, axial_scale=hardening.axial(stiffness), material=material, pieces=pieces
        )
        moved = np.linalg.norm(beams.along_struts(beams.solve(), 10), axis=2).max()
        last, new = scale, peak / float(moved)
        scale = new if last == 0.0 else float(np.sqrt(last * new))  # halfway: fewer swings
        soft = np.clip(scale * alone / (hardened * wanted), low, high)
        stiffness = hardened * np.where(unhardened, soft, 1.0)
        if abs(scale - last) <= 1e-3 * scale:
            break
    return stiffness, unhardened


def _own_sag(frame: Wireframe, material: Material) -> np.ndarray:
    """Sag (E,) in mm by its own weight of each hardened strut, lying level between clamped ends.

    A strut with a free end is a cantilever.
    """
    degree = np.bincount(frame.edges[frame.printed].ravel(), minlength=frame.vertex_count)
    loose = (degree == 1) & ~frame.grounded
    # q L^4 / (E I) with q = weight * pi r^2 and I = pi r^4 / 4
    sag = 4.0 * material.weight * frame.lengths**4 / (material.young * frame.radius**2)
    return sag * np.where(loose[frame.edges].any(axis=1), CANTILEVER, CLAMPED)
