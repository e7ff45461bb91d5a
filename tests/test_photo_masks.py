"""Masks of photographs against shares known by construction, and what becomes of views that cannot be used."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_tools import done, refused
from photo_cases import DARK, GREY, ORANGE, WHITE, codes, frame_photos, photo_capture, shift_of, strut_photo
from small_frames import tower

from frametwin.capture.capture import read_capture, write_capture
from frametwin.errors import InputError
from frametwin.imaging.coverage import coverage_about
from frametwin.imaging.light import linear_light, spread
from frametwin.imaging.masks import binarise_photo, read_masks
from frametwin.imaging.neighbourhood import Neighbourhood
from frametwin.imaging.photo_masks import nothing_to_see, photo_mask, refined_mask
from frametwin.imaging.photograph import photograph, with_light
from frametwin.imaging.refocus import SHARP, refocused
from frametwin.imaging.view_masks import LEAST_VIEWS, read_view_masks, refine_view_masks, settled_view_masks
from frametwin.raster.silhouette import silhouettes


def test_light_is_linear_where_the_picture_is_not() -> None:
    light = np.linspace(0.0, 1.0, 40)[None, :, None].repeat(3, axis=2)
    np.testing.assert_allclose(linear_light(codes(light, noise=0.0)), light, atol=0.006)


def test_spreading_keeps_what_is_known_and_carries_it_on() -> None:
    known = np.zeros((40, 60), dtype=np.float32)
    known[:, :10] = 1.0
    values = np.where(known > 0.0, 0.25, 99.0).astype(np.float32)
    np.testing.assert_allclose(spread(values, known, (1.0, 4.0)), 0.25, atol=1e-5)
    np.testing.assert_allclose(spread(np.dstack([values] * 3), known, (2.0, 20.0)), 0.25, atol=1e-5)


@pytest.mark.parametrize("exposure", [0.7, 1.0, 1.2])
def test_the_exposure_is_found(exposure: float) -> None:
    strut = strut_photo(exposure=exposure)
    gain = photograph(strut.image, strut.reference, strut.where).gain
    np.testing.assert_allclose(gain, exposure, rtol=0.05)


@pytest.mark.parametrize("material", [WHITE, GREY, DARK, ORANGE], ids=["white", "grey", "dark", "orange"])
@pytest.mark.parametrize("with_reference", [True, False])
def test_struts_of_any_colour_keep_their_width_and_place(material: tuple[float, ...], with_reference: bool) -> None:
    strut = strut_photo(material, exposure=1.1)
    photo = photograph(strut.image, strut.reference if with_reference else None, strut.where)
    refined = refined_mask(photo_mask(photo), strut.coverage).coverage
    assert refined.sum() / strut.coverage.sum() == pytest.approx(1.0, abs=0.06)
    assert abs(shift_of(refined, strut)) < 0.25


def test_the_shaded_side_is_kept_where_the_rule_of_the_paper_loses_it() -> None:
    strut = strut_photo()
    mask = photo_mask(photograph(strut.image, strut.reference, strut.where)).coverage
    paper = binarise_photo(strut.image, strut.reference)
    assert abs(shift_of(mask, strut)) < 0.3 < 1.0 < abs(shift_of(paper, strut))
    assert mask.sum() > 0.9 * strut.coverage.sum()


def test_a_twin_that_is_off_does_not_move_the_mask() -> None:
    strut = strut_photo()
    photo = photograph(strut.image, strut.reference, strut.where)
    moved = np.roll(strut.coverage, 1, axis=1)
    coverage = coverage_about(photo, moved, margin=3.0).share
    assert abs(shift_of(coverage, strut)) < 0.35 < abs(shift_of(moved, strut))


@pytest.mark.parametrize("blur", [1.8, 2.5])
@pytest.mark.parametrize(("off", "width"), [(0, 0.12), (1, 0.3)])
def test_photographs_out_of_focus_keep_the_width_and_place_of_a_strut(blur: float, off: int, width: float) -> None:
    strut = strut_photo(dark_side=0.6, radius=2.5)
    image, reference = (cv2.GaussianBlur(picture, (0, 0), blur) for picture in (strut.image, strut.reference))
    first = photo_mask(photograph(image, reference, strut.where))
    twin = np.roll(strut.coverage, off, axis=1)
    found = refined_mask(refined_mask(first, twin), twin)
    assert found.blur == pytest.approx(blur, rel=0.4)
    assert found.coverage.sum() / strut.coverage.sum() == pytest.approx(1.0, abs=width)
    assert abs(shift_of(found.coverage, strut)) < 0.4


def test_the_softness_of_a_photograph_is_its_blur_beside_the_strut() -> None:
    strut = strut_photo(radius=5.0)
    image, reference = (cv2.GaussianBlur(picture, (0, 0), 2.0) for picture in (strut.image, strut.reference))
    found = refined_mask(photo_mask(photograph(image, reference, strut.where)), strut.coverage)
    assert found.softness == pytest.approx(found.blur / 5.0, rel=0.25) and found.blur > 1.0
    sharp = refined_mask(photo_mask(photograph(strut.image, strut.reference, strut.where)), strut.coverage)
    assert sharp.softness == 0.0


def test_a_photograph_out_of_focus_is_looked_at_about_the_twin_in_the_end(tmp_path: Path) -> None:
    frame = tower().replace(radius=np.full(tower().strut_count, 1.5))
    cameras, images, before = frame_photos(frame, LEAST_VIEWS, size=(240, 320))
    soft = [[cv2.GaussianBlur(picture, (0, 0), 1.8) for picture in pictures] for pictures in (images, before)]
    write_capture(tmp_path, frame, cameras, soft[0], backgrounds=soft[1])
    capture = read_capture(tmp_path)
    masks = read_view_masks(capture)
    once = refine_view_masks(capture, masks, frame)
    settled = settled_view_masks(capture, masks, frame)
    assert all(mask.blur > 1.0 for mask in settled)
    for first, last, again in zip(once, settled, refine_view_masks(capture, once, frame), strict=True):
        np.testing.assert_array_equal(last.coverage, again.coverage)
        assert np.abs(last.coverage - first.coverage).max() > 0.1


def test_sharp_photographs_are_told_from_a_twin_that_lies_beside_the_print() -> None:
    strut = strut_photo()
    mask = photo_mask(photograph(strut.image, strut.reference, strut.where))
    assert refined_mask(mask, np.roll(strut.coverage, 2, axis=1)).blur < 1.0


def test_a_photograph_is_made_as_sharp_as_it_was() -> None:
    """Blurred by a lens and refocused, picture and background differ by noise alone from what they were."""
    strut = strut_photo(radius=4.0)
    sharp = photograph(strut.image, strut.reference, strut.where)
    soft = with_light(
        sharp, *(cv2.GaussianBlur(p, (0, 0), 2.0) for p in (sharp.light, sharp.background)), sharp.variance
    )
    left = cv2.GaussianBlur(sharp.light, (0, 0), SHARP.left)
    again = refocused(soft, 2.0)
    before, after = (float(np.sqrt(((p.light - left) ** 2).mean())) for p in (soft, again))
    assert after < 0.35 * before
    assert float(np.abs(again.light.mean() / sharp.light.mean() - 1.0)) < 0.01


@pytest.mark.parametrize("shadow", [0.15, 0.5, 0.8])
def test_a_shadow_is_no_print(shadow: float) -> None:
    strut = strut_photo(shadow=shadow)
    mask = photo_mask(photograph(strut.image, strut.reference, strut.where)).coverage
    assert mask[:, 74:80].max() < 0.5 < mask[:, 60].min()  # the shadow, the strut


def test_nothing_is_found_where_the_plan_is_not() -> None:
    strut = strut_photo()
    image = strut.image.copy()
    image[:, :15] = 240  # something bright beyond the plan's reach
    mask = photo_mask(photograph(image, strut.reference, strut.where)).coverage
    assert mask[:, :25].max() == 0.0 and mask[:, 60].min() > 0.9


def test_print_like_its_background_is_told_and_not_guessed() -> None:
    strut = strut_photo()
    photo = photograph(strut.reference, strut.reference, strut.where)
    first = photo_mask(photo)
    assert not first.used and "too little" in first.reason
    refined = refined_mask(replace(first, used=True), strut.coverage)
    assert not refined.used and "alike" in refined.reason
    np.testing.assert_allclose(refined.coverage[:, 57:64], strut.coverage[:, 57:64], atol=0.05)


@pytest.mark.parametrize(("level", "word"), [(0, "black"), (255, "white"), (120, "even")])
def test_a_picture_of_nothing_is_named(level: int, word: str) -> None:
    assert word in nothing_to_see(np.full((60, 80, 3), level, dtype=np.uint8))
    assert nothing_to_see(strut_photo().image) == ""


def test_the_plan_is_expected_where_it_projects() -> None:
    frame = tower()
    (camera, *_), _, _ = frame_photos(frame, 2)
    (drawn, *_) = silhouettes(frame, [camera])
    where = Neighbourhood.of(frame, camera)
    assert where.near[drawn > 0].all() and not where.near.all()
    assert where.expected == pytest.approx((drawn > 0).sum(), rel=0.25)


def test_pictures_that_are_masks_stay_as_they_are(tmp_path: Path) -> None:
    frame = tower()
    cameras, _, _ = frame_photos(frame, 2)
    write_capture(tmp_path / "c", frame, cameras, silhouettes(frame, cameras, supersampling=2))
    capture = read_capture(tmp_path / "c")
    for seen, mask in zip(read_view_masks(capture), read_masks(capture), strict=True):
        assert seen.used and seen.method == "mask" and seen.photo is None
        np.testing.assert_array_equal(seen.coverage, mask)


def test_the_rule_of_the_paper_can_be_asked_for(tmp_path: Path) -> None:
    capture = photo_capture(tmp_path / "c", tower(), 2)
    for seen, mask in zip(read_view_masks(capture, "paper"), read_masks(capture), strict=True):
        assert seen.method == "paper"
        np.testing.assert_array_equal(seen.coverage, mask)


def test_photographs_of_a_frame_become_its_silhouettes(tmp_path: Path) -> None:
    frame = tower()
    capture = photo_capture(tmp_path / "c", frame, 2)
    masks = read_view_masks(capture)
    drawn = silhouettes(frame, [view.camera for view in capture.views], supersampling=4)
    for seen in (masks, refine_view_masks(capture, masks, frame)):
        for mask, truth in zip(seen, drawn, strict=True):
            assert mask.used and mask.method == "reference"
            assert np.abs(mask.coverage - truth / 255.0).mean() < 0.012


def test_a_black_picture_is_named_and_the_others_serve(tmp_path: Path) -> None:
    masks = read_view_masks(photo_capture(tmp_path / "c", tower(), LEAST_VIEWS + 1, black=(2,)))
    assert [mask.used for mask in masks] == [i != 2 for i in range(LEAST_VIEWS + 1)]
    assert "black" in masks[2].reason


def test_too_few_views_are_refused(tmp_path: Path) -> None:
    capture = photo_capture(tmp_path / "c", tower(), LEAST_VIEWS, black=(1,))
    with pytest.raises(InputError, match=f"{capture.views[1].image.path.name}.*black"):
        read_view_masks(capture)


def test_what_is_to_be_ignored_tells_nothing(tmp_path: Path) -> None:
    frame = tower()
    capture = photo_capture(tmp_path / "c", frame, 2)
    arm = np.zeros((120, 160), dtype=np.uint8)
    arm[:, 60:90] = 255
    (tmp_path / "arm").mkdir()
    cv2.imwrite(str(tmp_path / "arm" / capture.views[0].image.path.name), arm)
    masks = read_view_masks(capture, ignore=tmp_path / "arm")
    assert masks[1].valid is None and masks[0].valid is not None
    np.testing.assert_array_equal(masks[0].valid == 0.0, arm > 0)
    assert masks[0].coverage[arm > 0].max() == 0.0
    refined = refine_view_masks(capture, masks, frame)[0]
    (drawn,) = silhouettes(frame, [capture.views[0].camera], supersampling=3)
    np.testing.assert_allclose(refined.coverage[arm > 0], drawn[arm > 0] / 255.0, atol=1e-6)
    with pytest.raises(InputError, match="holds no picture"):
        read_view_masks(capture, ignore=tmp_path)


def test_the_page_shows_every_view(tmp_path: Path) -> None:
    photo_capture(tmp_path / "c", tower(), LEAST_VIEWS + 1, black=(2,))
    result = done("mask", tmp_path / "c", "--out", tmp_path / "seen.html", "--json", "--quiet")
    told = json.loads(result.stdout)["views"]
    assert [view["used"] for view in told] == [i != 2 for i in range(LEAST_VIEWS + 1)]
    text = (tmp_path / "seen.html").read_text(encoding="utf-8")
    assert text.count("data:image/jpeg") == len(told) and "black" in text
    assert all(view["image"] in text for view in told)
    done("mask", tmp_path / "c", "--out", tmp_path / "seen.png", "--quiet")
    assert cv2.imread(str(tmp_path / "seen.png")) is not None
    assert "seen.txt" in refused("mask", tmp_path / "c", "--out", tmp_path / "seen.txt", "--quiet")
