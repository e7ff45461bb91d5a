"""Decoding of pictures: the numbers that were stored, and words for what is damaged."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from frametwin.capture.image_files import encode_png
from frametwin.errors import InputError
from frametwin.imaging.decoding import decoded, eight_bits


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (5, 7, 4)])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_pixels_come_back_as_they_were_stored(shape: tuple[int, ...], kind: type) -> None:
    pixels = np.random.default_rng(2).integers(0, np.iinfo(kind).max, shape, dtype=kind, endpoint=True)
    found = decoded(cv2.imencode(".png", pixels)[1].tobytes(), "a.png")
    assert found.dtype == kind
    np.testing.assert_array_equal(found, pixels)


def test_colours_are_in_opencvs_order() -> None:
    red_green_blue = np.array([[[1, 2, 3]]], dtype=np.uint8)
    assert decoded(encode_png(red_green_blue), "a.png").tolist() == [[[3, 2, 1]]]


def test_sixteen_bits_become_eight() -> None:
    assert eight_bits(np.array([[0, 256, 257, 65534, 65535]], dtype=np.uint16)).tolist() == [[0, 0, 1, 254, 255]]
    plain = np.array([[0, 255]], dtype=np.uint8)
    assert eight_bits(plain) is plain


@pytest.mark.parametrize("data", [b"", b"\x89PNG\r\n\x1a\n", b"GIF89a", b"hello"])
def test_what_is_no_picture_is_told_with_its_remedy(data: bytes) -> None:
    with pytest.raises(InputError, match=r"^a\.png: image: the picture is damaged; make it again\.$"):
        decoded(data, "a.png", "make it again")
