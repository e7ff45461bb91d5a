"""Outlines and differences of a view's print and the twin."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from frametwin.capture.capture import read_capture
from frametwin.fitting.api import fit_capture, write_run
from frametwin.geometry.parametric import named_frame
from frametwin.imaging.comparison import DARK, LIGHT, ONLY_PRINT, ONLY_TWIN, difference, outline
from frametwin.imaging.encoding import png_with_alpha
from frametwin.service.view_tasks import compare
from frametwin.simulation.simulate import SimulationSettings, simulate, write_simulation


def disc(radius: float, size: int = 101) -> np.ndarray:
    y, x = np.mgrid[:size, :size] - size // 2
    return (np.hypot(x, y) <= radius).astype(np.float32)


def test_the_outline_lies_just_outside_of_the_print() -> None:
    picture = outline(disc(30.0))
    y, x = np.mgrid[:101, :101] - 50
    distance = np.hypot(x, y)
    opaque = picture[..., 3] > 0
    assert distance[opaque].min() > 30.0 and distance[opaque].max() < 33.0
    light = opaque & (picture[..., :3] == LIGHT).all(axis=-1)
    dark = opaque & (picture[..., :3] == DARK).all(axis=-1)
    assert (light | dark)[opaque].all() and distance[light].mean() < distance[dark].mean()


def test_the_difference_has_a_colour_for_each_side_and_says_how_much_it_is() -> None:
    print_, twin = disc(30.0), np.roll(disc(30.0), 10, axis=1)
    picture, shares = difference(print_, twin)
    only_print, only_twin = (print_ > 0) & (twin == 0), (twin > 0) & (print_ == 0)
    assert (picture[only_print] == (*ONLY_PRINT, 255)).all() and (picture[only_twin] == (*ONLY_TWIN, 255)).all()
    assert not picture[~(only_print | only_twin)].any()
    # Two circles at a distance d of 10 and a radius r of 30: what one has alone, by the formula of their lens.
    r, d = 30.0, 10.0
    lens = 2.0 * r**2 * np.arccos(d / (2.0 * r)) - 0.5 * d * np.sqrt(4.0 * r**2 - d**2)
    assert shares.left_out == pytest.approx(1.0 - lens / (np.pi * r**2), abs=0.01)
    assert shares.left_out == pytest.approx(shares.beyond, abs=1e-9)
    assert difference(print_, print_)[0].any() == np.False_


def test_opacity_survives_the_file(tmp_path: Path) -> None:
    picture = np.random.default_rng(4).integers(0, 256, (7, 5, 4), dtype=np.uint8)
    (tmp_path / "a.png").write_bytes(png_with_alpha(picture))
    found = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(found[..., [2, 1, 0, 3]], picture)
    with pytest.raises(ValueError, match="with opacity"):
        png_with_alpha(picture[..., :3])


def test_a_run_is_compared_with_its_capture(tmp_path: Path) -> None:
    made = simulate(named_frame("bridge"), SimulationSettings(views=3, size=(240, 320), peak=6.0, missing=1, seed=2))
    write_simulation(tmp_path / "capture", made)
    capture = read_capture(tmp_path / "capture")
    write_run(tmp_path / "run", fit_capture(capture), capture)
    told = compare(tmp_path / "capture", tmp_path / "run", tmp_path / "views")
    assert [view["name"] for view in told["views"]] == [view.image.path.stem for view in capture.views]
    for view, shares in zip(capture.views, told["views"], strict=True):
        assert shares["left_out"] < 0.05 and shares["beyond"] < 0.05
        for kind in ("outline", "difference"):
            found = cv2.imread(str(tmp_path / "views" / kind / view.image.path.name), cv2.IMREAD_UNCHANGED)
            assert found.shape == (240, 320, 4) and found[..., 3].any()
