"""The zip: what is in it, that it installs into an empty profile, and that switching it off leaves nothing."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import bpy
import extension_cases as cases

CHILD = """
import sys
import bpy
sys.path.insert(0, {tests!r})
import extension_cases as cases
before = set(dir(bpy.types)), set(dir(bpy.types.Scene)), len(bpy.app.handlers.load_pre), len(bpy.app.handlers.undo_pre)
cases.install(cases.Path({archive!r}))
import frametwin
print("FROM", frametwin.__file__)
for _ in range(3):
    bpy.ops.preferences.addon_disable(module=cases.MODULE)
    left = (set(dir(bpy.types)) - before[0]) | (set(dir(bpy.types.Scene)) - before[1])
    assert not [name for name in left if "frametwin" in name.lower()], left
    assert (len(bpy.app.handlers.load_pre), len(bpy.app.handlers.undo_pre)) == before[2:]
    bpy.ops.preferences.addon_enable(module=cases.MODULE)
    assert hasattr(bpy.types, "FRAMETWIN_PT_plan")
assert bpy.ops.frametwin.add_frame() == {{"FINISHED"}}
heavy = {{"torch", "numba", "scipy", "cv2"}} & set(sys.modules)
assert not heavy, heavy
(unpacked,) = cases.Path({archive!r}).parent.glob("profile/**/site-packages/frametwin/errors.py")
assert {line!r} not in unpacked.read_text(encoding="utf-8")
cases.install(cases.Path({newer!r}))
assert unpacked.read_text(encoding="utf-8").endswith({line!r})
assert len(list(unpacked.parents[1].glob("frametwin-*"))) == 1
print("WALKED", flush=True)
import os
os._exit(0)
"""


def test_the_zip_is_whole_and_stands_alone(tmp_path: Path) -> None:
    archive = cases.build_zip(tmp_path)
    assert list(tmp_path.iterdir()) == [archive]
    with zipfile.ZipFile(archive) as content:
        names = set(content.namelist())
    wheel = next(name for name in names if name.startswith("wheels/frametwin-") and name.endswith(".whl"))
    assert {"blender_manifest.toml", "__init__.py", "set_up.py", "constraints.txt", "LICENSE"} <= names
    assert not [name for name in names if "numpy" in name or "torch" in name or name.endswith(".pyc")]
    version, _, content = wheel.split("-")[1].partition("+")
    assert version == archive.stem.split("-")[1] and content
    line = "# of the next build\n"
    newer = cases.with_other_library(archive, tmp_path / "newer", "frametwin/errors.py", line)
    # Without the source tree on the path, frametwin comes out of the zip where the environment has none installed.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"BLENDER_USER_RESOURCES": str(tmp_path / "profile"), "PYTHONSAFEPATH": "1"}
    code = CHILD.format(tests=str(Path(__file__).parent), archive=str(archive), newer=str(newer), line=line)
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False, timeout=180
    )
    assert done.returncode == 0 and "WALKED" in done.stdout, done.stdout + done.stderr
    assert "Traceback" not in done.stderr


STORE_CHILD = """
import sys
import bpy
sys.path.insert(0, {tests!r})
import extension_cases as cases
cases.install(cases.Path({archive!r}))
assert bpy.ops.frametwin.add_frame() == {{"FINISHED"}}
assert "set_up" not in dir(bpy.ops.frametwin) and "test_python" in dir(bpy.ops.frametwin)
computing = cases.addon("computing")
assert not computing.HAS_SET_UP and not hasattr(computing.preferences_of(), "torch_index")
assert computing.REMEDY == "choose a Python in Preferences > Add-ons > FrameTwin"
bpy.ops.preferences.addon_disable(module=cases.MODULE)
print("WALKED", flush=True)
import os
os._exit(0)
"""


def test_the_store_edition_has_no_set_up_and_no_network(tmp_path: Path) -> None:
    archive = cases.build_zip(tmp_path / "zips", "--bare", "--store")
    with zipfile.ZipFile(archive) as content:
        names = set(content.namelist())
        manifest = tomllib.loads(content.read("blender_manifest.toml").decode())
    assert manifest["permissions"].keys() == {"files"}
    assert "set_up.py" not in names and "constraints.txt" not in names and "preferences.py" in names
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "profile")}
    code = STORE_CHILD.format(tests=str(Path(__file__).parent), archive=str(archive))
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False, timeout=180
    )
    assert done.returncode == 0 and "WALKED" in done.stdout, done.stdout + done.stderr
    assert "Traceback" not in done.stderr


def test_a_folder_of_zips_becomes_a_repository(tmp_path: Path) -> None:
    archive = cases.build_zip(tmp_path, "--bare", "--repository", str(tmp_path))
    assert archive == tmp_path / "index.json"
    (zip_file,) = tmp_path.glob("*.zip")
    (entry,) = json.loads(archive.read_text())["data"]
    assert entry["id"] == "frametwin" and entry["archive_url"] == f"./{zip_file.name}"
    assert entry["archive_hash"] == f"sha256:{hashlib.sha256(zip_file.read_bytes()).hexdigest()}"
    assert (tmp_path / "index.html").is_file()


def test_presets_are_those_of_the_library(extension: str) -> None:
    shown = [item.identifier for item in bpy.context.scene.frametwin.fit.bl_rna.properties["preset"].enum_items]
    source = (cases.ROOT / "frametwin" / "fitting" / "settings.py").read_text() + '"fast"'
    assert shown[0] == "fast" and all(f'"{name}"' in source for name in shown)


def test_every_operator_and_property_says_what_it_does(extension: str) -> None:
    names = [name for name in dir(bpy.ops.frametwin) if not name.startswith("_")]
    assert len(names) > 20
    for name in names:
        kind = getattr(bpy.ops.frametwin, name).get_rna_type()
        assert len(kind.description) > 15 and not kind.description.endswith("."), name
    settings = bpy.context.scene.frametwin
    for group in ("deform", "cameras", "render", "fit", "view"):
        for item in getattr(settings, group).bl_rna.properties:
            assert item.identifier in ("rna_type", "name") or item.description, f"{group}.{item.identifier}"
