"""Tests of what runs inside of Blender: skipped where there is no ``bpy``, each in an empty scene of its own."""

from __future__ import annotations

import atexit
import importlib.util
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.geometry.wireframe import Wireframe
from frametwin.scratch import make_scratch, remove_scratch

REASON = "Blender is absent: install the bpy wheel (pip install bpy), 4.5 for Python 3.11 or 5.2 for 3.13"

# Blender looks for it once, when it is loaded: a profile of the tests' own, in which they may install extensions; of
# processes that share the tests, each has one.
if "BLENDER_USER_RESOURCES" not in os.environ or "PYTEST_XDIST_WORKER" in os.environ:
    os.environ["BLENDER_USER_RESOURCES"] = str(make_scratch())
    atexit.register(remove_scratch, os.environ["BLENDER_USER_RESOURCES"])


class WithoutBlender(pytest.Module):
    """A test file that is not even imported."""

    def collect(self) -> Any:
        pytest.skip(REASON, allow_module_level=True)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    if importlib.util.find_spec("bpy") is not None:
        return None
    module: pytest.Module = WithoutBlender.from_parent(parent, path=module_path)
    return module


@pytest.fixture(autouse=True)
def empty_scene() -> Iterator[Any]:
    """The scene of a fresh file without objects; what a test leaves behind is thrown away."""
    import bpy

    # Factory *settings* would disable extensions that a test has enabled; the factory start-up file does not.
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    yield bpy.context.scene
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


@pytest.fixture(scope="session")
def extension(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The add-on, built as for users, installed and enabled; its module."""
    import extension_cases as cases

    archive = cases.build_zip(tmp_path_factory.mktemp("extension"))
    cases.install(archive)
    yield cases.MODULE
    import bpy

    bpy.ops.preferences.addon_disable(module=cases.MODULE)


@pytest.fixture
def scene(empty_scene: Any) -> Any:
    """The scene in which the test runs; a unit is a metre."""
    return empty_scene


@pytest.fixture
def link(scene: Any) -> Callable[[str, Any], Any]:
    """Make an object of a data-block (or an empty, of ``None``) and put it into the scene."""
    import bpy

    def make(name: str, data: Any) -> Any:
        obj = bpy.data.objects.new(name, data)
        scene.collection.objects.link(obj)
        return obj

    return make


@pytest.fixture
def rich_frame() -> Wireframe:
    """Bent struts of different radius, partly printed, in batches, with a vertex that no strut uses."""
    rng = np.random.default_rng(11)
    ring = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)
    low = np.column_stack([40.0 * np.cos(ring), 40.0 * np.sin(ring), np.zeros(6)])
    vertices = np.concatenate([low, 0.7 * low + [3.0, -2.0, 55.0], [[500.0, 1.0, 2.0]]])
    edges = [[i, i + 6] for i in range(6)] + [[6 + i, 6 + (i + 1) % 6] for i in range(6)]
    edges += [[(i + 1) % 6, i + 6] for i in range(6)]
    straight = Wireframe.create(vertices, edges)
    curves = straight.control_points.copy()
    curves[:12, 1:3] += rng.normal(scale=3.0, size=(12, 2, 3))
    return straight.replace(
        control_points=curves,
        radius=rng.uniform(0.8, 1.6, size=18),
        printed=np.arange(18) < 11,
        grounded=np.array([True, True, False, True, True, True] + [False] * 7),
        batch=np.array([0, 0, 2, 1, 5, 2**40] * 3),
        name="hexagon",
    )


@pytest.fixture(scope="session")
def tower_capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of a small tower with three views and a truth, without OpenCV, which is not beside every Blender."""
    from rod_rays import margin
    from small_frames import tower

    from frametwin.cameras.rigs import ring_rig
    from frametwin.capture.capture import write_capture
    from frametwin.capture.scene import Scene

    frame = tower()
    cameras = ring_rig(frame, 3, size=(120, 160))
    truth = frame.transformed(np.diag([1.0, 1.0, 0.98, 1.0])).replace(radius=frame.radius)
    scene = Scene.whole(truth, cameras)
    images = [np.where(margin(scene, camera) <= 0.0, 255, 0).astype(np.uint8) for camera in cameras]
    folder = tmp_path_factory.mktemp("tower") / "capture"
    write_capture(folder, frame, cameras, images, truth=truth)
    return folder


@pytest.fixture
def small_capture(tower_capture: Path, tmp_path: Path) -> Path:
    """A copy of it for the test to damage."""
    return Path(shutil.copytree(tower_capture, tmp_path / "capture"))
