"""``frametwin print``: what the commands write, say and refuse."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_tools import done, hear_interrupts, refused, run
from print_cases import LeaningPrint, fingerprint, print_batch
from small_frames import tower

from frametwin.errors import Held
from frametwin.files import read_json
from frametwin.formats import frame_json
from frametwin.printing.job.answer import ACCEPTABLE
from frametwin.printing.job.job import PrintJob
from frametwin.printing.toolpath.robot_files import FORMATS
from frametwin.printing.toolpath.ur_arms import ARMS
from frametwin.worker.client import WorkerClient

ROOT = Path(__file__).resolve().parent.parent
COMMANDS = ("plan", "check", "next", "watch", "status", "simulate")


@pytest.fixture
def frame(tmp_path: Path) -> Path:
    path = tmp_path / "tower.json"
    frame_json.write(path, tower())
    return path


def plan(frame: Path, out: Path, *more: str) -> dict[str, Any]:
    arguments = (
        "print",
        "plan",
        frame,
        "--out",
        out,
        "--batch-size",
        "8",
        "--allow-contact",
        "--json",
        "--quiet",
        *more,
    )
    return json.loads(done(*arguments).stdout)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_for_printing_teaches(name: str) -> None:
    text = done("print", name, "--help").stdout
    assert text.startswith(f"Usage: frametwin print {name} ") and f"frametwin print {name} " in text[30:]
    assert "--json" in text and f"  {name} " in done("print", "--help").stdout


def test_names_in_the_help_are_those_of_the_library() -> None:
    from frametwin.cli import print_common

    assert print_common.KINDS == ACCEPTABLE and print_common.FORMATS == FORMATS
    assert tuple(ARMS) == print_common.ROBOTS


def test_a_print_by_hand(frame: Path, tmp_path: Path) -> None:
    job = tmp_path / "job"
    planned = plan(frame, job)
    assert planned["struts"] == 24 and planned["batches"] == len(planned["batch_sizes"]) == 3
    real = LeaningPrint(tower())
    for batch in range(3):
        capture = real.take(tmp_path / f"capture{batch}", print_batch(PrintJob(job), real))
        answered = json.loads(done("print", "next", job, "--capture", capture, "--json", "--quiet").stdout)
        assert answered["batch"] == batch and answered["finished"] == (batch == 2)
        assert answered["twin"]["start"] == "warm" and answered["seconds"]["total"] > 0.0
        status = json.loads(done("print", "status", job, "--json").stdout)
        states = ["answered"] * (batch + 1) + ["current", "to come"][: 2 - batch]
        assert [item["state"] for item in status["batches"]] == states
    assert status["finished"] and status["current"] is None and status["next"] == "The print is finished."
    text = done("print", "status", job).stdout
    assert "answered" in text and "24" in text and "The print is finished." in text
    assert "is finished" in refused("print", "next", job, "--capture", capture, "--quiet")


def test_people_are_told_what_to_do(frame: Path, tmp_path: Path) -> None:
    job = tmp_path / "job"
    text = done("print", "plan", frame, "--out", job, "--batch-size", "8", "--allow-contact", "--quiet").stdout
    for words in ("24 struts in 3 batches", "workspace", "mm in the robot's base", "frametwin print next"):
        assert words in text, words
    assert f"frametwin print next {job} --capture CAPTURE" in done("print", "status", job).stdout
    real = LeaningPrint(tower())
    capture = real.take(tmp_path / "capture", print_batch(PrintJob(job), real))
    text = done("print", "next", job, "--capture", capture, "--quiet").stdout
    for words in ("batch 0 of", "stand", "warm start", "batch 1,"):
        assert words in text, words


def test_options_of_the_plan_arrive(frame: Path, tmp_path: Path) -> None:
    job = tmp_path / "job"
    base, box = "400,0,20,90", "300,-100,15,500,300,400"
    more = ("--base", base, "--workspace", box, "--formats", "gcode,compas", "--max-tilt", "0", "--speed", "3")
    plan(frame, job, *more, "--tip-radius", "0.7", "--reprint", "--adapt", "paper")
    settings = read_json(job / "job.json")["settings"]
    robot = settings["robot"]
    assert settings["reprint"] and not settings["compensate"] and not settings["anticipate"]
    assert robot["workspace"]["lower"] == [300, -100, 15] and robot["workspace"]["upper"] == [500, 300, 400]
    assert [row[3] for row in robot["workspace"]["base"]] == [400, 0, 20, 1]
    assert robot["workspace"]["base"][1][0] == pytest.approx(1.0)
    assert robot["waypoints"]["speed"] == 3.0 and robot["waypoints"]["nozzle"]["tip_radius"] == 0.7
    files = {path.name for path in (job / "batches" / "000" / "waypoints").iterdir()}
    assert files == {"batch_000.gcode", "batch_000_compas.json", "summary.json"}


def test_an_order_that_is_given_is_kept(frame: Path, tmp_path: Path) -> None:
    first = tmp_path / "first"
    plan(frame, first)
    second = tmp_path / "second"
    order = ("--order", first / "sequence.json", "--allow-contact", "--quiet")
    done("print", "plan", frame, "--out", second, *order)
    kept = ("struts", "start", "batch")
    assert [read_json(first / "sequence.json")[key] for key in kept] == [
        read_json(second / "sequence.json")[key] for key in kept
    ]


def test_bad_input_is_refused_in_a_sentence(frame: Path, tmp_path: Path) -> None:
    job = tmp_path / "job"
    command = ("print", "plan", frame, "--out", job, "--quiet")
    assert "outside of the workspace" in refused(*command, "--workspace", "0,0,0,10,10,10", "--allow-contact")
    assert "is not above the lower corner" in refused(*command, "--workspace", "0,0,0,0,10,10")
    assert "is neither numbers nor a file" in refused(*command, "--base", "here")
    assert "is not a list of json" in refused(*command, "--formats", "dwg")
    assert "faster than the allowed" in refused(*command, "--max-speed", "1", "--allow-contact")
    assert "does not exist" in refused(*command, "--order", tmp_path / "no.json")
    assert not job.exists()
    assert "is no print job" in refused("print", "status", tmp_path)
    assert "there is no such folder" in refused("print", "next", job, "--capture", tmp_path)
    plan(frame, job)
    assert "there is no such folder" in refused("print", "next", job, "--capture", tmp_path / "none", "--quiet")
    assert "exists and is not empty" in refused("print", "plan", frame, "--out", job)
    assert "'everything' is not one of" in refused(
        "print", "next", job, "--capture", tmp_path, "--accept", "everything"
    )
    assert "needs twins to go by" in refused(
        "print", "simulate", frame, "--out", tmp_path / "s", "--no-adapt", "--reprint"
    )


def test_a_held_job_says_how_to_go_on(frame: Path, tmp_path: Path) -> None:
    job, real = tmp_path / "job", LeaningPrint(tower())
    plan(frame, job)
    capture = real.take(tmp_path / "0", print_batch(PrintJob(job), real))
    done("print", "next", job, "--capture", capture, "--quiet")
    before = fingerprint(job)
    sentence = refused("print", "next", job, "--capture", capture, "--quiet", code=3)
    assert "old-capture" in sentence and "or accept old-capture" in sentence and fingerprint(job) == before
    with WorkerClient(sys.executable) as worker, pytest.raises(Held) as caught:
        worker.call("print-next", {"job": job, "capture": capture})
    held = caught.value
    assert f"{held}\n" == sentence and (held.source, held.field) == (str(capture), "old-capture")
    assert held.parts["problem"] == held.doubts[0].problem and held.doubts[0].kind == "old-capture"
    assert fingerprint(job) == before
    kinds = ("old-capture", "wrong-batch", "wrong-twin", "lost-struts")
    accepted = [word for kind in kinds for word in ("--accept", kind)]
    answered = json.loads(done("print", "next", job, "--capture", capture, "--quiet", "--json", *accepted).stdout)
    assert "old-capture" in {doubt["kind"] for doubt in answered["accepted"]}
    assert "accepted old-capture" in done("print", "status", job).stdout


def test_a_page_is_kept_beside_the_job(frame: Path, tmp_path: Path) -> None:
    job, real = tmp_path / "job", LeaningPrint(tower())
    plan(frame, job)
    for batch, more in enumerate(((), ("--no-report",), ())):
        capture = real.take(tmp_path / str(batch), print_batch(PrintJob(job), real))
        before = (job / "report.html").read_bytes() if batch else b""
        if batch == 2:  # what stands in the way of the page does not stand in the way of the print
            (job / "report.html").unlink()
            (job / "report.html").mkdir()
        result = run("print", "next", job, "--capture", capture, *more)
        assert result.exit_code == 0 and PrintJob(job).answered == batch + 1
        if batch == 2:
            assert "The page was not written: " in result.stderr and "Traceback" not in result.stderr
        else:
            assert ((job / "report.html").read_bytes() == before) == (batch == 1)


def test_the_watch_ends_with_the_print(frame: Path, tmp_path: Path) -> None:
    job, captures, real = tmp_path / "job", tmp_path / "captures", LeaningPrint(tower())
    plan(frame, job)
    captures.mkdir()
    command = [
        sys.executable,
        "-m",
        "frametwin",
        "print",
        "watch",
        str(job),
        str(captures),
        "--every",
        "0.05",
        "--json",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as process:
        for batch in range(3):
            wait_for(lambda batch=batch: (job / "batches" / f"{batch:03d}" / "plan.json").is_file())
            real.take(captures / f"{batch:03d}", print_batch(PrintJob(job), real))
        out, said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert [item["batch"] for item in json.loads(out)["answered"]] == [0, 1, 2]
    assert "Waiting for the pictures of batch 0 of 3" in said and "002 answers batch 2." in said


def wait_for(condition: Any) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_the_watch_is_interrupted_at_once(frame: Path, tmp_path: Path) -> None:
    job, captures = tmp_path / "job", tmp_path / "captures"
    plan(frame, job)
    captures.mkdir()
    command = [sys.executable, "-m", "frametwin", "print", "watch", str(job), str(captures)]
    pipes = {"stderr": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=ROOT, preexec_fn=hear_interrupts, **pipes) as process:
        assert process.stderr is not None
        assert "Waiting for the pictures" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        try:
            _, rest = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()  # or leaving the block would wait for it without end
            raise
    assert process.returncode == 130 and rest == "Interrupted.\n"


def test_a_simulation_for_programs_and_for_people(frame: Path, tmp_path: Path) -> None:
    command = ("print", "simulate", frame, "--out", tmp_path / "job", "--views", "5", "--size", "400x300", "--quiet")
    told = json.loads(done(*command, "--batch-size", "8", "--json").stdout)
    wanted = {"completed", "collapsed_at_batch", "e_max", "attached", "lost", "mean_deviation", "twin_seconds"}
    assert wanted | {"printing_seconds", "held", "adapted", "struts"} <= told.keys()
    assert isinstance(told["completed"], bool) and len(told["e_max"]) == len(told["attached"])
    assert (tmp_path / "job" / "print.png").stat().st_size > 10_000
    text = done(*command, "--batch-size", "8").stdout  # finished: what there is is told again
    assert "with adaptation" in text and "result" in text and "print.png" in text
    assert "holds another simulation" in refused(*command, "--batch-size", "8", "--seed", "3")


def test_the_pictures_for_which_a_simulation_is_held_stay_to_be_looked_at(frame: Path, tmp_path: Path) -> None:
    command = ("print", "simulate", frame, "--out", tmp_path / "job", "--views", "5", "--size", "400x300", "--quiet")
    told = json.loads(done(*command, "--batch-size", "8", "--sag", "0.6", "--no-report", "--json").stdout)
    held = Path(told["held"].split(": ")[0])
    assert held.parent.parent == tmp_path / "job" / "batches"
    assert (held / "transforms.json").is_file() and len(list((held / "images").iterdir())) == 5
    again = json.loads(done(*command, "--batch-size", "8", "--sag", "0.6", "--no-report", "--json").stdout)
    assert again["held"] == told["held"]
    small = ("print", "simulate", frame, "--out", tmp_path / "small", "--views", "5", "--size", "8x8", "--quiet")
    named = Path(refused(*small).split(": ")[0])
    assert named.is_file() and named.suffix == ".png"


def test_a_slower_nozzle_is_a_remedy_in_simulations_too(frame: Path, tmp_path: Path) -> None:
    """Struts take twice as long, pauses do not; what is sagged less is nearer to the design."""
    told = []
    for speed in ("5", "2.5"):
        command = ("print", "simulate", frame, "--out", tmp_path / speed, "--no-adapt", "--quiet", "--json")
        told.append(json.loads(done(*command, "--sag", "0.02", "--speed", speed).stdout))
    usual, slow = (np.array(one["printing_seconds"]) for one in told)
    np.testing.assert_allclose(slow - 60.0, 2.0 * (usual - 60.0))
    assert told[1]["completed"] and told[1]["mean_deviation"] < 0.8 * told[0]["mean_deviation"]
    assert "speed" in refused("print", "simulate", frame, "--out", tmp_path / "x", "--speed", "0")


def test_a_print_that_collapses_is_a_result(tmp_path: Path) -> None:
    command = (
        "print",
        "simulate",
        "bridge",
        "--out",
        tmp_path / "job",
        "--no-adapt",
        "--sag",
        "0.6",
        "--quiet",
        "--json",
    )
    result = run(*command)
    assert result.exit_code == 0, result.stderr
    told = json.loads(result.stdout)
    assert not told["completed"] and told["collapsed_at_batch"] is not None
    assert told["collapsed_at_batch"] == len(told["e_max"]) - 1 and told["struts_lost"]
