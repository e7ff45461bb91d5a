"""Finite elements of 3D Euler-Bernoulli beams with round cross-sections, for many struts at once.

Every node has six degrees of freedom in the order ux, uy, uz (mm), rx, ry, rz (rad); node v of a frame owns
the rows 6 v to 6 v + 5. Units are mm, N and MPa. A round section bends equally about every axis across it, so
the 12x12 matrices are written with the tangent t alone: N = t t^T projects along the beam, P = I - N across
it, and X = [t]x is the cross product with it. No local axes have to be chosen, and no direction is special.

References
----------
J. S. Przemieniecki, *Theory of Matrix Structural Analysis*, 1968, chapter 5 (element matrices);
R. J. Guyan, "Reduction of stiffness and mass matrices", AIAA Journal 3(2), 1965 (condensation, exact in
statics).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frametwin.geometry.rotations import cross_matrix

if TYPE_CHECKING:
    from scipy import sparse
    from scipy.sparse.linalg import SuperLU


@dataclass(frozen=True, eq=False)
class Sections:
    """How stiff the cross-sections of N struts are.

    Attributes
    ----------
    axial
        (N,) E A in N.
    bending
        (N,) E I in N mm^2.
    twisting
        (N,) G J in N mm^2.
    """

    axial: np.ndarray
    bending: np.ndarray
    twisting: np.ndarray

    @classmethod
    def round(cls, radius: np.ndarray, young: np.ndarray, shear: np.ndarray) -> Sections:
        """Sections of round rods: radius (N,) mm, Young's and shear modulus (N,) MPa or one number."""
        area = np.pi * radius**2
        inertia = np.pi * radius**4 / 4.0
        return cls(axial=young * area, bending=young * inertia, twisting=shear * 2.0 * inertia)

    def __getitem__(self, struts: np.ndarray) -> Sections:
        return Sections(self.axial[struts], self.bending[struts], self.twisting[struts])


def element_stiffness(start: np.ndarray, end: np.ndarray, sections: Sections) -> np.ndarray:
    """Stiffness matrices of straight beams in world axes.

    Parameters
    ----------
    start, end
        (N, 3) ends in mm.
    sections
        Of the N beams.

    Returns
    -------
    (N, 12, 12) matrices over [u, r] of the start, then [u, r] of the end; N/mm, N and N mm.
    """
    axis = end - start
    length = np.linalg.norm(axis, axis=1)
    t = axis / length[:, None]
    along = t[:, :, None] * t[:, None, :]  # (N, 3, 3)
    across = np.eye(3) - along
    bend = sections.bending / length
    twist = (sections.twisting / length)[:, None, None] * along

    force = (sections.axial / length)[:, None, None] * along
    force = force + (12.0 * bend / length**2)[:, None, None] * across
    couple = (6.0 * bend / length)[:, None, None] * cross_matrix(t)
    near = (4.0 * bend)[:, None, None] * across + twist
    far = (2.0 * bend)[:, None, None] * across - twist
    result = np.empty((len(t), 4, 3, 4, 3))  # block by block: np.block takes as long as all the rest
    blocks = (
        (force, -couple, -force, -couple),
        (couple, near, -couple, far),
        (-force, couple, force, couple),
        (couple, far, -couple, near),
    )
    for row, column in np.ndindex(4, 4):
        result[:, row, :, column] = blocks[row][column]
    return result.reshape(-1, 12, 12)


def element_loads(start: np.ndarray, end: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Nodal forces and moments (N, 12) equivalent to even loads ``load`` (N, 3), N per mm of beam."""
    return np.asarray(np.einsum("nfk,nk->nf", loads_along_axes(start, end, np.ones(len(start))), load))


def loads_along_axes(start: np.ndarray, end: np.ndarray, load: np.ndarray) -> np.ndarray:
    """`element_loads` (N, 12, 3) of even loads ``load`` (N,), N per mm of beam, along each of the world's axes."""
    axis = end - start
    whole = (load * np.linalg.norm(axis, axis=1))[:, None, None]
    result = np.empty((len(axis), 12, 3))
    result[:, 0:3] = result[:, 6:9] = whole / 2.0 * np.eye(3)
    result[:, 3:6] = whole / 12.0 * cross_matrix(axis)
    result[:, 9:12] = -result[:, 3:6]
    return result


@dataclass(frozen=True, eq=False)
class Chains:
    """Struts of several straight beams each, condensed to their two ends (Guyan, exact in statics).

    Attributes
    ----------
    points
        (M, P + 1, 3) nodes along each strut in mm.
    stiffness, load
        (M, 12, 12) and (M, 12) of the ends, the inner nodes being eliminated.
    inner_load, inner_ends
        (M, 6 P - 6) and (M, 6 P - 6, 12): inner displacements = inner_load - inner_ends @ end displacements.
    """

    points: np.ndarray
    stiffness: np.ndarray
    load: np.ndarray
    inner_load: np.ndarray
    inner_ends: np.ndarray

    @classmethod
    def build(cls, points: np.ndarray, sections: Sections, load: np.ndarray) -> Chains:
        """Condense struts of P straight beams each.

        Parameters
        ----------
        points
            (M, P + 1, 3) nodes in mm; P = 1 needs no condensation and costs nothing extra.
        sections
            Of the M struts.
        load
            (M, 3) even load in N per mm of strut.
        """
        count, pieces = points.shape[0], points.shape[1] - 1
        full = np.zeros((count, 6 * (pieces + 1), 6 * (pieces + 1)))
        forces = np.zeros((count, 6 * (pieces + 1)))
        for i in range(pieces):
            at = slice(6 * i, 6 * i + 12)
            full[:, at, at] += element_stiffness(points[:, i], points[:, i + 1], sections)
            forces[:, at] += element_loads(points[:, i], points[:, i + 1], load)
        ends = np.r_[0:6, 6 * pieces : 6 * pieces + 6]
        inner = np.arange(6, 6 * pieces)
        between = full[:, inner[:, None], ends]  # (M, 6 P - 6, 12)
        known = np.concatenate([forces[:, inner, None], between], axis=2)
        solved = np.linalg.solve(full[:, inner[:, None], inner], known)
        inner_load, inner_ends = solved[:, :, 0], solved[:, :, 1:]
        return cls(
            points=points,
            stiffness=full[:, ends[:, None], ends] - between.transpose(0, 2, 1) @ inner_ends,
            load=forces[:, ends] - np.einsum("mie,mi->me", between, inner_load),
            inner_load=inner_load,
            inner_ends=inner_ends,
        )

    def recover(self, ends: np.ndarray) -> np.ndarray:
        """Displacements and rotations (M, P + 1, 6) of all nodes from those of the ends (M, 12)."""
        inner = self.inner_load - np.einsum("mie,me->mi", self.inner_ends, ends)
        nodes = np.concatenate([ends[:, :6], inner, ends[:, 6:]], axis=1)
        return nodes.reshape(len(ends), -1, 6)


def assemble(stiffness: np.ndarray, edges: np.ndarray, node_count: int) -> sparse.csc_matrix:
    """Sum element matrices (N, 12, 12) between the nodes ``edges`` (N, 2) into a sparse (6 V, 6 V) matrix."""
    from scipy import sparse  # takes a fifth of a second to load, and fits need none of it

    freedoms = (6 * edges[:, :, None] + np.arange(6)).reshape(-1, 12)
    rows = np.repeat(freedoms, 12, axis=1).ravel()
    columns = np.tile(freedoms, (1, 12)).ravel()
    shape = (6 * node_count, 6 * node_count)
    return sparse.coo_matrix((stiffness.ravel(), (rows, columns)), shape=shape).tocsc()


def assemble_loads(loads: np.ndarray, edges: np.ndarray, node_count: int) -> np.ndarray:
    """Sum element loads (N, 12) between the nodes ``edges`` (N, 2) into (V, 6) nodal forces and moments."""
    return np.stack(
        [np.bincount(edges.ravel(), weights=loads.reshape(-1, 6)[:, k], minlength=node_count) for k in range(6)],
        axis=1,
    )


def factorise(matrix: sparse.csc_matrix) -> SuperLU:
    """Factors of a symmetric positive definite matrix; its ``solve`` then costs little.

    Such a matrix needs no pivoting: the diagonal is taken as it comes, so the fill-in stays what minimum
    degree ordering promises (a tenth of what threshold pivoting makes of a frame of 4,000 struts).
    """
    from scipy.sparse.linalg import splu  # as `assemble` has it

    options = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def solve_clamped(stiffness: sparse.csc_matrix, loads: np.ndarray, clamped: np.ndarray) -> np.ndarray:
    """Displacements (V, 6) under nodal ``loads`` (V, 6), nodes ``clamped`` (V,) held in all six freedoms.

    Nodes that no beam touches are left at zero. One step of iterative refinement makes up for the spread
    between axial and bending stiffness of slender, unevenly hardened struts.
    """
    free = np.repeat(~clamped, 6) & (stiffness.diagonal() > 0.0)
    result = np.zeros(loads.size)
    if free.any():
        inner = stiffness[free][:, free].tocsc()
        factor = factorise(inner)
        force = loads.ravel()[free]
        first = factor.solve(force)
        result[free] = first + factor.solve(force - inner @ first)
    return result.reshape(-1, 6)


def displacement_along(
    points: np.ndarray, ends: np.ndarray, sections: Sections, load: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Displacement (N, S, 3) inside of straight beams under an even load, exact for Euler-Bernoulli beams.

    Cubic Hermite interpolation across the beam from the ends' displacements and rotations, linear along it,
    plus the closed form of what the load does to a beam with clamped ends: q x^2 (L - x)^2 / (24 E I) across
    and q x (L - x) / (2 E A) along.

    Parameters
    ----------
    points
        (N, 2, 3) ends in mm.
    ends
        (N, 12) displacements and rotations of the ends.
    sections
        Of the N beams.
    load
        (N, 3) even load in N/mm.
    at
        (N, S) places along the beams, 0..1.
    """
    axis = points[:, 1] - points[:, 0]
    length = np.linalg.norm(axis, axis=1)[:, None, None]
    t = (axis / length[:, 0])[:, None, :]  # (N, 1, 3)
    x = at[:, :, None]  # (N, S, 1)
    u0, r0, u1, r1 = ends.reshape(-1, 4, 1, 3).transpose(1, 0, 2, 3)  # each (N, 1, 3)

    slope0, slope1 = length * np.cross(r0, t), length * np.cross(r1, t)
    smooth = x * x * (3.0 - 2.0 * x)
    bent = u0 + (u1 - u0) * smooth + slope0 * (x * (1.0 - x) ** 2) - slope1 * (x * x * (1.0 - x))
    stretched = ((u1 - u0) @ t.transpose(0, 2, 1)) * t * (x - smooth)  # along the beam: linear, not cubic
    pull = np.sum(load[:, None] * t, axis=2, keepdims=True) * t
    push = load[:, None] - pull
    bubble = push * (length**4 / (24.0 * sections.bending[:, None, None])) * (x * (1.0 - x)) ** 2
    bubble = bubble + pull * (length**2 / (2.0 * sections.axial[:, None, None])) * (x * (1.0 - x))
    return bent + stretched + bubble
