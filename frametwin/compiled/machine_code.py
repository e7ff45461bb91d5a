"""Machine code that numba once made, called without numba.

numba takes half a second to load before it finds that it has compiled a loop already. The machine code itself needs of
it three small libraries alone: what memory, errors and threads are in it. This module links code to them by llvmlite,
numba's own linker, and calls it as numba would: an array is handed over as two owners, of which there are none here,
its size, the size of an item, where it is, its shape and its strides; a status is returned, 0 for success (numba's
``core/callconv.py`` and ``core/datamodel``). Whatever is not as expected raises `NotUsable`, and numba has to do it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from ctypes import CFUNCTYPE, byref, c_int, c_ssize_t, c_void_p
from dataclasses import dataclass
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_loader
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np

from frametwin.compiled.object_file import missing_symbols

HARMLESS = {"NUMBA_NUM_THREADS", "NUMBA_CACHE_DIR"}
"""Variables of the environment that change nothing of the code; with any other of numba's, numba is asked."""

THREADS = "np.ufunc.omppool"
"""The library of threads that numba takes unless it is told otherwise or finds one that is seldom installed."""

SCHEDULING = (
    "do_scheduling_signed",
    "do_scheduling_unsigned",
    "allocate_sched",
    "deallocate_sched",
    "get_num_threads",
    "set_num_threads",
    "get_thread_id",
    "set_parallel_chunksize",
    "get_parallel_chunksize",
    "get_sched_size",
)
"""What code that runs in threads calls, by the names that both sides know."""

Loop = Callable[..., None]


class NotUsable(Exception):
    """Machine code cannot be linked or called here."""


@dataclass(frozen=True)
class MachineCode:
    """One compiled loop.

    Attributes
    ----------
    symbol : str
        The name of the function in it.
    code : bytes
        An object file.
    """

    symbol: str
    code: bytes


def wanted_threads() -> int:
    """As many as numba would take.

    Raises
    ------
    NotUsable
        If the environment asks for what numba alone understands.
    """
    if not sys.platform.startswith("linux") or {name for name in os.environ if name.startswith("NUMBA_")} - HARMLESS:
        raise NotUsable("numba itself is asked for")
    count = os.environ.get("NUMBA_NUM_THREADS", str(len(os.sched_getaffinity(0))))
    if not count.isdecimal() or int(count) < 1:
        raise NotUsable("no number of threads")
    return int(count)


def host() -> str:
    """What machine code depends on besides its source: the processor and who compiled it."""
    import llvmlite
    import llvmlite.binding as llvm

    version = _folder_of_numba().joinpath("_version.py").read_text(encoding="utf-8")
    processor = (llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    return "\n".join([version, llvmlite.__version__, sys.implementation.cache_tag or "", *processor])


@cache
def linker() -> Linker:
    """The one of this process.

    Raises
    ------
    NotUsable
        If there is none.
    """
    try:
        return Linker(wanted_threads())
    except (ImportError, OSError, AttributeError, RuntimeError) as error:
        raise NotUsable(str(error)) from error


class Linker:
    """Links machine code to what it calls.

    Parameters
    ----------
    threads : int
        That share the loops.
    """

    def __init__(self, threads: int) -> None:
        import llvmlite.binding as llvm

        for name, address in _symbols(threads).items():
            llvm.add_symbol(name, address)
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._llvm = llvm
        self._alone = Lock()

    def linked(self, made: MachineCode, dimensions: tuple[int, ...]) -> Loop:
        """The function that takes contiguous arrays of so many dimensions and returns nothing.

        Raises
        ------
        NotUsable
            If there is no such function in the code, which has to be an object file, or something is missing that it
            calls; by the function, if it reports an error.
        """
        try:
            with self._alone:
                address = self._engine.get_function_address(made.symbol)
                if not address:  # it has not been linked yet
                    self._require_linkable(made.code)
                    self._engine.add_object_file(self._llvm.ObjectFileRef.from_data(made.code))
                    self._engine.finalize_object()
                    address = self._engine.get_function_address(made.symbol)
        except (RuntimeError, ValueError) as error:
            raise NotUsable(str(error)) from error
        if not address:
            raise NotUsable(f"no {made.symbol}")
        kinds = [
            kind
            for count in dimensions
            for kind in (c_void_p, c_void_p, c_ssize_t, c_ssize_t, c_void_p, *[c_ssize_t] * (2 * count))
        ]
        function = CFUNCTYPE(c_int, c_void_p, c_void_p, *kinds)(address)

        def loop(*arrays: np.ndarray) -> None:
            result, error = c_void_p(), c_void_p()
            if function(byref(result), byref(error), *[part for array in arrays for part in _parts(array)]):
                raise NotUsable(f"{made.symbol} reports an error")

        return loop

    def _require_linkable(self, code: bytes) -> None:
        """Refuse what would end the process: what is no object file, and what calls something that is not here.

        Such as vectors of numba's optional library of mathematics, which numba alone loads.
        """
        missing = [name for name in missing_symbols(code) if not self._llvm.address_of_symbol(name)]
        if missing:
            raise NotUsable(f"no {missing[0]}")


def _parts(array: np.ndarray) -> tuple[Any, ...]:
    place = array.__array_interface__["data"][0]
    return None, None, array.size, array.itemsize, place, *array.shape, *array.strides


def _symbols(threads: int) -> dict[str, int]:
    """Addresses of what compiled code calls, by name, and as many threads at hand."""
    helpers, memory = _library("_helperlib").c_helpers, _library("core.runtime._nrt_python").c_helpers
    pool = _library(THREADS)
    found = {f"numba_{name}": address for name, address in helpers.items()}
    found |= {name if name.startswith("_") else f"NRT_{name}": address for name, address in memory.items()}
    found |= {name: getattr(pool, name) for name in SCHEDULING}
    found["numba_parallel_for"] = pool.parallel_for
    CFUNCTYPE(None, c_int)(pool.launch_threads)(threads)  # which does nothing where numba has launched them
    if CFUNCTYPE(c_int)(pool.get_num_threads)() < 1:  # nobody has said how many of them are to work
        CFUNCTYPE(None, c_int)(pool.set_num_threads)(threads)
    return found


def _folder_of_numba() -> Path:
    spec = find_spec("numba")  # which does not import it
    if spec is None or spec.origin is None:
        raise NotUsable("numba is not installed")
    return Path(spec.origin).parent


def _library(name: str) -> ModuleType:
    """One of numba's libraries by itself; where numba comes to be imported later, it finds the same one."""
    full = f"numba.{name}"
    if full in sys.modules:
        return sys.modules[full]
    base = _folder_of_numba().joinpath(*name.split("."))
    for suffix in EXTENSION_SUFFIXES:
        path = base.with_name(base.name + suffix)
        if path.exists():
            loader = ExtensionFileLoader(full, str(path))
            spec = spec_from_loader(full, loader)
            if spec is not None:
                module = module_from_spec(spec)
                loader.exec_module(module)
                return module
    raise NotUsable(f"no library {full}")
