"""Twins: checked, written and read back bit by bit."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.twin import Twin, read_twin, write_twin
from frametwin.twin.verdict import Verdict

ARRAYS = ("control_points", "vertices", "thickness", "opacity", "completeness", "confidence")


def make(frame: Wireframe, **changes: Any) -> Twin:
    rng = np.random.default_rng(0)
    e = frame.strut_count
    values = {
        "control_points": frame.control_points,
        "vertices": frame.vertices,
        "thickness": rng.random((e, 20)) + 0.5,
        "opacity": rng.random((e, 20)),
        "completeness": rng.random(e),
        "confidence": 3.0 * rng.random(e),
        "loss": [0.5, 1.0 / 3.0, 1e-17],
        "timing": {"fit": 1.25, "read": 0.1},
        "provenance": {"version": "0.1.0", "seed": 0, "inputs": {"frame.json": "ab12"}},
        **changes,
    }
    return Twin(**values)


def test_round_trip(tmp_path: Path, curved_frame: Wireframe) -> None:
    twin = make(curved_frame)
    path = write_twin(tmp_path, twin)
    assert path == tmp_path / "twin.json" and os.listdir(tmp_path) == ["twin.json"]
    for source in (tmp_path, path, str(path)):
        back = read_twin(source)
        for name in ARRAYS:
            assert np.array_equal(getattr(back, name), getattr(twin, name)), name
            assert not getattr(back, name).flags.writeable
        assert back.loss == twin.loss == (0.5, 1.0 / 3.0, 1e-17)
        assert back.timing == twin.timing and back.provenance == twin.provenance


def test_file_is_as_designed(tmp_path: Path, curved_frame: Wireframe) -> None:
    write_twin(tmp_path, make(curved_frame))
    data = json.loads((tmp_path / "twin.json").read_text())
    since_2 = {"sigma_across", "sigma_along", "joint_radius", "attached", "gap", "cameras", "views", "verdict"}
    assert set(data) == {"format", "version", *ARRAYS, "loss", "timing", "provenance", *since_2}
    assert (data["format"], data["version"]) == ("frametwin-twin", 2)
    assert data["verdict"] == {"status": "good", "reasons": []} and data["sigma_across"] is None
    assert np.shape(data["control_points"]) == (24, 4, 3) and np.shape(data["thickness"]) == (24, 20)


def test_what_came_with_version_2_round_trips(tmp_path: Path, curved_frame: Wireframe) -> None:
    e, v = curved_frame.strut_count, curved_frame.vertex_count
    rng = np.random.default_rng(3)
    more = {"sigma_across": rng.random(e), "sigma_along": rng.random(e), "joint_radius": rng.random(v)}
    twin = make(
        curved_frame,
        **more,
        cameras=[{"name": "a", "sigmas": 1.5}],
        views=[{"name": "a", "used": False}],
        verdict=Verdict("doubtful", ("the light was bad",)),
    )
    write_twin(tmp_path, twin)
    back = read_twin(tmp_path)
    assert all(np.array_equal(getattr(back, name), values) for name, values in more.items())
    assert back.cameras == twin.cameras and back.views == twin.views and back.verdict == twin.verdict


def test_version_1_is_still_read(tmp_path: Path, curved_frame: Wireframe) -> None:
    path = write_twin(tmp_path, make(curved_frame))
    data = json.loads(path.read_text())
    old = {name: data[name] for name in ("format", *ARRAYS, "loss", "timing", "provenance")} | {"version": 1}
    path.write_text(json.dumps(old))
    back = read_twin(path)
    assert back.sigma_across is None and back.verdict == Verdict() and back.views == ()


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "curve nan": ({"control_points": np.full((24, 4, 3), np.nan)}, "control_points[0][0][0]"),
    "curves flat": ({"control_points": np.zeros((24, 12))}, "control_points"),
    "no struts": ({"control_points": np.zeros((0, 4, 3))}, "control_points"),
    "vertices": ({"vertices": np.zeros((12, 2))}, "vertices"),
    "thickness negative": ({"thickness": np.full((24, 20), -1.0)}, "thickness[0][0]"),
    "thickness of other struts": ({"thickness": np.ones((23, 20))}, "thickness"),
    "opacity of other kernels": ({"opacity": np.ones((24, 19))}, "opacity"),
    "opacity above one": ({"opacity": np.full((24, 20), 1.01)}, "opacity[0][0]"),
    "completeness above one": ({"completeness": np.full(24, 1.5)}, "completeness[0]"),
    "completeness a number": ({"completeness": 1.0}, "completeness"),
    "confidence infinite": ({"confidence": np.full(24, np.inf)}, "confidence[0]"),
    "loss nan": ({"loss": [1.0, float("nan")]}, "loss[1]"),
    "timing a list": ({"timing": [1.0]}, "timing"),
}


@pytest.mark.parametrize(("change", "field"), BAD.values(), ids=BAD.keys())
def test_refused(curved_frame: Wireframe, change: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        make(curved_frame, source="twin.json", **change)
    assert str(caught.value).startswith(f"twin.json: {field}: ")


def test_nan_in_the_remarks_is_never_written(tmp_path: Path, curved_frame: Wireframe) -> None:
    for change in ({"timing": {"fit": float("nan")}}, {"provenance": {"scores": [float("inf")]}}):
        with pytest.raises(ValueError):
            write_twin(tmp_path, make(curved_frame, **change))
        assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("key", [*ARRAYS, "loss", "timing", "provenance", "format", "version"])
def test_missing_or_wrong_fields_of_the_file(tmp_path: Path, curved_frame: Wireframe, key: str) -> None:
    path = write_twin(tmp_path, make(curved_frame))
    data = json.loads(path.read_text())
    for change in ({}, {key: None}, {key: "text"}, {key: [[True]]}):
        path.write_text(json.dumps({name: value for name, value in data.items() if name != key} | change))
        with pytest.raises(InputError, match=f"twin.json: {key}: "):
            read_twin(tmp_path)


def test_other_faults_of_the_file(tmp_path: Path, curved_frame: Wireframe) -> None:
    with pytest.raises(InputError, match="twin.json: file: the file does not exist"):
        read_twin(tmp_path)
    path = write_twin(tmp_path, make(curved_frame))
    text = path.read_text()
    for broken, fragment in (
        (text[: len(text) // 2], "cut short"),
        (text.replace('"version": 2', '"version": 3'), "version: 3"),
        (text.replace('"loss"', '"edges": [], "loss"'), "edges: is not a field"),
    ):
        path.write_text(broken)
        with pytest.raises(InputError, match=f"twin.json: .*{fragment}"):
            read_twin(path)


def test_twin_as_a_wireframe(straight_frame: Wireframe, curved_frame: Wireframe) -> None:
    moved = curved_frame.transformed(np.diag([1.1, 1.0, 0.9, 1.0]))
    frame = make(moved).as_wireframe(straight_frame)
    assert np.array_equal(frame.control_points, moved.control_points)
    assert np.array_equal(frame.edges, straight_frame.edges) and np.array_equal(frame.radius, straight_frame.radius)
    part, _ = straight_frame.subset(np.arange(24) < 20)
    with pytest.raises(InputError, match="the twin 24 and 12"):
        make(moved).as_wireframe(part)
    with pytest.raises(InputError, match="control_points"):
        make(moved, vertices=curved_frame.vertices).as_wireframe(straight_frame)


def test_a_copy_differs_in_what_was_changed_alone(curved_frame: Wireframe) -> None:
    twin = make(curved_frame)
    moved = twin.replace(timing={"fit": 2.0}, vertices=twin.vertices + 1.0)
    assert moved.timing == {"fit": 2.0} and np.array_equal(moved.vertices, twin.vertices + 1.0)
    assert twin.timing == {"fit": 1.25, "read": 0.1}
    for name in set(ARRAYS) - {"vertices"}:
        assert np.array_equal(getattr(moved, name), getattr(twin, name)), name
    assert (moved.loss, moved.provenance) == (twin.loss, twin.provenance)


def test_a_copy_is_checked_anew(curved_frame: Wireframe) -> None:
    twin = make(curved_frame)
    with pytest.raises(InputError, match=r"^run 3: opacity\[0\]\[0\]: "):
        twin.replace(opacity=np.full((24, 20), 1.01), source="run 3")
    with pytest.raises(TypeError, match="colour"):
        twin.replace(colour=1.0)
