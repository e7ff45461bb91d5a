"""Struts that are printed along with a frame and are no part of it: the last ones of its design.

First come those of the frame, then those of its supports, and those of a coupon.
"""

from __future__ import annotations

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe, straight_control_points
from frametwin.printing.records.sequence import PrintSequence


def with_struts(
    frame: Wireframe, points: np.ndarray, edges: np.ndarray, *, grounded: np.ndarray, batch: np.ndarray
) -> Wireframe:
    """Add straight struts to a frame, as thick as its typical ones; they come after those that it has.

    Parameters
    ----------
    frame
        To which they are added.
    points : (N, 3) array, mm
        Joints that are new.
    edges : (A, 2) array of int
        Joints of each strut, among those of the frame and, after them, the new ones.
    grounded : (N,) array of bool
        Which of the new joints stand on the plate.
    batch : (A,) array of int
        In which each strut is printed.
    """
    vertices, count = np.concatenate([frame.vertices, points]), len(edges)
    return Wireframe.create(
        vertices,
        np.concatenate([frame.edges, edges]),
        control_points=np.concatenate([frame.control_points, straight_control_points(vertices, edges)]),
        radius=np.concatenate([frame.radius, np.full(count, float(np.median(frame.radius)))]),
        printed=np.concatenate([frame.printed, np.ones(count, dtype=bool)]),
        grounded=np.concatenate([frame.grounded, grounded]),
        batch=np.concatenate([frame.batch, batch]),
        name=frame.name,
    )


def without_last(count: int, others: int) -> np.ndarray:
    """(E,) bool: which of ``count`` struts are a frame's own, the last ``others`` being of a coupon or supports."""
    return np.arange(count) < count - others


def frame_alone(design: Wireframe, sequence: PrintSequence, others: int) -> tuple[Wireframe, PrintSequence]:
    """The frame of a design whose last struts are a coupon or supports, and the order of its struts."""
    own = without_last(design.strut_count, others)
    frame, vertices = design.subset(own)
    return frame, sequence.part(own, vertices)


def plate_of(frame: Wireframe) -> float:
    """Height of the plate in mm: that of the lowest foot; vertices that no strut uses are none.

    Raises
    ------
    InputError
        If nothing of the frame stands on it.
    """
    feet = frame.grounded & (frame.degree > 0)
    if not feet.any():
        raise InputError.at(frame.name, "grounded", "nothing stands on the plate", "mark what does as grounded")
    return float(frame.vertices[feet, 2].min())
