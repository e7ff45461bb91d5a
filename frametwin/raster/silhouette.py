"""Exact silhouettes of round struts, without a renderer.

A pixel is white when the ray through its centre passes within a strut's radius of the strut's centreline: the
outline of a sphere swept along the curve, perspective and all. The radius may change along the strut. The curve is a
polyline so fine that its chords leave it by far less than a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor

import numba as nb
import numpy as np

from frametwin.cameras import Camera, packed
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.flattening import ROUNDING, is_straight
from frametwin.geometry.radii import radii_at
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report

CHORDS = 32
"""Straight pieces of a curved strut; a straight strut takes one."""


@nb.njit(cache=True)
def _near(rx, ry, a, b, ra, rb):
    """Whether the ray (rx, ry, 1) from the origin meets a sphere swept along a..b as its radius goes from ra to rb.

    The square of the distance less the square of the radius is a parabola over the way t from a to b.
    """
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    dr = rb - ra
    dd = rx * rx + ry * ry + 1.0
    de = rx * ex + ry * ey + ez
    ee = ex * ex + ey * ey + ez * ez
    da = rx * a[0] + ry * a[1] + a[2]
    ea = ex * a[0] + ey * a[1] + ez * a[2]
    curvature = dd * (ee - dr * dr) - de * de
    t = 0.0
    if curvature > 1e-18 * dd * ee:
        t = min(1.0, max(0.0, (de * da - dd * (ea - dr * ra)) / curvature))
    elif rb > ra:  # one end is nearest: the thicker one, as the ray runs along the strut
        t = 1.0
    x, y, z = a[0] + t * ex, a[1] + t * ey, a[2] + t * ez
    along = (rx * x + ry * y + z) / dd
    r = ra + t * dr
    return (x - along * rx) ** 2 + (y - along * ry) ** 2 + (z - along) ** 2 <= r * r


@nb.njit(parallel=True, cache=True)
def _fill(starts, ends, radius, camera, picture):
    """White into picture (H, W) uint8 for pieces (S, 3) with radii (S, 2); camera as `packed`.

    Bands of rows are filled in parallel.
    """
    height, width = picture.shape
    bands = 16
    rotation = camera[:9].reshape(3, 3)
    shift = camera[9:12]
    for band in nb.prange(bands):
        first, last = band * height // bands, (band + 1) * height // bands - 1
        a, b = np.empty(3), np.empty(3)
        for k in range(starts.shape[0]):
            for e in range(3):
                a[e], b[e] = shift[e], shift[e]
                for f in range(3):
                    a[e] += rotation[e, f] * starts[k, f]
                    b[e] += rotation[e, f] * ends[k, f]
            ra, rb = radius[k]
            r = max(ra, rb)
            if min(a[2], b[2]) <= r:
                continue
            x0 = min((a[0] - r) / a[2], (b[0] - r) / b[2])
            x1 = max((a[0] + r) / a[2], (b[0] + r) / b[2])
            y0 = min((a[1] - r) / a[2], (b[1] - r) / b[2])
            y1 = max((a[1] + r) / a[2], (b[1] + r) / b[2])
            # A sphere's outline reaches further than its centre plus r / z, the more so the further off the axis.
            aside = max(max(abs(x0), abs(x1)), max(abs(y0), abs(y1)))
            spare = 0.5 * r / min(a[2], b[2]) * (1.0 + aside**2)
            left = max(0, int(floor((x0 - spare) * camera[12] + camera[14] - 0.5)))
            right = min(width - 1, int(ceil((x1 + spare) * camera[12] + camera[14] - 0.5)))
            top = max(first, int(floor((y0 - spare) * camera[13] + camera[15] - 0.5)))
            bottom = min(last, int(ceil((y1 + spare) * camera[13] + camera[15] - 0.5)))
            for j in range(top, bottom + 1):
                ry = (j + 0.5 - camera[15]) / camera[13]
                for i in range(left, right + 1):
                    if picture[j, i] == 0 and _near((i + 0.5 - camera[14]) / camera[12], ry, a, b, ra, rb):
                        picture[j, i] = 255


def silhouettes(
    frame: Wireframe,
    cameras: Sequence[Camera],
    *,
    present: np.ndarray | None = None,
    thickness: np.ndarray | None = None,
    supersampling: int = 1,
    progress: ProgressCallback | None = None,
    curves: np.ndarray | None = None,
) -> list[np.ndarray]:
    """Pictures of the printed struts, white on black.

    Parameters
    ----------
    frame
        Its printed struts are seen; curves and radius in mm.
    cameras
        Without lens distortion.
    present
        (E, 2) interval of the curve parameter at which each strut is really there; all of it by default.
    thickness
        (E, K) radius in mm at even parameters from 0 to 1, linear in between, K >= 2; ``frame.radius`` by default.
    supersampling
        Samples along each side of a pixel. With 1 the picture holds 0 and 255 only.
    progress
        Called once a view; can cancel.
    curves
        (E, n + 1, 3) mm, where the struts are, such as `Twin.curves`; those of ``frame`` by default.

    Returns
    -------
    One (H, W) uint8 picture a camera.

    Raises
    ------
    InputError
        For cameras with lens distortion.
    Cancelled
        If ``progress`` says so.
    """
    curves = frame.control_points if curves is None else curves
    starts, ends, radius = _pieces(frame, curves, present, thickness)
    pictures = []
    for i, camera in enumerate(cameras):
        report(progress, Progress("silhouettes", i, len(cameras)))
        if camera.has_distortion:
            raise InputError.at(
                camera.name,
                "distortion",
                "silhouettes are drawn by pinhole cameras",
                "use camera.without_distortion()",
            )
        fine = camera.resized(camera.width * supersampling, camera.height * supersampling)
        picture = np.zeros((fine.height, fine.width), dtype=np.uint8)
        _fill(starts, ends, radius, packed([fine])[0], picture)
        if supersampling > 1:
            blocks = picture.reshape(camera.height, supersampling, camera.width, supersampling)
            picture = np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)
        pictures.append(picture)
    report(progress, Progress("silhouettes", len(cameras), len(cameras)))
    return pictures


def _pieces(
    frame: Wireframe, curves: np.ndarray, present: np.ndarray | None, thickness: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Straight pieces (S, 3), (S, 3) and the radii (S, 2) at their ends."""
    interval = np.tile([0.0, 1.0], (frame.strut_count, 1)) if present is None else np.asarray(present, dtype=float)
    radii = np.repeat(frame.radius[:, None], 2, axis=1) if thickness is None else np.asarray(thickness, dtype=float)
    there = frame.printed & (interval[:, 1] > interval[:, 0])
    control, interval, radii = curves[there], interval[there], radii[there]
    chords = np.linalg.norm(control[:, -1] - control[:, 0], axis=1)
    straight = is_straight(control, ROUNDING * chords, even=True)
    even = np.ptp(radii, axis=1) == 0.0
    kinks = np.linspace(0.0, 1.0, radii.shape[1])
    starts, ends, widths = [], [], []
    for chosen, count, corners in (
        (straight & even, 1, kinks[:0]),
        (~straight & even, CHORDS, kinks[:0]),
        (straight & ~even, 1, kinks[1:-1]),
        (~straight & ~even, CHORDS, kinks[1:-1]),
    ):
        share = np.linspace(0.0, 1.0, count + 1)
        low, high = interval[chosen, :1], interval[chosen, 1:]
        u = low + share * (high - low)  # (S, count + 1)
        # A piece ends wherever the radius bends; pieces of no length do no harm.
        u = np.sort(np.concatenate([u, np.clip(np.broadcast_to(corners, (len(u), corners.size)), low, high)], axis=1))
        basis = bezier.bernstein(control.shape[1] - 1, u.ravel()).reshape(*u.shape, control.shape[1])
        points = np.einsum("sjb,sbx->sjx", basis, control[chosen])
        radius = radii_at(radii[chosen], u)
        starts.append(points[:, :-1].reshape(-1, 3))
        ends.append(points[:, 1:].reshape(-1, 3))
        widths.append(np.stack([radius[:, :-1], radius[:, 1:]], axis=-1).reshape(-1, 2))
    return np.concatenate(starts), np.concatenate(ends), np.concatenate(widths)
