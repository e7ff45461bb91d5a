"""Format and unit in file dialogs: what a chosen file is, and as what one is written."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from frametwin.errors import InputError
from frametwin.files import read_json
from frametwin.formats import assembly, compas_graph, foreign_unit
from frametwin.formats.frame_json import UNITS
from frametwin.formats.units import taken_in
from frametwin.geometry.wireframe import Wireframe

from .steps import SaveStep, write_text

NAMES = {"mm": "Millimetres", "cm": "Centimetres", "m": "Metres", "in": "Inches"}

OF_FILE = "file"
UNIT_ITEMS = tuple((unit, NAMES[unit], f"A unit is {millimetres:g} mm") for unit, millimetres in UNITS.items())
READ_UNITS = ((OF_FILE, "As the File Says", "Millimetres where the file does not say"), *UNIT_ITEMS)

FORMATS = (
    (".json", "Frame (.json)", "frame.json: everything, in mm"),
    (".obj", "Lines (.obj)", "OBJ: the shape alone"),
    (".csv", "Table (.csv)", "CSV: a row for every strut, a column for every quantity"),
)

KINDS = {
    ".obj": "OBJ: lines become struts",
    ".txt": "RL3DP: a pair of Node and Edge files",
    ".dxf": "DXF drawing: lines become struts",
    ".3dm": "Rhino model: curves become struts",
    **dict.fromkeys((".stl", ".ply", ".off", ".glb", ".gltf"), "Mesh: edges become struts"),
}

LARGEST = 5_000_000
"""Bytes of a file that is looked into while the dialog is open."""


def in_mm(frame: Wireframe, unit: str, path: Path) -> Wireframe:
    """A frame as read from a file, in the unit that the dialog says.

    Raises
    ------
    InputError
        If the file states another unit.
    """
    return frame if unit == OF_FILE else taken_in(frame, unit, path)


_told: dict[tuple[str, float], str] = {}
"""What was found in the last file that was chosen: a dialog is drawn again and again."""


def told(path: Path) -> str:
    """What a chosen file is and which unit it states, in words; empty where nothing is chosen."""
    if not path.is_file():
        return ""
    key = str(path), path.stat().st_mtime
    if key not in _told:
        _told.clear()
        _told[key] = _look(path)
    return _told[key]


def _look(path: Path) -> str:
    if path.stat().st_size > LARGEST:
        return f"{path.suffix.lstrip('.').upper()} of {path.stat().st_size / 1e6:.0f} MB"
    try:
        kind = _json_kind(path) if path.suffix.lower() == ".json" else KINDS.get(path.suffix.lower(), "")
        stated = foreign_unit(path)
    except InputError as error:
        return str(error.problem or error)
    unit = f"in {stated} by the file itself" if stated else "in mm unless you say otherwise"
    return f"{kind}; {unit}" if kind else "A kind of file that holds no frame"


def _json_kind(path: Path) -> str:
    data = read_json(path)
    if assembly.is_assembly(data):
        return "Assembly of nodes and elements"
    if compas_graph.is_compas(data):
        return "COMPAS graph or network"
    return "Frame" if "edges" in data else ""


class FrameExport(SaveStep):
    """A `SaveStep` whose dialog asks for format and unit; without a dialog the suffix names the format."""

    if TYPE_CHECKING:
        properties: Any
        layout: bpy.types.UILayout
        format: str
        unit: str

    def check(self, context: bpy.types.Context) -> bool:
        """Give the file the suffix of the format that is chosen, as Blender's exporters do."""
        path = Path(self.filepath)
        known = [suffix for suffix, *_ in FORMATS]
        if not self.properties.is_property_set("format") and path.suffix.lower() in known:
            return False
        base = path.with_suffix("") if path.suffix.lower() in known else path
        wanted = f"{base}{self.format}"
        changed, self.filepath = wanted != self.filepath, wanted
        return changed

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(self, "format")
        suffix = Path(self.filepath).suffix.lower()
        if (suffix if suffix in (".json", ".obj", ".csv") else self.format) == ".obj":
            layout.prop(self, "unit")
        else:
            write_text(layout, "In millimetres.", context)


def draw_import(layout: bpy.types.UILayout, operator: Any, context: bpy.types.Context) -> None:
    """What the chosen file is, and its unit."""
    layout.use_property_split, layout.use_property_decorate = True, False
    layout.prop(operator, "unit")
    words = told(Path(bpy.path.abspath(operator.filepath)))
    if words:
        write_text(layout, words, context, "INFO")


CLASSES = ()
