"""The table of layers: what each part may import, seen in fresh interpreters and in the source."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HEAVY = ("OpenEXR", "bpy", "cv2", "distributed", "filelock", "matplotlib", "networkx", "numba", "pydantic")
HEAVY += ("rich", "safetensors", "scipy", "torch", "trimesh")
ADAPTERS = ("frametwin/blender", "addon")  # run inside of Blender, beside its own numpy


def light_files() -> list[Path]:
    """The light modules as the lint configuration names them, so that there is one list only; not Blender's own."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    ignores = config["tool"]["ruff"]["lint"]["per-file-ignores"]
    (pattern,) = (key for key, rules in ignores.items() if key.startswith("!") and rules == ["TID253"])
    inner = pattern.removeprefix("!frametwin/{").removesuffix("}.py")
    names = [name for name in braces(inner) if not name.startswith("blender/")]
    return sorted(path for name in names for path in (ROOT / "frametwin").glob(f"{name.replace('*', '**/*')}.py"))


def braces(pattern: str) -> list[str]:
    """The alternatives of a pattern such as ``a,b/{c,d}``."""
    inner = re.search(r"([^,{}]*)\{([^{}]*)\}", pattern)
    if inner is None:
        return pattern.split(",")
    spread = ",".join(f"{inner[1]}{part}" for part in inner[2].split(","))
    return braces(f"{pattern[: inner.start()]}{spread}{pattern[inner.end() :]}")


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules_after(statement: str) -> set[str]:
    """The top-level packages that a fresh interpreter has loaded after a statement."""
    code = f"{statement}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        stdin=subprocess.DEVNULL,
    )
    return {name.split(".")[0] for name in json.loads(result.stdout.splitlines()[-1])}


def imported_packages(path: Path) -> set[str]:
    """The top-level packages that a file imports anywhere, also inside of functions."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.split(".")[0])
    return names


def test_importing_the_package_loads_next_to_nothing() -> None:
    loaded = modules_after("import frametwin")
    assert not loaded & {*HEAVY, "numpy"}
    assert "frametwin" in loaded


def test_light_modules_load_nothing_heavy() -> None:
    names = [module_name(path) for path in light_files()]
    assert {"frametwin", "frametwin.geometry.wireframe", "frametwin.cameras.camera"} <= set(names)
    loaded = modules_after("\n".join(f"import {name}" for name in names))
    culprits = {
        name: sorted(found)
        for name in (names if loaded & set(HEAVY) else ())
        if (found := modules_after(f"import {name}") & set(HEAVY))
    }
    assert not culprits


def test_the_library_never_touches_blender() -> None:
    library = [p for p in ROOT.glob("frametwin/**/*.py") if "blender" not in p.relative_to(ROOT).parts]
    assert library
    assert not [path for path in library if "bpy" in imported_packages(path)]


def test_what_runs_inside_blender_never_imports_what_is_heavy() -> None:
    files = [path for folder in ADAPTERS for path in (ROOT / folder).glob("**/*.py")]
    forbidden = set(HEAVY) - {"bpy"}
    culprits = {str(path): sorted(found) for path in files if (found := imported_packages(path) & forbidden)}
    assert not culprits


def test_imports_are_found_wherever_they_stand(tmp_path: Path) -> None:
    source = "import a.b, c as d\nfrom e.f import g\nfrom . import h\n\n\ndef i():\n    import torch.nn\n"
    (tmp_path / "module.py").write_text(source, encoding="utf-8")
    assert imported_packages(tmp_path / "module.py") == {"a", "c", "e", "torch"}
