"""Errors carry the parts of their sentence, wherever they come from and wherever they are carried."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from worker_cases import extra_client, worker_python

from frametwin.dataset.farm import run_tasks
from frametwin.errors import Cancelled, Doubt, FrameTwinError, Held, InputError, error_from
from frametwin.files import staged_directory
from frametwin.formats import read_frame
from frametwin.worker.client import WorkerClient, error_of

PARTS = {
    "source": "a: b/frame.json",
    "field": "edges[3]",
    "problem": "is 7: too many; or not",
    "remedy": "count; again",
}
SENTENCE = "a: b/frame.json: edges[3]: is 7: too many; or not; count; again."


def held() -> Held:
    error = Held.at(*PARTS.values())
    error.doubts = (Doubt("edges[3]", PARTS["problem"], "count"), Doubt("collapsed", "all of it is gone", "look"))
    return error


@pytest.mark.parametrize("cls", [FrameTwinError, InputError, Held])
def test_parts_are_kept_as_they_were_given(cls: type[FrameTwinError]) -> None:
    error = cls.at(Path(PARTS["source"]), *list(PARTS.values())[1:])
    assert type(error) is cls and str(error) == SENTENCE and error.parts == PARTS
    assert (error.source, error.field, error.problem, error.remedy) == tuple(PARTS.values())


def test_an_error_of_a_whole_sentence_has_no_parts() -> None:
    error = InputError("wait: it is being set up; then start.")
    assert error.parts == {} and error.source == error.remedy == ""
    assert str(error.inside("x.blend")) == "x.blend: wait: it is being set up; then start."


@pytest.mark.parametrize(
    "carry", [copy.copy, copy.deepcopy, lambda error: error_from(json.loads(json.dumps(error.as_dict())))]
)
def test_parts_survive_being_carried(carry: Callable[[FrameTwinError], FrameTwinError]) -> None:
    for error in (InputError.at(*PARTS.values()), held(), FrameTwinError("as told"), Cancelled("stopped")):
        found = carry(error)
        assert type(found) is type(error) and str(found) == str(error) and found.parts == error.parts
    found = carry(held())
    assert isinstance(found, Held) and found.doubts == held().doubts


def test_parts_survive_a_farm() -> None:
    for path, outcome in run_tasks(read_frame, ["no: such.json", "nor; this.json"], workers=2):
        assert isinstance(outcome, InputError)
        assert (outcome.source, outcome.field, outcome.problem) == (path, "file", "the file does not exist")


def test_the_same_problem_inside_of_a_file() -> None:
    error = held().inside("scene.json")
    assert str(error) == f"scene.json: {SENTENCE}" and error.doubts == held().doubts
    assert (error.source, error.field) == ("scene.json", "a: b/frame.json: edges[3]")
    assert (error.problem, error.remedy) == (PARTS["problem"], PARTS["remedy"])


def test_the_same_problem_under_the_name_that_its_user_knows() -> None:
    error = held()
    told = error.with_field("Leave Out")
    assert str(told) == SENTENCE.replace("edges[3]", "Leave Out") and told.doubts == error.doubts
    assert type(told) is Held and told.parts == {**PARTS, "field": "Leave Out"} and str(error) == SENTENCE


def test_a_folder_that_stands_in_is_in_no_part(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught, staged_directory(tmp_path / "out") as stage:
        raise InputError.at(stage / "twin.json", "file", f"{stage} is full", "make room")
    error = caught.value
    assert error.source == str(tmp_path / "out" / "twin.json") and error.problem == f"{tmp_path / 'out'} is full"
    assert str(error) == f"{error.source}: file: {error.problem}; make room."


def test_a_held_job_is_no_typing_error() -> None:
    assert not isinstance(held(), InputError)
    codes = {cls: cls.exit_code for cls in (FrameTwinError, InputError, Held, Cancelled)}
    assert codes == {FrameTwinError: 1, InputError: 2, Held: 3, Cancelled: 130}


def test_parts_come_through_the_worker(tmp_path: Path) -> None:
    with WorkerClient(worker_python()) as worker:
        with pytest.raises(InputError) as caught:
            worker.call("evaluate", {"run": tmp_path / "run: 1", "truth": tmp_path})
        assert caught.value.source.startswith(str(tmp_path / "run: 1")) and caught.value.remedy
        with pytest.raises(InputError) as caught:
            worker.call("simulate", {"frame": "bridge", "settings": {"views": 1}})
        assert (caught.value.source, caught.value.field) == ("settings", "views")
        assert str(caught.value) == "settings: views: is 1; give a whole number from 2 to 1000, 8 are usual."


def test_a_held_job_comes_through_the_worker() -> None:
    with extra_client() as worker, pytest.raises(Held) as caught:
        worker.call("hold")
    assert caught.value.parts == {
        "source": "captures/3", "field": "collapsed", "problem": "it lies on the plate", "remedy": "look at it",
    }  # fmt: skip
    assert [doubt.kind for doubt in caught.value.doubts] == ["collapsed", "poor-fit"]


@pytest.mark.parametrize("kind", ["failed", "ended", "protocol"])
def test_other_events_are_plain_failures(kind: str) -> None:
    event: dict[str, Any] = {"event": "error", "id": "1", "kind": kind, "message": "It ended.", "details": "Traceback"}
    error = error_of(event)
    assert type(error) is FrameTwinError and str(error) == "It ended." and error.__notes__ == ["Traceback"]
