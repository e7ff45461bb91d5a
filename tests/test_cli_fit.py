"""The commands that make and use captures and runs: simulate, fit, evaluate, demo."""

from __future__ import annotations

import json
import shutil
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_tools import done, refused

from frametwin.blender.rendering import client as rendering
from frametwin.capture.capture import read_capture
from frametwin.cli import fit as fit_module
from frametwin.cli.demo import is_own_demo, takes_blender
from frametwin.errors import InputError
from frametwin.fitting.api import PRESETS, settings_of
from frametwin.formats import read_frame, write_frame
from frametwin.geometry.parametric import named_frame
from frametwin.imaging.masks import read_masks
from frametwin.twin.twin import read_twin

SMALL = ("--size", "200x150", "--views", "6", "--seed", "1", "--missing", "2")


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("captures") / "bridge"
    done("simulate", "bridge", "--out", folder, *SMALL, "--quiet")
    return folder


@pytest.fixture(scope="module")
def fitted(capture: Path) -> Path:
    folder = capture.parent / "run"
    done("fit", capture, "--out", folder, "--quiet")
    return folder


def test_presets_are_those_of_the_library() -> None:
    assert fit_module.PRESETS == PRESETS


def test_convert_a_run_gives_the_curves_of_the_twin(fitted: Path, tmp_path: Path) -> None:
    done("convert", fitted, tmp_path / "twin.json")
    assert np.array_equal(read_frame(tmp_path / "twin.json").control_points, read_twin(fitted).control_points)


def test_info_of_a_capture_and_a_run(capture: Path, fitted: Path) -> None:
    data = json.loads(done("info", capture, "--json").stdout)
    assert data["kind"] == "capture" and data["views"] == 6 and data["sizes"] == ["200x150"] and data["truth"]
    assert len(data["struts_missing"]) == 2
    assert "200x150" in done("info", capture).stdout
    data = json.loads(done("info", fitted / "twin.json", "--json").stdout)
    assert data["kind"] == "run" and data["preset"] == "fast" and data["struts"] == 76
    assert "preset" in done("info", fitted).stdout


def test_info_refuses_what_is_damaged(capture: Path, fitted: Path, tmp_path: Path) -> None:
    assert "does not exist" in refused("info", tmp_path / "nothing")
    damaged = shutil.copytree(capture, tmp_path / "damaged")
    next((damaged / "images").iterdir()).unlink()
    assert "is missing" in refused("info", damaged)
    other = shutil.copytree(fitted, tmp_path / "other")
    write_frame(other / "frame.json", named_frame("half_bowl"))
    assert "156 struts" in refused("info", other)


def test_simulate(capture: Path) -> None:
    content = read_capture(capture)
    assert content.truth is not None and len(content.views) == 6
    assert content.views[0].camera.height == 150
    assert json.loads((capture / "simulation.json").read_text())["seed"] == 1


def test_output_folders_are_not_overwritten(capture: Path, fitted: Path, tmp_path: Path) -> None:
    small = ("--size", "128x96", "--views", "2", "--quiet")
    folder = tmp_path / "precious"
    folder.mkdir()
    (folder / "thesis.txt").write_text("years of work")
    (tmp_path / "file").write_text("")
    for begin in (("simulate", "bridge", *small), ("fit", capture)):
        assert "not empty" in refused(*begin, "--out", folder)
        assert "something else" in refused(*begin, "--out", folder, "--overwrite")
        assert "name of a file" in refused(*begin, "--out", tmp_path / "file")
        assert "below the file" in refused(*begin, "--out", tmp_path / "file" / "run")
    assert [path.name for path in folder.iterdir()] == ["thesis.txt"]
    assert "not empty" in refused("fit", capture, "--out", fitted)
    (tmp_path / "empty").mkdir()
    done("simulate", "bridge", *small, "--out", tmp_path / "empty")
    done("simulate", "bridge", *small, "--out", tmp_path / "empty", "--overwrite")
    assert (tmp_path / "empty" / "transforms.json").is_file()


def test_fit_writes_a_run(capture: Path, fitted: Path) -> None:
    assert sorted(path.name for path in fitted.iterdir()) == ["field.safetensors", "frame.json", "twin.json"]
    twin = read_twin(fitted)
    assert twin.strut_count == 76 and twin.provenance["preset"] == "fast"


def test_fit_reports_missing_struts_and_can_start_warm(capture: Path, fitted: Path, tmp_path: Path) -> None:
    result = done("fit", capture, "--out", tmp_path / "run", "--warm-start", fitted, "--json")
    data = json.loads(result.stdout)
    lost = json.loads((capture / "defects.json").read_text())["struts"]
    assert [item["strut"] for item in data["missing"]] == lost
    assert data["struts"] == 76 and data["seconds"] > 0.0 and data["views"] == 6
    assert "reading images 6/6" in result.stderr
    text = dict(fit_module.summary_facts(data, 6))["missing struts"]
    assert all(f"{strut} (" in text for strut in lost)


def test_fit_changes_settings(capture: Path, tmp_path: Path) -> None:
    few = (
        "--preset",
        "paper-lattice",
        "--set",
        "kernels_per_strut=5",
        "--set",
        "iterations=3",
        "--set",
        "image_scale=0.25",
    )
    done("fit", capture, "--out", tmp_path / "run", "--quiet", *few, "--set", "lattice_cells=1, 2")
    twin = read_twin(tmp_path / "run")
    assert len(twin.loss) == 3 and list(twin.provenance["changes"]["lattice_cells"]) == [1, 2]


@pytest.mark.parametrize(
    ("preset", "assignment", "words"),
    [
        ("fast", "speed=3", "is not a setting"),
        ("fast", "kernels_per_strut", "is not NAME=VALUE"),
        ("fast", "seed=3", "is not a setting"),
        ("fast", "coarse=3", "is not a setting"),
        ("fast", "kernels_per_strut=many", "of another kind"),
        ("fast", "kernels_per_strut=2.5", "of another kind"),
        ("fast", "kernels_per_strut=true", "of another kind"),
        ("fast", "learn_opacity=1", "of another kind"),
        ("fast", "kernels_per_strut=0", "kernels_per_strut"),
        ("paper", "spread=-1", "spread"),
        ("paper", "spread=NaN", "spread"),
        ("paper", "lattice_cells=1,x", "of another kind"),
        ("paper", "field=cloud", "field"),
    ],
)
def test_settings_that_cannot_be_are_refused(
    capture: Path, tmp_path: Path, preset: str, assignment: str, words: str
) -> None:
    text = refused("fit", capture, "--out", tmp_path / "run", "--preset", preset, "--set", assignment, "--quiet")
    assert words in text and not (tmp_path / "run").exists()


def test_settings_are_of_the_kind_they_replace() -> None:
    changes = fit_module.parse_changes(
        ["iterations=7", "spread=2", "field=free", "adaptive_kernels=true", "lattice_cells=[2, 4]"],
        settings_of("paper"),
    )
    assert changes == {
        "iterations": 7, "spread": 2.0, "field": "free", "adaptive_kernels": True, "lattice_cells": (2, 4),
    }  # fmt: skip
    assert isinstance(changes["spread"], float)
    with pytest.raises(InputError, match="given twice"):
        fit_module.parse_changes(["spread=1", "spread=2"], settings_of("paper"))


def test_fit_refuses_a_damaged_capture_and_writes_nothing(capture: Path, tmp_path: Path) -> None:
    damaged = shutil.copytree(capture, tmp_path / "damaged")
    picture = next((damaged / "images").iterdir())
    picture.write_bytes(picture.read_bytes()[:200])
    assert picture.name in refused("fit", damaged, "--out", tmp_path / "run", "--quiet")
    assert "no such folder" in refused("fit", tmp_path / "none", "--out", tmp_path / "run")
    assert "does not exist" in refused(
        "fit", capture, "--out", tmp_path / "run", "--warm-start", tmp_path / "gone", "--quiet"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["damaged"]


def test_evaluate(capture: Path, fitted: Path) -> None:
    data = json.loads(done("evaluate", fitted, capture, "--json").stdout)
    for name in ("curves", "joints", "equal_parameter"):
        assert 0.0 < data[name]["mean"] <= data[name]["p95"] <= data[name]["max"] < 5.0
    assert len(data["struts"]["curves_mean"]) == 76 and len(data["joint_errors"]["distance"]) == 32
    assert len(data["missing"]["found"]) == 2 and not data["missing"]["overlooked"]
    text = done("evaluate", fitted, capture, "--worst", "3").stdout
    assert "curves, both ways" in text and "2 of 2 found" in text and "Worst struts" in text
    assert f"{data['curves']['mean']:.3f}" in text


def test_evaluate_against_a_frame_file(capture: Path, fitted: Path, tmp_path: Path) -> None:
    twin, plan = read_twin(fitted), read_frame(capture)
    write_frame(tmp_path / "same.json", twin.as_wireframe(plan))
    data = json.loads(done("evaluate", fitted, tmp_path / "same.json", "--json").stdout)
    assert data["curves"]["max"] < 1e-6 and data["joints"]["max"] < 1e-9 and "missing" not in data
    assert "does not exist" in refused("evaluate", fitted, tmp_path / "none.json")
    write_frame(tmp_path / "other.json", named_frame("half_bowl"))
    assert "vertices" in refused("evaluate", fitted, tmp_path / "other.json")
    assert "truth.json" in refused("evaluate", fitted, tmp_path)
    assert "does not exist" in refused("evaluate", tmp_path / "nowhere", capture)


@pytest.mark.skipif(find_spec("bpy") is None, reason="Blender's Python module is not installed")
def test_demo_renders_with_blender_and_says_so(tmp_path: Path) -> None:
    pictures = {}
    for renderer in ("auto", "library"):
        folder = tmp_path / renderer
        result = done("demo", "--out", folder, *SMALL, "--renderer", renderer, "--quiet")
        name = json.loads((folder / "demo.json").read_text())["renderer"]
        assert name.startswith("Blender " if renderer == "auto" else "the library") and name in result.stdout
        pictures[renderer] = read_masks(read_capture(folder / "capture"))
    for blender, library in zip(pictures["auto"], pictures["library"], strict=True):
        assert blender.sum() > 500.0 and np.mean(blender != library) < 0.005


def test_a_demo_without_blender_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendering, "blender_is_here", lambda: False)
    assert not takes_blender("auto") and not takes_blender("library")
    with pytest.raises(InputError, match=r"bpy is not installed; install it by"):
        takes_blender("blender")


def test_demo(tmp_path: Path) -> None:
    folder = tmp_path / "out" / "demo"
    result = done("demo", "--out", folder, *SMALL)
    assert sorted(path.name for path in folder.iterdir()) == ["capture", "demo.json", "run", "views.png"]
    assert "plan mean" in result.stdout and "twin max" in result.stdout and str(folder) in result.stdout
    data = json.loads((folder / "demo.json").read_text())
    for name in ("curves", "joints", "equal_parameter"):
        assert data["twin"][name]["mean"] < 0.2 * data["plan"][name]["mean"]
        assert f"{data['twin'][name]['max']:.3f}" in result.stdout
    assert len(data["missing_struts"]["found"]) == 2
    picture = cv2.imread(str(folder / "views.png"))
    assert picture is not None and picture.shape[1] > 1000
    assert json.loads(done("evaluate", folder / "run", folder / "capture", "--json").stdout)["curves"] == pytest.approx(
        data["twin"]["curves"]
    )

    assert is_own_demo(folder) and not is_own_demo(folder / "run") and not is_own_demo(tmp_path)
    (folder / "thesis.txt").write_text("years of work")
    assert "something else" in refused("demo", "--out", folder, *SMALL)
    assert (folder / "thesis.txt").exists()
    assert "does not exist" in refused("demo", "--frame", "pyramid", "--out", tmp_path / "x")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
