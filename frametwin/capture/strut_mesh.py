"""The solid of a print as one mesh: for every strut a tube of rings along its curve, with round ends.

The outline of the mesh is that of spheres swept along the centrelines (`frametwin.raster.silhouette`) to a small part
of a pixel. A polygon of circumradius c is seen half as wide as between c cos(pi / n) and c, on average
c sin(pi / n) / (pi / n): the rings are that much larger than the strut, so that the mean outline is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frametwin.cameras import Camera
from frametwin.geometry import bezier
from frametwin.geometry.flattening import chords_needed, second_derivative_bound
from frametwin.geometry.radii import radii_at
from frametwin.geometry.rotation_frames import rotation_minimising_frames
from frametwin.geometry.wireframe import Wireframe

OUTLINE_ERROR = 0.1
"""Largest distance in pixels by which the side of a polygon stands inside of the round outline (its corners stand
half as much outside of it)."""

CHORD_ERROR = 0.05
"""Largest distance in pixels by which the axis of a tube leaves its curve."""

SIDES = (12, 64)
"""Least and greatest number of sides of a tube; always a multiple of 4."""

SHORT = 1.5
"""A strut is short when its ends are nearer to each other than this many radii."""

MOST_SEGMENTS = 64
KINK_PIECES = 8
"""Segments between two given radii on a strut that is there in part, where rings cannot stand at all of these."""


@dataclass(frozen=True, eq=False)
class StrutMesh:
    """A mesh whose faces are counter-clockwise as seen from outside.

    Tubes are open where they end inside of a joint, whose ball belongs to the thickest strut there.

    Attributes
    ----------
    vertices
        (P, 3) float32, mm.
    normals
        (P, 3) float32, unit, of the round surface that the mesh stands for.
    quads, triangles
        (Q, 4) and (T, 3) int32 vertex indices.
    strut
        (Q + T,) int32: the strut of every quad, then of every triangle.
    """

    vertices: np.ndarray
    normals: np.ndarray
    quads: np.ndarray
    triangles: np.ndarray
    strut: np.ndarray


@dataclass(frozen=True)
class Resolution:
    """How fine a mesh is: ``sides`` of a tube (a multiple of 4), ``chord`` in mm by which it may leave the curve."""

    sides: int
    chord: float


def resolution_for(
    frame: Wireframe, thickness: np.ndarray, cameras: Sequence[Camera], least_sides: int = SIDES[0]
) -> Resolution:
    """The resolution at which no outline is wrong by more than `OUTLINE_ERROR` and `CHORD_ERROR` in any of the views.

    Parameters
    ----------
    frame
        Where the struts are, mm.
    thickness
        (E, K) radii in mm.
    cameras
        The views.
    least_sides
        For pictures that show more than the outline.
    """
    points = frame.control_points.reshape(-1, 3)
    radius = float(np.max(thickness))
    pixel = np.inf  # mm, of the nearest strut
    for camera in cameras:
        depth = camera.project(points, distort=False)[1]
        nearest = max(float(np.min(depth, where=depth > radius, initial=np.inf)) - radius, radius)
        pixel = min(pixel, nearest / max(camera.fl_x, camera.fl_y))
    # The side of a polygon stands c (pi / n)^2 / 3 inside of its mean outline, the corner half as much outside.
    sides = np.pi * np.sqrt(radius / pixel / (3.0 * OUTLINE_ERROR)) if np.isfinite(pixel) else SIDES[0]
    return Resolution(
        sides=int(np.clip(4 * np.ceil(sides / 4.0), least_sides, SIDES[1])),
        chord=CHORD_ERROR * (pixel if np.isfinite(pixel) else radius),
    )


def strut_mesh(frame: Wireframe, present: np.ndarray, thickness: np.ndarray, resolution: Resolution) -> StrutMesh:
    """Mesh of the struts that are printed and really there.

    Parameters
    ----------
    frame
        Curves in mm.
    present
        (E, 2) interval of the curve parameter at which each strut is there.
    thickness
        (E, K) radii in mm at even parameters from 0 to 1, K >= 2, linear in between.
    resolution
        See `resolution_for`.
    """
    present, thickness = np.asarray(present, dtype=np.float64), np.asarray(thickness, dtype=np.float64)
    there = np.flatnonzero(frame.printed & (present[:, 1] > present[:, 0]))
    present, thickness = present[there], thickness[there]
    control = sub_curves(frame.control_points[there], present)
    segments = _segments(control, present, thickness, resolution.chord)
    sides = resolution.sides
    mesh = _Assembly()
    tangents, normals = np.zeros((len(there), 2, 3)), np.zeros((len(there), 2, 3))
    for count in np.unique(segments):
        chosen = np.flatnonzero(segments == count)
        frames = rotation_minimising_frames(control[chosen], np.linspace(0.0, 1.0, count + 1), steps=int(count))
        tangents[chosen], normals[chosen] = frames.tangent[:, [0, -1]], frames.normal[:, [0, -1]]
        u = np.linspace(0.0, 1.0, count + 1)
        radius = radii_at(thickness[chosen], present[chosen, :1] + np.diff(present[chosen], axis=1) * u)
        outward = _around(frames.normal, frames.binormal, sides)  # (E, S, sides, 3)
        centres = bezier.evaluate(control[chosen], u)
        normal = _tilted(outward, frames.tangent, centres, radius)
        mesh.add(centres, radius, outward, normal, there[chosen])

    ends = radii_at(thickness, present)
    short = np.linalg.norm(control[:, 3] - control[:, 0], axis=1) < SHORT * ends.max(axis=1, initial=0.0)
    strut, end = np.nonzero(_bare_ends(frame.edges[there], present, ends, short))
    outwards = np.where(end[:, None] == 0, -1.0, 1.0) * tangents[strut, end]
    equator = _around(normals[strut, end], np.cross(outwards, normals[strut, end]), sides)[:, None]
    # Latitudes of a round end, from the equator to the pole, where the last ring shrinks to a point.
    latitude = (0.5 * np.pi * np.arange(sides // 4 + 1) / (sides // 4))[:, None, None]
    outward = np.cos(latitude) * equator + np.sin(latitude) * outwards[:, None, None]
    shape = outward.shape[:2]
    centres = np.broadcast_to(control[strut, 3 * end, None], (*shape, 3))
    mesh.add(centres, np.broadcast_to(ends[strut, end, None], shape), outward, outward, there[strut], pole=True)
    return mesh.whole()


class _Assembly:
    """Pieces of one mesh: rings of vertices, joined to tubes and round ends."""

    def __init__(self) -> None:
        self.vertices: list[np.ndarray] = []
        self.normals: list[np.ndarray] = []
        self.faces: dict[int, list[np.ndarray]] = {4: [], 3: []}
        self.struts: dict[int, list[np.ndarray]] = {4: [], 3: []}
        self.count = 0

    def add(
        self,
        centres: np.ndarray,
        radius: np.ndarray,
        outward: np.ndarray,
        normals: np.ndarray,
        struts: np.ndarray,
        pole: bool = False,
    ) -> None:
        """Surfaces through rings; of the last ring only one point is kept where it is a pole.

        Centres (C, R, 3), radii (C, R), directions from the centres to the vertices and normals (C, R, sides, 3),
        struts (C,).
        """
        count, rings, sides, _ = outward.shape
        wider = (np.pi / sides) / np.sin(np.pi / sides)
        points = centres[:, :, None] + (wider * radius)[:, :, None, None] * outward
        kept = (rings - 1) * sides + 1 if pole else rings * sides
        self.vertices.append(points.reshape(count, rings * sides, 3)[:, :kept].reshape(-1, 3).astype(np.float32))
        self.normals.append(normals.reshape(count, rings * sides, 3)[:, :kept].reshape(-1, 3).astype(np.float32))
        here = np.arange(sides, dtype=np.int32)
        after = (here + 1) % sides
        base = sides * np.arange(rings - (2 if pole else 1), dtype=np.int32)[:, None]
        quads = np.stack([base + here, base + after, base + sides + after, base + sides + here], axis=-1)
        triangles = (rings - 2) * sides + np.stack([here, after, np.full_like(here, sides)], axis=-1)
        first = np.int32(self.count) + np.int32(kept) * np.arange(count, dtype=np.int32)[:, None, None]
        for faces in (quads.reshape(-1, 4), triangles if pole else triangles[:0]):
            corners = faces.shape[1]
            self.faces[corners].append((faces + first).reshape(-1, corners))
            self.struts[corners].append(np.repeat(struts.astype(np.int32), len(faces)))
        self.count += count * kept

    def whole(self) -> StrutMesh:
        """The mesh of all pieces."""
        return StrutMesh(
            vertices=np.concatenate(self.vertices),
            normals=np.concatenate(self.normals),
            quads=np.concatenate(self.faces[4]),
            triangles=np.concatenate(self.faces[3]),
            strut=np.concatenate([*self.struts[4], *self.struts[3]]),
        )


def _bare_ends(edges: np.ndarray, present: np.ndarray, radius: np.ndarray, short: np.ndarray) -> np.ndarray:
    """(E, 2) bool: the ends that get a round end: broken ones, and that of the thickest strut at every joint.

    The half balls of the other struts at the joint lie inside of that one's ball, of which its tube covers the rest;
    not that of a ``short`` (E,) strut, which has round ends of its own. The radius is (E, 2), at both ends.
    """
    at_joint = np.stack([present[:, 0] == 0.0, present[:, 1] == 1.0], axis=1) & ~short[:, None]
    bare = ~at_joint
    places = np.flatnonzero(at_joint.ravel())
    joint = edges.ravel()[places]
    order = places[np.lexsort((places, -radius.ravel()[places], joint))]
    _, first = np.unique(edges.ravel()[order], return_index=True)
    bare.ravel()[order[first]] = True
    return bare


def _tilted(outward: np.ndarray, tangent: np.ndarray, centres: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Normals (E, S, sides, 3) of tubes whose radius (E, S) changes along the way."""
    if np.all(radius == radius[:, :1]):
        return outward
    way = np.zeros_like(radius)
    np.cumsum(np.linalg.norm(np.diff(centres, axis=1), axis=-1), axis=1, out=way[:, 1:])
    step, change = np.diff(way, axis=1), np.diff(radius, axis=1)
    left = np.concatenate([change[:, :1] / step[:, :1], change / step], axis=1)
    right = np.concatenate([change / step, change[:, -1:] / step[:, -1:]], axis=1)
    normal = outward - (0.5 * (left + right))[..., None, None] * tangent[..., None, :]
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _around(normal: np.ndarray, binormal: np.ndarray, sides: int) -> np.ndarray:
    """Unit vectors (..., sides, 3) to the corners of a ring."""
    angle = 2.0 * np.pi * np.arange(sides)[:, None] / sides
    return np.cos(angle) * normal[..., None, :] + np.sin(angle) * binormal[..., None, :]


def sub_curves(control_points: np.ndarray, interval: np.ndarray) -> np.ndarray:
    """Control points (E, 4, 3) of the parts of cubics (E, 4, 3) between two parameters (E, 2), by blossoming."""
    low, high = interval[:, :1], interval[:, 1:]
    parts = []
    for i in range(4):
        points = control_points
        for j in range(3):
            u = (high if j < i else low)[:, None]
            points = (1.0 - u) * points[:, :-1] + u * points[:, 1:]
        parts.append(points[:, 0])
    return np.stack(parts, axis=1)


def _segments(control: np.ndarray, present: np.ndarray, thickness: np.ndarray, chord: float) -> np.ndarray:
    """(E,) number of straight pieces of each tube."""
    segments = np.maximum(1, np.ceil(chords_needed(control, chord))).astype(np.int64)
    # A strut whose radius has kinks gets a ring at each of them.
    kinks = np.abs(np.diff(thickness, n=2, axis=1)).max(axis=1, initial=0.0) > 1e-6 * thickness.max(axis=1)
    intervals = thickness.shape[1] - 1
    whole = (present[:, 0] == 0.0) & (present[:, 1] == 1.0)
    needed = np.where(whole, intervals, KINK_PIECES * intervals)
    # A straight line that is run through at an uneven pace must follow the radius as well.
    taper = np.ptp(thickness, axis=1) > 1e-6 * thickness.max(axis=1)
    length = np.linalg.norm(control[:, 3] - control[:, 0], axis=1)
    uneven = taper & (second_derivative_bound(control) > 1e-6 * length)
    segments = np.where(uneven, np.maximum(segments, KINK_PIECES), segments)
    segments = np.where(kinks, -(-segments // needed) * needed, segments)
    return np.minimum(segments, np.maximum(MOST_SEGMENTS, np.where(kinks, needed, 0)))
