"""The wheels that the Blender extension carries, so that `fast` computes with Blender's own Python and numpy.

    python scripts/extension_wheels.py --lock

writes ``addon/wheels.txt`` anew for the versions in `PACKAGES`: pip fetches every wheel once, and its hash is noted.
The extension is built from wheels of these hashes alone, with `fetch`.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / "addon" / "wheels.txt"
STORE = ROOT / "out" / "wheels"
"""Where fetched wheels are kept, for the next build."""

PACKAGES = {
    "filelock": "4.2.11",
    "llvmlite": "0.50.0",
    "numba": "0.68.1",
    # The last one that asks for no numpy 2, which Blender 4.5 has not; and one wheel serves every Python.
    "opencv-python-headless": "4.11.0.86",
    "safetensors": "0.8.0",
    "scipy": "1.17.1",
    "threadpoolctl": "3.8.0",
    "trimesh": "5.2.0",
}
"""What is imported beyond numpy by all of the worker's jobs but those with PyTorch."""

PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_13_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
}
"""Blender's names of platforms, and pip's for what runs on the oldest system of each."""

PYTHONS = ("3.11", "3.13")
"""Those of Blender 4.5 to 5.0, and 5.1 to 5.2, as they come from blender.org."""

OTHER_PYTHONS = ("3.14",)
"""Those of Blenders that systems build with a Python of their own (Debian); one more would make the zip too large."""


class WheelError(Exception):
    """The wheels cannot be had; the message says why."""


def fetch(platform: str, pythons: Iterable[str] = PYTHONS, store: Path = STORE) -> list[Path]:
    """The wheels of a platform for some Pythons; those that are not in the store yet are fetched by pip.

    Parameters
    ----------
    platform
        One of `PLATFORMS`.
    pythons
        Versions of Python, as ``"3.13"``.
    store
        A folder with a folder for each platform.

    Returns
    -------
    Their paths, by name.

    Raises
    ------
    WheelError
        If pip cannot fetch one whose hash is in the lock.
    """
    folder = store / platform
    hashes = locked_hashes()
    wheels: set[Path] = set()
    for python in pythons:
        found = stored(folder, python, hashes)
        if len(found) < len(PACKAGES):
            download(folder, platform, python, ["--require-hashes", "-r", str(LOCK)])
            found = stored(folder, python, hashes)
        missing = sorted(PACKAGES.keys() - found.keys())
        if missing:
            raise WheelError(f"pip brought no wheel of {', '.join(missing)} for Python {python} on {platform}")
        wheels |= set(found.values())
    return sorted(wheels)


def stored(folder: Path, python: str, hashes: set[str]) -> dict[str, Path]:
    """The wheels of a folder that are for a Python and whose hash is in the lock, by the name of their package."""
    return {
        package_of(wheel): wheel
        for wheel in sorted(folder.glob("*.whl"))
        if is_for(wheel, python) and package_of(wheel) in PACKAGES and hash_of(wheel) in hashes
    }


def download(folder: Path, platform: str, python: str, what: list[str]) -> None:
    """Have pip put wheels into a folder.

    Raises
    ------
    WheelError
        With what pip says, if it fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-input"]
    command += ["--no-deps", "--only-binary=:all:", "--implementation", "cp", "--python-version", python]
    for tag in PLATFORMS[platform]:
        command += ["--platform", tag]
    done = subprocess.run([*command, "-d", str(folder), *what], capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.strip() or done.stdout.strip()
        raise WheelError(f"pip could not fetch the wheels for Python {python} on {platform}:\n{said}")


def is_for(wheel: Path, python: str) -> bool:
    """Whether a wheel is for a Python, by its name: that very one, an older one's stable interface, or any Python 3."""
    tag, interface = wheel.stem.split("-")[-3:-1]
    if "py3" in tag.split("."):
        return True
    minor = python.partition(".")[2]
    return tag == interface == f"cp3{minor}" or (interface == "abi3" and int(tag.removeprefix("cp3")) <= int(minor))


def package_of(wheel: Path) -> str:
    """The name of the package that a wheel holds, as in `PACKAGES`."""
    return wheel.name.split("-")[0].replace("_", "-").lower()


def hash_of(file: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def locked_hashes(lock: Path = LOCK) -> set[str]:
    """All hashes of the lock."""
    return set(re.findall(r"--hash=sha256:([0-9a-f]{64})", lock.read_text(encoding="utf-8")))


def write_lock(store: Path = STORE, lock: Path = LOCK) -> None:
    """Fetch the wheels of `PACKAGES` for every platform and Python, and note their hashes."""
    hashes: dict[str, set[str]] = {name: set() for name in PACKAGES}
    for platform in PLATFORMS:
        for python in (*PYTHONS, *OTHER_PYTHONS):
            download(store / platform, platform, python, [f"{name}=={version}" for name, version in PACKAGES.items()])
        for wheel in (store / platform).glob("*.whl"):
            name = package_of(wheel)
            if wheel.name.split("-")[1] == PACKAGES.get(name):
                hashes[name].add(hash_of(wheel))
    lines = ["# The wheels of the Blender extension, made by scripts/extension_wheels.py --lock; for pip."]
    for name, version in PACKAGES.items():
        lines.append(
            " \\\n    ".join([f"{name}=={version}", *(f"--hash=sha256:{each}" for each in sorted(hashes[name]))])
        )
    lock.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description="The wheels that the Blender extension carries.")
    parser.add_argument("--lock", action="store_true", required=True, help="write addon/wheels.txt anew")
    parser.add_argument("--wheels", type=Path, default=STORE, help="folder where fetched wheels are kept [out/wheels]")
    try:
        write_lock(parser.parse_args().wheels.resolve())
    except WheelError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
