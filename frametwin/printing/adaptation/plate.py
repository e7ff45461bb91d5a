"""Feet, which are stuck to the plate: where they are is known before any picture is taken."""

from __future__ import annotations

import numpy as np

from frametwin.geometry.wireframe import Wireframe


def feet_on_plate(frame: Wireframe, design: Wireframe, joints: np.ndarray) -> Wireframe:
    """Put feet back to where the design has them.

    A fit keeps feet near to where it starts, but hidden ones only so well. Were each fit to start from the last, what
    they are off would add up. Struts follow their ends in proportion; what is in place stays so to the last bit.

    Parameters
    ----------
    frame, design
        A plan, and where its feet belong.
    joints : (V,) bool array
        Those to look at; of them the grounded ones are feet.
    """
    off = frame.grounded & joints & (frame.vertices != design.vertices).any(axis=1)
    return frame.moved_to(np.where(off[:, None], design.vertices, frame.vertices)) if off.any() else frame
