"""``frametwin dataset validate``: datasets that are fine, and every kind of damage, each with its reason."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from dataset_cases import (
    edit_image,
    edit_json,
    make_dataset,
    note_again,
    run_command,
    write_passes,
    write_true_curves,
)

from frametwin.cameras import to_nerfstudio
from frametwin.capture.capture import read_capture
from frametwin.cli.dataset_checks import validate_command
from frametwin.dataset.folder import read_sample, sample_folder, write_sample_json
from frametwin.dataset.true_curves import read_true_curves
from frametwin.dataset.validate import validate_dataset, validate_sample
from frametwin.errors import Cancelled
from frametwin.raster.silhouette import silhouettes


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_dataset(tmp_path_factory.mktemp("datasets") / "made", size=(240, 320))


@pytest.fixture
def dataset(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "dataset")


def image_of(dataset: Path, view: int = 0) -> Path:
    return sorted((sample_folder(dataset, 0) / "images").iterdir())[view]


def shifted(image: np.ndarray, columns: int) -> np.ndarray:
    moved = np.zeros_like(image)
    moved[:, columns:] = image[:, :-columns]
    return moved


def test_a_good_dataset_is_fine(made: Path) -> None:
    assert validate_dataset(made).fine
    result = run_command(validate_command, made, "--quiet")
    assert result.exit_code == 0 and "All 2 samples" in result.stdout and result.stderr == ""


def test_a_dataset_without_curve_samples_is_fine(tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "d", samples=[{"seed": 5, "missing": 2}], curves=False)
    assert validate_dataset(dataset).fine


def test_several_processes_find_the_same(dataset: Path) -> None:
    image_of(dataset).unlink()
    found = validate_dataset(dataset, workers=2)
    assert found.as_dict() == validate_dataset(dataset).as_dict() and not found.fine


def test_which_sample_and_why(dataset: Path) -> None:
    image_of(dataset).unlink()
    result = run_command(validate_command, dataset, "--quiet")
    assert result.exit_code == 1
    assert "Sample 0" in result.stdout and f"images/{image_of(dataset).name}" not in result.stdout
    assert "is missing" in result.stdout and "1 of 2 samples are bad" in result.stdout
    data = json.loads(run_command(validate_command, dataset, "--json", "--quiet").stdout)
    assert data["checked"] == 2 and not data["fine"] and [bad["index"] for bad in data["bad"]] == [0]


def test_what_is_no_dataset_is_wrong_input(tmp_path: Path) -> None:
    result = run_command(validate_command, tmp_path)
    assert result.exit_code == 2 and "is no dataset" in result.stderr and result.stdout == ""


def test_validation_can_be_stopped(made: Path) -> None:
    with pytest.raises(Cancelled):
        validate_dataset(made, progress=lambda step: step.iteration < 1)


@pytest.mark.parametrize("columns", [2, 5])
def test_pictures_that_are_shifted_are_found(dataset: Path, columns: int) -> None:
    edit_image(image_of(dataset), lambda image: shifted(image, columns))
    note_again(dataset)
    (found,) = validate_dataset(dataset).findings
    assert found.index == 0 and all(image_of(dataset).name in problem for problem in found.problems)
    assert any("more than a pixel beside the true struts" in problem for problem in found.problems)


def test_a_shift_of_half_a_pixel_is_within_the_tolerance(dataset: Path) -> None:
    capture = read_capture(sample_folder(dataset, 0))
    assert capture.truth is not None
    curves, _ = read_true_curves(capture, capture.truth)
    camera = capture.views[0].camera
    moved = replace(camera, cx=camera.cx + 0.5, cy=camera.cy - 0.5)
    (picture,) = silhouettes(capture.truth, [moved], present=curves.intervals)
    edit_image(image_of(dataset), lambda image: picture)
    note_again(dataset)
    assert validate_dataset(dataset).fine


def test_a_strut_that_is_not_drawn_is_found(dataset: Path) -> None:
    capture = read_capture(sample_folder(dataset, 0))
    assert capture.truth is not None
    curves, _ = read_true_curves(capture, capture.truth)
    present = curves.intervals.copy()
    lengths = np.where(present[:, 1] > 0.0, capture.truth.lengths, 0.0)
    present[int(lengths.argmax())] = 0.0
    cameras = [view.camera for view in capture.views]
    for view, picture in enumerate(silhouettes(capture.truth, cameras, present=present)):
        assert cv2.imwrite(str(image_of(dataset, view)), picture)
    note_again(dataset)
    (found,) = validate_dataset(dataset).findings
    assert any("of the true struts' inside is not white" in problem for problem in found.problems)
    assert any(f"most of strut {lengths.argmax()}" in problem for problem in found.problems)


@pytest.mark.parametrize(("value", "words"), [(0, "is black"), (255, "is saturated")])
def test_black_and_white_pictures_are_found(dataset: Path, value: int, words: str) -> None:
    edit_image(image_of(dataset), lambda image: np.full_like(image, value))
    note_again(dataset)
    (found,) = validate_dataset(dataset).findings
    assert len(found.problems) == 1 and words in found.problems[0] and image_of(dataset).name in found.problems[0]


def as_photos(dataset: Path, gain: float = 1.0) -> None:
    """Turn the masks of the first sample into photos of grey struts before a blue table, with noise."""
    folder = sample_folder(dataset, 0)
    (folder / "background").mkdir(exist_ok=True)
    rng = np.random.default_rng(3)
    for path in sorted((folder / "images").iterdir()):
        mask = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        assert mask is not None
        table = np.array([110.0, 50.0, 20.0]) + rng.normal(scale=3.0, size=(*mask.shape, 3))
        struts = 190.0 + rng.normal(scale=8.0, size=(*mask.shape, 3))
        photo = np.where(mask[..., None] > 127, struts, table)
        for kind, picture in (("images", photo), ("background", table)):
            cv2.imwrite(str(folder / kind / path.name), np.clip(gain * picture, 0, 255).astype(np.uint8))
    note_again(dataset)


def test_photos_are_judged_by_their_masks(dataset: Path) -> None:
    as_photos(dataset)
    assert validate_dataset(dataset).fine
    edit_image(image_of(dataset), lambda image: np.roll(image, 4, axis=1))
    note_again(dataset)
    (found,) = validate_dataset(dataset).findings
    assert any("beside the true struts" in problem for problem in found.problems)


@pytest.mark.parametrize(("gain", "words"), [(0.05, "is black"), (20.0, "is saturated")])
def test_photos_that_are_not_exposed_well_are_found(dataset: Path, gain: float, words: str) -> None:
    as_photos(dataset, gain)
    (found,) = validate_dataset(dataset).findings
    assert all(words in problem for problem in found.problems)


def test_a_camera_that_is_not_the_pictures_is_found(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    capture = read_capture(folder)
    entry = to_nerfstudio(capture.views[1].camera, f"images/{capture.views[1].image.path.name}")
    entry["cx"] += 3.0
    edit_json(folder / "transforms.json", lambda data: data["frames"].__setitem__(1, entry))
    note_again(dataset)
    (found,) = validate_dataset(dataset).findings
    name = capture.views[1].camera.name
    assert any(f"pixels of strut 0 in {name}" in problem for problem in found.problems)
    write_true_curves(folder)  # now curves and cameras agree, and only the picture can tell
    note_again(dataset)
    (found,) = validate_dataset(dataset).findings
    assert all(f"images/{name}.png" in problem for problem in found.problems)


def test_a_pose_that_is_not_quite_rigid_is_found(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)

    def skew(data: dict) -> None:
        data["frames"][0]["transform_matrix"][0][0] += 2e-5

    edit_json(folder / "transforms.json", skew)
    note_again(dataset)
    assert any("is not rigid" in problem for problem in validate_sample(folder))


def test_a_truth_that_does_not_join_is_found(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)

    def pull(data: dict) -> None:
        data["control_points"][7][3][2] += 3e-6

    edit_json(folder / "truth.json", pull)
    note_again(dataset)
    assert any("truth.json: strut 7 ends" in problem for problem in validate_sample(folder))


def test_a_truth_of_another_frame_is_found(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    edit_json(folder / "truth.json", lambda data: data["edges"][3].reverse())
    note_again(dataset)
    assert any("truth.json" in problem for problem in validate_sample(folder))
    (folder / "truth.json").unlink()
    note_again(dataset)
    assert validate_sample(folder) == ["truth.json is missing"]


CURVE_DAMAGES: list[tuple[str, Callable[[np.ndarray], np.ndarray], str]] = [
    ("points", lambda a: a + np.float32(0.01), "points of strut"),
    ("points", lambda a: a[:, :-1], "is needed"),
    ("points", lambda a: np.full_like(a, np.nan), "points: holds values that are not finite"),
    ("tangents", lambda a: -a, "tangents of strut 0"),
    ("radius", lambda a: a * np.float32(3.0), "inside is not white"),
    ("radius", lambda a: a * np.float32(0.0), "radius: is not above 0"),
    ("present", lambda a: np.ones_like(a), "present of strut"),
    ("pixels", lambda a: a + np.float32(0.1), "pixels of strut 0"),
    ("pixel_tangents", lambda a: 2.0 * a, "are not of unit length"),
    ("depth", lambda a: a * np.float32(1.001), "depth in"),
    ("visible", lambda a: np.ones_like(a), "visible"),
    ("points", lambda a: a.astype(np.float64), "points: is float64"),
    ("cameras", lambda a: a[::-1], "cameras: are not those"),
    ("parameters", lambda a: a**2, "parameters are not even"),
]


@pytest.mark.parametrize(("name", "damage", "words"), CURVE_DAMAGES)
def test_damaged_curves_are_found(
    dataset: Path, name: str, damage: Callable[[np.ndarray], np.ndarray], words: str
) -> None:
    folder = sample_folder(dataset, 0)
    with np.load(folder / "curves.npz") as archive:
        arrays = {key: archive[key] for key in archive.files}
    arrays[name] = damage(arrays[name])
    np.savez(folder / "curves.npz", **arrays)
    note_again(dataset)
    problems = validate_sample(folder)
    assert any(words in problem for problem in problems), problems


def test_curves_without_an_array_are_found(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    np.savez(folder / "curves.npz", parameters=np.linspace(0.0, 1.0, 33))
    note_again(dataset)
    assert any("cameras: is missing" in problem for problem in validate_sample(folder))


def test_real_radii_are_used(tmp_path: Path) -> None:
    """A print whose struts are half as thick as planned, and say so in curves.npz, is fine."""
    dataset = make_dataset(tmp_path / "d", samples=[{"seed": 4}], size=(240, 320))
    folder = sample_folder(dataset, 0)
    capture = read_capture(folder)
    assert capture.truth is not None
    radius = capture.truth.radius[:, None] * np.linspace(0.4, 1.3, 9)
    write_true_curves(folder, radius)
    pictures = silhouettes(capture.truth, [view.camera for view in capture.views], thickness=radius)
    note_again(dataset)
    assert any("is not white" in problem for problem in validate_sample(folder))
    for view, picture in zip(capture.views, pictures, strict=True):
        assert cv2.imwrite(str(view.image.path), picture)
    note_again(dataset)
    assert validate_sample(folder) == []


def test_the_content_that_is_noted_must_be_that_of_the_files(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    sample = read_sample(folder)

    def swap(data: dict) -> None:
        data["files"]["frame.json"]["content"] = "0" * 64

    edit_json(folder / "sample.json", swap)
    from frametwin.dataset.hashes import sample_content

    content = sample_content(read_sample(folder).files, sample.specification)
    edit_json(folder / "sample.json", lambda data: data.update(content=content))
    problems = [problem for found in validate_dataset(dataset).findings for problem in found.problems]
    assert any("frame.json holds something else" in problem for problem in problems)
    assert any("not that in dataset.json" in problem for problem in problems)


def test_samples_that_are_absent_or_strange_are_told(dataset: Path) -> None:
    folder = sample_folder(dataset, 3)
    shutil.copytree(sample_folder(dataset, 1), folder)
    write_sample_json(folder, 3, {}, {})
    edit_json(dataset / "dataset.json", lambda data: data.update(count=5))
    found = validate_dataset(dataset)
    assert not found.findings and len(found.problems) == 2
    assert "does not list what is in samples/: 3" in found.problems[0]
    assert "neither there nor noted as failed: 2, 4" in found.problems[1]
    shutil.rmtree(folder)
    assert run_command(validate_command, dataset, "--quiet").exit_code == 1
    assert run_command(validate_command, dataset, "--quiet", "--partial").exit_code == 0


def test_failures_are_told_but_are_not_bad(dataset: Path) -> None:
    def fail(data: dict) -> None:
        data.update(count=3, failed=[{"index": 2, "reason": "Blender crashed"}])

    edit_json(dataset / "dataset.json", fail)
    result = run_command(validate_command, dataset, "--quiet")
    assert result.exit_code == 0 and "Sample 2 could not be made: Blender crashed" in result.stdout


PASS_DAMAGES: list[tuple[Callable[[dict[str, np.ndarray]], None], str | None]] = [
    (lambda channels: None, None),
    (lambda c: c.update({"Depth.Z": c["Depth.Z"] + np.float32(3.0)}), "the depth is that of the strut at only"),
    (lambda c: c.update({"Strut.X": np.roll(c["Strut.X"], 8, axis=1)}), "the strut index is that of the curve at only"),
    (lambda c: c.update({f"Normal.{a}": -c[f"Normal.{a}"] for a in "XYZ"}), "normals face the camera at only"),
    (lambda c: c.update({name: values[::2] for name, values in c.items()}), "pixels as the picture is"),
    (lambda c: c.pop("Depth.Z"), "Depth.Z"),
]


@pytest.mark.parametrize(("damage", "words"), PASS_DAMAGES)
def test_passes_are_compared_with_the_curves(
    dataset: Path, damage: Callable[[dict[str, np.ndarray]], None], words: str | None
) -> None:
    folder = sample_folder(dataset, 0)
    write_passes(folder, damage)
    note_again(dataset)
    problems = validate_sample(folder)
    if words is None:
        assert problems == []
    else:
        assert len(problems) == 4 and all("passes/" in problem and words in problem for problem in problems), problems


def test_every_view_needs_its_passes(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    write_passes(folder)
    (folder / "passes" / f"{image_of(dataset).stem}.exr").unlink()
    note_again(dataset)
    assert validate_sample(folder) == [f"passes/{image_of(dataset).stem}.exr is missing"]
