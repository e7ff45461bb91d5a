"""The script that goes from a capture, or a plan, to a .blend file with the twin and a picture of it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from worker_cases import worker_python

from frametwin.blender.display.twins import RUN_KEY, find_twin, is_twin
from frametwin.capture.image_files import decode_png
from frametwin.twin.runs import load_run

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "fit_capture.py"


def run(*words: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), "--", *map(str, words), "--python", worker_python()]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def test_a_plan_becomes_a_file_with_its_twin(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run("bridge", "--out", out, "--size", "400x300", "--views", "6")
    assert done.returncode == 0, done.stderr
    picture = decode_png((out / "twin.png").read_bytes())
    assert picture.shape[:2] == (1200, 1600) and len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 100
    bpy.ops.wm.open_mainfile(filepath=str(out / "twin.blend"))
    (collection,) = [found for found in bpy.data.collections if is_twin(found)]
    assert collection[RUN_KEY] == str(out / "run")
    shown, (twin, _) = find_twin(collection), load_run(out / "run")
    np.testing.assert_array_equal(shown.frame().control_points, twin.control_points)
    assert "error" in shown.values and len(bpy.data.cameras) == 6
    assert len([image for image in bpy.data.images if image.packed_file]) == 6
    assert bpy.data.scenes.keys() == ["Scene"]
    again = run("bridge", "--out", out)
    assert again.returncode == 2 and "Traceback" not in again.stderr and (out / "twin.blend").is_file()


def test_a_capture_is_fitted_as_it_is(small_capture: Path, tmp_path: Path) -> None:
    done = run(small_capture, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"run", "twin.blend", "twin.png"}


def test_bad_input_leaves_nothing(tmp_path: Path) -> None:
    done = run(tmp_path / "nowhere", "--out", tmp_path / "out")
    assert done.returncode == 2 and "nowhere" in done.stderr and "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
