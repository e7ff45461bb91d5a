"""Gravity sag of a print whose struts have not all hardened: a truth that fits are tested against."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.optimize import brentq

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.displacement import SAMPLES, largest_displacement
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.finite_rotation import RotatedShape
from frametwin.mechanics.hardening import Hardening, strut_stiffness
from frametwin.mechanics.stiffness import PLA, FrameBeams, Material, require_grounded
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.ranges import Seed, above, check_settings, within


@dataclass(frozen=True)
class SagSettings:
    """How a print sags.

    Attributes
    ----------
    peak
        Largest displacement of any point in mm; ``None`` for ``peak_fraction`` of the extent.
    peak_fraction
        Share of the longest side of the printed part's bounding box.
    hardening
        How many struts have not hardened, and how soft those are.
    seed
        Of the random choice.
    material
        Of the hardened struts. As the result is scaled to the peak, only ratios of stiffness matter.
    pieces
        Straight beams along a curved strut.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    peak: Annotated[float, above(0.0)] | None = None
    peak_fraction: Annotated[float, above(0.0, up_to=10.0)] = 0.07
    hardening: Hardening = Hardening()
    seed: Seed = 0
    material: Material = PLA
    pieces: Annotated[int, within(1, 1000)] = 4

    def __post_init__(self) -> None:
        check_settings(self)

    def peak_of(self, frame: Wireframe) -> float:
        """Largest displacement in mm for ``frame``."""
        return self.peak_fraction * frame.printed_part()[0].extent if self.peak is None else self.peak


@dataclass(frozen=True, eq=False)
class Sag:
    """A sagging print.

    Attributes
    ----------
    frame
        The deformed frame.
    stiffness
        (E,) stiffness of the struts relative to a hardened one.
    unhardened
        (E,) bool.
    """

    frame: Wireframe
    stiffness: np.ndarray
    unhardened: np.ndarray


def sag(frame: Wireframe, settings: SagSettings | None = None, progress: ProgressCallback | None = None) -> Wireframe:
    """Let the printed part of a frame sag under its own weight.

    The printed struts are Euler-Bernoulli beams, grounded vertices are clamped, and the linear result is
    scaled until the largest displacement is the wanted peak, with finite rotations (`RotatedShape`). Curves
    come from the displacements and rotations of their ends and from the closed form of an even load between.

    Parameters
    ----------
    frame
        The plan. Unprinted struts do not carry; their ends follow the joints of the print, and their inner
        control points follow linearly between. Unprinted struts that touch no print stay as planned.
    settings
        See `SagSettings`.
    progress
        See `ProgressCallback`.

    Returns
    -------
    The deformed frame: the same struts, in the same order.

    Raises
    ------
    InputError
        If nothing is printed, the print is not grounded, printed struts are loose, or the peak is out of
        reach.
    Cancelled
        If ``progress`` returns ``False``.
    """
    return simulate_sag(frame, settings, progress).frame


def simulate_sag(
    frame: Wireframe, settings: SagSettings | None = None, progress: ProgressCallback | None = None
) -> Sag:
    """Do what `sag` does, and tell how stiff every strut was taken to be.

    Parameters, exceptions
        See `sag`.
    """
    settings = SagSettings() if settings is None else settings
    require_grounded(frame)
    peak = settings.peak_of(frame)
    report(progress, Progress("hardening struts", 0, 3))
    stiffness, unhardened = strut_stiffness(
        frame,
        settings.hardening,
        peak=peak,
        seed=settings.seed,
        material=settings.material,
        pieces=settings.pieces,
    )
    beams = FrameBeams.build(
        frame,
        stiffness,
        axial_scale=settings.hardening.axial(stiffness),
        material=settings.material,
        pieces=settings.pieces,
    )
    report(progress, Progress("solving for the sag", 1, 3))
    joints = beams.solve()
    report(progress, Progress("bending struts", 2, 3))
    deformed = scaled_shape(beams, joints, peak)
    report(progress, Progress("bending struts", 3, 3))
    return Sag(deformed, stiffness, unhardened)


def scaled_shape(beams: FrameBeams, joints: np.ndarray, peak: float) -> Wireframe:
    """Scale a linear result to a largest displacement of ``peak`` mm, with finite rotations.

    Parameters
    ----------
    beams
        The struts at rest.
    joints
        (V, 6) displacements and rotations of the joints.
    peak
        In mm, measured on the refitted cubics.

    Raises
    ------
    InputError
        If nothing moves, or if the struts would have to turn in circles to get that far.
    """
    frame = beams.frame
    shape = RotatedShape.build(beams, joints, SAMPLES)

    def excess(scale: float) -> float:
        return largest_displacement(_refitted(shape.at(scale)[1])) - peak

    linear = float(np.linalg.norm(beams.along_struts(joints, SAMPLES), axis=2).max())
    if not linear > 0.0:
        raise InputError.at(
            frame.name,
            "grounded",
            "holds every strut still",
            "ground fewer vertices, or add struts above them",
        )
    high = peak / linear
    for _ in range(12):
        if excess(high) >= 0.0:
            break
        high *= 1.3
    else:
        raise InputError.at(
            frame.name, "peak", f"{peak:.4g} mm is further than this frame can sag", "give a smaller peak"
        )
    scale = brentq(excess, 0.0, high, xtol=1e-13 * high, rtol=1e-12)
    vertices, displacement = shape.at(scale)
    return moved_frame(frame, vertices, _refitted(displacement))


def moved_frame(frame: Wireframe, vertices: np.ndarray, change: np.ndarray) -> Wireframe:
    """The frame with joints at ``vertices`` (V, 3) and its printed curves changed by ``change`` (E, 4, 3).

    Unprinted curves follow their ends (`Wireframe.moved_to`).
    """
    following = frame.moved_to(vertices)
    control_points = np.where(frame.printed[:, None, None], frame.control_points + change, following.control_points)
    control_points[:, [0, 3]] = following.control_points[:, [0, 3]]
    return following.replace(control_points=control_points)


def _refitted(samples: np.ndarray) -> np.ndarray:
    """Cubics (E, 4, 3) through samples (E, m + 1, 3), ends exact (paper Eq. 6-8)."""
    return bezier.refit_matrix(samples.shape[1] - 1) @ samples
