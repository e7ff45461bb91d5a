"""What several test files need: the real frames, small frames, and a small capture on disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from frametwin import bezier
from frametwin.cameras import Camera
from frametwin.capture import write_capture
from frametwin.rigs import ring_rig
from frametwin.wireframe import Wireframe

SHARED_FRAMES = Path(__file__).resolve().parents[2] / "shared" / "frames"


@pytest.fixture(scope="session")
def shared_frames() -> Path:
    """The folder of real frames beside the project."""
    if not SHARED_FRAMES.is_dir():
        pytest.skip("the folder of real frames (../shared/frames beside the project) is absent")
    return SHARED_FRAMES


def tower(levels: int = 2, curved: bool = False) -> Wireframe:
    """A square tower with one diagonal on each side, 20 mm wide, levels of 20 mm."""
    corners = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])
    vertices = [[x, y, 20.0 * level] for level in range(levels + 1) for x, y in corners]
    edges = []
    for level in range(levels):
        low, high = 4 * level, 4 * level + 4
        for i in range(4):
            edges += [[low + i, high + i], [high + i, high + (i + 1) % 4], [low + i, high + (i + 1) % 4]]
    frame = Wireframe.create(vertices, edges, radius=1.0, name="tower")
    if not curved:
        return frame
    curves = frame.control_points.copy()
    curves[:, 1:3] += np.random.default_rng(5).normal(scale=1.0, size=(len(edges), 2, 3))
    return frame.replace(control_points=curves)


@pytest.fixture
def straight_frame() -> Wireframe:
    return tower()


@pytest.fixture
def curved_frame() -> Wireframe:
    return tower(curved=True)


def silhouette(frame: Wireframe, camera: Camera) -> np.ndarray:
    """Draw the printed struts as thick polylines (H, W) uint8: rough, but independent of the renderer."""
    image = np.zeros((camera.height, camera.width), dtype=np.uint8)
    curves = bezier.evaluate(frame.control_points[frame.printed], np.linspace(0.0, 1.0, 17))  # (E, 17, 3)
    pixels, depth = camera.project(curves)
    width = max(1, round(2.0 * frame.radius[0] * camera.fl_x / float(np.median(depth))))
    chains = [np.round(16.0 * (chain - 0.5)).astype(np.int32) for chain in pixels]
    cv2.polylines(image, chains, isClosed=False, color=255, thickness=width, lineType=cv2.LINE_AA, shift=4)
    return image


@pytest.fixture
def draw() -> Callable[[Wireframe, Camera], np.ndarray]:
    return silhouette


@pytest.fixture
def small_capture(tmp_path: Path) -> Path:
    """A capture with three views of 160 x 120 and a truth, as the writer makes it."""
    frame = tower()
    cameras = ring_rig(frame, 3, size=(120, 160))
    truth = frame.transformed(np.diag([1.0, 1.0, 0.98, 1.0])).replace(radius=frame.radius)
    folder = tmp_path / "capture"
    write_capture(folder, frame, cameras, [silhouette(truth, camera) for camera in cameras], truth=truth)
    return folder
