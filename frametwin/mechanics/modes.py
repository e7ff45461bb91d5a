"""Lumped masses and vibration modes: the ways in which a frame gives most easily."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.beams import factorise, lumped_mass
from frametwin.mechanics.stiffness import PLA, Material, require_grounded, stiffness_matrix


def joint_masses(frame: Wireframe, *, material: Material = PLA) -> np.ndarray:
    """Mass in t and rotary inertia in t mm^2 (V, 6) of the printed struts, lumped at the joints."""
    struts = frame.printed
    lengths = frame.lengths[struts]
    mass = material.mass * np.pi * frame.radius[struts] ** 2 * lengths
    return lumped_mass(lengths, mass, frame.edges[struts], frame.vertex_count)


def vibration_modes(
    frame: Wireframe, count: int, stiffness_scale: np.ndarray | None = None, *, material: Material = PLA
) -> tuple[np.ndarray, np.ndarray]:
    """The lowest modes of the printed part, its grounded joints clamped: the ways it gives most easily.

    Parameters
    ----------
    frame
        The frame at rest; every printed part must stand on the ground.
    count
        Number of modes; fewer come back if the frame has fewer free joints.
    stiffness_scale
        (E,) factors on the stiffness of the struts; default ones.
    material
        Of all struts.

    Returns
    -------
    frequencies, shapes
        (count,) in Hz, rising, and (count, V, 6) displacements and rotations of unit modal mass, zero at
        clamped and unprinted joints.

    Raises
    ------
    InputError
        If a printed part is not grounded.
    """
    require_grounded(frame)
    stiffness = stiffness_matrix(frame, stiffness_scale, material=material)
    mass = joint_masses(frame, material=material).ravel()
    free = np.repeat(~frame.grounded, 6) & (mass > 0.0)
    count = min(count, int(free.sum()) - 1)
    if count < 1:
        return np.zeros(0), np.zeros((0, frame.vertex_count, 6))
    # With M = S S the problem is symmetric; the inverse turns the lowest modes into the largest eigenvalues.
    root = np.sqrt(mass[free])
    factor = factorise(stiffness[free][:, free])
    size = len(root)
    inverse = LinearOperator((size, size), matvec=lambda x: root * factor.solve(root * x.ravel()))
    start = np.random.default_rng(0).standard_normal(size)
    values, vectors = eigsh(inverse, k=count, v0=start)
    order = np.argsort(-values)
    shapes = np.zeros((count, 6 * frame.vertex_count))
    shapes[:, free] = (vectors[:, order] / root[:, None]).T
    return 1.0 / (2.0 * np.pi * np.sqrt(values[order])), shapes.reshape(count, -1, 6)
