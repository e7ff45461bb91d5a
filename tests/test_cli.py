"""The command line: help, exit codes, what convert, info and simulate print and write, progress."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_tools import done, refused, run

from frametwin import __version__
from frametwin.cli import display as display_module
from frametwin.cli import interrupts
from frametwin.cli.display import Display
from frametwin.cli.main import COMMANDS
from frametwin.formats import read_frame
from frametwin.geometry.parametric import named_frame
from frametwin.progress import Progress

ROOT = Path(__file__).resolve().parent.parent
HEAVY = {"torch", "numba", "scipy", "cv2", "trimesh", "rich", "networkx", "safetensors", "numpy"}

# --- help, version, errors of the command line


def test_help_lists_all_commands_with_what_they_do() -> None:
    text = done("--help").stdout
    assert all(f"  {name} " in text for name in COMMANDS)
    assert "mm" in text and "130" in text


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_teaches(name: str) -> None:
    text = done(name, "--help").stdout
    assert text.startswith(f"Usage: frametwin {name} ") and f"frametwin {name} " in text[20:]
    assert done(name, "-h").stdout == text
    assert name in ("dataset", "calibrate") or "--json" in text  # a group of commands, each with its own


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - {"fit", "info", "mask", "dataset"}))
def test_commands_with_lengths_say_their_unit(name: str) -> None:
    assert "mm" in done(name, "--help").stdout


@pytest.mark.parametrize("name", ["generate", "validate", "fit", "view", "export"])
def test_every_command_for_datasets_teaches(name: str) -> None:
    text = done("dataset", name, "--help").stdout
    assert text.startswith(f"Usage: frametwin dataset {name} ") and f"frametwin dataset {name} " in text[30:]
    assert "--json" in text and name in done("dataset", "--help").stdout


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
    assert "Commands:" in result.output and result.exit_code == 2


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
    assert frame.grounded.tolist() == [True, True, False]  # and not what is within half a millimetre as it was read
    done("convert", metres, tmp_path / "b.json", "--scale", "1000")
    assert read_frame(tmp_path / "b.json").radius == pytest.approx(0.06 * 150.0)


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


def test_info_says_that_lengths_were_converted(tmp_path: Path) -> None:
    frame = {"format": "frametwin-frame", "version": 1, "unit": "in", "radius": 0.05}
    file = tmp_path / "post.json"
    file.write_text(json.dumps({**frame, "vertices": [[0, 0, 0], [0, 0, 2]], "edges": [[0, 1]]}))
    data = json.loads(done("info", file, "--json").stdout)
    assert data["unit_of_the_file"] == "in" and data["extent"] == pytest.approx(50.8)
    assert "in, converted to mm" in done("info", file).stdout
    done("convert", file, tmp_path / "mm.json")
    assert "unit_of_the_file" not in json.loads(done("info", tmp_path / "mm.json", "--json").stdout)


# --- simulate


def test_simulate_says_what_it_made(tmp_path: Path) -> None:
    arguments = ("--size", "128x96", "--views", "2", "--printed", "0.5", "--peak", "5", "--deformation", "warp")
    result = done("simulate", "bridge", "--out", tmp_path / "a", *arguments, "--json")
    data = json.loads(result.stdout)
    assert data["printed"] == 38 and data["views"] == 2 and data["missing"] == []
    assert 0.0 < data["largest_displacement"] <= 5.0 + 1e-6
    assert "silhouettes 2/2" in result.stderr
    result = done("simulate", "bridge", "--out", tmp_path / "b", *arguments, "--quiet")
    assert result.stderr == "" and "38 of 76 struts printed" in result.stdout
    assert "2 of 128 x 96 pixels" in result.stdout and "128x96" in done("info", tmp_path / "b").stdout
    picture = cv2.imread(str(tmp_path / "b" / "images" / "camera_00.png"), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (96, 128)  # rows, columns


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


def test_silence_between_stages_is_explained_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(display_module, "PATIENCE", 0.05)
    with Display() as shown:
        for progress in (Progress("fitting", 3, 9), Progress("reading", 4, 4), Progress("reading", 4, 4)):
            shown(progress)
            time.sleep(0.3)
    assert capsys.readouterr().err.count(display_module.HINT) == 1
    with Display() as shown:
        shown(Progress("fitting", 3, 9))  # in the middle of a stage the pace is known
        time.sleep(0.3)
    assert display_module.HINT not in capsys.readouterr().err


def test_quiet_shows_nothing_but_still_stops(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = Display(quiet=True)
    assert shown(Progress("a", 0, 1)) is True
    monkeypatch.setattr(interrupts, "requested", lambda: True)
    assert shown(Progress("a", 0, 1)) is False
    assert capsys.readouterr() == ("", "")
