"""What makes a wireframe valid, each fault named with its index."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frametwin.arrays import checked_array, is_plain_text
from frametwin.errors import InputError

_JOIN_TOLERANCE = 1e-6  # curve ends to vertices, relative to the extent
_ZERO_LENGTH = 1e-9  # shortest chord, relative to the extent


def check_graph(vertices: np.ndarray, edges: np.ndarray, source: str) -> None:
    """Refuse an empty frame, indices out of range, self-loops, duplicate struts and struts without length."""
    count = len(vertices)
    if len(edges) == 0:
        raise InputError.at(source, "edges", "the frame holds no strut", "give at least one strut")
    if count == 0:
        raise InputError.at(source, "vertices", "the frame holds no vertex", "give the vertices that the struts join")
    outside = np.flatnonzero(((edges < 0) | (edges >= count)).any(axis=1))
    if outside.size:
        i = int(outside[0])
        pair = tuple(int(v) for v in edges[i])
        raise InputError.at(
            source,
            f"edges[{i}]",
            f"{pair} names a vertex that does not exist ({count} vertices)",
            f"use vertex indices from 0 to {count - 1}",
        )
    loops = np.flatnonzero(edges[:, 0] == edges[:, 1])
    if loops.size:
        i = int(loops[0])
        raise InputError.at(source, f"edges[{i}]", f"joins vertex {int(edges[i, 0])} to itself", "remove the strut")
    _, first, group = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[group.ravel()] != np.arange(len(edges)))
    if again.size:
        i, j = int(again[0]), int(first[group.ravel()[again[0]]])
        pair = tuple(int(v) for v in edges[i])
        raise InputError.at(source, f"edges[{i}]", f"{pair} repeats edges[{j}]", "remove one of the two struts")
    chords = np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1)
    extent = float(np.ptp(vertices[edges.ravel()], axis=0).max())
    short = np.flatnonzero(chords <= _ZERO_LENGTH * extent)
    if short.size:
        i = int(short[0])
        raise InputError.at(
            source,
            f"edges[{i}]",
            "the strut has no length: its two vertices coincide",
            "merge the two vertices",
        )


def snapped_curves(control_points: Any, vertices: np.ndarray, edges: np.ndarray, source: str) -> np.ndarray:
    """Check that curves end on their vertices, and make them end there exactly."""
    curves = checked_array(control_points, "f", (len(edges), 4, 3), source, "control_points")
    ends = vertices[edges]  # (E, 2, 3)
    gap = np.linalg.norm(curves[:, [0, 3]] - ends, axis=2)
    far = np.argwhere(gap > _JOIN_TOLERANCE * float(np.ptp(vertices[edges.ravel()], axis=0).max()))
    if far.size:
        i, end = (int(v) for v in far[0])
        raise InputError.at(
            source,
            f"control_points[{i}][{3 * end}]",
            f"is {gap[i, end]:.3g} mm away from vertex {int(edges[i, end])}, where the strut ends",
            "let every curve start and end on its vertices",
        )
    curves[:, [0, 3]] = ends
    return curves


def check_name(name: Any, source: str) -> None:
    """Refuse a name that is not a plain text."""
    if not is_plain_text(name):
        raise InputError.at(source, "name", "is not a plain text", "give the frame a name")


def checked_fields(fields: Mapping[str, Any], source: str) -> dict[str, np.ndarray]:
    """Fresh arrays of the right types and shapes, from the fields of a frame by name.

    Parameters
    ----------
    fields
        ``vertices`` (V, 3), ``edges`` (E, 2), ``control_points`` (E, 4, 3), ``radius`` (E,), ``printed`` (E,),
        ``grounded`` (V,) and ``batch`` (E,).
    source
        What to call the frame in messages.

    Raises
    ------
    InputError
        Naming the field and the index.
    """
    vertices = checked_array(fields["vertices"], "f", (None, 3), source, "vertices")
    edges = checked_array(fields["edges"], "i", (None, 2), source, "edges")
    check_graph(vertices, edges, source)
    v, e = len(vertices), len(edges)
    radius = checked_array(fields["radius"], "f", (e,), source, "radius")
    thin = np.flatnonzero(radius <= 0.0)
    if thin.size:
        i = int(thin[0])
        raise InputError.at(
            source, f"radius[{i}]", f"is {radius[i]:g}, which is not above 0", "give a radius above 0 mm"
        )
    return {
        "vertices": vertices,
        "edges": edges,
        "control_points": snapped_curves(fields["control_points"], vertices, edges, source),
        "radius": radius,
        "printed": checked_array(fields["printed"], "b", (e,), source, "printed"),
        "grounded": checked_array(fields["grounded"], "b", (v,), source, "grounded"),
        "batch": checked_array(fields["batch"], "i", (e,), source, "batch"),
    }
