"""The add-on as users have it: built, installed into a fresh profile, enabled, and driven by its operators."""

from __future__ import annotations

import importlib
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import bpy

ROOT = Path(__file__).resolve().parents[2]
MODULE = "bl_ext.user_default.frametwin"
PATIENCE = 120.0


def build_zip(out: Path, *options: str) -> Path:
    """Build the extension; by default without the wheels, which take a while and of which one test is enough."""
    command = [sys.executable, str(ROOT / "scripts" / "build_extension.py"), "--out", str(out)]
    command += options or ["--bare"]
    made = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert made.returncode == 0, made.stdout + made.stderr
    return Path(made.stdout.strip().splitlines()[-1])


def with_other_library(archive: Path, folder: Path, file: str, line: str) -> Path:
    """The zip as it would be built after a line was added to a file of the library."""
    from scripts.library_wheel import stamp  # here, since a Blender of its own may not see the source tree

    stage = folder / "stage"
    shutil.unpack_archive(archive, stage)
    (wheel,) = (stage / "wheels").glob("frametwin-*.whl")
    shutil.unpack_archive(wheel, folder / "wheel", "zip")
    with (folder / "wheel" / file).open("a", encoding="utf-8") as stream:
        stream.write(line)
    shutil.make_archive(str(folder / "wheel"), "zip", folder / "wheel")
    manifest = stage / "blender_manifest.toml"
    text = manifest.read_text(encoding="utf-8")
    made = stamp(Path(shutil.move(folder / "wheel.zip", wheel)))
    manifest.write_text(text.replace(wheel.name, made.name), encoding="utf-8")
    return Path(shutil.make_archive(str(folder / archive.stem), "zip", stage))


def platform() -> str:
    """Blender's name of the platform of this computer."""
    import pytest

    from scripts.build_extension import BuildError, this_platform

    try:
        return this_platform()
    except BuildError as error:
        pytest.skip(str(error))


def install(archive: Path) -> None:
    """Install and enable it in this process."""
    bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=True)
    assert MODULE in bpy.context.preferences.addons


def addon(name: str) -> Any:
    """One of the add-on's modules."""
    return importlib.import_module(f"{MODULE}.{name}")


def refused(operator: Any, **values: Any) -> str:
    """Call an operator that must fail; what it reports."""
    try:
        operator(**values)
    except RuntimeError as error:
        words = str(error)
        assert "Traceback" not in words, words
        return words
    raise AssertionError(f"{operator} did not refuse")


def pump_until_done(patience: float = PATIENCE) -> str:
    """Pump as the timer would, until nothing is under way; what the user is told then."""
    session = addon("session")
    deadline = time.monotonic() + patience
    while session.pump():
        assert time.monotonic() < deadline, f"waited {patience:g} s for {session.runner.status.line}"
        time.sleep(0.005)
    return str(session.last_words)


def pump_until(condition: Any, patience: float = PATIENCE, pump: Any = None) -> None:
    """Pump until something is true."""
    pump = pump or addon("session").pump
    deadline = time.monotonic() + patience
    while not condition():
        pump()
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.002)


def scene_state() -> dict[str, Any]:
    """What a failure must leave as it was."""
    return {
        "objects": sorted(obj.name for obj in bpy.data.objects),
        "collections": sorted(collection.name for collection in bpy.data.collections),
        "curves": sorted(curve.name for curve in bpy.data.curves),
        "meshes": sorted(mesh.name for mesh in bpy.data.meshes),
    }
