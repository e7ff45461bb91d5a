"""What the worker process does with photographs before a fit: makes captures of them, and shows what is seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np

from frametwin.calibration.rig_capture import capture_from_rig
from frametwin.cameras.rig_file import read_rig
from frametwin.cameras.standing import standing_at
from frametwin.capture.capture import read_capture
from frametwin.errors import InputError
from frametwin.files import staged_directory
from frametwin.imaging.encoding import jpeg
from frametwin.imaging.mask_page import QUALITY, figures_of, seen_views
from frametwin.imaging.view_masks import LEAST_VIEWS, Method, read_view_masks
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.service.tasks import frame_of
from frametwin.twin.runs import require_free

MASK = "mask"
LONGEST_SIDE = 2048
"""Of the pictures with masks, in pixels."""


def make_capture(
    rig: Path,
    pictures: Path,
    frame: str | dict[str, Any],
    out: Path,
    base: list[float] | None = None,
    background: Path | None = None,
    moment: str | None = None,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Make a capture of raw pictures of a rig's cameras; the job ``capture``.

    Parameters
    ----------
    rig
        Its folder, or its ``rig.json``.
    pictures, background, moment
        See `frametwin.calibration.rig_capture.capture_from_rig`.
    frame
        The plan, with what has been printed: a file, or the content of a frame file.
    out, overwrite
        The capture folder, and whether it may be replaced if it is one.
    base
        Where the plan's origin stands in the robot's base: x, y, z in mm and, if given, the turn about z in degrees.

    Returns
    -------
    ``out``; ``views``: how many; ``missing``: names of the rig's cameras of which there is no picture.

    Raises
    ------
    InputError
        As `capture_from_rig`; if ``base`` has neither three nor four numbers.
    """
    if base is not None and len(base) not in (3, 4):
        raise InputError.at("request", "base", f"has {len(base)} numbers", "give x, y, z and perhaps the turn")
    require_free(out, overwrite, "transforms.json")
    found = read_rig(rig)
    missing = capture_from_rig(
        found,
        pictures,
        frame_of(frame),
        out,
        base=None if base is None else standing_at(base),
        background=background,
        moment=moment,
        overwrite=overwrite,
        progress=progress,
    )
    return {"out": out, "views": len(found.cameras) - len(missing), "missing": list(missing)}


def show_masks(
    capture: Path,
    out: Path,
    mask: str = "auto",
    ignore: Path | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Draw what is taken for print over each picture of a capture; the job ``masks``.

    Parameters
    ----------
    capture
        Its folder.
    out
        A new folder: ``mask/NAME.jpg``, each as the camera without its distortion sees it, print tinted and outlined.
    mask, ignore
        ``method`` and ``ignore`` of `frametwin.imaging.view_masks.read_view_masks`.

    Returns
    -------
    ``out``; ``views``: of each its ``name``, whether it is ``used``, and its ``figures`` in words, or why it cannot be
    used; ``needed``: how many a fit has to have.

    Raises
    ------
    InputError
        If the capture cannot be read, ``mask`` is unknown, or ``ignore`` holds no picture for any view.
    """
    content = read_capture(capture)
    masks = read_view_masks(content, cast(Method, mask), ignore=ignore, require=False, progress=progress)
    told = []
    with staged_directory(out, False) as stage:
        (stage / MASK).mkdir()
        for i, (view, found) in enumerate(zip(content.views, masks, strict=True)):
            (seen,) = seen_views(replace(content, views=(view,)), [found])
            name = view.image.path.stem
            (stage / MASK / f"{name}.jpg").write_bytes(jpeg(_reduced(seen.picture)[..., ::-1], QUALITY))
            told.append({"name": name, "used": found.used, "figures": figures_of(found)})
            report(progress, Progress("drawing masks", i + 1, len(masks)))
    return {"out": out, "views": told, "needed": min(LEAST_VIEWS, len(masks))}


def _reduced(picture: np.ndarray) -> np.ndarray:
    """A picture (H, W, 3), no longer than `LONGEST_SIDE`."""
    height, width = picture.shape[:2]
    share = min(1.0, LONGEST_SIDE / max(height, width))
    if share == 1.0:
        return picture
    size = (max(1, round(width * share)), max(1, round(height * share)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
