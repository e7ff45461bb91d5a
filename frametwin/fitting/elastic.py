"""The frame as the fitter moves it: joints that shift and turn, struts that follow, and how stiff all that is."""

from __future__ import annotations

from copy import copy

import numpy as np

from frametwin.fitting.stubs import tell_typical
from frametwin.geometry import bezier
from frametwin.geometry.rotations import cross_matrix
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.beams import Sections, element_stiffness
from frametwin.mechanics.blocks import BlockMatrix, BlockPattern

INNER = slice(3, 9)
"""Of a strut's twelve control coordinates, the two inner points."""

ANCHOR = 1e-6
"""Stiffness, relative to the mean diagonal, that holds what neither pictures nor struts hold."""

PINNED = 1e9
"""The same that holds joints that shall not move."""

QUADRATURE = 24
"""Intervals for the energies of the inner control points; they are polynomials of low degree."""


class ElasticFrame:
    """Displacements of a frame's curves, linear in six freedoms a joint and six a strut.

    A joint shifts by u and turns by w (small angle). Control points next to it follow as on a Hermite beam: u, the
    arm turned by w, and a third of the strut's stretch. What a strut does on its own is added to its two inner
    control points. The elastic energy is that of round beams (for the joints) and of bending and uneven stretch (for
    the inner points); stiffness is given relative to the median strut's resistance to a sideways shift of one end,
    so that an energy of 1/2 is such a strut, shifted by its radius.

    Attributes
    ----------
    edges : (E, 2).
    follow : (E, 12, 12) from the freedoms of both ends (u, w, u, w) to the four control points' displacements.
    freedoms : (E, 12) indices of the ends' freedoms, vertex v owning 6 v .. 6 v + 5.
    stiffness : (E, 12, 12) of each strut, over the ends' freedoms.
    spin_stiffness : (E, 12, 12) against turns of the ends about the strut's own chord, which nothing else holds in a
        strut that stands alone: turns are linear here, and a bent strut that spun would fly apart.
    inner_stiffness : (E, 6, 6) over the inner control points.
    """

    def __init__(self, frame: Wireframe) -> None:
        self.frame = frame
        self.edges = frame.edges
        self.vertex_count = frame.vertex_count
        self._pinned = np.zeros(0, dtype=np.int64)
        start, end = frame.control_points[:, 0], frame.control_points[:, 3]
        chord = np.linalg.norm(end - start, axis=1)
        area, inertia = np.pi * frame.radius**2, np.pi * frame.radius**4 / 4.0
        typical = tell_typical(chord, frame.radius)
        unit = float(np.median((12.0 * inertia / chord**3)[typical]) * np.median(frame.radius[typical]) ** 2)
        self.follow = _hermite(frame.control_points)
        self.freedoms = (6 * frame.edges[:, :, None] + np.arange(6)).reshape(-1, 12)
        young = np.full(len(chord), 1.0 / unit)
        self.stiffness = element_stiffness(start, end, Sections.round(frame.radius, young, young / 2.7))
        tangent = (end - start) / chord[:, None]
        self.spin_stiffness = _spin_stiffness(tangent, young / 2.7 * 2.0 * inertia / chord)
        self.inner_stiffness = _inner_stiffness(tangent, inertia / chord**3 / unit, area / chord / unit)
        self._find_pattern()

    def stiffened(self, factor: np.ndarray) -> ElasticFrame:
        """The same with struts that are stiffer by a factor (E,)."""
        stiffer = copy(self)
        for name in ("stiffness", "spin_stiffness", "inner_stiffness"):
            setattr(stiffer, name, factor[:, None, None] * getattr(self, name))
        return stiffer

    def part(self, frame: Wireframe, struts: np.ndarray, pinned: np.ndarray) -> ElasticFrame:
        """Some struts by themselves, as stiff as they are here.

        Parameters
        ----------
        frame : Wireframe
            Of these struts.
        struts : (E',) array of int
        pinned : (V',) array of bool
            Joints of that frame that neither shift nor turn.
        """
        result = copy(self)
        result.frame, result.edges, result.vertex_count = frame, frame.edges, frame.vertex_count
        for name in ("follow", "stiffness", "spin_stiffness", "inner_stiffness"):
            setattr(result, name, getattr(self, name)[struts])
        result.freedoms = (6 * frame.edges[:, :, None] + np.arange(6)).reshape(-1, 12)
        result._find_pattern()
        result._pinned = (6 * np.flatnonzero(pinned)[:, None] + np.arange(6)).ravel()
        return result

    def _find_pattern(self) -> None:
        """Where every element's entries go in the assembled matrix; found once, as it never changes."""
        self._pattern = BlockPattern.of(self.edges, self.vertex_count)
        self._touched = np.zeros(self.vertex_count, dtype=bool)
        self._touched[self.edges.ravel()] = True

    def assemble(self, blocks: np.ndarray, joint_blocks: np.ndarray | None = None) -> BlockMatrix:
        """Sum strut blocks (E, 12, 12) and joint blocks (V, 3, 3) over the shifts into a (6V, 6V) matrix."""
        entries = self._pattern.summed(blocks)
        if joint_blocks is not None:
            entries[self._pattern.own[self._touched, :3, :3]] += joint_blocks[self._touched]
        return BlockMatrix(self._pattern, entries)

    def assemble_vector(self, parts: np.ndarray, joint_parts: np.ndarray | None = None) -> np.ndarray:
        """Sum strut parts (E, 12) and joint parts (V, 3) into (6V,)."""
        total = np.bincount(self.freedoms.ravel(), weights=parts.ravel(), minlength=6 * self.vertex_count)
        if joint_parts is not None:
            total.reshape(-1, 6)[:, :3] += joint_parts
        return total

    def anchored(self, matrix: BlockMatrix) -> BlockMatrix:
        """The matrix with a faint spring on every freedom, so that it can be factorised."""
        mean = float(matrix.diagonal.mean())
        springs = np.full(len(self._pattern.diagonal), ANCHOR * mean if mean > 0.0 else 1.0)
        springs[self._pinned] += PINNED * max(mean, 1.0)
        return matrix.plus_diagonal(springs)

    def solve(self, matrix: BlockMatrix, right: np.ndarray) -> np.ndarray:
        """Solution of the anchored system."""
        return self.anchored(matrix).factorise().solve(right)

    def displaced(self, control_points: np.ndarray, joints: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Control points (E, 4, 3) after the joints' freedoms (V, 6) and the struts' own (E, 6)."""
        ends = joints.ravel()[self.freedoms]
        moved = control_points + np.matmul(self.follow, ends[:, :, None])[:, :, 0].reshape(-1, 4, 3)
        moved[:, 1:3] += inner.reshape(-1, 2, 3)
        return moved

    def freedoms_of(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The joints' freedoms (V, 6) and the struts' own (E, 6) that give a displacement (E, 4, 3) of the curves.

        Shifts are those of the ends; turns are the least-squares ones of the arms of all struts at a joint.
        """
        joints = np.zeros((self.vertex_count, 6))
        for side in (0, 1):
            joints[self.edges[:, side], :3] = displacement[:, 3 * side]
        matrix, right = np.zeros((self.vertex_count, 3, 3)), np.zeros((self.vertex_count, 3))
        shifted = self.displaced(np.zeros_like(displacement), joints, np.zeros((len(self.edges), 6)))
        for side, (turn, point) in enumerate(((slice(3, 6), 1), (slice(9, 12), 2))):
            arm = self.follow[:, 3 * point : 3 * point + 3, turn]
            gap = displacement[:, point] - shifted[:, point]
            np.add.at(matrix, self.edges[:, side], np.matmul(arm.transpose(0, 2, 1), arm))
            np.add.at(right, self.edges[:, side], np.einsum("eji,ej->ei", arm, gap))
        trace = np.trace(matrix, axis1=1, axis2=2)
        matrix += (1e-3 * trace + 1e-12)[:, None, None] * np.eye(3)
        joints[:, 3:] = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
        inner = displacement - self.displaced(np.zeros_like(displacement), joints, np.zeros((len(self.edges), 6)))
        return joints, inner[:, 1:3].reshape(-1, 6)


def _hermite(control_points: np.ndarray) -> np.ndarray:
    """(E, 12, 12): control points follow the ends' shifts, turns and a third of the stretch."""
    arm_start = control_points[:, 1] - control_points[:, 0]
    arm_end = control_points[:, 2] - control_points[:, 3]
    chord = control_points[:, 3] - control_points[:, 0]
    tangent = chord / np.linalg.norm(chord, axis=1)[:, None]
    third = tangent[:, :, None] * tangent[:, None, :] / 3.0
    result = np.zeros((len(control_points), 12, 12))
    one = np.eye(3)
    result[:, 0:3, 0:3] = one
    result[:, 9:12, 6:9] = one
    result[:, 3:6, 0:3], result[:, 3:6, 6:9] = one - third, third
    result[:, 6:9, 0:3], result[:, 6:9, 6:9] = third, one - third
    result[:, 3:6, 3:6] = -cross_matrix(arm_start)
    result[:, 6:9, 9:12] = -cross_matrix(arm_end)
    return result


def _spin_stiffness(tangent: np.ndarray, torsion: np.ndarray) -> np.ndarray:
    """(E, 12, 12): each end held against turns about the tangent (E, 3) as by the strut's own torsion (E,)."""
    result = np.zeros((len(tangent), 12, 12))
    result[:, 3:6, 3:6] = torsion[:, None, None] * tangent[:, :, None] * tangent[:, None, :]
    result[:, 9:12, 9:12] = result[:, 3:6, 3:6]
    return result


def _inner_stiffness(tangent: np.ndarray, bending: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """(E, 6, 6): bending across the strut; along it, stretch and its unevenness, which silhouettes do not show."""
    u = np.linspace(0.0, 1.0, QUADRATURE + 1)
    weight = np.full(QUADRATURE + 1, 1.0 / QUADRATURE)
    weight[[0, -1]] /= 2.0
    first, second = (_inner_derivative(u, order) for order in (1, 2))
    even = np.einsum("s,si,sj->ij", weight, first, first)
    bent = np.einsum("s,si,sj->ij", weight, second, second)
    along = tangent[:, :, None] * tangent[:, None, :]
    across = np.eye(3) - along
    energy = np.einsum("ij,eab,e->eiajb", bent, across, bending) + np.einsum(
        "ij,eab,e->eiajb", even + bent, along, stretch
    )
    return energy.reshape(-1, 6, 6)


def _inner_derivative(u: np.ndarray, order: int) -> np.ndarray:
    """(S, 2) derivatives of the two inner Bernstein polynomials."""
    unit = np.zeros((2, 4, 1))
    unit[0, 1, 0] = unit[1, 2, 0] = 1.0
    return bezier.derivative(np.concatenate([unit, np.zeros((2, 4, 2))], axis=2), u, order)[:, :, 0].T
