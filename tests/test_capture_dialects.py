"""``transforms.json`` as the field's tools write it."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.cameras import Camera
from frametwin.capture.capture import Capture, read_capture, write_capture
from frametwin.dataset.exports.sample_folders import arrays_of
from frametwin.dataset.sample_view import _camera
from frametwin.errors import InputError
from frametwin.formats import find_frame
from frametwin.simulation.simulate import SimulationSettings, simulate


@pytest.fixture(scope="module")
def made() -> Any:
    return simulate(find_frame("bridge"), SimulationSettings(size=(60, 80), views=3))


@pytest.fixture
def folder(made: Any, tmp_path: Path) -> Path:
    write_capture(tmp_path / "capture", made.frame, made.cameras, made.images)
    return tmp_path / "capture"


def changed(folder: Path, change: Callable[[dict[str, Any]], None]) -> Capture:
    """The capture read after a change of its ``transforms.json``."""
    file = folder / "transforms.json"
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))
    return read_capture(folder)


def poses(capture: Capture) -> np.ndarray:
    return np.array([view.camera.camera_to_world for view in capture.views])


def test_angle_of_view_alone_and_names_without_suffix(folder: Path) -> None:
    """As in the NeRF-synthetic scenes: the size is that of the pictures."""
    before = read_capture(folder).views[0].camera
    angle = 2.0 * np.arctan(0.5 * before.width / before.fl_x)

    def as_synthetic(data: dict[str, Any]) -> None:
        frames = [
            {"file_path": entry["file_path"].removesuffix(".png"), "transform_matrix": entry["transform_matrix"]}
            for entry in data["frames"]
        ]
        data.clear()
        data.update(camera_angle_x=angle, frames=frames)

    camera = changed(folder, as_synthetic).views[0].camera
    assert (camera.width, camera.height) == (before.width, before.height)
    assert camera.fl_x == pytest.approx(before.fl_x) and camera.fl_y == pytest.approx(before.fl_x)
    assert (camera.cx, camera.cy) == (before.width / 2, before.height / 2)


def test_a_name_without_suffix_that_two_pictures_have_is_told(folder: Path) -> None:
    first = sorted((folder / "images").iterdir())[0]
    first.with_suffix(".jpg").write_bytes(first.read_bytes())

    def without_suffix(data: dict[str, Any]) -> None:
        data["frames"][0]["file_path"] = f"images/{first.stem}"

    with pytest.raises(InputError, match="may be"):
        changed(folder, without_suffix)


@pytest.mark.parametrize("scale", [None, 0.004])
def test_what_a_converter_applied_is_undone(folder: Path, scale: float | None) -> None:
    """nerfstudio's convention: the pose of the file is the applied transform times the original, then scaled."""
    before = poses(read_capture(folder))
    applied = np.array([[0.0, 1.0, 0.0, 30.0], [0.0, 0.0, 1.0, -7.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 0.0, 1.0]])

    def as_converted(data: dict[str, Any]) -> None:
        data["applied_transform"] = applied[:3].tolist()
        if scale is not None:
            data["applied_scale"] = scale
        for entry in data["frames"]:
            pose = applied @ np.array(entry["transform_matrix"])
            pose[:3, 3] *= scale or 1.0
            entry["transform_matrix"] = pose.tolist()

    np.testing.assert_allclose(poses(changed(folder, as_converted)), before, atol=1e-9)


def test_cameras_in_metres_are_told_and_a_unit_is_heeded(folder: Path) -> None:
    before = poses(read_capture(folder))

    def in_metres(data: dict[str, Any]) -> None:
        for entry in data["frames"]:
            for row in entry["transform_matrix"][:3]:
                row[3] /= 1000.0

    with pytest.raises(InputError, match='in metres; write "unit": "m"'):
        changed(folder, in_metres)
    np.testing.assert_allclose(poses(changed(folder, lambda data: data.update(unit="m"))), before, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"unit": "furlong"}, "unit"),
        ({"applied_scale": 0}, "applied_scale"),
        ({"applied_scale": [1]}, "applied_scale"),
        ({"applied_transform": [[1, 0], [0, 1]]}, "applied_transform"),
        ({"applied_transform": [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]]}, "applied_transform"),
    ],
)
def test_what_cannot_be_undone_is_refused(folder: Path, change: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as refused:
        changed(folder, lambda data: data.update(change))
    assert refused.value.field == field


@pytest.mark.parametrize("name", ["images/" + "x" * 5000, "/".join(["y" * 200] * 30), "z" * 300 + ".png"])
def test_endless_file_names_are_refused_in_a_sentence(folder: Path, name: str) -> None:
    def renamed(data: dict[str, Any]) -> None:
        data["frames"][1]["file_path"] = name

    with pytest.raises(InputError, match="too long"):
        changed(folder, renamed)


@pytest.mark.parametrize("value", [1e-320, 1e300, 0, -5, "wide", None, [1]])
def test_absurd_focal_lengths_are_refused_in_a_sentence(folder: Path, value: Any) -> None:
    def refocused(data: dict[str, Any]) -> None:
        data["frames"][0]["fl_x"] = value

    with pytest.raises(InputError, match="fl_x"):
        changed(folder, refocused)


def test_a_size_as_a_decimal_number_is_read(folder: Path) -> None:
    def as_decimals(data: dict[str, Any]) -> None:
        for entry in data["frames"]:
            entry["w"], entry["h"] = float(entry["w"]), float(entry["h"])

    assert changed(folder, as_decimals).views[0].camera.width == 80


def test_damaged_descriptions_end_in_sentences(folder: Path) -> None:
    """Values of every kind in every place of the first view and of what views share."""
    text = (folder / "transforms.json").read_text()
    odd = [None, True, [], {}, "", "nan", 1e308, -1e308, 1e-320, 0, -1, [[1e200] * 4] * 4, "../x", [1, 2, 3], 2**70]
    fields = [*json.loads(text)["frames"][0], "k1", "camera_model", "distortion_params", "camera_angle_x"]
    for field in fields:
        for value in odd:
            data = json.loads(text)
            data["frames"][0][field] = value
            (folder / "transforms.json").write_text(json.dumps(data))
            try:
                read_capture(folder)
            except InputError as refused:
                assert str(refused)


def fisheye(camera: Camera) -> Camera:
    return replace(camera, distortion=np.array([0.02, -0.004, 0.001, -0.0002]), model="OPENCV_FISHEYE")


@pytest.mark.parametrize("every", [True, False])
def test_lens_models_are_told_at_the_top_where_shared_and_for_each_where_not(
    made: Any, tmp_path: Path, every: bool
) -> None:
    cameras = [fisheye(camera) if every or i == 1 else camera for i, camera in enumerate(made.cameras)]
    write_capture(tmp_path / "c", made.frame, cameras, made.images, truth=made.truth)
    data = json.loads((tmp_path / "c" / "transforms.json").read_text())
    assert data["camera_model"] == ("OPENCV_FISHEYE" if every else "OPENCV")
    told = [entry.get("camera_model", data["camera_model"]) for entry in data["frames"]]
    assert told == [camera.model for camera in cameras]
    capture = read_capture(tmp_path / "c")
    for view, camera in zip(capture.views, cameras, strict=True):
        assert view.camera.model == camera.model
        np.testing.assert_array_equal(view.camera.distortion, camera.distortion)
    arrays = arrays_of(capture)
    assert arrays["camera_model"].tolist() == told and arrays["distortion"].shape == (3, 5)
    for row, camera in zip(arrays["distortion"], cameras, strict=True):
        np.testing.assert_array_equal(row, [*camera.distortion, 0.0][:5])


def test_a_models_own_name_for_a_frame_counts_over_the_top(folder: Path) -> None:
    def mixed(data: dict[str, Any]) -> None:
        data["camera_model"] = "OPENCV_FISHEYE"
        data.update(k1=0.02, k4=-0.0003)
        data["frames"][0].update(camera_model="OPENCV", k1=-0.01, k4=0.0)

    views = changed(folder, mixed).views
    assert [view.camera.model for view in views] == ["OPENCV", "OPENCV_FISHEYE", "OPENCV_FISHEYE"]
    np.testing.assert_array_equal(views[0].camera.distortion, [-0.01, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(views[1].camera.distortion, [0.02, 0.0, 0.0, -0.0003])


def test_the_page_of_a_dataset_draws_through_either_lens(made: Any, tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node to run the page's script with")
    first, second, third = made.cameras
    cameras = [first, fisheye(second), replace(third, distortion=np.array([-0.1, 0.02, 1e-3, -2e-3, 1e-3]))]
    write_capture(tmp_path / "c", made.frame, cameras, made.images)
    capture = read_capture(tmp_path / "c")
    page = (Path(__file__).parent.parent / "frametwin" / "dataset" / "page.html").read_text(encoding="utf-8")
    start = page.index("function project(")
    points = made.frame.vertices[:5]
    shown = json.dumps([_camera(view, capture.root) for view in capture.views])
    script = page[start : page.index("\n}\n", start) + 3]
    script += f"const found = {shown}.map(c => {json.dumps(points.tolist())}.map(p => project(c, ...p)));"
    script += "console.log(JSON.stringify(found));"
    done = subprocess.run([node, "-e", script], capture_output=True, text=True, check=True)
    for pixels, camera in zip(json.loads(done.stdout), cameras, strict=True):
        np.testing.assert_allclose(pixels, camera.project(points)[0], atol=1e-9)
