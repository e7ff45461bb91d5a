"""Calibration pictures of a sample: boards held before each camera, boards that all see, and the block at its place.

They lie in folders as ``frametwin calibrate`` wants them, ``calibration/STEP/CAMERA/`` with the steps ``lenses``,
``moments`` and ``block``; what is true of them is in ``calibration/truth.json``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.calibration.boards import Board, faces, parse_board
from frametwin.calibration.patterns import black_rectangles
from frametwin.cameras import Camera
from frametwin.cameras.standing import standing_at
from frametwin.capture.board_scene import BoardScene, BoardShot, Body
from frametwin.dataset.specification_values import CalibrationValues
from frametwin.geometry.wireframe import Wireframe

Floats = NDArray[np.float64]

FOLDER = "calibration"
TRUTH_FILE = f"{FOLDER}/truth.json"
FORMAT, VERSION = "frametwin-calibration-truth", 1

ABOVE = 0.01
"""Height of ink over paper in mm, so that a ray meets the one and not the other."""

NEAR = (1.5, 2.1)
"""Distance of a board from the camera whose lens it shows, in distances at which it is as wide as the picture."""

ASIDE = 0.25
"""How far from the middle of the picture it may be, in sizes of the picture."""

TILTS = (45.0, 25.0)
"""Largest turns in degrees from facing one camera, and of a board that all see from facing up."""

WANDERS = 25.0
"""How far a board that all see is moved about, in mm to each side."""


def calibration_scene(
    values: CalibrationValues, plan: Wireframe, cameras: Sequence[Camera]
) -> tuple[BoardScene, dict[str, Any]]:
    """What is photographed for the calibration of a sample's cameras, and the content of its ``truth.json``.

    Parameters
    ----------
    values
        Drawn for the sample.
    plan
        The block stands where its print will be.
    cameras
        The true ones.
    """
    board, block = parse_board(values.board), parse_board(values.block)
    low, high = plan.bounds
    at = (*(round(float(value), 1) for value in (0.5 * (low[:2] + high[:2]))), round(float(low[2]), 1), values.turn_deg)
    rng = np.random.default_rng([values.seed, 4])
    shots = [
        *_lens_shots(values, board, cameras, rng),
        *_moment_shots(values, np.array([*at[:2], 0.5 * (low[2] + high[2])]), cameras, rng),
        *(_shot("block", camera, "block", standing_at(at), rng) for camera in cameras),
    ]
    truth = {
        "format": FORMAT,
        "version": VERSION,
        "board": board.text,
        "block": block.text,
        "at": at,
        "poses": {shot.file.removeprefix(f"{FOLDER}/"): shot.pose for shot in shots},
    }
    return BoardScene({"board": body_of(board), "block": body_of(block)}, tuple(shots)), truth


def body_of(board: Board) -> Body:
    """The flat pieces of a board or block."""
    white, black = [], []
    for face in faces(board):
        half = 0.5 * np.array(face.size) + (0.0 if board.kind == "cuboid" else 0.5 * board.square)
        white.append(_placed(np.array([[*-half, *half]]), 0.0, face.pose))
        black.append(_placed(black_rectangles(face), ABOVE, face.pose))
    return Body(np.concatenate(white), np.concatenate(black))


def _placed(rectangles: Floats, height: float, pose: Floats) -> Floats:
    """Corners (N, 4, 3) of rectangles (N, 4) left, bottom, right, top, at a height over a face."""
    left, bottom, right, top = rectangles.T
    around = ((left, bottom), (right, bottom), (right, top), (left, top))
    flat = np.stack([np.stack(corner, axis=1) for corner in around])
    corners = np.concatenate([flat, np.full((*flat.shape[:2], 1), height)], axis=2).transpose(1, 0, 2)
    return np.asarray(corners @ pose[:3, :3].T + pose[:3, 3])


def _lens_shots(
    values: CalibrationValues, board: Board, cameras: Sequence[Camera], rng: np.random.Generator
) -> list[BoardShot]:
    """A board all over the picture of each camera."""
    wide, shots = (board.columns + 1) * board.square, []
    for camera in cameras:
        for i in range(values.lens_pictures):
            depth = rng.uniform(*NEAR) * camera.fl_x * wide / camera.width
            aside = rng.uniform(-ASIDE, ASIDE, size=2) * (camera.width / camera.fl_x, camera.height / camera.fl_y)
            target = camera.centre + camera.camera_to_world[:3, :3] @ (depth * np.array([*aside, 1.0]))
            pose = random_pose(rng, target, camera.centre - target, TILTS[0])
            shots.append(_shot("lenses", camera, f"{i:02d}", pose, rng))
    return shots


def _moment_shots(
    values: CalibrationValues, middle: Floats, cameras: Sequence[Camera], rng: np.random.Generator
) -> list[BoardShot]:
    """A board over the middle of the print's place that all cameras see at the same moment."""
    moments = [
        random_pose(rng, middle + rng.uniform(-WANDERS, WANDERS, size=3), np.array([0.0, 0.0, 1.0]), TILTS[1])
        for _ in range(values.moments)
    ]
    return [_shot("moments", camera, f"m{i:02d}", pose, rng) for camera in cameras for i, pose in enumerate(moments)]


def _shot(step: str, camera: Camera, name: str, pose: Floats, rng: np.random.Generator) -> BoardShot:
    file = f"{FOLDER}/{step}/{camera.name}/{name}.png"
    return BoardShot(file, "block" if step == "block" else "board", pose, camera, int(rng.integers(2**31 - 1)))


def random_pose(rng: np.random.Generator, target: Floats, facing: ArrayLike, tilt_deg: float) -> Floats:
    """A pose at a place, its z turned away from a direction by up to an angle, and turned about itself."""
    towards = np.asarray(facing, dtype=float) / np.linalg.norm(facing)
    aside = rng.normal(size=3)
    aside -= towards * (aside @ towards)
    angle = np.radians(tilt_deg) * np.sqrt(rng.uniform(0.1, 1.0))
    z = np.cos(angle) * towards + np.sin(angle) * aside / np.linalg.norm(aside)
    x = np.cross(rng.normal(size=3), z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3] = np.column_stack([x, np.cross(z, x), z, target])
    return pose
