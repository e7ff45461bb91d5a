"""The verdict on twins whose masks were found in photographs."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

from frametwin.cameras import Camera
from frametwin.cameras.rig_file import DRIFT
from frametwin.capture.capture import read_capture
from frametwin.evaluation.evaluate import evaluate
from frametwin.fitting import api
from frametwin.fitting.camera_freedoms import SHIFT, TURN
from frametwin.fitting.judgement import judged_on_photographs
from frametwin.fitting.photo_fit import OUTLINE_OF_MASKS
from frametwin.formats import read_frame
from frametwin.geometry.rotations import rotation_matrices
from frametwin.twin.verdict import Verdict

PHOTOGRAPHS = Path(__file__).resolve().parents[2] / "shared" / "photographs"
needs_photographs = pytest.mark.skipif(not PHOTOGRAPHS.is_dir(), reason="needs photographs beside the project")


@pytest.mark.parametrize(
    ("loose", "moved", "status"), [(0.03, 0.01, "good"), (0.1, 0.01, "doubtful"), (0.03, 0.05, "doubtful")]
)
def test_a_twin_of_loose_or_unsettled_masks_is_doubtful(loose: float, moved: float, status: str) -> None:
    judged = judged_on_photographs(Verdict("good", ("a view was left out",)), loose, moved)
    assert judged.status == status and "a view was left out" in judged.reasons
    assert all(f"{value:.0%}" in judged.reasons[0] for value in (loose, moved) if value >= 0.05)


@pytest.mark.parametrize(("corrected", "status"), [(1.8, "good"), (3.0, "doubtful")])
def test_a_twin_for_which_most_cameras_had_to_move_is_doubtful(corrected: float, status: str) -> None:
    judged = judged_on_photographs(Verdict(), 0.03, 0.01, corrected)
    assert judged.status == status and (status == "good" or "3.0 standard deviations" in judged.reasons[0])


@pytest.mark.parametrize(("softness", "status"), [(0.15, "good"), (0.31, "doubtful")])
def test_a_twin_of_photographs_far_out_of_focus_is_doubtful(softness: float, status: str) -> None:
    judged = judged_on_photographs(Verdict(), 0.03, 0.01, 0.0, softness)
    assert judged.status == status and (status == "good" or "out of focus by 31%" in judged.reasons[0])


def test_a_graver_verdict_stays() -> None:
    wrong = Verdict("wrong", ("nothing agrees",))
    assert judged_on_photographs(wrong, 1.0, 1.0) is wrong


def test_a_doubt_of_photographs_through_moved_cameras_names_what_would_help() -> None:
    assert "rig.json" in judged_on_photographs(Verdict(), 0.1, 0.0, 0.5).reasons[0]
    assert "rig.json" not in judged_on_photographs(Verdict(), 0.1, 0.0).reasons[0]


@needs_photographs
def test_a_calibrated_rig_is_not_carried_off_by_the_masks_of_photographs() -> None:
    """Cameras that err as their calibration says are corrected by about that, and the twin stays as near as ever."""
    capture = read_capture(PHOTOGRAPHS / "matte")
    draw, known = np.random.default_rng(8), 1.1 * np.diag(DRIFT**2)
    views = [dataclasses.replace(view, camera=_nudged(view.camera, known, draw)) for view in capture.views]
    twin = api.fit_capture(dataclasses.replace(capture, views=views)).twin
    truth = read_frame(PHOTOGRAPHS / "matte" / "truth.json")
    assert evaluate(twin.control_points, twin.vertices, truth).curves.mean < 0.12
    assert twin.verdict.status == "good"


def _nudged(camera: Camera, known: np.ndarray, draw: np.random.Generator) -> Camera:
    """The camera turned and shifted by chance, by about as much as drifts after a calibration."""
    pose = np.array(camera.camera_to_world)
    pose[:3, :3] = pose[:3, :3] @ rotation_matrices(DRIFT[TURN] * draw.normal(size=3))
    pose[:3, 3] += DRIFT[SHIFT] * draw.normal(size=3)
    return dataclasses.replace(camera, camera_to_world=pose, covariance=known)


@needs_photographs
def test_what_a_fit_of_photographs_tells_reaches_its_twin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A view that shows nothing is named, and no strut is called surer than masks of photographs are."""
    monkeypatch.setattr(api, "ROUNDS", 0)
    folder = tmp_path / "capture"
    shutil.copytree(PHOTOGRAPHS / "matte", folder)
    hidden = sorted((folder / "images").iterdir())[2]
    shutil.copyfile(folder / "background" / hidden.name, hidden)
    capture = read_capture(folder)
    twin = api.fit_capture(capture).twin
    unused = [view["name"] for view in twin.views if not view["used"]]
    assert unused == [capture.views[2].camera.name]
    assert any(unused[0] in reason for reason in twin.verdict.reasons)
    nearest = max(view.camera.fl_x / np.linalg.norm(view.camera.centre) for view in capture.views)
    assert twin.sigma_across is not None and twin.sigma_across.min() > 0.5 * OUTLINE_OF_MASKS / nearest
    assert set(twin.provenance["inputs"]) == set(capture.hashes)
