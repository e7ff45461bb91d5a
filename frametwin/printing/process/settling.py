"""Settling: how a print deforms under its weight while its struts harden, in one increment of time."""

from __future__ import annotations

import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.finite_rotation import RotatedShape
from frametwin.mechanics.sag import moved_frame
from frametwin.mechanics.stiffness import FrameBeams
from frametwin.printing.process.material import PrintSettings

SAMPLES = 10
"""Intervals of the curve parameter from which bent struts are refitted."""


def settled(frame: Wireframe, stiffness: np.ndarray, load: np.ndarray, settings: PrintSettings) -> Wireframe:
    """Deform a frame as it settles for some time under a load; what flows is free of stress in its shape before.

    Parameters
    ----------
    frame
        What stands, all of it printed and connected to a grounded joint.
    stiffness : (E,) array
        Of the struts, relative to the hardened material (see `calibration.stiffness_between`).
    load : (E, 3) array, N/mm
        Spread evenly along each strut.
    settings
        See `PrintSettings`.
    """
    beams = FrameBeams.build(
        frame,
        stiffness,
        axial_scale=settings.axial * stiffness,
        material=settings.material,
        load=load,
        pieces=settings.pieces,
    )
    joints = beams.solve()
    vertices, displacement = RotatedShape.build(beams, joints, SAMPLES).at(1.0)
    return moved_frame(frame, vertices, bezier.refit_matrix(SAMPLES) @ displacement)


def bent_ends(control_points: np.ndarray) -> np.ndarray:
    """Find the angles between each curve's ends and its chord.

    Parameters
    ----------
    control_points : (N, 4, 3) array, mm

    Returns
    -------
    (N, 2) array, degrees
    """
    chord = control_points[:, 3] - control_points[:, 0]
    ends = control_points[:, [1, 3]] - control_points[:, [0, 2]]  # (N, 2, 3)
    across = np.linalg.norm(np.cross(ends, chord[:, None]), axis=2)
    return np.degrees(np.arctan2(across, np.einsum("nex,nx->ne", ends, chord)))
