"""The library's wheel inside of the extension: a version of its own for every content, which pip takes."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from packaging.utils import parse_wheel_filename

from scripts.library_wheel import stamp

TIMES = ((2020, 1, 1, 0, 0, 0), (2026, 5, 4, 3, 2, 2))
METADATA = "Metadata-Version: 2.1\nName: thing\nVersion: 1.2\n\nIts text.\nVersion: of the text\n"
TAGS = "Wheel-Version: 1.0\nGenerator: a test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"


def make_wheel(folder: Path, code: str, time: tuple[int, int, int, int, int, int] = TIMES[0]) -> Path:
    folder.mkdir(parents=True)
    wheel = folder / "thing-1.2-py3-none-any.whl"
    files = {
        "thing/__init__.py": code,
        "thing/METADATA": "no metadata of the wheel\nVersion: 7\n",
        "thing-1.2.dist-info/METADATA": METADATA,
        "thing-1.2.dist-info/WHEEL": TAGS,
        "thing-1.2.dist-info/licenses/LICENSE": "free",
        "thing-1.2.dist-info/RECORD": "".join(f"{name},,\n" for name in ("thing/__init__.py",)),
    }
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name, time), text)
    return wheel


def test_the_version_is_that_of_the_content_and_of_nothing_else(tmp_path: Path) -> None:
    first = stamp(make_wheel(tmp_path / "a", "one = 1\n"))
    again = stamp(make_wheel(tmp_path / "b", "one = 1\n", TIMES[1]))
    other = stamp(make_wheel(tmp_path / "c", "one = 2\n"))
    assert first.name == again.name != other.name and first.read_bytes() == again.read_bytes()
    assert list((tmp_path / "a").iterdir()) == [first]
    for wheel in (first, other):
        name, version, build, _ = parse_wheel_filename(wheel.name)
        assert (name, version.public, build) == ("thing", "1.2", ()) and version.local
        assert str(version) == wheel.name.split("-")[1]  # as it is written: nothing to be brought into another form
    assert stamp(first).name == first.name


def test_all_that_was_in_it_is_in_it_and_listed(tmp_path: Path) -> None:
    wheel = stamp(make_wheel(tmp_path / "a", "one = 1\n"))
    version = wheel.name.split("-")[1]
    with zipfile.ZipFile(wheel) as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    info = f"thing-{version}.dist-info"
    assert held.pop(f"{info}/METADATA").decode() == METADATA.replace("Version: 1.2", f"Version: {version}")
    rows = {path: (digest, size) for path, digest, size in csv.reader(io.StringIO(held.pop(f"{info}/RECORD").decode()))}
    assert rows.pop(f"{info}/RECORD") == ("", "")
    assert rows.keys() == held.keys() | {f"{info}/METADATA"}
    for path, data in held.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
        assert rows[path] == (f"sha256={digest}", str(len(data)))
    assert held == {
        "thing/__init__.py": b"one = 1\n",
        "thing/METADATA": b"no metadata of the wheel\nVersion: 7\n",
        f"{info}/WHEEL": TAGS.encode(),
        f"{info}/licenses/LICENSE": b"free",
    }


def test_pip_installs_it_where_the_public_version_is_asked_for(tmp_path: Path) -> None:
    wheel = stamp(make_wheel(tmp_path / "a", "one = 1\n"))
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--find-links"]
    where = tmp_path / "site"
    done = subprocess.run(
        [*command, str(wheel.parent), "--target", str(where), "thing==1.2"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    code = "import thing; from importlib.metadata import version; print(thing.one, version('thing'))"
    told = subprocess.run([sys.executable, "-c", code], cwd=where, capture_output=True, text=True, check=True).stdout
    assert told.split() == ["1", wheel.name.split("-")[1]]


@pytest.mark.parametrize("before", ["1.2", "1.2+other.1"])
def test_a_local_version_that_it_has_is_replaced(tmp_path: Path, before: str) -> None:
    wheel = make_wheel(tmp_path / "a", "one = 1\n")
    wanted = stamp(make_wheel(tmp_path / "b", "one = 1\n")).name
    with zipfile.ZipFile(wheel) as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    named = wheel.with_name(f"thing-{before}-py3-none-any.whl")
    with zipfile.ZipFile(named, "w") as archive:
        for name, data in held.items():
            archive.writestr(name.replace("thing-1.2.", f"thing-{before}."), data)
    assert stamp(named).name == wanted
