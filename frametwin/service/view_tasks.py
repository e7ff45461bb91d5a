"""What the worker process draws for those who compare a twin with its pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np

from frametwin.capture.capture import read_capture
from frametwin.errors import InputError
from frametwin.files import staged_directory
from frametwin.fitting.camera_corrections import as_found
from frametwin.imaging.comparison import difference, outline
from frametwin.imaging.encoding import png_with_alpha
from frametwin.imaging.view_masks import Method, read_view_masks
from frametwin.progress import ProgressCallback
from frametwin.raster.silhouette import silhouettes
from frametwin.twin.runs import load_run

OUTLINE, DIFFERENCE = "outline", "difference"
THERE = 0.5
"""Opacity from which on a part of a strut is drawn."""


def compare(
    capture: Path,
    run: Path,
    out: Path,
    mask: str = "auto",
    ignore: Path | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Draw each view's outline of the print, and where print and twin differ; the job ``compare``.

    Parameters
    ----------
    capture, run
        The folders. The twin is drawn by the cameras as the fit found them.
    out
        A new folder: ``outline/NAME.png`` and ``difference/NAME.png``, clear where there is nothing.
    mask, ignore
        ``method`` and ``ignore`` of `frametwin.imaging.view_masks.read_view_masks`.
    progress
        See `ProgressCallback`.

    Returns
    -------
    ``out``; ``views``: of each its ``name``, and as shares of the print what the twin leaves out (``left_out``) and
    covers besides (``beyond``).

    Raises
    ------
    InputError
        If a folder cannot be read, or the twin is not one of the capture's frame.
    """
    content = read_capture(capture)
    twin, frame = load_run(run)
    if frame.strut_count != content.frame.strut_count or not np.array_equal(frame.edges, content.frame.edges):
        raise InputError.at(run, "frame.json", f"is not the frame of {capture}", "give the capture of the run")
    masks = read_view_masks(content, cast(Method, mask), ignore=ignore, require=False, progress=progress)
    cameras = as_found([view.camera.without_distortion() for view in content.views], twin.cameras)
    thickness = np.where(twin.opacity >= THERE, twin.thickness, 0.0)
    shape = twin.as_wireframe(frame)
    drawn = silhouettes(shape, cameras, thickness=thickness, progress=progress, curves=twin.curves)
    told = []
    with staged_directory(out, False) as stage:
        for kind in (OUTLINE, DIFFERENCE):
            (stage / kind).mkdir()
        for view, found, silhouette in zip(content.views, masks, drawn, strict=True):
            name = view.image.path.stem
            picture, shares = difference(found.coverage, silhouette)
            (stage / OUTLINE / f"{name}.png").write_bytes(png_with_alpha(outline(found.coverage)))
            (stage / DIFFERENCE / f"{name}.png").write_bytes(png_with_alpha(picture))
            told.append({"name": name, "left_out": shares.left_out, "beyond": shares.beyond})
    return {"out": out, "views": told}
