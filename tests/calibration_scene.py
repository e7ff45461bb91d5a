"""A robot's cell with cameras, boards and the block, photographed for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from board_pictures import Noise, RayField, draw_board, ring, write_pictures

from frametwin.calibration.boards import Board, parse_board
from frametwin.calibration.detection import Look
from frametwin.cameras import look_at
from frametwin.cameras.rig_file import RigCamera
from frametwin.cameras.standing import standing_at
from frametwin.dataset.calibration_shots import random_pose

LENS = np.array([1000.0, 1002.0, 486.0, 352.0, -0.12, 0.05, 0.0004, -0.0003, 0.0])
FISHEYE_LENS = np.array([420.0, 421.0, 484.0, 357.0, 0.03, -0.008, 0.002, 0.0])
SIZE = (960, 720)
BOARD = "charuco:7x5:24:18:4X4_250"
BLOCK = "cuboid:50x60x70:14:10:4X4_100"
AT = (300.0, 40.0, 12.0, 30.0)


def robot_cameras(count: int, distance: float = 500.0) -> list[RigCamera]:
    """Cameras about the block's place, in the robot's axes, each with a lens of its own."""
    rng = np.random.default_rng(2)
    cameras = []
    for camera in ring(count, distance, LENS, SIZE, height=0.9):
        lens = LENS + rng.normal(size=9) * np.array([12.0, 0, 6.0, 6.0, 0.02, 0.01, 0, 0, 0])
        lens[1] = lens[0] * 1.001
        place = camera.centre + AT[:3]
        pose = look_at(place, np.add(AT[:3], (0.0, 0.0, 40.0)))
        cameras.append(RigCamera(camera.name, *SIZE, "OPENCV", lens, pose))
    return cameras


def lens_pictures(
    folder: Path, camera: RigCamera, board: Board, count: int, seed: int, look: Look | None = None, tilt: float = 45.0
) -> None:
    """Pictures of a board all over a camera's picture."""
    rng = np.random.default_rng(seed)
    field = RayField(camera)
    focal = camera.lens[0]
    wide = (board.columns + 1) * board.square
    pictures = []
    for i in range(count):
        depth = rng.uniform(1.5, 2.1) * focal * wide / camera.width
        aside = rng.uniform(-0.25, 0.25, size=2) * (camera.width, camera.height) / focal
        local = depth * np.array([*aside, 1.0])
        target = camera.centre + camera.camera_to_world[:3, :3] @ local
        pose = random_pose(rng, target, camera.centre - target, tilt)
        noise = Noise(seed=100 * seed + i)
        pictures.append((f"{i:02d}", draw_board(field, board, pose, look or Look(), noise)))
    write_pictures(folder, camera.name, pictures)


def moment_pictures(folder: Path, cameras: list[RigCamera], board: Board, count: int, seed: int = 5) -> None:
    """Pictures of a board over the block's place at the same moments; who sees it from behind sees none."""
    rng = np.random.default_rng(seed)
    poses = [random_pose(rng, np.array(AT[:3]) + rng.uniform(-25, 25, size=3) + (0, 0, 40), [0, 0, 1.0], 25.0)
             for _ in range(count)]  # fmt: skip
    for k, camera in enumerate(cameras):
        field = RayField(camera)
        pictures = [
            (f"m{i:02d}", draw_board(field, board, pose, noise=Noise(seed=1000 + 50 * k + i)))
            for i, pose in enumerate(poses)
        ]
        write_pictures(folder, camera.name, pictures)


def block_pictures(folder: Path, cameras: list[RigCamera], text: str = BLOCK, at: tuple[float, ...] = AT) -> None:
    """A picture of an object at its place by each camera."""
    for k, camera in enumerate(cameras):
        picture = draw_board(RayField(camera), parse_board(text), standing_at(at), noise=Noise(seed=7000 + k))
        write_pictures(folder, camera.name, [("block", picture)])
