"""Calibration boards rendered by Blender: corners where the cameras see them, and the chain from pictures to a rig."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cv2", reason="boards are drawn and found with OpenCV")

from frametwin.blender.rendering.render import render_scene
from frametwin.calibration.boards import parse_board
from frametwin.calibration.detection import Look, find_corners, object_points
from frametwin.calibration.pictures import read_grey
from frametwin.cameras import Camera, look_at
from frametwin.cameras.camera import FISHEYE
from frametwin.capture.board_scene import BoardScene, BoardShot, read_board_scene, write_board_scene
from frametwin.capture.scene import Scene
from frametwin.dataset.calibration_shots import TRUTH_FILE, body_of
from frametwin.dataset.folder import read_dataset
from frametwin.dataset.generate import generate
from frametwin.files import read_json
from frametwin.geometry.wireframe import Wireframe
from scripts.measure_calibration import measure_sample

BOARD, BLOCK = "charuco:7x5:24:18:4X4_250", "cuboid:50x60x70:14:10:4X4_100"
POSE = look_at([120.0, -260.0, 240.0], [0.0, 0.0, 10.0])
PINHOLE = Camera("pinhole", 640, 480, 800.0, 801.0, 321.0, 236.0, POSE)
LENSES = {
    "pinhole": PINHOLE,
    "barrel": replace(PINHOLE, name="barrel", distortion=np.array([-0.25, 0.08, 0.001, -0.0005, 0.0])),
    "fish": replace(PINHOLE, name="fish", distortion=np.array([0.03, -0.01, 0.0, 0.0]), model=FISHEYE),
}


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, BoardScene]:
    folder = tmp_path_factory.mktemp("boards")
    frame = Wireframe.create([[0, 0, 0], [10.0, 0, 0], [0, 0, 20.0]], [[0, 2], [1, 2]], radius=1.0)
    bodies = {"board": body_of(parse_board(BOARD)), "block": body_of(parse_board(BLOCK))}
    shots = tuple(
        BoardShot(f"{body}/{name}.png", body, np.eye(4), camera, 7)
        for name, camera in LENSES.items()
        for body in bodies
    )
    write_board_scene(folder / "boards.json", BoardScene(bodies, shots))
    boards = read_board_scene(folder / "boards.json")
    render_scene(Scene.whole(frame, (PINHOLE.resized(64, 48),), engine="cycles"), folder, boards=boards)
    return folder, boards


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize(("body", "text", "least"), [("board", BOARD, 20), ("block", BLOCK, 12)])
def test_corners_are_where_the_camera_sees_them(
    rendered: tuple[Path, BoardScene], lens: str, body: str, text: str, least: int
) -> None:
    folder, _ = rendered
    board = parse_board(text)
    grey = read_grey(folder / body / f"{lens}.png")
    assert grey.shape == (480, 640)
    numbers, found = find_corners(grey, board, Look())
    assert len(numbers) >= least
    pixels, _ = LENSES[lens].project(object_points(board, numbers, Look()))
    away = np.linalg.norm(found - pixels, axis=1)
    # The board has 50 pixels to a square, the block 30 and less; there is no common shift.
    assert np.median(away) < (0.1 if body == "board" else 0.2)
    assert np.linalg.norm((found - pixels).mean(axis=0)) < 0.06


def test_the_chain_finds_the_cameras(tmp_path: Path) -> None:
    recipe = (Path(__file__).parents[2] / "datasets" / "calibration.toml").read_text(encoding="utf-8")
    for old, new in (
        ("views = 8", "views = 3"),
        ("size = [1200, 1600]", "size = [480, 640]"),
        ("lens_pictures = 16", "lens_pictures = 7"),
        ("moments = 12", "moments = 5"),
        ('style = "photo"', 'style = "mask"'),
    ):
        assert old in recipe
        recipe = recipe.replace(old, new)
    (tmp_path / "small.toml").write_text(recipe, encoding="utf-8")
    made = generate(tmp_path / "small.toml", tmp_path / "out")
    assert made.made == [0]
    folder = read_dataset(tmp_path / "out").samples[0].folder
    truth = read_json(folder / TRUTH_FILE)
    assert len(truth["poses"]) == 3 * (7 + 5 + 1) and not (folder / "boards.json").exists()
    assert sorted(path.name for path in (folder / "calibration").iterdir()) == [
        "block",
        "lenses",
        "moments",
        "truth.json",
    ]
    found = measure_sample(folder, tmp_path / "work", fit=False)
    # Three cameras of 0.3 megapixels and few pictures: some thousandths of the distance.
    assert found["centre_largest_mm"] < 0.004 * found["distance_mm"]
    assert found["direction_largest_deg"] < 0.4
