"""COLMAP's binary models: as COLMAP itself writes them, as a capture, and damaged."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from camera_cases import assert_same

from frametwin.cameras import Camera, read_colmap, read_colmap_binary, write_colmap_text
from frametwin.cameras.colmap_lens import MODELS
from frametwin.capture.capture import Capture, read_capture, write_capture
from frametwin.errors import InputError
from frametwin.formats import find_frame
from frametwin.printing.job.batch_capture import take_capture
from frametwin.printing.job.watch import _look
from frametwin.simulation.simulate import SimulationSettings, simulate

LENSES = {
    "SIMPLE_PINHOLE": [500.5, 320.25, 240.5],
    "PINHOLE": [500.5, 502.0, 320.25, 240.5],
    "SIMPLE_RADIAL": [500.5, 320.25, 240.5, -0.1],
    "RADIAL": [500.5, 320.25, 240.5, -0.1, 0.02],
    "OPENCV": [500.5, 502.0, 320.25, 240.5, -0.1, 0.02, 1e-3, -2e-3],
    "FULL_OPENCV": [500.5, 502.0, 320.25, 240.5, -0.1, 0.02, 1e-3, -2e-3, 0.003, 0.0, 0.0, 0.0],
    "OPENCV_FISHEYE": [500.5, 502.0, 320.25, 240.5, 0.02, -0.004, 0.001, -0.0002],
    "SIMPLE_RADIAL_FISHEYE": [500.5, 320.25, 240.5, 0.02],
    "RADIAL_FISHEYE": [500.5, 320.25, 240.5, 0.02, -0.004],
    "SIMPLE_FISHEYE": [500.5, 320.25, 240.5],
    "FISHEYE": [500.5, 502.0, 320.25, 240.5],
}


def reconstruction(lenses: dict[str, list[float]]) -> Any:
    """A model of COLMAP's own with a picture by each lens, from a turned place, with points in the picture."""
    pycolmap = pytest.importorskip("pycolmap", reason="COLMAP's Python package is not installed")
    model = pycolmap.Reconstruction()
    for i, (lens, values) in enumerate(lenses.items()):
        camera = pycolmap.Camera(model=lens, width=640, height=480, params=values, camera_id=10 + i)
        model.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(name=f"side {i}/{lens}.png", camera_id=10 + i, image_id=3 + i)
        image.points2D = [pycolmap.Point2D(np.array([1.0, 2.0]))] * (i % 3)
        turn = np.array([0.1 * i, -0.5, 0.3, 1.0])
        place = pycolmap.Rigid3d(pycolmap.Rotation3d(turn / np.linalg.norm(turn)), np.array([1.0, -2.0, 300.0 + i]))
        model.add_image_with_trivial_frame(image, place)
    return model


def test_every_lens_that_colmap_writes_projects_as_in_colmap(tmp_path: Path) -> None:
    assert set(LENSES) == set(MODELS)
    model = reconstruction(LENSES)
    model.write_binary(tmp_path)
    cameras = {camera.name: camera for camera in read_colmap_binary(tmp_path)}
    points = np.random.default_rng(0).uniform(-60.0, 60.0, (20, 3))
    for image in model.images.values():
        camera = cameras.pop(image.name)
        wanted = np.array([image.project_point(point) for point in points], dtype=np.float64)
        np.testing.assert_allclose(camera.project(points)[0], wanted, atol=1e-8)
    assert not cameras


def test_text_and_binary_of_one_model_are_the_same_cameras(tmp_path: Path) -> None:
    model = reconstruction(LENSES)
    for kind in ("text", "binary"):
        (tmp_path / kind).mkdir()
        getattr(model, f"write_{kind}")(tmp_path / kind)
        (tmp_path / kind / f"points3D.{'bin' if kind == 'binary' else 'txt'}").unlink()  # is not needed
    texts, binaries = read_colmap(tmp_path / "text"), read_colmap(tmp_path / "binary")
    assert len(texts) == len(LENSES)
    for text, binary in zip(sorted(texts, key=by_name), sorted(binaries, key=by_name), strict=True):
        assert_same(text, binary)


def by_name(camera: Camera) -> str:
    return camera.name


def packed_model(folder: Path, cameras: list[Camera], points: int = 2) -> None:
    """A binary model of perspective cameras by the layout in COLMAP's documentation."""
    lenses, images = [struct.pack("<Q", len(cameras))], [struct.pack("<Q", len(cameras))]
    write_colmap_text(folder / "text", cameras)
    rows = (folder / "text" / "images.txt").read_text().splitlines()[2::2]
    for i, (camera, row) in enumerate(zip(cameras, rows, strict=True), start=1):
        lens = [camera.fl_x, camera.fl_y, camera.cx, camera.cy, *camera.distortion[:4]]
        lenses.append(struct.pack("<IiQQ8d", i, 4, camera.width, camera.height, *lens))
        pose = [float(word) for word in row.split()[1:8]]
        images.append(struct.pack("<I7dI", 40 + i, *pose, i) + camera.name.encode() + b"\0")
        images.append(struct.pack("<Q", points) + struct.pack("<ddQ", 3.5, 4.5, 2**64 - 1) * points)
    for file, parts in (("cameras.bin", lenses), ("images.bin", images)):
        (folder / file).write_bytes(b"".join(parts))


@pytest.fixture(scope="module")
def made() -> Any:
    return simulate(find_frame("bridge"), SimulationSettings(size=(60, 80), views=3))


@pytest.fixture
def capture(made: Any, tmp_path: Path) -> Path:
    """A capture whose cameras are in a COLMAP model in ``sparse/0``."""
    folder = tmp_path / "capture"
    write_capture(folder, made.frame, made.cameras, made.images)
    (folder / "transforms.json").unlink()
    (folder / "sparse" / "0").mkdir(parents=True)
    cameras = [Camera(**{**fields(camera), "name": f"{camera.name}.png"}) for camera in made.cameras]
    packed_model(folder / "sparse" / "0", cameras)
    return folder


def fields(camera: Camera) -> dict[str, Any]:
    keys = ("name", "width", "height", "fl_x", "fl_y", "cx", "cy", "camera_to_world", "distortion", "model")
    return {key: getattr(camera, key) for key in keys}


def assert_is_made(found: Capture, made: Any) -> None:
    for view, camera, image in zip(found.views, made.cameras, made.images, strict=True):
        assert_same(view.camera, camera)
        assert view.image.path.name == f"{camera.name}.png" and view.image.size == image.shape[::-1]


def test_a_capture_with_a_model_in_place_of_transforms(capture: Path, made: Any) -> None:
    found = read_capture(capture)
    assert_is_made(found, made)
    assert set(found.documents) == {"frame.json", "sparse/0/cameras.bin", "sparse/0/images.bin"}


def test_a_print_job_copies_a_model_and_reads_the_copy(capture: Path, made: Any, tmp_path: Path) -> None:
    (tmp_path / "copy").mkdir()
    taken = take_capture(capture, tmp_path / "copy", made.frame)
    assert_is_made(taken.capture, made)
    assert_is_made(read_capture(tmp_path / "copy"), made)


def test_a_watch_waits_for_the_pictures_of_a_model(capture: Path, made: Any) -> None:
    last = capture / "images" / f"{made.cameras[-1].name}.png"
    data = last.read_bytes()
    last.unlink()
    assert _look(capture)[0] == f"images/{last.name}"
    last.write_bytes(data)
    assert _look(capture)[0] == ""
    images = capture / "sparse" / "0" / "images.bin"
    images.write_bytes(images.read_bytes()[:100])
    assert _look(capture)[0] == "a whole COLMAP model"


@pytest.mark.parametrize("place", ["sparse", "."])
def test_other_places_and_text_models(capture: Path, made: Any, place: str) -> None:
    for name in ("cameras.txt", "images.txt"):
        (capture / "sparse" / "0" / "text" / name).rename(capture / place / name)
    for name in ("cameras.bin", "images.bin"):
        (capture / "sparse" / "0" / name).unlink()
    assert_is_made(read_capture(capture), made)


def test_names_below_the_capture_itself(capture: Path, made: Any) -> None:
    """A model that was made with the capture as the folder of pictures."""
    cameras = [Camera(**{**fields(camera), "name": f"images/{camera.name}.png"}) for camera in made.cameras]
    packed_model(capture / "sparse" / "0", cameras)
    assert_is_made(read_capture(capture), made)


def test_a_model_in_metres_is_told(capture: Path, made: Any) -> None:
    poses = [np.array(camera.camera_to_world) for camera in made.cameras]
    for pose in poses:
        pose[:3, 3] /= 1000.0
    cameras = [
        Camera(**{**fields(camera), "name": f"{camera.name}.png", "camera_to_world": pose})
        for camera, pose in zip(made.cameras, poses, strict=True)
    ]
    packed_model(capture / "sparse" / "0", cameras)
    with pytest.raises(InputError, match="in metres; scale the model to mm"):
        read_capture(capture)


@pytest.mark.parametrize("name", ["../a.png", "/etc/passwd", "", "x" * 5000, "no such.png", "a\nb.png"])
def test_names_that_are_no_pictures_of_the_capture(capture: Path, made: Any, name: str) -> None:
    data = (capture / "sparse" / "0" / "images.bin").read_bytes()
    own = f"{made.cameras[0].name}.png".encode()
    (capture / "sparse" / "0" / "images.bin").write_bytes(data.replace(own, name.encode(), 1))
    with pytest.raises(InputError) as refused:
        read_capture(capture)
    assert "\n" not in str(refused.value)


LENS_AT, IMAGE_AT = 8, 8  # where the first record begins


def put(name: str, at: int, layout: str, value: float) -> Callable[[Path], None]:
    def change(model: Path) -> None:
        data = bytearray((model / name).read_bytes())
        struct.pack_into(layout, data, at, value)
        (model / name).write_bytes(bytes(data))

    return change


def cut(name: str, keep: int) -> Callable[[Path], None]:
    return lambda model: (model / name).write_bytes((model / name).read_bytes()[:keep]) and None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("images.bin", 0, "<Q", 2**63), "more than the file can hold"),
        (put("cameras.bin", 0, "<Q", 2**63), "more than the file can hold"),
        (put("images.bin", 0, "<Q", 2), "bytes follow"),
        (put("images.bin", 0, "<Q", 0), "bytes follow"),
        (put("cameras.bin", 0, "<Q", 4), "more than the file can hold|cut short"),
        (put("cameras.bin", LENS_AT + 4, "<i", 99), "99 is not known"),
        (put("cameras.bin", LENS_AT + 4, "<i", -1), "-1 is not known"),
        (put("cameras.bin", LENS_AT + 4, "<i", 7), "FOV is not supported"),
        (put("cameras.bin", LENS_AT + 8, "<Q", 2**63), "width: is too large"),
        (put("cameras.bin", LENS_AT + 8, "<Q", 0), "whole number from 1"),
        (put("cameras.bin", LENS_AT + 24, "<d", np.nan), "fl_x"),
        (put("cameras.bin", LENS_AT + 24, "<d", -1.0), "fl_x"),
        (put("cameras.bin", LENS_AT + 56, "<d", np.inf), "distortion"),
        (put("images.bin", IMAGE_AT + 4, "<d", np.nan), "quaternion"),
        (put("images.bin", IMAGE_AT + 4, "<d", 1e200), "quaternion"),
        (put("images.bin", IMAGE_AT + 36, "<d", np.nan), "TX TY TZ"),
        (put("images.bin", IMAGE_AT + 36, "<d", 1e300), "camera_to_world"),
        (put("images.bin", IMAGE_AT + 60, "<I", 77), "77 is not in cameras.bin"),
        (cut("images.bin", 0), "cut short"),
        (cut("images.bin", 7), "cut short"),
        (cut("cameras.bin", 0), "cut short"),
        (lambda model: (model / "images.bin").unlink(), r"images\.bin"),
    ],
)
def test_damage_ends_in_a_sentence(capture: Path, change: Callable[[Path], None], message: str) -> None:
    model = capture / "sparse" / "0"
    change(model)
    with pytest.raises(InputError, match=message) as refused:
        read_colmap(model)
    assert "\n" not in str(refused.value) and str(model) in str(refused.value)


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin"])
def test_every_cut_of_a_file_is_told(capture: Path, name: str) -> None:
    model = capture / "sparse" / "0"
    whole = (model / name).read_bytes()
    for keep in range(len(whole)):
        (model / name).write_bytes(whole[:keep])
        with pytest.raises(InputError, match=r"cut short|more than the file can hold"):
            read_colmap(model)


def test_any_single_byte_may_be_wrong(capture: Path) -> None:
    """Cameras or a sentence, never anything else."""
    model, rng = capture / "sparse" / "0", np.random.default_rng(5)
    for name in ("cameras.bin", "images.bin"):
        whole = (model / name).read_bytes()
        for at in range(len(whole)):
            data = bytearray(whole)
            data[at] = int(rng.integers(256))
            (model / name).write_bytes(bytes(data))
            try:
                read_colmap(model)
            except InputError as refused:
                assert str(refused)
        (model / name).write_bytes(whole)
