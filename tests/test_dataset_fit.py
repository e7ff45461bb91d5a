"""``frametwin dataset fit``: every sample fitted once, the table of errors, failures that do not stop the others."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dataset_cases import edit_image, make_dataset, rows_of, run_command

from frametwin.capture.capture import read_capture
from frametwin.cli.dataset_fit import fit_command
from frametwin.dataset.fits import (
    COLUMNS,
    DatasetFitSettings,
    FitRow,
    SampleTask,
    current_twin,
    fit_dataset,
    fit_sample,
    measure,
    summarise,
)
from frametwin.dataset.folder import read_dataset, sample_folder
from frametwin.errors import Cancelled, InputError
from frametwin.evaluation.evaluate import evaluate
from frametwin.formats import defects_json
from frametwin.twin.twin import read_twin

SAMPLES = ({"seed": 1, "missing": 2}, {"seed": 2, "deformation": "warp"})


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    dataset = make_dataset(tmp_path_factory.mktemp("datasets") / "fitted", samples=SAMPLES, size=(150, 200), views=6)
    fit_dataset(dataset)
    return dataset


@pytest.fixture
def dataset(fitted: Path, tmp_path: Path) -> Path:
    return shutil.copytree(fitted, tmp_path / "dataset")


def test_the_table_holds_the_errors_of_the_twins(fitted: Path) -> None:
    rows = rows_of(fitted)
    assert sorted(rows) == [0, 1] and all(row.error is None for row in rows.values())
    for index, row in rows.items():
        capture = read_capture(sample_folder(fitted, index))
        twin = read_twin(fitted / "runs" / f"{index:06d}")
        assert capture.truth is not None
        present = defects_json.read(capture.root, capture.frame.printed) if index == 0 else None
        errors = evaluate(twin.curves, twin.vertices, capture.truth, present)
        assert (row.frame, row.struts, row.printed, row.views) == ("bridge", 76, 76, 6)
        assert row.curves_mean == errors.curves.mean and row.curves_max == errors.curves.max
        assert row.joints_max == errors.joints.max and row.equal_mean == errors.equal_parameter.mean
        assert row.curves_mean is not None and row.curves_mean < 0.2  # mm, of 8 mm and more of sag
    assert rows[0].found == 2 and rows[0].overlooked == 0 and rows[1].found == 0


def test_the_csv_file_is_the_same_table(fitted: Path) -> None:
    with open(fitted / "errors.csv", newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    rows = rows_of(fitted)
    assert [line["index"] for line in lines] == ["0", "1"] and tuple(lines[0]) == COLUMNS
    for line in lines:
        row = rows[int(line["index"])]
        assert float(line["equal_max"]) == row.equal_max and line["frame"] == "bridge" and line["error"] == ""


def test_runs_are_kept_if_nothing_has_changed(dataset: Path) -> None:
    before = {path: path.read_bytes() for path in dataset.glob("runs/*/twin.json")}
    table = (dataset / "errors.csv").read_bytes()
    assert all(row.kept for row in fit_dataset(dataset))
    assert {path: path.read_bytes() for path in before} == before
    assert (dataset / "errors.csv").read_bytes() == table


def test_runs_belong_to_their_files_and_settings(dataset: Path) -> None:
    run, settings = dataset / "runs" / "000001", DatasetFitSettings()
    capture = read_capture(sample_folder(dataset, 1))
    assert current_twin(run, capture, settings) is not None
    for other in (
        DatasetFitSettings(seed=3),
        DatasetFitSettings("paper-lattice"),
        DatasetFitSettings(changes={"field_cells": (1, 3)}),
    ):
        assert current_twin(run, capture, other) is None
    assert current_twin(dataset / "runs" / "000000", capture, settings) is None  # that of another sample
    edit_image(capture.views[3].image.path, _with_a_speck)
    capture = read_capture(sample_folder(dataset, 1))
    assert current_twin(run, capture, settings) is None
    assert current_twin(dataset / "runs" / "000005", capture, settings) is None


def test_changed_settings_are_found_again_in_the_file(dataset: Path) -> None:
    settings = DatasetFitSettings(changes={"field_cells": (1, 3)})
    task = SampleTask(read_dataset(dataset).samples[1], dataset / "runs" / "000001")
    assert not fit_sample(task, settings).kept
    assert fit_sample(task, settings).kept


def test_runs_that_are_damaged_or_out_of_date_are_made_again(dataset: Path) -> None:
    edit_image(next((sample_folder(dataset, 1) / "images").iterdir()), _with_a_speck)
    (dataset / "runs" / "000000" / "twin.json").write_text("{")
    assert [row.kept for row in fit_dataset(dataset)] == [False, False]
    assert read_twin(dataset / "runs" / "000000").strut_count == 76


def _with_a_speck(image: np.ndarray) -> np.ndarray:
    changed = image.copy()
    changed[0, 0] = 255
    return changed


def test_a_sample_that_fails_does_not_stop_the_others(dataset: Path) -> None:
    shutil.rmtree(dataset / "runs")
    (sample_folder(dataset, 0) / "truth.json").unlink()
    image = next((sample_folder(dataset, 0) / "images").iterdir())
    image.write_bytes(image.read_bytes()[:50])
    result = run_command(fit_command, dataset, "--quiet")
    assert result.exit_code == 1
    assert "Sample 0 failed" in result.stderr and "cut short" in result.stderr and "1 of 2 samples" in result.stdout
    rows = rows_of(dataset)
    assert rows[0].error is not None and rows[0].curves_mean is None and rows[1].error is None
    assert not (dataset / "runs" / "000000").exists() and (dataset / "runs" / "000001" / "twin.json").is_file()


def test_a_sample_without_truth_is_fitted_but_has_no_errors(dataset: Path) -> None:
    (sample_folder(dataset, 0) / "truth.json").unlink()
    row = fit_dataset(dataset)[0]
    assert row.error is not None and "truth.json: is missing" in row.error
    assert (dataset / "runs" / "000000" / "twin.json").is_file()


def test_the_command_prints_a_table(dataset: Path) -> None:
    result = run_command(fit_command, dataset)
    assert result.exit_code == 0
    lines = [line.split() for line in result.stdout.splitlines() if line.strip()]
    (total,) = (line for line in lines if line[0] == "all")
    rows = rows_of(dataset)
    worst = max(row.curves_max for row in rows.values() if row.curves_max is not None)
    assert f"{worst:.3f}" in total and "000001" in result.stdout and "2/2" in result.stdout
    assert "fitting samples 2/2" in result.stderr


def test_the_command_gives_json(dataset: Path) -> None:
    data = json.loads(run_command(fit_command, dataset, "--json", "--quiet").stdout)
    assert [item["kept"] for item in data["samples"]] == [True, True]
    means = [item["curves_mean"] for item in data["samples"]]
    assert data["summary"]["curves_mean"] == pytest.approx(np.mean(means)) and data["summary"]["failed"] == 0


def test_wrong_input(dataset: Path, tmp_path: Path) -> None:
    assert run_command(fit_command, tmp_path / "nothing").exit_code == 2
    result = run_command(fit_command, dataset, "--set", "nonsense=3")
    assert result.exit_code == 2 and "nonsense" in result.stderr
    with pytest.raises(InputError, match="preset"):
        DatasetFitSettings("faster")


def test_a_run_that_is_stopped_leaves_the_table_as_it_was(dataset: Path) -> None:
    table = (dataset / "fit.json").read_bytes()
    with pytest.raises(Cancelled):
        fit_dataset(dataset, again=True, progress=lambda step: "sample 2" not in step.stage)
    assert (dataset / "fit.json").read_bytes() == table
    assert (dataset / "runs" / "000001" / "twin.json").is_file()


def test_the_summary_is_over_what_was_fitted() -> None:
    rows = [FitRow(0, error="no"), *(FitRow(i, **dict.fromkeys(_numbers(), float(i))) for i in (1, 2))]
    data = summarise(rows)
    assert (data["fitted"], data["failed"]) == (2, 1)
    assert data["curves_mean"] == 1.5 and data["curves_max"] == 2.0 and data["found"] == 3.0
    assert summarise(rows[:1])["curves_mean"] is None


def _numbers() -> tuple[str, ...]:
    capture_names = ("index", "frame", "struts", "printed", "views", "error")
    return tuple(name for name in COLUMNS if name not in capture_names)


def test_measuring_the_truth_gives_no_error(fitted: Path) -> None:
    capture = read_capture(sample_folder(fitted, 1))
    twin = read_twin(fitted / "runs" / "000001")
    assert capture.truth is not None
    exact = replace(twin, control_points=capture.truth.control_points, vertices=capture.truth.vertices)
    found = measure(capture, exact)
    assert found["curves_max"] < 1e-9 and found["equal_max"] < 1e-9 and found["joints_max"] == 0.0
