"""``frametwin dataset export``: what other programs read is what the dataset holds; the card is valid."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import mlcroissant
import numpy as np
import pytest
import trimesh
from dataset_cases import edit_json, make_dataset, run_command

from frametwin.cameras import Camera, from_nerfstudio, read_colmap_text, to_nerfstudio
from frametwin.capture.capture import Capture, read_capture
from frametwin.cli import dataset_export
from frametwin.cli.dataset_export import export_command
from frametwin.dataset import export
from frametwin.dataset.croissant import write_croissant
from frametwin.dataset.export import ExportSettings, export_dataset
from frametwin.dataset.folder import read_dataset, sample_folder
from frametwin.errors import Cancelled, InputError
from frametwin.formats import read_frame

LENS = (-0.05, 0.01, 0.001, -0.002, 0.003)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = make_dataset(tmp_path_factory.mktemp("datasets") / "made")
    sample = sample_folder(folder, 1)
    views = []
    for view in read_capture(sample).views:  # with a lens, which every format has to keep
        entry = to_nerfstudio(view.camera, f"images/{view.image.path.name}")
        views.append(entry | dict(zip(("k1", "k2", "p1", "p2", "k3"), LENS, strict=True)))
    edit_json(sample / "transforms.json", lambda data: data.update(frames=views))
    return folder


@pytest.fixture(params=[0, 1])
def index(request: pytest.FixtureRequest) -> int:
    return int(request.param)


def capture_of(dataset: Path, index: int) -> Capture:
    return read_capture(sample_folder(dataset, index))


def assert_same_cameras(found: list[Camera], capture: Capture, scale: float) -> None:
    assert len(found) == len(capture.views)
    for camera, view in zip(found, capture.views, strict=True):
        wanted = view.camera
        assert (camera.width, camera.height) == (wanted.width, wanted.height)
        assert (camera.fl_x, camera.fl_y, camera.cx, camera.cy) == (wanted.fl_x, wanted.fl_y, wanted.cx, wanted.cy)
        np.testing.assert_array_equal(camera.distortion, wanted.distortion)
        np.testing.assert_allclose(camera.centre, scale * wanted.centre, rtol=1e-13, atol=1e-12)
        np.testing.assert_allclose(camera.camera_to_world[:3, :3], wanted.camera_to_world[:3, :3], atol=1e-14)


@pytest.mark.parametrize(("unit", "scale"), [(None, 1e-3), ("mm", 1.0)])
def test_nerfstudio(dataset: Path, tmp_path: Path, index: int, unit: str | None, scale: float) -> None:
    assert export_dataset(dataset, tmp_path / "out", ExportSettings("nerfstudio", unit)) == 2
    place, capture = tmp_path / "out" / f"{index:06d}", capture_of(dataset, index)
    data = json.loads((place / "transforms.json").read_text())
    assert_same_cameras([from_nerfstudio(entry, shared=data) for entry in data["frames"]], capture, scale)
    for entry, view in zip(data["frames"], capture.views, strict=True):
        assert (place / entry["file_path"]).read_bytes() == view.image.data
    cloud = trimesh.load(place / data["ply_file_path"])
    low, high = scale * capture.frame.vertices.min(axis=0), scale * capture.frame.vertices.max(axis=0)
    assert len(cloud.vertices) == 24 * 76
    assert (cloud.vertices >= low - 1e-6).all() and (cloud.vertices <= high + 1e-6).all()


@pytest.mark.parametrize(("unit", "scale"), [(None, 1.0), ("m", 1e-3)])
def test_colmap(dataset: Path, tmp_path: Path, index: int, unit: str | None, scale: float) -> None:
    export_dataset(dataset, tmp_path / "out", ExportSettings("colmap", unit))
    place, capture = tmp_path / "out" / f"{index:06d}", capture_of(dataset, index)
    cameras = read_colmap_text(place / "sparse" / "0")
    assert_same_cameras(cameras, capture, scale)
    for camera, view in zip(cameras, capture.views, strict=True):
        assert (place / "images" / camera.name).read_bytes() == view.image.data
    rows = [line.split() for line in (place / "sparse" / "0" / "points3D.txt").read_text().splitlines()[1:]]
    points = np.array([[float(value) for value in row[1:4]] for row in rows])
    assert {len(row) for row in rows} == {8} and len({row[0] for row in rows}) == len(rows)
    chords = capture.frame.vertices[capture.frame.edges]  # the plan is straight
    first = points[:24] / scale
    assert np.abs(np.cross(first - chords[0, 0], chords[0, 1] - chords[0, 0])).max() < 1e-6


def test_obj(dataset: Path, tmp_path: Path, index: int) -> None:
    export_dataset(dataset, tmp_path / "out", ExportSettings("obj", "m"))
    place, capture = tmp_path / "out" / f"{index:06d}", capture_of(dataset, index)
    assert sorted(path.name for path in place.iterdir()) == ["plan.obj", "truth.obj"]
    plan = read_frame(place / "plan.obj")
    np.testing.assert_allclose(plan.vertices, 1e-3 * capture.frame.vertices, atol=1e-15)
    np.testing.assert_array_equal(plan.edges, capture.frame.edges)
    lines = (place / "truth.obj").read_text().splitlines()
    assert sum(line.startswith("l ") for line in lines) == 76


def test_npz(dataset: Path, tmp_path: Path, index: int) -> None:
    export_dataset(dataset, tmp_path / "out", ExportSettings("npz"))
    capture = capture_of(dataset, index)
    assert capture.truth is not None
    with np.load(tmp_path / "out" / f"{index:06d}" / "sample.npz", allow_pickle=False) as arrays:
        assert arrays["images"].shape == (4, 120, 160) and arrays["images"].dtype == np.uint8
        np.testing.assert_array_equal(arrays["control_points"], capture.frame.control_points)
        np.testing.assert_array_equal(arrays["truth_control_points"], capture.truth.control_points)
        np.testing.assert_array_equal(arrays["edges"], capture.frame.edges)
        assert (arrays["present"][:, 1] < 1.0).sum() + (arrays["present"][:, 0] > 0.0).sum() == (2 if index == 0 else 0)
        for n, view in enumerate(capture.views):
            np.testing.assert_array_equal(arrays["K"][n], view.camera.K)
            np.testing.assert_array_equal(arrays["camera_to_world"][n], view.camera.camera_to_world)
            local = np.linalg.inv(arrays["camera_to_world"][n]) @ np.append(capture.frame.vertices[0], 1.0)
            seen = arrays["K"][n] @ local[:3]
            np.testing.assert_allclose(
                seen[:2] / seen[2], view.camera.project(capture.frame.vertices[0], distort=False)[0], atol=1e-9
            )


def test_links_share_the_file_and_copies_do_not(dataset: Path, tmp_path: Path) -> None:
    image = next((sample_folder(dataset, 0) / "images").iterdir())
    for link in (True, False):
        export_dataset(dataset, tmp_path / str(link), ExportSettings("colmap", link=link))
        exported = tmp_path / str(link) / "000000" / "images" / image.name
        assert os.path.samefile(exported, image) == link and exported.read_bytes() == image.read_bytes()


def test_an_export_is_whole_or_not_at_all(dataset: Path, tmp_path: Path) -> None:
    settings = ExportSettings("npz")
    with pytest.raises(Cancelled):
        export_dataset(dataset, tmp_path / "out", settings, progress=lambda step: step.iteration < 1)
    assert not list(tmp_path.iterdir())
    damaged = shutil.copytree(dataset, tmp_path / "damaged")
    (sample_folder(damaged, 1) / "transforms.json").unlink()
    with pytest.raises(InputError, match=r"transforms\.json"):
        export_dataset(damaged, tmp_path / "out", settings)
    assert not (tmp_path / "out").exists()


def test_the_command(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = run_command(export_command, dataset, "--format", "nerfstudio", "--out", out, "--quiet", "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout) | {"dataset": "", "out": ""} == {
        "dataset": "", "format": "nerfstudio", "out": "", "unit": "m", "samples": 2,
    }  # fmt: skip
    notes = json.loads((out / "export.json").read_text())
    entries = read_dataset(dataset).samples
    assert notes["kind"] == "nerfstudio" and list(notes["samples"].values()) == [entry.content for entry in entries]
    assert run_command(export_command, dataset, "--format", "obj", "--out", out).exit_code == 2
    assert (
        run_command(export_command, dataset, "--format", "obj", "--out", out, "--overwrite", "--quiet").exit_code == 0
    )
    assert (out / "000000" / "plan.obj").is_file() and not (out / "000000" / "images").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("")
    result = run_command(export_command, dataset, "--format", "obj", "--out", tmp_path / "mine", "--overwrite")
    assert result.exit_code == 2 and "something else" in result.stderr
    assert run_command(export_command, dataset, "--format", "obj").exit_code == 2
    assert run_command(export_command, dataset, "--format", "croissant", "--out", out).exit_code == 2


def test_formats_are_those_of_the_library() -> None:
    assert set(dataset_export.FORMATS) == {*export.FORMATS, "croissant"} and dataset_export.MARK == export.MARK
    for settings in ({"format": "gltf"}, {"format": "obj", "unit": "inch"}):
        with pytest.raises(InputError, match="settings"):
            ExportSettings(**settings)


def test_the_card_is_valid_and_gives_the_samples(dataset: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(dataset, tmp_path / "copy")
    assert run_command(export_command, copy, "--format", "croissant").exit_code == 0
    card = mlcroissant.Dataset(jsonld=copy / "croissant.json")
    issues = card.metadata.ctx.issues
    # Neither the day of publication nor how to cite it is known to whoever generates a dataset.
    assert not issues.errors
    assert len(issues.warnings) == 2, issues.warnings
    assert all("citeAs" in text or "datePublished" in text for text in issues.warnings)
    assert card.metadata.name == "small" and "http://mlcommons.org/croissant/1.0" in str(card.metadata.conforms_to)
    records = list(card.records("samples"))
    found = [(record["samples/index"], record["samples/folder"].decode()) for record in records]
    assert found == [(0, "samples/000000"), (1, "samples/000001")]
    assert [record["samples/content"].decode() for record in records] == [
        entry.content for entry in read_dataset(copy).samples
    ]
    sets = {item.id: item for item in card.metadata.file_sets}
    assert set(sets) == {"images", "plans", "truths", "cameras", "curves"}
    assert all(list(copy.glob(item.includes[0])) for item in sets.values())


def test_the_card_goes_with_the_listing(dataset: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(dataset, tmp_path / "copy")
    before = write_croissant(copy).read_text()
    assert write_croissant(copy).read_text() == before
    edit_json(copy / "dataset.json", lambda data: data["samples"].pop())
    assert write_croissant(copy).read_text() != before
    assert len(list(mlcroissant.Dataset(jsonld=copy / "croissant.json").records("samples"))) == 1
