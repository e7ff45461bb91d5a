"""PNG files as Blender writes them: decoding with numpy alone, and the same picture without its metadata.

Reference: Portable Network Graphics (PNG) Specification, third edition, W3C, 2025 (chunks: section 5; filters: 9).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike

SIGNATURE = b"\x89PNG\r\n\x1a\n"
PICTURE_CHUNKS = (b"IHDR", b"PLTE", b"IDAT", b"IEND")
CHANNELS = {0: 1, 2: 3, 6: 4}
"""Channels of the colour types that are read: grey, RGB and RGBA."""

NONE, SUB, UP, AVERAGE, PAETH = range(5)
_REMEDY = "save the picture again, as PNG"


def strip_png(data: bytes, path: PathLike = "picture") -> bytes:
    """The same picture without date, program and other remarks: its pixels are not encoded anew.

    Parameters
    ----------
    data
        The bytes of a PNG file.
    path
        What to call it in messages.

    Raises
    ------
    InputError
        If it is no PNG, cut short or damaged.
    """
    kept = [chunk for kind, chunk in _chunks(data, path) if kind in PICTURE_CHUNKS]
    return SIGNATURE + b"".join(bytes(chunk) for chunk in kept)


def decode_png(data: bytes, path: PathLike = "picture") -> np.ndarray:
    """Pixels of a PNG with 8 bits a channel, grey, RGB or RGBA, not interlaced.

    Parameters
    ----------
    data
        The bytes of the file.
    path
        What to call it in messages.

    Returns
    -------
    (H, W), (H, W, 3) or (H, W, 4) uint8.

    Raises
    ------
    InputError
        If it is no PNG, cut short or damaged, or of a kind that is not read.
    """
    chunks = list(_chunks(data, path))
    if chunks[0][0] != b"IHDR" or len(chunks[0][1]) != 25:
        raise InputError.at(path, "image", "the picture is damaged (no header)", _REMEDY)
    width, height, depth, colour, _, _, interlaced = struct.unpack_from(">IIBBBBB", chunks[0][1], 8)
    if depth != 8 or colour not in CHANNELS or interlaced:
        raise InputError.at(
            path, "image", "is no plain PNG", "save it as grey, RGB or RGBA with 8 bits a channel, not interlaced"
        )
    try:
        body = zlib.decompress(b"".join(chunk[8:-4] for kind, chunk in chunks if kind == b"IDAT"))
    except zlib.error as error:
        raise InputError.at(path, "image", "the picture is damaged (its pixels cannot be unpacked)", _REMEDY) from error
    channels = CHANNELS[colour]
    rows = np.frombuffer(body, dtype=np.uint8)
    if width == 0 or height == 0 or rows.size != height * (1 + width * channels):
        raise InputError.at(path, "image", "the picture is damaged (pixels are missing)", _REMEDY)
    rows = rows.reshape(height, 1 + width * channels)
    if rows[:, 0].max() > PAETH:
        raise InputError.at(path, "image", "the picture is damaged (unknown filter)", _REMEDY)
    pixels = _unfilter(rows[:, 0], rows[:, 1:], channels)
    return pixels.reshape((height, width) if channels == 1 else (height, width, channels))


def _chunks(data: bytes, path: PathLike) -> Iterator[tuple[bytes, memoryview]]:
    """Kind and bytes of each chunk up to IEND: length, kind, content, checksum."""
    if not data.startswith(SIGNATURE):
        raise InputError.at(path, "image", "is not a PNG picture", _REMEDY)
    view, position, kind = memoryview(data), len(SIGNATURE), b""
    while kind != b"IEND":
        if position + 12 > len(data):
            raise InputError.at(path, "image", "the picture is cut short", _REMEDY)
        (length,) = struct.unpack_from(">I", data, position)
        end = position + 12 + length
        if end > len(data):
            raise InputError.at(path, "image", "the picture is cut short", _REMEDY)
        kind = data[position + 4 : position + 8]
        (checksum,) = struct.unpack_from(">I", data, end - 4)
        if zlib.crc32(view[position + 4 : end - 4]) != checksum:
            raise InputError.at(path, "image", "the picture is damaged (wrong checksum)", _REMEDY)
        yield kind, view[position:end]
        position = end


def _unfilter(filters: np.ndarray, rows: np.ndarray, channels: int) -> np.ndarray:
    """Undo the filters (H,) of rows (H, W * channels): runs of rows with one filter at a time."""
    result = np.empty_like(rows)
    above = np.zeros(rows.shape[1], dtype=np.uint8)
    starts = np.flatnonzero(np.diff(filters, prepend=255))
    for first, last in zip(starts, [*starts[1:], len(rows)], strict=True):
        kind, block, out = filters[first], rows[first:last], result[first:last]
        if kind == NONE:
            out[:] = block
        elif kind == SUB:  # bytes wrap around, and so does their cumulative sum
            shaped = block.reshape(len(block), -1, channels)
            np.cumsum(shaped, axis=1, dtype=np.uint8, out=out.reshape(shaped.shape))
        elif kind == UP:
            np.cumsum(block, axis=0, dtype=np.uint8, out=out)
            out += above
        else:
            undo = _average if kind == AVERAGE else _paeth
            for i, row in enumerate(block):
                for c in range(channels):
                    out[i, c::channels] = undo(row[c::channels], above[c::channels])
                above = out[i]
        above = result[last - 1]
    return result


def _average(row: np.ndarray, above: np.ndarray) -> list[int]:
    """Each byte of one channel after the one to its left, in plain integers."""
    left, done = 0, []
    for value, up in zip(row.tolist(), above.tolist(), strict=True):
        left = (value + ((left + up) >> 1)) & 255
        done.append(left)
    return done


def _paeth(row: np.ndarray, above: np.ndarray) -> np.ndarray:
    """The same for Paeth's filter.

    Where nothing is stored and the byte above equals the one to its left, a byte is what its left neighbour is. Only
    the others are visited, which are few in masks.
    """
    diagonal = np.concatenate([np.zeros(1, dtype=np.uint8), above[:-1]])
    places = np.flatnonzero((row != 0) | (above != diagonal))
    left, done = 0, [0]
    for value, up, corner in zip(row[places].tolist(), above[places].tolist(), diagonal[places].tolist(), strict=True):
        # How far left + up - corner is from each of the three.
        to_left, to_up, to_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
        next_best = up if to_up <= to_corner else corner
        guess = left if to_left <= to_up and to_left <= to_corner else next_best
        left = (value + guess) & 255
        done.append(left)
    return np.repeat(np.array(done, dtype=np.uint8), np.diff(places, prepend=0, append=row.size))
