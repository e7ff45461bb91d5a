"""Loops that were compiled before run without numba, and never run as they were before an edit."""

from __future__ import annotations

import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from frametwin.compiled.kept_loops import KeptLoops, read_code, write_code
from frametwin.compiled.machine_code import MachineCode
from frametwin.compiled.object_file import missing_symbols
from frametwin.raster import rod_kernels, rods

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="machine code is kept on Linux alone")

KERNELS = """
import numba as nb
import numpy as np

@nb.njit(cache=True)
def scaled(numbers, result):
    for row in range(numbers.shape[0]):
        room = np.empty(numbers.shape[1])
        for column in range(numbers.shape[1]):
            room[column] = {factor} * numbers[row, column]
        for column in range(numbers.shape[1]):
            result[row, column] = room[column]
    if numbers[0, 0] < 0.0:
        raise ValueError("too small")
"""

RUN = """
import sys
import numpy as np
from frametwin.compiled.kept_loops import KeptLoops

numbers = np.arange(6.0).reshape(2, 3) + float(sys.argv[1])
result = np.empty_like(numbers)
try:
    for _ in range(2):
        KeptLoops("kernels").scaled(numbers, result)
    print((result / numbers.clip(1e-9))[1, 2], "numba" in sys.modules)
except ValueError as error:
    print(error, "numba" in sys.modules)
"""


def said(folder: Path, add: float = 0.0, **variables: str) -> list[str]:
    """What a process says that scales some numbers: by how much, and whether it needed numba."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": str(folder), **variables}
    command = [sys.executable, "-B", "-c", RUN, str(add)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


THREADS = """
import sys
import numba
import numpy as np
from frametwin.compiled.machine_code import linker

@numba.njit(parallel=True)
def one(numbers):
    for i in numba.prange(len(numbers)):
        numbers[i] = 1.0

if sys.argv[1] == "told":
    one(np.zeros(9))
    numba.set_num_threads(1)
linker()
print(numba.get_num_threads())
"""


@pytest.mark.parametrize(("order", "threads"), [("told", "1"), ("not told", "2")])
def test_the_number_of_threads_that_numba_was_told_stays(order: str, threads: str) -> None:
    environment = {**os.environ, "NUMBA_NUM_THREADS": "2"}
    command = [sys.executable, "-c", THREADS, order]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [threads]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A module of loops that have been compiled."""
    (tmp_path / "kernels.py").write_text(KERNELS.format(factor="3.0"), encoding="utf-8")
    assert said(tmp_path) == ["3.0", "True"]
    return tmp_path


def test_what_was_compiled_runs_without_numba_until_its_source_is_edited(folder: Path) -> None:
    assert said(folder) == ["3.0", "False"]
    assert said(folder, NUMBA_NUM_THREADS="1") == ["3.0", "False"]
    (folder / "kernels.py").write_text(KERNELS.format(factor="5.0"), encoding="utf-8")
    assert said(folder) == ["5.0", "True"]
    assert said(folder) == ["5.0", "False"]


def test_numba_does_what_is_asked_of_it_and_tells_of_errors(folder: Path) -> None:
    assert said(folder, NUMBA_DISABLE_JIT="1") == ["3.0", "True"]
    assert said(folder, -7.0) == ["too", "small", "True"]


def test_half_a_file_is_none(folder: Path) -> None:
    (kept,) = folder.glob("*.code")
    whole = kept.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", whole[:-1] + bytes([whole[-1] ^ 1])):
        kept.write_bytes(damaged)
        assert read_code(kept) is None
    assert said(folder) == ["3.0", "True"]
    assert kept.read_bytes() == whole and said(folder) == ["3.0", "False"]


@pytest.mark.parametrize("change", ["garbage", "half", "unknown call", "no words"])
def test_code_that_cannot_be_linked_is_left_to_numba(folder: Path, change: str) -> None:
    """A linker would end the process, with all that it has found, for each of these."""
    (path,) = folder.glob("*.code")
    made = read_code(path)
    assert made is not None and missing_symbols(made.code)
    code, name = made.code, missing_symbols(made.code)[0].encode()
    changed = {
        "garbage": bytes(range(256)) * 8,
        "half": code[: len(code) // 2],
        "unknown call": code.replace(name + b"\0", name[:-1] + b"\x7e\0"),
        "no words": code,
    }[change]
    write_code(path, MachineCode(made.symbol, changed))
    if change == "no words":
        rest = b"\xff\xfe\n" + code
        path.write_bytes(sha256(rest).hexdigest().encode() + b"\n" + rest)
    assert said(folder) == ["3.0", "True"]


def test_what_an_object_file_calls_is_read_whole_or_not_at_all(folder: Path) -> None:
    (path,) = folder.glob("*.code")
    made = read_code(path)
    assert made is not None and "NRT_MemInfo_alloc_aligned" in missing_symbols(made.code)
    for length in range(0, len(made.code), max(1, len(made.code) // 50)):
        with pytest.raises(ValueError, match="object file"):
            missing_symbols(made.code[:length])


def test_code_comes_back_as_it_was_written(tmp_path: Path) -> None:
    made = MachineCode("name", b"\x00\n\xff" * 40)
    write_code(tmp_path / "a.code", made)
    assert read_code(tmp_path / "a.code") == made
    assert read_code(tmp_path / "b.code") is None


def test_the_rods_know_the_least_transmittance_of_their_loops() -> None:
    assert rods.DARK == rod_kernels.DARK


def test_kept_loops_do_what_numba_does() -> None:
    """The picture that is compared with nothing: residuals and their squares."""
    rng = np.random.default_rng(3)
    through, target = rng.random((2, 600)).astype(np.float32)
    shapes, offsets = np.array([[10, 20], [20, 20]]), np.array([0, 200])
    found = []
    for loops in (rod_kernels, rods.rod_kernels, rods.rod_kernels):  # the second time it is kept in any case
        residual, losses = np.empty(600, dtype=np.float32), np.empty(2)
        loops.compare(through, target, shapes, offsets, residual, losses)
        found.append((residual, losses))
    assert np.allclose(found[0][0], 1.0 - through - target, atol=1e-6)
    for residual, losses in found[1:]:
        assert np.array_equal(residual, found[0][0]) and np.array_equal(losses, found[0][1])


def test_another_numba_or_llvmlite_than_is_expected_is_left_to_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    def changed() -> str:
        raise AttributeError("get_host_cpu_name")

    monkeypatch.setattr("frametwin.compiled.kept_loops.host", changed)
    residual, losses = np.empty(200, dtype=np.float32), np.empty(1)
    white = np.ones(200, dtype=np.float32)
    KeptLoops("frametwin.raster.rod_kernels").compare(
        white, white, np.array([[10, 20]]), np.array([0]), residual, losses
    )
    assert (residual == -1.0).all()
