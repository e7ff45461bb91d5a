"""``frametwin track``: streams from folders and films, events as lines, and a run that can be read at any moment."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from cli_tools import done, refused
from print_cases import LeaningPrint, cameras_of, print_batch, small_job
from small_frames import tower
from stream_cases import MovingPrint, drop

import frametwin
from frametwin.capture.capture import write_capture
from frametwin.capture.transforms import read_cameras
from frametwin.errors import Cancelled, InputError
from frametwin.fitting.api import fit_views, write_run
from frametwin.progress import Progress
from frametwin.raster.silhouette import silhouettes
from frametwin.tracking.camera_stream import CameraStream
from frametwin.tracking.event_log import EventLog
from frametwin.tracking.events import Event
from frametwin.tracking.folder_stream import FolderStream
from frametwin.tracking.session import Session
from frametwin.tracking.sources import cameras_for, read_followed

STILL = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def moving() -> MovingPrint:
    return MovingPrint(views=5)


@pytest.fixture(scope="module")
def run(moving: MovingPrint, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the print where it stands at first, and its capture beside it."""
    folder = tmp_path_factory.mktemp("run")
    write_capture(folder / "capture", moving.plan, moving.cameras, moving.pictures(STILL))
    masks = [picture / np.float32(255.0) for picture in moving.pictures(STILL)]
    result = fit_views(moving.plan, moving.cameras, masks)
    write_run(folder / "run", result, frametwin.read_capture(folder / "capture"))
    return folder / "run"


def names(moving: MovingPrint) -> list[str]:
    return [camera.name for camera in moving.cameras]


def lines_of(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_a_recorded_folder_is_followed_to_its_end(moving: MovingPrint, run: Path, tmp_path: Path) -> None:
    shots, live = tmp_path / "shots", tmp_path / "live"
    leans = [(x, 0.0, 0.0) for x in (0.0, 0.0, 0.0, 0.0, 0.7, 1.4, 2.1, 2.8, 3.5, 3.5, 3.5)]
    for n, lean in enumerate(leans):
        drop(shots, f"{n:04d}", names(moving), moving.pictures(lean))
    options = ("--every", "--rate", "5", "--idle", "0.3", "--quiet", "--cameras", run.parent / "capture")
    text = done("track", run, shots, "--out", live, *options).stdout
    events = lines_of(live / "events.jsonl")
    assert len(events) == len(text.splitlines())
    assert text.splitlines()[0] == "0.60 clear: nothing but the print is in view"
    assert {event["kind"] for event in events} == {"clear", "moved"}
    assert all(event["time"] == pytest.approx(0.2 * int(str(event["frame"]))) for event in events)
    twin = frametwin.read_run(live).twin
    real = moving.at(leans[-1])
    radius = real.radius[0]
    assert np.linalg.norm(twin.vertices - real.vertices, axis=1).max() < 0.2 * radius
    # Again, as one JSON object; the events are added to those that are there.
    again = done("track", run, shots, "--out", live, *options, "--overwrite", "--json").stdout
    told = json.loads(again)
    assert told["moments"] == len(leans) and told["passed_over"] == 0 and told["events"]["clear"] == 1
    assert len(lines_of(live / "events.jsonl")) == 2 * len(events)


def test_a_job_is_followed_into_its_next_batch(tmp_path: Path) -> None:
    """What is to be laid is awaited; once the pictures have answered the batch, the next one is."""
    job, real = small_job(tmp_path / "job", tower()), LeaningPrint(tower())
    cameras, shots = cameras_of(job.design), tmp_path / "shots"
    print_batch(job, real)
    capture = real.take(tmp_path / "capture")
    for n in range(5):
        drop(shots, f"a{n}", [camera.name for camera in cameras], silhouettes(real.standing(), cameras))
    told: list[Event] = []
    after = iter(range(100))

    def answer_meanwhile(progress: Progress) -> None:
        if progress.iteration == 5 and next(after) == 0:
            job.answer(capture)
            for n in range(5):
                drop(shots, f"b{n}", [camera.name for camera in cameras], silhouettes(real.standing(), cameras))

    followed = read_followed(job.folder)
    names = [camera.name for camera in cameras]
    stream = FolderStream(shots, names, every=True, rate=5.0)
    live = tmp_path / "live"
    summary = Session(
        followed, cameras, stream, live, say=told.append, progress=answer_meanwhile, idle=1.5, write_every=0.0
    ).run()
    assert summary.moments == 10
    clear = [event for event in told if event.kind == "clear"]
    first = sorted(job.sequence_at(0).in_batch(0).struts.tolist())
    assert sorted(s for event in told if event.kind == "laid" for s in event.facts["struts"]) == first
    assert any(event.facts["answerable"] and event.facts["batch"] == 0 for event in clear)
    assert [event.facts["batch"] for event in told if event.kind == "batch"] == [1]
    following = sorted(job.sequence_at(1).in_batch(1).struts.tolist())
    assert sorted(clear[-1].facts["awaited"]) == following and clear[-1].facts["batch"] == 1
    assert frametwin.read_run(live).twin.completeness[following].max() == 0.0
    # The last pictures of the job tell where the cameras are.
    assert [camera.name for camera in cameras_for(read_followed(job.folder), None, None)] == names


def test_a_stop_from_outside_still_leaves_the_latest_twin(moving: MovingPrint, run: Path, tmp_path: Path) -> None:
    shots, live = tmp_path / "shots", tmp_path / "live"
    for n in range(3):
        drop(shots, str(n), names(moving), moving.pictures((float(n), 0.0, 0.0)))
    stream = FolderStream(shots, names(moving), every=True, rate=5.0)
    session = Session(
        read_followed(run), moving.cameras, stream, live, progress=lambda p: p.iteration < 3, write_every=60.0
    )
    with pytest.raises(Cancelled):
        session.run()
    twin = frametwin.read_run(live).twin
    assert np.linalg.norm(twin.vertices - moving.at((2.0, 0.0, 0.0)).vertices, axis=1).max() < 1.0


def test_every_way_of_naming_pictures_gives_the_same_moments(tmp_path: Path) -> None:
    picture = np.zeros((4, 6), dtype=np.uint8)
    for style, name in {
        "moments": "{moment}/{camera}.png",
        "cameras": "{camera}/{moment}.png",
        "first": "{camera}-{moment}.png",
        "last": "{moment}_{camera}.jpg",
    }.items():
        folder = tmp_path / style
        for k, moment in enumerate(("007", "008")):
            for j, camera in enumerate(("left", "far-right")):
                path = folder / name.format(moment=moment, camera=camera)
                path.parent.mkdir(parents=True, exist_ok=True)
                cv2.imwrite(str(path), picture + np.uint8(100 * k + 50 * j))
        (folder / "background").mkdir()
        cv2.imwrite(str(folder / "background" / "left.png"), picture)
        stream = FolderStream(folder, ["left", "far-right"], every=True, rate=2.0)
        first, second, nothing = stream.next(), stream.next(), stream.next()
        assert first is not None and second is not None and nothing is None
        assert (first.name, first.time, second.name, second.time) == ("007", 0.0, "008", 0.5)
        for k, moment in enumerate((first, second)):
            seen = [int(np.median(p)) for p in moment.pictures if p is not None]
            assert seen == [100 * k, 100 * k + 50]


def test_the_newest_moment_is_taken_and_those_before_are_passed_over(tmp_path: Path) -> None:
    for n in range(4):
        drop(tmp_path / "shots", f"{n}", ["a", "b"], [np.full((4, 4), 10 * n, np.uint8)] * 2)
    stream = FolderStream(tmp_path / "shots", ["a", "b"], rate=10.0)
    newest = stream.next()
    assert newest is not None and (newest.name, newest.passed_over, newest.time) == ("3", 3, pytest.approx(0.3))
    assert stream.next() is None
    with pytest.raises(InputError, match="make the folder"):
        FolderStream(tmp_path / "none", ["a"])


@pytest.mark.parametrize("names", [("9", "10", "11"), ("t1.5", "t1.25", "t2.0"), ("shot9b", "shot10a", "shot10b")])
@pytest.mark.parametrize("style", ["{moment}/{camera}.png", "{camera}/{moment}.png", "{camera}-{moment}.png"])
def test_numbers_in_the_names_of_moments_count_as_numbers(tmp_path: Path, names: tuple[str, ...], style: str) -> None:
    for moment in names:
        for camera in ("a", "b"):
            path = tmp_path / style.format(moment=moment, camera=camera)
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), np.zeros((4, 4), np.uint8))
    expected = sorted(names, key=lambda name: float(name[1:])) if names[0].startswith("t") else list(names)
    stream = FolderStream(tmp_path, ["a", "b"], every=True, rate=1.0)
    found = [stream.next() for _ in range(4)]
    assert [moment and moment.name for moment in found] == [*expected, None]
    newest = FolderStream(tmp_path, ["a", "b"], rate=1.0).next()
    assert newest is not None and (newest.name, newest.passed_over) == (expected[-1], 2)


def test_a_camera_whose_name_begins_with_another_is_not_taken_for_it(tmp_path: Path) -> None:
    for camera, shade in (("cam", 50), ("cam-left", 100)):
        cv2.imwrite(str(tmp_path / f"{camera}-7.png"), np.full((4, 4), shade, np.uint8))
    moment = FolderStream(tmp_path, ["cam", "cam-left"]).next()
    assert moment is not None and moment.name == "7"
    assert [int(picture[0, 0]) for picture in moment.pictures if picture is not None] == [50, 100]


def test_moments_without_one_camera_are_not_waited_for_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All have been there as long; else a stream with a dead camera would fall behind for ever."""
    clock = [0.0]
    monkeypatch.setattr("frametwin.tracking.folder_stream.time.monotonic", lambda: clock[0])
    for n in range(3):
        drop(tmp_path / "shots", f"{n}", ["a"], [np.zeros((4, 4), np.uint8)])
    stream = FolderStream(tmp_path / "shots", ["a", "b"], every=True, rate=10.0)
    assert stream.next() is None
    clock[0] = 1.1
    found = [stream.next() for _ in range(3)]
    assert [moment and moment.name for moment in found] == ["0", "1", "2"]


def test_a_picture_that_is_still_growing_is_waited_for(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shots = tmp_path / "shots"
    drop(shots, "0", ["a", "b"], [np.full((40, 40), 200, np.uint8)] * 2)
    whole = (shots / "0" / "b.png").read_bytes()
    (shots / "0" / "b.png").write_bytes(whole[: len(whole) // 2])
    stream = FolderStream(shots, ["a", "b"])
    assert stream.next() is None
    (shots / "0" / "b.png").write_bytes(whole)
    moment = stream.next()
    assert moment is not None and all(picture is not None for picture in moment.pictures)
    assert capfd.readouterr().err == ""


def test_films_are_followed_as_cameras_are(tmp_path: Path) -> None:
    shades = (40, 120, 200)
    films = []
    for k in range(2):
        film = tmp_path / f"{k}.avi"
        writer = cv2.VideoWriter(str(film), cv2.VideoWriter_fourcc(*"MJPG"), 5.0, (64, 48))
        for shade in shades:
            writer.write(np.full((48, 64, 3), shade + 10 * k, np.uint8))
        writer.release()
        films.append(str(film))
    stream = CameraStream(films, rate=5.0)
    seen = []
    while (moment := stream.next()) is not None:
        seen.append([int(np.median(picture)) for picture in moment.pictures if picture is not None])
    assert stream.ended and np.abs(np.array(seen) - [[s, s + 10] for s in shades]).max() <= 3
    with pytest.raises(InputError, match="no_such_film.avi: camera: cannot be opened"):
        CameraStream([films[0], "no_such_film.avi"])


def test_events_are_added_to_whatever_a_killed_process_has_left(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    path.write_text('{"kind": "clear", "time": 0.0}\n{"kind": "mov')
    with EventLog(path) as log:
        log.add(Event("fallen", 1.5, 7, {"struts": [3, 4]}))
    first, torn, last = path.read_text().splitlines()
    assert json.loads(first)["kind"] == "clear" and torn == '{"kind": "mov'
    assert json.loads(last) == {"kind": "fallen", "time": 1.5, "frame": 7, "struts": [3, 4]}
    with pytest.raises(InputError, match="cannot be written"):
        EventLog(tmp_path / "nowhere" / "events.jsonl")


def test_events_read_as_sentences() -> None:
    assert str(Event("fallen", 0.0, 0, {"struts": [3]})) == "strut 3 has fallen"
    assert str(Event("laid", 0.0, 0, {"struts": [3, 5]})) == "struts 3 and 5 have been laid"
    lost = "left disagrees with the other views, or shows nothing"
    assert str(Event("view-lost", 0.0, 0, {"views": ["left"]})) == lost
    moved = {"joints": [4, 9], "distances": [1.2, 2.5], "positions": [[0.0] * 3] * 2}
    assert str(Event("moved", 0.0, 0, moved)) == "2 joints have moved, joint 9 by 2.50 mm"


def test_the_command_refuses_what_it_cannot_follow(run: Path, tmp_path: Path) -> None:
    live, shots = tmp_path / "live", tmp_path / "shots"
    shots.mkdir()
    assert "is neither a run nor a print job" in refused("track", shots, shots, "--out", live)
    assert "give --cameras" in refused("track", run, shots, "--out", live)
    with_cameras = ("--out", live, "--cameras", run.parent / "capture")
    assert "give either a folder STREAM or --camera" in refused("track", run, *with_cameras, "--quiet")
    assert "names 2 where 5 are calibrated" in refused("track", run, "--camera", "0,1", *with_cameras, "--quiet")
    assert "exists and is not empty" in refused("track", run, shots, "--out", run)
    camera = read_cameras(run.parent / "capture" / "transforms.json")[0]
    drop(shots, "7", [camera.name], [np.zeros((30, 40), np.uint8)])
    said = refused("track", run, shots, *with_cameras, "--quiet", "--idle", "1.5")
    assert said.startswith(f"{shots / '7' / camera.name}.png: size: is 40 x 30 pixels")
    shutil.copytree(shots / "7", shots / "background")
    said = refused("track", run, shots, *with_cameras, "--quiet")
    assert f"{shots / 'background'}" in said
    assert not live.exists()
