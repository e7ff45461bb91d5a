"""The command line: what it prints and writes, its exit codes, and what an interrupt leaves behind."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

from frametwin import __version__
from frametwin.capture import read_capture
from frametwin.cli import display as display_module
from frametwin.cli import fit as fit_module
from frametwin.cli import interrupts
from frametwin.cli.display import Display
from frametwin.cli.main import COMMANDS, cli
from frametwin.errors import InputError
from frametwin.fit.api import PRESETS, settings_of
from frametwin.formats import read_frame, write_frame
from frametwin.parametric import named_frame
from frametwin.progress import Progress
from frametwin.twin import read_twin

ROOT = Path(__file__).resolve().parent.parent
HEAVY = {"torch", "numba", "scipy", "cv2", "trimesh", "rich", "networkx", "safetensors", "numpy"}
SMALL = ("--size", "150x200", "--views", "6", "--seed", "1", "--missing", "2")


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], prog_name="frametwin")


def done(*arguments: str | Path) -> Result:
    result = run(*arguments)
    assert result.exit_code == 0, result.stderr
    return result


def refused(*arguments: str | Path) -> str:
    """The one sentence with which a command refuses its input."""
    result = run(*arguments)
    assert result.exit_code == 2, (result.stdout, result.stderr)
    assert result.stdout == "" and result.stderr.count("\n") == 1 and "Traceback" not in result.stderr
    return result.stderr


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


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("captures") / "bridge"
    done("simulate", "bridge", "--out", folder, *SMALL, "--quiet")
    return folder


@pytest.fixture(scope="module")
def fitted(capture: Path) -> Path:
    folder = capture.parent / "run"
    done("fit", capture, "--out", folder, "--quiet")
    return folder


# --- help, version, errors of the command line


def test_help_lists_all_commands_with_what_they_do() -> None:
    text = done("--help").stdout
    assert all(f"  {name} " in text for name in COMMANDS)
    assert "mm" in text and "130" in text


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_teaches(name: str) -> None:
    text = done(name, "--help").stdout
    assert text.startswith(f"Usage: frametwin {name} ") and f"frametwin {name} " in text[20:]
    assert "--json" in text and "mm" in text or name in ("fit", "info")
    assert done(name, "-h").stdout == text


def test_help_needs_nothing_heavy() -> None:
    code = "import sys\nfrom frametwin.cli.main import cli\ntry: cli(['simulate', '--help'])\n"
    code += "except SystemExit: pass\nprint(sorted({m.split('.')[0] for m in sys.modules}), file=sys.stderr)"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not HEAVY & set(result.stderr.replace("'", "").strip("[]\n").split(", "))


def test_version() -> None:
    assert done("--version").stdout == f"frametwin {__version__}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ("melt",),
        ("fit",),
        ("fit", "somewhere"),
        ("fit", "somewhere", "--out", "run", "--preset", "slow"),
        ("fit", "somewhere", "--out", "run", "--sead", "1"),
        ("simulate", "bridge", "--out", "x", "--size", "big"),
        ("simulate", "bridge", "--out", "x", "--peak", "nan"),
        ("simulate", "bridge", "--out", "x", "--printed", "1.5"),
        ("simulate", "bridge", "--out", "x", "--views", "1"),
        ("convert", "bridge", "x.json", "--scale", "-1"),
        ("convert", "bridge", "x.json", "--radius", "inf"),
    ],
)
def test_a_wrong_command_line_is_one_sentence(arguments: tuple[str, ...]) -> None:
    assert "--help'." in refused(*arguments)


def test_without_a_command_there_is_help() -> None:
    result = run()
    assert "Commands:" in result.output and result.exit_code in (0, 2)


def test_presets_are_those_of_the_library() -> None:
    assert fit_module.PRESETS == PRESETS


# --- convert


def test_convert_there_and_back(tmp_path: Path) -> None:
    text = done("convert", "half_bowl", tmp_path / "a.json").stdout
    assert "156 struts" in text
    frame = read_frame(tmp_path / "a.json")
    assert np.array_equal(frame.control_points, named_frame("half_bowl").control_points)
    data = json.loads(done("convert", "bridge", tmp_path / "b.obj", "--json").stdout)
    assert data["struts"] == 76
    assert np.allclose(read_frame(tmp_path / "b.obj").lengths, named_frame("bridge").lengths)


def test_convert_scales_and_sets_the_radius(tmp_path: Path) -> None:
    metres = tmp_path / "metres.obj"
    metres.write_text("v 0 0 0\nv 0.1 0 0\nv 0.1 0 0.2\nl 1 2 3\n")
    done("convert", metres, tmp_path / "a.json", "--scale", "1000", "--radius", "1.5")
    frame = read_frame(tmp_path / "a.json")
    assert np.allclose(frame.chord_lengths, [100.0, 200.0]) and (frame.radius == 1.5).all()
    done("convert", metres, tmp_path / "b.json", "--scale", "1000")
    assert read_frame(tmp_path / "b.json").radius == pytest.approx(0.06 * 150.0)


def test_convert_a_run_gives_the_curves_of_the_twin(fitted: Path, tmp_path: Path) -> None:
    done("convert", fitted, tmp_path / "twin.json")
    assert np.array_equal(read_frame(tmp_path / "twin.json").control_points, read_twin(fitted).control_points)


def test_convert_refuses(tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    target.write_text("precious")
    assert "exists already" in refused("convert", "bridge", target)
    done("convert", "bridge", target, "--overwrite")
    assert "does not exist" in refused("convert", tmp_path / "no.json", tmp_path / "b.json")
    assert ".stl" in refused("convert", "bridge", tmp_path / "b.stl")
    (tmp_path / "cut.json").write_text(target.read_text()[:500])
    assert "cut short" in refused("convert", tmp_path / "cut.json", tmp_path / "b.json")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "cut.json"]


# --- info


def test_info_of_a_frame() -> None:
    data = json.loads(done("info", "bridge", "--json").stdout)
    assert (data["kind"], data["struts"], data["joints"]) == ("frame", 76, 32)
    assert (data["grounded"], data["components"], data["loose_struts"]) == (4, 1, [])
    assert data["bounds"] == [[-100.0, -18.0, 0.0], [100.0, 18.0, 54.0]] and data["extent"] == 200.0
    assert "200 mm" in done("info", "bridge").stdout


def test_info_of_a_frame_with_loose_struts(tmp_path: Path) -> None:
    file = tmp_path / "loose.json"
    file.write_text(
        json.dumps(
            {
                "format": "frametwin-frame",
                "version": 1,
                "vertices": [[0, 0, 0], [0, 0, 10], [5, 0, 10], [9, 0, 9], [9, 9, 9]],
                "edges": [[0, 1], [1, 2], [2, 3]],
                "radius": [1, 2, 3],
                "printed": [True, False, True],
                "batch": [0, 1, 1],
            }
        )
    )
    data = json.loads(done("info", file, "--json").stdout)
    assert data["loose_struts"] == [2] and data["unused_joints"] == 1 and data["components"] == 1
    assert data["printed"] == 2 and data["batches"] == 2
    assert data["radius"] == {"min": 1.0, "median": 2.0, "max": 3.0}
    assert "1 (2)" in done("info", file).stdout


def test_info_of_a_capture_and_a_run(capture: Path, fitted: Path) -> None:
    data = json.loads(done("info", capture, "--json").stdout)
    assert data["kind"] == "capture" and data["views"] == 6 and data["sizes"] == ["150x200"] and data["truth"]
    assert len(data["struts_missing"]) == 2
    assert "150x200" in done("info", capture).stdout
    data = json.loads(done("info", fitted / "twin.json", "--json").stdout)
    assert data["kind"] == "run" and data["preset"] == "fast" and data["struts"] == 76
    assert "preset" in done("info", fitted).stdout


def test_info_refuses_what_is_damaged(capture: Path, fitted: Path, tmp_path: Path) -> None:
    assert "does not exist" in refused("info", tmp_path / "nothing")
    damaged = shutil.copytree(capture, tmp_path / "damaged")
    next((damaged / "images").iterdir()).unlink()
    assert "is missing" in refused("info", damaged)
    other = shutil.copytree(fitted, tmp_path / "other")
    write_frame(other / "frame.json", named_frame("half_bowl"))
    assert "156 struts" in refused("info", other)


# --- simulate, fit, evaluate


def test_simulate(capture: Path) -> None:
    content = read_capture(capture)
    assert content.truth is not None and len(content.views) == 6
    assert content.views[0].camera.height == 150
    assert json.loads((capture / "simulation.json").read_text())["seed"] == 1


def test_simulate_says_what_it_made(tmp_path: Path) -> None:
    arguments = ("--size", "96x128", "--views", "2", "--printed", "0.5", "--peak", "5", "--deformation", "warp")
    result = done("simulate", "bridge", "--out", tmp_path / "a", *arguments, "--json")
    data = json.loads(result.stdout)
    assert data["printed"] == 38 and data["views"] == 2 and data["missing"] == []
    assert 0.0 < data["largest_displacement"] <= 5.0 + 1e-6
    assert "silhouettes 2/2" in result.stderr
    result = done("simulate", "bridge", "--out", tmp_path / "b", *arguments, "--quiet")
    assert result.stderr == "" and "38 of 76 struts printed" in result.stdout


def test_output_folders_are_not_overwritten(capture: Path, fitted: Path, tmp_path: Path) -> None:
    small = ("--size", "96x128", "--views", "2", "--quiet")
    folder = tmp_path / "precious"
    folder.mkdir()
    (folder / "thesis.txt").write_text("years of work")
    (tmp_path / "file").write_text("")
    for begin in (("simulate", "bridge", *small), ("fit", capture)):
        assert "not empty" in refused(*begin, "--out", folder)
        assert "something else" in refused(*begin, "--out", folder, "--overwrite")
        assert "name of a file" in refused(*begin, "--out", tmp_path / "file")
    assert [path.name for path in folder.iterdir()] == ["thesis.txt"]
    assert "not empty" in refused("fit", capture, "--out", fitted)
    (tmp_path / "empty").mkdir()
    done("simulate", "bridge", *small, "--out", tmp_path / "empty")
    done("simulate", "bridge", *small, "--out", tmp_path / "empty", "--overwrite")
    assert (tmp_path / "empty" / "transforms.json").is_file()


def test_fit_writes_a_run(capture: Path, fitted: Path) -> None:
    assert sorted(path.name for path in fitted.iterdir()) == ["field.safetensors", "frame.json", "twin.json"]
    twin = read_twin(fitted)
    assert twin.strut_count == 76 and twin.provenance["preset"] == "fast"


def test_fit_reports_missing_struts_and_can_start_warm(capture: Path, fitted: Path, tmp_path: Path) -> None:
    result = done("fit", capture, "--out", tmp_path / "run", "--warm-start", fitted, "--json")
    data = json.loads(result.stdout)
    lost = json.loads((capture / "defects.json").read_text())["struts"]
    assert [item["strut"] for item in data["missing"]] == lost
    assert data["struts"] == 76 and data["seconds"] > 0.0 and data["views"] == 6
    assert "reading images 6/6" in result.stderr
    text = dict(fit_module.summary_facts(data, 6))["missing struts"]
    assert all(f"{strut} (" in text for strut in lost)


def test_fit_changes_settings(capture: Path, tmp_path: Path) -> None:
    few = ("--preset", "paper-lattice", "--set", "iterations=3", "--set", "image_scale=0.25")
    done("fit", capture, "--out", tmp_path / "run", "--quiet", *few, "--set", "lattice_cells=1, 2")
    twin = read_twin(tmp_path / "run")
    assert len(twin.loss) == 3 and list(twin.provenance["changes"]["lattice_cells"]) == [1, 2]


@pytest.mark.parametrize(
    ("preset", "assignment", "words"),
    [
        ("fast", "speed=3", "is not a setting"),
        ("fast", "kernels_per_strut", "is not NAME=VALUE"),
        ("fast", "seed=3", "is not a setting"),
        ("fast", "coarse=3", "is not a setting"),
        ("fast", "kernels_per_strut=many", "of another kind"),
        ("fast", "kernels_per_strut=2.5", "of another kind"),
        ("fast", "kernels_per_strut=true", "of another kind"),
        ("fast", "learn_opacity=1", "of another kind"),
        ("fast", "kernels_per_strut=0", "kernels_per_strut"),
        ("paper", "spread=-1", "spread"),
        ("paper", "spread=NaN", "spread"),
        ("paper", "lattice_cells=1,x", "of another kind"),
        ("paper", "field=cloud", "field"),
    ],
)
def test_settings_that_cannot_be_are_refused(
    capture: Path, tmp_path: Path, preset: str, assignment: str, words: str
) -> None:
    text = refused("fit", capture, "--out", tmp_path / "run", "--preset", preset, "--set", assignment, "--quiet")
    assert words in text and not (tmp_path / "run").exists()


def test_settings_are_of_the_kind_they_replace() -> None:
    changes = fit_module.parse_changes(
        ["iterations=7", "spread=2", "field=free", "adaptive_kernels=true", "lattice_cells=[2, 4]"],
        settings_of("paper"),
    )
    assert changes == {
        "iterations": 7, "spread": 2.0, "field": "free", "adaptive_kernels": True, "lattice_cells": (2, 4),
    }  # fmt: skip
    assert isinstance(changes["spread"], float)
    with pytest.raises(InputError, match="given twice"):
        fit_module.parse_changes(["spread=1", "spread=2"], settings_of("paper"))


def test_fit_refuses_a_damaged_capture_and_writes_nothing(capture: Path, tmp_path: Path) -> None:
    damaged = shutil.copytree(capture, tmp_path / "damaged")
    picture = next((damaged / "images").iterdir())
    picture.write_bytes(picture.read_bytes()[:200])
    assert picture.name in refused("fit", damaged, "--out", tmp_path / "run", "--quiet")
    assert "no such folder" in refused("fit", tmp_path / "none", "--out", tmp_path / "run")
    assert "does not exist" in refused(
        "fit", capture, "--out", tmp_path / "run", "--warm-start", tmp_path / "gone", "--quiet"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["damaged"]


def test_evaluate(capture: Path, fitted: Path) -> None:
    data = json.loads(done("evaluate", fitted, capture, "--json").stdout)
    for name in ("curves", "joints", "equal_parameter"):
        assert 0.0 < data[name]["mean"] <= data[name]["p95"] <= data[name]["max"] < 5.0
    assert len(data["struts"]["curves_mean"]) == 76 and len(data["joint_errors"]["distance"]) == 32
    assert len(data["missing"]["found"]) == 2 and not data["missing"]["overlooked"]
    text = done("evaluate", fitted, capture, "--worst", "3").stdout
    assert "curves, both ways" in text and "2 of 2 found" in text and "Worst struts" in text
    assert f"{data['curves']['mean']:.3f}" in text


def test_evaluate_against_a_frame_file(capture: Path, fitted: Path, tmp_path: Path) -> None:
    twin, plan = read_twin(fitted), read_frame(capture)
    write_frame(tmp_path / "same.json", twin.as_wireframe(plan))
    data = json.loads(done("evaluate", fitted, tmp_path / "same.json", "--json").stdout)
    assert data["curves"]["max"] < 1e-6 and data["joints"]["max"] < 1e-9 and "missing" not in data
    assert "does not exist" in refused("evaluate", fitted, tmp_path / "none.json")
    write_frame(tmp_path / "other.json", named_frame("half_bowl"))
    assert "vertices" in refused("evaluate", fitted, tmp_path / "other.json")
    assert "truth.json" in refused("evaluate", fitted, tmp_path)
    assert "does not exist" in refused("evaluate", tmp_path / "nowhere", capture)


# --- demo


def test_demo(tmp_path: Path) -> None:
    folder = tmp_path / "out" / "demo"
    result = done("demo", "--out", folder, *SMALL)
    assert sorted(path.name for path in folder.iterdir()) == ["capture", "demo.json", "run", "views.png"]
    assert "plan mean" in result.stdout and "twin max" in result.stdout and str(folder) in result.stdout
    data = json.loads((folder / "demo.json").read_text())
    for name in ("curves", "joints", "equal_parameter"):
        assert data["twin"][name]["mean"] < 0.2 * data["plan"][name]["mean"]
        assert f"{data['twin'][name]['max']:.3f}" in result.stdout
    assert len(data["missing_struts"]["found"]) == 2
    picture = cv2.imread(str(folder / "views.png"))
    assert picture is not None and picture.shape[1] > 1000
    assert json.loads(done("evaluate", folder / "run", folder / "capture", "--json").stdout)["curves"] == pytest.approx(
        data["twin"]["curves"]
    )

    assert is_own_demo(folder) and not is_own_demo(folder / "run") and not is_own_demo(tmp_path)
    (folder / "thesis.txt").write_text("years of work")
    assert "something else" in refused("demo", "--out", folder, *SMALL)
    assert (folder / "thesis.txt").exists()
    assert "does not exist" in refused("demo", "--frame", "pyramid", "--out", tmp_path / "x")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


# --- progress


def reports() -> list[Progress]:
    return [
        *[Progress("reading", i, 4) for i in range(5)],
        *[Progress("fitting", i, 200, loss=1.0 / (i + 1)) for i in range(150)],
        *[Progress("finishing", i, 200, loss=0.001) for i in range(150, 201)],
        *[Progress("finishing", 200, 200, loss=0.0005)] * 30,
        Progress("counting", 7, 0),
    ]


def test_lines_are_few_and_tell_begin_and_end(capsys: pytest.CaptureFixture[str]) -> None:
    with Display() as shown:
        assert all(shown(progress) for progress in reports())
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "reading 0/4" and "reading 4/4" in lines
    assert "fitting 0/200 (loss 1)" in lines and any(line.startswith("fitting 149/200") for line in lines)
    assert lines[-1] == "counting 7" and any("finishing 200/200 (loss 0.0005)" in line for line in lines)
    assert len(lines) < 14


def test_a_bar_is_shown_on_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(display_module, "_is_terminal", lambda: True)
    monkeypatch.setenv("FORCE_COLOR", "1")
    with Display() as shown:
        assert all(shown(progress) for progress in reports())
    captured = capsys.readouterr()
    assert captured.out == "" and "counting" in captured.err


def test_quiet_shows_nothing_but_still_stops(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = Display(quiet=True)
    assert shown(Progress("a", 0, 1)) is True
    monkeypatch.setattr(interrupts, "requested", lambda: True)
    assert shown(Progress("a", 0, 1)) is False
    assert capsys.readouterr() == ("", "")


# --- real processes


def test_a_real_process_and_its_exit_codes(tmp_path: Path) -> None:
    result = process("info", "bridge", "--json")
    assert result.returncode == 0 and json.loads(result.stdout)["struts"] == 76 and result.stderr == ""
    result = process("info", tmp_path / "none.json")
    assert result.returncode == 2 and result.stdout == "" and result.stderr.count("\n") == 1
    result = process("fit")
    assert result.returncode == 2 and "Missing argument" in result.stderr


def interrupt_when(arguments: list[str], ready: Callable[[str], bool], number: int) -> tuple[int, list[str], str]:
    """Start a command, send it a signal once a line of its progress says that it is ready."""
    child = subprocess.Popen(
        [sys.executable, "-m", "frametwin", *arguments],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None and child.stderr is not None
    lines = []
    for line in child.stderr:
        lines.append(line)
        if ready(line):
            child.send_signal(number)
            break
    lines += child.stderr.readlines()
    out = child.stdout.read()
    return child.wait(timeout=60), lines, out


LONG = ["--views", "500", "--size", "600x800"]


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
def test_an_interrupted_fit_keeps_the_run_before(capture: Path, fitted: Path, tmp_path: Path) -> None:
    run_folder = shutil.copytree(fitted, tmp_path / "run")
    before = {path.name: path.read_bytes() for path in run_folder.iterdir()}
    slow = ["--preset", "paper-lattice", "--set", "iterations=100000"]
    code, lines, stdout = interrupt_when(
        ["fit", str(capture), "--out", str(run_folder), "--overwrite", "--json", *slow],
        lambda line: line.startswith("fitting"),
        signal.SIGINT,
    )
    assert code == 130 and stdout == "" and lines[-1] == "Interrupted.\n"
    assert {path.name: path.read_bytes() for path in run_folder.iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals are for POSIX")
def test_a_terminal_gets_a_bar_that_is_gone_at_the_end(tmp_path: Path) -> None:
    import pty

    leader, follower = pty.openpty()
    child = subprocess.Popen(
        [
            *[sys.executable, "-m", "frametwin", "simulate", "bridge", "--out", str(tmp_path / "c")],
            *["--size", "96x128", "--views", "3", "--json"],
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
