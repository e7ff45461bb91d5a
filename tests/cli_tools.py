"""Running the command line in tests."""

from __future__ import annotations

import signal
from pathlib import Path

from click.testing import CliRunner, Result

from frametwin.cli.main import cli


def run(*arguments: str | Path) -> Result:
    """Run a command line in this process."""
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], prog_name="frametwin")


def done(*arguments: str | Path) -> Result:
    """Run one that has to succeed."""
    result = run(*arguments)
    assert result.exit_code == 0, result.stderr
    return result


def refused(*arguments: str | Path, code: int = 2) -> str:
    """The one sentence with which a command refuses its input, or ends otherwise with this exit code."""
    result = run(*arguments)
    assert result.exit_code == code, (result.stdout, result.stderr)
    assert result.stdout == "" and result.stderr.count("\n") == 1 and "Traceback" not in result.stderr
    return result.stderr


def hear_interrupts() -> None:
    """For ``preexec_fn``: tests may run in the background, where children inherit that SIGINT is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
