"""Format and unit in the file dialogs: what is read and written is what the command line reads and writes."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from test_blender_twins import shifted

from frametwin.blender.display.twins import show_twin
from frametwin.blender.frames.curves import wireframe_from_curve
from frametwin.formats import read_frame, write_frame
from frametwin.geometry.parametric import named_frame

ops = bpy.ops.frametwin


@pytest.fixture
def tab(extension: str, scene: Any) -> Any:
    """The add-on's settings of the scene, of which a unit is a millimetre."""
    cases.addon("session").runner.close()
    ops.use_millimetres()
    return scene.frametwin


def convert(*words: object) -> None:
    """Run ``frametwin convert``, where there is a command line beside this Blender."""
    pytest.importorskip("click", reason="the command line is compared with")
    from frametwin.cli.main import cli

    with pytest.raises(SystemExit) as ended:
        cli.main(["convert", *map(str, words)])
    assert ended.value.code == 0


@pytest.mark.parametrize(("unit", "millimetres"), [("mm", 1), ("cm", 10), ("m", 1000), ("in", 25.4)])
def test_a_drawing_without_a_unit_is_read_in_the_chosen_one(
    tab: Any, tmp_path: Path, unit: str, millimetres: float
) -> None:
    write_frame(tmp_path / "plan.obj", named_frame("bridge").transformed(np.diag([0.01, 0.01, 0.01, 1.0])))
    ops.import_frame(filepath=str(tmp_path / "plan.obj"), unit=unit)
    convert(tmp_path / "plan.obj", tmp_path / "wanted.json", "--scale", millimetres)
    found, wanted = wireframe_from_curve(tab.plan), read_frame(tmp_path / "wanted.json")
    for name in ("vertices", "edges", "control_points", "radius"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


def test_a_mesh_is_read_in_the_chosen_unit(tab: Any, tmp_path: Path) -> None:
    lines = [f"vertex {x} {y} {z}" for x, y, z in ((0, 0, 0), (0.03, 0, 0), (0, 0.04, 0.005))]
    text = "\n".join(["solid a", "facet normal 0 0 0", "outer loop", *lines, "endloop", "endfacet", "endsolid a"])
    (tmp_path / "corner.stl").write_text(text)
    ops.import_frame(filepath=str(tmp_path / "corner.stl"), unit="m")
    np.testing.assert_allclose(np.ptp(wireframe_from_curve(tab.plan).vertices, axis=0), [30.0, 40.0, 5.0], rtol=1e-6)


def test_a_file_that_states_its_unit_has_the_last_word(tab: Any, tmp_path: Path) -> None:
    frame = {"vertices": [[0, 0, 0], [1, 0, 2]], "edges": [[0, 1]], "radius": 0.1, "unit": "in"}
    (tmp_path / "inches.json").write_text(json.dumps({"format": "frametwin-frame", "version": 1, **frame}))
    before = cases.scene_state()
    words = cases.refused(ops.import_frame, filepath=str(tmp_path / "inches.json"), unit="m")
    assert "inches.json: unit: is in by the file itself" in words and cases.scene_state() == before
    for unit in ("file", "in"):
        ops.import_frame(filepath=str(tmp_path / "inches.json"), unit=unit)
        np.testing.assert_allclose(wireframe_from_curve(tab.plan).vertices[1], [25.4, 0.0, 50.8])


def test_the_dialog_tells_what_a_file_is(tab: Any, tmp_path: Path) -> None:
    told = cases.addon("file_formats").told
    write_frame(tmp_path / "plan.obj", named_frame("bridge"))
    write_frame(tmp_path / "plan.json", named_frame("bridge"))
    frame = json.loads((tmp_path / "plan.json").read_text())
    (tmp_path / "inches.json").write_text(json.dumps({**frame, "unit": "in"}))
    (tmp_path / "graph.json").write_text(
        '{"attributes": {"unit": "m"}, "node": {"0": {}}, "edge": {}, "dtype": "x/Graph"}'
    )
    (tmp_path / "cut.json").write_text('{"edges": [')
    (tmp_path / "notes.pdf").write_text("words")
    assert told(tmp_path / "plan.obj") == "OBJ: lines become struts; in mm unless you say otherwise"
    assert told(tmp_path / "plan.json") == "Frame; in mm unless you say otherwise"
    assert told(tmp_path / "inches.json") == "Frame; in in by the file itself"
    assert told(tmp_path / "cut.json") and "no frame" in told(tmp_path / "notes.pdf")
    assert told(tmp_path / "nowhere.json") == told(tmp_path) == ""


def test_lines_are_written_in_the_chosen_unit(tab: Any, rich_frame: Any, tmp_path: Path) -> None:
    twin = shifted(rich_frame, [0.0, 0.0, 2.0])
    tab.twin = show_twin(twin, rich_frame).collection
    ops.export_twin(filepath=str(tmp_path / "found.json"))
    ops.export_twin(filepath=str(tmp_path / "twin.obj"), unit="m")
    ops.export_twin(filepath=str(tmp_path / "same.json"), unit="m")  # frame files are always in mm
    assert (tmp_path / "same.json").read_text() == (tmp_path / "found.json").read_text()
    convert(tmp_path / "found.json", tmp_path / "wanted.obj", "--scale", 0.001)
    lines, wanted = ((tmp_path / name).read_text().splitlines() for name in ("twin.obj", "wanted.obj"))
    assert [line for line in lines if line[0] in "vl"] == [line for line in wanted if line[0] in "vl"]
    assert ", m, z up" in lines[0]
    ops.import_frame(filepath=str(tmp_path / "twin.obj"), unit="m")
    back = wireframe_from_curve(tab.plan)
    np.testing.assert_allclose(back.vertices[: len(twin.vertices)].max(axis=0), twin.vertices.max(axis=0), rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "chosen", "wanted"),
    [
        ("twin.json", ".csv", "twin.csv"),
        ("twin.csv", None, "twin.csv"),
        ("twin", None, "twin.json"),
        ("twin.v2", ".obj", "twin.v2.obj"),
    ],
)
def test_the_suffix_follows_the_format(extension: str, given: str, chosen: str | None, wanted: str) -> None:
    export = cases.addon("file_formats").FrameExport
    properties = SimpleNamespace(is_property_set=lambda name: chosen is not None)
    operator = SimpleNamespace(filepath=f"/tmp/{given}", format=chosen or ".json", properties=properties)
    assert export.check(operator, bpy.context) == (given != wanted)
    assert operator.filepath == str(Path(f"/tmp/{wanted}"))
