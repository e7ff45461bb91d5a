"""What every way of fitting takes and gives back."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from frametwin.cameras import Camera
from frametwin.fields.base import DeformationField
from frametwin.fitting.known_start import KnownStart
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback


@dataclass(frozen=True, eq=False)
class ViewsFit:
    """What a fit made of its N views.

    Attributes
    ----------
    cameras : (N, 10) array
        Corrections of the cameras (see `frametwin.fitting.camera_freedoms`); zeros where the rig was taken as it is.
    sigmas : (N,) array
        Largest correction of each camera, in standard deviations of its rig.
    used : (N,) array of bool
        Views that the fit was made from.
    unexplained, unseen : (N,) array, 0..1
        Share of each picture's white that the twin does not draw, and of the twin that is not white there.
    holds : str
        What holds the world: ``rig``, ``feet`` or ``cameras``.
    """

    cameras: np.ndarray
    sigmas: np.ndarray
    used: np.ndarray
    unexplained: np.ndarray
    unseen: np.ndarray
    holds: str


@dataclass(frozen=True, eq=False)
class KernelCloud:
    """Gaussian kernels that lie on no curve.

    Attributes
    ----------
    means : (N, 3) array, mm
    covariances : (N, 3, 3) array, mm^2
    opacity : (N,) array, 0..1
    """

    means: np.ndarray
    covariances: np.ndarray
    opacity: np.ndarray


@dataclass(frozen=True, eq=False)
class PartFit:
    """What was found of the part of a frame that is printed: E struts, V joints, K kernels a strut.

    Attributes
    ----------
    control_points : (E, 4, 3) array, mm
    vertices : (V, 3) array, mm
    thickness : (E, K) array, mm
        Radius of the strut at each kernel.
    opacity : (E, K) array, 0..1
    confidence : (E,) array, 0..1
        How well the pictures determine each strut.
    field : DeformationField
        What moves the plan to the curves, and everything around it along with them.
    loss : sequence of float
        After each step, as the fitter defines it.
    timing : mapping of str to float, s
        By stage.
    views : ViewsFit or None
        What was made of the views, by fitters that ask.
    joint_radius : (V,) array or None, mm
        Of the material at each joint, likewise.
    sigma_across, sigma_along : (E,) array or None, mm
        Standard deviation of each strut's curve across and along itself, likewise.
    attached : (E, 2) array of bool or None
        Whether the start and the end of each strut are at their joints, likewise.
    gap : (E, 2) array or None, mm
        How far ends that are not attached are from their joints, 0 for the others.
    cloud : KernelCloud or None
        The kernels, by fitters that let them leave their curves.
    bent : mapping of int to (n + 1, 3) array, mm
        Curves of a degree above 3 of struts that are bent as no cubic can be; their ``control_points`` are those of the
        cubics nearest to them.
    """

    control_points: np.ndarray
    vertices: np.ndarray
    thickness: np.ndarray
    opacity: np.ndarray
    confidence: np.ndarray
    field: DeformationField
    loss: Sequence[float]
    timing: Mapping[str, float]
    views: ViewsFit | None = None
    joint_radius: np.ndarray | None = None
    sigma_across: np.ndarray | None = None
    sigma_along: np.ndarray | None = None
    attached: np.ndarray | None = None
    gap: np.ndarray | None = None
    cloud: KernelCloud | None = None
    bent: Mapping[int, np.ndarray] = dataclasses.field(default_factory=dict)


class Fitter(Protocol):
    """A way of fitting, with its settings."""

    def fit(
        self,
        printed: Wireframe,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        start: DeformationField | KnownStart | None = None,
        callback: ProgressCallback | None = None,
    ) -> PartFit:
        """Find where every strut of a frame is, from its silhouettes.

        Parameters
        ----------
        printed : Wireframe
            The plan of what has been printed (see `Wireframe.printed_part`).
        cameras : sequence of Camera
            One for each picture, without lens distortion.
        masks : sequence of (H, W) array, 0..1
            1 where a strut is seen; sizes may differ.
        start : DeformationField or KnownStart, optional
            From which to start, such as that of the last batch; the plan by default.
        callback : ProgressCallback, optional
            Told of every step; can stop the fit.

        Raises
        ------
        InputError
            If pictures and cameras do not belong together, or the fitter cannot start from a field.
        Cancelled
            If the callback stops the fit.
        """
        ...
