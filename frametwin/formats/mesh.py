"""The edges of triangle meshes and of paths, through trimesh (imported when needed)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe

_MILLIMETRES = {
    "millimeters": 1.0,
    "mm": 1.0,
    "centimeters": 10.0,
    "cm": 10.0,
    "meters": 1000.0,
    "m": 1000.0,
    "inches": 25.4,
    "in": 25.4,
    "feet": 304.8,
    "ft": 304.8,
}
_Y_UP = (".glb", ".gltf")  # the standard prescribes it


def read(path: PathLike) -> Wireframe:
    """Read the edges of a mesh, each once, as struts.

    Polygons with more than three sides come out with the diagonals that the loader adds. Units that the file
    states are converted to mm; glTF (metres, y up) is turned so that z is up.

    Raises
    ------
    InputError
        If the file is missing, of a format that trimesh does not read here, damaged, or without edges.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError.at(path, "file", "the file does not exist", "check the name, or put the file there")
    try:
        import trimesh
    except ModuleNotFoundError as error:
        remedy = f"convert it elsewhere: frametwin convert {file.name} {file.stem}.json"
        problem = "is no frame file, and the package trimesh, which reads meshes, is not there"
        raise InputError.at(path, "file", problem, remedy) from error

    suffix = file.suffix.lower()
    if suffix[1:] not in trimesh.available_formats():
        raise InputError.at(
            path,
            "file",
            f"'{suffix}' is not a format that can be read",
            "give .json, .obj, .dxf, .3dm, .stl, .ply, .off or .glb",
        )
    try:
        scene = trimesh.load_scene(file, process=True)
    except Exception as error:  # the loaders raise whatever their parsers meet
        raise InputError.at(
            path,
            "file",
            f"cannot be read as a mesh ({type(error).__name__}: {error})",
            "export the mesh again",
        ) from error
    vertices, edges = _scene_edges(scene)
    if len(edges) == 0:
        raise InputError.at(path, "file", "holds no edges", "give a mesh with faces, or lines")
    vertices = vertices * _MILLIMETRES.get(str(scene.units).lower(), 1.0)
    if suffix in _Y_UP:
        vertices = vertices[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
    return Wireframe.create(vertices, edges, name=file.stem, source=str(path))


def _scene_edges(scene: Any) -> tuple[np.ndarray, np.ndarray]:
    """Collect vertices (V, 3) and distinct edges (E, 2) of all geometry of a scene, in world coordinates."""
    vertices: list[np.ndarray] = [np.zeros((0, 3))]
    edges: list[np.ndarray] = [np.zeros((0, 2), dtype=np.int64)]
    count = 0
    for geometry in scene.dump():
        points = np.asarray(geometry.vertices, dtype=np.float64)
        if hasattr(geometry, "edges_unique"):
            pairs = np.asarray(geometry.edges_unique, dtype=np.int64)
        elif hasattr(geometry, "entities"):
            chains = [np.asarray(entity.points) for entity in geometry.entities]
            pairs = np.concatenate([np.column_stack([chain[:-1], chain[1:]]) for chain in chains])
        else:
            continue  # a cloud of points
        if points.shape[1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        vertices.append(points)
        edges.append(pairs + count)
        count += len(points)
    return _tidy(np.concatenate(vertices), np.concatenate(edges))


def _tidy(vertices: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices at the same place; drop edges without length, repeated edges and unused vertices."""
    if len(edges) == 0:
        return vertices, edges
    places, group = np.unique(vertices, axis=0, return_inverse=True)
    pairs = np.sort(group.ravel()[edges], axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    used, pairs = np.unique(pairs, return_inverse=True)
    return places[used], pairs.reshape(-1, 2)
