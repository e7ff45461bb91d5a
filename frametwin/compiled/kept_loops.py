"""Compiled loops whose machine code is kept in files, so that numba need not be loaded for what it has compiled before.

The files lie where numba keeps its own: beside the sources, or in the user's cache where these cannot be written, or in
NUMBA_CACHE_DIR. A file is named by all that its code depends on (the source of the loops, the processor, versions, and
kinds of arrays), so that it cannot go stale, and begins with its hash, so that half a file is none.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.compiled.machine_code import Loop, MachineCode, NotUsable, host, linker
from frametwin.compiled.roomy_stack import with_room
from frametwin.errors import InputError
from frametwin.files import write_bytes

Kinds = tuple[tuple[str, int], ...]


class KeptLoops:
    """The loops of a module, by their names, as its attributes.

    They take contiguous arrays and return nothing.

    Parameters
    ----------
    module : str
        Of functions that numba compiles.
    """

    def __init__(self, module: str) -> None:
        self._module = module
        self._linked: dict[tuple[str, Kinds], Loop | None] = {}

    def __getattr__(self, name: str) -> Loop:
        if name.startswith("_"):  # no loop, but something of its own that could not be found
            raise AttributeError(name)

        def loop(*arrays: np.ndarray) -> None:
            self._run(name, arrays)

        setattr(self, name, loop)
        return loop

    def _run(self, name: str, arrays: tuple[np.ndarray, ...]) -> None:
        kinds = tuple((array.dtype.str, array.ndim) for array in arrays)
        if (name, kinds) not in self._linked:  # threads that come here at once find the same
            self._linked[name, kinds] = self._found(name, kinds)
        loop = self._linked[name, kinds]
        if loop is not None and all(array.flags.c_contiguous and array.flags.aligned for array in arrays):
            with contextlib.suppress(NotUsable):  # numba does it again, and tells what is wrong
                loop(*arrays)
                return
        self._by_numba(name, kinds, arrays)

    def _found(self, name: str, kinds: Kinds) -> Loop | None:
        """A loop whose code is kept."""
        with contextlib.suppress(NotUsable, OSError, ImportError, AttributeError, RuntimeError):  # or no home is known
            for folder in self._folders():
                made = read_code(folder / self._file(name, kinds))
                if made is not None:
                    return linker().linked(made, tuple(dimensions for _, dimensions in kinds))
        return None

    def _by_numba(self, name: str, kinds: Kinds, arrays: tuple[np.ndarray, ...]) -> None:
        """Run a loop by numba, which compiles it if need be, and keep the code that was not kept yet."""
        function = getattr(import_module(self._module), name)
        with_room(function, *arrays)
        if self._linked[name, kinds] is not None:
            return
        with contextlib.suppress(NotUsable, OSError, ImportError, AttributeError, InputError, RuntimeError):
            file = self._file(name, kinds)
            made = code_of(function, kinds)
            for folder in self._folders():
                if made is not None and os.access(folder, os.W_OK):
                    write_code(folder / file, made)
                    return

    def _file(self, name: str, kinds: Kinds) -> str:
        key = sha256("\n".join([self._key, name, repr(kinds)]).encode()).hexdigest()
        return f"{self._module.split('.')[-1]}.{name}-{key[:24]}.code"

    @cached_property
    def _source(self) -> Path:
        spec = find_spec(self._module)
        if spec is None or spec.origin is None:
            raise NotUsable(f"{self._module} is no file")
        return Path(spec.origin)

    @cached_property
    def _key(self) -> str:
        return f"{sha256(self._source.read_bytes()).hexdigest()}\n{host()}"

    def _folders(self) -> Iterator[Path]:
        """Where the code may lie."""
        given = os.environ.get("NUMBA_CACHE_DIR")
        if given:
            yield Path(given)
            return
        yield self._source.parent / "__pycache__"
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        yield Path(home) / "numba"


def read_code(path: Path) -> MachineCode | None:
    """The code of a file; ``None`` if there is no such file or it is damaged."""
    if not path.is_file():
        return None
    digest, _, rest = path.read_bytes().partition(b"\n")
    if sha256(rest).hexdigest().encode() != digest:
        return None
    symbol, _, code = rest.partition(b"\n")
    return MachineCode(symbol.decode(errors="replace"), code)


def write_code(path: Path, made: MachineCode) -> None:
    """Write a file for `read_code`, whole or not at all."""
    rest = made.symbol.encode() + b"\n" + made.code
    write_bytes(path, sha256(rest).hexdigest().encode() + b"\n" + rest)


def code_of(function: Any, kinds: Kinds) -> MachineCode | None:
    """The code that numba has kept of a function for contiguous arrays of such kinds; ``None`` if there is none.

    Parameters
    ----------
    function
        What numba's ``njit(cache=True)`` made.
    kinds : tuple of (str, int)
        Type of the numbers and dimensions of each array.
    """
    from numba import types

    for signature, compiled in getattr(function, "overloads", {}).items():  # none where it compiles nothing
        arrays = all(isinstance(one, types.Array) and one.layout == "C" and one.aligned for one in signature)
        if not arrays or compiled.signature.return_type != types.none:
            continue
        if tuple((np.dtype(str(one.dtype)).str, one.ndim) for one in signature) != kinds:
            continue
        store = function._cache
        kept = store._cache_file.load(store._index_key(signature, function.targetctx.codegen()))
        if kept is not None:
            _, form, (code, _) = kept[0]
            symbol = compiled.fndesc.llvm_func_name
            if form == "object" and isinstance(code, bytes) and symbol.encode() in code:
                return MachineCode(symbol, code)
    return None
