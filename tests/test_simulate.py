"""Simulated captures: what is printed stands, pictures show the truth, and the same seed gives the same bytes."""

from __future__ import annotations

import hashlib
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.cameras.rigs import RIGS
from frametwin.capture.capture import read_capture
from frametwin.errors import Cancelled, InputError
from frametwin.files import read_json
from frametwin.formats import defects_json, read_frame
from frametwin.geometry import bezier
from frametwin.geometry.parametric import FRAMES, named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.masks import read_masks
from frametwin.mechanics.deformations import DEFORMATIONS, random_rigid_motion
from frametwin.simulation.print_order import print_order, print_share
from frametwin.simulation.simulate import SimulationSettings, deform_print, simulate, write_simulation

SMALL = SimulationSettings(views=3, size=(96, 128))


def small(**changes: Any) -> SimulationSettings:
    return SimulationSettings(**{"views": 3, "size": (96, 128), **changes})


@pytest.fixture(scope="module")
def bridge() -> Wireframe:
    return named_frame("bridge")


def assert_every_strut_stands_on_those_before(frame: Wireframe, order: np.ndarray) -> None:
    reached = frame.grounded.copy()
    for strut in order:
        assert reached[frame.edges[strut]].any(), f"strut {strut} would hang in the air"
        reached[frame.edges[strut]] = True


# --- the order of printing


@pytest.mark.parametrize("name", FRAMES)
def test_print_order_follows_batches_and_stands(name: str) -> None:
    frame = named_frame(name)
    order = print_order(frame)
    assert np.array_equal(np.sort(order), np.arange(frame.strut_count))
    assert_every_strut_stands_on_those_before(frame, order)
    assert all(a <= b for a, b in pairwise(frame.batch[order]))  # each batch meets the ground or earlier ones


def test_without_batches_the_lowest_strut_in_reach_comes_next() -> None:
    frame = named_frame("lattice_tower").replace(batch=np.zeros(804, dtype=int))
    order = print_order(frame)
    assert_every_strut_stands_on_those_before(frame, order)
    tops = frame.vertices[frame.edges[order], 2].max(axis=1)
    assert np.all(np.diff(tops) >= 0.0)  # every joint of the tower can be reached from below


def test_a_strut_that_only_hangs_waits_for_what_holds_it() -> None:
    #  2---3   strut 2 (3-4) is low but hangs from the bar above
    #  |   |
    #  1   4
    vertices = [[0, 0, 0], [0, 0, 10], [0, 0, 20], [10, 0, 20], [10, 0, 5]]
    frame = Wireframe.create(vertices, [[0, 1], [1, 2], [3, 4], [2, 3]])
    assert print_order(frame).tolist() == [0, 1, 3, 2]
    assert print_share(frame, 0.75).printed.tolist() == [True, True, False, True]


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.95, 1.0])
def test_a_share_of_a_real_frame_stands_on_the_ground(shared_frames: Path, share: float) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    printed = print_share(frame, share)
    assert printed.printed.sum() == max(1, round(share * frame.strut_count))
    part, _, _ = printed.printed_part()
    count, labels = part.components()
    assert set(labels[part.grounded]) == set(range(count))


def test_a_share_that_is_not_connected_to_the_ground_is_refused() -> None:
    frame = Wireframe.create([[0, 0, 0], [0, 0, 9], [5, 0, 5], [5, 0, 9]], [[0, 1], [2, 3]])
    assert print_share(frame, 0.5).printed.tolist() == [True, False]
    with pytest.raises(InputError, match="grounded: only 1 of 2 struts"):
        print_share(frame, 0.9)
    for share in (0.0, -0.5, 1.5, float("nan")):
        with pytest.raises(InputError, match="printed"):
            print_share(frame, share)


# --- the simulation


@pytest.mark.parametrize("deformation", DEFORMATIONS)
@pytest.mark.parametrize("rig", RIGS)
def test_deformations_reach_their_peak_in_full_view(bridge: Wireframe, deformation: str, rig: str) -> None:
    done = simulate(bridge, small(deformation=deformation, rig=rig, peak=9.0))
    u = np.linspace(0.0, 1.0, 201)
    gap = bezier.evaluate(done.truth.control_points, u) - bezier.evaluate(bridge.control_points, u)
    assert np.linalg.norm(gap, axis=2).max() == pytest.approx(9.0, rel=1e-3)
    assert done.peak == pytest.approx(9.0, rel=1e-3)
    assert np.array_equal(done.truth.edges, bridge.edges)
    for camera in done.cameras:
        for frame in (bridge, done.truth):
            pixels, depth = camera.project(bezier.evaluate(frame.control_points, u).reshape(-1, 3))
            assert (depth > 0.0).all() and (pixels > 0.0).all()
            assert (pixels < [camera.width, camera.height]).all()


def test_the_default_peak_is_seven_percent(bridge: Wireframe) -> None:
    assert simulate(bridge, SMALL).peak == pytest.approx(0.07 * bridge.extent, rel=1e-6)


def test_a_rigid_motion_keeps_all_distances(bridge: Wireframe) -> None:
    moved = random_rigid_motion(bridge, 12.0, seed=3)
    before, after = (np.linalg.norm(frame.vertices[:, None] - frame.vertices, axis=2) for frame in (bridge, moved))
    assert np.allclose(before, after, atol=1e-9)
    with pytest.raises(InputError, match="peak"):
        random_rigid_motion(bridge, 1000.0)


def test_pictures_show_the_truth_and_not_the_plan(bridge: Wireframe) -> None:
    done = simulate(bridge, small(peak=20.0))
    for camera, image in zip(done.cameras, done.images, strict=True):
        assert image.dtype == np.uint8 and set(np.unique(image)) == {0, 255}
        real, _ = camera.project(bezier.evaluate(done.truth.control_points, [0.25, 0.5]).reshape(-1, 3))
        column, row = np.floor(real).astype(int).T
        assert (image[row, column] == 255).all()
        planned, _ = camera.project(bezier.evaluate(bridge.control_points, [0.25, 0.5]).reshape(-1, 3))
        column, row = np.floor(planned).astype(int).T
        assert (image[row, column] == 0).any()


def test_supersampling_gives_grey_edges(bridge: Wireframe) -> None:
    plain, fine = (simulate(bridge, small(size=(240, 320), supersampling=n)).images for n in (1, 4))
    assert len(np.unique(fine[0])) > 10
    for a, b in zip(plain, fine, strict=True):
        assert b.mean() == pytest.approx(a.mean(), rel=0.03)  # the same area


def test_only_what_is_printed_is_seen_and_sags(bridge: Wireframe) -> None:
    done = simulate(bridge, small(printed=0.5))
    assert done.frame.printed.sum() == 38
    assert np.array_equal(done.truth.printed, done.frame.printed)
    free = ~done.frame.printed_vertices()
    assert free.any() and np.array_equal(done.truth.vertices[free], bridge.vertices[free])
    part, _, _ = done.frame.printed_part()
    assert done.peak == pytest.approx(0.07 * part.extent, rel=1e-6)
    assert all(
        half.sum() < whole.sum() for half, whole in zip(done.images, simulate(bridge, SMALL).images, strict=True)
    )


def test_printed_is_left_as_the_frame_says(bridge: Wireframe) -> None:
    partial = print_share(bridge, 0.7)
    assert np.array_equal(simulate(partial, SMALL).frame.printed, partial.printed)
    assert simulate(partial, small(printed=1.0)).frame.printed.all()


def test_missing_struts_are_missing_in_the_pictures(bridge: Wireframe) -> None:
    whole, broken = simulate(bridge, SMALL), simulate(bridge, small(missing=10, missing_share=1.0))
    lost = np.flatnonzero((broken.present != [0.0, 1.0]).any(axis=1))
    assert len(lost) == 10 and not broken.present[lost].any()
    assert np.array_equal(whole.truth.control_points, broken.truth.control_points)
    for a, b in zip(whole.images, broken.images, strict=True):
        assert (b <= a).all() and b.sum() < a.sum()


def test_missing_struts_are_not_the_soft_ones(bridge: Wireframe) -> None:
    from frametwin.mechanics.sag import SagSettings, simulate_sag

    soft = simulate_sag(bridge, SagSettings(seed=0)).unhardened
    lost = (simulate(bridge, small(missing=19)).present != [0.0, 1.0]).any(axis=1)
    assert 0 < (lost & soft).sum() < 19


@pytest.mark.parametrize("deformation", DEFORMATIONS)
def test_a_print_is_deformed_alike_without_its_pictures(bridge: Wireframe, deformation: str) -> None:
    settings, stages = small(deformation=deformation, missing=3, printed=0.7, seed=2), []
    alone, pictured = deform_print(bridge, settings, lambda p: stages.append(p.stage)), simulate(bridge, settings)
    assert alone.peak == pictured.peak and "silhouettes" not in stages
    np.testing.assert_array_equal(alone.truth.control_points, pictured.truth.control_points)
    np.testing.assert_array_equal(alone.frame.printed, pictured.frame.printed)
    np.testing.assert_array_equal(alone.present, pictured.present)


def test_it_can_be_cancelled(bridge: Wireframe) -> None:
    stages = []
    with pytest.raises(Cancelled):
        simulate(bridge, SMALL, lambda p: (stages.append(p.stage), p.stage != "silhouettes")[1])
    assert stages[-1] == "silhouettes"


# --- files


def digest(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_the_same_seed_gives_the_same_files(bridge: Wireframe, tmp_path: Path) -> None:
    for name, seed in (("a", 4), ("b", 4), ("c", 5)):
        write_simulation(tmp_path / name, simulate(bridge, small(seed=seed, missing=2)))
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    first, other = digest(tmp_path / "a"), digest(tmp_path / "c")
    assert first["frame.json"] == other["frame.json"]
    changing = [name for name in first if name.startswith(("images", "truth", "defects"))]
    assert len(changing) > 3 and all(first[name] != other[name] for name in changing)


def test_round_trip(bridge: Wireframe, tmp_path: Path) -> None:
    done = simulate(bridge, small(missing=3, printed=0.8, seed=1))
    write_simulation(tmp_path / "capture", done)
    capture = read_capture(tmp_path / "capture")
    assert capture.truth is not None
    assert np.array_equal(capture.frame.printed, done.frame.printed)
    assert np.array_equal(capture.truth.control_points, done.truth.control_points)
    for mask, image in zip(read_masks(capture), done.images, strict=True):
        assert np.array_equal(mask, image / 255.0)
    assert np.array_equal(defects_json.read(capture.root, capture.frame.printed), done.present)
    notes = read_json(tmp_path / "capture" / "simulation.json")
    assert notes["seed"] == 1 and notes["missing"] == 3 and notes["size"] == [96, 128]
    assert notes["largest_displacement"] == pytest.approx(done.peak)


def test_whole_prints_have_no_file_of_defects(bridge: Wireframe, tmp_path: Path) -> None:
    write_simulation(tmp_path / "capture", simulate(bridge, small(printed=0.5)))
    assert not (tmp_path / "capture" / "defects.json").exists()
    with pytest.raises(InputError, match="exists"):
        write_simulation(tmp_path / "capture", simulate(bridge, SMALL))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"struts": [99]}, r"struts\[0\]"),
        ({"struts": [-1]}, r"struts\[0\]"),
        ({"struts": [3]}, r"struts\[0\].*not printed"),
        ({"struts": [1, 1], "present": [[0, 0.5]] * 2}, r"struts\[1\].*twice"),
        ({"struts": [0.5]}, "struts"),
        ({"struts": None}, "struts"),
        ({"present": [[0.5, 0.2]]}, r"present\[0\]"),
        ({"present": [[0.0, 1.5]]}, r"present\[0\]"),
        ({"present": [[0.0]]}, "present"),
        ({"present": []}, "present"),
        ({"format": "frametwin-frame"}, "format"),
        ({"version": 2}, "version"),
    ],
)
def test_damaged_defects_are_refused(tmp_path: Path, change: dict[str, Any], field: str) -> None:
    whole = {"format": "frametwin-defects", "version": 1, "struts": [1], "present": [[0.0, 0.5]]}
    printed = np.array([True, True, True, False])
    file = tmp_path / "defects.json"
    file.write_text(json.dumps(whole))
    assert defects_json.read(file, printed).tolist() == [[0, 1], [0, 0.5], [0, 1], [0, 0]]
    file.write_text(json.dumps({**whole, **change}))
    with pytest.raises(InputError, match=field):
        defects_json.read(file, printed)


@pytest.mark.parametrize(
    "changes",
    [
        {"views": 1},
        {"size": (4, 100)},
        {"size": (100, 100000)},
        {"peak": 0.0},
        {"peak": float("nan")},
        {"peak": float("inf")},
        {"seed": -1},
        {"missing": -1},
        {"missing_share": 0.0},
        {"missing_share": 1.1},
        {"printed": 0.0},
        {"printed": float("nan")},
        {"rig": "sphere"},
        {"deformation": "melt"},
        {"supersampling": 0},
    ],
)
def test_settings_out_of_range_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(changes))):
        SimulationSettings(**changes)


def test_more_missing_than_printed_is_refused(bridge: Wireframe) -> None:
    with pytest.raises(InputError, match="missing"):
        simulate(bridge, small(missing=77))
