"""The rooms of the project and the direction of their imports: no circle, and no arrow that runs back up."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import networkx as nx

ROOT = Path(__file__).resolve().parent.parent

ROOMS = (
    "root",
    "compiled",
    "geometry",
    "fields",
    "mechanics",
    "cameras",
    "formats",
    "evaluation",
    "capture",
    "twin",
    "raster",
    "imaging",
    "calibration",
    "fitting",
    "simulation",
    "printing.records",
    "printing.process",
    "printing.sequencing",
    "printing.adaptation",
    "printing.toolpath",
    "printing.job",
    "printing.simulation",
    "tracking",
    "worker",
    "blender.background",
    "blender.scene",
    "blender.frames",
    "blender.rendering",
    "blender.display",
    "blender.views",
    "dataset",
    "report",
    "service",
    "api",
    "addon",
    "scripts",
    "cli",
)
"""From the ground up: a room imports only from those before it, also inside of functions."""

SPLIT = ("printing", "blender")
"""Folders whose folders are rooms of their own."""


FACE = "frametwin"
"""The package itself: type checkers are told where each of its names comes from, and nothing is imported before a name
is asked for, so these are not imports of the ground floor."""


def is_for_type_checkers(node: ast.stmt) -> bool:
    """Whether a statement is ``if TYPE_CHECKING: ...``."""
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def source_files() -> dict[str, Path]:
    """Every module of the project by its dotted name."""
    files = [path for folder in ("frametwin", "addon", "scripts") for path in sorted((ROOT / folder).rglob("*.py"))]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in files}


def room_of(module: str, files: dict[str, Path]) -> str:
    """The room that a module lies in."""
    parts = module.split(".")
    if parts[0] != "frametwin":
        return parts[0]
    if module == "frametwin.__main__":
        return "cli"  # it starts the command and is imported by nobody
    folders = parts[1:] if files[module].name == "__init__.py" else parts[1:-1]
    if not folders:
        return "root"
    return ".".join(folders[:2]) if folders[0] in SPLIT else folders[0]


def imported_modules(module: str, files: dict[str, Path]) -> Iterator[str]:
    """Modules of the project that a module imports, wherever the import stands."""
    package = module if files[module].name == "__init__.py" else module.rpartition(".")[0]
    tree = ast.parse(files[module].read_text(encoding="utf-8"))
    if module == FACE:
        tree.body = [node for node in tree.body if not is_for_type_checkers(node)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            names = [f"{base}.{alias.name}" if f"{base}.{alias.name}" in files else base for alias in node.names]
        else:
            continue
        yield from (name for name in names if name in files and name != module)


def import_graph(files: dict[str, Path]) -> nx.DiGraph:
    """Which module imports which."""
    graph = nx.DiGraph()
    graph.add_nodes_from(files)
    graph.add_edges_from((module, other) for module in files for other in imported_modules(module, files))
    return graph


def test_every_module_lies_in_a_room() -> None:
    files = source_files()
    rooms = {room_of(module, files) for module in files} - set(SPLIT)  # whose own faces define nothing
    assert rooms == set(ROOMS)


def test_rooms_import_only_from_the_rooms_below() -> None:
    files = source_files()
    floor = {room: i for i, room in enumerate(ROOMS)}
    arrows = [
        f"{module} -> {other}"
        for module, other in import_graph(files).edges
        if room_of(module, files) in floor and floor[room_of(other, files)] > floor[room_of(module, files)]
    ]
    assert not arrows


def test_no_modules_import_each_other_in_a_circle() -> None:
    circles = [sorted(circle) for circle in nx.simple_cycles(import_graph(source_files()), length_bound=6)]
    assert not circles


def test_the_graph_sees_every_kind_of_import(tmp_path: Path) -> None:
    texts = {
        "a": "from b import c\n",
        "b": "def f():\n    import d\n",
        "c": "from . import d\n",
        "d": "",
    }
    files = {}
    for name, text in texts.items():
        files[name] = tmp_path / f"{name}.py"
        files[name].write_text(text, encoding="utf-8")
    graph = import_graph(files)
    assert set(graph.edges) == {("a", "b"), ("b", "d")}  # c's is of a package that is not there
