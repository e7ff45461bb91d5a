"""The set-up script: what it decides before it starts a program."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from longest_files import LONGEST

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def run() -> ModuleType:
    spec = importlib.util.spec_from_file_location("frametwin_run_script", ROOT / "scripts" / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_arguments_after_two_dashes_go_to_the_task(run: ModuleType) -> None:
    assert run.split_arguments(["test"]) == (["test"], [])
    assert run.split_arguments(["test", "--", "-k", "a", "--", "b"]) == (["test"], ["-k", "a", "--", "b"])
    assert run.split_arguments(["test", "--no-blender", "--"]) == (["test", "--no-blender"], [])


def test_tasks_are_checks_and_tests_and_the_demo(run: ModuleType) -> None:
    names = [[command[0] for command in group] for group in run.task_commands("test", ["-x"])]
    assert names == [["ruff"], ["ruff"], ["mypy", "mkdocs", "frametwin"], ["pytest"]]
    (tests,) = run.task_commands("test", ["-x"])[-1]
    assert tests == ["pytest", *run.shared_out(), "-x"]
    assert run.task_commands("demo", ["--json"]) == [[["frametwin", "demo", "--out", "out/first", "--json"]]]
    assert run.task_commands("lint", []) == run.task_commands("test", [])[:2]
    assert run.task_commands("setup", []) == []
    whole = run.task_commands("test", [])
    assert run.task_commands("types", [])[0] + run.task_commands("docs", [])[0] == whole[2][:2]
    assert "--strict" in whole[2][1]  # a link that leads nowhere is an error
    assert all(isinstance(run.task_commands(task, []), list) for task in run.TASKS)


def test_test_files_are_shared_by_so_many_processes_as_there_are_processors(
    run: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(run.os, "sched_getaffinity", raising=False)
    for processors, processes in ((1, "1"), (2, "2"), (64, str(run.MOST_PROCESSES)), (None, "1")):
        monkeypatch.setattr(run.os, "cpu_count", lambda processors=processors: processors)
        assert run.shared_out()[:2] == ["-n", processes]
    files = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert all(files.count(name) == 1 for name in LONGEST) and len(set(LONGEST)) == len(LONGEST)


@pytest.mark.parametrize(
    ("version", "suits"),
    [((3, 10, 14), False), ((3, 11, 0), True), ((3, 13, 9), True), ((3, 14, 0), False), ((2, 7), False)],
)
def test_versions_of_python_are_those_of_the_package(run: ModuleType, version: tuple[int, ...], suits: bool) -> None:
    assert run.suits(version) is suits
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    low, high = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", project["requires-python"]).groups()
    assert [(3, int(low)), (3, int(high) - 1)] == [run.OLDEST, run.NEWEST]


def test_the_interpreter_of_an_environment_is_where_the_system_puts_it(run: ModuleType) -> None:
    assert run.venv_python(Path("v"), windows=False) == Path("v/bin/python")
    assert run.venv_python(Path("v"), windows=True) == Path("v/Scripts/python.exe")


def project_copy(folder: Path) -> Path:
    for name in ("pyproject.toml", "constraints.txt"):
        (folder / name).write_bytes((ROOT / name).read_bytes())
    return folder


def test_the_fingerprint_follows_the_project_and_python(run: ModuleType, tmp_path: Path) -> None:
    root = project_copy(tmp_path)
    first = run.fingerprint(root, "3.11.2")
    assert first == run.fingerprint(root, "3.11.2")
    assert first != run.fingerprint(root, "3.12.1")
    with (root / "constraints.txt").open("a", encoding="utf-8") as stream:
        stream.write("# changed\n")
    assert first != run.fingerprint(root, "3.11.2")


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "\x00"])
def test_a_damaged_stamp_counts_as_none(run: ModuleType, tmp_path: Path, text: str) -> None:
    assert run.read_stamp(tmp_path / "none.json") == {}
    (tmp_path / "stamp.json").write_text(text, encoding="utf-8")
    assert run.read_stamp(tmp_path / "stamp.json") == {}


@pytest.fixture
def recorded(run: ModuleType, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Commands that would have been started; every one of them succeeds."""
    calls: list[list[str]] = []

    def call(command: list, environment: dict | None = None) -> int:
        calls.append([str(word) for word in command])
        return 0

    monkeypatch.setattr(run, "call", call)
    monkeypatch.setattr(run, "make_venv", lambda venv: Path(sys.executable))
    return calls


def test_pytorch_comes_first_and_alone_and_the_second_time_nothing(
    run: ModuleType, recorded: list[list[str]], tmp_path: Path
) -> None:
    run.set_up(tmp_path, {"test"}, "https://example.org/cpu")
    torch, rest = recorded
    assert torch[-3:] == ["torch==2.13.0", "--extra-index-url", "https://example.org/cpu"]
    assert rest[-2:] == ["-e", ".[test]"]
    assert all(command[-4 if command is rest else -5 :][:2] == ["-c", "constraints.txt"] for command in recorded)
    recorded.clear()
    run.set_up(tmp_path, {"test"}, None)
    assert recorded == []


def test_an_interrupted_or_outdated_set_up_is_done_again_with_all_its_extras(
    run: ModuleType, recorded: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / run.STAMP).write_text(json.dumps({"key": "old", "extras": ["extra"]}), encoding="utf-8")
    monkeypatch.setattr(run, "call", lambda command, environment=None: 1)
    with pytest.raises(run.SetupError, match="PyTorch"):
        run.set_up(tmp_path, {"test"}, None)
    assert not (tmp_path / run.STAMP).exists()
    (tmp_path / run.STAMP).write_text(json.dumps({"key": "old", "extras": ["extra"]}), encoding="utf-8")
    monkeypatch.setattr(run, "call", lambda command, environment=None: recorded.append(command) or 0)
    run.set_up(tmp_path, {"test"}, None)
    assert recorded[-1][-1] == ".[extra,test]"


def test_the_exit_code_of_a_failing_part_is_carried_through(run: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    for codes, wanted in (([0, 0, 0], 0), ([0, 0, 5], 5), ([1, 0, 0], 1), ([1, 0, 2], 2)):
        left = [0, *codes]
        monkeypatch.setattr(run, "call_together", lambda commands, environment, left=left: left.pop(0))
        assert run.run_task("test", Path(sys.executable), []) == wanted


MEET = """
import sys, time
from pathlib import Path
own, other, code = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
own.touch()
end = time.monotonic() + 60.0
while not other.exists() and time.monotonic() < end:
    time.sleep(0.01)
print(own.name, "met" if other.exists() else "waited for", other.name, file=sys.stderr if code == 3 else sys.stdout)
raise SystemExit(code)
"""


def test_programs_run_at_the_same_time_and_are_told_of_in_their_order(
    run: ModuleType, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    commands = [[sys.executable, "-c", MEET, one, two, 3], [sys.executable, "-c", MEET, two, one, 4]]
    assert run.call_together(commands, dict(os.environ)) == 4  # of the last one that failed
    assert capfd.readouterr().out.splitlines() == ["one met two", "two met one"]
    commands[1][-1] = 0
    assert run.call_together(commands, dict(os.environ)) == 3


def test_a_killed_program_has_the_exit_code_of_a_shell(run: ModuleType) -> None:
    assert run.call([sys.executable, "-c", "raise SystemExit(7)"]) == 7
    if sys.platform != "win32":
        assert run.call([sys.executable, "-c", "import os; os.kill(os.getpid(), 15)"]) == 128 + 15


def test_a_folder_that_is_no_environment_is_left_alone(run: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("years of work", encoding="utf-8")
    with pytest.raises(run.SetupError, match="not a virtual environment"):
        run.make_venv(tmp_path)
    assert (tmp_path / "thesis.txt").exists()


def test_missing_debian_packages_are_named_to_those_who_may_not_install_them(
    run: ModuleType, recorded: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(run.os, "geteuid", lambda: 1000, raising=False)
    with pytest.raises(run.SetupError, match="sudo apt-get install python3.11-venv"):
        run.install_debian_packages(["python3.11-venv"], "no environments")
    assert recorded == []
    monkeypatch.setattr(run.os, "geteuid", lambda: 0, raising=False)
    run.install_debian_packages(["libgl1", "libegl1"], "no libraries")
    assert [command[:2] for command in recorded] == [["apt-get", "update"], ["apt-get", "install"]]
    assert recorded[-1][-2:] == ["libgl1", "libegl1"]
    monkeypatch.setattr(run.shutil, "which", lambda name: None)
    with pytest.raises(run.SetupError, match="libgl1"):
        run.install_debian_packages(["libgl1"], "no libraries")


def test_python_3_12_does_without_blender(
    run: ModuleType, recorded: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert [run.has_blender(f"3.{minor}.1 (main)") for minor in (11, 12, 13, 14)] == [True, False, True, False]
    monkeypatch.setattr(run, "output", lambda command: "3.12.1 (main)")
    run.set_up(tmp_path, {"test", "blender"}, None)
    assert recorded[-1][-1] == ".[test]"


@pytest.mark.parametrize(("mine", "other"), [((3, 11), "3.13"), ((3, 13), "3.11")])
def test_blenders_part_is_tested_with_the_other_generation_too(
    run: ModuleType,
    recorded: list[list[str]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    mine: tuple[int, int],
    other: str,
) -> None:
    monkeypatch.setattr(run, "output", lambda command: json.dumps(mine))
    monkeypatch.setattr(run, "find_python_of", lambda version: f"python{version[0]}.{version[1]}")
    made = run.other_blender(tmp_path / ".venv", Path(sys.executable), required=True)
    assert run.test_other_blender(made, Path(sys.executable), ["-x"]) == 0
    environment = tmp_path / f".venv-blender-{other}"
    assert recorded[0] == [f"python{other}", "-m", "venv", "--clear", str(environment)]
    assert recorded[1][-5:] == list(run.OTHER_PACKAGES) and "constraints.txt" in recorded[1]
    assert recorded[2][0] == str(run.venv_python(environment)) and recorded[2][-2:] == ["tests/blender", "-x"]


def test_a_missing_python_is_an_error_only_where_it_is_required(
    run: ModuleType, recorded: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(run, "output", lambda command: "[3, 11]")
    monkeypatch.setattr(run, "find_python_of", lambda version: None)
    missing = run.other_blender(tmp_path / ".venv", Path(sys.executable), required=False)
    assert missing is None and run.test_other_blender(missing, Path(sys.executable), []) == 0
    with pytest.raises(run.SetupError, match=r"Blender 5\.2 LTS needs Python 3\.13"):
        run.other_blender(tmp_path / ".venv", Path(sys.executable), required=True)
    assert recorded == []


def test_an_interpreter_of_a_version_is_found_or_not_at_all(run: ModuleType) -> None:
    mine = sys.version_info[:2]
    found = run.find_python_of(mine)
    if found is not None:  # the one that runs the tests may be out of its sight
        assert run.output([found, "-c", "import sys; print(sys.version_info[:2])"]).strip() == str(tuple(mine))
    assert run.find_python_of((3, 99)) is None


def test_unknown_tasks_end_with_the_usage() -> None:
    result = subprocess.run(
        [sys.executable, ROOT / "scripts" / "run.py", "fly"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 2 and "usage: run.py" in result.stderr


def test_constraints_pin_everything_that_the_project_names() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    requirements = [*project["dependencies"], *sum(project["optional-dependencies"].values(), [])]
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert all(re.match(r"^[A-Za-z0-9_.-]+==[^\s;]+(; python_version .*)?$", line) for line in pins)
    names = {line.split("==")[0].lower() for line in pins}
    wanted = {re.match(r"[A-Za-z0-9_.-]+", requirement)[0].lower() for requirement in requirements}
    assert wanted <= names
