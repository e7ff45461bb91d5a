"""From linear displacements and rotations to a shape whose struts keep their lengths when they turn.

A linear analysis moves a turning strut along the tangent of its circle: at 45 degrees it would be 41 %
longer. Here every strut, bent and stretched as the analysis says, is turned by the full rotation, and the
joints are placed where the turned struts fit together best. For small displacements it is the linear result.

References
----------
M. G. Choi, H.-S. Ko, "Modal warping: real-time simulation of large rotational deformation and manipulation",
IEEE TVCG 11(1), 2005 (rotations of the linear field integrated to finite ones); O. Sorkine, M. Alexa,
"As-rigid-as-possible surface modeling", SGP 2007 (joints from turned edges).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU

from frametwin.geometry import bezier
from frametwin.geometry.rotations import rotation_matrices
from frametwin.mechanics.beams import factorise
from frametwin.mechanics.stiffness import FrameBeams


@dataclass(frozen=True, eq=False)
class RotatedShape:
    """The shape of the printed struts as a function of how far the linear result is scaled.

    Attributes
    ----------
    beams
        The struts at rest.
    parameters
        (S,) curve parameters of the samples.
    turn
        (E', 3) rotation of each printed strut, the mean of its joints, in rad.
    rest, bent
        (E', S, 3) samples relative to the strut's start at rest, and their displacement beyond that of the
        start and beyond the rotation.
    strain
        (E',) linear change of the chord's length, as a share of it.
    struts
        (E',) indices of the printed struts.
    pull
        (V', E') sums the turned struts at the free joints, weighted by their stiffness along.
    held
        (V', V) stiffness between the free joints and all.
    factor
        Of the part of ``held`` between free joints.
    free
        (V',) indices of the free joints.
    """

    beams: FrameBeams
    parameters: np.ndarray
    turn: np.ndarray
    rest: np.ndarray
    bent: np.ndarray
    strain: np.ndarray
    struts: np.ndarray
    pull: sparse.csr_matrix
    held: sparse.csr_matrix
    factor: SuperLU | None
    free: np.ndarray

    @classmethod
    def build(cls, beams: FrameBeams, joints: np.ndarray, m: int) -> RotatedShape:
        """Split a linear result into rotation and bending.

        Parameters
        ----------
        beams
            The struts; every printed part must be grounded.
        joints
            (V, 6) displacements in mm and rotations in rad of the joints.
        m
            Number of intervals of the curve parameter.
        """
        frame = beams.frame
        struts = np.flatnonzero(frame.printed)
        start, end = frame.edges[struts].T
        parameters = np.arange(m + 1) / m
        curve = bezier.evaluate(frame.control_points[struts], parameters)
        rest = curve - curve[:, :1]
        turn = 0.5 * (joints[start, 3:] + joints[end, 3:])
        moved = beams.along_struts(joints, m)[struts]
        bent = moved - moved[:, :1] - np.cross(turn[:, None], rest)

        chord = rest[:, -1]
        strain = np.sum(bent[:, -1] * chord, axis=1) / np.sum(chord**2, axis=1)

        count = np.arange(len(struts))
        signs = np.concatenate([-np.ones(len(struts)), np.ones(len(struts))])
        rows, columns = np.concatenate([count, count]), np.concatenate([start, end])
        difference = sparse.csr_matrix((signs, (rows, columns)), shape=(len(struts), frame.vertex_count))
        free = np.flatnonzero(frame.printed_vertices() & ~frame.grounded)
        # The joints settle like a truss of the struts, in proportion to their stiffness along.
        weight = frame.radius[struts] ** 2 / frame.lengths[struts]
        pull = (difference[:, free].T @ sparse.diags(weight / weight.mean())).tocsr()
        held = (pull @ difference).tocsr()
        factor = factorise(held[:, free].tocsc()) if len(free) else None
        return cls(beams, parameters, turn, rest, bent, strain, struts, pull, held, factor, free)

    def at(self, scale: float) -> tuple[np.ndarray, np.ndarray]:
        """The shape for the linear result times ``scale``.

        Returns
        -------
        vertices, displacement
            (V, 3) joints (unprinted ones stay as planned) and (E, S, 3) displacement of the samples of all
            curves, zero on unprinted struts.
        """
        frame = self.beams.frame
        rotation = rotation_matrices(scale * self.turn)
        shape = self.rest + scale * self.bent  # from the strut's start
        # The chord turns further than the joints where the strut bends into an S; that must not lengthen it.
        length = np.linalg.norm(self.rest[:, -1], axis=1) * np.exp(scale * self.strain)
        shape *= (length / np.linalg.norm(shape[:, -1], axis=1))[:, None, None]
        shape = shape @ rotation.transpose(0, 2, 1)
        vertices = frame.vertices.copy()
        if self.factor is not None:
            at_rest = vertices.copy()
            at_rest[self.free] = 0.0
            vertices[self.free] = self.factor.solve(self.pull @ shape[:, -1] - self.held @ at_rest)
        start, end = vertices[frame.edges[self.struts]].transpose(1, 0, 2)
        gap = end - start - shape[:, -1]  # what the strut must still be stretched to reach both its joints
        first = frame.vertices[frame.edges[self.struts, 0]]
        displacement = np.zeros((frame.strut_count, len(self.parameters), 3))
        displacement[self.struts] = (
            (start - first)[:, None] + shape - self.rest + gap[:, None] * self.parameters[:, None]
        )
        return vertices, displacement
