"""Lenses, errors of cameras and looks that recipes draw: what is drawn is told, and what is told is so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import read_capture, write_capture
from frametwin.capture.scene import PhotoLook
from frametwin.dataset.camera_errors import with_true_cameras
from frametwin.dataset.contrast_checks import contrast_problems, is_hard, is_indistinct
from frametwin.dataset.folder import read_dataset, read_sample
from frametwin.dataset.generate import generate
from frametwin.dataset.recipe import read_recipe
from frametwin.dataset.sample_arrays import sample_arrays
from frametwin.dataset.specification import Sampler
from frametwin.dataset.validate import validate_dataset
from frametwin.geometry.parametric import named_frame
from frametwin.raster.silhouette import silhouettes

HEAD = """
format = "frametwin-recipe"
version = 1
name = "varied"
count = 3
[[frames]]
frame = "bridge"
[rig]
views = 4
size = [240, 320]
"""
LENS = '[rig.lens]\nmodel = "OPENCV"\nk1 = [-0.2, -0.05]\nk2 = 0.02\np1 = [-0.001, 0.001]\n'
ERRORS = (
    "[errors]\nturned_deg = [0.2, 0.4]\nmoved_mm = 1.5\nfocal = 0.01\ncentre_px = 3\nlens_ignored = true\n"
    "bumped = 1\nbumped_deg = 2\n"
)
LOOK = """
[render]
style = "photo"
[render.look]
plastics = ["orange", "dark", "natural"]
tables = ["wood", "grey"]
strut_roughness = [0.2, 0.9]
clutter = [2, 5]
light_side = [0.1, 2.0]
exposure_spread = 0.3
reference_exposure = [-0.5, 0.5]
reference_turn = [0, 20]
defocus = [0, 1.5]
vignetting = [0, 0.4]
"""


def recipe_in(folder: Path, *tables: str) -> Path:
    path = folder / "varied.toml"
    path.write_text(HEAD + "".join(tables), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("varied")
    made = generate(recipe_in(folder, LENS, ERRORS, '[render]\nstyle = "silhouette"\n'), folder / "out")
    assert len(made.made) == 3 and not made.failed
    return folder / "out"


def angle_between(one: Camera, other: Camera) -> float:
    turn = one.camera_to_world[:3, :3].T @ other.camera_to_world[:3, :3]
    return float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(turn) - 1.0), -1.0, 1.0))))


def test_stated_cameras_are_off_by_what_the_sample_tells(dataset: Path) -> None:
    for entry in read_dataset(dataset).samples:
        told = read_sample(entry.folder).specification
        errors, lens = told["errors"], told["rig"]["lens"]
        capture = read_capture(entry.folder)
        stated = [view.camera for view in capture.views]
        true = [view.camera for view in with_true_cameras(capture).views]
        assert 0.2 <= errors["turned_deg"] <= 0.4 and len(errors["bumped"]) == 1
        for i, (wrong, right) in enumerate(zip(stated, true, strict=True)):
            assert np.linalg.norm(wrong.centre - right.centre) == pytest.approx(1.5, abs=1e-6)
            assert abs(wrong.fl_x / right.fl_x - 1.0) == pytest.approx(0.01, abs=1e-9)
            assert np.hypot(wrong.cx - right.cx, wrong.cy - right.cy) == pytest.approx(3.0, abs=1e-6)
            assert not wrong.has_distortion
            np.testing.assert_allclose(right.distortion, lens["coefficients"][i])
            turned = angle_between(wrong, right)
            if i in errors["bumped"]:
                assert 1.5 < turned < 2.5
            else:
                assert turned == pytest.approx(errors["turned_deg"], abs=1e-4)


def test_pictures_and_curves_are_those_of_the_true_cameras(dataset: Path) -> None:
    assert validate_dataset(dataset).fine
    folder = read_dataset(dataset).samples[0].folder
    arrays = sample_arrays(read_capture(folder), ["visibility", "curves"])
    for i, view in enumerate(with_true_cameras(read_capture(folder)).views):
        pixels, _ = view.camera.project(arrays["points"])
        np.testing.assert_allclose(arrays["pixels"][i], pixels, atol=0.01)
    for i, view in enumerate(read_capture(folder).views):
        pixels, _ = view.camera.project(arrays["points"])
        assert np.linalg.norm(pixels - arrays["pixels"][i], axis=-1).mean() > 1.0


def test_a_run_goes_on_where_it_stopped(dataset: Path) -> None:
    again = generate(dataset.parent / "varied.toml", dataset)
    assert again.kept == [0, 1, 2] and not again.made


def test_datasets_of_before_can_be_gone_on_with(dataset: Path, tmp_path: Path) -> None:
    recipe = recipe_in(tmp_path, '[render]\nstyle = "silhouette"\n')
    generate(recipe, tmp_path / "out")
    listing = tmp_path / "out" / "dataset.json"
    data = json.loads(listing.read_text(encoding="utf-8"))
    # As written before there were lenses, errors and calibration.
    for name in ("errors", "calibration"):
        assert data["recipe"].pop(name) is None
    assert data["recipe"]["rig"].pop("lens") is None
    listing.write_text(json.dumps(data), encoding="utf-8")
    assert generate(recipe, tmp_path / "out").kept == [0, 1, 2]
    told = read_sample(read_dataset(tmp_path / "out").samples[0].folder).specification
    assert "errors" not in told and "calibration" not in told and "lens" not in told["rig"]


def test_looks_are_drawn_and_are_looks(tmp_path: Path) -> None:
    sampler = Sampler(read_recipe(recipe_in(tmp_path, LOOK)))
    looks = [PhotoLook(**sampler.specification(index).render.look) for index in range(30)]
    assert looks[3] == PhotoLook(**Sampler(sampler.source).specification(3).render.look)
    assert len({look.strut_colour for look in looks}) > 3  # two colours, and natural ones of many greys
    assert {look.table_colour for look in looks} == {(0.30, 0.16, 0.07), (0.18, 0.18, 0.18)}
    assert {len(look.clutter) for look in looks} == {2, 3, 4, 5}
    assert all(len(look.view_exposures) == 4 for look in looks)
    spread = np.std([stops for look in looks for stops in look.view_exposures])
    assert 0.22 < spread < 0.38
    for name, low, high in (("strut_roughness", 0.2, 0.9), ("light_side", 0.1, 2.0), ("defocus", 0.0, 1.5)):
        values = [getattr(look, name) for look in looks]
        assert low <= min(values) < low + 0.25 * (high - low) and high >= max(values) > high - 0.25 * (high - low)
    # Things stand beside the print, whose farthest corner is half a size from the middle.
    for look in looks:
        for _, x, y, width, *_ in look.clutter:
            assert np.hypot(x, y) - np.sqrt(0.5) * width > 0.5


def test_other_looks_show_the_same_prints(tmp_path: Path) -> None:
    plain, varied = (Sampler(read_recipe(recipe_in(tmp_path, text))) for text in ("", LENS + ERRORS + LOOK))
    for index in range(3):
        one, other = plain.specification(index), varied.specification(index)
        assert (one.frame, one.deformation, one.printing) == (other.frame, other.deformation, other.printing)
        assert one.rig.seed == other.rig.seed


@pytest.mark.parametrize(("shift", "fine"), [(0, True), (25, False)])
def test_coloured_prints_are_compared_by_contrast(shift: int, fine: bool, tmp_path: Path) -> None:
    frame = named_frame("bridge")
    cameras = ring_rig(frame, 2, size=(240, 320))
    exact = silhouettes(frame, cameras)
    rng = np.random.default_rng(2)
    pictures = {}
    for kind, exposure in (("images", 0.8), ("background", 1.0)):
        pictures[kind] = []
        for mask in exact:
            table = np.linspace(20.0, 90.0, 320)[None, :, None] * (0.9, 0.6, 0.4)
            share = np.roll(mask, shift, axis=1)[..., None] / (255.0 if kind == "images" else np.inf)
            picture = exposure * (table * (1.0 - share) + share * np.array([10.0, 95.0, 40.0]))
            pictures[kind].append(np.clip(picture + rng.normal(0.0, 2.0, picture.shape), 0, 255).astype(np.uint8))
    folder = tmp_path / "capture"
    write_capture(folder, frame, cameras, pictures["images"], backgrounds=pictures["background"])
    for view, mask in zip(read_capture(folder).views, exact, strict=True):
        assert (contrast_problems(view, mask) == []) == fine


def test_what_the_papers_rule_is_made_for_is_no_hard_look() -> None:
    natural = {"strut_colour": [0.78, 0.78, 0.76], "table_colour": [0.006, 0.035, 0.2], "view_exposures": []}
    assert not is_hard(natural) and not is_hard({})
    assert is_hard({**natural, "strut_colour": [0.7, 0.2, 0.03]}) and is_hard({**natural, "reference_turn": 3.0})
    assert is_indistinct({"strut_colour": [0.012, 0.012, 0.013], "table_colour": [0.01, 0.01, 0.01]})
    assert not is_indistinct(natural)
