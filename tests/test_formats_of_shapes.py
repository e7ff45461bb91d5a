"""Frames from files that hold only a shape: OBJ and meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from frametwin.errors import InputError
from frametwin.formats import read_frame, write_frame
from frametwin.geometry.wireframe import Wireframe


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


# --- OBJ


def test_obj_round_trip_of_straight_struts(tmp_path: Path, straight_frame: Wireframe) -> None:
    frame = straight_frame.transformed([[1, 0.1, 0, 1 / 3], [0, 1, 0.2, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    write_frame(tmp_path / "a.obj", frame)
    back = read_frame(tmp_path / "a.obj")
    assert np.array_equal(back.vertices, frame.vertices) and np.array_equal(back.edges, frame.edges)
    assert back.is_straight


def test_obj_of_curved_struts_is_a_polyline(tmp_path: Path, curved_frame: Wireframe) -> None:
    write_frame(tmp_path / "a.obj", curved_frame)
    back = read_frame(tmp_path / "a.obj")
    assert back.strut_count == 16 * curved_frame.strut_count
    assert np.array_equal(back.vertices[: curved_frame.vertex_count], curved_frame.vertices)
    assert back.lengths.sum() == pytest.approx(curved_frame.lengths.sum(), rel=1e-3)


def test_obj_polylines_and_ways_to_count(tmp_path: Path) -> None:
    text = """# a comment
    o frame
    v 0 0 0 1.0
    v 10 0 0  # another
    v 10 10 0
    l 1/1 2/2 3
    v 10 10 0
    v 10 10 \\
      10
    l -2 -1
    f 1 2 3
    """
    frame = read_frame(write(tmp_path / "a.obj", text))
    assert frame.vertices.tolist() == [
        [0, 0, 0],
        [10, 0, 0],
        [10, 10, 0],
        [10, 10, 10],
    ]  # one place, one joint
    assert frame.edges.tolist() == [[0, 1], [1, 2], [2, 3]]  # the face is not asked


def test_obj_faces_give_each_side_once(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nf 1//1 2//1 3//1 4//1\nf 2 5 6 3\n"
    frame = read_frame(write(tmp_path / "quads.obj", text))
    assert frame.strut_count == 7  # no diagonals


@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        ("", "holds no vertices"),
        ("v 0 0 0\nv 1 0 0\n", "neither lines nor faces"),
        ("v 0 0 0\nv 1 0 0\ncstype bspline\ncurv 0 1 1 2\n", "free-form curves"),
        ("v 0 0\n", "line 1: "),
        ("v 0 0 nan\n", "line 1: "),
        ("v 0 0 0\nv 1 0 0\nl 1\n", "line 3: "),
        ("v 0 0 0\nv 1 0 0\nl 1 a\n", "line 3: "),
        ("v 0 0 0\nv 1 0 0\nl 1 3\n", "line 3: names vertex 3"),
        ("v 0 0 0\nv 1 0 0\nl 0 1\n", "line 3: names vertex 0"),
        ("v 0 0 0\nv 1 0 0\nl -3 1\n", "line 3: names vertex -3"),
        ("v 0 0 0\nv 1 0 0\nl 1 1\n", "line 3: .*without length"),
        ("v 0 0 0\nv 1 0 0\nv 0 0 0\nl 1 3\n", "line 4: .*without length"),
        ("v 0 0 0\nv 1 0 0\nl 1 2\nl 2 1\n", "line 4: repeats a strut of line 3"),
    ],
)
def test_damaged_obj(tmp_path: Path, text: str, fragment: str) -> None:
    with pytest.raises(InputError, match=f"a.obj: (file: .*)?{fragment}"):
        read_frame(write(tmp_path / "a.obj", text))


# --- meshes


@pytest.mark.parametrize("kind", ["stl", "ply", "off"])
def test_mesh_edges(tmp_path: Path, kind: str) -> None:
    mesh = trimesh.creation.icosahedron()
    mesh.apply_scale(50.0)
    mesh.export(tmp_path / f"ball.{kind}")
    frame = read_frame(tmp_path / f"ball.{kind}")
    assert (frame.vertex_count, frame.strut_count, frame.name) == (12, 30, "ball")
    np.testing.assert_allclose(frame.chord_lengths, mesh.edges_unique_length[0], rtol=1e-5)
    assert (frame.degree == 5).all()


def test_gltf_is_in_metres_with_y_up(tmp_path: Path) -> None:
    mesh = trimesh.creation.box(extents=[0.1, 0.3, 0.2])  # 0.3 m high
    mesh.export(tmp_path / "box.glb")
    frame = read_frame(tmp_path / "box.glb")
    np.testing.assert_allclose(np.ptp(frame.bounds, axis=0), [100.0, 200.0, 300.0], rtol=1e-6)
    assert frame.strut_count == 18  # the twelve sides and a diagonal on each face


def test_damaged_meshes(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"not a mesh at all")
    with pytest.raises(InputError, match="a.stl: file: "):
        read_frame(tmp_path / "a.stl")
    trimesh.PointCloud(np.random.default_rng(0).random((5, 3))).export(tmp_path / "points.ply")
    with pytest.raises(InputError, match=r"points.ply: file: holds no edges"):
        read_frame(tmp_path / "points.ply")
    (tmp_path / "a.step").write_text("ISO-10303-21;")
    with pytest.raises(InputError, match=r"a.step: file: '.step' is not a format"):
        read_frame(tmp_path / "a.step")
