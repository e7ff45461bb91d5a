"""The elastic model of a wireframe: its struts as beams, condensed to the joints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy import sparse

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.flattening import ROUNDING, is_straight
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.beams import (
    Chains,
    Sections,
    assemble,
    assemble_loads,
    displacement_along,
    solve_clamped,
)
from frametwin.ranges import above, between, check_settings
from frametwin.wording import listed

GRAVITY = 9.80665
"""Standard gravity in m/s^2."""


@dataclass(frozen=True)
class Material:
    """An isotropic material; the defaults are solid PLA.

    Attributes
    ----------
    young
        Young's modulus in MPa.
    poisson
        Poisson's ratio.
    density
        Density in g/cm^3.
    """

    young: Annotated[float, above(0.0)] = 3500.0
    poisson: Annotated[float, between(-1.0, 0.5)] = 0.35
    density: Annotated[float, above(0.0)] = 1.24

    def __post_init__(self) -> None:
        check_settings(self, "material")

    @property
    def shear(self) -> float:
        """Shear modulus in MPa."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def weight(self) -> float:
        """Weight of a volume in N/mm^3."""
        return 1e-6 * self.density * GRAVITY


PLA = Material()


@dataclass(frozen=True, eq=False)
class _Group:
    """Struts with the same number of pieces: their indices in the frame (M,) and their beams."""

    struts: np.ndarray
    chains: Chains


@dataclass(frozen=True, eq=False)
class FrameBeams:
    """The struts of a frame as beams: a straight strut is one, a curved one several, condensed to its ends.

    Attributes
    ----------
    frame
        The frame at rest; only its printed struts carry and weigh anything.
    sections
        Of all E struts.
    load
        (E, 3) even load on the struts in N/mm: their weight, unless others were given.
    groups
        The beams, by number of pieces.
    """

    frame: Wireframe
    sections: Sections
    load: np.ndarray
    groups: tuple[_Group, ...]

    @classmethod
    def build(
        cls,
        frame: Wireframe,
        stiffness_scale: np.ndarray | None = None,
        *,
        axial_scale: np.ndarray | None = None,
        material: Material = PLA,
        weightless: bool = False,
        load: np.ndarray | None = None,
        pieces: int = 4,
    ) -> FrameBeams:
        """Make beams of the printed struts.

        Parameters
        ----------
        frame
            The frame at rest.
        stiffness_scale
            (E,) factors on the stiffness of each strut; default ones.
        axial_scale
            (E,) factors on the stiffness along each strut, where they are others.
        material
            Of all struts.
        weightless
            Leave the struts' own weight out.
        load
            (E, 3) even loads in N/mm that take the place of the struts' weight.
        pieces
            Straight beams along a curved strut.

        Raises
        ------
        InputError
            If the factors are not (E,) or not above 0.
        """
        scale = _factors(frame, "stiffness_scale", stiffness_scale)
        axial = scale if axial_scale is None else _factors(frame, "axial_scale", axial_scale)
        sections = Sections.round(frame.radius, material.young * scale, material.shear * scale)
        sections = replace(sections, axial=material.young * axial * np.pi * frame.radius**2)
        if load is None:
            load = _down(material.weight * np.pi * frame.radius**2 * (0.0 if weightless else 1.0))
        curved = ~is_straight(frame.control_points, ROUNDING * frame.chord_lengths)
        groups = []
        for mask, count in ((~curved, 1), (curved, pieces)):
            struts = np.flatnonzero(mask & frame.printed)
            if len(struts):
                points = bezier.evaluate(frame.control_points[struts], np.arange(count + 1) / count)
                groups.append(_Group(struts, Chains.build(points, sections[struts], load[struts])))
        return cls(frame, sections, load, tuple(groups))

    @property
    def weight(self) -> np.ndarray:
        """(E,) downward part of the loads in N/mm."""
        return -self.load[:, 2]

    def stiffness(self) -> sparse.csc_matrix:
        """Stiffness of the joints, before any of them is held.

        Returns
        -------
        (6 V, 6 V) sparse matrix
            Symmetric and positive semi-definite; vertex v owns rows 6 v .. 6 v + 5 (ux uy uz rx ry rz). N/mm between
            displacements, N between displacements and rotations, N mm between rotations. Rows and columns of joints
            without printed struts are empty.
        """
        matrix = sparse.csc_matrix((6 * self.frame.vertex_count,) * 2)
        for group in self.groups:
            edges = self.frame.edges[group.struts]
            matrix = matrix + assemble(group.chains.stiffness, edges, self.frame.vertex_count)
        return matrix

    def loads(self) -> np.ndarray:
        """Forces and moments (V, 6) of the struts' weight on the joints, N and N mm."""
        total = np.zeros((self.frame.vertex_count, 6))
        for group in self.groups:
            edges = self.frame.edges[group.struts]
            total += assemble_loads(group.chains.load, edges, self.frame.vertex_count)
        return total

    def solve(self, joint_loads: np.ndarray | None = None) -> np.ndarray:
        """Displacements and rotations (V, 6) of the joints; grounded joints are clamped.

        Parameters
        ----------
        joint_loads
            (V, 6) forces in N and moments in N mm on the joints, besides the struts' weight.
        """
        loads = self.loads() if joint_loads is None else self.loads() + joint_loads
        return solve_clamped(self.stiffness(), loads, self.frame.grounded)

    def along_struts(self, joints: np.ndarray, m: int) -> np.ndarray:
        """Displacement (E, m + 1, 3) of the points j / m of every strut's curve, zero on unprinted struts.

        Parameters
        ----------
        joints
            (V, 6) displacements and rotations of the joints.
        m
            Number of intervals of the curve parameter.
        """
        parameters = np.arange(m + 1) / m
        result = np.zeros((self.frame.strut_count, m + 1, 3))
        for group in self.groups:
            nodes = group.chains.recover(joints[self.frame.edges[group.struts]].reshape(-1, 12))
            curve = bezier.evaluate(self.frame.control_points[group.struts], parameters)
            pieces = nodes.shape[1] - 1
            piece = np.minimum((parameters * pieces).astype(int), pieces - 1)
            for i in range(pieces):
                at = np.flatnonzero(piece == i)
                moved = self._along_piece(group, nodes[:, i : i + 2], i, curve[:, at])
                result[group.struts[:, None], at] = moved
        return result

    def _along_piece(self, group: _Group, ends: np.ndarray, i: int, curve: np.ndarray) -> np.ndarray:
        """Displacement of the points ``curve`` (M, S, 3) next to the i-th beam of the group's struts."""
        points = group.chains.points[:, i : i + 2]
        axis = points[:, 1] - points[:, 0]
        relative = curve - points[:, :1]
        x = np.einsum("msk,mk->ms", relative, axis) / np.sum(axis**2, axis=1)[:, None]
        load, sections = self.load[group.struts], self.sections[group.struts]
        moved = displacement_along(points, ends.reshape(-1, 12), sections, load, x)
        # The curve beside its chord turns with the section it belongs to.
        rotation = ends[:, :1, 3:] * (1.0 - x[:, :, None]) + ends[:, 1:, 3:] * x[:, :, None]
        return moved + np.cross(rotation, relative - x[:, :, None] * axis[:, None])


def _down(weight: np.ndarray) -> np.ndarray:
    """Even loads (N, 3) that act downwards."""
    return weight[:, None] * np.array([0.0, 0.0, -1.0])


def _factors(frame: Wireframe, field: str, values: np.ndarray | None) -> np.ndarray:
    """Factors (E,) above 0, checked; ones if there are none."""
    if values is None:
        return np.ones(frame.strut_count)
    factors = np.asarray(values, dtype=np.float64)
    if factors.shape != (frame.strut_count,) or not np.all((factors > 0.0) & np.isfinite(factors)):
        raise InputError.at(
            frame.name, field, "is not a number above 0 for every strut", f"give {frame.strut_count} factors"
        )
    return factors


def require_grounded(frame: Wireframe) -> None:
    """Check that every printed strut is connected to a grounded vertex by printed struts.

    Raises
    ------
    InputError
        If nothing is printed, nothing printed is grounded, or struts are loose; it says how many.
    """
    part, edge_ids, _ = frame.printed_part()
    if not part.grounded.any():
        raise InputError.at(
            frame.name,
            "grounded",
            "no printed strut ends on a grounded vertex, so nothing holds the print up",
            "mark the vertices that stand on the base as grounded",
        )
    count, labels = part.components()
    held = np.zeros(count, dtype=bool)
    held[labels[part.grounded]] = True
    loose = np.flatnonzero(~held[labels[part.edges[:, 0]]])
    if len(loose):
        raise InputError.at(
            frame.name,
            "edges",
            f"{len(loose)} printed struts have no connection to a grounded vertex ({listed(edge_ids[loose], 5)})",
            "connect them, mark one of their vertices as grounded, or mark them as not printed",
        )
