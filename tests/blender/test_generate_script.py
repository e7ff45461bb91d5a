"""scripts/generate_dataset.py in this Blender makes the samples that the command makes in the project's environment."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("bpy", reason="Blender's Python module is not installed")

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts" / "generate_dataset.py"
PYTHON = os.environ.get("FRAMETWIN_PYTHON") or sys.executable
RECIPE = """
format = "frametwin-recipe"
version = 1
name = "tiny"
count = 3
[[frames]]
frame = "bridge"
[[deformations]]
kind = "sag"
[printing]
printed = [0.5, 1.0]
missing = 1
thickness_variation = 0.04
[rig]
views = 2
size = [90, 120]
[render]
style = "mask"
"""


def run(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in words],
        cwd=ROOT,
        env={**os.environ, "FRAMETWIN_PYTHON": PYTHON, **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def contents(out: Path) -> dict[int, str]:
    listed = json.loads((out / "dataset.json").read_text(encoding="utf-8"))["samples"]
    return {entry["index"]: entry["content"] for entry in listed}


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


def test_the_script_makes_what_the_command_makes(recipe: Path, tmp_path: Path) -> None:
    script = run(sys.executable, SCRIPT, "--", recipe, "--out", tmp_path / "script", "--per-process", 2)
    assert script.returncode == 0, script.stderr
    assert "3 samples made" in script.stderr and "Traceback" not in script.stderr
    command = run(PYTHON, "-m", "frametwin", "dataset", "generate", recipe, "--out", tmp_path / "command", "--quiet")
    assert command.returncode == 0, command.stderr
    found = contents(tmp_path / "script")
    assert sorted(found) == [0, 1, 2] and found == contents(tmp_path / "command")
    again = run(sys.executable, SCRIPT, "--", recipe, "--out", tmp_path / "script")
    assert again.returncode == 0 and "3 samples are there, 0 are wanted" in again.stderr


def test_a_frame_that_was_bent_in_blender(tmp_path: Path) -> None:
    import bpy

    from frametwin.blender.frames.curves import wireframe_to_curve
    from frametwin.formats import frame_json
    from frametwin.geometry.parametric import named_frame

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    plan = named_frame("half_bowl")
    curve = wireframe_to_curve(plan, name="Bowl")
    lattice = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
    bpy.context.scene.collection.objects.link(lattice)
    for axis in "uvw":
        setattr(lattice.data, f"interpolation_type_{axis}", "KEY_LINEAR")  # an even stretch stays even
    for point in lattice.data.points:
        point.co_deform = (1.1 * point.co_deform[0], point.co_deform[1], point.co_deform[2])
    curve.modifiers.new("Cage", "LATTICE").object = lattice
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bent.blend"))
    deformation = 'kind = "blend"\nfile = "bent.blend"\nobject = "Bowl"'
    text = RECIPE.replace('kind = "sag"', deformation).replace('[[frames]]\nframe = "bridge"\n', "")
    (tmp_path / "bent.toml").write_text(text.replace("count = 3", "count = 1"), encoding="utf-8")
    script = run(sys.executable, SCRIPT, "--", tmp_path / "bent.toml", "--out", tmp_path / "d")
    assert script.returncode == 0, script.stderr
    sample = tmp_path / "d" / "samples" / "000000"
    found, truth = frame_json.read(sample / "frame.json"), frame_json.read(sample / "truth.json")
    assert abs(found.vertices - plan.vertices).max() < 1e-4
    # The cage is a cube of 1 m about the origin: everything is stretched along x.
    assert abs(truth.vertices - plan.vertices * [1.1, 1.0, 1.0]).max() < 1e-3
    assert truth.printed.sum() < truth.strut_count


def test_mistakes_are_told_in_a_sentence(recipe: Path, tmp_path: Path) -> None:
    cases = [
        ([tmp_path / "none.toml", "--out", tmp_path / "d"], {}, "does not exist"),
        ([recipe, "--out", tmp_path / "d", "--shard", "4/3"], {}, "from 1 to n"),
        ([recipe, "--out", tmp_path / "d", "--count", "0"], {}, "count: is 0"),
        ([recipe, "--out", tmp_path / "d", "--seed", "-1"], {}, "seed: is -1"),
        ([recipe, "--out", tmp_path / "d", "--python", tmp_path / "nothing"], {}, "does not exist"),
        ([recipe, "--out", recipe], {}, "something else"),
    ]
    for words, environment, expected in cases:
        result = run(sys.executable, SCRIPT, "--", *words, **environment)
        assert result.returncode == 2 and expected in result.stderr, result.stderr
        assert "Traceback" not in result.stderr and not (tmp_path / "d").exists()
