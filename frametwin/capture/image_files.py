"""PNG and JPEG files with the standard library alone: their size, whether they are whole, and writing PNG."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, write_bytes

_PNG = b"\x89PNG\r\n\x1a\n"
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
    if data.startswith(_PNG):
        return _png_size(path, data)
    if data.startswith(_JPEG):
        return _jpeg_size(path, data)
    if _PNG.startswith(data) or _JPEG.startswith(data):
        raise _cut(path)
    raise InputError.at(path, "image", "is not a PNG or JPEG picture", _REMEDY)


def _cut(path: PathLike) -> InputError:
    return InputError.at(path, "image", "the picture is cut short", "copy or save it again, whole")


def _png_size(path: PathLike, data: bytes) -> tuple[int, int]:
    """Walk the chunks (PNG specification, section 5): length, type, content, checksum, up to IEND."""
    position, size = len(_PNG), None
    while True:
        if position + 12 > len(data):
            raise _cut(path)
        (length,) = struct.unpack_from(">I", data, position)
        end = position + 12 + length
        if end > len(data):
            raise _cut(path)
        kind = data[position + 4 : position + 8]
        (checksum,) = struct.unpack_from(">I", data, end - 4)
        if zlib.crc32(data[position + 4 : end - 4]) != checksum:
            raise InputError.at(path, "image", "the picture is damaged (wrong checksum)", _REMEDY)
        if size is None:
            if kind != b"IHDR" or length != 13:
                raise InputError.at(path, "image", "the picture is damaged (no header)", _REMEDY)
            size = struct.unpack_from(">II", data, position + 8)
        if kind == b"IEND":
            return size
        position = end


def _jpeg_size(path: PathLike, data: bytes) -> tuple[int, int]:
    """Walk the marker segments (ITU T.81, annex B) to the scan, and look for the end marker after it."""
    position, size = 2, None
    while True:
        while data[position : position + 2] == b"\xff\xff":  # fill bytes
            position += 1
        if position + 4 > len(data):
            raise _cut(path)
        if data[position] != 0xFF:
            raise InputError.at(path, "image", "the picture is damaged (no marker where one belongs)", _REMEDY)
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
        raise InputError.at(path, "image", "the picture is damaged (no size before the data)", _REMEDY)
    if data.find(b"\xff\xd9", position) < 0:
        raise _cut(path)
    return size


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
    return _PNG + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def write_png(path: PathLike, image: np.ndarray) -> None:
    """Write a picture as PNG, atomically; see `encode_png`.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_bytes(path, encode_png(image))
