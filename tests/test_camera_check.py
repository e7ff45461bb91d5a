"""What a rig knows of its cameras in captures and fits, and which cameras were touched."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_tools import done
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.cameras import Camera
from frametwin.cameras.rig_file import FILE_NAME, Rig, RigCamera, rig_data, write_rig
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import Capture, read_capture, write_capture
from frametwin.errors import InputError
from frametwin.fitting.camera_check import STILL, TOUCHED, check_cameras
from frametwin.raster.silhouette import silhouettes

FRAME = tower(3)


def rig_of(cameras: tuple[Camera, ...], turn: float = 1e-4, shift: float = 0.05) -> Rig:
    deviations = [0.3, 0.3, 0.2, 0.2, *5 * [1e-4], *3 * [turn], *3 * [shift]]
    known = np.diag(np.square(deviations))
    return Rig(tuple(RigCamera.of(camera, known) for camera in cameras), world="robot")


def bumped(camera: Camera, degrees: float) -> Camera:
    pose = np.array(camera.camera_to_world)
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(np.deg2rad([0.0, degrees, 0.0])).as_matrix()
    return replace(camera, camera_to_world=pose)


@pytest.fixture(scope="module")
def cameras() -> tuple[Camera, ...]:
    return ring_rig(FRAME, 7, size=(400, 300))


def taken(folder: Path, told: tuple[Camera, ...], real: tuple[Camera, ...]) -> Capture:
    write_capture(folder, FRAME, told, silhouettes(FRAME, real), extra={FILE_NAME: rig_data(rig_of(told))})
    return read_capture(folder)


def test_a_capture_knows_how_well_its_cameras_are_known(tmp_path: Path, cameras: tuple[Camera, ...]) -> None:
    capture = taken(tmp_path / "capture", cameras, cameras)
    for view, camera in zip(capture.views, rig_of(cameras).cameras, strict=True):
        np.testing.assert_allclose(view.camera.covariance, camera.freedoms_covariance)
        np.testing.assert_allclose(view.camera.without_distortion().covariance, camera.freedoms_covariance)
    assert FILE_NAME in capture.hashes


def test_a_damaged_rig_in_a_capture_is_named(tmp_path: Path, cameras: tuple[Camera, ...]) -> None:
    taken(tmp_path / "capture", cameras, cameras)
    file = tmp_path / "capture" / FILE_NAME
    data = json.loads(file.read_text())
    data["cameras"][2]["covariance"][0][0] = -1.0
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"rig\.json.*cameras\[2\]\.covariance"):
        read_capture(tmp_path / "capture")


def test_the_camera_that_was_touched_is_named(tmp_path: Path, cameras: tuple[Camera, ...]) -> None:
    real = (*cameras[:2], bumped(cameras[2], 1.0), *cameras[3:])
    checks, _ = check_cameras(rig_of(cameras), taken(tmp_path / "capture", cameras, real))
    assert [check.name for check in checks if check.status == TOUCHED] == [cameras[2].name]
    assert sum(check.status == STILL for check in checks) == 6


def test_cameras_that_stand_are_called_still(tmp_path: Path) -> None:
    cameras = ring_rig(FRAME, 6, size=(400, 300))
    taken(tmp_path / "capture", cameras, cameras)
    (tmp_path / "rig").mkdir()
    write_rig(tmp_path / "rig", rig_of(cameras))
    told = json.loads(
        done("calibrate", "check", tmp_path / "rig", tmp_path / "capture", "--strict", "--json", "--quiet").stdout
    )
    assert {camera["status"] for camera in told["cameras"]} == {STILL}


def test_a_capture_of_other_cameras_is_refused(tmp_path: Path, cameras: tuple[Camera, ...]) -> None:
    capture = taken(tmp_path / "capture", cameras, cameras)
    elsewhere = (*cameras[:3], bumped(cameras[3], 0.5), *cameras[4:])
    with pytest.raises(InputError, match=f"{cameras[3].name}.*stands elsewhere"):
        check_cameras(rig_of(elsewhere), capture)
    with pytest.raises(InputError, match=f"{cameras[6].name}.*is no camera of the rig"):
        check_cameras(rig_of(cameras[:6]), capture)
