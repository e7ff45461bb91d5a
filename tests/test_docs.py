"""README and documentation: code runs or at least resolves, commands have the options that are shown, files exist."""

from __future__ import annotations

import ast
import importlib.util
import re
import shlex
import textwrap
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import click
import pytest
import yaml
from dataset_cases import make_dataset

import frametwin
from frametwin.cli.main import cli

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PROGRAMS = ("frametwin", "python", "python3", "blender", "sbatch")
README_LINES = 120


@dataclass(frozen=True)
class Block:
    """A piece of code of a page: its language, its text, and the line at which it begins."""

    page: Path
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.page.name}:{self.line}"


def blocks_of(page: Path) -> list[Block]:
    """The fenced blocks of a page, and those of README that are indented."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in re.finditer(r"^( *)```(\w*)\n(.*?)^\1```$", text, re.M | re.S):
        found.append(Block(page, text[: match.start()].count("\n") + 1, match[2], textwrap.dedent(match[3])))
    for match in re.finditer(r"(?:^ {4}\S.*\n)+", text, re.M):
        inside = any(b.line <= text[: match.start()].count("\n") + 1 <= b.line + b.text.count("\n") for b in found)
        if not inside:
            found.append(Block(page, text[: match.start()].count("\n") + 1, "sh", textwrap.dedent(match[0])))
    return found


BLOCKS = [block for page in PAGES for block in blocks_of(page)]
PYTHON = [block for block in BLOCKS if block.language == "python"]


def commands() -> list[tuple[str, list[str]]]:
    """Every command that is shown, as words, with the place where it stands."""
    found = []
    for block in BLOCKS:
        if block.language != "sh":
            continue
        for line in block.text.splitlines():
            words = shlex.split(line, comments=True)
            if words and Path(words[0]).name in PROGRAMS:
                found.append((f"{block.page.name}: {' '.join(words)}", words))
    return found


COMMANDS = commands()


# --- Python


@pytest.mark.parametrize("block", PYTHON, ids=str)
def test_names_that_are_imported_are_there(block: Block) -> None:
    for node in ast.walk(ast.parse(block.text, str(block))):
        if isinstance(node, ast.Import):
            assert all(importlib.util.find_spec(alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None
            if node.module != "frametwin":
                assert {alias.name for alias in node.names} <= names_defined_in(node.module)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "frametwin":
            assert node.attr in frametwin.__all__


def names_defined_in(module: str) -> set[str]:
    """What a module defines, without loading it: it may need Blender."""
    spec = importlib.util.find_spec(module)
    assert spec is not None and spec.origin is not None, module
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}


def test_only_the_face_is_shown_but_for_blenders_part() -> None:
    for block in PYTHON:
        for node in ast.walk(ast.parse(block.text)):
            module = node.module if isinstance(node, ast.ImportFrom) else None
            assert module in (None, "frametwin") or module.startswith("frametwin.blender."), block


def pages_that_run() -> list[Path]:
    return sorted({block.page for block in PYTHON if "blender" not in block.text})


@pytest.mark.parametrize("page", pages_that_run(), ids=lambda page: page.name)
def test_the_code_of_a_page_runs_from_top_to_bottom(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    simulate = frametwin.simulate
    monkeypatch.setattr(frametwin, "simulate", lambda frame, **settings: simulate(frame, size=(150, 200), **settings))
    frametwin.write_simulation("CAPTURE", frametwin.simulate("bridge"))
    make_dataset(Path("out", "demo"))
    names: dict[str, object] = {}
    for block in (block for block in PYTHON if block.page == page):
        if "# needs " not in block.text:  # what nobody has here, such as the pictures of a real print
            exec(compile(block.text, str(block), "exec"), names)
    assert Path("RUN", "twin.json").is_file() == ("write_run" in page.read_text(encoding="utf-8"))


# --- commands


@pytest.mark.parametrize(("place", "words"), COMMANDS, ids=[place for place, _ in COMMANDS])
def test_commands_have_the_arguments_that_are_shown(place: str, words: list[str]) -> None:
    words = [re.sub(r"\$\w+|\{task\}", "1", word) for word in words]
    program = Path(words[0]).name
    if program == "sbatch":
        words = shlex.split(words[words.index("--wrap") + 1])
        program = words[0]
    if program == "frametwin":
        check_command(words[1:])
    elif program == "blender":
        assert words[1:3] == ["--background", "--python"] and words[4] == "--"
        check_script(words[3], words[5:])
    elif words[1] == "-m":
        check_module(words[2], words[3:])
    else:
        check_script(words[1], words[2:])


def check_command(arguments: list[str]) -> None:
    """Parse a command line down to its last command, without running it."""
    command: click.Command = cli
    context: click.Context | None = None
    name = "frametwin"
    while isinstance(command, click.Group):
        context = click.Context(command, info_name=name, parent=context, **command.context_settings)
        found = command.get_command(context, arguments[0])
        assert found is not None, f"there is no command {arguments[0]}"
        command, name, arguments = found, arguments[0], arguments[1:]
    command.make_context(name, list(arguments), parent=context)


def check_script(script: str, arguments: list[str]) -> None:
    """A script is there, and names every option that is shown."""
    path = ROOT / script
    source = path.read_text(encoding="utf-8")
    if path.name == "run.py":
        arguments, _ = load(path).split_arguments(arguments)
        load(path).parser().parse_args(arguments)
    for word in arguments:
        assert not word.startswith("--") or word == "--" or f'"{word}"' in source, f"{script} has no {word}"


def check_module(module: str, arguments: list[str]) -> None:
    """A module is installed; options are not looked at."""
    assert importlib.util.find_spec(module) is not None


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_commands_are_found_and_wrong_ones_refused() -> None:
    assert len(COMMANDS) > 40 and len(PYTHON) > 5
    for line in ("fit CAPTURE --out RUN --fast", "print fly JOB", "fit CAPTURE", "simulate bridge --out x --views one"):
        with pytest.raises((click.UsageError, AssertionError)):
            check_command(line.split())


# --- files


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files_of_the_repository(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if not re.match(r"https?://|#", target):
            assert (page.parent / target.partition("#")[0]).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_and_folders_that_are_named_exist(page: Path) -> None:
    roots = ("addon/", "datasets/", "docs/", "frametwin/", "scripts/", "tests/")
    for name in re.findall(r"`([\w./-]+)`", page.read_text(encoding="utf-8")):
        if name.startswith(roots):
            assert (ROOT / name).exists(), name


def test_every_public_name_is_in_the_reference() -> None:
    shown = re.findall(r"^::: frametwin\.(\w+)$", (ROOT / "docs" / "api.md").read_text(encoding="utf-8"), re.M)
    assert sorted(shown) == sorted(set(frametwin.__all__) - {"__version__"})


def test_readme_is_what_a_stranger_needs() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= README_LINES
    for command in ("demo", "test"):
        assert any(line.startswith(f"    python3 scripts/run.py {command}") for line in lines)


# --- the files of the project's host


def steps_of(workflow: dict) -> list[str]:
    return [step["run"] for job in workflow["jobs"].values() for step in job["steps"] if "run" in step]


def test_hosted_tests_run_the_commands_of_the_readme() -> None:
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))
    run = load(ROOT / "scripts" / "run.py")
    lines = [shlex.split(text) for text in steps_of(workflow) if "scripts/run.py" in text]
    tasks = []
    for words in lines:
        own, _ = run.split_arguments(words[2:])
        tasks.append(run.parser().parse_args(own).task)
    assert set(tasks) == {"demo", "test"}
    matrix = workflow["jobs"]["tests"]["strategy"]["matrix"]
    assert {system.split("-")[0] for system in matrix["system"]} == {"ubuntu", "macos", "windows"}
    assert {tuple(map(int, version.split("."))) for version in matrix["python"]} == set(run.BLENDER_PYTHONS)
    (packages,) = {text.partition("recommends")[2] for text in steps_of(workflow) if "apt-get" in text}
    assert packages.replace("\\", "").split() == list(run.BLENDER_PACKAGES)


def test_hooks_run_modules_that_are_installed() -> None:
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    entries = [hook["entry"].split() for repo in config["repos"] for hook in repo["hooks"]]
    modules = [words[2] for words in entries if words[:2] == ["python", "-m"]]
    assert {"ruff", "mypy", "mkdocs"} == set(modules)
    assert all(importlib.util.find_spec(module) for module in modules)


def test_the_citation_names_the_software_and_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["title"] == "FrameTwin" and citation["type"] == "software"
    (paper,) = citation["references"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"*{paper['title']}*" in readme
    assert [author["family-names"] for author in paper["authors"]][:2] == ["Wang", "Huang"]
