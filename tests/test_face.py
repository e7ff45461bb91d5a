"""The face: every name is there, nothing is loaded before it is asked for, and the functions do what they say."""

from __future__ import annotations

import ast
import importlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from print_cases import LeaningPrint, print_batch

import frametwin
from frametwin import FrameTwinError, InputError
from scripts import build_extension

ROOT = Path(__file__).resolve().parent.parent
HEAVY = {"bpy", "cv2", "distributed", "matplotlib", "numba", "pydantic", "rich", "safetensors", "scipy", "torch"}
LIGHT_NAMES = (
    "Camera, Cancelled, Capture, FrameTwinError, InputError, Progress, Run, Twin, View, Wireframe, answer_print,"
    " dome_rig, evaluate, fit, generate_dataset, missing_struts, named_frame, plan_print, read_cameras, read_capture,"
    " read_frame, read_print, read_run, ring_rig, simulate, simulate_print, uncertain_struts, write_capture,"
    " write_frame, write_run"
)


def packages_after(statement: str) -> set[str]:
    """The packages that a fresh interpreter has loaded after a statement."""
    code = f"{statement}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in json.loads(done.stdout)}


def names_for_type_checkers() -> dict[str, str]:
    """Each public name and where type checkers are told that it comes from, as ``module:name``."""
    tree = ast.parse(Path(frametwin.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    return {
        alias.asname or alias.name: f"{node.module}:{alias.name}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


# --- names


@pytest.mark.parametrize("name", frametwin.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    assert name in dir(frametwin)
    value = getattr(frametwin, name)
    assert getattr(frametwin, name) is value
    if name != "__version__":
        assert value.__doc__ and value.__module__.startswith("frametwin.")


def test_type_checkers_see_the_objects_that_programs_get() -> None:
    told = names_for_type_checkers()
    assert {"__version__", *told} == set(frametwin.__all__)
    for name, place in told.items():
        module, inner = place.split(":")
        assert getattr(importlib.import_module(module), inner) is getattr(frametwin, name)


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        frametwin.fly  # noqa: B018
    with pytest.raises(ImportError, match="fly"):
        exec("from frametwin import fly")


def test_folders_of_the_library_stay_packages() -> None:
    for name in ("capture", "twin", "cameras", "formats", "geometry", "fitting"):
        assert importlib.import_module(f"frametwin.{name}").__path__


def test_names_are_listed_before_anything_is_imported() -> None:
    loaded = packages_after(f"import frametwin\nassert set({frametwin.__all__!r}) <= set(dir(frametwin))")
    assert "frametwin" in loaded and not loaded & {*HEAVY, "numpy"}


def test_reading_files_and_naming_functions_loads_nothing_heavy() -> None:
    loaded = packages_after(f"from frametwin import {LIGHT_NAMES}")
    assert "numpy" in loaded and not loaded & HEAVY


# --- the version


def test_the_version_is_written_in_one_place() -> None:
    version = re.compile(rf"(?<![\d.]){re.escape(frametwin.__version__)}(?![\d.])")
    history = {"CHANGELOG.md", "constraints.txt", "LICENSE"}  # what was, and what others are at
    text = {".cff", ".html", ".md", ".py", ".toml", ".txt", ".yaml", ".yml"}
    files = [path for path in ROOT.iterdir() if path.name not in history]
    for folder in ("frametwin", "addon", "scripts", "docs", "datasets", ".github"):
        files += (ROOT / folder).rglob("*")
    files = [path for path in files if path.suffix in text]
    places = [path for path in files if version.search(path.read_text(encoding="utf-8"))]
    assert places == [ROOT / "frametwin" / "__init__.py"]


def test_the_changelog_knows_the_version() -> None:
    headings = re.findall(r"^## \[(.+?)\](?: - (.+))?$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert headings[0] == ("Unreleased", "")
    version, day = headings[1]
    assert version == frametwin.__version__ and re.fullmatch(r"\d{4}-\d{2}-\d{2}", day)


def test_the_extension_is_built_with_that_version() -> None:
    assert build_extension.project_version() == frametwin.__version__
    assert '"{version}"' in (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")


# --- functions


@pytest.fixture(scope="module")
def print_() -> frametwin.Simulation:
    return frametwin.simulate("bridge", views=6, size=(300, 400), missing=1, seed=2)


@pytest.fixture(scope="module")
def result(print_: frametwin.Simulation) -> frametwin.FitResult:
    return frametwin.fit(print_)


@pytest.fixture(scope="module")
def capture_folder(print_: frametwin.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("face") / "capture"
    frametwin.write_simulation(folder, print_)
    return folder


def test_a_simulation_a_capture_and_its_folder_are_fitted_alike(
    result: frametwin.FitResult, capture_folder: Path
) -> None:
    for capture in (str(capture_folder), frametwin.read_capture(capture_folder)):
        twin = frametwin.fit(capture).twin
        assert np.array_equal(twin.control_points, result.twin.control_points)


def test_a_run_that_was_written_is_read_again(
    result: frametwin.FitResult, print_: frametwin.Simulation, capture_folder: Path, tmp_path: Path
) -> None:
    points = print_.frame.vertices
    captures = (print_, capture_folder, frametwin.read_capture(capture_folder))
    for name, capture in zip("abc", captures, strict=True):
        frametwin.write_run(tmp_path / name, result, capture)
        run = frametwin.read_run(tmp_path / name)
        assert np.array_equal(run.twin.control_points, result.twin.control_points)
        assert np.array_equal(run.frame.vertices, points)
        assert np.array_equal(run.field.evaluate(points), result.field.evaluate(points))
        assert frametwin.read_run(tmp_path / name / "twin.json").folder == tmp_path / name
    with pytest.raises(InputError, match="not empty|exists"):
        frametwin.write_run(tmp_path / "a", result, print_)
    frametwin.write_run(tmp_path / "a", result, print_, overwrite=True)


def test_errors_are_the_same_however_twin_and_truth_are_given(
    result: frametwin.FitResult, print_: frametwin.Simulation, capture_folder: Path, tmp_path: Path
) -> None:
    frametwin.write_run(tmp_path / "run", result, print_)
    run = frametwin.read_run(tmp_path / "run")
    capture = frametwin.read_capture(capture_folder)
    errors = [
        frametwin.evaluate(found, truth).summary()
        for found in (result, result.twin, run, tmp_path / "run")
        for truth in (print_, capture, capture_folder)
    ]
    assert all(other == errors[0] for other in errors)
    before = frametwin.evaluate(print_.frame, print_).curves.mean
    assert errors[0]["curves"]["mean"] < 0.1 * before  # the print sags by millimetres, the fit finds it to hundredths


def test_a_shifted_frame_is_as_far_from_the_truth_as_it_was_shifted(tmp_path: Path) -> None:
    frame = frametwin.named_frame("bridge")
    step = np.eye(4)
    step[:3, 3] = 0.3, 0.0, 0.4
    frametwin.write_frame(tmp_path / "truth.json", frame.transformed(step))
    for truth in (frame.transformed(step), tmp_path / "truth.json"):
        errors = frametwin.evaluate(frame, truth)
        assert errors.joints.max == pytest.approx(0.5) and errors.equal_parameter.max == pytest.approx(0.5)


def test_a_fit_can_be_stopped_and_told_of(print_: frametwin.Simulation) -> None:
    stages: list[str] = []

    def stop(progress: frametwin.Progress) -> bool:
        stages.append(progress.stage)
        return len(stages) < 3

    with pytest.raises(frametwin.Cancelled):
        frametwin.fit(print_, progress=stop)
    assert len(stages) == 3


def test_frames_are_taken_as_objects_files_and_names(tmp_path: Path) -> None:
    frametwin.write_frame(tmp_path / "plan.json", frametwin.named_frame("bridge"))
    plans = ["bridge", tmp_path / "plan.json", frametwin.named_frame("bridge")]
    first, *others = [frametwin.simulate(plan, views=2, size=(30, 40)) for plan in plans]
    assert all(np.array_equal(other.truth.vertices, first.truth.vertices) for other in others)
    with pytest.raises(InputError, match="no_such_frame"):
        frametwin.simulate("no_such_frame")


def test_a_job_is_planned_answered_and_opened(straight_frame: frametwin.Wireframe, tmp_path: Path) -> None:
    folder = tmp_path / "job"
    job = frametwin.plan_print(straight_frame, folder, batch_size=8, allow_contact=True)
    assert isinstance(job, frametwin.PrintJob) and job.current == 0
    assert list((job.batch_folder(0) / "waypoints").iterdir())
    real = LeaningPrint(straight_frame)
    print_batch(job, real)
    report = frametwin.answer_print(folder, real.take(tmp_path / "first"))
    assert report["batch"] == 0 and report["lost"] == []
    again = frametwin.read_print(folder)
    assert again.current == 1 and again.report(0) == report
    with pytest.raises(FrameTwinError, match="old-capture"):
        frametwin.answer_print(again, real.take(tmp_path / "second"))
    assert again.current == 1


def test_a_print_is_simulated_with_and_without_adaptation(straight_frame: frametwin.Wireframe, tmp_path: Path) -> None:
    options = {"views": 4, "size": (150, 200), "batch_size": 12}
    blind = frametwin.simulate_print(straight_frame, tmp_path / "blind", adapt=False, **options)
    assert isinstance(blind, frametwin.SimulatedPrint)
    assert not blind.job.settings.adapt and not blind.job.settings.reprint
    assert not any(blind.twin_seconds)
    other = frametwin.simulate_print(straight_frame, tmp_path / "other", adapt=False, seed=1, **options)
    assert other.report.e_max != blind.report.e_max
    same = frametwin.simulate_print(straight_frame, tmp_path / "same", adapt=False, **options)
    assert same.report.e_max == blind.report.e_max


def test_a_dataset_is_made_of_a_recipe(tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.toml"
    recipe.write_text(
        'format = "frametwin-recipe"\nversion = 1\nname = "small"\ncount = 5\nseed = 3\n'
        '[[frames]]\nframe = "bridge"\n[[deformations]]\nkind = "sag"\npeak_fraction = 0.05\n'
        '[rig]\nviews = 2\nsize = [60, 80]\n[render]\nstyle = "silhouette"\n',
        encoding="utf-8",
    )
    report = frametwin.generate_dataset(recipe, tmp_path / "out", count=1)
    assert report.made == [0] and not report.failed
    assert len(frametwin.read_capture(tmp_path / "out" / "samples" / "000000").views) == 2
    assert frametwin.generate_dataset(recipe, tmp_path / "out", count=1).kept == [0]
