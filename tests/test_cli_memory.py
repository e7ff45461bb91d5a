"""Memory that a command has freed is at hand when it asks for as much again."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

ROUNDS = 20

PICTURES = f"""
import resource, sys
import numpy as np
from frametwin.cli.memory import keep_freed_memory

if sys.argv[1] == "kept":
    keep_freed_memory()
np.ones(20 * 2**18), np.ones(20 * 2**17)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range({ROUNDS}):
    pictures = [np.ones(3 * 2**20, dtype=np.float32) for _ in range(4)]
    del pictures
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="a setting of glibc")
def test_pages_of_pictures_are_fetched_once() -> None:
    environment = {"NUMPY_MADVISE_HUGEPAGE": "0", "PATH": ""}
    faults = {}
    for how in ("kept", "given back"):
        command = [sys.executable, "-c", PICTURES, how]
        faults[how] = int(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
    pages = 4 * 12 * 2**20 / 4096
    assert faults["kept"] < 1.5 * pages < 0.5 * ROUNDS * pages < faults["given back"]
