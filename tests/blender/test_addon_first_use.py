"""Installed from disk on a computer with Blender and nothing else, without a network: a fit runs to its end at once."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import extension_cases as cases
import pytest

from scripts.extension_wheels import PYTHONS, WheelError, fetch

CHILD = """
import sys
from importlib.util import find_spec
from pathlib import Path
import bpy
import numpy
assert not [name for name in {lacking!r} if find_spec(name)], sys.path
sys.path.insert(0, {tests!r})
import extension_cases as cases
cases.install(Path({archive!r}))
blenders = numpy.__version__, numpy.__file__
bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
ops, settings = bpy.ops.frametwin, bpy.context.scene.frametwin
settings.fit.capture, settings.render.folder = {capture!r}, {out!r}
ops.test_python()
words = cases.pump_until_done()
assert "numpy " + blenders[0] in words and "no PyTorch, which Fast does not need" in words, words
ops.add_frame()
ops.sag()
assert "printed" in cases.pump_until_done()
ops.fit()
print("FIT", cases.pump_until_done(300.0))
settings.fit.preset = "paper"
print("PAPER", cases.refused(ops.fit))
assert not {{"torch", "numba", "scipy", "cv2"}} & set(sys.modules)
import importlib
numpy = importlib.reload(numpy)
assert (numpy.__version__, numpy.__file__) == blenders
print("WALKED", flush=True)
cases.addon("session").runner.close()
import os
os._exit(0)
"""
LACKING = ("scipy", "numba", "cv2", "torch", "safetensors", "frametwin")


@pytest.fixture(scope="module")
def blender(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A Python that has Blender's module and what that asks for, and nothing else."""
    folder = tmp_path_factory.mktemp("computer") / "blender"
    base = Path(sys.base_prefix, "bin", f"python3.{sys.version_info[1]}")
    if not base.is_file():
        pytest.skip(f"{base} is absent, so no other environment can be made with it")
    subprocess.run([str(base), "-m", "venv", "--without-pip", str(folder)], check=True, timeout=120)
    (packages,) = folder.glob("lib/python3.*/site-packages")
    for name in needed_by("bpy"):
        for path in metadata.files(name) or []:
            top = path.parts[0]
            if top != ".." and not (packages / top).exists():
                (packages / top).symlink_to(Path(str(path.locate())).parents[len(path.parts) - 1] / top)
        for libraries in Path(str(metadata.distribution(name).locate_file(""))).glob(f"{name}.libs"):
            if not (packages / libraries.name).exists():
                (packages / libraries.name).symlink_to(libraries)
    yield folder / "bin" / "python"


def needed_by(package: str) -> set[str]:
    """A package and all that it needs, extras left out, as installed."""
    names, left = set(), [package]
    while left:
        name = left.pop()
        if name in names:
            continue
        try:
            requirements = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # of another system or Python
        names.add(name)
        wanted = [line.partition(";") for line in requirements]
        left += [
            need.split("[")[0].split("<")[0].split(">")[0].split("=")[0].split("!")[0].split("~")[0].strip()
            for need, _, marker in wanted
            if "extra" not in marker
        ]
    return names


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip for this Blender's platform, with the wheels."""
    try:
        fetch(cases.platform(), PYTHONS)
    except WheelError as error:
        pytest.skip(str(error))
    return cases.build_zip(tmp_path_factory.mktemp("wheels"), "--platform", cases.platform())


def test_the_first_fit_needs_no_set_up(archive: Path, blender: Path, tower_capture: Path, tmp_path: Path) -> None:
    assert archive.stat().st_size < 300e6
    left_out = {"PYTHONPATH", "PYTHONHOME", "FRAMETWIN_PYTHON", "VIRTUAL_ENV"}
    environment = {name: value for name, value in os.environ.items() if name not in left_out}
    environment |= {"BLENDER_USER_RESOURCES": str(tmp_path / "profile"), "PYTHONSAFEPATH": "1", "PYTHONNOUSERSITE": "1"}
    environment |= dict.fromkeys(("HTTP_PROXY", "HTTPS_PROXY", "http_proxy", "https_proxy"), "http://127.0.0.1:9")
    code = CHILD.format(
        tests=str(Path(__file__).parent),
        archive=str(archive),
        capture=str(tower_capture),
        out=str(tmp_path / "out"),
        lacking=LACKING,
    )
    done = subprocess.run(
        [str(blender), "-c", code], env=environment, capture_output=True, text=True, check=False, timeout=500
    )
    assert done.returncode == 0 and "WALKED" in done.stdout, done.stdout + done.stderr
    assert "struts found" in next(line for line in done.stdout.splitlines() if line.startswith("FIT"))
    assert "PAPER Error: This preset needs PyTorch, which Blender's Python has not: press Set Up" in done.stdout
    assert "Traceback" not in done.stderr


def test_the_zip_carries_no_numpy_and_no_torch(archive: Path) -> None:
    with zipfile.ZipFile(archive) as content:
        manifest = tomllib.loads(content.read("blender_manifest.toml").decode())
        wheels = {name for name in content.namelist() if name.endswith(".whl")}
    assert manifest["platforms"] == [cases.platform()]
    assert {name.removeprefix("./") for name in manifest["wheels"]} == wheels
    packages = sorted({name.removeprefix("wheels/").split("-")[0] for name in wheels})
    assert "numba" in packages and not {"numpy", "torch"} & set(packages)
    for tag in ("cp311", "cp313"):
        assert [name for name in wheels if name.startswith("wheels/scipy-") and f"-{tag}-{tag}-" in name]
