"""The command as a process of its own: exit codes, interrupts, terminals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli_tools import done, hear_interrupts

ROOT = Path(__file__).resolve().parent.parent


def process(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "frametwin", *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
        **options,
    )


def test_a_real_process_and_its_exit_codes(tmp_path: Path) -> None:
    result = process("info", "bridge", "--json")
    assert result.returncode == 0 and json.loads(result.stdout)["struts"] == 76 and result.stderr == ""
    result = process("info", tmp_path / "none.json")
    assert result.returncode == 2 and result.stdout == "" and result.stderr.count("\n") == 1
    result = process("fit")
    assert result.returncode == 2 and "Missing argument" in result.stderr


def interrupt_when(arguments: list[str], ready: Callable[[str], bool], number: int) -> tuple[int, list[str], str]:
    """Start a command, send it a signal once a line of its progress says that it is ready.

    A command that does not end is killed, so that the test fails and does not hang.
    """
    child = subprocess.Popen(
        [sys.executable, "-m", "frametwin", *arguments],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hear_interrupts,
    )
    assert child.stdout is not None and child.stderr is not None
    end = threading.Timer(120.0, child.kill)
    end.start()
    lines = []
    for line in child.stderr:
        lines.append(line)
        if ready(line):
            for _ in range(3):  # an impatient user changes nothing
                child.send_signal(number)
                time.sleep(0.02)
            break
    lines += child.stderr.readlines()
    out = child.stdout.read()
    end.cancel()
    return child.wait(timeout=60), lines, out


LONG = ["--views", "500", "--size", "800x600"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals that one process sends to another")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_leaves_nothing_behind(tmp_path: Path, number: int) -> None:
    out = tmp_path / "deep" / "capture"
    code, lines, stdout = interrupt_when(
        ["simulate", "lattice_tower", "--out", str(out), *LONG],
        lambda line: line.startswith("silhouettes 0/500"),
        number,
    )
    assert code == 130 and stdout == ""
    assert lines[-1] == "Interrupted.\n" and not any("Traceback" in line for line in lines)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals that one process sends to another")
def test_an_interrupted_fit_keeps_the_run_before(tmp_path: Path) -> None:
    capture, old = tmp_path / "capture", tmp_path / "run"
    done("simulate", "bridge", "--out", capture, "--size", "128x96", "--views", "3", "--quiet")
    old.mkdir()
    (old / "twin.json").write_text("an earlier twin")
    slow = ["--preset", "paper-lattice", "--set", "iterations=100000"]
    code, lines, stdout = interrupt_when(
        ["fit", str(capture), "--out", str(old), "--overwrite", "--json", *slow],
        lambda line: line.startswith("fitting"),
        signal.SIGINT,
    )
    assert code == 130 and stdout == "" and lines[-1] == "Interrupted.\n"
    assert [path.read_text() for path in old.iterdir()] == ["an earlier twin"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["capture", "run"]


@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals are for POSIX")
def test_a_terminal_gets_a_bar_that_is_gone_at_the_end(tmp_path: Path) -> None:
    import pty

    leader, follower = pty.openpty()
    child = subprocess.Popen(
        [
            *[sys.executable, "-m", "frametwin", "simulate", "bridge", "--out", str(tmp_path / "c")],
            *["--size", "128x96", "--views", "3", "--json"],
        ],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=follower,
        env={**os.environ, "TERM": "xterm-256color"},
    )
    os.close(follower)
    shown = b""
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        try:
            part = os.read(leader, 4096)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        shown += part
    assert child.stdout is not None
    assert json.loads(child.stdout.read())["views"] == 3 and child.wait(timeout=60) == 0
    os.close(leader)
    assert b"\x1b[?25l" in shown and shown.rstrip().endswith((b"\x1b[2K", b"\x1b[?25h", b"\r", b"\x1b[1A"))
