"""Frames of any kind through files and back: what a format holds comes back as it was."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from strategies import frames, json_values

from frametwin.errors import InputError
from frametwin.files import dump_json, parse_json
from frametwin.formats import frame_json, read_frame, write_frame
from frametwin.formats.obj import CURVE_SEGMENTS
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import ARRAYS, Wireframe

DIALECTS = (
    ("node_list", "node_id", "element_list", "end_node_ids", "layer_id"),
    ("nodes", "node_ind", "elements", "end_node_inds", "layer_ind"),
)


def written(name: str, frame: Wireframe) -> Wireframe:
    """The frame after it went through a file of this name."""
    with tempfile.TemporaryDirectory() as folder:
        write_frame(Path(folder) / name, frame)
        return read_frame(Path(folder) / name)


def assert_same_bits(found: Wireframe, wanted: Wireframe, fields: tuple[str, ...] = ARRAYS) -> None:
    for field in fields:
        np.testing.assert_array_equal(getattr(found, field), getattr(wanted, field), err_msg=field)


@given(frames())
def test_frame_json_gives_back_every_bit_and_the_name(frame: Wireframe) -> None:
    found = written("a.json", frame)
    assert_same_bits(found, frame)
    assert found.name == frame.name


@given(frames(straight=True))
def test_frame_json_holds_no_control_points_where_struts_are_straight(frame: Wireframe) -> None:
    assert "control_points" not in frame_json.to_dict(frame)
    assert_same_bits(written("a.json", frame), frame)


@given(frames(straight=True))
def test_obj_gives_back_straight_struts(frame: Wireframe) -> None:
    assert_same_bits(written("a.obj", frame), frame, ("vertices", "edges", "control_points"))


@given(frames())
def test_obj_holds_bent_struts_as_polylines_on_their_curves(frame: Wireframe) -> None:
    found = written("a.obj", frame)
    np.testing.assert_array_equal(found.vertices[: frame.vertex_count], frame.vertices)
    u = np.linspace(0.0, 1.0, CURVE_SEGMENTS + 1)
    pieces = 0
    for (a, b), curve in zip(frame.edges.tolist(), frame.control_points, strict=True):
        start, *_, last = chain = walk(found, a, pieces)
        assert (start, last) == (a, b) and len(chain) in (2, len(u))
        if len(chain) > 2:
            np.testing.assert_allclose(found.vertices[chain], bezier.evaluate(curve, u), rtol=0, atol=1e-9)
        pieces += len(chain) - 1
    assert pieces == found.strut_count


def walk(frame: Wireframe, start: int, first: int) -> list[int]:
    """The vertices of a chain of struts that are joined end to end through vertices of no other strut."""
    chain, degree = [start, int(frame.edges[first, 1])], frame.degree
    assert frame.edges[first, 0] == start
    while len(chain) < CURVE_SEGMENTS + 1 and degree[chain[-1]] == 2 and first + len(chain) - 1 < frame.strut_count:
        a, b = (int(vertex) for vertex in frame.edges[first + len(chain) - 1])
        if a != chain[-1]:
            break
        chain.append(b)
    return chain


@given(frames(straight=True), st.data())
def test_rl3dp_pairs_hold_the_graph(frame: Wireframe, data: st.DataObject) -> None:
    between = data.draw(st.sampled_from([" ", ", ", "\t", "  "]))
    with tempfile.TemporaryDirectory() as folder:
        node, edge = Path(folder) / "Node_a.txt", Path(folder) / "Edge_a.txt"
        for path, rows in ((node, frame.vertices), (edge, frame.edges)):
            path.write_text("\n".join(between.join(map(repr, row)) for row in rows.tolist()) + "\n")
        for found in (read_frame(node), read_frame(edge), read_frame((edge, node))):
            assert_same_bits(found, frame, ("vertices", "edges", "control_points"))


@given(frames(straight=True), st.sampled_from(DIALECTS), st.permutations(range(100)))
def test_assemblies_hold_graph_ground_and_order_under_any_ids(
    frame: Wireframe, dialect: tuple[str, ...], ids: list[int]
) -> None:
    nodes, node_id, elements, ends, layer = dialect
    data: dict[str, Any] = {
        "unit": "millimeter",
        "model_name": frame.name,
        nodes: [
            {"point": dict(zip("XYZ", place, strict=True)), node_id: ids[i], "is_grounded": bool(frame.grounded[i])}
            for i, place in enumerate(frame.vertices.tolist())
        ],
        elements: [
            {ends: [ids[a], ids[b]], layer: batch}
            for (a, b), batch in zip(frame.edges.tolist(), frame.batch.tolist(), strict=True)
        ],
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.json"
        path.write_text(json.dumps(data), encoding="utf-8")
        found = read_frame(path)
    assert_same_bits(found, frame, ("vertices", "edges", "control_points", "grounded"))
    assert found.name == frame.name
    # Layers become ranks: the same struts together, in the same order.
    before, after = frame.batch, found.batch
    np.testing.assert_array_equal(np.sign(after[:, None] - after), np.sign(before[:, None] - before))
    assert set(after.tolist()) == set(range(len(set(before.tolist()))))


@given(st.dictionaries(st.text(max_size=6), json_values(), max_size=5))
def test_json_that_is_written_reads_back_as_it_was(data: dict[str, Any]) -> None:
    text = dump_json(data)
    assert json.loads(text) == data
    assert parse_json(text, "a.json") == data


SIZES = st.lists(st.integers(0, 3), min_size=1, max_size=4).map(tuple)


@given(
    st.one_of(
        npst.arrays(np.float64, SIZES, elements=st.floats(allow_nan=False, allow_infinity=False)),
        npst.arrays(st.sampled_from([np.int64, np.bool_, np.uint8, "U3"]), SIZES),
    )
)
def test_arrays_are_written_as_lists_are(array: np.ndarray) -> None:
    inside = {"a": array, "b": {"c": array}}
    assert dump_json(inside) == dump_json({"a": array.tolist(), "b": {"c": array.tolist()}})


def test_no_array_hides_a_number_that_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        dump_json({"a": np.array([[1.0, np.nan]])})


@given(frames(), st.sampled_from((*ARRAYS, "format", "version", "name")), json_values())
def test_any_value_in_any_field_of_a_frame_is_taken_or_refused_in_one_sentence(
    frame: Wireframe, field: str, value: object
) -> None:
    data = json.loads(dump_json(frame_json.to_dict(frame)))
    data[field] = value
    try:
        found = frame_json.parse(data, "a.json")
    except InputError as error:
        # Struts that join vertices which are no longer there are named themselves.
        named = ("vertices", "edges[") if field == "vertices" else (field,)
        assert str(error).startswith(tuple(f"a.json: {name}" for name in named)) and "\n" not in str(error)
    else:
        assert_same_bits(frame_json.parse(json.loads(dump_json(frame_json.to_dict(found))), "b.json"), found)
