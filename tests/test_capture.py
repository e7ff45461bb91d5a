"""Captures: written whole, read back the same, nerfstudio's habits understood."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import read_capture, write_capture
from frametwin.capture.image_files import encode_png, image_size, write_png
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.masks import read_masks


def picture(camera: Camera, seed: int = 0, colour: bool = False) -> np.ndarray:
    shape = (camera.height, camera.width, 3) if colour else (camera.height, camera.width)
    return np.random.default_rng(seed).integers(0, 255, shape, dtype=np.uint8)


def edit(folder: Path, **changes: Any) -> None:
    file = folder / "transforms.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))


def test_round_trip(tmp_path: Path, curved_frame: Wireframe) -> None:
    cameras = list(ring_rig(curved_frame, 4, size=(60, 80)))
    cameras[2] = ring_rig(curved_frame, 4, size=(90, 70))[2]  # views of different sizes
    lens = np.array([-0.1, 0.02, 1e-3, -2e-3, 1e-3])
    cameras[3] = Camera(
        "wide", 80, 60, 90.0, 91.0, 40.5, 29.25, camera_to_world=cameras[3].camera_to_world, distortion=lens
    )
    images = [picture(camera, i, colour=i == 1) for i, camera in enumerate(cameras)]
    backgrounds = [picture(camera, 10 + i) for i, camera in enumerate(cameras)]
    truth = curved_frame.transformed(np.diag([1.0, 1.0, 0.9, 1.0]))
    folder = tmp_path / "capture"
    write_capture(
        folder,
        curved_frame,
        cameras,
        images,
        truth=truth,
        backgrounds=backgrounds,
        extra={"sag.json": {"seed": 0}},
    )
    assert sorted(os.listdir(folder)) == [
        "background", "frame.json", "images", "sag.json", "transforms.json", "truth.json",
    ]  # fmt: skip

    capture = read_capture(folder)
    assert capture.root == folder
    assert np.array_equal(capture.frame.control_points, curved_frame.control_points)
    assert capture.truth is not None and np.array_equal(capture.truth.vertices, truth.vertices)
    for view, camera, image, before in zip(capture.views, cameras, images, backgrounds, strict=True):
        assert view.image.path.name == f"{camera.name}.png" and view.camera.name == camera.name
        for name in ("width", "height", "fl_x", "fl_y", "cx", "cy"):
            assert getattr(view.camera, name) == getattr(camera, name)
        assert np.array_equal(view.camera.camera_to_world, camera.camera_to_world)
        assert np.array_equal(view.camera.distortion, camera.distortion)
        assert view.background is not None
        for file, written in ((view.image, image), (view.background, before)):
            decoded = cv2.imread(str(file.path), cv2.IMREAD_UNCHANGED)
            assert np.array_equal(decoded if decoded.ndim == 2 else decoded[..., ::-1], written)


def test_camera_names_that_are_no_file_names(tmp_path: Path, straight_frame: Wireframe) -> None:
    cameras = [
        Camera(name, c.width, c.height, c.fl_x, c.fl_y, c.cx, c.cy, c.camera_to_world)
        for name, c in zip(("../up", "a"), ring_rig(straight_frame, 2, size=(60, 80)), strict=True)
    ]
    write_capture(tmp_path / "c", straight_frame, cameras, [picture(camera) for camera in cameras])
    assert [view.camera.name for view in read_capture(tmp_path / "c").views] == ["view_00", "view_01"]


def test_written_whole_or_not_at_all(tmp_path: Path, straight_frame: Wireframe) -> None:
    cameras = ring_rig(straight_frame, 2, size=(60, 80))
    images = [picture(camera) for camera in cameras]
    other = Wireframe.create(straight_frame.vertices, straight_frame.edges[::-1], radius=1.0)
    inside = Camera("inside", 80, 60, 90.0, 90.0, 40.0, 30.0, np.diag([1.0, 1.0, 1.0, 1.0]) + _shift(9, 11, 19))
    bad: list[tuple[str, dict[str, Any]]] = [
        ("images", {"images": images[:1]}),
        ("background", {"backgrounds": images[:1]}),
        ("images of", {"images": [images[0], images[1].T]}),
        ("at least two views", {"cameras": cameras[:1], "images": images[:1]}),
        ("inside the frame", {"cameras": [cameras[0], inside]}),
        ("truth.json", {"truth": other}),
        ("extra", {"extra": {"frame.json": {}}}),
        ("extra", {"extra": {"../a.json": {}}}),
        (
            "printed",
            {"frame": straight_frame.replace(printed=np.zeros(straight_frame.strut_count, dtype=bool))},
        ),
    ]
    for fragment, change in bad:
        arguments = {"frame": straight_frame, "cameras": cameras, "images": images, **change}
        with pytest.raises(InputError, match=fragment):
            write_capture(tmp_path / "c", **arguments)
        assert os.listdir(tmp_path) == []
    with pytest.raises(ValueError):  # a fault in the middle of writing
        write_capture(tmp_path / "c", straight_frame, cameras, [images[0], images[1].astype(float)])
    assert os.listdir(tmp_path) == []
    write_capture(tmp_path / "c", straight_frame, cameras, images)
    with pytest.raises(InputError, match="not empty"):
        write_capture(tmp_path / "c", straight_frame, cameras, images)
    write_capture(tmp_path / "c", straight_frame, cameras, images, overwrite=True)


def _shift(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.zeros((4, 4))
    matrix[:3, 3] = x, y, z
    return matrix


def test_transforms_of_nerfstudio_itself(small_capture: Path) -> None:
    written = read_capture(small_capture)
    file = small_capture / "transforms.json"
    data = json.loads(file.read_text())
    shared = {key: data["frames"][0][key] for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")}
    frames = [
        {"file_path": f["file_path"], "transform_matrix": f["transform_matrix"], "colmap_im_id": i}
        for i, f in enumerate(data["frames"])
    ]
    frames[1]["fl_x"] = 150.0  # the view's own counts
    content = {
        **shared,
        "k1": 0.01,
        "k2": 0.0,
        "camera_model": "OPENCV",
        "ply_file_path": "x.ply",
        "frames": frames,
    }
    file.write_text(json.dumps(content))
    capture = read_capture(small_capture)
    assert [view.camera.fl_x for view in capture.views] == [shared["fl_x"], 150.0, shared["fl_x"]]
    assert capture.views[0].camera.distortion.tolist() == [0.01, 0, 0, 0, 0]
    assert np.array_equal(capture.views[2].camera.camera_to_world, written.views[2].camera.camera_to_world)
    for model in ("PINHOLE", "OPENCV"):
        edit(small_capture, camera_model=model)
        read_capture(small_capture)
    edit(small_capture, camera_model="EQUIRECTANGULAR")
    with pytest.raises(InputError, match="camera_model: 'EQUIRECTANGULAR'"):
        read_capture(small_capture)


def test_pictures_anywhere_in_the_folder(small_capture: Path) -> None:
    data = json.loads((small_capture / "transforms.json").read_text())
    for i, entry in enumerate(data["frames"]):
        folder = small_capture / f"camera{i}"
        folder.mkdir()
        os.rename(small_capture / entry["file_path"], folder / "last.png")
        entry["file_path"] = f"./camera{i}/last.png"
    edit(small_capture, frames=data["frames"])
    assert [view.camera.name for view in read_capture(small_capture).views] == [
        "./camera0/last.png",
        "./camera1/last.png",
        "./camera2/last.png",
    ]


def test_links_within_the_folder_are_fine(small_capture: Path) -> None:
    os.rename(small_capture / "images", small_capture / "pictures")
    os.symlink("pictures", small_capture / "images")
    assert len(read_masks(read_capture(small_capture))) == 3


def test_capture_without_truth(small_capture: Path) -> None:
    (small_capture / "truth.json").unlink()
    assert read_capture(small_capture).truth is None


def test_only_what_is_printed_must_keep_clear_of_cameras(tmp_path: Path, straight_frame: Wireframe) -> None:
    """A camera may stand where the frame is yet to grow."""
    lower = straight_frame.vertices[straight_frame.edges, 2].max(axis=1) <= 20.0
    cameras = list(ring_rig(straight_frame.replace(printed=lower).printed_part()[0], 2, size=(60, 80)))
    pose = np.diag([1.0, -1.0, -1.0, 1.0]) + _shift(10.5, 9.5, 39.0)  # above, looking down
    cameras.append(Camera("above", 80, 60, 50.0, 50.0, 40.0, 30.0, pose))
    images = [picture(camera) for camera in cameras]
    write_capture(tmp_path / "c", straight_frame.replace(printed=lower), cameras, images)
    assert len(read_capture(tmp_path / "c").views) == 3
    with pytest.raises(InputError, match=r"frames\[2\].transform_matrix: the camera stands inside"):
        write_capture(tmp_path / "d", straight_frame, cameras, images)


# --- picture files


@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (5, 7, 3), (40, 33)])
def test_png_encoder_against_opencv(tmp_path: Path, shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).integers(0, 255, shape, dtype=np.uint8, endpoint=True)
    write_png(tmp_path / "a.png", image)
    decoded = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(decoded if decoded.ndim == 2 else decoded[..., ::-1], image)
    assert image_size(tmp_path / "a.png") == (shape[1], shape[0])


@pytest.mark.parametrize("image", [np.zeros((4, 4)), np.zeros((4, 4, 2), np.uint8), np.zeros((0, 4), np.uint8)])
def test_png_encoder_refuses(image: np.ndarray) -> None:
    with pytest.raises(ValueError, match="uint8"):
        encode_png(image)


@pytest.mark.parametrize("kind", ["png", "jpg"])
@pytest.mark.parametrize("progressive", [0, 1])
def test_size_from_the_header(tmp_path: Path, kind: str, progressive: int) -> None:
    image = np.random.default_rng(0).integers(0, 255, (37, 59, 3), dtype=np.uint8)
    path = tmp_path / f"a.{kind}"
    cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive] if kind == "jpg" else [])
    assert image_size(path) == (59, 37)
    data = path.read_bytes()
    for length in range(1, len(data) - 1, max(1, len(data) // 200)):
        path.write_bytes(data[:length])
        with pytest.raises(InputError, match="cut short|damaged"):
            image_size(path)


def test_reading_a_capture_imports_nothing_heavy(small_capture: Path) -> None:
    code = (
        "import sys; from frametwin.capture.capture import read_capture; import frametwin.twin.twin; "
        f"read_capture({str(small_capture)!r}); "
        "heavy = {'cv2', 'scipy', 'torch', 'numba', 'trimesh'} & set(sys.modules); "
        "sys.exit(str(heavy) if heavy else 0)"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[1])}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
