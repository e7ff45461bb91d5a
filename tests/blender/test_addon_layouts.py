"""Panels at default and narrow width: no button of a row is cut off, and names stand beside their fields or above."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from types import SimpleNamespace
from typing import Any

import bpy
import extension_cases as cases
import pytest
from test_blender_twins import shifted

from frametwin.blender.display.twins import show_twin
from frametwin.geometry.parametric import named_frame

ops = bpy.ops.frametwin
PANELS = {
    "plan": ("plan",),
    "deform": ("deform",),
    "cameras": ("cameras",),
    "fit": ("fit", "fit_views"),
    "twin": ("twin",),
    "printing": ("print",),
}


class Drawn:
    """A layout that remembers what is in its rows."""

    def __init__(self, kind: str = "column", split: bool = False) -> None:
        self.kind, self.items, self.use_property_split = kind, [], split
        self.children: list[Drawn] = []

    def _child(self, kind: str) -> Drawn:
        child = Drawn(kind, self.use_property_split)
        self.children.append(child)
        self.items.append(child)
        return child

    def row(self, **words: Any) -> Drawn:
        return self._child("row")

    def column(self, **words: Any) -> Drawn:
        return self._child("column")

    def box(self) -> Drawn:
        return self._child("column")

    def operator(self, name: str, text: str | None = None, icon: str = "NONE", **words: Any) -> Any:
        label = getattr(ops, name.removeprefix("frametwin.")).get_rna_type().name
        self.items.append(("button", label if text is None else text, icon != "NONE"))
        return SimpleNamespace()

    def label(self, text: str = "", icon: str = "NONE", **words: Any) -> None:
        self.items.append(("label", text, icon != "NONE"))

    def prop(self, data: Any, name: str, text: str | None = None, icon: str = "NONE", **words: Any) -> None:
        shown = data.bl_rna.properties[name].name if text is None and hasattr(data, "bl_rna") else text or ""
        self.items.append(("prop", shown, icon != "NONE"))

    def rows(self) -> Iterator[Drawn]:
        if self.kind == "row":
            yield self
        for child in self.children:
            yield from child.rows()

    def leaves(self) -> list[tuple[str, str, bool]]:
        """What stands side by side in a row; a column in it counts as its widest."""
        found: list[tuple[str, str, bool]] = []
        for item in self.items:
            if isinstance(item, Drawn):
                inner = item.leaves()
                found += inner if item.kind == "row" else sorted(inner, key=lambda leaf: len(leaf[1]))[-1:]
            else:
                found.append(item)
        return found

    def props(self) -> Iterator[tuple[Drawn, str]]:
        for item in self.items:
            if isinstance(item, Drawn):
                yield from item.props()
            elif item[0] == "prop":
                yield self, item[1]


def sidebar(width: float, scale: float) -> Any:
    """The context of a sidebar of so many pixels at a scale of 1; without a window Blender's own has no scale."""
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=scale))
    return SimpleNamespace(
        scene=bpy.context.scene,
        region=SimpleNamespace(width=width * scale),
        preferences=preferences,
        view_layer=bpy.context.view_layer,
        window=None,
    )


def draw(module: str, name: str, context: Any, monkeypatch: pytest.MonkeyPatch) -> Drawn:
    panel = getattr(cases.addon(module), f"FRAMETWIN_PT_{name}")
    for each in (cases.addon("steps"), cases.addon("twin")):  # what asks Blender itself for the width
        monkeypatch.setattr(each, "bpy", SimpleNamespace(**{**vars(bpy), "context": context}))
    drawn = Drawn()
    drawn_by = type("Panel", (), {key: value for key, value in vars(panel).items() if callable(value)})()
    drawn_by.layout = drawn
    drawn_by.draw(context)
    return drawn


@pytest.fixture
def tab(extension: str, scene: Any, tmp_path: Any) -> Any:
    """A scene in which all panels are full."""
    cases.addon("session").runner.close()
    settings = scene.frametwin
    ops.use_millimetres()
    ops.add_frame()
    settings.cameras.width, settings.cameras.height = 400, 300
    ops.make_rig()
    settings.fit.capture = settings.pictures.rig = str(tmp_path)
    frame = named_frame("bridge")
    settings.twin = show_twin(shifted(frame, [0.0, 0.0, 2.0]), frame).collection
    return settings


@pytest.mark.parametrize("module", PANELS)
def test_no_button_of_a_row_is_cut_off(tab: Any, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import blf  # which is there once bpy is

    words = cases.addon("translations").WORDS
    rows = 0
    for language, width, scale in product((None, 0, 1), (182.0, 240.0, 292.0), (1.0, 2.0)):

        def translated(text: str, language: int | None = language) -> str:
            return text if language is None or text not in words else words[text][language]

        monkeypatch.setattr(cases.addon("layouts"), "translated", translated)
        blf.size(0, 11.0)
        for name in PANELS[module]:
            drawn = draw(module, name, sidebar(width, scale), monkeypatch)
            assert drawn.items
            for there in filter(is_of_buttons, (row.leaves() for row in drawn.rows())):
                bare = 22.0 * sum(1 for kind, text, _ in there if kind == "button" and not text)  # icons alone
                shares = sum(1 for kind, text, _ in there if text or kind == "prop")
                room = (width - cases.addon("layouts").BESIDES - bare) / shares
                for _, text, icon in there:
                    needed = blf.dimensions(0, translated(text))[0] + (20.0 if icon and text else 0.0)
                    assert needed <= room + 1.0, (name, language, width, text, needed, room)
                rows += 1
    assert rows


def is_of_buttons(there: list[tuple[str, str, bool]]) -> bool:
    """Whether buttons with texts stand side by side, perhaps beside a field without its name."""
    texts = [kind for kind, text, _ in there if text]
    return len(there) > 1 and "button" in texts and "prop" not in texts


@pytest.mark.parametrize(("width", "beside"), [(182.0, False), (292.0, True)])
def test_names_stand_beside_fields_only_where_there_is_room(
    tab: Any, width: float, beside: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("deform", "cameras", "photographs", "fit"):
        drawn = draw(module, module, sidebar(width, 1.0), monkeypatch)
        assert drawn.use_property_split == beside
    drawn = draw("deform", "deform", sidebar(width, 1.0), monkeypatch)
    labels = [item[1] for part in [drawn, *drawn.children] for item in part.items if not isinstance(item, Drawn)]
    assert ("Kind" in [name for _, name in drawn.props()]) == beside
    assert "Kind" in labels
