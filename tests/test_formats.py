"""Readers and writers of wireframes: round trips, other programs' dialects, real frames."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.formats import find_frame, foreign_unit, read_frame, write_frame
from frametwin.formats.rl3dp import read_pair
from frametwin.geometry.parametric import arched_bridge
from frametwin.geometry.wireframe import Wireframe

FIELDS = ("vertices", "edges", "control_points", "radius", "printed", "grounded", "batch")


def assert_same(a: Wireframe, b: Wireframe) -> None:
    for name in FIELDS:
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


def assembly(**changes: Any) -> dict[str, Any]:
    """The older dialect: a tripod, without node ids."""
    points = [(0, 0, 0), (60, 0, 0), (30, 50, 0), (30, 20, 40)]
    return {
        "model_name": "tripod",
        "unit": "millimeter",
        "node_list": [
            {"point": {"X": float(x), "Y": float(y), "Z": float(z)}, "is_grounded": int(z == 0)} for x, y, z in points
        ],
        "element_list": [{"end_node_ids": [i, 3], "layer_id": layer} for i, layer in enumerate((7, -1, 7))],
        **changes,
    }


def write(path: Path, content: Any) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


# --- real frames


@pytest.mark.parametrize(
    ("file", "vertices", "struts"),
    [
        ("rl3dp/NodeFemur_wireframe.txt", 263, 772),
        ("rl3dp/EdgeCoral_wireframe.txt", 785, 2322),
        ("rl3dp/NodeLounge_wireframe.txt", 1390, 4164),
        ("rl3dp/EdgeBunny_wireframe.txt", 1155, 3382),
        ("assembly_instances/bunny_full_tri_dense.json", 246, 732),
        ("assembly_instances/fertility.json", 249, 765),
        ("assembly_instances/klein_bottle_S1.5.json", 126, 246),
        ("assembly_instances/mars_bubble_S1_03-14-2019_w_layer.json", 97, 225),
        ("assembly_instances/simple_frame.json", 12, 19),
        ("assembly_instances/topopt-310_S1_03-14-2019_w_layer.json", 160, 310),
        ("sequences/conmech_four-frame.json", 5, 4),
    ],
)
def test_real_frames(shared_frames: Path, tmp_path: Path, file: str, vertices: int, struts: int) -> None:
    frame = read_frame(shared_frames / file)
    assert (frame.vertex_count, frame.strut_count) == (vertices, struts)
    assert frame.grounded.any() and not frame.grounded.all()
    assert frame.components()[0] == 1
    write_frame(tmp_path / "frame.json", frame)
    assert_same(read_frame(tmp_path / "frame.json"), frame)


def test_every_assembly_instance_is_readable(shared_frames: Path) -> None:
    files = sorted((shared_frames / "assembly_instances").glob("*.json"))
    assert files
    for file in files:
        data = json.loads(file.read_text())
        frame = read_frame(file)
        assert frame.grounded.sum() == sum(bool(node["is_grounded"]) for node in data["node_list"])
        node = data["node_list"][7]["point"]
        assert frame.vertices[7].tolist() == [node["X"], node["Y"], node["Z"]]
        assert np.array_equal(np.sort(frame.batch), np.sort(np.unique(frame.batch)[frame.batch]))  # ranks
        np.testing.assert_allclose(frame.radius, 1.5, rtol=1e-6)  # as a remark in the files says


def test_known_oddities_of_real_frames(shared_frames: Path) -> None:
    femur = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    assert femur.name == "Femur"
    assert femur.vertices[:, 2].min() < 0.0 and femur.grounded.sum() == 14  # a loose base
    topopt = read_frame(shared_frames / "assembly_instances" / "topopt-310_S1_03-14-2019_w_layer.json")
    assert (topopt.degree == 1).any() and topopt.lengths.max() == pytest.approx(250.0)
    four = read_frame(shared_frames / "sequences" / "conmech_four-frame.json")
    assert four.vertices[4].tolist() == [0.0, 0.0, 20.0]  # 0.02 m
    np.testing.assert_allclose(four.radius, 1.5, rtol=1e-9)  # a round section of 7.0686e-6 m2


def test_control_points_without_lines_are_refused_in_words(shared_frames: Path) -> None:
    with pytest.raises(InputError, match="neither lines nor faces.*control points.*'l' line"):
        read_frame(shared_frames / "curved" / "fab3dwire_bunny_controls.obj")


def test_files_of_real_data_that_are_no_frames(shared_frames: Path) -> None:
    others = [file for file in (shared_frames / "sequences").iterdir() if file.name != "conmech_four-frame.json"]
    assert others
    for file in others:
        with pytest.raises(InputError, match=file.name):
            read_frame(file)


# --- frame.json


def test_frame_json_keeps_everything(tmp_path: Path, curved_frame: Wireframe) -> None:
    rng = np.random.default_rng(0)
    e, v = curved_frame.strut_count, curved_frame.vertex_count
    frame = curved_frame.replace(
        radius=rng.random(e) + 0.1,
        printed=rng.random(e) < 0.5,
        grounded=rng.random(v) < 0.5,
        batch=rng.integers(-3, 9, e),
        name="Brücke 1",
    )
    write_frame(tmp_path / "a.json", frame)
    back = read_frame(tmp_path / "a.json")
    assert_same(back, frame)
    assert back.name == "Brücke 1"


def test_frame_json_leaves_defaults_out(tmp_path: Path, straight_frame: Wireframe) -> None:
    write_frame(tmp_path / "frame.json", straight_frame)
    data = json.loads((tmp_path / "frame.json").read_text())
    assert set(data) == {"format", "version", "name", "vertices", "edges", "radius", "grounded"}
    assert (data["format"], data["version"], data["radius"]) == ("frametwin-frame", 1, 1.0)
    assert_same(read_frame(tmp_path), straight_frame)  # a folder with a frame.json will do


def test_frame_json_by_hand(tmp_path: Path) -> None:
    minimal = {
        "format": "frametwin-frame",
        "version": 1,
        "vertices": [[0, 0, 0], [0, 0, 50]],
        "edges": [[1, 0]],
        "radius": 2,
        "comment": "by hand",
    }
    frame = read_frame(write(tmp_path / "post.json", minimal))
    assert frame.name == "post" and frame.grounded.tolist() == [True, False]
    assert frame.control_points[0, :, 2].tolist() == pytest.approx([50, 100 / 3, 50 / 3, 0])
    for key in ("format", "version", "vertices", "edges", "radius"):
        data = {name: value for name, value in minimal.items() if name != key}
        with pytest.raises(InputError, match=f"post.json: {key}: "):
            read_frame(write(tmp_path / "post.json", data))
    with pytest.raises(InputError, match="post.json: groundd: .*'grounded'"):
        read_frame(write(tmp_path / "post.json", {**minimal, "groundd": [True, False]}))
    with pytest.raises(InputError, match="post.json: printed: is null"):
        read_frame(write(tmp_path / "post.json", {**minimal, "printed": None}))


POST = {
    "format": "frametwin-frame",
    "version": 1,
    "vertices": [[0, 0, 0], [0, 0, 2]],
    "edges": [[0, 1]],
    "radius": 0.05,
    "control_points": [[[0, 0, 0], [0.5, 0, 1], [0.5, 0, 1.5], [0, 0, 2]]],
}


@pytest.mark.parametrize(
    ("unit", "height", "radius", "bow"),
    [("mm", 2.0, 0.05, 0.5), ("cm", 20.0, 0.5, 5.0), ("m", 2000.0, 50.0, 500.0), ("in", 50.8, 1.27, 12.7)],
)
def test_a_frame_may_state_its_unit(tmp_path: Path, unit: str, height: float, radius: float, bow: float) -> None:
    path = write(tmp_path / "post.json", {**POST, "unit": unit})
    frame = read_frame(path)
    assert frame.vertices.tolist() == [[0.0, 0.0, 0.0], [0.0, 0.0, pytest.approx(height)]]
    assert frame.radius.tolist() == [pytest.approx(radius)]
    np.testing.assert_allclose(frame.control_points[0, :, 0], [0.0, bow, bow, 0.0])
    np.testing.assert_allclose(frame.control_points[0, :, 2], np.array([0.0, 0.5, 0.75, 1.0]) * height)
    assert foreign_unit(path) == (None if unit == "mm" else unit)
    write_frame(tmp_path / "back.json", frame)  # in mm
    assert "unit" not in json.loads((tmp_path / "back.json").read_text())
    assert_same(read_frame(tmp_path / "back.json"), frame)


def test_radii_of_single_struts_are_in_the_unit_too(tmp_path: Path) -> None:
    frame = read_frame(write(tmp_path / "post.json", {**POST, "unit": "in", "radius": [0.125]}))
    assert frame.radius.tolist() == [3.175]


@pytest.mark.parametrize("unit", ["ft", "MM", "", 25.4, ["mm"], True])
def test_a_unit_that_is_not_known_is_refused(tmp_path: Path, unit: Any) -> None:
    path = write(tmp_path / "post.json", {**POST, "unit": unit})
    for read in (read_frame, foreign_unit):
        with pytest.raises(InputError, match=r"post\.json: unit: .* is not known; write 'mm', 'cm', 'm' or 'in'\."):
            read(path)
    with pytest.raises(InputError, match=r"post\.json: unit: is null"):
        read_frame(write(path, {**POST, "unit": None}))


@pytest.mark.parametrize(
    ("changes", "fragment"),
    [
        ({"vertices": [[0, 0], [0, 2]]}, "vertices: is 2 x 2 where"),
        ({"vertices": "many"}, "vertices: does not hold numbers"),
        ({"radius": "thick"}, "radius: does not hold numbers"),
        ({"radius": [0.1, 0.2]}, "radius: "),
        ({"vertices": [[0, 0, 0], [0, 0, 1e12]]}, "vertices[1][2]: is too large"),
    ],
)
def test_damage_is_told_whatever_the_unit(tmp_path: Path, changes: dict, fragment: str) -> None:
    path = write(tmp_path / "post.json", {**POST, "unit": "m", **changes})
    with pytest.raises(InputError, match=re.escape(f"post.json: {fragment}")):
        read_frame(path)


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        ({"format": "frametwin-twin", "version": 1}, "digital twin"),
        ({"frames": [], "fl_x": 1.0}, "cameras"),
        ({"format": "frametwin-capture", "version": 1, "frames": []}, "cameras"),
        ({"plan": [[0, 1]]}, "without a frame"),
        ({"format": "frametwin-frame", "version": 2, "vertices": [], "edges": []}, "version"),
    ],
)
def test_json_of_another_kind(tmp_path: Path, content: dict, fragment: str) -> None:
    with pytest.raises(InputError, match=fragment):
        read_frame(write(tmp_path / "x.json", content))


# --- assembly and conmech


def test_assembly_without_node_ids(tmp_path: Path) -> None:
    frame = read_frame(write(tmp_path / "a.json", assembly()))
    assert frame.name == "tripod"
    assert frame.vertices[3].tolist() == [30.0, 20.0, 40.0]
    assert frame.edges.tolist() == [[0, 3], [1, 3], [2, 3]]
    assert frame.batch.tolist() == [1, 0, 1]
    assert frame.grounded.tolist() == [True, True, True, False]


def test_assembly_with_ids_that_are_no_indices(tmp_path: Path) -> None:
    data = assembly()
    for node, key in zip(data["node_list"], (40, 10, 30, 20), strict=True):
        node["node_id"] = key
    data["element_list"] = [{"end_node_ids": [40, 20]}, {"end_node_ids": [20, 30]}]
    frame = read_frame(write(tmp_path / "a.json", data))
    assert frame.edges.tolist() == [[0, 3], [3, 2]]
    assert frame.batch.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("unit", "scale"),
    [
        ("mm", 1.0),
        ("millimeter", 1.0),
        ("Millimetres", 1.0),
        ("meter", 1000.0),
        ("metre", 1000.0),
        ("inches", 25.4),
    ],
)
def test_units(tmp_path: Path, unit: str, scale: float) -> None:
    frame = read_frame(write(tmp_path / "a.json", assembly(unit=unit)))
    assert frame.vertices[1, 0] == 60.0 * scale


def test_newer_dialect(tmp_path: Path) -> None:
    data = {
        "unit": "meter",
        "nodes": [
            {"point": [0.0, 0.0, 0.0], "node_ind": 5, "is_grounded": True},
            {"point": [0.0, 0.1, 0.2], "node_ind": 6, "is_grounded": False},
        ],
        "elements": [{"end_node_inds": [6, 5], "layer_ind": -1}],
    }
    frame = read_frame(write(tmp_path / "post.json", data))
    assert frame.vertices[1].tolist() == [0.0, 100.0, 200.0]
    assert frame.edges.tolist() == [[1, 0]] and frame.name == "post" and frame.grounded.tolist() == [True, False]


def _changed(field: str, index: int, **change: Any) -> dict[str, Any]:
    data = assembly()
    data[field][index] = {**data[field][index], **change}
    return data


@pytest.mark.parametrize(
    ("data", "fragment"),
    [
        (assembly(unit="furlong"), "unit: 'furlong'"),
        (assembly(unit=None), "unit: is missing"),
        (assembly(unit=5), "unit: 5"),
        (assembly(node_list=None), "node_list: is missing"),
        (assembly(node_list=[1]), "node_list: is not a list of objects"),
        (assembly(element_list=[]), "edges: the frame holds no strut"),
        (_changed("node_list", 1, point={"X": 1.0, "Y": 2.0}), r"node_list\[1\].point"),
        (_changed("node_list", 1, point={"X": 1.0, "Y": 2.0, "Z": "3"}), r"node_list\[1\].point"),
        (_changed("node_list", 1, point={"X": 1.0, "Y": 2.0, "Z": 10**400}), r"node_list\[1\].point"),
        (_changed("node_list", 1, node_id=4), r"node_list\[0\].node_id: is missing"),
        (_changed("node_list", 2, is_grounded=2), r"node_list\[2\].is_grounded"),
        (_changed("element_list", 0, end_node_ids=[0, 9]), r"element_list\[0\].end_node_ids: names node 9"),
        (_changed("element_list", 0, end_node_ids=[0]), r"element_list\[0\].end_node_ids"),
        (_changed("element_list", 0, end_node_ids=[0, True]), r"element_list\[0\].end_node_ids"),
        (_changed("element_list", 0, end_node_ids=[1, 3]), r"edges\[1\]: .*repeats"),
        (_changed("element_list", 2, layer_id="top"), r"element_list\[2\].layer_id"),
        (
            assembly(material_properties={"cross_sec_area": 1.0, "cross_sec_area_unit": "acre"}),
            "cross_sec_area_unit: 'acre'",
        ),
        (
            assembly(material_properties={"cross_sec_area": -1.0, "cross_sec_area_unit": "mm2"}),
            "cross_sec_area: -1.0",
        ),
    ],
)
def test_damaged_assembly(tmp_path: Path, data: dict, fragment: str) -> None:
    with pytest.raises(InputError, match=f"a.json: (material_properties.)?{fragment}"):
        read_frame(write(tmp_path / "a.json", data))


def test_duplicate_node_ids(tmp_path: Path) -> None:
    data = assembly()
    for node in data["node_list"]:
        node["node_id"] = 1
    with pytest.raises(InputError, match=r"node_list\[1\].node_id: 1 is taken"):
        read_frame(write(tmp_path / "a.json", data))


# --- RL3DP pairs


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    node = write(tmp_path / "NodePost_wireframe.txt", "0 0 0\r\n10.5\t0 0 \r\n0 0 3e1\r\n\r\n")
    return node, write(tmp_path / "EdgePost_wireframe.txt", "0 1\n2 1")


def test_rl3dp_by_either_file_or_both(pair: tuple[Path, Path]) -> None:
    node, edge = pair
    frame = read_frame(node)
    assert frame.vertices.tolist() == [[0, 0, 0], [10.5, 0, 0], [0, 0, 30]]
    assert frame.edges.tolist() == [[0, 1], [2, 1]] and frame.name == "Post"
    for other in (edge, (node, edge), (edge, node), (str(edge), str(node))):
        assert_same(read_frame(other), frame)


def test_rl3dp_style_of_capitals(tmp_path: Path) -> None:
    write(tmp_path / "node_a.txt", "0 0 0\n1 0 0\n")
    write(tmp_path / "edge_a.txt", "0 1\n")
    assert read_frame(tmp_path / "edge_a.txt").name == "a"


@pytest.mark.parametrize(
    ("which", "content", "fragment"),
    [
        (0, "0 0 0\n1 0\n", "NodePost_wireframe.txt: line 2: has 2 values"),
        (0, "0 0 0\n1 0 x\n", "NodePost_wireframe.txt: line 2: "),
        (0, "0 0 0\n1 0 nan\n", "NodePost_wireframe.txt: line 2: .*finite"),
        (0, "", "NodePost_wireframe.txt: file: is empty"),
        (1, "0 1\n1 1.5\n", "EdgePost_wireframe.txt: line 2: "),
        (1, "0 1\n1 3\n", r"EdgePost_wireframe.txt: edges\[1\]: "),
        (1, "0 1\n1 99999999999999999999\n", "EdgePost_wireframe.txt: edges: "),
        (1, "0 1\n1 0\n", r"EdgePost_wireframe.txt: edges\[1\]: .*repeats"),
    ],
)
def test_damaged_rl3dp(pair: tuple[Path, Path], which: int, content: str, fragment: str) -> None:
    pair[which].write_text(content)
    with pytest.raises(InputError, match=fragment):
        read_frame(pair[0])


def test_rl3dp_without_its_other_half(pair: tuple[Path, Path], tmp_path: Path) -> None:
    pair[0].unlink()
    with pytest.raises(InputError, match="other half NodePost_wireframe.txt is missing"):
        read_frame(pair[1])
    with pytest.raises(InputError, match="not named"):
        read_pair(pair[1], pair[1])


# --- dispatch


def test_missing_and_unknown_files(tmp_path: Path, straight_frame: Wireframe) -> None:
    for name in ("a.json", "a.obj", "Nodea.txt", "a.stl"):
        with pytest.raises(InputError, match=f"{name}: file: the file does not exist"):
            read_frame(tmp_path / name)
    with pytest.raises(InputError, match="frame.json: file: the file does not exist"):
        read_frame(tmp_path)
    with pytest.raises(InputError, match="notes.txt: .*Node"):
        read_frame(write(tmp_path / "notes.txt", "hello"))
    with pytest.raises(InputError, match=r"a.stl: file: .*\.json or \.obj"):
        write_frame(tmp_path / "a.stl", straight_frame)
    assert not (tmp_path / "a.stl").exists()


def test_frames_are_found_by_path_before_they_are_by_name(tmp_path: Path, straight_frame: Wireframe) -> None:
    write_frame(tmp_path / "mine.json", straight_frame)
    assert find_frame("mine.json", tmp_path).strut_count == straight_frame.strut_count
    assert find_frame(str(tmp_path / "mine.json"), "elsewhere").strut_count == straight_frame.strut_count
    assert np.array_equal(find_frame("bridge", tmp_path).vertices, arched_bridge().vertices)
    (tmp_path / "bridge").mkdir()
    write_frame(tmp_path / "bridge" / "frame.json", straight_frame)
    assert find_frame("bridge", tmp_path).strut_count == straight_frame.strut_count
    with pytest.raises(InputError, match="castle: file: the file does not exist"):
        find_frame("castle", tmp_path)
