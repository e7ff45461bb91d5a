"""The wireframe: a graph of struts, each a cubic Bezier curve with its ends on two vertices."""

from __future__ import annotations

import dataclasses
from dataclasses import InitVar, dataclass
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.flattening import ROUNDING, is_straight
from frametwin.geometry.wireframe_checks import check_graph, check_name, checked_fields, snapped_curves

ARRAYS = ("vertices", "edges", "control_points", "radius", "printed", "grounded", "batch")
"""Fields of a wireframe that are arrays."""

RADIUS_SHARE = 0.06
"""Default strut radius as a share of the median strut length."""


def straight_control_points(vertices: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Control points (E, 4, 3) of straight struts, evenly spaced; the ends are the vertices bit for bit."""
    return bezier.straight(vertices[edges[:, 0]], vertices[edges[:, 1]])


@dataclass(frozen=True, eq=False, repr=False)
class Wireframe:
    """A wireframe, planned or real. All arrays are checked, copied and read-only; lengths are in mm, z is up.

    Attributes
    ----------
    vertices
        (V, 3) joints; a vertex that no strut uses is allowed.
    edges
        (E, 2) int64 vertex indices of each strut, 0-based; the order is the direction of its curve.
    control_points
        (E, 4, 3) cubic Bezier curves, ends on the strut's vertices (exactly: they are snapped).
    radius
        (E,) strut radius.
    printed
        (E,) bool, True where the strut has been printed already.
    grounded
        (V,) bool, True where the vertex stands on the base.
    batch
        (E,) int64, the order in which groups of struts are printed.
    name
        What to call the frame.

    Raises
    ------
    InputError
        If anything is not as described; the message names ``source`` (a file, say), the field and the index.

    Notes
    -----
    `Wireframe.create` fills in what is not known.
    """

    vertices: np.ndarray
    edges: np.ndarray
    control_points: np.ndarray
    radius: np.ndarray
    printed: np.ndarray
    grounded: np.ndarray
    batch: np.ndarray
    name: str = "frame"
    source: InitVar[str] = "frame"

    def __post_init__(self, source: str) -> None:
        check_name(self.name, str(source))
        arrays = {name: getattr(self, name) for name in ARRAYS}
        for field, value in checked_fields(arrays, str(source)).items():
            value.setflags(write=False)
            object.__setattr__(self, field, value)

    def __repr__(self) -> str:
        return f"Wireframe({self.name!r}, {self.vertex_count} vertices, {self.strut_count} struts)"

    @classmethod
    def create(
        cls,
        vertices: Any,
        edges: Any,
        *,
        radius: Any = None,
        control_points: Any = None,
        printed: Any = None,
        grounded: Any = None,
        batch: Any = None,
        name: str = "frame",
        source: str = "frame",
    ) -> Wireframe:
        """Build a wireframe from arrays or nested lists, filling in what is ``None``.

        Parameters
        ----------
        vertices, edges
            (V, 3) mm and (E, 2).
        radius
            (E,) or one number in mm; default 6 % of the median strut length.
        control_points
            (E, 4, 3) mm; default straight struts.
        printed
            (E,) bool; default all printed.
        grounded
            (V,) bool; default see `lowest_vertices`.
        batch
            (E,) integers; default zeros.
        name, source
            The frame's name, and what to call its source in messages.

        Raises
        ------
        InputError
            See `Wireframe`.
        """
        points = checked_array(vertices, "f", (None, 3), source, "vertices")
        struts = checked_array(edges, "i", (None, 2), source, "edges")
        check_graph(points, struts, source)
        count = len(struts)
        if control_points is None:
            curves = straight_control_points(points, struts)
        else:
            curves = snapped_curves(control_points, points, struts, source)
        if radius is None:
            radius = RADIUS_SHARE * float(np.median(bezier.arc_length(curves)))
        if not isinstance(radius, list | tuple) and np.ndim(radius) == 0:  # a ragged list has no dimension
            radius = np.full(count, checked_array(radius, "f", (), source, "radius"))
        return cls(
            vertices=points,
            edges=struts,
            control_points=curves,
            radius=radius,
            printed=np.ones(count, dtype=bool) if printed is None else printed,
            grounded=lowest_vertices(points, struts) if grounded is None else grounded,
            batch=np.zeros(count, dtype=np.int64) if batch is None else batch,
            name=name,
            source=source,
        )

    @property
    def strut_count(self) -> int:
        """Number of struts E."""
        return len(self.edges)

    @property
    def vertex_count(self) -> int:
        """Number of vertices V."""
        return len(self.vertices)

    @property
    def lengths(self) -> np.ndarray:
        """(E,) arc lengths of the curves in mm."""
        return bezier.arc_length(self.control_points)

    @property
    def chord_lengths(self) -> np.ndarray:
        """(E,) distances between the struts' ends in mm."""
        return np.linalg.norm(self.control_points[:, 3] - self.control_points[:, 0], axis=1)

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) lowest and highest coordinates of the control points in mm; every curve lies inside."""
        points = self.control_points.reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @property
    def extent(self) -> float:
        """Longest side of `bounds` in mm."""
        return float(np.ptp(self.bounds, axis=0).max())

    @property
    def degree(self) -> np.ndarray:
        """(V,) number of struts that meet at each vertex."""
        return np.bincount(self.edges.ravel(), minlength=self.vertex_count)

    @property
    def is_straight(self) -> bool:
        """True if every strut is straight with evenly spaced control points (to `ROUNDING` of the extent)."""
        return bool(is_straight(self.control_points, ROUNDING * self.extent, even=True).all())

    def replace(self, **changes: Any) -> Wireframe:
        """Return a copy with other values in some fields, checked anew.

        Whoever moves vertices gives the matching ``control_points`` too.

        Raises
        ------
        InputError
            See `Wireframe`.
        """
        return dataclasses.replace(self, **{"source": self.name, **changes})

    def moved_to(self, vertices: np.ndarray) -> Wireframe:
        """The frame with its joints at ``vertices`` (V, 3) in mm, every curve following its ends in proportion.

        Control point i moves by (1 - i/3, i/3) of what the ends do; what does not move stays as it is to the last bit.
        """
        ends = (vertices - self.vertices)[self.edges]  # (E, 2, 3)
        curves = self.control_points + bezier.straight(ends[:, 0], ends[:, 1])
        curves[:, 0], curves[:, 3] = vertices[self.edges[:, 0]], vertices[self.edges[:, 1]]
        return self.replace(vertices=vertices, control_points=curves)

    def detached(self, ends: np.ndarray, **changes: Any) -> Wireframe:
        """The frame in which some ends of struts have vertices of their own, at their place, after all others.

        Parameters
        ----------
        ends
            (T, 2) strut, and 0 for its start or 1 for its end; end i gets the vertex ``vertex_count + i``.
        changes
            Other values in some fields, as for `replace`; ``vertices`` are those that the frame has now.

        Raises
        ------
        InputError
            See `Wireframe`.
        """
        strut, side = np.asarray(ends, dtype=np.int64).reshape(-1, 2).T
        curves = changes.get("control_points", self.control_points)
        edges = np.array(self.edges)
        edges[strut, side] = self.vertex_count + np.arange(len(strut))
        fields = {
            **changes,
            "vertices": np.concatenate([changes.get("vertices", self.vertices), curves[strut, 3 * side]]),
            "edges": edges,
            "grounded": np.concatenate([self.grounded, np.zeros(len(strut), dtype=bool)]),
        }
        return self.replace(**fields)

    def subset(self, edge_mask: Any) -> tuple[Wireframe, np.ndarray]:
        """Keep the struts of ``edge_mask`` (E,) bool, in their order, and the vertices they use.

        Returns
        -------
        frame, vertex_ids
            The smaller frame, and (V',) the index in this frame of each of its vertices.

        Raises
        ------
        InputError
            If the mask keeps no strut.
        """
        mask = checked_array(edge_mask, "b", (self.strut_count,), self.name, "edge_mask")
        vertex_ids, edges = np.unique(self.edges[mask], return_inverse=True)
        frame = dataclasses.replace(
            self,
            vertices=self.vertices[vertex_ids],
            edges=edges.reshape(-1, 2),
            control_points=self.control_points[mask],
            radius=self.radius[mask],
            printed=self.printed[mask],
            grounded=self.grounded[vertex_ids],
            batch=self.batch[mask],
            source=self.name,
        )
        return frame, vertex_ids

    def printed_part(self) -> tuple[Wireframe, np.ndarray, np.ndarray]:
        """Keep what has been printed.

        Returns
        -------
        frame, edge_ids, vertex_ids
            The printed frame and the indices in this frame of its struts (E',) and vertices (V',).

        Raises
        ------
        InputError
            If nothing has been printed.
        """
        if not self.printed.any():
            raise InputError.at(self.name, "printed", "no strut is printed", "mark at least one strut as printed")
        frame, vertex_ids = self.subset(self.printed)
        return frame, np.flatnonzero(self.printed), vertex_ids

    def _touched(self, mask: np.ndarray) -> np.ndarray:
        touched = np.zeros(self.vertex_count, dtype=bool)
        touched[self.edges[mask].ravel()] = True
        return touched

    def printed_vertices(self) -> np.ndarray:
        """(V,) bool: at least one printed strut ends there."""
        return self._touched(self.printed)

    def components(self) -> tuple[int, np.ndarray]:
        """Find the connected parts of the graph.

        Returns
        -------
        count, labels
            Their number, and (V,) the part of each vertex, numbered from 0 in the order of their first
            vertices; -1 for vertices that no strut uses, which are not counted.
        """
        root = np.arange(self.vertex_count)
        start, end = self.edges.T
        while True:  # hang the larger root below the smaller, then flatten; a few rounds suffice
            low = np.minimum(root[start], root[end])
            high = np.maximum(root[start], root[end])
            if np.array_equal(low, high):
                break
            np.minimum.at(root, high, low)
            while not np.array_equal(root, root[root]):
                root = root[root]
        used = self.degree > 0
        labels = np.full(self.vertex_count, -1, dtype=np.int64)
        values, labels[used] = np.unique(root[used], return_inverse=True)
        return len(values), labels

    def transformed(self, matrix: Any) -> Wireframe:
        """Move the frame by an affine ``matrix`` (4, 4); radii grow by the cube root of its volume factor.

        Raises
        ------
        InputError
            If the matrix is not finite, is singular, or has a last row other than 0 0 0 1.
        """
        m = checked_array(matrix, "f", (4, 4), self.name, "matrix")
        if not np.array_equal(m[3], [0.0, 0.0, 0.0, 1.0]):
            raise InputError.at(self.name, "matrix", "the last row is not 0 0 0 1", "give an affine matrix")
        scale = abs(float(np.linalg.det(m[:3, :3]))) ** (1.0 / 3.0)
        if scale <= 1e-12 * float(np.abs(m[:3, :3]).max(initial=0.0)):
            raise InputError.at(self.name, "matrix", "is singular", "give a matrix that can be inverted")
        vertices = self.vertices @ m[:3, :3].T + m[:3, 3]
        if np.array_equal(self.control_points, straight_control_points(self.vertices, self.edges)):
            curves = straight_control_points(vertices, self.edges)  # stays straight to the last bit
        else:
            curves = self.control_points @ m[:3, :3].T + m[:3, 3]
        return self.replace(vertices=vertices, control_points=curves, radius=self.radius * scale)


def lowest_vertices(vertices: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(V,) bool: within 0.5 mm, or 0.3 % of the height if that is more, of the lowest vertex of a strut."""
    used = vertices[edges.ravel(), 2]
    return vertices[:, 2] <= used.min() + max(0.5, 0.003 * float(np.ptp(used)))
