"""How well a calibrated rig knows: in px over the picture, and in mm at the print.

After mrcal (D. Kogan, NASA JPL, "Finite-difference and propagated projection uncertainty"): a lens of which the pose is
not known may turn a little to make up for its errors, so what a turn explains does not count.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.cameras.lens_models import project, rays
from frametwin.cameras.rig_file import RigCamera

Floats = NDArray[np.float64]


def pixel_grid(camera: RigCamera, columns: int = 24) -> tuple[Floats, tuple[int, int]]:
    """Places (N, 2) spread evenly over a picture, and their rows and columns."""
    rows = max(2, round(columns * camera.height / camera.width))
    x = (np.arange(columns) + 0.5) * camera.width / columns
    y = (np.arange(rows) + 0.5) * camera.height / rows
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), (rows, columns)


def lens_uncertainty(camera: RigCamera, pixels: Floats) -> Floats:
    """Standard deviation in px of where a far point is seen, at each of some pixels (N, 2), by the lens alone.

    Returns
    -------
    (N,) array
        The longer axis of the ellipse; NaN where the lens has no inverse.
    """
    assert camera.covariance is not None
    count = len(camera.lens)
    directions = rays(camera.model, camera.lens, pixels)
    good = np.isfinite(directions).all(axis=1)
    _, by_point, by_lens = project(camera.model, camera.lens, directions[good])
    turning = by_point @ _cross(directions[good])
    design, field = turning.reshape(-1, 3), by_lens.reshape(-1, count)
    field = field - design @ np.linalg.lstsq(design, field, rcond=None)[0]
    found = np.full(len(pixels), np.nan)
    found[good] = _longest(field.reshape(-1, 2, count), camera.covariance[:count, :count])
    return found


def point_uncertainty(camera: RigCamera, points: ArrayLike) -> Floats:
    """Standard deviation in px of where points (N, 3) of the world in mm are seen, by lens and pose.

    Returns
    -------
    (N,) array
        The longer axis of the ellipse.
    """
    jacobian = camera_jacobian(camera, points)
    assert camera.covariance is not None
    return _longest(jacobian, camera.covariance)


def camera_jacobian(camera: RigCamera, points: ArrayLike) -> Floats:
    """Derivative (N, 2, P + 6) of where points (N, 3) are seen, by the parameters of the camera's covariance."""
    assert camera.camera_to_world is not None
    rotation = camera.camera_to_world[:3, :3]
    local = (np.asarray(points, dtype=np.float64) - camera.centre) @ rotation
    _, by_local, by_lens = project(camera.model, camera.lens, local)
    return np.concatenate([by_lens, by_local @ _cross(local), -by_local @ rotation.T], axis=2)


def rig_uncertainty(cameras: Sequence[RigCamera], points: ArrayLike) -> Floats:
    """Standard deviation in mm of points (N, 3) that all cameras together locate, by errors of the calibration alone.

    Each camera's errors count as its own; what they share through one board or object is not in it.

    Returns
    -------
    (N,) array
        The longest axis of the ellipsoid, mm; infinite where fewer than two cameras see a point.
    """
    points = np.atleast_2d(np.asarray(points, dtype=np.float64))
    found = np.full(len(points), np.inf)
    for k, point in enumerate(points):
        information, count = np.zeros((3, 3)), 0
        for camera in cameras:
            assert camera.camera_to_world is not None and camera.covariance is not None
            rotation = camera.camera_to_world[:3, :3]
            local = (point - camera.centre) @ rotation
            if local[2] <= 0.0:
                continue
            pixel, by_local, _ = project(camera.model, camera.lens, local[None])
            if not ((pixel[0] >= 0.0) & (pixel[0] < (camera.width, camera.height))).all():
                continue
            jacobian = camera_jacobian(camera, point[None])[0]
            spread = jacobian @ camera.covariance @ jacobian.T + 1e-8 * np.eye(2)
            by_world = by_local[0] @ rotation.T
            information += by_world.T @ np.linalg.solve(spread, by_world)
            count += 1
        if count >= 2:
            found[k] = np.sqrt(1.0 / max(float(np.linalg.eigvalsh(information)[0]), 1e-300))
    return found


def meeting_point(cameras: Sequence[RigCamera]) -> Floats:
    """The point (3,) in mm that all cameras look at, nearest to all their lines of sight."""
    matrix, vector = 1e-9 * np.eye(3), np.zeros(3)
    for camera in cameras:
        assert camera.camera_to_world is not None
        across = np.eye(3) - np.outer(camera.camera_to_world[:3, 2], camera.camera_to_world[:3, 2])
        matrix, vector = matrix + across, vector + across @ camera.centre
    return np.asarray(np.linalg.solve(matrix, vector))


def _longest(jacobian: Floats, covariance: Floats) -> Floats:
    spread = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(spread)[:, -1], 0.0))


def _cross(vectors: Floats) -> Floats:
    """(N, 3, 3) matrices of cross products."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
