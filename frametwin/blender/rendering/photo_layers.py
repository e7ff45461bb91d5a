"""Photos rendered in layers, in a fifth of the time: what is smooth is rendered coarsely, and print alone finely.

Three layers are put together. The surroundings without the print are smooth, for the lamps are soft and the table is
painted evenly. How much the print darkens and brightens them is smooth too, but for the shadows at its feet, which
get a finer picture of their own. The print itself is rendered before nothing, where it is in the picture.
Light goes its full way in all three: what the camera does not see still shades, and casts back its light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from frametwin.blender.rendering.photo_stage import PhotoStage
from frametwin.cameras import Camera

COARSE, FINE = 4, 2
"""Pixels to one of a smooth layer, and of one with edges."""

SOFT_LIGHT = 0.5
"""Side of the key light in sizes of the frame from which on its shadows are smooth."""

FEET, FEET_ROOM = 8.0, 6.0
"""Height up to which struts throw shadows with edges, and what these are given on all sides; in strut radii."""

SEAM = 16.0
"""Pixels over which the finer picture of the feet goes over into the coarse one."""

DARK = 1e-4
"""Light below which a share of it says nothing."""

Shot = Callable[[Camera, float], np.ndarray]
"""Renders the scene as it is set, with a share of the samples: linear light (H, W, 4), whose colours are already times
their coverage."""

SMOOTH = 0.5
"""Share of the samples that smooth layers get: the denoiser needs no more there."""

Box = tuple[int, int, int, int]
"""First column and row, and those behind the last."""


def layered_light(stage: PhotoStage, camera: Camera, shot: Shot) -> tuple[np.ndarray, np.ndarray]:
    """Linear light (H, W, 3) float32 of a view with the print, and of the same without it.

    Parameters
    ----------
    stage
        The scene.
    camera
        A pinhole camera.
    shot
        The renderer.
    """
    empty, without = light_without_print(stage, camera, shot)
    vertices = stage.private.mesh.vertices
    covered = box_of(camera, vertices, margin=2.0)
    if covered is None:
        return without, without
    light = without * _shading(stage, camera, shot, empty)
    stage.show(surroundings=False)
    layer = shot(cropped(camera, covered), 1.0)
    stage.show()
    part = _slice(covered)
    light[part] = light[part] * (1.0 - layer[..., 3:]) + layer[..., :3]
    return light, without


def light_without_print(stage: PhotoStage, camera: Camera, shot: Shot) -> tuple[np.ndarray, np.ndarray]:
    """Linear light of the surroundings alone, coarse (h, w, 3) and as the camera sees it (H, W, 3).

    Parameters
    ----------
    stage, camera, shot
        See `layered_light`.
    """
    struts = stage.private.struts
    stage.show()
    struts.hide_render = True
    empty = shot(coarser(camera, COARSE), SMOOTH)[..., :3]
    # Things that stand about have edges; shares of light need the coarse picture all the same.
    fine = shot(coarser(camera, FINE), SMOOTH)[..., :3] if stage.clutter else empty
    struts.hide_render = False
    return empty, resized(fine, camera.width, camera.height)


def _shading(stage: PhotoStage, camera: Camera, shot: Shot, empty: np.ndarray) -> np.ndarray:
    """Share (H, W, 3) of the light of the surroundings that is left beside the print, which is not seen itself."""
    soft = stage.private.content.look.light_side >= SOFT_LIGHT
    stage.show(print_=False)
    if soft:
        share = resized(_share(shot(coarser(camera, COARSE), SMOOTH), empty), camera.width, camera.height)
    else:
        fine = coarser(camera, FINE)
        share = _share(shot(fine, SMOOTH), resized(empty, fine.width, fine.height))
        share = resized(share, camera.width, camera.height)
    feet = _feet(stage)
    near = box_of(camera, feet, margin=2.0) if soft and len(feet) else None
    if near is not None:
        left, top, right, bottom = near
        view = coarser(cropped(camera, near), FINE)
        # What the surroundings give there, at the size of the part.
        there = resized(empty, camera.width, camera.height)[_slice(near)]
        fine_share = _share(shot(view, SMOOTH), resized(there, view.width, view.height))
        mix, part = _feather(right - left, bottom - top), share[_slice(near)]
        part += mix * (resized(fine_share, right - left, bottom - top) - part)
    stage.show()
    return share


def _share(with_print: np.ndarray, empty: np.ndarray) -> np.ndarray:
    return np.where(empty > DARK, with_print[..., :3] / np.maximum(empty, DARK), 1.0).clip(0.0, 2.0)


def _feather(width: int, height: int) -> np.ndarray:
    """Weights (H, W, 1) of a part of a picture: 1 inside, falling to 0 towards its edges."""
    x, y = (np.minimum(np.arange(side) + 0.5, side - 0.5 - np.arange(side)) / SEAM for side in (width, height))
    return np.minimum(np.minimum(x[None], y[:, None]), 1.0)[..., None].astype(np.float32)


def _feet(stage: PhotoStage) -> np.ndarray:
    """Corners (N, 3) of the part of the table that struts stand on or just above."""
    radius = float(stage.private.content.thickness.max())
    points = stage.private.mesh.vertices
    low = points[points[:, 2] < stage.ground[2] + FEET * radius]
    if not len(low):
        return low
    (x0, y0), (x1, y1) = low[:, :2].min(axis=0) - FEET_ROOM * radius, low[:, :2].max(axis=0) + FEET_ROOM * radius
    return np.array([(x, y, stage.ground[2]) for x in (x0, x1) for y in (y0, y1)])


def box_of(camera: Camera, points: np.ndarray, margin: float) -> Box | None:
    """The part of the picture that points (N, 3) lie in, with so many pixels around it; ``None`` if there is none."""
    if not len(points):
        return None
    pixels, _ = camera.project(points)
    if not np.isfinite(pixels).all():
        return 0, 0, camera.width, camera.height  # something reaches behind the camera
    size = np.array([camera.width, camera.height])
    low = np.clip(np.floor(pixels.min(axis=0) - margin), 0, size).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0) + margin), 0, size).astype(int)
    if np.any(high - low < 1):
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def cropped(camera: Camera, box: Box) -> Camera:
    """The camera that sees a part of the picture only."""
    left, top, right, bottom = box
    return replace(camera, width=right - left, height=bottom - top, cx=camera.cx - left, cy=camera.cy - top)


def coarser(camera: Camera, factor: int) -> Camera:
    """The camera with so many times fewer pixels along each side, at least 4."""
    return camera.resized(*(max(4, -(-side // factor)) for side in (camera.width, camera.height)))


def resized(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """A picture (h, w, C) in another size, linear between pixel centres, float32; a copy."""
    for axis, side in ((0, height), (1, width)):
        count = picture.shape[axis]
        place = np.clip((np.arange(side) + 0.5) * count / side - 0.5, 0.0, count - 1.0)
        before = np.minimum(place.astype(np.intp), max(count - 2, 0))
        on = (place - before).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        after = np.minimum(before + 1, count - 1)
        picture = picture.take(before, axis=axis) * (1.0 - on) + picture.take(after, axis=axis) * on
    return np.asarray(picture, dtype=np.float32)


def _slice(box: Box) -> tuple[slice, slice]:
    left, top, right, bottom = box
    return slice(top, bottom), slice(left, right)
