"""The jobs of a real worker, asked for by a client: runs in Blender's Python too, which has numpy alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from worker_cases import extra_client

import frametwin
from frametwin.capture.capture import read_capture
from frametwin.errors import Cancelled, InputError
from frametwin.formats import frame_json, read_frame
from frametwin.geometry.parametric import named_frame
from frametwin.progress import Progress
from frametwin.twin.twin import read_twin
from frametwin.worker.client import WorkerClient
from frametwin.worker.protocol import PROTOCOL


@pytest.fixture(scope="module")
def worker() -> Iterator[WorkerClient]:
    """One worker for all tests that leave it well."""
    with extra_client() as client:
        yield client


@pytest.fixture(scope="module")
def capture(worker: WorkerClient, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of the bridge, three quarters printed, in a folder with a name that is not plain."""
    folder = tmp_path_factory.mktemp("Brücke 桥") / "a capture"
    settings = {"views": 3, "size": [96, 128], "peak": 4.0, "printed": 0.75, "seed": 3}
    worker.call("simulate", {"frame": "bridge", "out": folder, "settings": settings})
    return folder


@pytest.fixture(scope="module")
def run(worker: WorkerClient, capture: Path) -> Path:
    folder = capture.parent / "a run"
    worker.call("fit", {"capture": capture, "out": folder})
    return folder


def test_the_handshake_says_what_is_there(worker: WorkerClient) -> None:
    assert worker.versions["frametwin"] == frametwin.__version__ and worker.versions["protocol"] == PROTOCOL
    assert worker.versions["pid"] == worker.pid and worker.versions["cores"] >= 1
    assert {"simulate", "fit", "evaluate", "adapt"} <= set(worker.versions["jobs"])
    assert worker.versions["torch"] and worker.versions["numba"]
    assert worker.call("versions") == worker.call("hello") == worker.versions


def test_simulate_writes_a_capture(worker: WorkerClient, capture: Path) -> None:
    views = read_capture(capture)
    assert len(views.views) == 3 and views.views[0].camera.width == 128
    assert views.frame.name == "bridge" and views.frame.printed.sum() == round(0.75 * 76)
    truth = read_frame(capture / "truth.json")
    same = {"frame": "bridge", "settings": {"peak": 4.0, "printed": 0.75, "seed": 3}}
    result = worker.call("simulate", same)
    assert result["out"] is None and result["views"] == 0
    assert np.array_equal(result["control_points"], truth.control_points)
    assert np.array_equal(result["vertices"], truth.vertices)
    assert np.array_equal(result["printed_struts"], views.frame.printed)
    assert result["largest_displacement"] == pytest.approx(4.0)


def test_a_frame_can_be_in_the_request(worker: WorkerClient, tmp_path: Path) -> None:
    frame = named_frame("bridge")
    frame = frame.replace(radius=frame.radius * 2.0, printed=np.arange(76) < 70)
    settings = {"deformation": "rigid", "peak": 3.0, "views": 2, "size": [40, 50], "missing": 2}
    result = worker.call("simulate", {"frame": frame_json.to_dict(frame), "out": tmp_path / "c", "settings": settings})
    assert result["out"] == str(tmp_path / "c") and result["views"] == 2 and len(result["missing"]) == 2
    assert (result["present"][result["missing"]] != [0.0, 1.0]).any(axis=1).all()
    plan = read_frame(tmp_path / "c")
    assert np.array_equal(plan.control_points, frame.control_points) and np.array_equal(plan.printed, frame.printed)
    with pytest.raises(InputError, match=r"c: out: exists and is not empty"):
        worker.call("simulate", {"frame": "bridge", "out": tmp_path / "c"})
    settings["views"] = 3
    worker.call("simulate", {"frame": "bridge", "out": tmp_path / "c", "settings": settings, "overwrite": True})
    assert len(read_capture(tmp_path / "c").views) == 3
    (tmp_path / "c" / "transforms.json").unlink()
    with pytest.raises(InputError, match="holds something else"):
        worker.call("simulate", {"frame": "bridge", "out": tmp_path / "c", "overwrite": True})


def test_fit_evaluate_and_adapt(worker: WorkerClient, capture: Path, run: Path, tmp_path: Path) -> None:
    plan, twin = read_frame(capture), read_twin(run)
    figures = worker.call("evaluate", {"run": run, "truth": capture})
    distance = np.linalg.norm(twin.vertices - read_frame(capture / "truth.json").vertices, axis=1)
    assert figures["joints"]["max"] == pytest.approx(distance[plan.printed_vertices()].max())
    assert figures["curves"]["mean"] < 1.0 and len(figures["struts"]["curves_max"]) == 76

    blended = worker.call("adapt", {"run": run, "out": tmp_path / "rest.json"})
    assert np.array_equal(blended["struts"], np.flatnonzero(~plan.printed))
    assert np.array_equal(blended["before"], plan.control_points[~plan.printed])
    assert np.allclose(blended["after"], twin.control_points[~plan.printed], rtol=0.0, atol=1e-12)
    whole = read_frame(tmp_path / "rest.json")
    assert np.array_equal(whole.control_points[~plan.printed], blended["after"])
    assert np.array_equal(whole.vertices, blended["vertices"])
    changed = (blended["after"] != blended["before"]).any(axis=(1, 2))
    assert 0 < blended["moved"] == changed.sum()
    with pytest.raises(InputError, match=r"rest.json: file: exists already"):
        worker.call("adapt", {"run": run, "out": tmp_path / "rest.json"})


def test_adapt_to_another_state_of_the_print(worker: WorkerClient, capture: Path, run: Path) -> None:
    plan = read_frame(capture)
    first = np.flatnonzero(plan.printed)[0]
    fewer = plan.replace(printed=np.arange(76) == first)
    result = worker.call("adapt", {"run": run, "frame": frame_json.to_dict(fewer)})
    assert len(result["struts"]) == 75
    everything = worker.call(
        "adapt", {"run": run, "frame": frame_json.to_dict(plan.replace(printed=np.full(76, True)))}
    )
    assert len(everything["struts"]) == 0 and everything["largest_displacement"] == 0.0
    with pytest.raises(InputError, match="struts"):
        worker.call("adapt", {"run": run, "frame": "half_bowl"})


def test_a_fit_shows_its_curves(worker: WorkerClient, capture: Path, run: Path, tmp_path: Path) -> None:
    steps: list[Progress] = []
    job = {"capture": capture, "out": tmp_path / "run", "changes": {"kernels_per_strut": 5}, "warm_start": run}
    result = worker.call("fit", job, steps.append, curves=True)
    assert result["printed"] == 57 and read_twin(tmp_path / "run").thickness.shape == (76, 5)
    drawn = [step for step in steps if step.control_points is not None]
    assert drawn and drawn[0].control_points.shape == (57, 4, 3) and drawn[0].control_points.dtype == np.float32
    plan = read_frame(capture)
    assert np.abs(drawn[0].control_points - plan.control_points[plan.printed]).max() < 8.0
    assert {"reading images", "joints and struts"} <= {step.stage for step in steps}
    assert all(step.loss > 0.0 for step in drawn)


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("fit", {"capture": "nowhere", "out": "o"}, "nowhere"),
        ("fit", {"capture": "c", "out": "o", "preset": "best"}, "preset: 'best' is unknown"),
        ("fit", {"capture": "c", "out": "o", "changes": {"itrations": 3}}, "itrations: is not a setting"),
        ("fit", {"capture": "c", "out": "o", "changes": {"absent": "no"}}, "absent: is 'no'; give a number"),
        ("fit", {"capture": "c", "out": "o", "changes": {"coarse": 3}}, "coarse: is 3; give a list"),
        ("fit", {"capture": "c", "out": "o", "preset": "paper", "changes": {"samples": 1}}, "samples: is 1"),
        ("fit", {"capture": "c"}, "request fit: out: is missing"),
        ("fit", {"capture": 3, "out": "o"}, "capture: is 3; give a path"),
        ("evaluate", {"run": "nowhere", "truth": "t"}, "nowhere"),
        ("evaluate", {"run": "r", "truth": "t", "worst": 5}, "worst: is not a parameter; use one of run, truth"),
        ("adapt", {"run": "nowhere"}, "nowhere"),
        ("simulate", {"frame": "no_such_frame"}, "no_such_frame: file: the file does not exist"),
        ("simulate", {"frame": {"vertices": []}}, "frame of the request: format: is missing"),
        ("simulate", {"frame": "bridge", "settings": {"views": "8"}}, "views: is '8'; give a whole number"),
        ("simulate", {"frame": "bridge", "settings": {"views": True}}, "views: is True; give a whole number"),
        ("simulate", {"frame": "bridge", "settings": {"views": 1}}, "views: is 1"),
        ("simulate", {"frame": "bridge", "settings": {"size": [8, 8, 8]}}, "size: is of another kind; give a list"),
        ("simulate", {"frame": "bridge", "settings": {"weather": 1}}, "weather: is not a setting"),
        ("simulate", {"frame": "bridge", "overwrite": 1}, "overwrite: is 1; give true or false"),
    ],
)
def test_wrong_parameters_are_refused_in_words(
    worker: WorkerClient, name: str, parameters: dict, words: str, tmp_path: Path
) -> None:
    if "out" in parameters:
        parameters = {**parameters, "out": tmp_path / "out"}
    with pytest.raises(InputError) as caught:
        worker.call(name, parameters)
    assert words in str(caught.value) and "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_cancel_in_the_middle(worker: WorkerClient, capture: Path, tmp_path: Path) -> None:
    long = {"views": 500, "size": [300, 400]}
    with pytest.raises(Cancelled, match="simulate was cancelled: stopped during silhouettes"):
        worker.call(
            "simulate",
            {"frame": "bridge", "out": tmp_path / "c", "settings": long},
            lambda step: step.stage != "silhouettes",
        )
    with pytest.raises(Cancelled, match="fit was cancelled"):
        worker.call(
            "fit",
            {"capture": capture, "out": tmp_path / "r"},
            lambda step: step.iteration < 3 or step.stage == "reading images",
        )
    assert list(tmp_path.iterdir()) == []
    assert worker.call("count")["steps"] == 3
