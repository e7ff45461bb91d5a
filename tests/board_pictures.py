"""Pictures of calibration boards, computed exactly: every sample of a pixel is followed back to the board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.interpolate import RectBivariateSpline

from frametwin.calibration.boards import Board, Face, faces
from frametwin.calibration.detection import Look
from frametwin.calibration.patterns import black_rectangles
from frametwin.cameras import look_at
from frametwin.cameras.lens_models import project, rays
from frametwin.cameras.rig_file import RigCamera

SAMPLES = 19
"""In a pixel, on a lattice whose rows and columns all differ: an upright edge is met as finely as a slanted one."""

AS_IT_SHOULD_BE = Look()
WHITE, BLACK, GROUND = 215.0, 25.0, 120.0
Shape = tuple[np.ndarray, np.ndarray]
STEP = 8  # pixels between the places where the lens is inverted; a spline lies between


@dataclass(frozen=True, eq=False)
class Noise:
    """What a real camera adds: a blur of so many pixels, and noise of so many grey values."""

    blur: float = 0.6
    noise: float = 2.0
    seed: int = 0


def black_at(rectangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether points (..., 2) lie in rectangles (N, 4), by the cells of the grid that their edges make."""
    xs, ys = np.unique(rectangles[:, [0, 2]].round(9)), np.unique(rectangles[:, [1, 3]].round(9))
    cells = np.zeros((len(xs) + 1, len(ys) + 1), dtype=bool)
    for left, bottom, right, top in rectangles.round(9):
        i, j = np.searchsorted(xs, [left, right]) + 1, np.searchsorted(ys, [bottom, top]) + 1
        cells[i[0] : i[1], j[0] : j[1]] = True
    return cells[np.searchsorted(xs, points[..., 0]), np.searchsorted(ys, points[..., 1])]


class RayField:
    """Directions (x / z, y / z) of all places of a camera's picture, from a spline through exact ones."""

    def __init__(self, camera: RigCamera) -> None:
        self.camera = camera
        x = np.arange(-STEP, camera.width + 2 * STEP, STEP, dtype=float)
        y = np.arange(-STEP, camera.height + 2 * STEP, STEP, dtype=float)
        pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        directions = rays(camera.model, camera.lens, pixels)
        plane = (directions[:, :2] / directions[:, 2:]).reshape(len(y), len(x), 2)
        assert np.isfinite(plane).all()
        self.splines = [RectBivariateSpline(y, x, plane[..., i], kx=3, ky=3) for i in range(2)]

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(len(y), len(x), 2) directions of a grid of places."""
        return np.stack([spline(y, x) for spline in self.splines], axis=-1)


def draw_board(
    field: RayField, board: Board, pose: np.ndarray, look: Look = AS_IT_SHOULD_BE, noise: Noise | None = None
) -> np.ndarray:
    """A picture (H, W) uint8 of a board.

    Parameters
    ----------
    field
        Of the camera, whose pose has to be known.
    board, look
        The board, and the way it was printed.
    pose : (4, 4) array, mm
        From the board's axes to the world.
    """
    noise = noise or Noise()
    camera = field.camera
    picture = np.full((camera.height, camera.width), GROUND)
    to_camera = np.linalg.inv(camera.camera_to_world) @ pose
    for face in faces(board):
        _draw_face(picture, field, to_camera @ face.pose, _shape(face, board, look), look)
    if noise.blur > 0.0:
        picture = cv2.GaussianBlur(picture, (0, 0), noise.blur)
    rng = np.random.default_rng(noise.seed)
    return np.clip(np.rint(picture + noise.noise * rng.normal(size=picture.shape)), 0, 255).astype(np.uint8)


def _shape(face: Face, board: Board, look: Look) -> Shape:
    """Black rectangles of a face, and half of the width and height of its white ground."""
    half = 0.5 * np.array(face.size) + (0.0 if board.kind == "cuboid" else 0.5 * board.square)
    return black_rectangles(face, look.legacy), half


def _draw_face(picture: np.ndarray, field: RayField, pose: np.ndarray, shape: Shape, look: Look) -> None:
    """Add a face to a picture; samples are taken only where not all of a pixel's neighbourhood is alike."""
    rectangles, half = shape
    if pose[:3, 2] @ pose[:3, 3] >= 0.0:  # seen from behind
        return
    camera = field.camera
    low, high = _window(camera, pose, half)
    if (high <= low).any():
        return

    def values(directions: np.ndarray) -> np.ndarray:
        """What is seen along (..., 2) x / z, y / z: grey values above that of the ground."""
        rays_out = np.concatenate([directions, np.ones((*directions.shape[:-1], 1))], axis=-1)
        distance = (pose[:3, 2] @ pose[:3, 3]) / (rays_out @ pose[:3, 2])
        flat = (rays_out * distance[..., None] - pose[:3, 3]) @ pose[:3, :2]
        inside = (np.abs(flat) <= half).all(axis=-1) & (distance > 0.0)
        black = black_at(rectangles, flat * (-1.0, 1.0) if look.mirrored else flat) != look.inverted
        return np.where(inside, np.where(black, BLACK, WHITE) - GROUND, 0.0)

    edges = field.at(*(np.arange(low[i], high[i] + 1, dtype=float) for i in range(2)))
    corners = [(slice(i, i - 1 or None), slice(j, j - 1 or None)) for i in (0, 1) for j in (0, 1)]
    at_corners = values(edges)
    four = np.stack([at_corners[corner] for corner in corners])
    result = four.mean(axis=0)
    mixed = cv2.dilate((np.ptp(four, axis=0) > 0.0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    u = (np.arange(SAMPLES) + 0.5) / SAMPLES
    v = (7 * np.arange(SAMPLES) % SAMPLES + 0.5) / SAMPLES
    shares = np.stack([(1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u])  # (4, SAMPLES)
    directions = np.stack([edges[corner][mixed] for corner in corners])  # (4, M, 2)
    result[mixed] = values(np.einsum("cs,cmk->msk", shares, directions)).mean(axis=1)
    picture[low[1] : high[1], low[0] : high[0]] += result  # faces of a convex block never overlap


def _window(camera: RigCamera, pose: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last pixel that a face reaches."""
    rim = np.linspace(-1.0, 1.0, 41)[:, None]
    edge = np.ones_like(rim)
    outline = np.concatenate([np.hstack(p) for p in ((rim, edge), (rim, -edge), (edge, rim), (-edge, rim))]) * half
    local = outline @ pose[:3, :2].T + pose[:3, 3]
    assert (local[:, 2] > 1.0).all(), "the board reaches behind the camera"
    pixels = project(camera.model, camera.lens, local)[0]
    low = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 1, 0)
    return low, np.minimum(np.ceil(pixels.max(axis=0)).astype(int) + 1, (camera.width, camera.height))


def ring(count: int, distance: float, lens: np.ndarray, size: tuple[int, int], height: float = 0.6) -> list[RigCamera]:
    """Cameras around the origin that look at it."""
    cameras = []
    for i in range(count):
        angle = 2.0 * np.pi * i / count + 0.1
        place = np.array([np.cos(angle), np.sin(angle), height * (0.8 + 0.4 * (i % 2))])
        place *= distance / np.linalg.norm(place)
        pose = look_at(place, [0.0, 0.0, 30.0])
        model = "OPENCV" if len(lens) == 9 else "OPENCV_FISHEYE"
        cameras.append(RigCamera(f"cam_{i}", size[0], size[1], model, np.array(lens), pose))
    return cameras


def write_pictures(folder, camera: str, pictures: Sequence[tuple[str, np.ndarray]]) -> None:
    """Write pictures of a camera as PNG."""
    place = folder / camera
    place.mkdir(parents=True, exist_ok=True)
    for name, picture in pictures:
        assert cv2.imwrite(str(place / f"{name}.png"), picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])
