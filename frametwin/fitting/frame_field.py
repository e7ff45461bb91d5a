"""Fields that move a frame's curves: the one that was asked to, and what a field makes of the curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.fields.base import DeformationField
from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fields.lattice_fit import fit_lattice
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

SAMPLES = 8
"""Intervals between samples of a strut that a field moves ..."""

FIT_SAMPLES = 4
"""... and of one that a field is fitted to: a cubic's way has no more to tell, and the field comes as near to it."""

MARGIN = 0.1
"""How far the field's box reaches beyond the frame's, as a share of the longest side."""


def field_through(
    frame: Wireframe, control_points: np.ndarray, cells: Sequence[int], weight: np.ndarray | None = None
) -> LatticeField:
    """The smooth field that moves a frame's curves to given ones, and everything between along with them.

    Parameters
    ----------
    frame : Wireframe
        The plan, of the struts that were fitted.
    control_points : (E, 4, 3) array, mm
        Where they are.
    cells : sequence of int
        Cells of each level of the lattice, along the longest side of the box.
    weight : (E,) array, optional
        Of each strut; struts that the views do not determine should have little.
    """
    u = np.linspace(0.0, 1.0, FIT_SAMPLES + 1)
    points = bezier.evaluate(frame.control_points, u)
    shift = bezier.evaluate(control_points, u) - points
    low, high = frame.bounds
    margin = MARGIN * frame.extent
    box = np.array([low - margin, high + margin])
    weights = None if weight is None else np.repeat(np.maximum(weight, 1e-3), len(u))
    resolutions = [even_cells(box, count) for count in cells]
    return fit_lattice(points.reshape(-1, 3), shift.reshape(-1, 3), weights, box, resolutions, bending=1e-7)


def moved_curves(frame: Wireframe, field: DeformationField) -> np.ndarray:
    """Curves of a frame, moved by a field (paper, Eq. 6 to 8).

    Returns
    -------
    (E, 4, 3) array, mm
        Control points.
    """
    u = np.linspace(0.0, 1.0, SAMPLES + 1)
    points = bezier.evaluate(frame.control_points, u)
    moved = points + field.evaluate(points.reshape(-1, 3)).reshape(points.shape)
    return np.einsum("cj,sjx->scx", bezier.refit_matrix(SAMPLES), moved)
