"""Set FrameTwin up and run it, with nothing but Python: ``python3 scripts/run.py demo`` or ``... test``.

The first call makes a virtual environment and installs the exact versions of constraints.txt; later calls
find them there and start at once. Standard library only; Linux, macOS and Windows.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OLDEST, NEWEST = (3, 11), (3, 13)
BLENDER_PYTHONS = {(3, 11): "Blender 4.5 LTS", (3, 13): "Blender 5.2 LTS"}
"""Which Blender there is as a module for which Python; each of its releases belongs to one."""
STAMP = "frametwin-setup.json"
OTHER_TESTS = ("tests/blender",)
OTHER_PACKAGES = ("bpy", "pytest", "pytest-timeout", "pytest-xdist", "hatchling")
OTHER_MODULES = ("bpy", "pytest", "pytest_timeout", "xdist", "hatchling")
"""What is installed beside Blender's other generation, and what of it can be imported then."""
SURROUNDINGS = {"NO_MKDOCS_2_WARNING": "1", "PYTHONDONTWRITEBYTECODE": ""}
"""For the tools that tasks run: no news of the theme's successor between the lines of a test, and bytecode is kept, so
that each of the thousand processes that tests start need not compile all sources anew."""
MOST_PROCESSES = 4
"""That share the tests; each loads PyTorch and Blender."""
CPU_INDEX = "https://download.pytorch.org/whl/cpu"
BLENDER_PACKAGES = ("libxrender1", "libxfixes3", "libxi6", "libxkbcommon0", "libsm6", "libgl1", "libegl1")

TASKS = {
    "demo": "run a frame of the project through simulation, pictures, fit and evaluation, into out/first",
    "test": "lint, types, documentation, then all tests, those of Blender's part once more with its other generation",
    "lint": "ruff check and ruff format --check",
    "types": "mypy over library, add-on and scripts",
    "docs": "build the documentation into out/site; every link in it is checked",
    "setup": "only make the virtual environment and install",
}


class SetupError(Exception):
    """Something that the user has to put right, in plain words."""


def main(arguments: list[str]) -> int:
    """Set up where needed, run the task, return its exit code."""
    own, extra = split_arguments(arguments)
    options = parser().parse_args(own)
    try:
        venv = Path(os.environ.get("FRAMETWIN_VENV") or ROOT / ".venv").absolute()
        python = set_up(venv, {"docs", "test", *(["blender"] if options.blender else [])}, options.torch_index)
        if options.task != "test" or not options.blender:
            return run_task(options.task, python, extra)
        with ThreadPoolExecutor(1) as pool:  # while the checks run, of which one processor does most
            other = pool.submit(other_blender, venv, python, options.both_blenders)
            code = run_task(options.task, python, extra)
            return test_other_blender(other.result(), python, extra) or code
    except SetupError as error:
        print(f"\nFrameTwin cannot be set up: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nInterrupted.", file=sys.stderr)
        return 130


def parser() -> argparse.ArgumentParser:
    """The options of this script; whatever follows ``--`` belongs to the task."""
    tasks = "\n".join(f"  {name:6} {text}" for name, text in TASKS.items())
    result = argparse.ArgumentParser(
        prog="run.py",
        description="Set FrameTwin up in a virtual environment of its own, then run a task in it.",
        epilog=f"tasks:\n{tasks}\n\nexample: python3 scripts/run.py test -- -k cameras\n\n"
        "The environment is .venv beside this project, or the folder named by FRAMETWIN_VENV.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    result.add_argument("task", choices=TASKS, metavar="task", help=", ".join(TASKS))
    result.add_argument(
        "--torch-index",
        metavar="URL",
        help=f"also look for PyTorch here, e.g. {CPU_INDEX} for the small CPU build",
    )
    result.add_argument(
        "--no-blender", dest="blender", action="store_false", help="do without Blender as a Python module (bpy)"
    )
    result.add_argument(
        "--both-blenders",
        action="store_true",
        help="of test: fail where the Python of Blender's other generation is missing, in place of leaving it out",
    )
    return result


def split_arguments(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Cut at the first ``--``: options of this script, and arguments of the task."""
    at = arguments.index("--") if "--" in arguments else len(arguments)
    return arguments[:at], arguments[at + 1 :]


# --- Python and its virtual environment


def suits(version: tuple[int, ...]) -> bool:
    """Whether FrameTwin runs on this version of Python."""
    return OLDEST <= tuple(version[:2]) <= NEWEST


def find_python() -> str:
    """This interpreter if its version suits, otherwise the newest one on the PATH that does."""
    if suits(tuple(sys.version_info[:2])):
        return sys.executable
    for minor in range(NEWEST[1], OLDEST[1] - 1, -1):
        found = shutil.which(f"python3.{minor}")
        if found:
            return found
    raise SetupError(
        f"it needs Python {OLDEST[0]}.{OLDEST[1]} to {NEWEST[0]}.{NEWEST[1]}, and this is Python "
        f"{platform.python_version()}. Install one of those and start the script with it."
    )


def venv_python(venv: Path, windows: bool = os.name == "nt") -> Path:
    """The interpreter of a virtual environment."""
    return venv / "Scripts" / "python.exe" if windows else venv / "bin" / "python"


def make_venv(venv: Path) -> Path:
    """Make the virtual environment unless it is there and works."""
    python = venv_python(venv)
    if python.exists() and succeeds([python, "-m", "pip", "--version"]):
        version = json.loads(output([python, "-c", "import json, sys; print(json.dumps(sys.version_info[:2]))"]))
        if not suits(tuple(version)):
            raise SetupError(
                f"the virtual environment {venv} has Python {version[0]}.{version[1]}, which does not suit. "
                "Delete the folder, or name another one by FRAMETWIN_VENV."
            )
        return python
    if venv.exists() and not (venv / "pyvenv.cfg").exists() and (venv.is_file() or any(venv.iterdir())):
        raise SetupError(f"{venv} is in the way: it is not a virtual environment. Name another folder.")
    base = find_python()
    say(f"Making the virtual environment {venv}")
    if not succeeds([base, "-c", "import ensurepip, venv"]):
        minor = output([base, "-c", "import sys; print(sys.version_info[1])"]).strip()
        install_debian_packages([f"python3.{minor}-venv"], f"{base} cannot make virtual environments")
    if call([base, "-m", "venv", "--clear", venv]) != 0:
        raise SetupError(f"the virtual environment {venv} could not be made; the reason is above.")
    return python


# --- What is installed


def set_up(venv: Path, extras: set[str], torch_index: str | None) -> Path:
    """Make the environment and install what is missing; returns its interpreter."""
    python = make_venv(venv)
    stamp = venv / STAMP
    version = output([python, "-c", "import sys; print(sys.version)"]).strip()
    if "blender" in extras and not has_blender(version):
        say("Without Blender: its module needs Python 3.11 (Blender 4.5) or 3.13 (Blender 5.2)")
        extras = extras - {"blender"}
    key, done = fingerprint(ROOT, version), read_stamp(stamp)
    if done.get("key") == key and extras <= set(done.get("extras", [])):
        return python
    extras = extras | set(done.get("extras", []))
    if "blender" in extras:
        check_blender()
    stamp.unlink(missing_ok=True)
    pip = pip_install(python)
    torch = pinned("torch", (ROOT / "constraints.txt").read_text(encoding="utf-8"))
    say(f"Installing {torch}")
    if torch_index is None and sys.platform == "linux":
        print(f"(If pip takes the CUDA build, some gigabytes: --torch-index {CPU_INDEX})", flush=True)
    # First and alone: a CPU build that pip is told to look for is taken, and that place gives nothing else.
    install([*pip, torch, *(["--extra-index-url", torch_index] if torch_index else [])], "PyTorch")
    say("Installing FrameTwin and the other packages it needs")
    install([*pip, "-e", f".[{','.join(sorted(extras))}]"], "FrameTwin")
    stamp.write_text(json.dumps({"key": key, "extras": sorted(extras)}) + "\n", encoding="utf-8")
    return python


def pip_install(python: Path) -> list:
    """The beginning of a command that installs something, in the versions of the constraints."""
    quiet = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"]
    return [python, "-m", "pip", "install", *quiet, "-c", "constraints.txt"]


def fingerprint(root: Path, python_version: str) -> str:
    """Changes when an installed environment no longer fits the project."""
    digest = hashlib.sha256()
    for name in ("pyproject.toml", "constraints.txt"):
        digest.update((root / name).read_bytes())
    digest.update(f"{root}\n{python_version}".encode())
    return digest.hexdigest()


def read_stamp(stamp: Path) -> dict:
    """What the last set-up noted; empty when there was none or it was cut off."""
    try:
        noted = json.loads(stamp.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return {}
    return noted if isinstance(noted, dict) else {}


def pinned(package: str, constraints: str) -> str:
    """The line ``package==version`` of the constraints."""
    found = re.search(rf"^{re.escape(package)}==[^\s;]+", constraints, re.MULTILINE)
    if found is None:
        raise SetupError(f"constraints.txt names no version of {package}.")
    return found.group()


def install(command: list, what: str) -> None:
    """Run pip, or say what may be wrong."""
    if call(command) != 0:
        raise SetupError(
            f"pip could not install {what}; its last lines above say why. Without a network pip finds no "
            "packages; HTTPS_PROXY names a proxy, PIP_INDEX_URL another package index. The next call goes on "
            "from here."
        )


# --- Packages of Debian and Ubuntu


def has_blender(python_version: str) -> bool:
    """Whether there is a Blender for this Python, given as ``3.11.7 ...``."""
    return tuple(int(part) for part in python_version.split(".")[:2]) in BLENDER_PYTHONS


def check_blender() -> None:
    """Make sure that what Blender's module needs of the system is there."""
    if sys.platform == "linux" and shutil.which("dpkg-query"):
        missing = [name for name in BLENDER_PACKAGES if not has_debian_package(name)]
        if missing:
            install_debian_packages(
                missing, "Blender's module needs system libraries (or leave it out by --no-blender)"
            )


def has_debian_package(name: str) -> bool:
    """Whether the package manager has it installed."""
    query = subprocess.run(
        ["dpkg-query", "-W", "-f=${Status}", name],
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    return query.returncode == 0 and query.stdout.endswith(" installed")


def install_debian_packages(packages: list[str], reason: str) -> None:
    """Install packages where this user may; otherwise name them in one command."""
    names = " ".join(packages)
    if not shutil.which("apt-get"):
        raise SetupError(f"{reason}. On Debian and Ubuntu the packages {names} bring what is missing.")
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        raise SetupError(f"{reason}. Install what is missing and try again:\n  sudo apt-get install {names}")
    say(f"Installing the Debian packages {names}")
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    call(["apt-get", "update"], quiet)  # an index that cannot be reached need not be the one that is needed
    if call(["apt-get", "install", "-y", "--no-install-recommends", *packages], quiet) != 0:
        raise SetupError(f"{reason}, and apt-get could not install {names}; the reason is above.")


# --- Blender's other generation


def other_blender(venv: Path, python: Path, required: bool) -> tuple[Path, str] | None:
    """Make an environment for the other generation: its interpreter, and which Blender that is.

    Parameters
    ----------
    venv, python
        The project's own environment.
    required
        Whether a missing Python is an error, and not merely nothing.
    """
    version = tuple(json.loads(output([python, "-c", "import json, sys; print(json.dumps(sys.version_info[:2]))"])))
    others = [other for other in BLENDER_PYTHONS if other != version]
    if version not in BLENDER_PYTHONS:
        return None
    name, blender = f"{others[0][0]}.{others[0][1]}", BLENDER_PYTHONS[others[0]]
    base = find_python_of(others[0])
    if base is None:
        sentence = f"{blender} needs Python {name}, which is not installed here"
        if required:
            raise SetupError(f"{sentence}. Install it, or leave out --both-blenders.")
        say(f"Tests left out: {sentence}")
        return None
    other = venv.with_name(f"{venv.name}-blender-{name}")
    inner = venv_python(other)
    if not (inner.exists() and succeeds([inner, "-c", f"import {', '.join(OTHER_MODULES)}"])):
        say(f"Making {other} for {blender}")
        if call([base, "-m", "venv", "--clear", other]) != 0:
            raise SetupError(f"the virtual environment {other} could not be made; the reason is above.")
        install([*pip_install(inner), "--quiet", *OTHER_PACKAGES], "Blender's module")
    return inner, blender


def test_other_blender(other: tuple[Path, str] | None, python: Path, extra: list[str]) -> int:
    """Run the tests of Blender's part with the other generation, beside numpy alone as inside of a real Blender.

    Parameters
    ----------
    other
        As `other_blender` gives it.
    python
        Of the project's environment, in which the worker processes of those tests run.
    extra
        Arguments for pytest.
    """
    if other is None:
        return 0
    inner, blender = other
    say(f"pytest {' '.join([*OTHER_TESTS, *extra])} ({blender})")
    environment = {**os.environ, **SURROUNDINGS, "FRAMETWIN_PYTHON": str(python), "PYTHONPATH": str(ROOT)}
    code = call([inner, "-m", "pytest", "-p", "no:cacheprovider", *shared_out(), *OTHER_TESTS, *extra], environment)
    return 0 if code == 5 and extra else code  # 5: what was asked for by name is not among these tests


def find_python_of(version: tuple[int, int]) -> str | None:
    """An interpreter of this version: on the PATH, or where pyenv or uv keep theirs."""
    name = f"python{version[0]}.{version[1]}"
    home = Path.home()
    kept = [
        *Path(os.environ.get("PYENV_ROOT") or home / ".pyenv").glob(f"versions/{version[0]}.{version[1]}.*/bin/python"),
        *home.glob(f".local/share/uv/python/cpython-{version[0]}.{version[1]}.*/bin/{name}"),
    ]
    for candidate in [shutil.which(name), *map(str, sorted(kept))]:
        if candidate and succeeds(
            [candidate, "-c", f"import sys, venv, ensurepip; sys.version_info[:2] == {version} or 1/0"]
        ):
            return candidate
    return None


# --- Tasks


def task_commands(task: str, extra: list[str]) -> list[list[list[str]]]:
    """Modules to run, each with its arguments: group after group, those of a group at the same time."""
    lint = [[["ruff", "check", "."]], [["ruff", "format", "--check", "."]]]
    types, docs = ["mypy"], ["mkdocs", "build", "--strict", "--quiet"]
    # Each uses one processor; and what is compiled by now is not compiled by every process of the tests.
    checks = [types, docs, ["frametwin", "prepare", "--quiet"]]
    return {
        "demo": [[["frametwin", "demo", "--out", "out/first", *extra]]],
        "test": [*lint, checks, [["pytest", *shared_out(), *extra]]],
        "lint": lint,
        "types": [[[*types, *extra]]],
        "docs": [[[*docs, *extra]]],
        "setup": [],
    }[task]


def shared_out() -> list[str]:
    """Options of pytest by which processes share the test files, one for each processor that this one may use."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return ["-n", str(min(count, MOST_PROCESSES)), "--dist", "loadfile", "--no-loadscope-reorder"]


def run_task(task: str, python: Path, extra: list[str]) -> int:
    """Run all parts of a task; the exit code is that of the last part that failed, 0 if none did."""
    code = 0
    for group in task_commands(task, extra):
        say(" + ".join(" ".join(command) for command in group))
        code = call_together([[python, "-m", *command] for command in group], {**os.environ, **SURROUNDINGS}) or code
    return code


# --- Processes


def say(step: str) -> None:
    """Announce a step."""
    print(f"\n==> {step}", flush=True)


def call(command: list, environment: dict | None = None) -> int:
    """Run a program in the project's folder, its output on the terminal; the exit code is a shell's."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, check=False)
    return shell_code(done.returncode)


def call_together(commands: list[list], environment: dict) -> int:
    """Run programs at the same time, or one as `call` does; the exit code is that of the last one that failed.

    What each of several has printed comes when it has ended, in their order.
    """
    if len(commands) == 1:
        return call(commands[0], environment)
    code = 0
    with ThreadPoolExecutor(len(commands)) as pool:
        for done in pool.map(lambda command: call_quietly(command, environment), commands):
            print(done.stdout, end="", flush=True)
            code = shell_code(done.returncode) or code
    return code


def call_quietly(command: list, environment: dict) -> subprocess.CompletedProcess[str]:
    """Run a program in the project's folder; all its output in ``stdout``."""
    return subprocess.run(
        [str(word) for word in command],
        cwd=ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )


def shell_code(returncode: int) -> int:
    """The exit code that a shell would give."""
    return 128 - returncode if returncode < 0 else returncode


def succeeds(command: list) -> bool:
    """Run a program without showing its output."""
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, stdin=subprocess.DEVNULL, check=False).returncode == 0


def output(command: list) -> str:
    """What a program prints."""
    words = [str(word) for word in command]
    return subprocess.run(words, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=True).stdout


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
