"""What the pictures say about a twin: how much of them it explains, and whether other struts are to be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting import presence
from frametwin.fitting.levels import Levels
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster import rods
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Rods
from frametwin.twin.twin import Twin

DETAIL = 1.8
"""Radius in pixels of the typical strut in the pictures that are compared: an outline that is a fifth of a radius off
is less than half a pixel there."""

UNCOVERED = 0.8
"""A white pixel counts as uncovered if the twin lets more than this share of it through."""

BLUR = 0.7
PIECES = 6


@dataclass(frozen=True, eq=False)
class Evidence:
    """What pictures say about a twin and about struts that should not be there yet.

    Attributes
    ----------
    unexplained
        Share of the white in the pictures where the twin has nothing.
    contradicted
        Share of the twin's own silhouette where the pictures are dark.
    uncovered
        Share of the white pixels where the twin has next to nothing. Outlines that are a little off do not count
        here, so that of N struts one that lies elsewhere shows as 1/N.
    whiteness : (N,) array
        Share of each other strut's pixels that is white, of those in plain view past the twin; NaN for struts of
        which hardly any are.
    """

    unexplained: float
    contradicted: float
    uncovered: float
    whiteness: np.ndarray

    @property
    def mismatch(self) -> float:
        """The larger of the two shares."""
        return max(self.unexplained, self.contradicted)


class Pictures:
    """The pictures of a batch at the size at which twins are compared with them.

    Parameters
    ----------
    frame
        What is printed of it sets the size.
    cameras, masks
        Cameras without distortion, and (H, W) masks 0..1.
    """

    def __init__(self, frame: Wireframe, cameras: Sequence[Camera], masks: Sequence[np.ndarray]) -> None:
        printed, _, _ = frame.printed_part()
        self.level: Level = Levels(printed, Pyramid(cameras, masks)).at(DETAIL, BLUR)
        self._white = float(self.level.target.sum())
        self._pixels = float((self.level.target > 0.5).sum())

    def evidence(self, frame: Wireframe, twin: Twin, others: Wireframe | None = None) -> Evidence:
        """Compare a twin with the pictures.

        Parameters
        ----------
        frame
            Its printed struts are those of which the twin tells.
        twin
            Of ``frame``.
        others
            Struts that are looked for beside them.
        """
        drawn = _rods_of(frame, twin)
        through = rods.transmittance(drawn, self.level)
        residual = np.float32(1.0) - through - self.level.target
        silhouette = float((np.float32(1.0) - through).sum())
        return Evidence(
            unexplained=-float(np.minimum(residual, 0.0).sum()) / max(self._white, 1.0),
            contradicted=float(np.maximum(residual, 0.0).sum()) / max(silhouette, 1.0),
            uncovered=float(((self.level.target > 0.5) & (through > UNCOVERED)).sum()) / max(self._pixels, 1.0),
            whiteness=np.zeros(0) if others is None else self._whiteness(drawn, others),
        )

    def _whiteness(self, drawn: Rods, others: Wireframe) -> np.ndarray:
        count = others.strut_count
        both = Rods(
            control_points=np.concatenate([drawn.control_points, others.control_points]),
            joints=drawn.joints,
            edges=np.concatenate([drawn.edges, np.zeros((count, 2), dtype=np.int64)]),
            radius=np.concatenate([drawn.radius, np.repeat(others.radius[:, None], PIECES, axis=1)]),
            opacity=np.concatenate([drawn.opacity, np.ones((count, PIECES))]),
            joint_size=drawn.joint_size,
        )
        opacity, weight = presence.seen_opacity(both, self.level)
        needed = presence.IN_VIEW * PIECES * float(np.median(weight))
        opacity, weight = opacity[-count:], weight[-count:]
        total = weight.sum(axis=1)
        seen = total > needed
        return np.where(seen, (weight * opacity).sum(axis=1) / np.maximum(total, 1e-12), np.nan)


def _rods_of(frame: Wireframe, twin: Twin) -> Rods:
    """The twin's printed struts, as far as they are there, and the material at their joints."""
    printed = frame.printed
    kernel = ((np.arange(PIECES) + 0.5) / PIECES * twin.opacity.shape[1]).astype(int)
    vertices, edges = np.unique(frame.edges[printed], return_inverse=True)
    drawn = Rods(
        control_points=twin.control_points[printed],
        joints=twin.vertices[vertices],
        edges=edges.reshape(-1, 2),
        radius=twin.thickness[printed][:, kernel],
        opacity=(twin.opacity[printed][:, kernel] > 0.5).astype(np.float64),
    )
    if twin.joint_radius is None:
        return drawn
    thickest, found = drawn.joint_radius(), twin.joint_radius[vertices]
    told = (thickest > 0.0) & (found > 0.0)
    return replace(drawn, joint_size=np.where(told, found / np.where(told, thickest, 1.0), 1.0))
