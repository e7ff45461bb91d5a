"""Files that say which boards are rendered: round trips, damage, and boards as flat pieces."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.calibration.boards import corner_points, parse_board
from frametwin.cameras import Camera, look_at
from frametwin.capture.board_scene import BoardScene, BoardShot, read_board_scene, write_board_scene
from frametwin.dataset.calibration_shots import body_of, calibration_scene
from frametwin.dataset.specification_values import CalibrationValues
from frametwin.errors import InputError
from frametwin.geometry.parametric import named_frame

CAMERA = Camera(
    "left", 640, 480, 800.0, 801.0, 321.0, 236.0, look_at([300.0, 10.0, 200.0], [0.0, 0.0, 30.0]),
    np.array([-0.1, 0.02, 0.001, 0.0, 0.0]),
)  # fmt: skip


def example() -> BoardScene:
    shot = BoardShot("calibration/block/left/block.png", "block", np.eye(4), CAMERA, 5)
    return BoardScene({"block": body_of(parse_board("cuboid:50x60x70:14:10:4X4_100"))}, (shot,))


def test_a_file_is_read_back_bit_by_bit(tmp_path: Path) -> None:
    scene = example()
    write_board_scene(tmp_path / "boards.json", scene)
    found = read_board_scene(tmp_path / "boards.json")
    np.testing.assert_array_equal(found.bodies["block"].white, scene.bodies["block"].white)
    np.testing.assert_array_equal(found.bodies["block"].black, scene.bodies["block"].black)
    (shot,), (wanted,) = found.shots, scene.shots
    assert (shot.file, shot.body, shot.seed, shot.camera.name) == (wanted.file, wanted.body, wanted.seed, "left")
    np.testing.assert_array_equal(shot.camera.camera_to_world, CAMERA.camera_to_world)
    np.testing.assert_array_equal(shot.camera.distortion, CAMERA.distortion)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"file": "../away.png"}, r"shots\[0\].file: '../away.png' is not a file of the sample"),
        ({"file": "/etc/away.png"}, r"shots\[0\].file"),
        ({"body": "ball"}, r"shots\[0\].body: there is no body 'ball'"),
        ({"pose": [[1.0]]}, r"shots\[0\].pose"),
        ({"seed": -1}, r"shots\[0\].seed"),
    ],
)
def test_damage_is_named(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    path = tmp_path / "boards.json"
    write_board_scene(path, example())
    data = json.loads(path.read_text(encoding="utf-8"))
    data["shots"][0] |= change
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(InputError, match=f"boards.json: {words}"):
        read_board_scene(path)


@pytest.mark.parametrize("text", ["charuco:7x5:24:18:4X4_250", "checkerboard:6x5:20", "cuboid:50x60x70:14:10:4X4_100"])
def test_every_corner_is_where_black_pieces_meet(text: str) -> None:
    board = parse_board(text)
    body = body_of(board)
    for corner in corner_points(board):
        away = np.linalg.norm(body.black.reshape(-1, 3) - corner, axis=1)
        assert np.count_nonzero(away < 0.02) == 2  # two squares touch there, a hundredth of a millimetre above
    low, high = body.white.reshape(-1, 3).min(axis=0), body.white.reshape(-1, 3).max(axis=0)
    pieces = body.black.reshape(-1, 3)
    assert (pieces > low - 0.02).all() and (pieces < high + 0.02).all()


def test_the_pictures_of_a_sample_depend_on_its_seed_alone() -> None:
    plan = named_frame("half_bowl")
    values = CalibrationValues(board="charuco:7x5:24:18:4X4_250", block="cuboid", turn_deg=30.0, lens_pictures=4,
                               moments=2, seed=9)  # fmt: skip
    (one, told), (again, _) = (calibration_scene(values, plan, [CAMERA]) for _ in range(2))
    assert len(one.shots) == 4 + 2 + 1 and len({shot.file for shot in one.shots}) == 7
    for first, second in zip(one.shots, again.shots, strict=True):
        np.testing.assert_array_equal(first.pose, second.pose)
    low, high = plan.bounds
    np.testing.assert_allclose(told["at"][:2], 0.5 * (low + high)[:2], atol=0.06)
    assert told["at"][3] == 30.0
    for shot in one.shots[:4]:  # boards before the camera face it, and their middles are in the picture
        towards = CAMERA.centre - shot.pose[:3, 3]
        assert shot.pose[:3, 2] @ towards / np.linalg.norm(towards) > np.cos(np.radians(45.1))
        pixel, _ = CAMERA.project(shot.pose[:3, 3])
        assert (pixel > 0).all() and (pixel < (640, 480)).all()
