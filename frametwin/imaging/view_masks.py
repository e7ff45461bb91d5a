"""The masks of a capture, view by view: the method is chosen here, and a view that cannot be used is named."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.capture import Capture, View
from frametwin.capture.picture import Picture
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.masks import binarise_photo, content_problem, decode, mask_itself, undistort
from frametwin.imaging.neighbourhood import Neighbourhood
from frametwin.imaging.photo_masks import MARGIN, ViewMask, nothing_to_see, photo_mask, refined_mask
from frametwin.imaging.photograph import photograph, without
from frametwin.progress import Progress, ProgressCallback, report

Method = Literal["auto", "paper"]
METHODS: tuple[Method, ...] = ("auto", "paper")

LEAST_VIEWS = 6
"""Views that must be left; of a capture with fewer, all."""

LEAST_REACH, REACH = 4.0, 1.5
"""How far beyond a twin's outlines its surface is carried on: at least in pixels, and in margins."""

_WORKERS = 2


def read_view_masks(
    capture: Capture,
    method: Method = "auto",
    *,
    ignore: PathLike | None = None,
    require: bool = True,
    progress: ProgressCallback | None = None,
) -> list[ViewMask]:
    """Read all views of a capture as undistorted masks.

    Parameters
    ----------
    capture
        The capture.
    method
        What becomes of photographs: ``auto`` compares them with the background under any light, ``paper``
        follows section V.B of the paper. Pictures that are masks already stay as they are.
    ignore
        A folder with pictures named as the views' own: what is white there, such as the robot's arm, is neither
        print nor background. Views without such a picture are seen whole.
    require
        Refuse a capture of which too few views can be used.
    progress
        Called after each view.

    Returns
    -------
    masks
        One for each view, in their order. They belong to ``view.camera.without_distortion()``.

    Raises
    ------
    InputError
        If a picture cannot be decoded or has another size than its camera, or fewer than `LEAST_VIEWS` views can
        be used.
    Cancelled
        If ``progress`` says so.
    """
    if method not in METHODS:
        raise InputError.at("settings", "mask", f"{method!r} is unknown", f"give one of {', '.join(METHODS)}")
    hidden = _ignored(capture, ignore)
    masks = []
    with ThreadPoolExecutor(_WORKERS) as pool:
        jobs = pool.map(lambda view, hid: _read(capture.frame, view, hid, method), capture.views, hidden)
        for i, mask in enumerate(jobs):
            masks.append(mask)
            report(progress, Progress("reading images", i + 1, len(capture.views)))
    if require:
        require_views(capture, masks)
    return masks


@dataclass(frozen=True, eq=False)
class MasksOfCapture:
    """The masks of a capture that was read before.

    Attributes
    ----------
    capture, masks
        The capture, and what `read_view_masks` made of it.
    """

    capture: Capture
    masks: list[ViewMask]

    def of(self, capture: Capture) -> list[ViewMask] | None:
        """The masks of another reading of it; ``None`` unless that shows the same to the last byte."""
        same = self.capture.frame is capture.frame and self.capture.documents == capture.documents
        return self.masks if same and _shown(self.capture) == _shown(capture) else None


def _shown(capture: Capture) -> list[list[tuple[str, bytes]]]:
    """Names and bytes of the pictures, view by view."""
    return [[(capture.name_of(picture), picture.data) for picture in view.pictures] for view in capture.views]


def require_views(capture: Capture, masks: Sequence[ViewMask]) -> None:
    """Refuse a capture of which too few views can be used, naming the first that cannot.

    Raises
    ------
    InputError
        If so.
    """
    spoilt = [(view, mask) for view, mask in zip(capture.views, masks, strict=True) if not mask.used]
    if len(masks) - len(spoilt) >= min(LEAST_VIEWS, len(masks)):
        return
    view, mask = spoilt[0]
    others = f"; {len(masks) - len(spoilt)} of {len(masks)} views can be used" if len(spoilt) > 1 else ""
    raise InputError.at(
        view.image.path,
        "image",
        f"{mask.reason}{others}",
        mask.remedy,
    )


def refine_view_masks(
    capture: Capture,
    masks: Sequence[ViewMask],
    twin: Wireframe,
    cameras: Sequence[Camera] | None = None,
    margin: float = MARGIN,
    curves: np.ndarray | None = None,
) -> list[ViewMask]:
    """The masks of photographs once more, about a twin that is right to within a margin in mm.

    What lies wholly in shadow has the colour of shadow; only its shape tells it from one. Masks that are no
    photographs, and views that are not used, stay as they are.

    Parameters
    ----------
    capture, masks
        As they were read.
    twin
        The frame where it is.
    cameras
        Of all views, without distortion, where they were found to be; by default where the capture has them.
    margin
        By how many mm the twin may be off.
    curves
        (E, n + 1, 3) mm, of its struts, where they are of a higher degree; those of ``twin`` by default.
    """
    chosen = [i for i, mask in enumerate(masks) if mask.photo is not None and mask.used]
    if not chosen:
        return list(masks)
    from frametwin.raster.silhouette import silhouettes  # which loads numba: only photographs need it

    known = cameras or [view.camera.without_distortion() for view in capture.views]
    drawn = silhouettes(twin, [known[i] for i in chosen], supersampling=3, curves=curves)
    refined = list(masks)
    with ThreadPoolExecutor(_WORKERS) as pool:
        waiting = [
            pool.submit(_refined, masks[i], twin, known[i], silhouette.astype(np.float32) / 255.0, margin, curves)
            for i, silhouette in zip(chosen, drawn, strict=True)
        ]
        for i, job in zip(chosen, waiting, strict=True):
            refined[i] = job.result()
    return refined


def settled_view_masks(
    capture: Capture,
    masks: Sequence[ViewMask],
    twin: Wireframe,
    cameras: Sequence[Camera] | None = None,
    curves: np.ndarray | None = None,
) -> list[ViewMask]:
    """The masks of photographs about a twin as a fit sees them last; see `refine_view_masks`.

    The first look about a twin only tells how far out of focus a photograph is, and finds its print once more without
    the twin. The second looks about it.
    """
    seen = refine_view_masks(capture, masks, twin, cameras, curves=curves)
    told = [after.blur > 0.0 and before.blur == 0.0 for before, after in zip(masks, seen, strict=True)]
    if not any(told):
        return seen
    again = refine_view_masks(capture, seen, twin, cameras, curves=curves)
    return [new if just else old for new, old, just in zip(again, seen, told, strict=True)]


def _refined(
    mask: ViewMask,
    twin: Wireframe,
    camera: Camera,
    silhouette: np.ndarray,
    margin: float,
    curves: np.ndarray | None,
) -> ViewMask:
    from frametwin.raster.normals import surface_normals

    scale = 0.0 if mask.photo is None else mask.photo.neighbourhood.pixels_per_mm
    normals = surface_normals(twin, camera, max(LEAST_REACH, REACH * margin * scale), curves)
    return refined_mask(mask, silhouette, margin, normals)


def _read(frame: Wireframe, view: View, hidden: np.ndarray | None, method: Method) -> ViewMask:
    image = decode(view.image, view.camera)
    reference = None if view.background is None else decode(view.background, view.camera)
    itself = mask_itself(image) if reference is None else None
    valid = _seen(view, hidden)
    if itself is None and method == "auto":
        reason = nothing_to_see(image)
        if reason:
            return ViewMask(np.zeros(image.shape[:2], np.float32), used=False, reason=reason, method=method)
        where = Neighbourhood.of(frame, view.camera.without_distortion())
        straight = None if reference is None else undistort(reference, view.camera)
        photo = photograph(undistort(image, view.camera), straight, where)
        return replace(photo_mask(photo if valid is None else without(photo, valid == 0.0)), valid=valid)
    mask = binarise_photo(image, reference) if itself is None else itself
    reason, remedy = content_problem(mask)
    straight = undistort(mask, view.camera)
    if not reason and straight is not mask and not (straight > 0.5).any():
        reason = "shows nothing of the print once its lens distortion is removed"
        remedy = "calibrate the camera again"
    if valid is not None:
        straight = np.where(valid > 0.0, straight, 0.0).astype(np.float32)
    shown = ViewMask(straight, not reason, reason, "paper" if itself is None else "mask", valid)
    return replace(shown, remedy=remedy) if reason else shown


def _seen(view: View, hidden: np.ndarray | None) -> np.ndarray | None:
    if hidden is None:
        return None
    return np.asarray(undistort((hidden <= 127).astype(np.float32), view.camera) > 0.5, dtype=np.float32)


def _ignored(capture: Capture, folder: PathLike | None) -> list[np.ndarray | None]:
    if folder is None:
        return [None] * len(capture.views)
    root = Path(folder)
    found = [_matching(root, view) for view in capture.views]
    if not any(found):
        raise InputError.at(
            root,
            "ignore",
            "holds no picture for any view",
            "give a folder with pictures named as the views' own, white where nothing is to be looked at",
        )
    pictures: list[np.ndarray | None] = []
    for path, view in zip(found, capture.views, strict=True):
        picture = None if path is None else decode(Picture.read(path), view.camera)
        pictures.append(picture if picture is None or picture.ndim == 2 else picture.max(axis=2))
    return pictures


def _matching(root: Path, view: View) -> Path | None:
    names = (view.image.path.name, f"{view.image.path.stem}.png")
    return next((root / name for name in names if (root / name).is_file()), None)
