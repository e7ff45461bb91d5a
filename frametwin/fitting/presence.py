"""What of each strut is really there, and how thick it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frametwin.fitting.motion import Pose
from frametwin.fitting.stubs import are_stubs, tell_typical
from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods

IN_VIEW = 0.02
"""A piece is judged by itself if it is in plain view on at least this share of the pixels that it covers in all
views together; a piece in less takes its strut's judgement, and a strut in less is believed to be there."""

SHORTEST_GAP = 3.0
"""Radii of the shortest gap in a strut."""

THINNEST, THICKEST = 0.3, 3.0
"""Limits of a strut's radius, as shares of the planned one."""

STEADY = 0.3
"""How firmly a strut's radius is held to the frame's, as a share of the typical strut's own evidence."""

SHARE = 0.6
"""Of a step of radii that is taken. Curvatures are those of each strut alone. Where one is behind another, both answer
for the same pixels, and whole steps go twice as far as they should: radii would swing to and fro for ever."""


def seen_opacity(drawn: Rods, level: Level) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares opacity of every piece, and how much of it is in plain view.

    A piece's pixels vote for their whiteness, weighted by how much of them is seen past everything else.

    Returns
    -------
    (E, P) opacity 0..1 and (E, P) pixels in plain view.
    """
    evidence = rods.plain_evidence(drawn, level)
    weight, slope = evidence[..., 0], evidence[..., 1]
    opacity = np.clip(drawn.opacity - slope / np.maximum(weight, 1e-12), 0.0, 1.0)
    needed = IN_VIEW * np.median(weight[_typical(drawn)])
    strut_weight = weight.sum(axis=1)
    strut = np.where(strut_weight > needed, (weight * opacity).sum(axis=1) / np.maximum(strut_weight, 1e-12), 1.0)
    return np.where(weight > needed, opacity, strut[:, None]), weight


def believed_opacity(drawn: Rods, level: Level) -> tuple[np.ndarray, np.ndarray]:
    """As `seen_opacity`, but stubs are judged together with the material that would be gone with them.

    That is the end where nothing else ends, such as a foot, and where joints are thicker than struts both joints. It
    hides them all but for a rim, which is white or dark by a fraction of a pixel.
    """
    opacity, weight = seen_opacity(drawn, level)
    stubs = are_stubs(_chords(drawn), drawn.radius.max(axis=1))
    if not stubs.any():
        return opacity, weight
    bare = np.ones(len(drawn.joints)) if drawn.joint_size is None else drawn.joint_size.copy()
    ends = drawn.edges[stubs].ravel()
    if drawn.joint_size is None:
        ends = ends[np.bincount(drawn.edges.ravel())[ends] == 1]
    bare[ends] = 0.0
    alone, in_view = seen_opacity(replace(drawn, joint_size=bare), level)
    rows = stubs[:, None]
    return np.where(rows, alone, opacity), np.where(rows, in_view, weight)


def _chords(drawn: Rods) -> np.ndarray:
    return np.asarray(np.linalg.norm(drawn.control_points[:, 3] - drawn.control_points[:, 0], axis=1))


def _typical(drawn: Rods) -> np.ndarray:
    """(E,) array of bool: struts that tell what is typical of those that are drawn."""
    return tell_typical(_chords(drawn), drawn.radius.max(axis=1))


def without_gaps(opacity: np.ndarray, absent: float, shortest: np.ndarray | None = None) -> np.ndarray:
    """(E, P) 1 where a piece is there and 0 in gaps: so many pieces in a row that are less opaque than ``absent``.

    Single pieces look dark where they are not yet in their place, the end of a short strut above all. Were they left
    out, nothing would pull them there, and their joint would have no disc to be placed by.

    Parameters
    ----------
    opacity
        (E, P) of the pieces.
    absent
        A piece that is less opaque is dark.
    shortest
        (E,) pieces of the shortest gap (`shortest_gap`); two by default. A strut that is dark from end to end is
        missing whatever its length.
    """
    dark, count = opacity < absent, opacity.shape[1]
    least = np.full(len(opacity), 2) if shortest is None else shortest
    least = np.clip(least, 1, count)
    gap = np.zeros_like(dark)
    for length in np.unique(least):
        struts = least == length
        for first in range(count - length + 1):
            row = slice(first, first + length)
            gap[struts, row] |= np.asarray(dark[struts, row].all(axis=1))[:, None]
    return np.where(gap, 0.0, 1.0)


def shortest_gap(lengths: np.ndarray, radius: np.ndarray, pieces: int) -> np.ndarray:
    """(E,) pieces, two or more, of the shortest gap that is believed: `SHORTEST_GAP` radii (E,) of each length (E,).

    Of pieces that are shorter than they are thick one sees little but their neighbours.
    """
    return np.maximum(2, np.ceil(SHORTEST_GAP * radius * pieces / lengths - 1e-9)).astype(np.int64)


def strut_whiteness(drawn: Rods, level: Level) -> np.ndarray:
    """(E,) share of each strut's pixels in plain view that are white."""
    opacity, weight = believed_opacity(drawn, level)
    total = weight.sum(axis=1)
    return np.where(total > 0.0, (weight * opacity).sum(axis=1) / np.maximum(total, 1e-12), 1.0)


def outline_misfit(drawn: Rods, level: Level) -> np.ndarray:
    """(E,) radii by which outlines in the pictures seem to be off each strut's own.

    A strut of apparent radius r and length L that lies d beside its place covers d L dark pixels along one side, and
    leaves as many white ones along the other. Of each its soft rim counts about a half, in plain view of 2 r L.
    """
    through = rods.transmittance(drawn, level)
    differs = np.abs(np.float32(1.0) - through - level.target)
    weight, slope = np.moveaxis(rods.opacity_terms(drawn, level, through, differs).sum(axis=1), 1, 0)
    seen = weight > IN_VIEW * np.median(weight[_typical(drawn)])
    return np.where(seen, 2.0 * slope / np.maximum(weight, 1e-12), 0.0)


def learn_thickness(pose: Pose, planned: np.ndarray, widths: np.ndarray, hidden: np.ndarray | None = None) -> Pose:
    """`SHARE` of a Gauss-Newton step of the struts' radii, each strut's held to the frame's common factor.

    Parameters
    ----------
    pose : with the present radii.
    planned : (E,) mm.
    widths : (E, P, 2) curvature and slope of the loss by the radius of each piece.
    hidden : (E,) array of bool, optional
        Struts whose own radius is not seen, such as stubs between joints with material of their own: they take the
        common factor.
    """
    # By the logarithm of the radius, in which a common factor is a common shift.
    curvature = widths[..., 0].sum(axis=1) * pose.radius**2
    slope = widths[..., 1].sum(axis=1) * pose.radius
    seen = np.ones(len(planned), dtype=bool) if hidden is None else ~hidden
    told = steadied(np.log(pose.radius / planned)[seen], curvature[seen], slope[seen])
    if told is None:
        return pose
    factor = np.full(len(planned), np.median(told))
    factor[seen] = told
    factor = np.clip(factor, np.log(THINNEST), np.log(THICKEST))
    return replace(pose, radius=planned * np.exp(factor))


def steadied(present: np.ndarray, curvature: np.ndarray, slope: np.ndarray) -> np.ndarray | None:
    """`SHARE` of one Newton step of many like quantities, each held to what they have in common.

    Parameters
    ----------
    present : (N,) array
    curvature, slope : (N,) array
        Of the loss by each of them.

    Returns
    -------
    (N,) array or None
        ``None`` where the pictures say nothing of them.
    """
    hold = STEADY * np.median(curvature)
    if hold <= 0.0:
        return None
    wanted = present - slope / np.maximum(curvature, 1e-9 * hold)
    # Struts astray would ask for absurd radii: what is common is a weighted median.
    order = np.argsort(wanted)
    share = np.cumsum(curvature[order])
    common = wanted[order][np.searchsorted(share, 0.5 * share[-1])]
    return present + SHARE * ((curvature * wanted + hold * common) / (curvature + hold) - present)
