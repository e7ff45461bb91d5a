"""What several test files need: the real frames, small frames, and a small capture on disk."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from longest_files import place_of
from small_frames import tower

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import write_capture
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

_SESSION = pytest.StashKey[pytest.Session]()

SHARED_FRAMES = Path(__file__).resolve().parents[2] / "shared" / "frames"


@pytest.fixture(scope="session")
def shared_frames() -> Path:
    """The folder of real frames beside the project."""
    if not SHARED_FRAMES.is_dir():
        pytest.skip("the folder of real frames (../shared/frames beside the project) is absent")
    return SHARED_FRAMES


@pytest.fixture
def straight_frame() -> Wireframe:
    return tower()


@pytest.fixture
def curved_frame() -> Wireframe:
    return tower(curved=True)


def silhouette(frame: Wireframe, camera: Camera) -> np.ndarray:
    """Draw the printed struts as thick polylines (H, W) uint8: rough, but independent of the renderer."""
    import cv2  # here, since tests inside of Blender have numpy alone

    image = np.zeros((camera.height, camera.width), dtype=np.uint8)
    curves = bezier.evaluate(frame.control_points[frame.printed], np.linspace(0.0, 1.0, 17))  # (E, 17, 3)
    pixels, depth = camera.project(curves)
    width = max(1, round(2.0 * frame.radius[0] * camera.fl_x / float(np.median(depth))))
    chains = [np.round(16.0 * (chain - 0.5)).astype(np.int32) for chain in pixels]
    cv2.polylines(image, chains, isClosed=False, color=255, thickness=width, lineType=cv2.LINE_AA, shift=4)
    return image


@pytest.fixture(scope="module")
def one_thread() -> Iterator[None]:
    """For fits so small that they lose more by waiting for a second thread than they gain by it."""
    import numba  # here, since tests inside of Blender have numpy alone
    import torch

    before = torch.get_num_threads(), numba.get_num_threads()
    torch.set_num_threads(1)
    numba.set_num_threads(1)
    yield
    torch.set_num_threads(before[0])
    numba.set_num_threads(before[1])


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


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: place_of(item.path.name))


def pytest_sessionstart(session: pytest.Session) -> None:
    session.config.stash[_SESSION] = session


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Leave at once if Blender was loaded, with the exit code of the tests: its own way out may hang or crash."""
    session = config.stash.get(_SESSION, None)
    if "bpy" not in sys.modules or session is None:
        return
    if config.pluginmanager.has_plugin("terminalreporter"):
        config.get_terminal_writer().flush()
    sys.stdout.flush()
    sys.stderr.flush()
    shutil.rmtree(sys.modules["bpy"].app.tempdir, ignore_errors=True)
    os._exit(int(session.exitstatus))
