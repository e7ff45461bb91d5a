"""The job folder: batch after batch by hand, what it refuses, and that it goes on wherever it was killed."""

from __future__ import annotations

import dataclasses
import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from print_cases import LEAN, LeaningPrint, cameras_of, fingerprint, print_batch, small_job, take_with
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.errors import Held, InputError
from frametwin.evaluation.evaluate import evaluate
from frametwin.files import read_json, write_json
from frametwin.formats import frame_json
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job import answer as answer_module
from frametwin.printing.job import job as job_module
from frametwin.printing.job import plan_job as plan_module
from frametwin.printing.job.answer import AnswerOptions
from frametwin.printing.job.job import JobBusy, PrintJob
from frametwin.printing.records.history import read_history
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.reachability import OrderSettings
from frametwin.printing.toolpath.exports import read_waypoints
from frametwin.printing.toolpath.waypoints import PRINT
from frametwin.worker.client import WorkerClient


@pytest.fixture
def design() -> Wireframe:
    return tower()


@pytest.fixture
def job(tmp_path: Path, design: Wireframe) -> PrintJob:
    return small_job(tmp_path / "job", design, formats=("json",))


@pytest.fixture
def real(design: Wireframe) -> LeaningPrint:
    return LeaningPrint(design)


def advance(job: PrintJob, real: LeaningPrint, folder: Path, batches: int) -> None:
    for _ in range(batches):
        batch = job.current
        job.answer(real.take(folder / f"{batch:03d}", print_batch(job, real)))


def test_a_job_is_planned_with_one_tool_and_one_search(
    tmp_path: Path, design: Wireframe, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What its waypoints are made with is what its order was found for."""
    fitted: list[Nozzle] = []
    searched: list[OrderSettings] = []
    fitting, search = Nozzle.fitting, plan_module.plan_sequence

    def counted_fitting(*arguments: Any, **sizes: float) -> Nozzle:
        fitted.append(fitting(*arguments, **sizes))
        return fitted[-1]

    def counted_search(frame: Wireframe, settings: OrderSettings, *more: Any) -> PrintSequence:
        searched.append(settings)
        return search(frame, settings, *more)

    monkeypatch.setattr(Nozzle, "fitting", counted_fitting)
    monkeypatch.setattr(plan_module, "plan_sequence", counted_search)
    job = small_job(tmp_path / "job", design, nozzle={"tip_radius": 0.6})
    assert len(fitted) == len(searched) == 1
    assert job.settings.robot.waypoints.nozzle == searched[0].nozzle == fitted[0] and fitted[0].tip_radius == 0.6


# --- by hand, to the end


def test_a_job_is_printed_by_hand_to_the_end(tmp_path: Path) -> None:
    design = named_frame("bridge")
    job = small_job(tmp_path / "job", design, batch_size=20, anticipate=False)
    real = LeaningPrint(design, 2.5 * LEAN)
    answered = []
    while (batch := job.current) is not None:
        standing = print_batch(job, real)
        report = job.answer(real.take(tmp_path / f"capture_{batch}", standing))
        answered.append(report["batch"])
        assert report["standing"] == int(standing.printed.sum()) and report["lost"] == []
        adapted = job.adapted(batch)
        assert np.array_equal(adapted.printed, standing.printed)
        errors = evaluate(adapted.control_points, adapted.vertices, standing)
        assert errors.curves.mean < 0.2 and errors.joints.mean < 0.45  # a pixel is nearly 1 mm
        if job.current is not None:
            assert_starts_are_met(job, job.current, real)
    assert answered == list(range(job.file.batches)) and job.file.batches > 2
    assert np.linalg.norm(real.vertices - design.vertices, axis=1).max() > 3.0  # which blind waypoints would miss
    with pytest.raises(InputError, match="is finished"):
        job.answer(tmp_path / "capture_0")


def assert_starts_are_met(job: PrintJob, batch: int, real: LeaningPrint) -> None:
    """The robot is told to begin where the print really is."""
    held = real.standing().printed_vertices()
    for start, position in starts(job, batch):
        if held[start]:
            assert np.linalg.norm(position - real.vertices[start]) < 0.6


def starts(job: PrintJob, batch: int) -> list[tuple[int, np.ndarray]]:
    """The joint at which the robot is told to begin each strut of a batch, and where."""
    waypoints = read_waypoints(job.batch_folder(batch) / "waypoints" / f"batch_{batch:03d}.json")
    part = job.expectation(batch).sequence.in_batch(batch)
    rows = [np.flatnonzero((waypoints.strut == strut) & (waypoints.kind == PRINT))[0] - 1 for strut in part.struts]
    return list(zip(part.start.tolist(), waypoints.position[rows], strict=True))


def test_a_print_that_leans_on_is_met_where_it_will_be(tmp_path: Path) -> None:
    job = small_job(tmp_path / "job", tower(3), batch_size=8)
    real = LeaningPrint(job.design, 2.0 * LEAN)
    advance(job, real, tmp_path, 1)
    assert not job.anticipation(1).rate.any()  # nothing is known of how it moves yet
    advance(job, real, tmp_path, 1)
    held, told = real.standing().printed_vertices() & ~job.design.grounded, starts(job, 2)
    meanwhile = [(place + 0.5) / 8.0 * real.step[start] for place, (start, _) in enumerate(told)]
    gaps = [np.linalg.norm(real.vertices[start] - position) for start, position in told if held[start]]
    ahead = [
        np.linalg.norm(real.vertices[start] + way - position)
        for way, (start, position) in zip(meanwhile, told, strict=True)
        if held[start]
    ]
    assert len(ahead) and max(ahead) < 0.6 < max(gaps)
    killed = PrintJob(job.folder)
    folder, before = job.batch_folder(2), fingerprint(job.batch_folder(2))
    shutil.rmtree(folder)  # as if the process had been killed before the batch was in its place
    killed.recover()
    assert fingerprint(folder) == before


def test_every_file_of_a_batch_is_there_and_readable(job: PrintJob, real: LeaningPrint, tmp_path: Path) -> None:
    advance(job, real, tmp_path, 1)
    first, second = job.batch_folder(0), job.batch_folder(1)
    assert {path.name for path in first.iterdir()} == {
        "plan.json", "waypoints", "capture", "run", "adapted.json", "report.json",
    }  # fmt: skip
    assert {path.name for path in second.iterdir()} == {"plan.json", "waypoints"}
    assert (second / "plan.json").read_bytes() == (first / "adapted.json").read_bytes()
    frame = frame_json.read(first / "capture" / "frame.json")
    assert np.array_equal(np.flatnonzero(frame.printed), np.sort(job.sequence.in_batch(0).struts))
    assert read_json(first / "report.json")["pictures"].keys() == {f"images/camera_0{i}.png" for i in range(5)}
    assert not any(path.name.endswith(".part") for path in job.folder.rglob("*"))


def test_compensation_of_older_jobs_aims_what_is_to_come_above_where_it_sinks(tmp_path: Path) -> None:
    folder = small_job(tmp_path / "job", tower(3), batch_size=8, compensate=True).folder
    planned = read_json(folder / "job.json")
    del planned["settings"]["forecast"]  # as jobs were that were planned before there was another,
    del planned["hash"]  # and before the file had a hash of its own
    write_json(folder / "job.json", planned)
    job = PrintJob(folder)
    real = LeaningPrint(job.design, np.array([0.0, 0.0, -3.0]))
    advance(job, real, tmp_path, 2)
    plan = job.plan(2)
    standing = plan.printed_vertices()
    assert np.abs(plan.vertices - real.vertices)[standing].max() < 0.6  # met where it was seen, as ever
    aimed = (plan.vertices - job.design.vertices)[~standing]
    assert len(aimed) and (aimed[:, 2] > 0.2).all()


# --- what is refused, with nothing changed


@pytest.fixture
def second(job: PrintJob, real: LeaningPrint, tmp_path: Path) -> Callable[..., str]:
    """Refuse a capture for batch 1; the sentence."""
    advance(job, real, tmp_path, 1)

    def refuse(capture: Path, **options: Any) -> str:
        before = fingerprint(job.folder)
        with pytest.raises((Held, InputError)) as caught:
            job.answer(capture, AnswerOptions(**options))
        assert fingerprint(job.folder) == before and job.current == 1
        sentence = str(caught.value)
        assert sentence.startswith(str(capture)) and sentence.endswith(".") and "\n" not in sentence
        assert ".part" not in sentence
        return sentence

    return refuse


def test_the_pictures_of_the_last_batch_are_refused(second: Callable[..., str], tmp_path: Path) -> None:
    shutil.copytree(tmp_path / "000", tmp_path / "again")
    assert "old-capture: its pictures are those of batch 0" in second(tmp_path / "again")


def test_new_pictures_of_the_state_before_are_refused(
    second: Callable[..., str], real: LeaningPrint, tmp_path: Path
) -> None:
    real.vertices += [0.3, 0.0, 0.0]  # other pixels, same batch
    assert "wrong-batch: 7 of the 7 struts of batch 1 are not" in second(real.take(tmp_path / "new", real.standing()))


def test_pictures_of_a_later_batch_are_refused(
    second: Callable[..., str], job: PrintJob, real: LeaningPrint, tmp_path: Path
) -> None:
    print_batch(job, real)
    real.lay(job.sequence.in_batch(2).struts, job.plan(1))
    sentence = second(real.take(tmp_path / "later", real.standing()))
    assert "wrong-batch" in sentence and "batch 2, which is still to come, are in the pictures" in sentence


def test_a_frame_that_tells_of_another_batch_is_refused(
    second: Callable[..., str], job: PrintJob, real: LeaningPrint, tmp_path: Path
) -> None:
    capture = real.take(tmp_path / "capture", print_batch(job, real))
    frame_json.write(capture / "frame.json", job.plan(1))
    assert "its frame.json has 8 struts printed where batch 1 makes 15" in second(capture)
    frame_json.write(capture / "frame.json", tower(3))
    assert "edges: are not those of the job's design" in second(capture)


def test_a_camera_that_stands_still_is_found(
    second: Callable[..., str], job: PrintJob, real: LeaningPrint, tmp_path: Path
) -> None:
    capture = real.take(tmp_path / "capture", print_batch(job, real))
    shutil.copy(tmp_path / "000" / "images" / "camera_02.png", capture / "images" / "camera_02.png")
    assert "the picture images/camera_02.png is that of batch 0 again" in second(capture)


def test_cameras_that_were_moved_are_noticed(
    second: Callable[..., str], job: PrintJob, real: LeaningPrint, tmp_path: Path
) -> None:
    standing = print_batch(job, real)
    told = cameras_of(real.design)
    aside = np.eye(4)
    aside[0, 3] = 25.0
    turned = cameras_of(real.design.transformed(aside))
    sentence = second(take_with(tmp_path / "moved", standing, turned, told))
    # Cameras that moved together are a print that moved: either way it is not where it was.
    assert "wrong-twin" in sentence and "displacement" in sentence


def test_one_camera_that_was_turned_is_told_and_no_later_batch_suspected(
    second: Callable[..., str], job: PrintJob, real: LeaningPrint, tmp_path: Path
) -> None:
    standing = print_batch(job, real)
    told = cameras_of(real.design)
    pose = np.array(told[1].camera_to_world)
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_euler("z", 3.0, degrees=True).as_matrix()
    real_one = dataclasses.replace(told[1], camera_to_world=pose)
    sentence = second(take_with(tmp_path / "turned", standing, [told[0], real_one, *told[2:]], told))
    assert "camera-moved" in sentence and told[1].name in sentence and "wrong-batch" not in sentence


@pytest.mark.parametrize("damage", ["cut", "missing", "black"])
def test_damaged_pictures_are_refused(
    second: Callable[..., str], job: PrintJob, real: LeaningPrint, tmp_path: Path, damage: str
) -> None:
    capture = real.take(tmp_path / "capture", print_batch(job, real))
    picture = capture / "images" / "camera_01.png"
    if damage == "cut":
        picture.write_bytes(picture.read_bytes()[:-20])
    elif damage == "missing":
        picture.unlink()
    else:
        from frametwin.capture.image_files import write_png

        write_png(picture, np.zeros((300, 400), dtype=np.uint8))
    assert str(capture) in second(capture)


def test_unknown_doubts_cannot_be_accepted() -> None:
    with pytest.raises(InputError, match="'everything' is nothing that a job stops for"):
        AnswerOptions(accept=frozenset({"everything"}))


def test_a_changed_design_is_refused(job: PrintJob, design: Wireframe) -> None:
    frame_json.write(job.folder / "design.json", design.replace(radius=design.radius * 2.0))
    with pytest.raises(InputError, match="is not the one that the job was planned with"):
        PrintJob(job.folder)


def test_folders_that_are_no_jobs_are_refused(tmp_path: Path, job: PrintJob) -> None:
    with pytest.raises(InputError, match="there is no such folder"):
        PrintJob(tmp_path / "nowhere")
    with pytest.raises(InputError, match="is no print job"):
        PrintJob(tmp_path)
    data = read_json(job.folder / "job.json")
    (job.folder / "job.json").write_text(json.dumps({**data, "version": 2}))
    with pytest.raises(InputError, match="2 is not known"):
        PrintJob(job.folder)


def test_nothing_outside_of_the_workspace_is_written(tmp_path: Path, design: Wireframe) -> None:
    with pytest.raises(InputError, match="outside of the workspace"):
        small_job(tmp_path / "job", design, workspace=(-5.0, -5.0, -2.0, 25.0, 25.0, 45.0))
    assert not (tmp_path / "job").exists()


# --- lost struts


def lost_strut(job: PrintJob, batch: int) -> int | None:
    """A strut of the batch without which struts of later ones, and of those alone, would start in the air."""
    sequence, edges = job.sequence, job.design.edges
    for lost in sequence.in_batch(batch).struts:
        held, hanging = job.design.grounded.copy(), []
        for strut, start, when in zip(sequence.struts, sequence.start, sequence.batch, strict=True):
            if strut != lost and held[start]:
                held[edges[strut]] = True
            elif strut != lost:
                hanging.append(when)
        if hanging and min(hanging) > batch:
            return int(lost)
    return None


@pytest.fixture
def cantilevers(tmp_path: Path) -> tuple[PrintJob, LeaningPrint]:
    """A job in small batches, of which one ends with a strut that alone holds what comes next."""
    job = small_job(tmp_path / "job", tower(), batch_size=2, formats=("json",))
    return job, LeaningPrint(job.design)


def until_lost(job: PrintJob, real: LeaningPrint, folder: Path) -> tuple[int, Path]:
    """Print until a strut is lost where others start: the strut and the pictures."""
    while (batch := job.current) is not None:
        standing, strut = print_batch(job, real), lost_strut(job, batch)
        if strut is not None and len(job.sequence.in_batch(batch)) > 1:
            real.printed[strut] = False
            return strut, real.take(folder / f"{batch:03d}")
        job.answer(real.take(folder / f"{batch:03d}", standing))
    raise AssertionError("no strut holds others alone")


def test_a_strut_that_is_lost_where_others_start_holds_the_job(
    cantilevers: tuple[PrintJob, LeaningPrint], tmp_path: Path
) -> None:
    job, real = cantilevers
    strut, capture = until_lost(job, real, tmp_path)
    batch, before = job.current, fingerprint(job.folder)
    with pytest.raises(Held, match="would start where nothing stands any more") as caught:
        job.answer(capture)
    assert [doubt.kind for doubt in caught.value.doubts] == ["lost-struts"]
    assert fingerprint(job.folder) == before and job.current == batch
    report = job.answer(capture, AnswerOptions(accept=frozenset({"lost-struts"})))
    assert report["lost"] == [strut] and report["accepted"][0]["kind"] == "lost-struts"


def test_a_lost_strut_is_laid_again(cantilevers: tuple[PrintJob, LeaningPrint], tmp_path: Path) -> None:
    job, real = cantilevers
    strut, capture = until_lost(job, real, tmp_path)
    batch = job.current
    report = job.answer(capture, AnswerOptions(reprint=True))
    assert report["again"] == [strut] and job.current == batch + 1
    assert job.sequence.in_batch(batch + 1).struts[0] == strut
    summary = job.waypoint_summary(batch + 1)
    assert summary["struts"][0] == strut
    advance(PrintJob(job.folder), real, tmp_path, 1)
    assert job.adapted(batch + 1).printed[strut] and job.report(batch + 1)["lost"] == []
    assert len(np.unique(job.sequence.struts)) == job.design.strut_count


def test_a_batch_of_which_every_strut_fell_is_laid_again(
    cantilevers: tuple[PrintJob, LeaningPrint], tmp_path: Path
) -> None:
    job, real = cantilevers
    advance(job, real, tmp_path, 3)
    fallen = job.sequence.in_batch(3).struts
    before = real.printed.copy()
    print_batch(job, real)
    real.printed[:] = before
    capture = real.take(tmp_path / "fallen", real.standing())
    wanted = AnswerOptions(reprint=True)
    with pytest.raises(Held, match="wrong-batch"):  # they may be pictures of the moment before
        job.answer(capture, wanted)
    report = job.answer(capture, AnswerOptions(reprint=True, accept=frozenset({"wrong-batch", "lost-struts"})))
    assert report["again"] == sorted(fallen) and job.current == 4
    job = PrintJob(job.folder)
    assert set(fallen) <= set(job.sequence.in_batch(4).struts)
    while job.current is not None:
        advance(job, real, tmp_path, 1)
    assert job.adapted(job.answered - 1).printed.all()
    assert [state.struts > 0 for state in job.states()] == [True] * job.sequence.batch_count
    assert read_history(job.folder).batches[3].laid.tolist() == fallen.tolist()


# --- killed, and going on


class Killed(BaseException):
    """Stands for a process that ends at once."""


def kill_at(monkeypatch: pytest.MonkeyPatch, place: str, count: int) -> None:
    """End at the ``count``-th call of a function, before it does anything, with nothing tidied up."""
    owner, name = {
        "copied": (answer_module, "fit_batch"),
        "fitted": (answer_module, "adapt"),
        "run": (answer_module.frame_json, "write"),
        "report": (answer_module.files, "write_report"),
        "next": (job_module, "write_batch"),
        "replace": (job_module.os, "replace"),
        "rename": (job_module.os, "rename"),
    }[place]
    original, calls = getattr(owner, name), []

    def dying(*args: Any, **more: Any) -> Any:
        if name in ("replace", "rename") and (".part" in str(args[1]) or ".part" not in str(args[0])):
            return original(*args, **more)  # inside of what is staged
        calls.append(args)
        if len(calls) == count:
            raise Killed
        return original(*args, **more)

    monkeypatch.setattr(owner, name, dying)
    monkeypatch.setattr(job_module.shutil, "rmtree", lambda *args, **more: None)


PLACES = [
    ("copied", 1), ("fitted", 1), ("run", 1), ("run", 2), ("report", 1), ("next", 1), ("run", 3),
    ("replace", 1), ("replace", 2), ("replace", 3), ("replace", 4), ("rename", 1),
]  # fmt: skip


@pytest.mark.parametrize(("place", "count"), PLACES)
def test_a_killed_answer_goes_on(
    job: PrintJob, real: LeaningPrint, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, count: int
) -> None:
    capture = real.take(tmp_path / "000", print_batch(job, real))
    with monkeypatch.context() as patch:
        kill_at(patch, place, count)
        with pytest.raises(Killed):
            job.answer(capture)
    again = PrintJob(job.folder)
    done = again.is_answered(0)
    assert done == (place == "rename")  # the report is what makes the batch an answered one
    again.recover()
    assert not list((job.folder / "batches").glob(".*"))
    if not done:
        again.answer(capture)
    assert again.current == 1 and again.report(0)["batch"] == 0
    assert (again.batch_folder(1) / "plan.json").read_bytes() == (again.batch_folder(0) / "adapted.json").read_bytes()
    assert again.waypoint_summary(1)["struts"] == again.sequence.in_batch(1).struts.tolist()
    with pytest.raises(Held, match="old-capture"):
        again.answer(capture)


def test_a_job_that_has_lost_the_report_of_an_earlier_batch_says_so(
    job: PrintJob, real: LeaningPrint, tmp_path: Path
) -> None:
    capture = real.take(tmp_path / "000", print_batch(job, real))
    job.answer(capture)
    (job.batch_folder(0) / "report.json").unlink()
    before = fingerprint(job.folder)
    with pytest.raises(InputError, match=r"files of batch 1 and no report.json of batch 0; put it back"):
        PrintJob(job.folder).answer(capture)
    assert fingerprint(job.folder) == before


def test_a_process_that_is_killed_leaves_a_job_that_goes_on(job: PrintJob, real: LeaningPrint, tmp_path: Path) -> None:
    capture = real.take(tmp_path / "000", print_batch(job, real))
    code = (
        "import sys, time\nfrom frametwin.printing.job.job import PrintJob\n"
        "def tell(p):\n    print(p.stage, flush=True)\n    time.sleep(0.05)\n"
        "PrintJob(sys.argv[1]).answer(sys.argv[2], progress=tell)\n"
    )
    command = [sys.executable, "-c", code, str(job.folder), str(capture)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.strip() == "joints and struts":
                with pytest.raises(JobBusy, match="another process"):
                    job.answer(capture)
                process.send_signal(signal.SIGKILL)
                break
        assert process.wait() == -signal.SIGKILL
    assert job.current == 0 and list((job.folder / "batches").glob(".*"))
    job.answer(capture)
    assert job.current == 1 and not list((job.folder / "batches").glob(".*"))


def test_a_folder_that_cannot_be_written_is_told(job: PrintJob) -> None:
    (job.folder / ".lock").mkdir()  # as good as a folder without rights, which the superuser has all the same
    with pytest.raises(InputError, match=r"\.lock: file: cannot be written .*; make the job's folder writable"):
        job.answer(job.folder)
    PrintJob(job.folder).recover()


def test_cancelling_changes_nothing(job: PrintJob, real: LeaningPrint, tmp_path: Path) -> None:
    from frametwin.errors import Cancelled

    capture = real.take(tmp_path / "000", print_batch(job, real))
    before = fingerprint(job.folder)
    for stage in ("copying pictures", "reading images", "joints and struts", "writing"):
        with pytest.raises(Cancelled):
            job.answer(capture, progress=lambda p, stage=stage: p.stage != stage)
        assert fingerprint(job.folder) == before


# --- in a process of its own


def test_the_worker_plans_answers_and_tells(tmp_path: Path, design: Wireframe) -> None:
    folder, real = tmp_path / "job", LeaningPrint(design)
    with WorkerClient(sys.executable) as worker:
        settings = {"batch_size": 8, "allow_contact": True, "formats": ["json"]}
        request = {"frame": frame_json.to_dict(design), "out": str(folder), "settings": settings}
        planned = worker.call("print-plan", request)
        assert planned["struts"] == 24 and sum(planned["batch_sizes"]) == 24
        capture = real.take(tmp_path / "000", print_batch(PrintJob(folder), real))
        answered = worker.call("print-next", {"job": str(folder), "capture": str(capture)})
        assert answered["batch"] == 0 and answered["next"]["batch"] == 1 and not answered["finished"]
        status = worker.call("print-status", {"job": str(folder)})
        assert [item["state"] for item in status["batches"]] == ["answered", "current", "to come"]
        with pytest.raises(Held, match="old-capture"):
            worker.call("print-next", {"job": str(folder), "capture": str(capture)})
        with pytest.raises(InputError, match="laser: is not a setting"):
            worker.call("print-plan", {**request, "settings": {"laser": 1}})
