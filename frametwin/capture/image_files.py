"""PNG and JPEG files without a decoder: their size and whether they are whole, and PNG read, stripped and written.

References
----------
Portable Network Graphics (PNG) Specification, third edition, W3C, 2025 (chunks: section 5; filters: section 9).
ITU T.81, annex B (markers of JPEG files).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, write_bytes

SIGNATURE = b"\x89PNG\r\n\x1a\n"
PICTURE_CHUNKS = (b"IHDR", b"PLTE", b"IDAT", b"IEND")
CHANNELS = {0: 1, 2: 3, 6: 4}
"""Channels of the colour types that `decode_png` reads: grey, RGB and RGBA."""

NONE, SUB, UP, AVERAGE, PAETH = range(5)
_JPEG = b"\xff\xd8\xff"
_JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # start-of-frame markers
_REMEDY = "save the picture again, as PNG or JPEG"


def read_image_bytes(path: PathLike) -> bytes:
    """Read the bytes of a picture.

    Raises
    ------
    InputError
        If the file is missing, empty or cannot be read.
    """
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError as error:
        raise InputError.at(path, "image", "the picture is missing", "put it there, or correct file_path") from error
    except OSError as error:
        raise InputError.at(path, "image", f"cannot be read ({error.strerror})", "give a file, not a folder") from error
    if not data:
        raise InputError.at(path, "image", "the file is empty", _REMEDY)
    return data


def image_size(path: PathLike, data: bytes | None = None) -> tuple[int, int]:
    """Find the size of a picture from its header, and check that the file is whole, without decoding it.

    Parameters
    ----------
    path
        A PNG or JPEG file; the content counts, not the suffix.
    data
        Its bytes, where they have been read already.

    Returns
    -------
    width, height
        In pixels, as stored (a rotation noted in the metadata is not applied).

    Raises
    ------
    InputError
        If the file is missing, not a PNG or JPEG, cut short, or (PNG) has a wrong checksum.
    """
    data = read_image_bytes(path) if data is None else data
    if data.startswith(SIGNATURE):
        return _png_size(path, data)
    if data.startswith(_JPEG):
        return _jpeg_size(path, data)
    if SIGNATURE.startswith(data) or _JPEG.startswith(data):
        raise _cut(path)
    raise InputError.at(path, "image", "is not a PNG or JPEG picture", _REMEDY)


def _cut(path: PathLike) -> InputError:
    return InputError.at(path, "image", "the picture is cut short", "copy or save it again, whole")


def _damaged(path: PathLike, why: str) -> InputError:
    return InputError.at(path, "image", f"the picture is damaged ({why})", _REMEDY)


def _jpeg_size(path: PathLike, data: bytes) -> tuple[int, int]:
    """Walk the marker segments to the scan, and look for the end marker after it."""
    position, size = 2, None
    while True:
        while data[position : position + 2] == b"\xff\xff":  # fill bytes
            position += 1
        if position + 4 > len(data):
            raise _cut(path)
        if data[position] != 0xFF:
            raise _damaged(path, "no marker where one belongs")
        marker = data[position + 1]
        (length,) = struct.unpack_from(">H", data, position + 2)
        if position + 2 + length > len(data):
            raise _cut(path)
        if marker in _JPEG_SIZES and length >= 8:
            height, width = struct.unpack_from(">HH", data, position + 5)
            size = (width, height)
        position += 2 + length
        if marker == 0xDA:
            break
    if size is None:
        raise _damaged(path, "no size before the data")
    if data.find(b"\xff\xd9", position) < 0:
        raise _cut(path)
    return size


def _png_chunks(data: bytes, path: PathLike) -> Iterator[tuple[bytes, memoryview]]:
    """Kind and bytes of each chunk from the header to the end: length, kind, content, checksum."""
    if not data.startswith(SIGNATURE):
        raise InputError.at(path, "image", "is not a PNG picture", _REMEDY)
    view, position, kind = memoryview(data), len(SIGNATURE), b""
    while kind != b"IEND":
        if position + 12 > len(data):
            raise _cut(path)
        (length,) = struct.unpack_from(">I", data, position)
        end = position + 12 + length
        if end > len(data):
            raise _cut(path)
        kind = data[position + 4 : position + 8]
        (checksum,) = struct.unpack_from(">I", data, end - 4)
        if zlib.crc32(view[position + 4 : end - 4]) != checksum:
            raise _damaged(path, "wrong checksum")
        if position == len(SIGNATURE) and (kind != b"IHDR" or length != 13):
            raise _damaged(path, "no header")
        yield kind, view[position:end]
        position = end


def _png_size(path: PathLike, data: bytes) -> tuple[int, int]:
    """Width and height from the header, once all chunks have been walked."""
    header = [chunk for _, chunk in _png_chunks(data, path)][0]
    width, height = struct.unpack_from(">II", header, 8)
    return width, height


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
    kept = [chunk for kind, chunk in _png_chunks(data, path) if kind in PICTURE_CHUNKS]
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
    chunks = list(_png_chunks(data, path))
    width, height, depth, colour, _, _, interlaced = struct.unpack_from(">IIBBBBB", chunks[0][1], 8)
    if depth != 8 or colour not in CHANNELS or interlaced:
        raise InputError.at(
            path, "image", "is no plain PNG", "save it as grey, RGB or RGBA with 8 bits a channel, not interlaced"
        )
    try:
        body = zlib.decompress(b"".join(chunk[8:-4] for kind, chunk in chunks if kind == b"IDAT"))
    except zlib.error as error:
        raise _damaged(path, "its pixels cannot be unpacked") from error
    channels = CHANNELS[colour]
    rows = np.frombuffer(body, dtype=np.uint8)
    if width == 0 or height == 0 or rows.size != height * (1 + width * channels):
        raise _damaged(path, "pixels are missing")
    rows = rows.reshape(height, 1 + width * channels)
    if rows[:, 0].max() > PAETH:
        raise _damaged(path, "unknown filter")
    pixels = _unfilter(rows[:, 0], rows[:, 1:], channels)
    return pixels.reshape((height, width) if channels == 1 else (height, width, channels))


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


def encode_png(image: np.ndarray, noisy: bool = False) -> bytes:
    """Encode a picture as PNG, 8 bits a channel, without losses.

    Parameters
    ----------
    image
        (H, W) grey or (H, W, 3) red-green-blue, uint8.
    noisy
        Whether the noise of a sensor lies over it: nothing repeats then, and looking for it takes nine tenths of the
        time and makes the file larger.

    Raises
    ------
    ValueError
        If it is of another shape or type.
    """
    colour = image.ndim == 3
    if image.dtype != np.uint8 or image.size == 0 or image.ndim not in (2, 3) or (colour and image.shape[2] != 3):
        raise ValueError(f"a picture is (H, W) or (H, W, 3) uint8, not {image.shape} {image.dtype}")
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image).reshape(height, -1)
    # Filter 2 stores the difference to the row above: long runs of zeros in masks and gentle photos alike.
    filtered = np.full((height, rows.shape[1] + 1), 2, dtype=np.uint8)
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, 8, 2 if colour else 0, 0, 0, 0)
    strategy = zlib.Z_HUFFMAN_ONLY if noisy else zlib.Z_DEFAULT_STRATEGY
    packer = zlib.compressobj(6, zlib.DEFLATED, zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, strategy)
    body = packer.compress(filtered.tobytes()) + packer.flush()
    return SIGNATURE + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def write_png(path: PathLike, image: np.ndarray) -> None:
    """Write a picture as PNG, atomically; see `encode_png`.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_bytes(path, encode_png(image))
