"""Feet, which are stuck to the plate: where they are is known before any picture is taken."""

from __future__ import annotations

import numpy as np

from frametwin import bezier
from frametwin.wireframe import Wireframe


def feet_on_plate(frame: Wireframe, design: Wireframe, joints: np.ndarray) -> Wireframe:
    """The frame with the grounded ones of ``joints`` (V,) bool where the design has them.

    A fit holds feet to where it starts, but hidden ones only so well. Were each fit to start from the last, what they
    are off would add up. Struts follow their ends in proportion; what is in place stays so to the last bit.
    """
    shift = np.where((frame.grounded & joints)[:, None], design.vertices - frame.vertices, 0.0)
    if not shift.any():
        return frame
    vertices = np.where(shift.any(axis=1)[:, None], design.vertices, frame.vertices)
    curves = frame.control_points + bezier.straight(*shift[frame.edges].transpose(1, 0, 2))
    for side, corner in ((0, 0), (1, 3)):
        curves[:, corner] = vertices[frame.edges[:, side]]
    return frame.replace(vertices=vertices, control_points=curves)
