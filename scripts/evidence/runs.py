"""Runs of cases one after the other, each in a process of its own, so that one can fail and memory is that case's."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from frametwin.progress import Progress
from scripts.evidence.cases import Case
from scripts.evidence.records import is_done

Say = Callable[[str], object]


class EverySoOften:
    """Progress as a line of text every few seconds, however many stages there are.

    Parameters
    ----------
    say
        Gets each line.
    """

    PAUSE = 10.0
    """Seconds between two lines."""

    def __init__(self, say: Say) -> None:
        self._say, self._said = say, perf_counter()

    def __call__(self, progress: Progress) -> None:
        if perf_counter() - self._said >= self.PAUSE:
            self._said = perf_counter()
            count = f" {progress.iteration}/{progress.total}" if progress.total else ""
            self._say(f"    {progress.stage}{count}")


def run_all(cases: Sequence[Case], out: Path, command: Callable[[Case], Sequence[str]], say: Say) -> list[Case]:
    """Run every case whose result is not there yet.

    Parameters
    ----------
    cases : list of Case
        In the order in which they run.
    out : Path
        Folder of the results.
    command : callable
        Gives the words of a command that runs one case and writes its result.
    say : callable
        Told of each case.

    Returns
    -------
    list of Case
        Those that failed.

    Raises
    ------
    KeyboardInterrupt
        If the user stops it; what is being run ends too, and nothing of it is written.
    """
    missing = [case for case in cases if not is_done(out, case)]
    say(f"{len(cases) - len(missing)} of {len(cases)} cases are there; {len(missing)} to run.")
    failed = []
    for number, case in enumerate(missing, 1):
        say(f"[{number}/{len(missing)}] {case.experiment} {case.name}")
        done = subprocess.run([sys.executable, *command(case)], check=False)
        if done.returncode == 130:
            raise KeyboardInterrupt
        if done.returncode != 0 or not is_done(out, case):
            say(f"[{number}/{len(missing)}] {case.experiment} {case.name} failed")
            failed.append(case)
    return failed
