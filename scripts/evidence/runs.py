"""Runs of cases one after the other, each in a process of its own, so that one can fail and memory is that case's."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
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
        title = f"[{number}/{len(missing)}] {case.experiment} {case.name}"
        code = _run([sys.executable, *command(case)], partial(say, title))
        if code == 130:
            raise KeyboardInterrupt
        if code != 0 or not is_done(out, case):
            say(f"{title} failed")
            failed.append(case)
    return failed


def _run(words: Sequence[str], begun: Callable[[], object]) -> int:
    """Run a command, and tell when it has begun; its exit code.

    It is out of reach of Ctrl-C: when we are told to end, so is it, and waited for.
    """
    with subprocess.Popen(words, start_new_session=True) as process:
        try:
            begun()
            return process.wait()
        except KeyboardInterrupt:
            process.terminate()
            process.wait()
            raise
