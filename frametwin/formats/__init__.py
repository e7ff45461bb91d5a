"""Reading and writing wireframes in the formats of other programs and in FrameTwin's own.

======================  ======  =======  ==========================================================
format                  read    write    found by
======================  ======  =======  ==========================================================
frame.json              yes     yes      ``.json`` with ``"format": "frametwin-frame"``
assembly, conmech JSON  yes     no       ``.json`` with ``node_list`` or ``nodes``
COMPAS Graph, Network   yes     no       ``.json`` with ``"dtype": "compas.datastructures/Graph"``
RL3DP Node/Edge pair    yes     no       ``Node*.txt`` beside ``Edge*.txt`` (either, or both)
Wavefront OBJ           yes     yes      ``.obj``: ``l`` lines, otherwise the edges of its faces
Rhino model             yes     no       ``.3dm``: lines and polylines, by rhino3dm
DXF drawing             yes     no       ``.dxf``: lines and polylines, by ezdxf
meshes                  yes     no       ``.stl``, ``.ply``, ``.off``, ``.glb`` and what trimesh reads
======================  ======  =======  ==========================================================
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, parse_json, read_text
from frametwin.formats import assembly, compas_graph, dxf, frame_json, mesh, obj, rhino, rl3dp
from frametwin.geometry.parametric import FRAMES, named_frame
from frametwin.geometry.wireframe import Wireframe

__all__ = ["find_frame", "foreign_unit", "read_frame", "write_frame"]

_DRAWINGS: dict[str, Any] = {".dxf": dxf, ".3dm": rhino}
"""Readers of drawings by suffix; each has ``read`` and ``unit_of``, and needs a library of the extra ``formats``."""

_OWN_FILES = {
    "frametwin-twin": "is a digital twin, not a frame",
    "frametwin-capture": "holds the cameras of a capture, not a frame",
}


def read_frame(path: PathLike | tuple[PathLike, PathLike]) -> Wireframe:
    """Read a wireframe, whatever the format.

    Parameters
    ----------
    path
        A file of one of the formats above; a folder that holds a ``frame.json`` (a capture, a run); or a
        pair of RL3DP files in either order. Lengths come out in mm: files that state a unit are converted,
        the others (RL3DP, OBJ, STL ...) are taken to be in mm.

    Raises
    ------
    InputError
        If the file is missing or damaged, of no known format, or does not hold a valid frame.
    """
    if isinstance(path, tuple):
        return rl3dp.read_pair(*path)
    file = Path(path)
    if file.is_dir():
        file = file / "frame.json"
    suffix = file.suffix.lower()
    if not file.is_file():
        raise InputError.at(file, "file", "the file does not exist", "check the name, or put the file there")
    if suffix == ".obj":
        return obj.read(file)
    if suffix in (".json", ""):
        return _read_json(file)
    if suffix in _DRAWINGS:
        return _DRAWINGS[suffix].read(file)
    if rl3dp.is_name(file.name):
        return rl3dp.read_pair(file, rl3dp.sibling(file))
    if suffix in (".txt", ".csv", ".md"):
        raise InputError.at(
            file,
            "file",
            "is a text file of no known format",
            "give a .json, an .obj, a mesh, or a pair of files named Node*.txt and Edge*.txt",
        )
    return mesh.read(file)


def find_frame(name: str, folder: PathLike = "") -> Wireframe:
    """The frame in a file, or else one of the project's own by its name.

    Parameters
    ----------
    name
        A path for `read_frame`, or a name of `frametwin.geometry.parametric.FRAMES`. What exists as a file or folder
        goes first.
    folder
        Where a relative path begins; the working folder by default.

    Raises
    ------
    InputError
        If it is neither, and as `read_frame`.
    """
    path = Path(folder, name)
    return named_frame(name) if name in FRAMES and not path.exists() else read_frame(path)


def foreign_unit(path: PathLike) -> str | None:
    """The unit of length that a file states in its own words, where it is not the millimetre.

    `read_frame` converts such lengths.

    Raises
    ------
    InputError
        If the file is damaged, or its unit is not known.
    """
    file = Path(path) / "frame.json" if Path(path).is_dir() else Path(path)
    suffix = file.suffix.lower()
    if suffix in _DRAWINGS and file.is_file():
        unit, scale = _DRAWINGS[suffix].unit_of(file)
        return None if scale == 1.0 else unit
    if suffix != ".json" or not file.is_file():
        return None
    data = parse_json(read_text(file), file)
    if compas_graph.is_compas(data):
        return compas_graph.unit_of(data, file)
    if assembly.is_assembly(data):
        scale = assembly.millimetres(data.get("unit"), str(file), "unit")
    else:
        scale = frame_json.UNITS[frame_json.unit_of(data, file)]
    return None if scale == 1.0 else str(data["unit"])


def _read_json(path: Path) -> Wireframe:
    data = parse_json(read_text(path), path)
    if assembly.is_assembly(data):
        return assembly.parse(data, path)
    if compas_graph.is_compas(data):
        return compas_graph.parse(data, path)
    kind = data.get("format")
    if isinstance(kind, str) and kind in _OWN_FILES:
        raise InputError.at(path, "format", _OWN_FILES[kind], "give the frame.json that lies beside it")
    if "frames" in data and "vertices" not in data:
        raise InputError.at(path, "file", "holds cameras, not a frame", "give the frame.json that lies beside it")
    if kind is None and not {"vertices", "edges"} & set(data):
        raise InputError.at(
            path,
            "file",
            "is JSON without a frame in it",
            "give a frame.json, the nodes and elements of an assembly, or a graph of COMPAS",
        )
    return frame_json.parse(data, path)


def write_frame(path: PathLike, wireframe: Wireframe, curves: np.ndarray | None = None) -> None:
    """Write a wireframe; the suffix of ``path`` names the format: ``.json`` keeps everything, ``.obj`` the
    shape.

    Parameters
    ----------
    path
        The file.
    wireframe
        The frame.
    curves : (E, n + 1, 3) array, mm, optional
        Its struts by curves of a higher degree, such as `frametwin.twin.twin.Twin.curves`, for formats that can draw
        them: a ``.json`` has cubics alone, those of ``wireframe``.

    Raises
    ------
    InputError
        If the suffix is another one, or the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".json":
        frame_json.write(path, wireframe)
    elif suffix == ".obj":
        obj.write(path, wireframe, curves=curves)
    else:
        raise InputError.at(path, "file", f"frames are not written as '{suffix}'", "name it .json or .obj")
