"""Real photographs: four webcams before an inverted ChArUco board, and OpenCV's own stereo set."""

from __future__ import annotations

import gzip
import json
import tomllib
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from cli_tools import done

from frametwin.cameras.rig_file import read_rig

REAL = Path(__file__).resolve().parents[2] / "shared" / "real" / "charuco_rig"
STEREO = Path("/usr/share/doc/opencv-doc/examples/data")


def test_four_webcams_agree_with_another_calibration(tmp_path: Path) -> None:
    if not REAL.is_dir():
        pytest.skip("the real photographs (../shared/real beside the project) are absent")
    rig = tmp_path / "rig"
    board = "charuco:4x5:54:40.5:4X4_1000"
    result = done("calibrate", "intrinsics", REAL / "images", "--board", board, "--out", rig, "--json")
    told = json.loads(result.stdout)
    assert any("inverted" in note for note in told["notes"])
    done("calibrate", "extrinsics", rig, REAL / "images", "--quiet")
    found = read_rig(rig)
    reference = tomllib.loads((REAL / "reference_camera_array.toml").read_text(encoding="utf-8"))["cameras"]
    centres = []
    for i, camera in enumerate(found.cameras):
        own = reference[str(i)]
        assert camera.lens[0] == pytest.approx(own["matrix"][0][0], rel=0.02)
        centres.append(-1000.0 * np.array(own["rotation"]).T @ np.array(own["translation"]))
    assert any("moved" in note["text"] for note in found.notes)  # the board was held by hand, the cameras ran freely
    for i, j in combinations(range(4), 2):
        distance = np.linalg.norm(found.cameras[i].centre - found.cameras[j].centre)
        # The board moved by millimetres between the pictures of a moment; the reference had four times the frames.
        assert distance == pytest.approx(np.linalg.norm(centres[i] - centres[j]), rel=0.05)


def test_the_stereo_set_of_opencv_has_its_published_focal_length(tmp_path: Path) -> None:
    files = sorted(STEREO.glob("left[01][0-9].jpg*"))
    if len(files) < 13:
        pytest.skip("Debian's opencv-doc, which has the pictures, is not installed")
    folder = tmp_path / "left"
    folder.mkdir()
    for file in files:
        data = file.read_bytes()
        (folder / file.name.removesuffix(".gz")).write_bytes(gzip.decompress(data) if file.suffix == ".gz" else data)
    rig = tmp_path / "rig"
    result = done("calibrate", "intrinsics", folder, "--board", "checkerboard:9x6:25", "--out", rig, "--quiet")
    camera = read_rig(rig).cameras[0]
    assert camera.lens[0] == pytest.approx(535.916, rel=0.005)
    assert camera.residuals["rms_px"] < 0.25
    # A window of the usual size takes in a neighbouring corner there; it is measured in a smaller one, and told.
    assert "left02" in result.stdout
