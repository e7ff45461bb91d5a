"""The passes that Blender writes: multi-layer OpenEXR, one part for all (4.5) or one a pass (5.x)."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

from frametwin.errors import InputError
from frametwin.files import PathLike

FAR = 1e9
"""Depth in mm from which on there is nothing; Blender writes 1e10."""

_REMEDY = "render it again"
_CHANNELS = ("Depth.Z", "Normal.X", "Normal.Y", "Normal.Z", "Strut.X")


@dataclass(frozen=True, eq=False)
class Passes:
    """What the centre of every pixel of a view sees.

    Attributes
    ----------
    depth
        (H, W) float32, mm along the optical axis (not along the ray); infinite where there is nothing.
    normal
        (H, W, 3) float32, unit, world axes; zero where there is nothing.
    strut
        (H, W) int32 index of the strut in the frame; -1 where there is nothing. In the file it is one more, and 0
        stands for nothing.
    """

    depth: np.ndarray
    normal: np.ndarray
    strut: np.ndarray


def read_passes(path: PathLike) -> Passes:
    """Read ``passes/NAME.exr``.

    Raises
    ------
    InputError
        If the file is missing, damaged, or lacks a pass.
    """
    channels = _channels(Path(path))
    missing = [name for name in _CHANNELS if name not in channels]
    if missing:
        raise InputError.at(path, missing[0], "the pass is missing", "render the passes with FrameTwin")
    shapes = {channels[name].shape for name in _CHANNELS}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2:
        raise InputError.at(path, "size", "the passes differ in size", _REMEDY)
    depth = channels["Depth.Z"].astype(np.float32)
    strut = channels["Strut.X"]
    if not (np.isfinite(strut).all() and np.array_equal(strut, np.rint(strut)) and strut.min() >= 0.0):
        raise InputError.at(path, "Strut.X", "holds other than strut numbers", _REMEDY)
    normal = np.stack([channels[f"Normal.{axis}"] for axis in "XYZ"], axis=-1).astype(np.float32)
    return Passes(
        depth=np.where(depth < FAR, depth, np.float32(np.inf)), normal=normal, strut=strut.astype(np.int32) - 1
    )


def resample_channels(path: PathLike, resample: Callable[[np.ndarray], np.ndarray]) -> None:
    """Resample every channel of a file in place.

    Parameters
    ----------
    path
        The file, of one part.
    resample
        Gives the values (H, W) that take the place of those of a channel (H, W).
    """
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
        changed = {name: np.ascontiguousarray(resample(pixels)) for name, pixels in channels.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, changed).write(str(path))


def _channels(path: Path) -> dict[str, np.ndarray]:
    """All channels of all parts (H, W), by their names without the view layer's."""
    if not path.is_file():
        raise InputError.at(path, "file", "the file does not exist", _REMEDY)
    words = io.StringIO()
    try:
        # Parts whose pixels cannot be unpacked the package leaves out, and says so on standard output only.
        with contextlib.redirect_stdout(words), OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {
                ".".join(name.split(".")[-2:]): channel.pixels.copy()
                for part in file.parts
                for name, channel in part.channels.items()
            }
    except Exception as error:  # the package raises whatever comes to hand
        raise InputError.at(path, "file", "is no whole OpenEXR file", _REMEDY) from error
    if words.getvalue():
        raise InputError.at(path, "file", "the file is damaged or cut short", _REMEDY)
    return channels
