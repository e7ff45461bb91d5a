"""Pictures as files in memory: what is decoded is what was encoded; other types are refused."""

from __future__ import annotations

import io

import cv2
import numpy as np
import PIL.Image
import pytest

from frametwin.imaging.encoding import jpeg, png_of_16_bits, tiff_of_floats


def test_jpeg_takes_the_channels_of_opencv() -> None:
    picture = np.zeros((16, 24, 3), dtype=np.uint8)
    picture[..., 0] = 250  # blue
    red, _, blue = np.asarray(PIL.Image.open(io.BytesIO(jpeg(picture, 95)))).reshape(-1, 3).mean(axis=0)
    assert blue > 240 and red < 10
    grey = np.tile(np.arange(0, 240, 10, dtype=np.uint8), (16, 1))
    assert np.abs(np.asarray(PIL.Image.open(io.BytesIO(jpeg(grey, 100)))).astype(int) - grey).max() <= 3
    assert len(jpeg(np.random.default_rng(0).integers(0, 255, (64, 64), dtype=np.uint8), 10)) < 2000


def test_whole_numbers_and_depths_keep_every_digit() -> None:
    numbers = np.random.default_rng(1).integers(0, 65536, (7, 9)).astype(np.uint16)
    np.testing.assert_array_equal(np.asarray(PIL.Image.open(io.BytesIO(png_of_16_bits(numbers)))), numbers)
    depth = np.random.default_rng(2).normal(500.0, 100.0, (7, 9)).astype(np.float32)
    depth[2] = np.inf
    np.testing.assert_array_equal(np.asarray(PIL.Image.open(io.BytesIO(tiff_of_floats(depth)))), depth)
    found = cv2.imdecode(np.frombuffer(tiff_of_floats(depth), np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(found, depth)


@pytest.mark.parametrize("picture", [np.zeros((4, 4)), np.zeros((0, 4), np.uint8), np.zeros((4, 4, 2, 3), np.uint8)])
def test_other_arrays_are_refused(picture: np.ndarray) -> None:
    with pytest.raises(ValueError, match="cannot be written as jpg"):
        jpeg(picture, 80)
