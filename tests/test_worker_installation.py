"""Setting up the worker's environment: what is run, what is left when it fails or is cancelled."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from worker_cases import is_gone, script, until

from frametwin.errors import InputError
from frametwin.worker import installation
from frametwin.worker.installation import Installation, Installer, base_python, environment_python, installed_python

posix = pytest.mark.skipif(os.name == "nt", reason="shell scripts and signals are for POSIX")


@pytest.fixture
def wanted(tmp_path: Path) -> Installation:
    wheel = tmp_path / "frametwin-0.1.0-py3-none-any.whl"
    wheel.write_bytes(b"no wheel")
    return Installation(tmp_path / "environment", wheel, base=sys.executable)


def ended(installer: Installer) -> Installer:
    installer.start()
    until(lambda: not installer.running, "the end of the set-up")
    return installer


def test_the_steps(wanted: Installation, tmp_path: Path) -> None:
    constraints = tmp_path / "constraints.txt"
    commands = [
        command for _, command in Installation(wanted.folder, wanted.wheel, constraints, sys.executable).commands()
    ]
    assert commands[0] == [sys.executable, "-m", "venv", "--clear", str(wanted.folder)]
    inside = str(environment_python(wanted.folder))
    assert all(command[0] == inside and str(constraints) in command for command in commands[1:])
    assert "torch" in commands[1] and commands[2][-1] == str(wanted.wheel)
    with pytest.raises(InputError, match="wheel"):
        Installation(wanted.folder, tmp_path / "nowhere.whl").commands()


def test_a_base_that_suits_is_found() -> None:
    assert base_python(sys.executable) == sys.executable
    assert Path(base_python()).exists()
    for other in (os.devnull, "true"):  # one that cannot be run, and a program that is content with anything
        with pytest.raises(InputError, match="is no Python of version 3.11 to 3.13"):
            base_python(other)


def test_an_environment_is_made_and_marked(wanted: Installation, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = [("making the environment", [sys.executable, "-m", "venv", "--without-pip", str(wanted.folder)])]
    monkeypatch.setattr(Installation, "commands", lambda self: steps)
    installer = ended(Installer(wanted))
    assert installer.done and not installer.error
    assert installed_python(wanted.folder) == str(environment_python(wanted.folder))
    ended(Installer(wanted))  # and once more, in the place of the first
    assert installed_python(wanted.folder)


def test_a_step_that_fails_is_told_and_nothing_is_left(wanted: Installation, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import sys; print('ERROR: no such thing'); print('a hint'); sys.exit(1)"
    monkeypatch.setattr(Installation, "commands", lambda self: [("installing", [sys.executable, "-c", code])])
    installer = ended(Installer(wanted))
    assert "while installing: ERROR: no such thing The log says more." in installer.error and not installer.done
    assert "a hint" in installer.log and not wanted.folder.exists()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("WARNING: Retrying after connection broken by 'NewConnectionError('<...>: refused')'", "cannot reach"),
        (
            "WARNING: Retrying after connection broken by 'SSLError(SSLCertVerificationError(1, '[SSL: "
            "CERTIFICATE_VERIFY_FAILED] certificate verify failed: self-signed certificate in certificate chain'))'",
            "certificate of the package index is not trusted",
        ),
        (
            "WARNING: Retrying after connection broken by 'ProxyError('Cannot connect to proxy.', OSError('Tunnel "
            "connection failed: 407 Proxy Authentication Required'))': /simple/torch/",
            "name and a password",
        ),
        (
            "WARNING: Retrying after connection broken by 'ProxyError('Cannot connect to proxy.', "
            "NewConnectionError('<...>: Failed to establish a new connection: [Errno 111] Connection refused'))'",
            "proxy does not answer or refuses",
        ),
        ("ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device", "disk is full"),
    ],
)
def test_usual_causes_are_told_in_words(line: str, words: str) -> None:
    assert words in installation._reason([line, "ERROR: ResolutionImpossible: for help visit the site"])


@posix
def test_cancelling_kills_all_of_it(wanted: Installation, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    slow = script(tmp_path / "slow", f"echo $$ > {tmp_path}/pid; sleep 600 & echo $! > {tmp_path}/child; wait")
    monkeypatch.setattr(Installation, "commands", lambda self: [("installing", [slow])])
    installer = Installer(wanted)
    installer.start()
    until(lambda: (tmp_path / "child").is_file() and (tmp_path / "child").read_text().strip(), "the child")
    installer.cancel()
    until(lambda: not installer.running, "the end of the set-up")
    for name in ("pid", "child"):
        until(lambda name=name: is_gone(int((tmp_path / name).read_text())), "the end of the process")
    assert installer.cancelled and not installer.done and not installer.error and not wanted.folder.exists()


def test_something_else_is_not_deleted(wanted: Installation) -> None:
    wanted.folder.mkdir()
    (wanted.folder / "thesis.txt").write_text("mine")
    installer = ended(Installer(wanted))
    assert "holds something else" in installer.error and (wanted.folder / "thesis.txt").read_text() == "mine"


def test_variables_of_blenders_python_are_kept_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    process = installation._start([sys.executable, "-c", "import os; print('PYTHONPATH' in os.environ)"])
    assert process.communicate()[0].strip() == "False"
