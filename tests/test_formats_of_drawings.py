"""Frames from drawings, written by the programs' own libraries: DXF, Rhino models, and graphs of COMPAS."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.formats import foreign_unit, read_frame
from frametwin.formats.chains import merged
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe


def segments(frame: Wireframe) -> set[tuple[tuple[float, ...], ...]]:
    """The struts as pairs of places, to a nanometre."""
    ends = np.round(frame.vertices[frame.edges], 6) + 0.0
    return {tuple(sorted(map(tuple, pair))) for pair in ends.tolist()}


BRIDGE = named_frame("bridge")
LINES = BRIDGE.vertices[BRIDGE.edges]
"""(E, 2, 3) mm, every strut with ends of its own."""


# --- DXF


def drawing(unit: int = 4) -> Any:
    ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")
    return ezdxf.new("R2010", units=unit)


def saved(document: Any, tmp_path: Path) -> Path:
    document.saveas(tmp_path / "plan.dxf")
    return tmp_path / "plan.dxf"


@pytest.mark.parametrize(
    ("unit", "millimetres"), [(0, 1.0), (1, 25.4), (2, 304.8), (4, 1.0), (5, 10.0), (6, 1000.0), (14, 100.0)]
)
def test_dxf_lines_in_every_unit(tmp_path: Path, unit: int, millimetres: float) -> None:
    document = drawing(unit)
    for start, end in LINES / millimetres:
        document.modelspace().add_line(start, end)
    frame = read_frame(saved(document, tmp_path))
    assert (frame.vertex_count, frame.strut_count, frame.name) == (BRIDGE.vertex_count, BRIDGE.strut_count, "plan")
    np.testing.assert_allclose(frame.vertices[frame.edges], LINES, atol=1e-9)
    assert (foreign_unit(tmp_path / "plan.dxf") is None) == (millimetres == 1.0)


def test_dxf_polylines_splines_and_blocks(tmp_path: Path) -> None:
    document = drawing()
    space = document.modelspace()
    space.add_lwpolyline([(0, 0), (10, 0), (10, 10)], close=True, dxfattribs={"elevation": 5.0})
    space.add_polyline3d([(0, 0, 5), (0, 0, 15), (0, 10, 15)])
    space.add_polyline2d([(20, 0), (30, 0)])
    space.add_open_spline([(40, 0, 0), (50, 0, 0), (50, 10, 0)], degree=1)
    space.add_open_spline([(0, 40, 0), (10, 40, 0), (15, 40, 0), (60, 40, 0)], degree=3)  # goes straight on
    block = document.blocks.new("leg")
    block.add_line((0, 0, 0), (0, 0, 1))
    document.blocks.new("pair").add_blockref("leg", (1, 0, 0))
    space.add_blockref("pair", (100, 0, 0), dxfattribs={"xscale": 2.0, "yscale": 2.0, "zscale": 3.0})
    space.add_blockref("leg", (200, 0, 0), dxfattribs={"column_count": 3, "column_spacing": 10.0})
    space.add_text("a name")
    space.add_point((7, 7, 7))
    assert segments(read_frame(saved(document, tmp_path))) == {
        ((0, 0, 5), (10, 0, 5)), ((10, 0, 5), (10, 10, 5)), ((0, 0, 5), (10, 10, 5)),
        ((0, 0, 5), (0, 0, 15)), ((0, 0, 15), (0, 10, 15)),
        ((20, 0, 0), (30, 0, 0)), ((40, 0, 0), (50, 0, 0)), ((50, 0, 0), (50, 10, 0)), ((0, 40, 0), (60, 40, 0)),
        ((102, 0, 0), (102, 0, 3)),
        ((200, 0, 0), (200, 0, 1)), ((210, 0, 0), (210, 0, 1)), ((220, 0, 0), (220, 0, 1)),
    }  # fmt: skip


def test_dxf_in_the_axes_of_an_object(tmp_path: Path) -> None:
    """A flat polyline that stands upright: its own axes follow from its extrusion direction."""
    document = drawing()
    document.modelspace().add_lwpolyline([(0, 0), (10, 0), (10, 20)], dxfattribs={"extrusion": (0, -1, 0)})
    assert segments(read_frame(saved(document, tmp_path))) == {
        ((0, 0, 0), (10, 0, 0)), ((10, 0, 0), (10, 0, 20))
    }  # fmt: skip


def test_dxf_what_is_hidden_does_not_count(tmp_path: Path) -> None:
    document = drawing()
    for name in ("off", "frozen", "shown"):
        document.layers.add(name)
        document.modelspace().add_line((0, 0, 0), (0, 0, len(name)), dxfattribs={"layer": name})
    document.layers.get("off").off()
    document.layers.get("frozen").freeze()
    assert segments(read_frame(saved(document, tmp_path))) == {((0, 0, 0), (0, 0, 5))}


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda space: space.add_arc((0, 0), 5, 0, 90, dxfattribs={"layer": "walls"}), "ARC .* on layer walls: is a c"),
        (lambda space: space.add_circle((0, 0), 5), "CIRCLE"),
        (lambda space: space.add_lwpolyline([(0, 0, 0, 0, 0.5), (1, 0)]), "LWPOLYLINE .*curved pieces"),
        (lambda space: space.add_open_spline([(0, 0), (1, 1), (2, 0), (3, 5)]), "SPLINE .*curved pieces"),
        (lambda space: space.add_spline([(0, 0), (1, 1), (2, 0)]), "SPLINE .*curved pieces"),
        (lambda space: space.add_line((1, 1), (1, 1)), "LINE .*has no length"),
        (lambda space: [space.add_line((0, 0), (1, 1)), space.add_line((1, 1), (0, 0))], "repeats a strut of LINE"),
        (lambda space: space.add_text("a name"), "holds no lines or polylines that can be seen, but TEXT"),
        (lambda space: space.add_lwpolyline([(1, 1)]), "fewer than two points"),
        (lambda space: space.doc.header.__setitem__("$INSUNITS", 20), "INSUNITS: 20 is no unit"),
        (lambda space: space.add_line((0, 0), (float("nan"), 1)), "not finite"),
    ],
)
def test_dxf_that_is_no_frame(tmp_path: Path, draw: Callable[[Any], Any], message: str) -> None:
    document = drawing()
    draw(document.modelspace())
    with pytest.raises(InputError, match=message) as refused:
        read_frame(saved(document, tmp_path))
    assert "\n" not in str(refused.value)


def test_dxf_blocks_without_end_are_refused(tmp_path: Path) -> None:
    document = drawing()
    inner = document.blocks.new("b0")
    for k in range(10):
        inner.add_line((k, 0, 0), (k, 0, 1))
    for level in range(1, 8):
        block = document.blocks.new(f"b{level}")
        for k in range(10):
            block.add_blockref(f"b{level - 1}", (k * 10**level, 0, 0))
    document.modelspace().add_blockref("b1", (0, 0, 0))
    assert read_frame(saved(document, tmp_path)).strut_count == 100
    document.blocks.new("loop").add_blockref("loop", (1, 0, 0))
    document.modelspace().add_blockref("loop", (0, 0, 0))
    with pytest.raises(InputError, match="more than 32 blocks"):
        read_frame(saved(document, tmp_path))


def test_damaged_dxf_ends_in_a_sentence(tmp_path: Path) -> None:
    document = drawing()
    for start, end in LINES[:20]:
        document.modelspace().add_line(start, end)
    data = saved(document, tmp_path).read_bytes()
    for keep in (0, 1, 100, len(data) // 3, len(data) - 30):
        (tmp_path / "cut.dxf").write_bytes(data[:keep])
        with pytest.raises(InputError, match="cut.dxf") as refused:
            read_frame(tmp_path / "cut.dxf")
        assert "\n" not in str(refused.value)
    (tmp_path / "odd.dxf").write_bytes(bytes(range(256)) * 10)
    with pytest.raises(InputError, match="cannot be read as DXF"):
        read_frame(tmp_path / "odd.dxf")


# --- Rhino


def model(unit: str = "Millimeters") -> tuple[Any, Any]:
    rhino3dm = pytest.importorskip("rhino3dm", reason="rhino3dm is not installed")
    file = rhino3dm.File3dm()
    file.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit)
    return rhino3dm, file


def written(file: Any, tmp_path: Path) -> Path:
    assert file.Write(str(tmp_path / "plan.3dm"), 7)
    return tmp_path / "plan.3dm"


def points(rhino: Any, *places: Any) -> list[Any]:
    return [rhino.Point3d(*map(float, place)) for place in places]


@pytest.mark.parametrize(
    ("unit", "millimetres"), [("Millimeters", 1.0), ("Centimeters", 10.0), ("Meters", 1000.0), ("Inches", 25.4)]
)
def test_rhino_lines_in_every_unit(tmp_path: Path, unit: str, millimetres: float) -> None:
    rhino, file = model(unit)
    file.Settings.ModelAbsoluteTolerance = 0.001 / millimetres
    for pair in LINES / millimetres:
        file.Objects.AddLine(*points(rhino, *pair))
    frame = read_frame(written(file, tmp_path))
    assert (frame.vertex_count, frame.strut_count, frame.name) == (BRIDGE.vertex_count, BRIDGE.strut_count, "plan")
    np.testing.assert_allclose(frame.vertices[frame.edges], LINES, atol=1e-9)
    assert (foreign_unit(tmp_path / "plan.3dm") is None) == (millimetres == 1.0)


def test_rhino_curves_that_are_straight(tmp_path: Path) -> None:
    rhino, file = model()
    file.Objects.AddPolyline(rhino.Polyline(points(rhino, (0, 0, 0), (10, 0, 0), (10, 0, 9))))
    file.Objects.AddCurve(rhino.NurbsCurve.Create(False, 1, points(rhino, (0, 20, 0), (10, 20, 0), (10, 20, 9))))
    file.Objects.AddCurve(rhino.NurbsCurve.Create(False, 3, points(rhino, *[(0, 0, 3 * i + 20) for i in range(5)])))
    joined = rhino.PolyCurve()
    for pair in (((50, 0, 0), (50, 0, 5)), ((50, 0, 5), (55, 0, 5))):
        joined.Append(rhino.LineCurve(*points(rhino, *pair)))
    file.Objects.AddCurve(joined)
    file.Objects.AddPoint(rhino.Point3d(1, 2, 3))
    assert segments(read_frame(written(file, tmp_path))) == {
        ((0, 0, 0), (10, 0, 0)), ((10, 0, 0), (10, 0, 9)), ((0, 20, 0), (10, 20, 0)), ((10, 20, 0), (10, 20, 9)),
        ((0, 0, 20), (0, 0, 32)), ((50, 0, 0), (50, 0, 5)), ((50, 0, 5), (55, 0, 5)),
    }  # fmt: skip


def test_rhino_blocks_and_what_is_hidden(tmp_path: Path) -> None:
    rhino, file = model()
    leg = rhino.LineCurve(*points(rhino, (0, 0, 0), (0, 0, 1)))
    plain = (rhino.ObjectAttributes(),)
    number = file.InstanceDefinitions.Add("leg", "", "", "", rhino.Point3d(0, 0, 0), (leg,), plain)
    placed = rhino.Transform.Multiply(
        rhino.Transform.Translation(10, 20, 30), rhino.Transform.Scale(rhino.Point3d(0, 0, 0), 4.0)
    )
    file.Objects.AddInstanceObject(rhino.InstanceReference(file.InstanceDefinitions.FindIndex(number).Id, placed))
    hidden = rhino.ObjectAttributes()
    for name, seen in (("Default", True), ("helpers", False)):
        layer = rhino.Layer()
        layer.Name, layer.Visible = name, seen
        hidden.LayerIndex = file.Layers.Add(layer)
    file.Objects.AddLine(*points(rhino, (0, 0, 0), (5, 5, 5)), hidden)
    off = rhino.ObjectAttributes()
    off.Visible = False
    file.Objects.AddCurve(rhino.LineCurve(*points(rhino, (0, 0, 0), (5, 5, 6))), off)
    assert segments(read_frame(written(file, tmp_path))) == {((10, 20, 30), (10, 20, 34))}


def arc(rhino: Any, file: Any) -> None:
    attributes = rhino.ObjectAttributes()
    attributes.Name = "rib 7"
    curve = rhino.NurbsCurve.CreateFromArc(rhino.Arc(rhino.Point3d(0, 0, 0), 20.0, 1.0))
    file.Objects.AddCurve(curve, attributes)


def tolerant_arc(rhino: Any, file: Any) -> None:
    """A bend that a tolerance as large as the drawing would take for a line."""
    file.Settings.ModelAbsoluteTolerance = 100.0
    arc(rhino, file)


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (tolerant_arc, "rib 7 .*is a curve, and struts of a plan are straight"),
        (arc, "rib 7 .*is a curve, and struts of a plan are straight"),
        (lambda rhino, file: file.Objects.AddPoint(rhino.Point3d(1, 2, 3)), "holds no lines .*but Point"),
        (
            lambda rhino, file: [file.Objects.AddLine(*points(rhino, (0, 0, 0), (1, 0, 9))) for _ in range(2)],
            "repeats a strut of LineCurve",
        ),
        (
            lambda rhino, file: file.Settings.__setattr__("ModelUnitSystem", rhino.UnitSystem.Parsecs),
            "Parsecs are no unit for prints",
        ),
    ],
)
def test_rhino_models_that_are_no_frame(tmp_path: Path, draw: Callable[[Any, Any], Any], message: str) -> None:
    rhino, file = model()
    draw(rhino, file)
    with pytest.raises(InputError, match=message):
        read_frame(written(file, tmp_path))


def test_damaged_rhino_models_end_in_a_sentence(tmp_path: Path) -> None:
    rhino, file = model()
    for pair in LINES[:20]:
        file.Objects.AddLine(*points(rhino, *pair))
    data = written(file, tmp_path).read_bytes()
    for keep in (0, 10, 400):
        (tmp_path / "cut.3dm").write_bytes(data[:keep])
        with pytest.raises(InputError, match="cut.3dm: file: "):
            read_frame(tmp_path / "cut.3dm")


# --- what both share


def test_ends_that_rounding_moved_apart_are_one_joint_and_others_are_not(tmp_path: Path) -> None:
    extent = float(np.ptp(BRIDGE.vertices, axis=0).max())
    rng = np.random.default_rng(3)
    for share, joined in ((2e-7, True), (1e-4, False)):
        document = drawing()
        for start, end in LINES + rng.uniform(-share, share, LINES.shape) * extent:
            document.modelspace().add_line(start, end)
        frame = read_frame(saved(document, tmp_path))
        assert (frame.vertex_count == BRIDGE.vertex_count) == joined
        assert (frame.vertex_count > BRIDGE.vertex_count) == (not joined)


def test_a_models_own_tolerance_counts_up_to_a_limit(tmp_path: Path) -> None:
    rhino, file = model()
    file.Objects.AddLine(*points(rhino, (0, 0, 0), (100, 0, 0)))
    file.Objects.AddLine(*points(rhino, (100.004, 0, 0), (100, 0, 100)))
    for tolerance, joints in ((0.001, 4), (0.005, 3), (90.0, 3)):
        file.Settings.ModelAbsoluteTolerance = tolerance
        assert read_frame(written(file, tmp_path)).vertex_count == joints


def test_merging_agrees_with_comparing_all_pairs() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(0.0, 1.0, (40, 3))
    cloud = places[rng.integers(40, size=300)] + rng.normal(scale=1e-4, size=(300, 3))
    joints, joint = merged(cloud, 1e-3)
    apart = np.linalg.norm(cloud[:, None] - cloud[None], axis=2) < 1e-2  # the 40 places are farther apart than that
    assert np.array_equal(joint[:, None] == joint[None], apart)
    assert (np.linalg.norm(joints[joint] - cloud, axis=1) <= 1e-3).all()


@pytest.mark.parametrize(("module", "name"), [("ezdxf", "plan.dxf"), ("rhino3dm", "plan.3dm")])
def test_without_the_library_the_command_that_installs_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, name: str
) -> None:
    (tmp_path / name).write_bytes(b"anything")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=rf"needs {module}, .* pip install 'frametwin\[formats\]'"):
        read_frame(tmp_path / name)


# --- COMPAS


def graph_of_bridge() -> Any:
    datastructures = pytest.importorskip("compas.datastructures", reason="COMPAS is not installed")
    graph = datastructures.Graph(name="crossing")
    keys = [graph.add_node(f"n{i}" if i % 2 else i, x=x, y=y, z=z) for i, (x, y, z) in enumerate(BRIDGE.vertices)]
    for a, b in BRIDGE.edges.tolist():
        graph.add_edge(keys[a], keys[b])
    return graph


def dumped(graph: Any, path: Path) -> dict[str, Any]:
    import compas

    compas.json_dump(graph, path)
    return dict(json.loads(path.read_text()))


def test_compas_graph(tmp_path: Path) -> None:
    dumped(graph_of_bridge(), tmp_path / "graph.json")
    frame = read_frame(tmp_path / "graph.json")
    assert frame.name == "crossing" and np.array_equal(frame.vertices, BRIDGE.vertices)
    assert segments(frame) == segments(BRIDGE) and frame.strut_count == BRIDGE.strut_count
    assert foreign_unit(tmp_path / "graph.json") is None


def as_version_1(data: dict[str, Any]) -> dict[str, Any]:
    content = data["data"]
    content["dna"], content["dea"] = content.pop("default_node_attributes"), content.pop("default_edge_attributes")
    return {"dtype": "compas.datastructures/Network", "value": content}


@pytest.mark.parametrize(
    "change",
    [
        as_version_1,
        lambda data: {"compas": "0.18.0", "datatype": "compas.datastructures/Network", "data": data["data"]},
        lambda data: data["data"],
        lambda data: {"vertex": data["data"]["node"], "edge": data["data"]["edge"]},
    ],
)
def test_older_versions_of_compas(tmp_path: Path, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    data = change(dumped(graph_of_bridge(), tmp_path / "graph.json"))
    (tmp_path / "graph.json").write_text(json.dumps(data))
    frame = read_frame(tmp_path / "graph.json")
    assert np.array_equal(frame.vertices, BRIDGE.vertices) and segments(frame) == segments(BRIDGE)


def test_compas_both_ways_of_an_edge_defaults_and_units(tmp_path: Path) -> None:
    graph = graph_of_bridge()
    a, b = next(iter(graph.edges()))
    graph.add_edge(b, a)
    graph.attributes["unit"] = "m"
    data = dumped(graph, tmp_path / "graph.json")
    for node in data["data"]["node"].values():
        if node["z"] == 0.0:
            del node["z"]  # as its default
    (tmp_path / "graph.json").write_text(json.dumps(data))
    frame = read_frame(tmp_path / "graph.json")
    assert frame.strut_count == BRIDGE.strut_count and np.array_equal(frame.vertices, 1000.0 * BRIDGE.vertices)
    assert foreign_unit(tmp_path / "graph.json") == "m"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda data: data.update(dtype="compas.datastructures/Mesh"), "dtype"),
        (lambda data: data.update(data=[]), "data"),
        (lambda data: data["data"].update(node=[]), "node"),
        (lambda data: data["data"].update(edge=None), "edge"),
        (lambda data: data["data"]["node"]["0"].update(x="far"), "node.0"),
        (lambda data: data["data"]["node"]["0"].update(x=1e300), "node.0"),
        (lambda data: data["data"]["node"].update({"0": 7}), "node.0"),
        (lambda data: data["data"]["edge"]["0"].update({"99": {}}), "edge.0"),
        (lambda data: data["data"]["edge"]["0"].update({"0": {}}), "edge.0"),
        (lambda data: data["data"]["edge"].update({"0": []}), "edge.0"),
        (lambda data: data["data"]["attributes"].update(unit="furlong"), "attributes.unit"),
    ],
)
def test_damaged_graphs_are_refused(tmp_path: Path, change: Callable[[dict[str, Any]], None], field: str) -> None:
    data = dumped(graph_of_bridge(), tmp_path / "graph.json")
    change(data)
    (tmp_path / "graph.json").write_text(json.dumps(data))
    with pytest.raises(InputError) as refused:
        read_frame(tmp_path / "graph.json")
    assert refused.value.field == field
