"""Build frametwin-VERSION.zip, the Blender extension, and check it with Blender's own extension tool.

    python scripts/build_extension.py --out DIR

Run it with a Python that has the bpy wheel, and hatchling (without hatchling, pip fetches it).
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon" / "frametwin_blender"
MANIFEST = ROOT / "blender_manifest.toml"


class BuildError(Exception):
    """The extension cannot be built; the message says why."""


def build(out: Path) -> Path:
    """Build and validate the zip; an older one is replaced only by a valid one.

    Returns
    -------
    Its path, in ``out``.

    Raises
    ------
    BuildError
        If a tool is missing or one of them fails.
    """
    tool, version = extension_tool(), project_version()
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".build-") as scratch:
        stage, made = Path(scratch, "stage"), Path(scratch, f"frametwin-{version}.zip")
        shutil.copytree(ADDON, stage, ignore=shutil.ignore_patterns("__pycache__"))
        for extra in ("constraints.txt", "LICENSE"):
            shutil.copy(ROOT / extra, stage)
        manifest = MANIFEST.read_text(encoding="utf-8").replace("{version}", version)
        (stage / MANIFEST.name).write_text(manifest, encoding="utf-8")
        isolation = ["--no-build-isolation"] if importlib.util.find_spec("hatchling") else []
        run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", *isolation, "-w", stage / "wheels", ROOT)
        run(sys.executable, tool, "build", "--source-dir", stage, "--output-filepath", made)
        run(sys.executable, tool, "validate", made)
        os.replace(made, out / made.name)
        return out / made.name


def project_version() -> str:
    """The version, from the only place where it is written; read and not imported, so that no other one is taken."""
    tree = ast.parse((ROOT / "frametwin" / "__init__.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__version__":
            return str(ast.literal_eval(node.value))
    raise BuildError("frametwin/__init__.py has no __version__")


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


def main() -> int:
    parser = argparse.ArgumentParser(description="Build and validate the Blender extension.")
    parser.add_argument("--out", type=Path, required=True, help="folder for the zip")
    try:
        print(build(parser.parse_args().out.resolve()))
    except BuildError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
