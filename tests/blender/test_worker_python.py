"""In which Python the worker runs, and what is said if it cannot: runs in Blender's Python too."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from worker_cases import extra_client, is_gone, script, worker_python

import frametwin
from frametwin.errors import InputError
from frametwin.worker.client import WorkerClient, find_python
from frametwin.worker.interpreter import (
    NEEDED,
    VARIABLE,
    WITHOUT_TORCH,
    Interpreter,
    find_interpreter,
    running_interpreter,
    worker_environment,
)
from frametwin.worker.protocol import PROTOCOL

posix = pytest.mark.skipif(os.name == "nt", reason="shell scripts and signals are for POSIX")


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ({"TEST_VERSION": "9.8.7"}, f"frametwin: is 9.8.7 where {frametwin.__version__} is needed"),
        ({"TEST_PROTOCOL": "2"}, f"worker: speaks protocol 2 where {PROTOCOL} is needed"),
    ],
)
def test_another_version_is_refused_with_the_remedy(variables: dict[str, str], words: str) -> None:
    client = extra_client(**variables)
    with pytest.raises(InputError) as caught:
        client.start()
    assert words in str(caught.value)
    assert f'run "{client.python}" -m pip install frametwin=={frametwin.__version__}' in str(caught.value)
    assert client.pid is not None and is_gone(client.pid)


def test_an_older_frametwin_has_no_worker(tmp_path: Path) -> None:
    (tmp_path / "frametwin").mkdir()
    (tmp_path / "frametwin" / "__init__.py").write_text("")
    with pytest.raises(InputError, match="frametwin: is an older one, without a worker; run "):
        WorkerClient(worker_python(), package_root=tmp_path).start()


@posix
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('exec "PYTHON" -S -I "$@"', "frametwin: is not installed there; set up an environment"),
        ("echo out of order >&2; exit 7", "did not start, it ended with the exit code 7, its last words: out of order"),
        ("exit 0", "did not start, it ended with the exit code 0, without a word"),
        ("echo Welcome; echo '[1]'; exit 1", "its last words: Welcome / [1]"),
        ("exec sleep 600", "did not answer within 0.7 s"),
    ],
)
def test_programs_that_are_no_worker(text: str, words: str, tmp_path: Path) -> None:
    program = script(tmp_path / "python", text.replace("PYTHON", worker_python()))
    client = WorkerClient(program)
    with pytest.raises(InputError) as caught:
        client.start(timeout=0.7 if "sleep" in text else 60.0)
    assert str(caught.value).startswith(f"{program}: ") and words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert client.pid is not None and is_gone(client.pid)


def test_noise_before_the_handshake_is_no_event() -> None:
    with extra_client(TEST_NOISE="Loading ...\n{}\n\n") as client:
        assert client.call("count")["steps"] == 3
        assert "Loading ..." in client.last_words


def test_places_where_no_worker_can_be_started(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="working folder: does not exist"):
        WorkerClient(worker_python(), cwd=tmp_path / "none").start()
    with pytest.raises(InputError, match="cannot be run"):
        WorkerClient(tmp_path / "none").start()
    (tmp_path / "text").write_text("no program")
    (tmp_path / "text").chmod(0o755)
    with pytest.raises(InputError, match="cannot be run"):
        WorkerClient(tmp_path / "text").start()


def test_a_file_in_the_working_folder_is_no_module(tmp_path: Path) -> None:
    for name in ("numpy", "json", "frametwin"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('picked up by accident')")
    with WorkerClient(worker_python(), cwd=tmp_path) as client:
        assert client.call("versions")["frametwin"] == frametwin.__version__


def test_which_python_is_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    here = sys.executable
    monkeypatch.setenv(VARIABLE, str(tmp_path / "gone"))
    assert find_python(here) == os.path.abspath(here)
    with pytest.raises(InputError, match=rf"gone: {VARIABLE}: does not exist; set up an environment"):
        find_python()
    monkeypatch.setenv(VARIABLE, here)
    assert find_python() == find_python("") == os.path.abspath(here)
    with pytest.raises(InputError, match="none: Python: does not exist"):
        find_python(tmp_path / "none")
    with pytest.raises(InputError, match="is a folder without a Python"):
        find_python(tmp_path)
    (tmp_path / "bin").mkdir()
    inside = tmp_path / "bin" / "python"
    inside.write_text("")
    if os.name != "nt":
        inside.chmod(0o644)
        with pytest.raises(InputError, match="is not a program that can be run"):
            find_python(tmp_path)
    inside.chmod(0o755)
    assert find_python(tmp_path) == str(inside)


def test_the_running_python_is_taken_if_it_can_do_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib.util import find_spec

    monkeypatch.delenv(VARIABLE, raising=False)
    if all(find_spec(name) for name in NEEDED):
        assert find_python() == sys.executable
    else:
        with pytest.raises(InputError, match=rf"lacks what FrameTwin computes with \(.*\); set up .*{VARIABLE}"):
            find_python()
    monkeypatch.setattr(sys, "executable", "/opt/blender-5.2/blender")
    with pytest.raises(InputError, match="is no Python"):
        find_python()


def test_the_running_python_with_the_folders_of_its_packages(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    here = os.path.abspath(os.path.join(os.path.dirname(frametwin.__file__), os.pardir))
    plain = running_interpreter(("json",))
    assert plain is not None and plain.python == sys.executable
    assert set(plain.folders) == {here, os.path.dirname(os.path.dirname(json.__file__))}
    assert running_interpreter(("json", "no_such_package")) is None
    # What extensions carry lies in a folder that Blender alone puts on its path; those before it come first there too.
    carried = tmp_path / "site-packages"
    (carried / "carried_package").mkdir(parents=True)
    (carried / "carried_package" / "__init__.py").write_text("WHERE = 'carried'\n")
    (carried / "carried_module.py").write_text("")
    monkeypatch.syspath_prepend(str(carried))
    found = running_interpreter(("carried_package", "carried_module"))
    assert found is not None and found.folders == (str(carried), here)
    code = "import carried_package, frametwin; print(carried_package.WHERE, frametwin.__file__)"
    environment = worker_environment(found.python, None, found.environment)
    said = subprocess.run([found.python, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["carried", frametwin.__file__]
    # Blender itself may call itself the executable; its Python lies beside it.
    monkeypatch.setattr(sys, "executable", "/opt/blender-5.2/blender")
    beside = running_interpreter(("carried_package",))
    assert beside is None or Path(beside.python).name.startswith("python")


def test_a_python_of_its_own_needs_no_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Interpreter("/usr/bin/python3").environment == {}
    assert find_interpreter(sys.executable) == Interpreter(os.path.abspath(sys.executable))
    monkeypatch.setenv(VARIABLE, sys.executable)
    assert find_interpreter(torch=False) == Interpreter(os.path.abspath(sys.executable))
    monkeypatch.delenv(VARIABLE)
    own = running_interpreter(WITHOUT_TORCH)
    if own is not None:
        assert find_interpreter(torch=False) == own and own.folders
    assert set(WITHOUT_TORCH) < set(NEEDED) and "torch" not in WITHOUT_TORCH


def test_a_package_that_is_missing_is_told_in_words() -> None:
    with extra_client() as client, pytest.raises(InputError) as caught:
        client.call("lacking")
    assert "Python: lacks no_such_package, which lacking needs here; let the worker run in one" in str(caught.value)


def test_blenders_own_variables_are_kept_from_another_python(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PYTHONPATH", "/blender/modules")
    monkeypatch.setenv("PYTHONHOME", "/blender/python")
    other = worker_environment(str(tmp_path / "python"), None, {"A": "b", "HOME": None})
    assert "PYTHONPATH" not in other and "PYTHONHOME" not in other
    assert other["A"] == "b" and "HOME" not in other
    same = worker_environment(os.path.abspath(sys.executable), None, None)
    assert same["PYTHONPATH"] == "/blender/modules"
    rooted = worker_environment(str(tmp_path / "python"), tmp_path, None)
    assert rooted["PYTHONPATH"] == str(tmp_path)
