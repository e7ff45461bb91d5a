"""Kinds of damage to the frame and the truth of a capture, and to its files as such (data for the tests)."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

Damage = Callable[[Path], Any]
KINDS: dict[str, tuple[Damage, str, str]] = {}


def kind(file: str, field: str) -> Callable[[Damage], Damage]:
    """Register a damage: the file and the words that the message must have."""

    def register(damage: Damage) -> Damage:
        KINDS[damage.__name__] = (damage, file, field)
        return damage

    return register


def change(path: Path, edit: Callable[[dict[str, Any]], Any]) -> None:
    """Edit a JSON file in place; NaN and its like are written, as careless programs do."""
    data = json.loads(path.read_text())
    edit(data)
    path.write_text(json.dumps(data))


def each_key(file: str, keys: dict[str, str], edit: Callable[[dict[str, Any], str], Any], words: str) -> None:
    """Register the same damage for several keys, given with the field that the message must name."""
    for key, field in keys.items():

        def damage(folder: Path, key: str = key) -> None:
            change(folder / file, lambda data: edit(data, key))

        damage.__name__ = f"{words}_{file}_{key}"
        kind(file, field)(damage)


def value(file: str, key: str, index: tuple[int | str, ...], new: Any, name: str, field: str | None = None) -> None:
    """Register a damage that replaces one value."""

    def damage(folder: Path) -> None:
        def edit(data: dict[str, Any]) -> None:
            place: Any = data
            for step in (key, *index)[:-1]:
                place = place[step]
            place[(key, *index)[-1]] = new

        change(folder / file, edit)

    damage.__name__ = name
    kind(file, field or "".join([key, *(f"[{i}]" if isinstance(i, int) else f".{i}" for i in index)]))(damage)


# --- files


@kind("capture", "folder")
def no_folder(folder: Path) -> None:
    os.rename(folder, folder.with_name("elsewhere"))


@kind("frame.json", "does not exist")
def no_frame(folder: Path) -> None:
    (folder / "frame.json").unlink()


@kind("transforms.json", "does not exist")
def no_transforms(folder: Path) -> None:
    (folder / "transforms.json").unlink()


for _file in ("frame.json", "transforms.json", "truth.json"):

    def _cut(folder: Path, file: str = _file) -> None:
        text = (folder / file).read_text()
        (folder / file).write_text(text[: len(text) // 2])

    def _garbage(folder: Path, file: str = _file) -> None:
        (folder / file).write_text("vertices: none")

    def _empty(folder: Path, file: str = _file) -> None:
        (folder / file).write_text("")

    def _list(folder: Path, file: str = _file) -> None:
        (folder / file).write_text("[]")

    def _binary(folder: Path, file: str = _file) -> None:
        (folder / file).write_bytes(bytes(range(256)))

    def _twice(folder: Path, file: str = _file) -> None:
        text = (folder / file).read_text()
        (folder / file).write_text(text.replace('"version": 1,', '"version": 1, "version": 1,', 1))

    def _version(folder: Path, file: str = _file) -> None:
        change(folder / file, lambda data: data.update(version=2))

    def _no_version(folder: Path, file: str = _file) -> None:
        change(folder / file, lambda data: data.pop("version"))

    def _format(folder: Path, file: str = _file) -> None:
        change(folder / file, lambda data: data.update(format="frametwin-picture"))

    def _link_out(folder: Path, file: str = _file) -> None:
        os.rename(folder / file, folder.parent / "outside.json")
        os.symlink(folder.parent / "outside.json", folder / file)

    for _damage, _words in (
        (_cut, "cut short"),
        (_garbage, "not JSON"),
        (_empty, "is empty"),
        (_list, "object"),
        (_binary, "not a text file"),
        (_twice, "version: occurs twice"),
        (_version, "version: 2"),
        (_no_version, "version: is missing"),
        (_format, "format: is 'frametwin-picture'"),
        (_link_out, "link that leaves the folder"),
    ):
        _damage.__name__ = f"{_file}{_damage.__name__}"
        kind(_file, _words)(_damage)

# --- the frame

each_key(
    "frame.json",
    {"vertices": "vertices", "edges": "edges", "radius": "radius", "format": "format"},
    lambda data, key: data.pop(key),
    "missing",
)
each_key(
    "frame.json",
    {key: key for key in ("vertices", "edges", "radius", "printed", "grounded", "batch", "control_points")},
    lambda data, key: data.update({key: "many"}),
    "text_in",
)
each_key(
    "frame.json",
    {key: key for key in ("printed", "grounded", "batch", "radius", "control_points")},
    lambda data, key: data.update({key: [True]}),
    "wrong_length_of",
)
value("frame.json", "vertices", (3, 1), float("nan"), "vertex_nan", "NaN")
value("frame.json", "vertices", (3, 1), float("-inf"), "vertex_infinite", "Infinity")
value("frame.json", "vertices", (3, 1), 1e300, "vertex_beyond_belief")
value("frame.json", "vertices", (3,), [1.0, 2.0], "vertex_flat", "vertices")
value("frame.json", "vertices", (3, 2), "40", "vertex_text", "vertices")
value("frame.json", "vertices", (3, 2), True, "vertex_boolean", "vertices")
value("frame.json", "vertices", (3, 2), None, "vertex_null", "vertices")
value("frame.json", "edges", (5,), [0, 99], "index_out_of_range")
value("frame.json", "edges", (5,), [-1, 0], "index_negative")
value("frame.json", "edges", (5,), [2, 2], "self_loop")
value("frame.json", "edges", (5,), [4, 0], "duplicate_strut")
value("frame.json", "edges", (5,), [0, 1.5], "index_not_whole", "edges")
value("frame.json", "edges", (5,), [0, 10**30], "index_huge", "edges")
value("frame.json", "radius", (), 0, "radius_zero", "radius")
value("frame.json", "radius", (), -1.5, "radius_negative", "radius")
value("frame.json", "radius", (), True, "radius_boolean", "radius")
value("frame.json", "printed", (), [1] * 24, "printed_numbers")
value("frame.json", "printed", (), [False] * 24, "nothing_printed")
value("frame.json", "printed", (), None, "printed_null")
value("frame.json", "grounded", (), [0] * 12, "grounded_numbers")
value("frame.json", "batch", (), [0.5] * 24, "batch_not_whole")
value("frame.json", "name", (), 5, "name_number")
value("frame.json", "groundd", (), [True] * 12, "unknown_field")
value("frame.json", "unit", (), "meter", "unit_in_frame")
value("frame.json", "control_points", (), [[[0.0] * 3] * 4] * 24, "curves_off_the_vertices")


@kind("frame.json", "no strut")
def frame_empty(folder: Path) -> None:
    change(folder / "frame.json", lambda data: data.update(vertices=[], edges=[], grounded=[]))


@kind("frame.json", "no length")
def strut_without_length(folder: Path) -> None:
    change(folder / "frame.json", lambda data: data["vertices"].__setitem__(4, data["vertices"][0]))


# --- the truth


@kind("truth.json", "edges[2]")
def truth_of_another_order(folder: Path) -> None:
    def edit(data: dict[str, Any]) -> None:
        data["edges"][2], data["edges"][3] = data["edges"][3], data["edges"][2]

    change(folder / "truth.json", edit)


@kind("truth.json", "edges")
def truth_with_fewer_struts(folder: Path) -> None:
    change(folder / "truth.json", lambda data: data["edges"].pop())


@kind("truth.json", "vertices")
def truth_with_more_vertices(folder: Path) -> None:
    def edit(data: dict[str, Any]) -> None:
        data["vertices"].append([0, 0, 90])
        data["grounded"].append(False)

    change(folder / "truth.json", edit)


value("truth.json", "vertices", (0, 0), float("nan"), "truth_nan", "NaN")
