"""The wheels of the Blender extension: the lock, which wheels are for whom, and that nothing else is taken."""

from __future__ import annotations

import hashlib
import re
import tomllib
from pathlib import Path

import pytest

from scripts import build_extension, extension_wheels
from scripts.build_extension import Edition, manifest_of
from scripts.extension_wheels import LOCK, PACKAGES, PLATFORMS, WheelError, fetch, is_for, package_of

CONSTRAINTS = LOCK.parents[1] / "constraints.txt"


def test_the_lock_has_exact_versions_and_hashes_of_every_package() -> None:
    locked = re.findall(r"^([\w-]+)==(\S+) \\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", LOCK.read_text(), re.M)
    assert {name: version for name, version, _ in locked} == PACKAGES
    many = {name: hashes.count("--hash=") for name, _, hashes in locked}
    for name in ("scipy", "numba", "llvmlite"):
        assert many[name] == len(PLATFORMS) * 3, name  # one for each platform and Python
    for name in ("opencv-python-headless", "safetensors"):
        assert many[name] == len(PLATFORMS), name
    assert not {"numpy", "torch"} & PACKAGES.keys()


def test_the_versions_are_those_that_all_other_tests_run_with() -> None:
    pinned = set(re.findall(r"^([\w-]+==[^\s;]+)", CONSTRAINTS.read_text(), re.M))
    assert {f"{name}=={version}" for name, version in PACKAGES.items()} <= pinned


@pytest.mark.parametrize(
    ("wheel", "pythons"),
    [
        ("scipy-1.17.1-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl", {"3.11"}),
        ("llvmlite-0.50.0-cp313-cp313-win_amd64.whl", {"3.13"}),
        ("numba-0.68.1-cp313-cp313t-win_amd64.whl", set()),
        ("opencv_python_headless-4.11.0.86-cp37-abi3-win_amd64.whl", {"3.11", "3.13"}),
        ("safetensors-0.8.0-cp312-abi3-macosx_11_0_arm64.whl", {"3.13"}),
        ("filelock-4.2.11-py3-none-any.whl", {"3.11", "3.13"}),
        ("six-1.0-py2.py3-none-any.whl", {"3.11", "3.13"}),
    ],
)
def test_for_which_python_a_wheel_is(wheel: str, pythons: set[str]) -> None:
    assert {python for python in ("3.11", "3.13") if is_for(Path(wheel), python)} == pythons
    assert "_" not in package_of(Path(wheel))


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two packages, one of them with a wheel for each Python, and a lock of their hashes."""
    monkeypatch.setattr(extension_wheels, "PACKAGES", {"one": "1", "two-b": "2"})
    folder, hashes = tmp_path / "wheels" / "linux-x64", []
    folder.mkdir(parents=True)
    for name in ("one-1-py3-none-any", "two_b-2-cp311-cp311-linux_x86_64", "two_b-2-cp313-cp313-linux_x86_64"):
        (folder / f"{name}.whl").write_bytes(name.encode())
        hashes.append(hashlib.sha256(name.encode()).hexdigest())
    lock = " ".join(f"--hash=sha256:{each}" for each in hashes)
    monkeypatch.setattr(extension_wheels, "locked_hashes", lambda: set(re.findall(r"sha256:(\w+)", lock)))
    return tmp_path / "wheels"


def test_wheels_that_are_there_are_not_fetched_again(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extension_wheels, "download", lambda *_: pytest.fail("the network was used"))
    assert [wheel.name[:12] for wheel in fetch("linux-x64", ["3.11", "3.13"], store)] == [
        "one-1-py3-no", "two_b-2-cp31", "two_b-2-cp31",
    ]  # fmt: skip
    assert [wheel.stem.split("-")[2] for wheel in fetch("linux-x64", ["3.13"], store)] == ["py3", "cp313"]


def test_a_wheel_of_another_hash_is_never_taken(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(extension_wheels, "download", lambda folder, platform, python, what: asked.append(python))
    (store / "linux-x64" / "two_b-2-cp313-cp313-linux_x86_64.whl").write_bytes(b"changed")
    with pytest.raises(WheelError, match="no wheel of two-b for Python 3.13 on linux-x64"):
        fetch("linux-x64", ["3.11", "3.13"], store)
    assert asked == ["3.13"]


def test_pip_refuses_what_is_not_in_the_lock(tmp_path: Path) -> None:
    wheel = tmp_path / "one-1-py3-none-any.whl"
    wheel.write_bytes(b"no wheel at all")
    (tmp_path / "lock.txt").write_text(f"one @ {wheel.as_uri()} --hash=sha256:{'0' * 64}\n")
    with pytest.raises(WheelError, match="could not fetch the wheels for Python 3.13 on windows-x64"):
        extension_wheels.download(
            tmp_path / "out", "windows-x64", "3.13", ["--require-hashes", "-r", str(tmp_path / "lock.txt")]
        )


def test_the_manifest_of_each_edition() -> None:
    names = ["frametwin-0.1.0-py3-none-any.whl", "scipy-1-cp313-cp313-win_amd64.whl"]
    whole = tomllib.loads(manifest_of(Edition("windows-x64"), names))
    assert whole["platforms"] == ["windows-x64"] and whole["wheels"] == [f"./wheels/{name}" for name in names]
    assert whole["version"] == build_extension.project_version() and "network" in whole["permissions"]
    store = tomllib.loads(manifest_of(Edition("", store=True), names[:1]))
    assert "platforms" not in store and "network" not in store["permissions"]
    assert Edition("windows-x64").name == f"frametwin-{whole['version']}-windows_x64"
    assert Edition("", store=True).name == f"frametwin-{whole['version']}-store"
    assert Edition("linux-x64", ("3.14",)).name == f"frametwin-{whole['version']}-linux_x64-python3.14"
