"""From struts that are drawn one by one to a wireframe whose struts meet in joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.blender.frames.welding import weld
from frametwin.blender.scene.units import FLOAT32
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.flattening import is_straight
from frametwin.geometry.wireframe import RADIUS_SHARE, Wireframe, lowest_vertices

STRETCH = 4.0
"""How much further apart than at rest the ends at a joint may be after a deformation."""


@dataclass(frozen=True)
class Reading:
    """How drawn objects are read.

    Attributes
    ----------
    weld
        Ends not further apart than this are one joint, in mm. Where Blender's single precision is coarser, that.
    radius
        Of struts that have no thickness in Blender, in mm; the default of `Wireframe.create` when ``None``.
    split
        What to do about a frame whose struts were pulled apart at a joint: refuse it (``False``), or read it as it
        is drawn, with the joint opened (``True``).
    """

    weld: float = 0.01
    radius: float | None = None
    split: bool = False


@dataclass(frozen=True, eq=False)
class Drawn:
    """Where the segments of an object are, at rest or deformed.

    Attributes
    ----------
    control_points
        (N, 4, 3) mm, world.
    is_straight
        (N,) bool: straight and even, as far as Blender's precision goes.
    """

    control_points: np.ndarray
    is_straight: np.ndarray

    @property
    def ends(self) -> np.ndarray:
        """(N, 2, 3) both ends."""
        return self.control_points[:, [0, 3]]

    def tolerance(self, weld_mm: float) -> float:
        """The distance in mm within which ends are one joint, not below what single precision can tell."""
        return max(weld_mm, 16.0 * FLOAT32 * float(np.abs(self.control_points).max(initial=0.0)))


@dataclass(frozen=True, eq=False)
class Graph:
    """Which of the drawn segments are struts, where they join, and what is known of them.

    Attributes
    ----------
    name, source
        The frame's name, and what to call the object in messages.
    struts
        (E,) drawn segment of each strut.
    vertices
        (V, 3) mm, world, at rest; of use for those that no strut ends on.
    edges, radius, printed, grounded, batch
        As in `Wireframe`; ``radius`` may be one number.
    tolerance
        Mm, how far ends may be from their joint at rest.
    """

    name: str
    source: str
    struts: np.ndarray
    vertices: np.ndarray
    edges: np.ndarray
    radius: np.ndarray | float
    printed: np.ndarray
    grounded: np.ndarray
    batch: np.ndarray
    tolerance: float

    def gaps(self, drawn: Drawn) -> tuple[np.ndarray, np.ndarray]:
        """The joints (V, 3), each where the first strut ends on it, and the distance (E, 2) of every end from its."""
        ends = drawn.ends[self.struts]
        vertices = self.vertices.copy()
        vertices[self.edges.ravel()[::-1]] = ends.reshape(-1, 3)[::-1]  # of several values the last one stays
        return vertices, np.linalg.norm(ends - vertices[self.edges], axis=2)

    def open_joint(self, drawn: Drawn, tolerance: float) -> str:
        """The joint that is open widest, in words; empty if all are closed within the tolerance (mm)."""
        _, gap = self.gaps(drawn)
        if not gap.size or gap.max() <= tolerance:
            return ""
        strut, end = np.unravel_index(int(gap.argmax()), gap.shape)
        other = int(np.argmax((self.edges == self.edges[strut, end]).any(axis=1)))
        return f"struts {other} and {int(strut)} are {gap.max():.3g} mm apart where they meet"

    def refuse_torn(self, drawn: Drawn) -> None:
        """Refuse a deformation that pulls struts apart; it may stretch small gaps that were welded.

        Raises
        ------
        InputError
            If an end is further from its joint than `STRETCH` times the tolerance at rest.
        """
        apart = self.open_joint(drawn, STRETCH * max(self.tolerance, drawn.tolerance(0.0)))
        if apart:
            raise InputError.at(
                self.source,
                "modifiers",
                f"{apart}, though they meet without modifiers",
                "let hooks and other modifiers hold all ends of a joint",
            )

    def wireframe(self, drawn: Drawn) -> Wireframe:
        """The frame with its struts where they are drawn, the ends put onto their joints.

        Raises
        ------
        InputError
            See `Wireframe`.
        """
        vertices, _ = self.gaps(drawn)
        curves = drawn.control_points[self.struts]
        curves[:, [0, 3]] = vertices[self.edges]
        straight = drawn.is_straight[self.struts]
        curves[straight] = bezier.straight(curves[straight, 0], curves[straight, 3])
        return Wireframe.create(
            vertices,
            self.edges,
            radius=self.radius,
            control_points=curves,
            printed=self.printed,
            grounded=self.grounded,
            batch=self.batch,
            name=self.name,
            source=self.source,
        )


def looks_straight(control_points: np.ndarray) -> np.ndarray:
    """(N,) bool: the inner control points are on the thirds of the chord as far as single precision can tell."""
    return is_straight(control_points, 2.0 * FLOAT32 * np.abs(control_points).max(axis=(1, 2)), even=True)


def joined(
    name: str,
    source: str,
    drawn: Drawn,
    *,
    reading: Reading,
    radius: np.ndarray | None = None,
    points: np.ndarray | None = None,
    ends: np.ndarray | None = None,
) -> Graph:
    """Join segments that know nothing of each other, by welding their ends.

    Parameters
    ----------
    name, source
        See `Graph`.
    drawn
        The segments at rest.
    reading
        How to read.
    radius
        (N,) mm, where the segments have a thickness.
    points, ends
        (P, 3) mm and (N, 2): points that segments share already (vertices of a mesh), and the two of each. Joints
        are numbered in the order of the points; by default in the order in which segments end there.

    Returns
    -------
    All printed, in batch 0, standing on their lowest joints. Segments without length are left out, and so is a strut
    drawn twice.

    Raises
    ------
    InputError
        If there is no strut, a segment begins and ends on the same joint, or different struts join the same two.
    """
    if points is None or ends is None:
        points, ends = drawn.ends.reshape(-1, 3), np.arange(2 * len(drawn.control_points)).reshape(-1, 2)
    tolerance = drawn.tolerance(reading.weld)
    edges = weld(points, tolerance)[ends]
    keep = _with_length(drawn.control_points, edges, tolerance, source)
    keep = keep[_first_of_equals(drawn.control_points[keep], edges[keep], tolerance, source, keep)]
    if not len(keep):
        raise InputError.at(source, "geometry", "holds no edge or segment with a length", "draw at least one strut")
    used, first = np.unique(edges[keep], return_index=True)
    edges = np.searchsorted(used, edges[keep])
    vertices = drawn.ends[keep].reshape(-1, 3)[first]
    return Graph(
        name=name,
        source=source,
        struts=keep,
        vertices=vertices,
        edges=edges,
        radius=_default_radius(drawn.control_points[keep], reading) if radius is None else radius[keep],
        printed=np.ones(len(keep), dtype=bool),
        grounded=lowest_vertices(vertices, edges),
        batch=np.zeros(len(keep), dtype=np.int64),
        tolerance=tolerance,
    )


def _default_radius(curves: np.ndarray, reading: Reading) -> float:
    """Mm; fixed at rest, so that a deformation does not make struts thicker."""
    return RADIUS_SHARE * float(np.median(bezier.arc_length(curves))) if reading.radius is None else reading.radius


def _with_length(curves: np.ndarray, edges: np.ndarray, tolerance: float, source: str) -> np.ndarray:
    """Indices of the segments that join two different joints; those that are a mere point are left out."""
    closed = edges[:, 0] == edges[:, 1]
    size = np.linalg.norm(curves - curves[:, :1], axis=2).max(axis=1, initial=0.0)
    loops = np.flatnonzero(closed & (size > 4.0 * tolerance))
    if loops.size:
        raise InputError.at(
            source,
            f"segment {int(loops[0])}",
            "begins and ends on the same joint",
            "subdivide it, so that it becomes two or more struts",
        )
    return np.flatnonzero(~closed)


def _first_of_equals(
    curves: np.ndarray, edges: np.ndarray, tolerance: float, source: str, numbers: np.ndarray
) -> np.ndarray:
    """Positions of the segments without those that repeat an earlier one, in either direction."""
    pairs = np.sort(edges, axis=1)
    _, first, group = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    original = first[group.ravel()]
    again = np.flatnonzero(original != np.arange(len(edges)))
    turned = edges[again, 0] != edges[original[again], 0]
    repeats = np.where(turned[:, None, None], curves[again, ::-1], curves[again])
    away = np.linalg.norm(repeats - curves[original[again]], axis=2).max(axis=1, initial=0.0)
    different = np.flatnonzero(away > 4.0 * tolerance)
    if different.size:
        i = int(again[different[0]])
        raise InputError.at(
            source,
            f"segment {int(numbers[i])}",
            f"joins the same two joints as segment {int(numbers[original[i]])}",
            "remove one of the two, or subdivide it",
        )
    return np.flatnonzero(original == np.arange(len(edges)))
