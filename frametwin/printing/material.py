"""What a simulated print is made of: how soft struts are when laid, how they harden, and what is left to chance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.errors import InputError
from frametwin.stiffness import PLA, Material


@dataclass(frozen=True)
class PrintSettings:
    """How a print behaves. Nothing here knows whether the plan is adapted.

    Attributes
    ----------
    sag
        How far the finished print would sag, as a share of its extent, if every strut attached and nothing was
        left to chance: the weight is scaled to that (`frametwin.printing.calibration`), so that frames of any
        size can be printed. ``None`` takes the weight as ``material`` has it.
    material
        Of hardened struts.
    soft, softness_spread
        Stiffness of a strut just laid relative to a hardened one, and the standard deviation of its logarithm
        from strut to strut.
    hardening
        Seconds after which a strut lacks 1/e of its final stiffness.
    creep
        What a strut's weight goes on to do while it hardens, as a share of what it did at once.
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
        A strut takes a time drawn from between these (paper, Sec. VI.C: 36 to 44 s).
    tear_angle, tear_stretch
        A strut comes off if an end is bent against its chord by more degrees than this since it was laid, or
        its chord grew or shrank by more than this share.
    collapse_share
        The print has collapsed when a larger share of the struts laid so far does not stand, or when fewer
        struts stand after a batch than before it.
    softest_axial
        Least stiffness along a strut relative to a hardened one: it droops, it does not shrink.
    pieces
        Straight beams along a bent strut.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    sag: float | None = 0.07
    material: Material = PLA
    soft: float = 0.2
    softness_spread: float = 0.3
    hardening: float = 600.0
    creep: float = 0.3
    lean: float = 0.1
    residual: float = 0.1
    placement: float = 0.03
    bead: float = 1.0
    increments: int = 3
    seconds: tuple[float, float] = (36.0, 44.0)
    tear_angle: float = 45.0
    tear_stretch: float = 0.25
    collapse_share: float = 0.1
    softest_axial: float = 0.1
    pieces: int = 2

    def __post_init__(self) -> None:
        positive = ("hardening", "bead", "tear_angle", "tear_stretch")
        low, high = self.seconds
        rules = (
            ("sag", self.sag is None or 0.0 <= self.sag < 1.0, "give a share of 0 or more and below 1, or None"),
            *(
                (name, _finite(getattr(self, name)) and getattr(self, name) > 0.0, "give a number above 0")
                for name in positive
            ),
            *(
                (name, _finite(getattr(self, name)) and getattr(self, name) >= 0.0, "give a number of 0 or more")
                for name in ("softness_spread", "creep", "lean", "residual", "placement")
            ),
            ("soft", 0.0 < self.soft <= 1.0, "give a share above 0 and up to 1"),
            ("softest_axial", 0.0 < self.softest_axial <= 1.0, "give a share above 0 and up to 1"),
            ("collapse_share", 0.0 < self.collapse_share <= 1.0, "give a share above 0 and up to 1"),
            ("increments", self.increments >= 1, "give a whole number above 0"),
            ("pieces", self.pieces >= 1, "give a whole number above 0"),
            ("seconds", 0.0 < low <= high < np.inf, "give two rising numbers above 0"),
        )
        for field, fine, remedy in rules:
            if not fine:
                raise InputError.at("settings", field, f"is {getattr(self, field)}", remedy)

    def stiffness(self, soft: np.ndarray | float, age: np.ndarray) -> np.ndarray:
        """Stiffness (N,) relative to a hardened strut at ``age`` (N,) in s, ``soft`` (N,) or one number at age 0."""
        return 1.0 - (1.0 - soft) * np.exp(-age / self.hardening)

    def weight_taken(self, age: np.ndarray) -> np.ndarray:
        """(N,) how often a strut's weight has acted by the ``age`` (N,) in s: once at first, then its creep."""
        return 1.0 + self.creep * (1.0 - np.exp(-age / self.hardening))


def _finite(value: float) -> bool:
    return bool(np.isfinite(value))


@dataclass(frozen=True, eq=False)
class Chance:
    """What the seed decides, drawn before the first strut is laid, so that no plan can change it.

    Attributes
    ----------
    soft
        (E,) stiffness of each strut when just laid.
    pull
        (E, 3) direction of the load on each strut, as a multiple of its weight.
    placement
        (E, 2, 3) how far the nozzle is off at start and end, as a multiple of the bead.
    seconds
        (E,) that each strut takes.
    """

    soft: np.ndarray
    pull: np.ndarray
    placement: np.ndarray
    seconds: np.ndarray

    @classmethod
    def draw(cls, struts: int, settings: PrintSettings, seed: int) -> Chance:
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
        soft = settings.soft * np.exp(settings.softness_spread * rng.normal(size=struts))
        sideways = settings.lean * np.array([np.cos(azimuth), np.sin(azimuth)])
        pull = np.full((struts, 3), -1.0)
        pull[:, :2] = sideways + settings.residual * rng.normal(size=(struts, 2))
        placement = settings.placement * rng.normal(size=(struts, 2, 3))
        return cls(np.clip(soft, 1e-3, 1.0), pull, placement, rng.uniform(*settings.seconds, size=struts))

    @classmethod
    def nominal(cls, struts: int, settings: PrintSettings) -> Chance:
        """What is expected, nothing being left to chance."""
        return cls(
            soft=np.full(struts, settings.soft),
            pull=np.tile([0.0, 0.0, -1.0], (struts, 1)),
            placement=np.zeros((struts, 2, 3)),
            seconds=np.full(struts, float(np.mean(settings.seconds))),
        )
