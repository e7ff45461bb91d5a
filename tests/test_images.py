"""From pictures to masks: grey edges kept, photos binarised as in the paper, lens distortion removed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import Capture, read_capture, write_capture
from frametwin.capture.picture import Picture
from frametwin.errors import Cancelled, InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.masks import binarise_photo, read_masks, undistort
from frametwin.progress import Progress

Draw = Callable[[Wireframe, Camera], np.ndarray]


def capture_of(tmp_path: Path, frame: Wireframe, draw: Draw, size: tuple[int, int] = (120, 160)) -> Capture:
    cameras = ring_rig(frame, 2, size=size)
    write_capture(tmp_path / "c", frame, cameras, [draw(frame, camera) for camera in cameras])
    return read_capture(tmp_path / "c")


def first_mask(capture: Capture, image: np.ndarray, background: np.ndarray | None = None) -> np.ndarray:
    """Read the mask of the first view after its picture has been replaced."""
    view = capture.views[0]
    path = view.image.path
    cv2.imwrite(str(path), image)
    view = replace(view, image=Picture.read(path))
    if background is not None:
        before = capture.root / "before.png"
        cv2.imwrite(str(before), background)
        view = replace(view, background=Picture.read(before))
    return read_masks(replace(capture, views=(view,)))[0]


def test_grey_edges_are_kept(tmp_path: Path, straight_frame: Wireframe, draw: Draw) -> None:
    capture = capture_of(tmp_path, straight_frame, draw)
    for mask, view in zip(read_masks(capture), capture.views, strict=True):
        drawn = draw(straight_frame, view.camera)
        assert mask.dtype == np.float32 and len(np.unique(drawn)) > 10
        np.testing.assert_allclose(mask, drawn / 255.0, atol=1e-7)


def test_ways_to_store_one_mask(tmp_path: Path, straight_frame: Wireframe, draw: Draw) -> None:
    capture = capture_of(tmp_path, straight_frame, draw)
    grey = draw(straight_frame, capture.views[0].camera)
    hard = np.where(grey > 127, 255, 0).astype(np.uint8)
    opaque = np.full_like(hard, 255)
    three = np.dstack([hard] * 3)
    for image in (
        hard,
        hard // 255,  # labels 0 and 1
        np.where(hard > 0, 200, 10).astype(np.uint8),
        three,
        np.dstack([three, opaque]),
        np.dstack([np.full_like(three, 255), hard]),  # cut out: the mask is the transparency
        hard.astype(np.uint16) * 257,
    ):
        np.testing.assert_array_equal(first_mask(capture, image), hard / 255.0)
    soft = draw(straight_frame.replace(radius=4.0 * straight_frame.radius), capture.views[0].camera)
    for image in (np.dstack([soft] * 3), soft.astype(np.uint16) * 257):
        np.testing.assert_allclose(first_mask(capture, image), soft / 255.0, atol=1e-7)


def test_jpeg_mask(tmp_path: Path, straight_frame: Wireframe, draw: Draw) -> None:
    capture = capture_of(tmp_path, straight_frame, draw)
    grey = draw(straight_frame, capture.views[0].camera)
    view = capture.views[0]
    view.image.path.write_bytes(cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes())
    view = replace(view, image=Picture.read(view.image.path))
    assert np.abs(read_masks(replace(capture, views=(view,)))[0] - grey / 255.0).mean() < 0.02


def test_binarisation_rules_of_the_paper() -> None:
    pixels = {
        (121, 121, 121): 1.0,
        (120, 255, 255): 0.0,  # not above 120
        (121, 180, 150): 1.0,  # 59 apart
        (121, 181, 150): 0.0,  # 60 apart
        (255, 255, 200): 1.0,
        (10, 10, 10): 0.0,
        (60, 90, 200): 0.0,  # the blue table
    }
    image = np.array([list(pixels)], dtype=np.uint8)
    assert binarise_photo(image)[0].tolist() == list(pixels.values())
    assert binarise_photo(image[..., ::-1])[0].tolist() == list(pixels.values())
    assert binarise_photo(image, threshold=9)[0].tolist() == [1, 0, 0, 0, 0, 1, 0]
    np.testing.assert_array_equal(binarise_photo(image, image), 0.0)
    np.testing.assert_array_equal(binarise_photo(image, np.zeros_like(image)), binarise_photo(image))
    with pytest.raises(ValueError, match="background"):
        binarise_photo(image, image[:, :2])


def test_photo_in_front_of_a_cluttered_background(tmp_path: Path, straight_frame: Wireframe, draw: Draw) -> None:
    """Grey plastic with shading and noise, a blue table, and a bright lamp that was there before."""
    capture = capture_of(tmp_path, straight_frame, draw)
    rng = np.random.default_rng(0)
    struts = draw(straight_frame, capture.views[0].camera) > 127
    background = np.zeros((*struts.shape, 3))
    background[80:] = (160, 70, 40)
    background[5:25, 5:25] = 230.0
    photo = np.where(struts[..., None], rng.uniform(160, 220, struts.shape)[..., None], background)
    photo, background = (
        np.clip(image + rng.normal(scale=4.0, size=image.shape), 0, 255).astype(np.uint8)
        for image in (photo, background)
    )
    assert (first_mask(capture, photo, background) == struts).mean() > 0.999
    without = first_mask(capture, photo)
    assert without[10:20, 10:20].all()  # nobody said that the lamp is no strut
    without[5:25, 5:25] = 0.0
    assert (without == struts).mean() > 0.98
    grey = cv2.cvtColor(photo, cv2.COLOR_BGR2GRAY), cv2.cvtColor(background, cv2.COLOR_BGR2GRAY)
    assert (first_mask(capture, *grey) == struts).mean() > 0.99  # a camera without colour


def test_undistorted_picture_is_that_of_the_pinhole_camera(draw: Draw, curved_frame: Wireframe) -> None:
    """Spots drawn where the distorted camera sees points must come to lie where the pinhole camera does."""
    base = ring_rig(curved_frame, 1, size=(600, 800))[0]
    lens = np.array([-0.25, 0.1, 2e-3, -3e-3, 0.02])
    camera = replace(base, distortion=lens, cx=base.cx + 7.25, cy=base.cy - 4.5)
    pinhole = camera.without_distortion()
    moved = []
    for point in curved_frame.vertices:
        image = np.zeros((camera.height, camera.width), dtype=np.float32)
        pixel, _ = camera.project(point)
        rows, columns = np.mgrid[: camera.height, : camera.width]
        image += np.exp(-((columns + 0.5 - pixel[0]) ** 2 + (rows + 0.5 - pixel[1]) ** 2) / (2 * 2.0**2))
        straight = undistort(image, camera).astype(np.float64)
        found = np.array([(straight * (columns + 0.5)).sum(), (straight * (rows + 0.5)).sum()]) / straight.sum()
        wanted, _ = pinhole.project(point)
        assert np.linalg.norm(found - wanted) < 0.06
        moved.append(np.linalg.norm(wanted - pixel))
    assert max(moved) > 5.0  # half a pixel of confusion would show, and so would no undistortion


def test_masks_of_a_distorted_view_are_undistorted(tmp_path: Path, straight_frame: Wireframe, draw: Draw) -> None:
    cameras = [
        replace(camera, distortion=np.array([-0.2, 0.05, 0.0, 0.0, 0.0]))
        for camera in ring_rig(straight_frame, 2, size=(300, 400))
    ]
    # What the bent camera sees: the pinhole drawing, looked up where each distorted pixel comes from.
    images = []
    for camera in cameras:
        pinhole = camera.without_distortion()
        rows, columns = np.mgrid[:300, :400] + 0.5
        rays = camera.unproject(np.stack([columns, rows], axis=-1), np.ones((300, 400)))
        source = (pinhole.project(rays)[0] - 0.5).astype(np.float32)
        drawn = draw(straight_frame, pinhole)
        images.append(cv2.remap(drawn, source[..., 0], source[..., 1], cv2.INTER_LINEAR))
    write_capture(tmp_path / "c", straight_frame, cameras, images)
    for mask, camera in zip(read_masks(read_capture(tmp_path / "c")), cameras, strict=True):
        drawn = draw(straight_frame, camera.without_distortion()) / 255.0
        difference = np.abs(mask - drawn)
        assert difference.sum() < 0.15 * drawn.sum()  # twice resampled, but in place
        bent = np.abs(mask - images[cameras.index(camera)] / 255.0)
        assert difference.sum() < 0.5 * bent.sum()


def test_progress_and_stopping(small_capture: Path) -> None:
    capture = read_capture(small_capture)
    seen: list[Progress] = []
    read_masks(capture, seen.append)
    assert [(step.iteration, step.total) for step in seen] == [(1, 3), (2, 3), (3, 3)]
    calls: list[Progress] = []

    def stop(progress: Progress) -> bool:
        calls.append(progress)
        return len(calls) < 2

    with pytest.raises(Cancelled):
        read_masks(capture, stop)
    assert len(calls) == 2


def test_what_becomes_of_the_files_after_they_were_read_changes_nothing(small_capture: Path) -> None:
    capture = read_capture(small_capture)
    before = read_masks(capture)
    cv2.imwrite(str(capture.views[1].image.path), np.zeros((10, 10), dtype=np.uint8))
    capture.views[2].image.path.unlink()
    for mask, again in zip(before, read_masks(capture), strict=True):
        np.testing.assert_array_equal(again, mask)


def test_a_picture_of_another_size_than_its_camera_is_refused(small_capture: Path) -> None:
    capture = read_capture(small_capture)
    path = capture.views[1].image.path
    cv2.imwrite(str(path), np.zeros((10, 10), dtype=np.uint8))
    view = replace(capture.views[1], image=Picture.read(path))
    with pytest.raises(InputError, match=r"camera_01.png: size: is 10 x 10 pixels"):
        read_masks(replace(capture, views=(view,)))
