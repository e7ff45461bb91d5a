"""Pictures of simulated prints by cameras that err as a calibration does, and says, with material at the joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.capture.capture import read_capture
from frametwin.errors import InputError
from frametwin.printing.simulation.outcome import Standing
from frametwin.printing.simulation.simulated_pictures import SimulatedRig, with_blobs
from frametwin.raster.silhouette import silhouettes

RIG = SimulatedRig(views=4, size=(120, 160), turn_error=0.05, shift_error=0.3, blob=2.5)


def test_cameras_are_off_by_what_was_asked_and_the_capture_says_how_well_they_are_known(tmp_path: Path) -> None:
    frame = tower()
    cameras = RIG.cameras(frame)
    told = RIG.told(cameras, 3)
    for real, other in zip(cameras, told, strict=True):
        turn = Rotation.from_matrix(real.camera_to_world[:3, :3].T @ other.camera_to_world[:3, :3]).magnitude()
        assert np.degrees(turn) == pytest.approx(0.05, rel=1e-3)
        assert np.linalg.norm(real.centre - other.centre) == pytest.approx(0.3)
    assert all(
        np.array_equal(a.camera_to_world, b.camera_to_world) for a, b in zip(told, RIG.told(cameras, 3), strict=True)
    )
    assert not np.array_equal(told[0].camera_to_world, RIG.told(cameras, 4)[0].camera_to_world)
    assert SimulatedRig().told(cameras, 3) == cameras
    RIG.take(tmp_path / "capture", Standing(frame, frame), cameras, 0, told=told)
    assert not (tmp_path / "capture" / "frame.json").exists()
    for view, camera in zip(read_capture(tmp_path / "capture", frame).views, told, strict=True):
        np.testing.assert_allclose(view.camera.camera_to_world, camera.camera_to_world, atol=1e-9)
        deviations = view.camera.deviations
        assert (
            deviations is not None and 0.3 / 3**0.5 < deviations[3] < 0.5
        )  # with what a rig is off by until it is used


def test_blobs_are_balls_at_the_joints_and_nothing_else() -> None:
    frame = tower()
    cameras = RIG.cameras(frame)
    for camera, plain, blobbed in zip(
        cameras, silhouettes(frame, cameras), silhouettes(with_blobs(frame, 2.5), cameras), strict=True
    ):
        more = (blobbed > 0) & ~(plain > 0)
        assert more.any() and not ((plain > 0) & ~(blobbed > 0)).any()
        seen, _ = camera.project(frame.vertices)
        rows, columns = np.nonzero(more)
        away = np.linalg.norm(np.column_stack([columns, rows])[:, None] + 0.5 - seen[None], axis=2).min(axis=1)
        depth = frame.vertices @ camera.world_to_camera[2, :3] + camera.world_to_camera[2, 3]
        assert away.max() < 2.5 * frame.radius.max() * camera.fl_x / depth.min() + 1.0


def test_errors_are_of_the_librarys_pictures_only() -> None:
    rig = SimulatedRig(render="mask", blob=1.5)
    with pytest.raises(InputError, match="camera errors and blobs"):
        rig.require(lambda *_: None)
