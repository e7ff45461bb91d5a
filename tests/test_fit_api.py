"""From a fit to its run folder: the field through the twin, settings by name, and files whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_frames import tower

from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import Capture, read_capture
from frametwin.errors import InputError
from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fields.lattice_fit import MOST_COEFFICIENTS
from frametwin.fitting import api
from frametwin.fitting.api import FitResult, fit_views, read_field, settings_of, write_run
from frametwin.fitting.fast_settings import FastSettings
from frametwin.fitting.frame_field import MARGIN, field_through, moved_curves
from frametwin.fitting.settings import FitSettings
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.twin.twin import Twin, read_twin

FRAMES = {"straight": tower(), "curved": tower(curved=True)}
MATRIX = np.array([[0.01, -0.05, 0.02], [0.03, 0.02, -0.01], [0.0, 0.04, -0.03]])


def affine(points: np.ndarray) -> np.ndarray:
    return points @ MATRIX + [1.0, -0.5, 2.0]


def anywhere(count: int = 300) -> np.ndarray:
    """Points in and around the tower's box."""
    return np.random.default_rng(0).uniform([-5.0, -5.0, -5.0], [25.0, 25.0, 45.0], size=(count, 3))


@pytest.mark.parametrize(("cells", "tolerance"), [((2, 5), 1e-6), ((1,), 2e-5)])
@pytest.mark.parametrize("name", FRAMES)
def test_the_field_through_an_affine_motion_is_that_motion(name: str, cells: tuple[int, ...], tolerance: float) -> None:
    frame = FRAMES[name]
    moved = frame.control_points + affine(frame.control_points)
    weights = (None, np.random.default_rng(1).uniform(0.0, 1.0, frame.strut_count))
    for weight in weights:
        field = field_through(frame, moved, cells, weight)
        assert len(field.levels) == len(cells)
        np.testing.assert_allclose(field.evaluate(anywhere()), affine(anywhere()), atol=tolerance)


def test_the_field_follows_a_bent_frame_and_reaches_beyond_it() -> None:
    frame = FRAMES["straight"]

    def bent(points: np.ndarray) -> np.ndarray:
        return 1.5e-3 * points[..., 2:] ** 2 * np.array([1.0, 0.0, -0.2])

    u = np.linspace(0.0, 1.0, 9)
    points = bezier.evaluate(frame.control_points, u)
    moved = np.einsum("cj,sjx->scx", bezier.refit_matrix(8), points + bent(points))
    field = field_through(frame, moved, (2, 5))
    np.testing.assert_allclose(field.evaluate(points.reshape(-1, 3)), bent(points.reshape(-1, 3)), atol=0.02)
    low, high = frame.bounds
    margin = MARGIN * frame.extent
    np.testing.assert_allclose(field.box, [low - margin, high + margin])


def test_a_strut_of_little_weight_hardly_bends_the_field() -> None:
    frame = FRAMES["straight"]
    moved = frame.control_points + affine(frame.control_points)
    moved[5] += 8.0  # astray
    points = np.delete(frame.control_points, 5, axis=0).reshape(-1, 3)
    weight = np.ones(frame.strut_count)
    trusting = np.abs(field_through(frame, moved, (2, 5)).evaluate(points) - affine(points))
    weight[5] = 0.0
    wary = np.abs(field_through(frame, moved, (2, 5), weight).evaluate(points) - affine(points))
    assert trusting.max() > 1.0
    assert wary.max() < 0.05


@pytest.mark.parametrize("name", FRAMES)
def test_curves_moved_by_a_field_give_back_the_field(name: str) -> None:
    frame = FRAMES[name]
    field = field_through(frame, frame.control_points + affine(frame.control_points), (2, 5))
    wanted = frame.control_points + affine(frame.control_points)  # cubics stay cubics under affine motions
    np.testing.assert_allclose(moved_curves(frame, field), wanted, atol=1e-6)


def test_settings_by_name() -> None:
    fast = settings_of("fast", 3, {"cells": 2, "learn_thickness": False})
    assert isinstance(fast, FastSettings)
    assert (fast.seed, fast.cells, fast.learn_thickness) == (3, 2, False)
    for name in api.PRESETS:
        settings = settings_of(name, 5)
        assert (settings.preset, settings.seed) == (name, 5)
        assert isinstance(settings, FastSettings if name == "fast" else FitSettings)
    assert settings_of("paper", changes={"iterations": 7}).iterations == 7


@pytest.mark.parametrize(
    ("preset", "seed", "changes", "field"),
    [
        ("quick", 0, {}, "preset"),
        ("fast", 0, {"iterations": 5}, "iterations"),
        ("fast", -1, {}, "seed"),
        ("fast", 0, {"cells": 0}, "cells"),
        ("fast", 0, {"cells": 2.0}, "cells"),
        ("fast", 0, {"kernels_per_strut": True}, "kernels_per_strut"),
        ("fast", 0, {"absent": 1.5}, "absent"),
        ("fast", 0, {"suspicious": float("nan")}, "suspicious"),
        ("fast", 0, {"learn_opacity": 1}, "learn_opacity"),
        ("fast", 0, {"field_cells": ()}, "field_cells"),
        ("fast", 0, {"field_cells": (2, 0)}, "field_cells"),
        ("fast", 0, {"field_cells": (2.0,)}, "field_cells"),
        ("fast", 0, {"field_cells": (500,)}, "field_cells"),
        ("fast", 0, {"field_cells": (16, 16)}, "field_cells"),
        ("paper", 0, {"cells": 1}, "cells"),
        ("paper", 0, {"iterations": 0}, "iterations"),
        ("paper-lattice", -1, {}, "seed"),
    ],
)
def test_settings_that_do_not_exist_or_fit_are_refused(preset: str, seed: int, changes: dict, field: str) -> None:
    with pytest.raises(InputError, match=f"^settings: {field}: "):
        settings_of(preset, seed, changes)


def test_every_field_that_is_allowed_can_be_fitted() -> None:
    cube = np.array([[0.0, 0.0, 0.0], [9.0, 9.0, 9.0]])
    for cells in ((1,), (2, 5), (12, 12), (3, 15)):
        assert settings_of("fast", changes={"field_cells": list(cells)}).field_cells == cells
        resolutions = [even_cells(cube, count) for count in cells]
        assert len(LatticeField.zeros(cube, resolutions).coefficients) <= MOST_COEFFICIENTS


def test_an_unknown_setting_is_answered_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="use one of .*cells.*learn_thickness"):
        settings_of("fast", changes={"cell": 1})


def test_a_warm_start_is_refused_where_it_would_not_be_used() -> None:
    frame = FRAMES["straight"]
    cameras = ring_rig(frame, 2, size=(30, 40))
    masks = [np.zeros((30, 40), dtype=np.float32)] * 2
    field = LatticeField.zeros(frame.bounds, [(1, 1, 1)])
    with pytest.raises(InputError, match="warm start"):
        fit_views(frame, cameras, masks, "paper", start=field)


@pytest.fixture
def capture(small_capture: Path) -> Capture:
    return read_capture(small_capture)


@pytest.fixture
def result(capture: Capture) -> FitResult:
    frame = capture.frame
    moved = frame.control_points + affine(frame.control_points)
    kernels = (frame.strut_count, 5)
    twin = Twin(
        control_points=moved,
        vertices=frame.vertices + affine(frame.vertices),
        thickness=np.full(kernels, 0.9),
        opacity=np.ones(kernels),
        completeness=np.ones(frame.strut_count),
        confidence=np.linspace(0.0, 1.0, frame.strut_count),
        loss=[0.5, 0.25],
        timing={"fit": 1.5},
        provenance={"preset": "fast", "seed": 0},
    )
    return FitResult(twin, field_through(frame, moved, (1, 2)))


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()
    }


def test_a_run_is_read_back_as_it_was_written(tmp_path: Path, capture: Capture, result: FitResult) -> None:
    run = tmp_path / "runs" / "one"
    write_run(run, result, capture)
    assert sorted(files(run)) == ["field.safetensors", "frame.json", "twin.json"]
    twin = read_twin(run)
    for name in ("control_points", "vertices", "thickness", "opacity", "completeness", "confidence"):
        np.testing.assert_array_equal(getattr(twin, name), getattr(result.twin, name))
    assert (twin.loss, twin.timing, twin.provenance) == (result.twin.loss, result.twin.timing, result.twin.provenance)
    for place in (run, run / api.FIELD_FILE, str(run)):
        np.testing.assert_array_equal(read_field(place).evaluate(anywhere()), result.field.evaluate(anywhere()))
    np.testing.assert_array_equal(read_frame(run / "frame.json").control_points, capture.frame.control_points)


@pytest.mark.parametrize("step", ["twin", "field", "frame"])
@pytest.mark.parametrize("error", [OSError("no space left"), KeyboardInterrupt()])
def test_a_run_that_fails_leaves_nothing(
    tmp_path: Path,
    capture: Capture,
    result: FitResult,
    monkeypatch: pytest.MonkeyPatch,
    step: str,
    error: BaseException,
) -> None:
    owner, name = {
        "twin": (api.twin_files, "write_twin"),
        "field": (api, "save_field"),
        "frame": (api, "write_frame"),
    }[step]
    before = files(tmp_path)

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(owner, name, fail)
    with pytest.raises(type(error)):
        write_run(tmp_path / "runs" / "one", result, capture)
    assert files(tmp_path) == before
    assert not (tmp_path / "runs").exists()


def test_a_failed_overwrite_keeps_the_old_run(
    tmp_path: Path, capture: Capture, result: FitResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    write_run(run, result, capture)
    before = files(tmp_path)
    with pytest.raises(InputError, match="not empty"):
        write_run(run, result, capture)
    assert files(tmp_path) == before

    def fail(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(api, "write_frame", fail)
    with pytest.raises(OSError, match="no space"):
        write_run(run, result, capture, overwrite=True)
    assert files(tmp_path) == before
    monkeypatch.undo()
    other = FitResult(result.twin, LatticeField.zeros(result.field.box, [(1, 1, 1)]))
    write_run(run, other, capture, overwrite=True)
    assert not read_field(run).evaluate(anywhere()).any()


def test_a_field_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"field\.safetensors: file: does not exist"):
        read_field(tmp_path)
