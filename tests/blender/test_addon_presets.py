"""Presets of rig, deformation and fit: Blender finds those that come along and keeps the user's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import pytest

KINDS = {"rig": "cameras", "deform": "deform", "fit": "fit"}


@pytest.fixture
def tab(extension: str, scene: Any) -> Any:
    """The add-on's settings of the scene."""
    return scene.frametwin


def files_of(kind: str) -> dict[str, Path]:
    """The presets that Blender would list, by the names that it shows."""
    folders = [Path(folder) for folder in bpy.utils.preset_paths(f"frametwin/{kind}")]
    return {
        bpy.path.display_name(str(path), title_case=False): path for folder in folders for path in folder.glob("*.py")
    }


def apply(kind: str, path: Path) -> None:
    """What a click in the list does."""
    bpy.ops.script.execute_preset(filepath=str(path), menu_idname=f"FRAMETWIN_PT_{kind}_presets")


def add(kind: str, **values: Any) -> set[str]:
    done: set[str] = getattr(bpy.ops.frametwin, f"add_{kind}_preset")(**values)
    return done


def kept(kind: str) -> list[str]:
    """What a preset of a kind keeps."""
    operator = getattr(cases.addon("setting_presets"), f"FRAMETWIN_OT_add_{kind}_preset")
    return [value.partition(".")[2] for value in operator.preset_values]


@pytest.mark.parametrize("kind", KINDS)
def test_presets_come_along_and_set_all_that_a_preset_keeps(tab: Any, kind: str) -> None:
    settings, found = getattr(tab, KINDS[kind]), files_of(kind)
    assert len(found) >= 4
    seen = set()
    for path in found.values():
        for name in kept(kind):
            settings.property_unset(name)
        apply(kind, path)
        assert all(settings.is_property_set(name) for name in kept(kind)), path
        seen.add(tuple(getattr(settings, name) for name in kept(kind)))
    assert len(seen) == len(found)  # no two of them are the same


@pytest.mark.parametrize(
    ("kind", "changes", "stays"),
    [
        ("rig", {"kind": "dome", "count": 11, "distance": 1.75, "lens": 0.5, "width": 1234}, {"opacity": 0.25}),
        ("deform", {"kind": "warp", "automatic": False, "peak": 2.5, "how": "height", "height": 12.5}, {"seed": 7}),
        ("fit", {"mask": "paper", "cameras": "exact", "anchor": "feet"}, {"capture": "/here", "ignore": "/arm"}),
    ],
)
def test_a_preset_is_kept_with_the_users_and_brings_back_what_it_was_made_of(
    tab: Any, kind: str, changes: dict[str, Any], stays: dict[str, Any]
) -> None:
    settings = getattr(tab, KINDS[kind])
    for name, value in changes.items():
        setattr(settings, name, value)
    wanted = {name: getattr(settings, name) for name in kept(kind)}
    assert add(kind, name="My Lab") == {"FINISHED"}
    path = files_of(kind)["My Lab"]
    try:
        assert path.is_relative_to(bpy.utils.user_resource("SCRIPTS"))
        for name in kept(kind):
            settings.property_unset(name)
        for name, value in stays.items():
            setattr(settings, name, value)
        apply(kind, path)
        assert {name: getattr(settings, name) for name in kept(kind)} == wanted
        assert {name: getattr(settings, name) for name in stays} == stays  # of one capture or print, not of a kind
    finally:
        assert add(kind, name="My Lab", remove_name=True) == {"FINISHED"}
    assert "My Lab" not in files_of(kind)


def test_presets_that_come_along_cannot_be_removed(tab: Any) -> None:
    before = files_of("rig")
    assert add("rig", name=next(iter(before)), remove_name=True) == {"CANCELLED"}
    assert files_of("rig") == before


def test_presets_go_with_the_add_on(extension: str) -> None:
    bpy.ops.preferences.addon_disable(module=extension)
    try:
        assert not files_of("rig")
    finally:
        bpy.ops.preferences.addon_enable(module=extension)
    assert files_of("rig")
