"""The whole chain by the command line: lenses, poses, the robot's world and a capture, against rendered truth."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_pictures import RayField, draw_board
from calibration_scene import AT, BOARD, block_pictures, lens_pictures, moment_pictures, robot_cameras
from cli_tools import done, refused

from frametwin.calibration.boards import parse_board
from frametwin.cameras.rig_file import Rig, RigCamera, read_rig
from frametwin.capture.capture import read_capture
from frametwin.fitting.camera_freedoms import RigErrors
from frametwin.fitting.plate_cameras import through_plate
from frametwin.formats import frame_json
from frametwin.geometry.parametric import named_frame

COUNT = 4
PLATE = "plate:6x5:30:24:APRILTAG_36h11"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[RigCamera]]:
    """The folder with all pictures, and the true cameras."""
    folder = tmp_path_factory.mktemp("cell")
    cameras = robot_cameras(COUNT)
    board = parse_board(BOARD)
    for k, camera in enumerate(cameras):
        lens_pictures(folder / "lenses", camera, board, 8, seed=k)
    moment_pictures(folder / "moments", cameras, board, 6)
    block_pictures(folder / "block", cameras)
    block_pictures(folder / "top", cameras, "checkerboard:5x4:9", (*AT[:2], AT[2] + 70.0, AT[3]))
    block_pictures(folder / "plate", cameras, PLATE)
    return folder, cameras


@pytest.fixture(scope="module")
def placed(cell: tuple[Path, list[RigCamera]]) -> Path:
    """The rig after all steps."""
    folder, _ = cell
    rig = folder / "rig"
    done("calibrate", "intrinsics", folder / "lenses", "--board", BOARD, "--out", rig, "--quiet")
    assert read_rig(rig).world == "none" and not (rig / "transforms.json").exists()
    done("calibrate", "extrinsics", rig, folder / "moments", "--quiet")
    assert read_rig(rig).world == "camera" and (rig / "transforms.json").exists()
    at = ",".join(str(value) for value in AT)
    done("calibrate", "place", rig, folder / "block", "--object", "cuboid:50x60x70:14:10", "--at", at, "--quiet")
    return rig


def errors_of(rig: Rig, cameras: list[RigCamera]) -> tuple[list[float], list[float]]:
    """Distances of the centres in mm and angles between the directions in degrees."""
    places, angles = [], []
    for found, wanted in zip(rig.cameras, cameras, strict=True):
        assert found.camera_to_world is not None and wanted.camera_to_world is not None
        places.append(float(np.linalg.norm(found.centre - wanted.centre)))
        turn = found.camera_to_world[:3, :3].T @ wanted.camera_to_world[:3, :3]
        axis = turn - turn.T
        angles.append(float(np.degrees(np.linalg.norm([axis[2, 1], axis[0, 2], axis[1, 0]]) / 2.0)))
    return places, angles


def test_cameras_are_found_where_they_are(placed: Path, cell: tuple[Path, list[RigCamera]]) -> None:
    rig = read_rig(placed)
    places, angles = errors_of(rig, cell[1])
    assert rig.world == "robot"
    # Four cameras of 0.7 megapixels at 500 mm, eight pictures for each lens: a thousandth of the distance. What a turn
    # of the camera and its principal point have in common is not told apart to better than a pixel, 0.06 degrees.
    assert max(places) < 0.6 and max(angles) < 0.12


def test_the_covariances_hold_the_errors(placed: Path, cell: tuple[Path, list[RigCamera]]) -> None:
    distances = []
    for found, wanted in zip(read_rig(placed).cameras, cell[1], strict=True):
        assert found.covariance is not None
        error = np.concatenate([(found.lens - wanted.lens)[:4], found.centre - wanted.centre])
        index = [0, 1, 2, 3, -3, -2, -1]
        distances.append(float(error @ np.linalg.solve(found.covariance[np.ix_(index, index)], error)))
    # Chi-square with 7 degrees of freedom each, so a mean of 7; twice that is sigmas too small by 1.4.
    assert np.mean(distances) < 14.0


def test_the_paper_s_checkerboard_on_top_tells_the_same_world(placed: Path, cell: tuple[Path, list[RigCamera]]) -> None:
    folder, cameras = cell
    at = ",".join(str(value) for value in (*AT[:2], AT[2] + 70.0, AT[3]))
    rig = folder / "rig_top"
    rig.mkdir()
    for file in placed.iterdir():
        (rig / file.name).write_bytes(file.read_bytes())
    done("calibrate", "place", rig, folder / "top", "--object", "checkerboard:5x4:9", "--at", at, "--quiet")
    places, angles = errors_of(read_rig(rig), cameras)
    assert max(places) < 2.0 and max(angles) < 0.3  # a small flat board tells a world less well


def test_a_plate_tells_the_world_and_every_capture_of_it(
    placed: Path, cell: tuple[Path, list[RigCamera]], tmp_path: Path
) -> None:
    folder, cameras = cell
    rig = tmp_path / "rig"
    shutil.copytree(placed, rig)
    at = ",".join(str(value) for value in AT)
    done("calibrate", "place", rig, folder / "plate", "--object", PLATE, "--at", at, "--quiet")
    places, angles = errors_of(read_rig(rig), cameras)
    assert max(places) < 0.6 and max(angles) < 0.12
    shots = tmp_path / "shots"
    shots.mkdir()
    for camera in cameras:
        shutil.copyfile(folder / "plate" / camera.name / "block.png", shots / f"{camera.name}.png")
    plan = tmp_path / "plan.json"
    frame_json.write(plan, named_frame("lattice_tower"))
    done("capture", rig, shots, "--frame", plan, "--base", at, "--out", tmp_path / "capture", "--quiet")
    capture = read_capture(tmp_path / "capture")
    assert capture.plate is not None
    np.testing.assert_allclose(capture.plate.pose, np.eye(4), atol=1e-9)  # the base is where the plate is
    placed_again = through_plate(capture, RigErrors())
    assert all(found is not None and found.error < 0.5 for found in placed_again.found)
    sigmas = [np.abs(found.freedoms / view.camera.deviations).max()
              for found, view in zip(placed_again.found, capture.views, strict=True)
              if found is not None and view.camera.deviations is not None]  # fmt: skip
    assert len(sigmas) == COUNT and max(sigmas) < 3.0  # the rig knows these cameras as well as it says


def test_a_capture_is_made_of_raw_pictures(placed: Path, cell: tuple[Path, list[RigCamera]], tmp_path: Path) -> None:
    _, cameras = cell
    board = parse_board(BOARD)
    shots = tmp_path / "shots"
    shots.mkdir()
    for camera in cameras[:3]:
        pose = np.eye(4)
        pose[:3, 3] = AT[:3]
        assert cv2.imwrite(str(shots / f"{camera.name}.png"), draw_board(RayField(camera), board, pose))
    plan = tmp_path / "plan.json"
    frame_json.write(plan, named_frame("lattice_tower"))
    base = ",".join(str(value) for value in AT)
    out = tmp_path / "capture"
    result = done("capture", placed, shots, "--frame", plan, "--base", base, "--out", out, "--json")
    assert json.loads(result.stdout)["missing"] == ["cam_3"]
    capture = read_capture(out)
    rig = read_rig(out)
    assert len(capture.views) == 3 and rig.names == ("cam_0", "cam_1", "cam_2")
    pose = np.eye(4)
    angle = np.radians(AT[3])
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    for view, camera in zip(capture.views, cameras[:3], strict=True):
        wanted = pose[:3, :3].T @ (camera.centre - AT[:3])  # in the plan's axes
        assert np.linalg.norm(view.camera.centre - wanted) < 0.6
    assert "cam_0" in refused("capture", placed, tmp_path, "--frame", plan, "--out", tmp_path / "none")


def test_the_page_is_one_file_with_every_camera(placed: Path) -> None:
    text = (placed / "report.html").read_text(encoding="utf-8")
    for word in ("cam_0", "cam_3", "Coverage", "Residuals", "at the print", "px in the middle", "viewBox"):
        assert word in text
    assert "http://" not in text and "https://" not in text and 'src="data:image/png' in text


def test_steps_out_of_order_are_told(cell: tuple[Path, list[RigCamera]], placed: Path, tmp_path: Path) -> None:
    folder, _ = cell
    assert "intrinsics first" in refused("calibrate", "extrinsics", _only(placed, tmp_path / "a"), folder / "moments")
    lenses_only = _only(placed, tmp_path / "b", "sightings_lenses.json")
    place = ("--object", "cuboid", "--at", "0,0,0")
    assert "extrinsics first" in refused("calibrate", "place", lenses_only, folder / "block", *place)
    assert "rig.json" in refused("calibrate", "extrinsics", tmp_path / "none", folder / "moments")
    assert "half a turn" in refused(
        "calibrate", "place", placed, folder / "block", "--object", "checkerboard:5x5:8", "--at", "0,0,0"
    )


def _only(rig: Path, folder: Path, *names: str) -> Path:
    folder.mkdir()
    for name in ("rig.json", *names):
        (folder / name).write_bytes((rig / name).read_bytes())
    return folder
