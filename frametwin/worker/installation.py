"""An environment of its own for the worker: a virtual environment with FrameTwin and PyTorch's CPU build, by pip.

Needs the standard library alone, runs beside the caller, and never touches the Python that runs it.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from frametwin import __version__
from frametwin.errors import Cancelled, FrameTwinError, InputError
from frametwin.worker.interpreter import BLENDERS_OWN

OLDEST, NEWEST = (3, 11), (3, 13)
STAMP = "frametwin-environment.json"
CPU_INDEX = "https://download.pytorch.org/whl/cpu"
"""Where PyTorch's builds without CUDA are; on Windows and macOS the usual ones are such builds."""

LINES_KEPT = 20_000
"""Of what the steps write: all of it, but for a pip that has gone astray."""


@dataclass(frozen=True)
class Installation:
    """What is to be installed.

    Attributes
    ----------
    folder
        Of the environment. Whatever is there is replaced, if it was made by an earlier installation.
    wheel
        FrameTwin's wheel.
    constraints
        Exact versions of everything, or ``None`` for the newest that suit.
    base
        A Python of 3.11 to 3.13; by default the running one if it suits, else one of the search path.
    torch_index
        Where to look for PyTorch besides the usual place; empty for nowhere else.
    """

    folder: Path
    wheel: Path
    constraints: Path | None = None
    base: str = ""
    torch_index: str = CPU_INDEX if sys.platform == "linux" else ""

    def commands(self) -> list[tuple[str, list[str]]]:
        """The steps: what each does, in words, and its command.

        Raises
        ------
        InputError
            If there is no Python that suits, or no wheel.
        """
        if not self.wheel.is_file():
            raise InputError.at(self.wheel, "wheel", "does not exist", "install the extension anew")
        python = str(environment_python(self.folder))
        pip = [python, "-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--progress-bar", "off"]
        if self.constraints is not None:
            pip += ["-c", str(self.constraints)]
        index = ["--extra-index-url", self.torch_index] if self.torch_index else []
        return [
            ("making the environment", [base_python(self.base), "-m", "venv", "--clear", str(self.folder)]),
            ("installing PyTorch", [*pip, "torch", *index]),
            ("installing FrameTwin", [*pip, str(self.wheel)]),
        ]


def environment_python(folder: Path) -> Path:
    """The interpreter of a virtual environment."""
    return folder / "Scripts" / "python.exe" if os.name == "nt" else folder / "bin" / "python"


def installed_python(folder: Path) -> str | None:
    """The Python of an environment that was set up to the end; ``None`` if there is none."""
    python = environment_python(folder)
    return str(python) if (folder / STAMP).is_file() and python.exists() else None


def base_python(given: str = "") -> str:
    """A Python that can make the environment.

    Raises
    ------
    InputError
        If the given one does not suit, or none is found.
    """
    wanted = f"{OLDEST[0]}.{OLDEST[1]} to {NEWEST[0]}.{NEWEST[1]}"
    names = [f"python{NEWEST[0]}.{minor}" for minor in range(NEWEST[1], OLDEST[1] - 1, -1)]
    candidates = [given] if given else [sys.executable or "", *names, "python3", "python"]
    for candidate in candidates:
        found = shutil.which(candidate) if candidate else None
        if found is not None and _suits(found):
            return found
    if given:
        raise InputError.at(given, "Python", f"is no Python of version {wanted}", "give another one")
    remedy = f"install Python {wanted} (python.org, or your system's packages) and set up again"
    raise InputError.at("this computer", "Python", f"has none of version {wanted} that can make environments", remedy)


def _suits(python: str) -> bool:
    test = f"import sys, venv, ensurepip; print('suits' * ({OLDEST} <= sys.version_info[:2] <= {NEWEST}))"
    try:
        done = subprocess.run(
            [python, "-I", "-c", test], stdin=subprocess.DEVNULL, capture_output=True, timeout=20, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and done.stdout.strip() == b"suits"  # other programs end with 0 too


class Installer:
    """An installation under way, in a thread; ask it how far it is.

    Attributes
    ----------
    stage, number, total
        The present step in words, its number from 0, and how many there are.
    log
        The last lines of what the steps wrote.
    error
        Why it failed, in words; empty if it did not, or has not ended.
    """

    def __init__(self, installation: Installation) -> None:
        self.installation = installation
        self.stage, self.number, self.total = "looking for a Python", 0, 3
        self.log: deque[str] = deque(maxlen=LINES_KEPT)
        self.error = ""
        self.cancelled = False
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="set-up of the environment", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self._thread.is_alive()

    @property
    def done(self) -> bool:
        """Whether it ended well."""
        return not self.running and not self.error and not self.cancelled and self._thread.ident is not None

    def cancel(self, wait: float = 0.0) -> None:
        """Stop it; what was installed so far is removed."""
        with self._lock:
            self.cancelled = True
            if self._process is not None:
                _kill_group(self._process)
        if wait and self._thread.ident is not None:
            self._thread.join(wait)

    def _run(self) -> None:
        folder = self.installation.folder
        try:
            _clear(folder)
        except (FrameTwinError, OSError) as error:  # what is there is somebody else's
            self.error = str(error)
            return
        try:
            steps = self.installation.commands()
            self.total = len(steps)
            for self.number, (self.stage, command) in enumerate(steps):
                self._call(command)
            notes: dict[str, Any] = {"frametwin": __version__, "wheel": self.installation.wheel.name}
            (folder / STAMP).write_text(json.dumps(notes) + "\n", encoding="utf-8")
        except Cancelled:
            shutil.rmtree(folder, ignore_errors=True)
        except FrameTwinError as error:
            self.error = str(error)
            shutil.rmtree(folder, ignore_errors=True)
        except OSError as error:
            self.error = f"{folder}: cannot be written ({error.strerror}); choose another place, or free some space."

    def _call(self, command: Sequence[str]) -> None:
        self.log.append("$ " + " ".join(command))
        with self._lock:
            if self.cancelled:
                raise Cancelled("cancelled")
            self._process = _start(command)
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self.log.append(line.rstrip())
        code = self._process.wait()
        if self.cancelled:
            raise Cancelled("cancelled")
        if code:
            raise FrameTwinError(f"The set-up failed while {self.stage}: {_reason(list(self.log))}")


_CAUSES = (
    # The first that fits: pip wraps certificates and proxies into what it says of a network that is not there.
    (
        r"CERTIFICATE_VERIFY_FAILED|SSLCertVerificationError|certificate verify failed|confirming the ssl certificate",
        "the certificate of the package index is not trusted, as where a company's proxy reads along. Give its"
        " certificate in the variable PIP_CERT (a .pem file), and set up again.",
    ),
    (
        r"407 Proxy Authentication|Proxy Authentication Required",
        "the proxy asks for a name and a password. Give them in HTTPS_PROXY (http://name:password@host:port), and set"
        " up again.",
    ),
    (
        r"ProxyError|Tunnel connection failed|Cannot connect to proxy",
        "the proxy does not answer or refuses. Check HTTPS_PROXY, and set up again.",
    ),
    (
        r"NewConnectionError|NameResolutionError|ConnectTimeoutError|ReadTimeoutError|Max retries exceeded",
        "pip cannot reach its package index. Check the network and the proxy, and set up again.",
    ),
    (r"No space left", "the disk is full. Free about 3 GB, and set up again."),
)
"""What pip writes, and what that means."""


def _reason(log: Sequence[str]) -> str:
    """Why a step failed, in words, from what it wrote."""
    written = "\n".join(log)
    for pattern, meaning in _CAUSES:
        if re.search(pattern, written):
            return meaning
    words = next((line for line in reversed(log) if "error" in line.lower()), log[-1])
    return f"{words} The log says more."


def _start(command: Sequence[str]) -> subprocess.Popen[str]:
    """A child in a group of its own, without variables that lead its Python to another one's modules."""
    environment = {name: value for name, value in os.environ.items() if name not in BLENDERS_OWN}
    options: Mapping[str, Any] = {"start_new_session": True}
    if os.name == "nt":
        options = {"creationflags": getattr(subprocess, "CREATE_NO_WINDOW", 0)}
    return subprocess.Popen(
        list(command),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env={**environment, "PYTHONUNBUFFERED": "1"},
        **options,
    )


def _kill_group(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(OSError):
        if os.name == "nt":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)


def _clear(folder: Path) -> None:
    """Make room, unless something else is there."""
    if not folder.exists() or not any(folder.iterdir()):
        folder.mkdir(parents=True, exist_ok=True)
        return
    if not ((folder / "pyvenv.cfg").is_file() or (folder / STAMP).is_file()):
        raise InputError.at(folder, "folder", "holds something else than an environment", "choose another folder")
    shutil.rmtree(folder)
    folder.mkdir(parents=True)
