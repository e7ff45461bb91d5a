"""A lens from corners with known noise: recovered, with as many terms as it has, and bad pictures named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from frametwin.calibration.boards import corner_points, parse_board
from frametwin.calibration.detection import Sighting
from frametwin.calibration.intrinsics import Lens, calibrate_lens
from frametwin.calibration.uncertainty import lens_uncertainty, pixel_grid
from frametwin.cameras.lens_models import FISHEYE, PERSPECTIVE, project, rays
from frametwin.dataset.calibration_shots import random_pose
from frametwin.errors import InputError

SIZE = (1280, 960)
BOARD = corner_points(parse_board("charuco:9x7:20"))
NOISE = 0.1
LENSES = {
    PERSPECTIVE: np.array([1100.0, 1101.0, 650.0, 470.0, -0.25, 0.09, 0.0009, -0.0006, 0.0]),
    FISHEYE: np.array([520.0, 520.5, 650.0, 470.0, 0.04, -0.012, 0.003, 0.0]),
}


def sightings(
    model: str, lens: np.ndarray, count: int = 14, tilt: float = 45.0, spread: float = 0.3, seed: int = 1
) -> list[Sighting]:
    """The board at random places of the picture."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        pixel = np.array(SIZE) * (0.5 + rng.uniform(-spread, spread, size=2))
        ray = rays(model, lens, pixel[None])[0]
        pose = random_pose(rng, ray * rng.uniform(300.0, 420.0), -ray, tilt)
        local = BOARD @ pose[:3, :3].T + pose[:3, 3]
        pixels = project(model, lens, local)[0] + NOISE * rng.normal(size=(len(BOARD), 2))
        inside = ((pixels > 0) & (pixels < SIZE)).all(axis=1)
        if inside.sum() > 20:
            whole = Sighting("cam", f"{len(found):02d}", np.arange(len(BOARD)), BOARD, pixels)
            found.append(whole.only(inside))
    return found


def calibrated(model: str, views: Sequence[Sighting]) -> Lens:
    return calibrate_lens("cam", SIZE, views, model)


@pytest.mark.parametrize("model", [PERSPECTIVE, FISHEYE])
def test_the_lens_is_found_as_well_as_it_says(model: str) -> None:
    found = calibrated(model, sightings(model, LENSES[model]))
    sigma = np.sqrt(np.diag(found.camera.covariance))
    off = np.abs(found.camera.lens - LENSES[model])
    assert (off[:4] < 4.0 * sigma[:4]).all() and off[0] < 2e-3 * LENSES[model][0]
    assert not found.left_out
    assert found.camera.residuals["sigma_px"] == pytest.approx(NOISE, rel=0.1)
    # What counts is where things are seen: over the picture, and as well as the uncertainty says.
    grid, _ = pixel_grid(found.camera, 12)
    there = project(model, found.camera.lens, rays(model, LENSES[model], grid))[0] - grid
    turn = there - there.mean(axis=0)  # a turn of the camera moves all of the picture alike, nearly
    assert np.median(np.linalg.norm(turn, axis=1)) < 4.0 * np.median(lens_uncertainty(found.camera, grid)) + 0.1


@pytest.mark.parametrize(
    ("terms", "radial"),
    [({}, 0), ({"k1": -0.2}, 1), ({"k1": -0.3, "k2": 0.2, "p1": 0.004, "p2": -0.003}, 2)],
)
def test_as_many_terms_are_used_as_the_lens_has(terms: dict[str, float], radial: int) -> None:
    keys = ("k1", "k2", "p1", "p2", "k3")
    lens = np.array([1100.0, 1101.0, 650.0, 470.0, *(terms.get(key, 0.0) for key in keys)])
    found = calibrated(PERSPECTIVE, sightings(PERSPECTIVE, lens)).terms
    assert set(terms) <= set(found) and radial <= sum(key.startswith("k") for key in found) <= radial + 1


def test_small_tangential_terms_do_not_turn_the_camera_unnoticed() -> None:
    # Left out, terms as small as these move the principal point by pixels, which no residual and no sigma tells.
    lens = np.array([1100.0, 1100.0, 650.0, 470.0, -0.1, 0.04, 0.0005, -0.0005, 0.0])
    distances = []
    for seed in range(4):
        camera = calibrated(PERSPECTIVE, sightings(PERSPECTIVE, lens, count=8, seed=seed)).camera
        off = (camera.lens - lens)[2:4]
        distances.append(float(off @ np.linalg.solve(camera.covariance[2:4, 2:4], off)))
    assert np.mean(distances) < 5.0  # chi-square with two degrees of freedom each: a mean of 2, of four of them +- 1


def test_a_picture_that_spoils_the_result_is_left_out_by_name() -> None:
    lens = LENSES[PERSPECTIVE]
    views = sightings(PERSPECTIVE, lens)
    clean = calibrated(PERSPECTIVE, views).camera.lens
    bent = views[5].pixels + 1e-4 * (views[5].pixels - views[5].pixels.mean(axis=0)) ** 2
    stray = views[8].pixels.copy()
    stray[3] += 6.0
    views[5], views[8] = replace(views[5], pixels=bent), replace(views[8], pixels=stray)
    found = calibrated(PERSPECTIVE, views)
    reasons = {note.picture: note.reason for note in found.left_out}
    assert set(reasons) == {"05", "08"}
    assert "px where those of the others miss" in reasons["05"] and "1 of its" in reasons["08"]
    assert abs(found.camera.lens[0] - clean[0]) < 1.0


def test_flat_and_similar_poses_are_told() -> None:
    lens = LENSES[PERSPECTIVE]
    flat = " ".join(calibrated(PERSPECTIVE, sightings(PERSPECTIVE, lens, tilt=6.0)).notes)
    assert "too flat" in flat
    good = " ".join(calibrated(PERSPECTIVE, sightings(PERSPECTIVE, lens)).notes)
    assert "too flat" not in good and "too similar" not in good
    base = sightings(PERSPECTIVE, lens, count=3)
    rng = np.random.default_rng(0)
    again = []
    for i in range(9):
        pixels = base[i % 3].pixels
        noisy = pixels + 0.05 * rng.normal(size=pixels.shape)
        again.append(replace(base[i % 3], picture=f"{i:02d}", pixels=noisy))
    assert "too similar: 9 pictures show only 3" in " ".join(calibrated(PERSPECTIVE, again).notes)


def test_too_few_pictures_are_refused() -> None:
    with pytest.raises(InputError, match=r"camera cam: pictures: the board is seen in 2"):
        calibrated(PERSPECTIVE, sightings(PERSPECTIVE, LENSES[PERSPECTIVE], count=2))
    few = calibrated(PERSPECTIVE, sightings(PERSPECTIVE, LENSES[PERSPECTIVE], count=5))
    assert "only 5 pictures" in " ".join(few.notes)
