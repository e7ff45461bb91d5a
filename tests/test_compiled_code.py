"""Compiled code cannot go stale: what a compiled function is made of lies in the file by which numba caches it.

numba compiles a function together with the helpers that it calls and the constants that it reads, and keeps the machine
code until the file of that function changes. An edit of another file would go unnoticed. So nothing that goes into
compiled code may come from another file of the project; here the source of every file is looked through for that.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
COMPILERS = {"njit", "jit", "vectorize", "guvectorize", "stencil", "cfunc", "jit_module"}
COMPILERS |= {"overload", "overload_method", "overload_attribute", "register_jitable", "intrinsic", "generated_jit"}
OUTSIDE = ("frametwin", "frametwin_blender")


def sources() -> list[Path]:
    """Every file of the project."""
    return [path for folder in ("frametwin", "addon", "scripts") for path in sorted((ROOT / folder).rglob("*.py"))]


def names_in(node: ast.AST) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


class CompiledFile:
    """A file's top-level names, what each is made of, and which of its functions numba compiles."""

    def __init__(self, text: str) -> None:
        self.tree = ast.parse(text)
        self.numba: set[str] = set()  # the name that numba has here
        self.compilers: set[str] = set()  # the names that its compilers have here
        self.elsewhere: dict[str, str] = {}  # names that come from other files of the project, and from which
        self.made_of: dict[str, set[str]] = {}
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                self._look_at_import(node)
        for node in self.tree.body:
            for name in defined(node):
                self.made_of.setdefault(name, set()).update(ingredients(node))
        self.compiled = [node for node in ast.walk(self.tree) if self._is_compiled(node)]

    def _look_at_import(self, node: ast.Import | ast.ImportFrom) -> None:
        module = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
        relative = isinstance(node, ast.ImportFrom) and node.level > 0
        for alias in node.names:
            source = module or alias.name
            name = alias.asname or alias.name.split(".")[0]
            if source.split(".")[0] == "numba":
                if not module:
                    self.numba.add(name)
                elif alias.name in COMPILERS:
                    self.compilers.add(name)
            elif relative or source.split(".")[0] in OUTSIDE:
                self.elsewhere[name] = f"{'.' * getattr(node, 'level', 0)}{source}"

    def _is_compiled(self, node: ast.AST) -> bool:
        return isinstance(node, ast.FunctionDef) and any(self._compiles(part) for part in node.decorator_list)

    def _compiles(self, node: ast.expr) -> bool:
        node = node.func if isinstance(node, ast.Call) else node
        if isinstance(node, ast.Attribute):
            return node.attr in COMPILERS and isinstance(node.value, ast.Name) and node.value.id in self.numba
        return isinstance(node, ast.Name) and node.id in self.compilers

    def faults(self) -> Iterator[str]:
        """What could go stale, in words."""
        top = [node for node in self.tree.body if isinstance(node, ast.FunctionDef)]
        decorators = {id(getattr(part, "func", part)) for node in self.compiled for part in node.decorator_list}
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Attribute | ast.Name) and self._compiles(node) and id(node) not in decorators:
                yield f"line {node.lineno}: compiles otherwise than by a decorator"
        for node in self.compiled:
            if node not in top:
                yield f"{node.name}: is compiled inside of another function or class"
            elif "*" in self.elsewhere:
                yield f"{node.name}: may use anything of {self.elsewhere['*']}"
            for name in sorted(self._reached(node)):
                if name in self.elsewhere:
                    yield f"{node.name}: uses {name} of {self.elsewhere[name]}"

    def _reached(self, node: ast.FunctionDef) -> set[str]:
        """All names that a function uses, by itself or by way of others of this file."""
        reached: set[str] = set()
        waiting = ingredients(node)
        while waiting:
            name = waiting.pop()
            if name not in reached:
                reached.add(name)
                waiting |= self.made_of.get(name, set())
        return reached


def defined(node: ast.stmt) -> set[str]:
    """The names that a statement at the top of a file defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return {node.name}
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}


def ingredients(node: ast.stmt) -> set[str]:
    """The names that a statement is made of; annotations are not compiled."""
    if not isinstance(node, ast.FunctionDef):
        return names_in(node)
    parts = [*node.body, *node.args.defaults, *[one for one in node.args.kw_defaults if one], *node.decorator_list]
    return set().union(*(names_in(part) for part in parts))


def test_all_that_is_compiled_lies_in_the_file_by_which_it_is_cached() -> None:
    files = {path: CompiledFile(path.read_text(encoding="utf-8")) for path in sources()}
    faults = [f"{path.relative_to(ROOT)}: {fault}" for path, file in files.items() for fault in file.faults()]
    assert not faults
    compiled = {path.name for path, file in files.items() if file.compiled}
    assert {
        "block_kernels.py",
        "rod_kernels.py",
        "nozzle_kernels.py",
        "removal_kernels.py",
    } <= compiled  # they were looked through


BODY = "\n@nb.njit(cache=True)\ndef f(x):\n    return {}\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("from frametwin.a import g" + BODY.format("g(x)"), "f: uses g of frametwin.a"),
        ("from frametwin.a import LIMIT as L" + BODY.format("x + L"), "f: uses L of frametwin.a"),
        ("from frametwin import a" + BODY.format("a.g(x)"), "f: uses a of frametwin"),
        ("import frametwin.a" + BODY.format("frametwin.a.g(x)"), "f: uses frametwin of frametwin.a"),
        ("from . import a" + BODY.format("a.g(x)"), "f: uses a of .a"),
        ("from frametwin.a import L\nM = 2 * L" + BODY.format("x + M"), "f: uses L of frametwin.a"),
        (
            "from frametwin.a import L\n@nb.njit\ndef g(x):\n    return x + L\n" + BODY.format("g(x)"),
            "f: uses L of frametwin.a",
        ),
        ("from frametwin.a import *" + BODY.format("g(x)"), "f: may use anything of frametwin.a"),
        ("from numba import njit\nf = njit(abs)", "line 3: compiles otherwise than by a decorator"),
        ("f = nb.njit(abs)", "line 2: compiles otherwise than by a decorator"),
        ("def g():\n    @nb.njit\n    def f(x):\n        return x\n", "f: is compiled inside of another function"),
    ],
)
def test_every_way_to_go_stale_is_seen(text: str, words: str) -> None:
    faults = list(CompiledFile(f"import numba as nb\n{text}").faults())
    assert any(words in fault for fault in faults), faults


def test_what_is_not_compiled_may_come_from_anywhere() -> None:
    text = "import numba as nb\nimport numpy as np\nfrom math import sqrt\nfrom frametwin.a import g\nL = np.float32(2)"
    text += BODY.format("sqrt(x) * L") + "\ndef h(x):\n    return g(f(x))\n"
    file = CompiledFile(text)
    assert [node.name for node in file.compiled] == ["f"] and not list(file.faults())


def test_an_edit_of_its_file_makes_numba_compile_anew(tmp_path: Path) -> None:
    """What the rule rests on, with the numba that is installed: helpers and constants of the same file count."""
    module = tmp_path / "kernels.py"
    text = "import numba as nb\nSTEP = {}\n@nb.njit\ndef helper(x):\n    return {}\n"
    text += "@nb.njit(cache=True)\ndef kernel(x):\n    return helper(x) + STEP\n"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    code = "from kernels import kernel; print(kernel(10), sum(kernel.stats.cache_hits.values()))"
    command = [sys.executable, "-c", code]
    said = []
    for step, helper in ((1, "x"), (1, "x"), (200, "x"), (200, "x * x * x")):
        module.write_text(text.format(step, helper), encoding="utf-8")
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        said.append(done.stdout.split())
    assert said == [["11", "0"], ["11", "1"], ["210", "0"], ["1200", "0"]]
