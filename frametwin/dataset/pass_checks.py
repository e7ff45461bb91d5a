"""Whether the passes of a sample (depth, normal, strut index) agree with its true curves."""

from __future__ import annotations

import numpy as np

from frametwin.capture.capture import Capture, View
from frametwin.dataset.true_curves import TrueCurves
from frametwin.errors import InputError
from frametwin.imaging.exr import Passes, read_passes

LEAST_AGREEING = 0.95
"""Share of the samples that are compared at which a pass says what the curves say."""

CLEAR_OF_EDGES = 3.0
"""In radii: samples nearer to an end of their strut are not compared; there another strut's surface may be seen."""

LEAST_SINE = 0.3
"""Of the angle between strut and ray: where it runs along the view, its surface lies far before its centreline."""

LEAST_PIXELS = 1.5
"""Apparent radius from which on the pixel of a centreline shows its strut for certain."""

DEPTHS = (0.5, 1.5)
"""By how much the surface may lie before the centreline, in radii over the sine."""


def check_passes(capture: Capture, curves: TrueCurves) -> list[str]:
    """Compare every view's passes with the curves, where there are passes.

    Parameters
    ----------
    capture
        The sample.
    curves
        Its true curves; where nothing is known of what is visible, only the sizes of the passes are checked.

    Returns
    -------
    What is wrong, in words.
    """
    folder = capture.root / "passes"
    if not folder.is_dir():
        return []
    problems = []
    for n, view in enumerate(capture.views):
        path = folder / f"{view.image.path.stem}.exr"
        name = path.relative_to(capture.root).as_posix()
        if not path.is_file():
            problems.append(f"{name} is missing")
            continue
        try:
            passes = read_passes(path)
        except InputError as error:
            problems.append(str(error))
            continue
        problems += [f"{name}: {text}" for text in _pass_problems(passes, view, curves, n)]
    return problems


def _pass_problems(passes: Passes, view: View, curves: TrueCurves, n: int) -> list[str]:
    size = (view.camera.height, view.camera.width)
    if passes.depth.shape != size or passes.strut.shape != size or passes.normal.shape != (*size, 3):
        return [f"the passes are not {size[0]} x {size[1]} pixels as the picture is"]
    if curves.visible is None or curves.depth is None:
        return []
    seen, sine = _compared(view, curves, n)
    if not seen.any():
        return []
    pixels, _ = view.camera.project(curves.points[seen])
    column, row = np.clip(np.floor(pixels).astype(int), 0, [size[1] - 1, size[0] - 1]).T
    strut = np.broadcast_to(np.arange(len(seen))[:, None], seen.shape)[seen]
    same = passes.strut[row, column] == strut
    problems = []
    if same.mean() < LEAST_AGREEING:
        problems.append(f"the strut index is that of the curve at only {same.mean():.0%} of the visible samples")
    with np.errstate(invalid="ignore"):
        before = (curves.depth[n][seen] - passes.depth[row, column]) * sine[seen] / curves.radius[seen]
    fine = (before > DEPTHS[0]) & (before < DEPTHS[1])
    if fine[same].size and fine[same].mean() < LEAST_AGREEING:
        problems.append(f"the depth is that of the strut at only {fine[same].mean():.0%} of the visible samples")
    towards = np.einsum("nx,nx->n", passes.normal[row, column], view.camera.centre - curves.points[seen]) > 0.0
    if towards.mean() < LEAST_AGREEING:
        problems.append(f"normals face the camera at only {towards.mean():.0%} of the visible samples")
    return problems


def _compared(view: View, curves: TrueCurves, n: int) -> tuple[np.ndarray, np.ndarray]:
    """(E, S) bool: samples at which the passes can be told; and (E, S) sine between strut and ray."""
    assert curves.visible is not None and curves.depth is not None
    points = curves.points
    ends = np.stack([np.linalg.norm(points - points[:, [i]], axis=2) for i in (0, -1)]).min(axis=0)
    ray = points - view.camera.centre
    sine = np.linalg.norm(np.cross(ray, curves.tangents), axis=2) / np.linalg.norm(ray, axis=2)
    apparent = min(view.camera.fl_x, view.camera.fl_y) * curves.radius / np.maximum(curves.depth[n], 1e-9)
    clear = (ends > CLEAR_OF_EDGES * curves.radius) & (sine > LEAST_SINE) & (apparent > LEAST_PIXELS)
    return curves.visible[n] & clear, sine
