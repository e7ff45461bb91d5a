"""What a simulated print is made of: how fast struts flow when laid, how they harden, and what varies at random.

By the analogy of Stokes and Rayleigh, a slow viscous thread moves as fast as an elastic beam of the same section would
be bent far (M. Bergou, B. Audoly et al., "Discrete viscous threads", ACM TOG 29(4), 2010), so the beams of
`frametwin.mechanics.stiffness` serve with the inverse of the fluidity for Young's modulus.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from frametwin.errors import InputError
from frametwin.mechanics.stiffness import PLA, Material
from frametwin.ranges import above, at_least, check_settings, in_words, rising, within

USUAL_SPEED = 5.0
"""mm/s of the nozzle at which what `PrintSettings` say of flow and seconds is meant."""


@dataclass(frozen=True)
class PrintSettings:
    """How a print behaves. Nothing here knows whether the plan is adapted.

    Attributes
    ----------
    sag
        How far the finished print would sag, as a share of its extent, if every strut attached and nothing was
        left to chance: the weight is scaled to that (`frametwin.printing.process.calibration`), so that frames of any
        size can be printed. ``None`` takes the weight as ``material`` has it.
    material
        Of hardened struts.
    flow
        How much further a strut flows while it hardens than it would bend at once when hard. PLA above its glass
        transition keeps about a thousandth of its stiffness.
    hardening
        Seconds after which a strut flows only 1/e times as fast as when it was laid.
    rest
        How fast a hardened strut still flows, as a share of the speed when it was laid: the heat of the print.
    uneven
        Standard deviation of the logarithm of how fast a strut flows, from strut to strut.
    axial
        Stiffness along a strut relative to that of its solid section: it hangs on two beads that are squashed
        and drawn out.
    speed
        Of the nozzle while it lays a strut, mm/s. ``flow`` and ``seconds`` are told for `USUAL_SPEED`: at half of it
        a strut takes twice as long, and flows half as far, since half as much of it is soft at once.
    draw
        How the nozzle pulls at what stands while it draws a strut from there, along the strut, as a multiple of its
        weight: the tension of a thread that is drawn, three times its viscosity times how fast it gets longer
        (F. Trouton, "On the coefficient of viscous traction and its relation to that of viscosity", Proc. R. Soc. A 77,
        1906). A nozzle that feeds as much as it lays pulls by next to nothing; one that feeds less stretches the strut.
    lean
        Sideways pull as a share of the weight, in one direction for the whole print, drawn by the seed: what
        the residual stresses of a nozzle that keeps coming from the same side add up to.
    residual
        The same for each strut alone, standard deviation along x and y (paper, Sec. I: changes of the printing
        direction introduce unpredictable deformations).
    placement
        Standard deviation along each axis of where the nozzle really is, as a share of the bead.
    bead
        Diameter of the molten bead as a multiple of the strut's: further from the material, nothing sticks.
    increments
        Parts into which a batch is divided; the print sags after each, before the next is laid.
    seconds
        A strut takes a time drawn from between these at `USUAL_SPEED` (paper, Sec. VI.C: 36 to 44 s).
    pause
        Seconds from the last strut of a batch until the next batch begins: pictures and twin.
    tear_angle, tear_stretch
        A strut comes off if an end is bent against its chord by more degrees than this since it was laid, or
        its chord grew or shrank by more than this share.
    collapse_share
        The print has collapsed when a larger share of the struts laid so far does not stand, or when fewer
        struts stand after a batch than before it.
    pieces
        Straight beams along a bent strut.
    variation
        Share by which ``flow``, ``hardening``, ``rest`` and ``axial`` differ at most from print to print, each drawn
        evenly by the seed: another spool, another room.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    sag: Annotated[float, at_least(0.0, below=1.0, noun="a share")] | None = 0.07
    material: Material = PLA
    flow: Annotated[float, above(0.0)] = 1000.0
    hardening: Annotated[float, above(0.0)] = 600.0
    rest: Annotated[float, at_least(0.0)] = 0.1
    uneven: Annotated[float, at_least(0.0)] = 0.3
    axial: Annotated[float, above(0.0, up_to=1.0, noun="a share")] = 0.1
    speed: Annotated[float, above(0.0)] = USUAL_SPEED
    draw: Annotated[float, at_least(0.0)] = 0.0
    lean: Annotated[float, at_least(0.0)] = 0.05
    residual: Annotated[float, at_least(0.0)] = 0.1
    placement: Annotated[float, at_least(0.0)] = 0.03
    bead: Annotated[float, above(0.0)] = 1.0
    increments: Annotated[int, within(1, 1000)] = 3
    seconds: Annotated[
        tuple[Annotated[float, above(0.0)], Annotated[float, above(0.0)]],
        rising,
        in_words("two rising numbers above 0"),
    ] = (36.0, 44.0)
    pause: Annotated[float, at_least(0.0)] = 60.0
    tear_angle: Annotated[float, above(0.0)] = 45.0
    tear_stretch: Annotated[float, above(0.0)] = 0.25
    collapse_share: Annotated[float, above(0.0, up_to=1.0, noun="a share")] = 0.05
    pieces: Annotated[int, within(1, 1000)] = 2
    variation: Annotated[float, at_least(0.0, below=1.0, noun="a share")] = 0.0

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def hot_flow(self) -> float:
        """``flow`` at the speed of the nozzle."""
        return self.flow * self.speed / USUAL_SPEED

    @property
    def strut_seconds(self) -> tuple[float, float]:
        """``seconds`` at the speed of the nozzle."""
        least, most = self.seconds
        return least * USUAL_SPEED / self.speed, most * USUAL_SPEED / self.speed

    def of_print(self, seed: int) -> PrintSettings:
        """The settings of the print of this seed, with what varies from print to print."""
        if self.variation == 0.0:
            return self
        low, high = 1.0 - self.variation, 1.0 + self.variation
        factors = np.random.default_rng(np.random.SeedSequence([seed, 1])).uniform(low, high, size=4)
        names = ("flow", "hardening", "rest", "axial")
        drawn = {name: getattr(self, name) * float(factor) for name, factor in zip(names, factors, strict=True)}
        return replace(self, **{**drawn, "axial": min(1.0, drawn["axial"])}, variation=0.0)

    def flowed(self, young: np.ndarray, old: np.ndarray) -> np.ndarray:
        """How far struts flow between two ages (N,) in s, in multiples of how far they would bend at once when hard.

        The integral of the fluidity, exp(-age / hardening) + rest, scaled so that hardening itself comes to `hot_flow`.
        """
        return flowed_between(young, old, self.hot_flow, self.hardening, self.rest)


def flowed_between(young: np.ndarray, old: np.ndarray, flow: float, hardening: float, rest: float) -> np.ndarray:
    """As `PrintSettings.flowed`, of a material with these settings."""
    softening = np.exp(-young / hardening) - np.exp(-old / hardening)
    return flow * (softening + rest * (old - young) / hardening)


@dataclass(frozen=True, eq=False)
class ProcessVariation:
    """Random variation of the process, drawn by the seed before the first strut is laid, so that no plan can change it.

    Attributes
    ----------
    speed : (E,) array
        How fast each strut flows, relative to what is expected.
    pull : (E, 3) array
        Load on each strut, as a multiple of its weight.
    placement : (E, 2, 3) array
        How far the nozzle is off at start and end, as a multiple of the bead.
    seconds : (E,) array, s
        Time that each strut takes.
    """

    speed: np.ndarray
    pull: np.ndarray
    placement: np.ndarray
    seconds: np.ndarray

    @classmethod
    def draw(cls, struts: int, settings: PrintSettings, seed: int) -> ProcessVariation:
        """Draw for a frame of so many struts.

        Raises
        ------
        InputError
            If the seed is below 0.
        """
        if seed < 0:
            raise InputError.at("settings", "seed", f"is {seed}", "give a whole number from 0 up")
        rng = np.random.default_rng(seed)
        azimuth = rng.uniform(0.0, 2.0 * np.pi)
        speed = np.exp(settings.uneven * rng.normal(size=struts))
        sideways = settings.lean * np.array([np.cos(azimuth), np.sin(azimuth)])
        pull = np.full((struts, 3), -1.0)
        pull[:, :2] = sideways + settings.residual * rng.normal(size=(struts, 2))
        placement = settings.placement * rng.normal(size=(struts, 2, 3))
        return cls(speed, pull, placement, rng.uniform(*settings.strut_seconds, size=struts))
