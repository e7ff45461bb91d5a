"""Rig folders read back as written, damage refused in words; lens models against OpenCV and finite differences."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from camera_cases import LENS
from scipy.spatial.transform import Rotation

from frametwin.calibration.uncertainty import point_uncertainty
from frametwin.cameras import Camera, look_at, packed
from frametwin.cameras.lens_models import FISHEYE, LENS_KEYS, PERSPECTIVE, project, rays
from frametwin.cameras.rig_file import DRIFT, Rig, RigCamera, read_rig, write_rig
from frametwin.capture.transforms import read_cameras
from frametwin.errors import InputError
from frametwin.fitting.camera_freedoms import view_motions

LENSES = {
    PERSPECTIVE: np.array([900.0, 910.0, 640.5, 350.0, *LENS]),
    FISHEYE: np.array([420.0, 421.0, 640.5, 350.0, 0.03, -0.01, 0.004, -0.002]),
}


def some_rig(world: str = "robot") -> Rig:
    rng = np.random.default_rng(5)
    cameras = []
    for i, model in enumerate((PERSPECTIVE, FISHEYE, PERSPECTIVE)):
        size = len(LENS_KEYS[model]) + 6 * (world != "none")
        root = rng.normal(size=(size, size))
        pose = look_at(rng.normal(size=3) * 400.0, [0.0, 0.0, 60.0])
        cameras.append(
            RigCamera(
                f"cam_{i}",
                1280,
                720,
                model,
                LENSES[model],
                None if world == "none" else pose,
                root @ root.T,
                {"rms_px": 0.1},
            )
        )
    placed = {"kind": "cuboid", "at": [1.0, 2.0, 3.0, 90.0]}
    notes = ({"step": "place", "text": "a note"},)
    left_out = ({"step": "intrinsics", "camera": "cam_0", "picture": "02", "reason": "blurred"},)
    return Rig(tuple(cameras), world, "charuco:4x5:54", placed, "2026-11-29T10:00:00", notes, left_out)


@pytest.mark.parametrize("world", ["none", "robot"])
def test_a_rig_is_read_as_it_was_written(tmp_path: Path, world: str) -> None:
    rig = some_rig(world)
    write_rig(tmp_path, rig)
    found = read_rig(tmp_path)
    for key in ("world", "board", "placed_by", "date", "notes", "left_out", "names"):
        assert getattr(found, key) == getattr(rig, key)
    for a, b in zip(found.cameras, rig.cameras, strict=True):
        assert (a.width, a.height, a.model, a.residuals) == (b.width, b.height, b.model, b.residuals)
        np.testing.assert_array_equal(a.lens, b.lens)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-15)
        if world != "none":
            np.testing.assert_array_equal(a.camera_to_world, b.camera_to_world)
    assert (tmp_path / "transforms.json").exists() == (world != "none")


def test_other_tools_find_the_same_cameras_in_transforms_json(tmp_path: Path) -> None:
    rig = some_rig()
    rig = replace(rig, cameras=(rig.cameras[0], rig.cameras[2]))
    write_rig(tmp_path, rig)
    for camera, wanted in zip(read_cameras(tmp_path / "transforms.json"), rig.cameras, strict=True):
        assert camera.name == wanted.name
        np.testing.assert_allclose(camera.camera_to_world, wanted.camera_to_world, atol=1e-12)
        np.testing.assert_array_equal(camera.distortion, wanted.lens[4:])


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"format": "frametwin-frame"}, "format"),
        ({"world": "table"}, "world"),
        ({"cameras": []}, "cameras"),
        ({"notes": [1]}, "notes"),
        ({"object": 3}, "object"),
    ],
)
def test_damage_at_the_top_is_named(tmp_path: Path, change: dict[str, object], field: str) -> None:
    write_rig(tmp_path, some_rig())
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=rf"rig\.json: {field}"):
        read_rig(tmp_path)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("name", "a/b"),
        ("name", "cam_1"),
        ("w", 12.5),
        ("fl_x", 1e-320),
        ("model", "FISHEYE62"),
        ("k3", None),
        ("transform_matrix", np.diag([2.0, 1.0, 1.0, 1.0]).tolist()),
        ("covariance", (-np.eye(15)).tolist()),
        ("covariance", np.arange(225.0).reshape(15, 15).tolist()),
        ("covariance_of", ["x"]),
        ("residuals", []),
    ],
)
def test_damage_of_a_camera_is_named(tmp_path: Path, key: str, value: object) -> None:
    write_rig(tmp_path, some_rig())
    path = tmp_path / "rig.json"
    data = json.loads(path.read_text())
    data["cameras"][0][key] = value
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=rf"rig\.json: cameras\[[01]\]\.{key}"):
        read_rig(tmp_path)


def test_the_cameras_of_a_rig_move_with_their_world() -> None:
    rig = some_rig()
    motion = look_at([10.0, 20.0, 30.0], [0.0, 5.0, 1.0])
    moved = rig.moved(motion)
    for a, b in zip(moved.cameras, rig.cameras, strict=True):
        np.testing.assert_allclose(a.centre, motion[:3, :3] @ b.centre + motion[:3, 3], atol=1e-9)
        back = motion[:3, :3].T @ a.covariance[-3:, -3:] @ motion[:3, :3]
        np.testing.assert_allclose(back, b.covariance[-3:, -3:], atol=1e-9)
        np.testing.assert_allclose(a.covariance[:-3, :-3], b.covariance[:-3, :-3], atol=1e-12)


def local_points(model: str) -> np.ndarray:
    rng = np.random.default_rng(3)
    aside = rng.uniform(-0.45, 0.45, size=(200, 2)) * (4.0 if model == FISHEYE else 1.0)
    return np.concatenate([aside, np.ones((200, 1))], axis=1) * rng.uniform(100.0, 900.0, size=(200, 1))


@pytest.mark.parametrize("model", [PERSPECTIVE, FISHEYE])
def test_lens_models_are_opencv_s(model: str) -> None:
    points, lens = local_points(model), LENSES[model]
    matrix = np.array([[lens[0], 0.0, lens[2]], [0.0, lens[1], lens[3]], [0.0, 0.0, 1.0]])
    nothing = np.zeros(3)
    if model == PERSPECTIVE:
        wanted, _ = cv2.projectPoints(points, nothing, nothing, matrix, lens[4:])
    else:
        wanted, _ = cv2.fisheye.projectPoints(points[:, None], nothing, nothing, matrix, lens[4:])
    np.testing.assert_allclose(project(model, lens, points)[0], wanted[:, 0], atol=1e-9)


@pytest.mark.parametrize("model", [PERSPECTIVE, FISHEYE])
def test_lens_derivatives_are_those_of_finite_differences(model: str) -> None:
    points, lens = local_points(model), LENSES[model]
    _, by_point, by_lens = project(model, lens, points)
    for i in range(3):
        step = np.eye(3)[i] * 1e-3
        slope = (project(model, lens, points + step)[0] - project(model, lens, points - step)[0]) / 2e-3
        np.testing.assert_allclose(by_point[..., i], slope, atol=1e-6)
    for i in range(len(lens)):
        size = 1e-5 if i < 4 else 1e-7
        step = np.eye(len(lens))[i] * size
        slope = (project(model, lens + step, points)[0] - project(model, lens - step, points)[0]) / (2.0 * size)
        np.testing.assert_allclose(by_lens[..., i], slope, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("model", [PERSPECTIVE, FISHEYE])
def test_rays_are_the_way_back(model: str) -> None:
    points, lens = local_points(model), LENSES[model]
    wanted = points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(rays(model, lens, project(model, lens, points)[0]), wanted, atol=1e-9)
    np.testing.assert_allclose(rays(model, lens, lens[None, 2:4]), [[0.0, 0.0, 1.0]], atol=1e-12)


def test_a_rig_camera_is_the_camera_of_everything_else() -> None:
    camera = some_rig().cameras[0]
    found = camera.as_camera()
    assert isinstance(found, Camera)
    points = camera.centre + local_points(PERSPECTIVE) @ camera.camera_to_world[:3, :3].T
    np.testing.assert_allclose(
        found.project(points)[0], project(camera.model, camera.lens, local_points(PERSPECTIVE))[0], atol=1e-8
    )
    with pytest.raises(InputError, match="OPENCV_FISHEYE"):
        some_rig().cameras[1].as_camera()


def test_what_is_known_of_a_camera_reaches_the_fit() -> None:
    """Each freedom's own deviation and what is known of several together, in the units of the fit."""
    camera = some_rig().cameras[0]
    assert camera.covariance is not None
    known = camera.as_camera().deviations
    assert known is not None
    spread = dict(zip(camera.keys, np.sqrt(np.diag(camera.covariance)), strict=True))
    names = ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")
    np.testing.assert_allclose(known[:6], np.hypot([spread[name] for name in names], DRIFT[:6]))
    np.testing.assert_allclose(known[7:], np.hypot([spread["cx"], spread["cy"], spread["k1"]], DRIFT[7:]))
    focal = camera.covariance[:2, :2] / np.outer(camera.lens[:2], camera.lens[:2])
    assert known[6] == pytest.approx(np.sqrt(focal.mean() + DRIFT[6] ** 2))
    assert some_rig("none").cameras[0].freedoms_covariance is None
    half = camera.as_camera().resized(640, 360)
    np.testing.assert_allclose(half.deviations, known * [*7 * [1.0], 0.5, 0.5, 1.0])


def test_what_a_rig_knows_of_freedoms_together_is_that_of_the_points_it_sees() -> None:
    """The spread in pixels by the fit's freedoms is that by the calibration's parameters, whatever their signs are."""
    camera = some_rig().cameras[0]
    assert camera.camera_to_world is not None and camera.covariance is not None
    chosen = [0, 1, 2, 3, 4, *range(9, 15)]  # what the fit's freedoms do not have is taken as known
    mixed = np.random.default_rng(2).normal(size=(11, 11)) * [3e-1, 3e-1, 1.0, 1.0, 1e-3, *3 * [1e-3], *3 * [0.5]]
    mixed[:, 1] = mixed[:, 0] * camera.lens[1] / camera.lens[0]  # one focal length for both directions
    spread = np.zeros((15, 15))
    spread[np.ix_(chosen, chosen)] = mixed.T @ mixed
    camera = replace(camera, lens=np.array([*camera.lens[:4], *5 * [0.0]]), covariance=spread)
    local = np.random.default_rng(3).uniform([-60.0, -60.0, 440.0], [60.0, 60.0, 560.0], size=(20, 3))
    points = local @ camera.camera_to_world[:3, :3].T + camera.centre
    by_calibration = point_uncertainty(camera, points)
    seen = camera.as_camera()
    motion = view_motions(points, packed([seen])[0], 1.0)
    by_world = projection_slopes(seen, points)
    by_freedom = np.einsum("nij,njf->nif", by_world, motion)
    assert seen.covariance is not None
    total = by_freedom @ (seen.covariance - np.diag(DRIFT**2)) @ by_freedom.transpose(0, 2, 1)
    np.testing.assert_allclose(np.sqrt(np.linalg.eigvalsh(total)[:, -1]), by_calibration, rtol=1e-4)


def projection_slopes(camera: Camera, points: np.ndarray, step: float = 1e-3) -> np.ndarray:
    """(N, 2, 3) derivatives of where points are seen, by differences."""
    moved = [np.stack([camera.project(points + side * step * axis)[0] for side in (1, -1)]) for axis in np.eye(3)]
    return np.stack([(ahead - behind) / (2.0 * step) for ahead, behind in moved], axis=-1)


@pytest.mark.parametrize("world", ["none", "robot"])
def test_a_fisheye_becomes_a_perspective_camera_known_as_well_as_before(world: str) -> None:
    perspective, fisheye, _ = some_rig(world).cameras
    assert perspective.straightened() is perspective
    straight = fisheye.straightened()
    assert (straight.model, straight.name, len(straight.lens)) == (PERSPECTIVE, "cam_1", 9)
    assert straight.lens[:4].tolist() == fisheye.lens[:4].tolist() and not straight.lens[4:].any()
    assert straight.covariance is not None and fisheye.covariance is not None
    assert straight.covariance.shape == (len(straight.keys),) * 2
    for i, row in enumerate(straight.keys):
        for j, column in enumerate(straight.keys):
            bends = {row, column} & set(LENS_KEYS[PERSPECTIVE][4:])
            wanted = 0.0 if bends else fisheye.covariance[fisheye.keys.index(row), fisheye.keys.index(column)]
            assert straight.covariance[i, j] == wanted


def test_a_rig_in_the_axes_of_a_plan_needs_the_robots_world() -> None:
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = Rotation.from_euler("z", 30.0, degrees=True).as_matrix(), [400.0, 0.0, 20.0]
    rig = some_rig()
    assert rig.in_plan() is rig
    for inside, camera in zip(rig.in_plan(base).cameras, rig.cameras, strict=True):
        np.testing.assert_allclose(base @ inside.camera_to_world, camera.camera_to_world, atol=1e-9)
    with pytest.raises(InputError, match=r"rig\.json.*world.*frametwin calibrate place"):
        replace(rig, world="camera").in_plan()
