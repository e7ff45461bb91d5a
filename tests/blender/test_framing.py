"""What is looked at lies in the part of a view that nothing covers, and fills it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from frametwin.blender.views.framing import BORDER, SENSOR, Room, camera_view, free_view

FREE = Room(1311, 878, 58, 1019, 0, 824)
WHOLE = Room(1311, 878, 0, 1311, 0, 878)
NARROW = Room(600, 878, 58, 308, 0, 824)


@dataclass
class Region:
    """What is known of a region of an area."""

    type: str
    alignment: str
    x: int
    y: int
    width: int
    height: int


REGIONS = [
    Region("HEADER", "TOP", 2, 946, 1311, 27),
    Region("TOOL_HEADER", "TOP", 2, 919, 1311, 27),
    Region("TOOLS", "LEFT", 2, 95, 58, 824),
    Region("UI", "RIGHT", 1021, 95, 292, 824),
    Region("ASSET_SHELF", "BOTTOM", 2, 95, 1311, 1),  # closed
    Region("HUD", "FLOAT", 100, 100, 168, 25),
    Region("WINDOW", "NONE", 2, 95, 1311, 878),
]


def test_the_room_beside_what_covers_a_view() -> None:
    assert Room.of(REGIONS) == FREE
    assert Room.of(REGIONS, 786) == replace(FREE, width=786, right=494)
    assert Room.of(REGIONS, 360) == Room(360, 878, 0, 360, 0, 878)  # next to nothing would be left
    beside = [replace(region, width=961, x=60, height=824) if region.type == "WINDOW" else region for region in REGIONS]
    assert Room.of(beside) == Room(961, 824, 0, 961, 0, 824)  # the preferences let nothing overlap


def test_a_camera_fills_a_whole_view_as_blender_centres_it() -> None:
    zoom, offset = camera_view(WHOLE, (1600, 1200))
    assert zoom == pytest.approx(23.594, abs=0.05) and offset == (0.0, 0.0)  # of View > Center View to Camera


@pytest.mark.parametrize("room", [FREE, NARROW, Room(700, 900, 0, 700, 100, 900)])
@pytest.mark.parametrize("size", [(1600, 1200), (1080, 1920), (500, 500)])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
def test_a_cameras_picture_fills_what_is_free(room: Room, size: tuple[int, int], fit: str) -> None:
    zoom, (right, up) = camera_view(room, size, fit)
    factor = (np.sqrt(2.0) + zoom / 50.0) ** 2 / 4.0
    side = {"HORIZONTAL": room.width / size[0], "VERTICAL": room.height / size[1]}
    scale = factor * side.get(fit, max(room.width, room.height) / max(size))
    middle = (room.width * (0.5 - 2.0 * factor * right), room.height * (0.5 - 2.0 * factor * up))
    gaps = [
        middle[0] - 0.5 * scale * size[0] - room.left,
        room.right - middle[0] - 0.5 * scale * size[0],
        middle[1] - 0.5 * scale * size[1] - room.low,
        room.high - middle[1] - 0.5 * scale * size[1],
    ]
    assert min(gaps) == pytest.approx(0.5 * BORDER)
    assert gaps[0] == pytest.approx(gaps[1]) and gaps[2] == pytest.approx(gaps[3])


@pytest.mark.parametrize("room", [FREE, NARROW])
@pytest.mark.parametrize("perspective", [True, False])
def test_points_fill_what_is_free(room: Room, perspective: bool) -> None:
    rng = np.random.default_rng(5)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = rng.normal(size=(40, 3)) * [200.0, 40.0, 60.0] + [500.0, -300.0, 20.0]
    place, distance = free_view(room, points, axes, 50.0, perspective, margin=1.0)
    local = (points - place) @ axes
    depth = distance - local[:, 2] if perspective else np.full(len(points), distance)
    seen = local[:, :2] / depth[:, None] * 50.0 / (2.0 * SENSOR) * max(room.width, room.height)
    pixels = seen + 0.5 * np.array([room.width, room.height])
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    gaps = np.array([low - [room.left, room.low], [room.right, room.high] - high])
    assert gaps.min() == pytest.approx(0.0, abs=1e-6) and depth.min() > 0.0
    side = int(gaps.sum(axis=0).argmin())
    assert gaps[:, side] == pytest.approx([0.0, 0.0], abs=1e-6)  # from end to end


def test_the_eye_is_before_what_points_at_it() -> None:
    axes, points = np.eye(3), np.array([[0.0, 0.0, -50.0], [0.0, 0.0, 50.0]])
    _, distance = free_view(FREE, points, axes, 50.0, True)
    assert distance > 60.0
