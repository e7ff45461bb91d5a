"""Build frametwin-VERSION-PLATFORM.zip, the Blender extension, and check it with Blender's own extension tool.

    python scripts/build_extension.py --out DIR                           for this computer's platform
    python scripts/build_extension.py --platform windows-x64 --out DIR    for another one
    python scripts/build_extension.py --store --out DIR                   without Set Up: it never uses the network
    python scripts/build_extension.py --bare --out DIR                    without wheels, for a Python of one's own
    python scripts/build_extension.py --repository DIR                    an index of the zips in DIR, to be served

The zip carries the wheels of addon/wheels.txt, which pip fetches once. Run it with a Python that has the bpy wheel, and
hatchling (without hatchling, pip fetches it).
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # where this project is not installed

from scripts.extension_wheels import PLATFORMS, PYTHONS, STORE, WheelError, fetch
from scripts.library_wheel import stamp

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon" / "frametwin_blender"
MANIFEST = ROOT / "blender_manifest.toml"
NETWORK = "network = "
"""How the line of the manifest begins that asks for the network."""

OF_SET_UP = ("set_up.py", "constraints.txt")
"""What the edition without Set Up leaves out."""


class BuildError(Exception):
    """The extension cannot be built; the message says why."""


@dataclass(frozen=True)
class Edition:
    """Which extension is built.

    Attributes
    ----------
    platform
        Blender's name of the platform; empty for a zip without wheels, which is for all of them.
    pythons
        Versions of Python for which there are wheels.
    store
        Whether Set Up and the network are left out.
    """

    platform: str
    pythons: Sequence[str] = PYTHONS
    store: bool = False

    @property
    def name(self) -> str:
        """Of the zip, without its suffix."""
        others = [f"python{python}" for python in self.pythons] if tuple(self.pythons) != PYTHONS else []
        words = ["frametwin", project_version(), *(["store"] if self.store else [])]
        return "-".join([*words, *([self.platform.replace("-", "_"), *others] if self.platform else [])])


def build(out: Path, edition: Edition, wheels: Path = STORE) -> Path:
    """Build and validate the zip; an older one is replaced only by a valid one.

    Parameters
    ----------
    out
        The folder for it.
    edition
        What it is.
    wheels
        The folder in which fetched wheels are kept.

    Returns
    -------
    Its path, in ``out``.

    Raises
    ------
    BuildError, WheelError
        If a tool is missing or one of them fails.
    """
    tool = extension_tool()
    carried = fetch(edition.platform, edition.pythons, wheels) if edition.platform else []
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".build-") as scratch:
        stage, made = Path(scratch, "stage"), Path(scratch, f"{edition.name}.zip")
        lay_out(stage, edition, carried)
        run(sys.executable, tool, "build", "--source-dir", stage, "--output-filepath", made)
        run(sys.executable, tool, "validate", made)
        os.replace(made, out / made.name)
        return out / made.name


def lay_out(stage: Path, edition: Edition, carried: Sequence[Path]) -> None:
    """Put everything that belongs into the zip into a folder."""
    shutil.copytree(ADDON, stage, ignore=shutil.ignore_patterns("__pycache__"))
    for extra in ("constraints.txt", "LICENSE", "docs/blender.md"):
        shutil.copy(ROOT / extra, stage)
    if links := published_links():
        (stage / "links.json").write_text(json.dumps(links), encoding="utf-8")
    if edition.store:
        for name in OF_SET_UP:
            (stage / name).unlink()
    isolation = ["--no-build-isolation"] if importlib.util.find_spec("hatchling") else []
    run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", *isolation, "-w", stage / "wheels", ROOT)
    (library,) = (stage / "wheels").iterdir()
    stamp(library)
    for wheel in carried:
        shutil.copy(wheel, stage / "wheels")
    names = sorted(path.name for path in (stage / "wheels").iterdir())
    (stage / MANIFEST.name).write_text(manifest_of(edition, names), encoding="utf-8")


def manifest_of(edition: Edition, wheels: Sequence[str]) -> str:
    """The manifest, with the version, the wheels and the platform put in."""
    lines = MANIFEST.read_text(encoding="utf-8").replace("{version}", project_version()).splitlines()
    if edition.store:
        lines = [line for line in lines if not line.startswith(NETWORK)]
    at = lines.index("wheels = []")
    website = published_links().get("documentation")
    if website:
        lines.insert(at, f'website = "{website}"')
        at += 1
    lines[at : at + 1] = ["wheels = [", *(f'  "./wheels/{name}",' for name in wheels), "]"]
    if edition.platform:
        lines.insert(at, f'platforms = ["{edition.platform}"]')
    return "\n".join(lines) + "\n"


def make_repository(folder: Path) -> Path:
    """Write the index of a folder of zips, so that any web server can serve it to Blender; its path.

    Raises
    ------
    BuildError
        If there are no zips, or Blender's tool fails.
    """
    if not list(folder.glob("*.zip")):
        raise BuildError(f"{folder} holds no zip: build one with --out {folder} first")
    run(sys.executable, extension_tool(), "server-generate", "--repo-dir", folder, "--html")
    listed = json.loads((folder / "index.json").read_text(encoding="utf-8"))["data"]
    if len(listed) < len(list(folder.glob("*.zip"))):
        raise BuildError(f"{folder}/index.json leaves out zips: is there more than one for a platform?")
    return folder / "index.json"


def project_version() -> str:
    """The version, from the only place where it is written; read and not imported, so that no other one is taken."""
    tree = ast.parse((ROOT / "frametwin" / "__init__.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__version__":
            return str(ast.literal_eval(node.value))
    raise BuildError("frametwin/__init__.py has no __version__")


def published_links() -> dict[str, str]:
    """Addresses of the documentation and of the list of issues, where pyproject.toml names them."""
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"].get("urls", {})
    known = {"documentation": ("Documentation", "Homepage", "Repository"), "issues": ("Issues",)}
    found = {kind: [urls[name] for name in names if name in urls] for kind, names in known.items()}
    return {kind: addresses[0] for kind, addresses in found.items() if addresses}


def this_platform() -> str:
    """Blender's name of the platform of this computer.

    Raises
    ------
    BuildError
        If there are no wheels for it.
    """
    systems = {"darwin": "macos"}
    machines = {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64"}
    system, machine = platform.system().lower(), platform.machine().lower()
    name = f"{systems.get(system, system)}-{machines.get(machine, machine)}"
    if name not in PLATFORMS:
        raise BuildError(f"there are no wheels for {name}: give --platform, or build without wheels by --bare")
    return name


def extension_tool() -> Path:
    """Blender's ``blender_ext.py`` in the bpy wheel, found without loading Blender."""
    spec = importlib.util.find_spec("bpy")
    folders = list(spec.submodule_search_locations or []) if spec else []
    for folder in folders:
        for tool in sorted(Path(folder).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")):
            return tool
    raise BuildError("Blender's extension tool is missing: install the bpy wheel (pip install bpy)")


def run(*words: object) -> None:
    """Run a tool; what it says becomes the error if it fails."""
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(f"{words[1]} {words[2]} failed:\n{done.stdout}{done.stderr}")


def parser() -> argparse.ArgumentParser:
    """The options."""
    result = argparse.ArgumentParser(description="Build and validate the Blender extension.")
    result.add_argument("--out", type=Path, help="folder for the zip")
    result.add_argument("--platform", choices=PLATFORMS, help="of the Blender that it is for [this computer's]")
    result.add_argument(
        "--python",
        action="append",
        help="carry wheels for this Python alone, as 3.14 for Debian's Blender; may be repeated [3.11 and 3.13]",
    )
    result.add_argument("--store", action="store_true", help="leave out Set Up and the permission to use the network")
    result.add_argument("--bare", action="store_true", help="leave out the wheels")
    result.add_argument("--wheels", type=Path, default=STORE, help="folder where fetched wheels are kept [out/wheels]")
    result.add_argument("--repository", type=Path, metavar="DIR", help="write the index of the zips in DIR")
    return result


def main() -> int:
    options = parser().parse_args()
    try:
        if options.out is None and options.repository is None:
            raise BuildError("give --out, --repository, or both")
        if options.out is not None:
            name = "" if options.bare else options.platform or this_platform()
            edition = Edition(name, tuple(options.python or PYTHONS), options.store)
            made = build(options.out.resolve(), edition, options.wheels.resolve())
            print(f"{made.stat().st_size / 1e6:.1f} MB", file=sys.stderr)
            print(made)
        if options.repository is not None:
            print(make_repository(options.repository.resolve()))
    except (BuildError, WheelError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
