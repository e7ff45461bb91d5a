"""Pictures of plan, truth and twin: lines where the camera sees them, all layers visible, nothing lost."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from small_frames import tower

from frametwin.cameras import Camera, look_at
from frametwin.cameras.rigs import ring_rig
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging import contact_sheet as sheets
from frametwin.imaging.contact_sheet import contact_sheet, find_close_ups, put_text
from frametwin.imaging.overlay import PAPER, PLAN, PRINT, TRUTH, TWIN, Layer, Window, draw_view, layers_of, window_of
from frametwin.raster.silhouette import silhouettes

BLACK = (0, 0, 0)


def camera_in_front(width: int = 160, height: int = 120) -> Camera:
    """At (0, -100, 0), looking along y, x to the right and z up; a millimetre at the origin is 2 pixels."""
    return Camera("front", width, height, 200.0, 200.0, width / 2, height / 2, look_at([0, -100, 0], [0, 0, 0]))


def strut(a: list[float], b: list[float]) -> Wireframe:
    return Wireframe.create([a, b], [[0, 1]], radius=2.0)


def closeness(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """(H, W) bool: pixels of nearly this colour."""
    return np.abs(picture.astype(int) - colour).max(axis=2) <= 12


def test_lines_lie_where_the_camera_sees_the_curves() -> None:
    camera = camera_in_front()
    blank = np.zeros((120, 160), dtype=np.uint8)
    for height in (0.0, 0.13, 0.25, 3.4):  # 0.13 mm are a quarter of a pixel
        frame = strut([-60, 0, height], [60, 0, height])
        picture = draw_view(
            camera,
            blank,
            [Layer("line", frame.control_points, BLACK, 3.0)],
            size=(120, 160),
            window=Window(80.0, 60.0, 1.0),
        )
        ink = 255.0 - picture[:, 40:120, 0].astype(float)
        row = (ink.sum(axis=1) @ (np.arange(120) + 0.5)) / ink.sum()
        assert row == pytest.approx(60.0 - 2.0 * height, abs=0.07)
        assert ink.sum(axis=0).mean() / 255.0 == pytest.approx(3.0, abs=0.4)


@pytest.mark.parametrize("zoom", [0.37, 0.5, 1.0, 1.6, 4.0])
def test_the_mask_lies_under_the_lines(zoom: float) -> None:
    camera = camera_in_front(640, 480)
    frame = strut([-150, 0, 7.25], [150, 0, 7.25])  # in the middle of a pixel: an even mask
    (mask,) = silhouettes(frame, [camera], supersampling=4)
    window = Window(310.0, 230.0, zoom)
    seen, drawn = (
        255.0 - draw_view(camera, picture, layers, size=(240, 320), window=window)[..., 0].astype(float)
        for picture, layers in (
            (mask, ()),
            (np.zeros_like(mask), [Layer("line", frame.control_points, BLACK, 3.0)]),
        )
    )
    rows = np.arange(240) + 0.5
    middle = [(ink.sum(axis=1) @ rows) / ink.sum() for ink in (seen, drawn)]
    assert middle[0] == pytest.approx(middle[1], abs=0.1)


def test_masks_of_either_kind_look_alike() -> None:
    camera, frame = camera_in_front(), strut([-20, 0, 0], [20, 0, 5])
    (mask,) = silhouettes(frame, [camera])
    window = Window(80.0, 60.0, 1.0)
    first, second = (
        draw_view(camera, picture, (), size=(120, 160), window=window)
        for picture in (mask, (mask / 255.0).astype(np.float32))
    )
    assert np.array_equal(first, second)
    assert closeness(first, PRINT)[mask == 255].mean() > 0.9
    assert closeness(first, PAPER)[mask == 0].mean() > 0.9


@pytest.mark.parametrize("width", [1.0, 2.0])
def test_equal_curves_are_all_visible(width: float) -> None:
    camera, frame = camera_in_front(), strut([-25, 0, 0.3], [25, 0, 0.3])
    curves = frame.control_points
    picture = draw_view(
        camera,
        np.zeros((120, 160)),
        layers_of(curves, curves, curves),
        size=(480, 640),
        window=Window(80.0, 60.0, 4.0),
        width=width,
    )
    column = picture[:, 320].astype(float)
    # From above: paper, truth (light), plan (dark and blue), twin (red), plan, truth, paper.
    middle = round(240 - 4 * 2.0 * 0.3)
    assert np.abs(np.arange(480)[column[:, 0] - column[:, 2] > 40.0] - middle).max() <= 3
    for side in (column[: middle - 1][::-1], column[middle + 1 :]):
        away = np.linalg.norm(side - 255.0, axis=1)
        line = side[: int(np.argmax(away < 5.0))]
        blue = line[:, 2] - line[:, 0]
        light = line[:, 1] - 0.5 * (line[:, 0] + line[:, 2])  # green and nothing else
        assert 0 < len(line) < 12 and blue.max() > 60.0 and light.max() > 15.0
        assert light[0] / blue[0] < light[-1] / max(blue[-1], 1.0)  # bluer inside, greener outside
    if width == 2.0:
        for colour in (PLAN, TRUTH, TWIN):
            assert closeness(picture, colour)[:, 320].any()


def test_the_window_holds_all_curves() -> None:
    frame = named_frame("bridge")
    for camera in ring_rig(frame, 3, size=(300, 400)):
        layers = layers_of(frame.control_points)
        window = window_of(camera, layers, (200, 300))
        pixels, _ = camera.project(bezier.evaluate(frame.control_points, [0.0, 0.5, 1.0]).reshape(-1, 3))
        placed = window.placed(pixels, (200, 300)) / 32.0
        assert (placed > 5.0).all() and (placed < [295.0, 195.0]).all()
        span = np.ptp(placed, axis=0) / [300.0, 200.0]
        assert span.max() > 0.85  # and not much more


def test_curves_behind_the_camera_are_left_out() -> None:
    camera = camera_in_front()
    frame = strut([-5, -150, 0], [5, -130, 3])
    for curves in (frame.control_points, np.concatenate([frame.control_points] * 2)):
        layers = layers_of(curves)
        picture = draw_view(camera, np.zeros((120, 160)), layers, size=(60, 80))
        assert np.array_equal(picture, np.full((60, 80, 3), 255))


def test_colours_are_told_apart_by_all_eyes() -> None:
    """Machado, Oliveira, Fernandes, "A physiologically-based model for simulation of color vision deficiency",
    IEEE TVCG 15(6), 2009: the matrices of full severity, for linear red, green, blue."""
    eyes = {
        "protanopia": [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
        "deuteranopia": [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ],
        "tritanopia": [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ],
        "none": np.eye(3),
    }
    for matrix in eyes.values():
        linear = (np.array([PLAN, TRUTH, TWIN, PRINT, PAPER]) / 255.0) ** 2.2
        seen = np.clip(linear @ np.transpose(matrix), 0.0, 1.0) ** (1.0 / 2.2)
        apart = [np.linalg.norm(seen[a] - seen[b]) for a, b in combinations(range(3), 2)]
        assert min(apart) > 0.25
        assert min(np.linalg.norm(seen[i] - seen[4]) for i in range(3)) > 0.25


@pytest.mark.parametrize(("name", "count"), [("bridge", 2), ("bridge", 5), ("bridge", 8), ("tower", 3), ("tower", 11)])
def test_the_sheet_shows_every_view(name: str, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for limit, share in (("TILE_AREA", 9), ("MIN_WIDTH", 3)):  # a sheet of a third of the size: many are drawn
        monkeypatch.setattr(sheets, limit, getattr(sheets, limit) // share)
    frame = tower(3) if name == "tower" else named_frame(name)  # wide and tall
    cameras = ring_rig(frame, count, size=(120, 160))
    masks = silhouettes(frame, cameras)
    layers = layers_of(frame.control_points, twin=frame.control_points)
    sheet = contact_sheet(cameras, masks, layers, title=name)
    assert sheet.dtype == np.uint8 and sheet.ndim == 3 and sheet.shape[2] == 3
    assert 0.3 < sheet.shape[0] / sheet.shape[1] < 2.0
    places = []
    for i in range(count):
        others = [mask if k != i else np.zeros_like(mask) for k, mask in enumerate(masks)]
        rows, columns = np.nonzero((contact_sheet(cameras, others, layers, title=name) != sheet).any(axis=2))
        places.append((rows.min(), rows.max(), columns.min(), columns.max()))
    for a, b in combinations(places, 2):  # each view in a place of its own
        assert a[1] < b[0] or b[1] < a[0] or a[3] < b[2] or b[3] < a[2]


def test_close_ups_show_the_joint_that_moved_and_the_one_that_is_off() -> None:
    frame = named_frame("bridge")
    truth, twin = frame.vertices.copy(), frame.vertices.copy()
    truth[8] += [0.0, 0.0, -12.0]
    twin[8] = truth[8]
    twin[20] += [0.4, 0.0, 0.3]
    cameras = ring_rig(frame, 6, size=(300, 400))
    moved, off = find_close_ups(cameras, frame.vertices, truth, twin)
    assert "12.0 mm" in moved.caption and "0.50 mm" in off.caption
    for shown, joint in ((moved, 8), (off, 20)):
        camera = cameras[shown.view]
        assert camera.name in shown.caption
        ends = np.stack([twin[joint] if shown is off else frame.vertices[joint], truth[joint]])
        assert np.allclose(shown.marks, camera.project(ends)[0])
        placed = shown.window.placed(shown.marks, (540, 1080)) / 32.0
        assert (placed > 10.0).all() and (placed < [1070.0, 530.0]).all()
        step = np.linalg.norm(np.diff(shown.marks, axis=0)) * shown.window.zoom
        length = np.linalg.norm(np.diff(ends, axis=0))
        assert 0.6 * length < step / shown.pixels_per_mm < 1.05 * length
    only, _ = find_close_ups(cameras, frame.vertices, truth, twin, joints=np.arange(frame.vertex_count) != 8)
    assert "0.0 mm" in only.caption
    masks = silhouettes(frame, cameras)
    plain = contact_sheet(cameras, masks, layers_of(frame.control_points), title="a")
    more = contact_sheet(cameras, masks, layers_of(frame.control_points), title="a", close_ups=[moved, off])
    assert more.shape[0] > plain.shape[0] + 500


def test_views_of_different_sizes_share_a_sheet() -> None:
    frame = named_frame("bridge")
    cameras = [*ring_rig(frame, 3, size=(120, 160))[:2], ring_rig(frame, 3, size=(200, 100))[2]]
    masks = silhouettes(frame, cameras)
    assert contact_sheet(cameras, masks, layers_of(frame.control_points), title="mixed").size


def test_text_is_written_where_it_is_put() -> None:
    picture = np.full((60, 200, 3), 255, dtype=np.uint8)
    put_text(picture, "twin 12 mm", (20, 40), 0.7, BLACK)
    rows, columns = np.nonzero(picture[..., 0] < 128)
    assert 20 <= columns.min() < 26 and 120 < columns.max() < 200
    assert 15 < rows.min() < 28 and 36 <= rows.max() <= 44
    put_text(picture, "cut off at the edge of the picture", (150, 8), 0.7, BLACK)
    put_text(picture, "", (0, 0), 0.7, BLACK)
