"""Smooth ways in which a frame gives: its answers to smooth loads.

The coarse stage moves the frame as it would answer, by its own stiffness, to a load that is a cubic B-spline lattice
of body forces: u = K^-1 f(x). Gravity is such a load, and so is nearly whatever else pulls a print out of shape; with
the same number of unknowns these motions come several times nearer to a sagging frame than a lattice of displacements
does, as they know what is joined to what, what stands and what hangs. Rigid motions are added, for a print that came
off its place as a whole.
"""

from __future__ import annotations

import numpy as np

from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fitting.elastic import ElasticFrame

HOLD = 1e6
"""Springs on grounded joints, relative to the mean diagonal of the stiffness."""

LEAST = 1e-3
"""Loads that move the frame by less than this share of what others do press on the ground and are left out."""


def rigid_motions(vertices: np.ndarray) -> np.ndarray:
    """(6V, 6): three shifts of 1 mm and three turns about the middle by up to about 1 mm."""
    arm = vertices - vertices.mean(axis=0)
    reach = max(float(np.linalg.norm(arm, axis=1).max()), 1e-9)
    motions = np.zeros((len(vertices), 6, 6))
    for axis in range(3):
        unit = np.eye(3)[axis]
        motions[:, axis, axis] = 1.0
        motions[:, :3, 3 + axis] = np.cross(unit, arm) / reach
        motions[:, 3 + axis, 3 + axis] = 1.0 / reach
    return motions.reshape(-1, 6)


def load_answers(elastic: ElasticFrame, cells: int) -> np.ndarray:
    """Static answers (6V, M) to a lattice of body forces, each scaled to a root mean square shift of 1 mm.

    Parameters
    ----------
    elastic
        The frame; its grounded joints are held.
    cells
        Cells of the lattice along the longest side of the frame's box.
    """
    frame = elastic.frame
    box = _box(elastic)
    basis = LatticeField.zeros(box, [even_cells(box, cells)]).dense_matrix(frame.vertices)
    basis = basis[:, np.abs(basis).max(axis=0) > 1e-3]
    half = frame.chord_lengths / 2.0
    weight = np.bincount(frame.edges.ravel(), weights=np.repeat(half, 2), minlength=frame.vertex_count)
    loads = np.zeros((frame.vertex_count, 6, 3, basis.shape[1]))
    for axis in range(3):
        loads[:, axis, axis] = basis * weight[:, None]
    stiffness = elastic.anchored(elastic.assemble(elastic.stiffness))
    held = np.flatnonzero(frame.grounded)
    grip = np.zeros((frame.vertex_count, 6))
    grip[held] = HOLD * stiffness.diagonal.mean()
    answers = stiffness.plus_diagonal(grip.ravel()).factorise().solve(loads.reshape(6 * frame.vertex_count, -1))
    return _scaled(answers)


def smooth_warps(elastic: ElasticFrame, cells: int) -> np.ndarray:
    """A lattice of displacements (6V, M), joints turning by half the curl, each scaled as `load_answers`."""
    frame = elastic.frame
    lattice = LatticeField.zeros(_box(elastic), [even_cells(_box(elastic), cells)])
    basis = lattice.dense_matrix(frame.vertices)
    used = np.abs(basis).max(axis=0) > 1e-3
    first = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    slope = np.stack([lattice.dense_matrix(frame.vertices, orders)[:, used] for orders in first])
    warps = np.zeros((frame.vertex_count, 6, 3, int(used.sum())))
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        warps[:, axis, axis] = basis[:, used]
        warps[:, 3 + after, axis] = 0.5 * slope[last]
        warps[:, 3 + last, axis] = -0.5 * slope[after]
    return _scaled(warps.reshape(6 * frame.vertex_count, -1))


def _box(elastic: ElasticFrame) -> np.ndarray:
    pad = 1e-3 * elastic.frame.extent
    return elastic.frame.bounds + np.array([[-pad], [pad]])


def _scaled(motions: np.ndarray) -> np.ndarray:
    shift = motions.reshape(-1, 6, motions.shape[1])[:, :3]
    size = np.sqrt(np.square(shift).sum(axis=(0, 1)) / len(shift))
    moving = size > LEAST * size.max()
    return motions[:, moving] / size[moving]
