"""PNG files decoded with numpy, every filter against its definition, and stripped of their metadata."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest

from frametwin.capture.image_files import SIGNATURE, decode_png, encode_png, strip_png
from frametwin.errors import InputError

COLOURS = {1: 0, 3: 2, 4: 6}


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def filtered(row: np.ndarray, above: np.ndarray, kind: int, channels: int) -> np.ndarray:
    """The definition, byte by byte: PNG specification, section 9.2."""
    out = []
    for i, value in enumerate(row.tolist()):
        a = int(row[i - channels]) if i >= channels else 0
        b = int(above[i])
        c = int(above[i - channels]) if i >= channels else 0
        p = a + b - c
        paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out.append((value - (0, a, b, (a + b) // 2, paeth)[kind]) % 256)
    return np.array(out, dtype=np.uint8)


def encode(image: np.ndarray, filters: np.ndarray, parts: int = 1, extra: bytes = b"") -> bytes:
    height, width = image.shape[:2]
    channels = 1 if image.ndim == 2 else image.shape[2]
    rows = image.reshape(height, -1)
    above = np.zeros(rows.shape[1], dtype=np.uint8)
    body = b""
    for row, kind in zip(rows, filters.tolist(), strict=True):
        body += bytes([kind]) + filtered(row, above, kind, channels).tobytes()
        above = row
    packed = zlib.compress(body)
    cuts = np.linspace(0, len(packed), parts + 1).astype(int)
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, COLOURS[channels], 0, 0, 0))
    data = b"".join(chunk(b"IDAT", packed[a:b]) for a, b in zip(cuts[:-1], cuts[1:], strict=True))
    return SIGNATURE + header + extra + data + chunk(b"IEND", b"")


def pictures() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:23, :31]
    mask = 255 * ((np.hypot(x - 15, y - 11) < 9) ^ (np.abs(x - y) < 3))
    return {
        "mask": mask.astype(np.uint8),
        "grey": rng.integers(0, 256, size=(23, 31), dtype=np.uint8),
        "colour": rng.integers(0, 256, size=(23, 31, 3), dtype=np.uint8),
        "ramp": np.stack([8 * x, 11 * y, 4 * x + 5 * y], axis=-1).astype(np.uint8),
        "transparent": rng.integers(0, 256, size=(9, 7, 4), dtype=np.uint8),
        "one pixel": np.array([[7]], dtype=np.uint8),
    }


@pytest.mark.parametrize("filters", [0, 1, 2, 3, 4, "mixed"])
@pytest.mark.parametrize("name", pictures())
def test_every_filter_is_undone(name: str, filters: int | str) -> None:
    image = pictures()[name]
    rng = np.random.default_rng(4)
    kinds = rng.integers(0, 5, size=len(image)) if filters == "mixed" else np.full(len(image), filters)
    found = decode_png(encode(image, kinds, parts=3))
    assert found.dtype == np.uint8
    np.testing.assert_array_equal(found, image)


@pytest.mark.parametrize("noisy", [False, True])
@pytest.mark.parametrize("name", ["mask", "grey", "colour", "ramp"])
def test_what_the_project_writes_is_read(name: str, noisy: bool) -> None:
    image = pictures()[name]
    np.testing.assert_array_equal(decode_png(encode_png(image, noisy)), image)


def test_metadata_is_stripped_and_the_pixels_are_untouched() -> None:
    image = pictures()["mask"]
    plain = encode(image, np.full(23, 2))
    remarks = chunk(b"tEXt", b"Date\x002026/11/23") + chunk(b"pHYs", struct.pack(">IIB", 1, 1, 0))
    remarks += chunk(b"eXIf", b"anything")
    assert strip_png(encode(image, np.full(23, 2), extra=remarks)) == plain
    assert strip_png(plain) == plain
    assert strip_png(plain + b"behind the end") == plain


def damaged() -> dict[str, tuple[bytes, str]]:
    image = pictures()["grey"]
    good = encode(image, np.full(23, 4))
    flipped = bytearray(good)
    flipped[60] ^= 1
    deep = SIGNATURE + chunk(b"IHDR", struct.pack(">IIBBBBB", 31, 23, 16, 0, 0, 0, 0)) + chunk(b"IEND", b"")
    header = good[8:33]
    short = SIGNATURE + header + chunk(b"IDAT", zlib.compress(b"\0" * 40)) + chunk(b"IEND", b"")
    garbage = SIGNATURE + header + chunk(b"IDAT", b"no zlib") + chunk(b"IEND", b"")
    strange = SIGNATURE + header + chunk(b"IDAT", zlib.compress(b"\7" * 23 * 32)) + chunk(b"IEND", b"")
    return {
        "empty": (b"", "is not a PNG"),
        "text": (b"hello, this is no picture", "is not a PNG"),
        "cut": (good[:100], "cut short"),
        "without an end": (good[:-12], "cut short"),
        "flipped": (bytes(flipped), "wrong checksum"),
        "16 bits": (deep, "no plain PNG"),
        "no header": (SIGNATURE + chunk(b"IEND", b""), "no header"),
        "too few pixels": (short, "pixels are missing"),
        "not packed": (garbage, "cannot be unpacked"),
        "no such filter": (strange, "unknown filter"),
    }


@pytest.mark.parametrize("name", damaged())
def test_damage_is_told_in_words(name: str) -> None:
    data, words = damaged()[name]
    with pytest.raises(InputError, match=rf"views/x\.png: image: .*{words}.*; (copy or )?save "):
        decode_png(data, "views/x.png")
