"""Fits and looks at photographs by turns: which cameras are believed, and where the next look is taken."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import read_capture
from frametwin.errors import InputError
from frametwin.fitting import photo_fit
from frametwin.fitting.camera_corrections import as_found, as_records
from frametwin.fitting.camera_freedoms import FREEDOMS, corrected
from frametwin.fitting.part_fit import ViewsFit
from frametwin.imaging.photo_masks import ViewMask
from frametwin.imaging.view_masks import read_view_masks

PHOTOGRAPHS = Path(__file__).resolve().parents[2] / "shared" / "photographs"
needs_photographs = pytest.mark.skipif(not PHOTOGRAPHS.is_dir(), reason="needs photographs beside the project")


def some_cameras(count: int) -> tuple[Camera, ...]:
    return ring_rig(np.array([[-50.0, -50.0, 0.0], [50.0, 50.0, 80.0]]), count, size=(80, 60))


def views_fit(count: int, holds: str, seed: int = 0) -> ViewsFit:
    scale = np.array([*3 * [0.005], *3 * [2.0], 0.01, *2 * [3.0], 0.0])
    cameras = scale * np.random.default_rng(seed).standard_normal((count, FREEDOMS))
    rest = np.zeros(count)
    return ViewsFit(cameras, rest + 1.0, np.ones(count, dtype=bool), rest, rest, holds)


def test_cameras_are_found_again_from_what_a_twin_keeps() -> None:
    cameras = some_cameras(3)
    found = views_fit(3, "feet")
    again = as_found(cameras, as_records(found, cameras))
    for one, other in zip(again, corrected(cameras, found.cameras), strict=True):
        np.testing.assert_allclose(one.camera_to_world, other.camera_to_world, atol=1e-12)
        np.testing.assert_allclose([one.fl_x, one.fl_y, one.cx, one.cy], [other.fl_x, other.fl_y, other.cx, other.cy])


def test_cameras_that_nothing_is_said_of_stay() -> None:
    cameras = some_cameras(2)
    assert as_records(views_fit(2, "rig"), cameras) == []
    (first, second) = as_found(cameras, as_records(views_fit(1, "feet"), cameras[:1]))
    assert np.abs(first.camera_to_world - cameras[0].camera_to_world).max() > 1e-3
    np.testing.assert_array_equal(second.camera_to_world, cameras[1].camera_to_world)


@pytest.mark.parametrize(
    ("key", "value"), [("turn_deg", [0.0, 1.0]), ("shift_mm", "far"), ("focal_share", -2.0), ("centre_px", None)]
)
def test_a_correction_that_is_none_is_named(key: str, value: object) -> None:
    cameras = some_cameras(2)
    records = as_records(views_fit(2, "feet"), cameras)
    records[1][key] = value
    with pytest.raises(InputError, match=rf"twin\.json.*cameras\[1\]\.{key}"):
        as_found(cameras, records)


class FakeFit:
    """A fit whose cameras go where they are told, with a misfit of its own for free and for exact ones."""

    def __init__(self, sigmas: float, free: float, exact: float) -> None:
        self.sigmas, self.misfit = sigmas, {False: free, True: exact}
        self.asked: list[bool] = []

    def __call__(self, cameras: Sequence[Camera], pictures: Any, start: Any, exact: bool) -> Any:
        self.asked.append(exact)
        moved = [] if exact else [{"name": camera.name, "sigmas": self.sigmas} for camera in cameras]
        views = [
            {"name": camera.name, "used": True, "unexplained": self.misfit[exact], "unseen": 0.0} for camera in cameras
        ]
        return SimpleNamespace(twin=SimpleNamespace(cameras=moved, views=views), field=None, exact=exact)


@pytest.mark.parametrize(
    ("sigmas", "free", "exact", "believed"),
    [(2.0, 0.03, 0.2, "free"), (6.0, 0.035, 0.036, "exact"), (6.0, 0.1, 0.3, "free")],
    ids=["within the rig's errors", "far for nothing", "far and needed"],
)
def test_cameras_that_move_far_are_believed_only_if_they_explain_more(
    sigmas: float, free: float, exact: float, believed: str
) -> None:
    cameras = some_cameras(3)
    capture = SimpleNamespace(views=[SimpleNamespace(camera=camera) for camera in cameras])
    black = np.zeros((4, 4), np.float32)
    masks = [ViewMask(black, photo=SimpleNamespace()) for _ in cameras]  # type: ignore[arg-type]
    fit = FakeFit(sigmas, free, exact)
    result: Any = photo_fit._fit_used(capture, masks, fit, None)  # type: ignore[arg-type]
    assert result.exact == (believed == "exact")
    assert fit.asked == ([False] if sigmas < 4.0 else [False, True])


@needs_photographs
def test_the_next_look_is_taken_through_the_cameras_that_were_found(monkeypatch: pytest.MonkeyPatch) -> None:
    capture = read_capture(PHOTOGRAPHS / "matte")
    seen: list[Sequence[Camera]] = []

    def look(taken: Any, masks: Any, twin: Any, cameras: Sequence[Camera], **_: Any) -> Any:
        seen.append(cameras)
        return masks

    monkeypatch.setattr(photo_fit, "refine_view_masks", look)
    shift = [0.0, 0.0, 1.5]
    record = {"turn_deg": [0, 0, 0], "shift_mm": shift, "focal_share": 0.0, "centre_px": [0, 0], "sigmas": 0.8}
    twin = SimpleNamespace(
        cameras=[{"name": view.camera.name, **record} for view in capture.views],
        control_points=capture.frame.control_points,
        curves=capture.frame.control_points,
        as_wireframe=lambda frame: frame,
    )
    result = SimpleNamespace(twin=twin, field=None)
    photo_fit.fit_by_turns(capture, read_view_masks(capture), lambda *_, **__: result)  # type: ignore
    assert len(seen) == 1  # the second fit is where the first was: no further look
    for camera, view in zip(seen[0], capture.views, strict=True):
        np.testing.assert_allclose(camera.centre - view.camera.centre, shift)


def test_outlines_are_more_doubtful_out_of_focus_than_in_focus() -> None:
    black = np.zeros((4, 4), np.float32)
    sharp, soft, unused = ViewMask(black), ViewMask(black, blur=2.0), ViewMask(black, used=False, blur=9.0)
    assert photo_fit.outline_doubt([sharp, unused]) == photo_fit.OUTLINE_OF_MASKS
    assert photo_fit.outline_doubt([soft, unused]) > 2.0 * photo_fit.outline_doubt([sharp])
