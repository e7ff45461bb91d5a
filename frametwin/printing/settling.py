"""One increment of a print's deformation: the load that came on acts on the stiffness that is there now."""

from __future__ import annotations

import numpy as np

from frametwin import bezier
from frametwin.finite_rotation import RotatedShape
from frametwin.sag import moved_frame
from frametwin.stiffness import FrameBeams, Material
from frametwin.wireframe import Wireframe

SAMPLES = 10
"""Intervals of the curve parameter from which bent struts are refitted."""


def settled(
    frame: Wireframe,
    stiffness: np.ndarray,
    load: np.ndarray,
    *,
    material: Material,
    softest_axial: float,
    pieces: int = 2,
) -> Wireframe:
    """The frame after a load came on: hypoelastic, its shape before being free of stress.

    What a strut was bent to while soft is its shape when it hardens (solidification, as Z. P. Bazant and S. Prasannan
    have it for ageing concrete, J. Eng. Mech. 115(8), 1989): increments add up, each on the stiffness of its time.

    Parameters
    ----------
    frame
        What stands, all of it printed and connected to a grounded joint.
    stiffness
        (E,) of the struts relative to ``material``.
    load
        (E, 3) increment of the even load in N/mm.
    material, softest_axial, pieces
        See `PrintSettings`.
    """
    axial = np.maximum(stiffness, softest_axial)
    beams = FrameBeams.build(frame, stiffness, axial_scale=axial, material=material, load=load, pieces=pieces)
    joints = beams.solve()
    vertices, displacement = RotatedShape.build(beams, joints, SAMPLES).at(1.0)
    return moved_frame(frame, vertices, bezier.refit_matrix(SAMPLES) @ displacement)


def bent_ends(control_points: np.ndarray) -> np.ndarray:
    """(N, 2) angles in degrees between each curve's ends and its chord."""
    chord = control_points[:, 3] - control_points[:, 0]
    ends = control_points[:, [1, 3]] - control_points[:, [0, 2]]  # (N, 2, 3)
    across = np.linalg.norm(np.cross(ends, chord[:, None]), axis=2)
    return np.degrees(np.arctan2(across, np.einsum("nex,nx->ne", ends, chord)))
