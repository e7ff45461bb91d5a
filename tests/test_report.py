"""``frametwin report``: one page that holds what a run, a print job or a dataset holds, and loads nothing."""

from __future__ import annotations

import base64
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from cli_tools import done, refused
from dataset_cases import edit_json, make_dataset
from print_cases import small_job
from small_frames import tower

from frametwin.capture.capture import read_capture
from frametwin.dataset.fits import fit_dataset
from frametwin.dataset.folder import Dataset, read_dataset
from frametwin.errors import Cancelled, InputError
from frametwin.evaluation.evaluate import evaluate
from frametwin.formats import frame_json, read_frame, write_frame
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions
from frametwin.printing.simulation.simulate import SimulationOptions, simulate_print
from frametwin.printing.simulation.simulated_pictures import SimulatedRig
from frametwin.progress import Progress
from frametwin.report import write_report
from frametwin.report.page import page as page_of
from frametwin.twin.runs import load_run
from frametwin.twin.twin import Twin, read_twin, write_twin

NASTY = "</script><script>alert(1)</script><!--\u2028 <b>&\"'"


class Page(HTMLParser):
    """What is in a page: its elements, the texts of its scripts by kind, and the data in it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.text = path.read_text(encoding="utf-8")
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: dict[str, str] = {}
        self.title = ""
        self.inside = ""
        self.feed(self.text)
        self.close()
        self.data: dict[str, Any] = json.loads(self.scripts["application/json"])

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "title":
            self.title += data
        if self.inside == "script":
            kind = self.elements[-1][1].get("type") or "code"
            self.scripts[kind] = self.scripts.get(kind, "") + data

    @property
    def tags(self) -> list[str]:
        return [tag for tag, _ in self.elements]


def curves_in(text: str) -> np.ndarray:
    """(E, 4, 3) curves as the page holds them."""
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(-1, 4, 3)


def nones(values: np.ndarray) -> list[float]:
    return [float("nan") if value is None else value for value in values]


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "capture"
    done(
        *[
            "simulate",
            "bridge",
            "--size",
            "160x120",
            "--views",
            "5",
            "--seed",
            "1",
            "--missing",
            "2",
            "--quiet",
            "--out",
        ],
        folder,
    )
    return folder


@pytest.fixture(scope="module")
def run(capture: Path) -> Path:
    folder = capture.parent / "run"
    done("fit", capture, "--out", folder, "--quiet")
    return folder


@pytest.fixture(scope="module")
def shown(run: Path, capture: Path) -> Page:
    return Page(write_report(run, run.parent / "run.html", capture=capture).path)


def copy_of(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / folder.name))


# --- A run


def test_the_page_of_a_run_holds_its_curves_and_figures(shown: Page, run: Path) -> None:
    twin, frame = load_run(run)
    (scene,) = shown.data["scenes"]
    printed = np.flatnonzero(frame.printed)
    assert shown.data["kind"] == "run" and shown.data["facts"]["printed"] == len(printed)
    assert scene["struts"] == printed.tolist()
    assert np.allclose(curves_in(scene["curves"]), twin.control_points[printed], atol=1e-4)
    assert np.allclose(curves_in(scene["plan"]["curves"]), frame.control_points, atol=1e-4)
    assert np.reshape(scene["plan"]["edges"], (-1, 2)).tolist() == frame.edges.tolist()
    for name in ("completeness", "confidence", "sigma_across", "sigma_along"):
        expected = getattr(twin, name)[printed]
        assert np.allclose(nones(scene["quantities"][name]), expected, rtol=1e-4, atol=1e-9, equal_nan=True)
    u = np.linspace(0.0, 1.0, 201)
    away = np.linalg.norm(
        bezier.evaluate(twin.control_points, u) - bezier.evaluate(frame.control_points, u), axis=2
    ).max(axis=1)
    assert np.allclose(scene["quantities"]["displacement"], away[printed], rtol=0.02, atol=1e-4)
    assert scene["verdict"] == {"status": twin.verdict.status, "reasons": list(twin.verdict.reasons)}
    assert np.allclose(scene["loss"], twin.loss, rtol=1e-3)


def test_errors_are_those_of_the_evaluation_and_the_worst_come_first(shown: Page, run: Path, capture: Path) -> None:
    told = json.loads(done("evaluate", run, capture, "--json").stdout)
    (scene,) = shown.data["scenes"]
    assert scene["errors"]["curves"]["max"] == pytest.approx(told["curves"]["max"])
    truth = frame_json.read(capture / "truth.json")
    assert np.allclose(curves_in(scene["truth"]), truth.control_points[scene["struts"]], atol=1e-4)
    errors = dict(zip(scene["struts"], nones(scene["quantities"]["error"]), strict=True))
    worst = [errors[strut] for strut in scene["worst"]]
    known = np.array([value for value in errors.values() if not np.isnan(value)])
    assert worst == sorted(worst, reverse=True) and worst[0] == known.max()
    assert (known > worst[-1]).sum() < len(worst)


def test_missing_struts_are_marked(shown: Page, run: Path) -> None:
    told = json.loads(done("info", run, "--json").stdout)
    expected = [item["strut"] if isinstance(item, dict) else item for item in told["missing"]]
    assert shown.data["scenes"][0]["marks"]["missing"] == expected


def test_torn_ends_are_told_with_their_gaps(run: Path, tmp_path: Path, shown: Page) -> None:
    folder = copy_of(run, tmp_path)
    twin, frame = load_run(folder)
    attached, gap = np.ones((twin.strut_count, 2), dtype=bool), np.zeros((twin.strut_count, 2))
    for strut, side, away in ((4, 1, 1.25), (9, 0, 3.5), (9, 1, 0.75)):
        attached[strut, side], gap[strut, side] = False, away
    write_twin(folder, twin.replace(attached=attached, gap=gap))
    (scene,) = Page(write_report(folder, tmp_path / "torn.html").path).data["scenes"]
    assert scene["torn"] == [[9, 0, 3.5], [4, 1, 1.25], [9, 1, 0.75]]  # the furthest first
    assert scene["marks"]["torn"] == [4, 9]
    assert np.allclose(scene["quantities"]["gap"], gap.max(axis=1)[frame.printed])
    (whole,) = shown.data["scenes"]
    assert whole["torn"] == [] and "torn" not in whole["marks"] and "gap" not in whole["quantities"]


def test_gaps_that_a_twin_does_not_tell_are_left_open(run: Path, tmp_path: Path) -> None:
    folder = copy_of(run, tmp_path)
    twin, _ = load_run(folder)
    attached = np.ones((twin.strut_count, 2), dtype=bool)
    attached[3, 0] = False
    write_twin(folder, twin.replace(attached=attached, gap=None))
    (scene,) = Page(write_report(folder, tmp_path / "torn.html").path).data["scenes"]
    assert scene["torn"] == [[3, 0, None]] and set(scene["quantities"]["gap"]) == {None}


def test_the_camera_beside_a_picture_is_that_of_the_picture(shown: Page, run: Path, capture: Path) -> None:
    """White pixels of the masks are where the cameras that the page tells see the curves that it tells."""
    (scene,) = shown.data["scenes"]
    truth = curves_in(scene["truth"])[[i for i, s in enumerate(scene["struts"]) if s not in scene["marks"]["missing"]]]
    points = bezier.evaluate(truth, np.linspace(0.1, 0.9, 5)).reshape(-1, 3)
    assert [view["name"] for view in scene["views"]] == [v.camera.name for v in read_capture(capture).views]
    crops = [crop for crops in scene["crops"].values() for crop in crops]
    assert crops and set(map(int, scene["crops"])) <= set(scene["worst"])
    for shot in [*scene["views"], *crops]:
        picture = cv2.imdecode(np.frombuffer(base64.b64decode(shot["picture"]), np.uint8), cv2.IMREAD_GRAYSCALE)
        assert picture is not None and [picture.shape[1], picture.shape[0]] == shot["size"]
        matrix = np.reshape(shot["m"], (3, 4))
        seen = points @ matrix[:, :3].T + matrix[:, 3]
        fx, fy, cx, cy = shot["k"]
        x = np.floor(fx * seen[:, 0] / seen[:, 2] + cx).astype(int)
        y = np.floor(fy * seen[:, 1] / seen[:, 2] + cy).astype(int)
        inside = (x >= 0) & (y >= 0) & (x < picture.shape[1]) & (y < picture.shape[0])
        assert inside.sum() > 5 and (picture[y[inside], x[inside]] > 100).mean() > 0.9


def test_without_pictures_the_views_are_still_told(run: Path, tmp_path: Path) -> None:
    page = Page(write_report(run / "twin.json", tmp_path / "page.html").path)
    (scene,) = page.data["scenes"]
    assert "errors" not in scene and "truth" not in scene and "crops" not in scene
    assert [view["name"] for view in scene["views"]] == [view["name"] for view in read_twin(run).views]
    assert not any("picture" in view for view in scene["views"])


def test_a_truth_can_be_given_alone(run: Path, capture: Path, tmp_path: Path, shown: Page) -> None:
    page = Page(write_report(run, tmp_path / "page.html", truth=capture / "truth.json").path)
    assert page.data["scenes"][0]["errors"] == shown.data["scenes"][0]["errors"]


def test_a_twin_of_version_1_has_no_standard_deviations(run: Path, tmp_path: Path) -> None:
    old = copy_of(run, tmp_path)

    def age(data: dict[str, Any]) -> None:
        since = (
            "sigma_across",
            "sigma_along",
            "joint_radius",
            "attached",
            "gap",
            "bent",
            "cameras",
            "views",
            "verdict",
        )
        for name in since:
            data.pop(name, None)
        data["version"] = 1

    edit_json(old / "twin.json", age)
    page = Page(write_report(old, tmp_path / "page.html").path)
    (scene,) = page.data["scenes"]
    assert "sigma_across" not in scene["quantities"] and scene["views"] == [] and scene["cameras"] == []
    assert scene["verdict"] is None
    assert np.allclose(curves_in(scene["curves"]), read_twin(run).control_points[scene["struts"]], atol=1e-4)


# --- The page


def test_a_page_loads_nothing(shown: Page) -> None:
    assert not {"link", "iframe", "object", "embed", "base", "img"} & set(shown.tags)
    assert not any({"src", "href", "action", "srcset"} & set(attributes) for _, attributes in shown.elements)
    assert not re.search(r"\b(fetch|importScripts|import|require)\s*\(", shown.scripts["code"])
    assert "XMLHttpRequest" not in shown.scripts["code"] and "WebSocket" not in shown.scripts["code"]
    (style,) = re.findall(r"<style>(.*?)</style>", shown.text, re.S)
    assert "url(" not in style and "@import" not in style
    namespaces = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xhtml"}
    assert set(re.findall(r"https?://[^\s\"'`)<]+", shown.text)) <= namespaces


def test_the_licence_of_the_library_goes_with_it(shown: Page) -> None:
    licence = shown.scripts["text/plain"]
    assert "The MIT License" in licence and "three.js authors" in licence
    assert "Permission is hereby granted" in licence and "WITHOUT WARRANTY" in licence.upper()


def test_names_from_files_do_not_become_markup(run: Path, tmp_path: Path, shown: Page) -> None:
    named = copy_of(run, tmp_path)
    edit_json(named / "frame.json", lambda data: data.update(name=NASTY))

    def rename(data: dict[str, Any]) -> None:
        data["views"][0]["name"] = NASTY
        data["verdict"] = {"status": "doubtful", "reasons": [NASTY]}
        data["provenance"]["preset"] = NASTY

    edit_json(named / "twin.json", rename)
    page = Page(write_report(named, tmp_path / "page.html").path)
    assert page.tags == shown.tags
    assert page.title.startswith(NASTY) and page.data["title"] == NASTY
    assert page.data["facts"]["preset"] == NASTY
    (scene,) = page.data["scenes"]
    assert scene["views"][0]["name"] == NASTY and scene["verdict"]["reasons"] == [NASTY]


def test_marks_of_the_template_in_names_stay_names(tmp_path: Path) -> None:
    marks = "/*DATA*/ /*SCRIPTS*/ <!--TITLE--> /*LIBRARY*/"
    path = tmp_path / "page.html"
    path.write_text(page_of({"kind": "run", "title": marks, "facts": {}, "scenes": []}), encoding="utf-8")
    page = Page(path)
    assert page.data["title"] == marks and page.title.startswith(marks)


def test_scripts_of_the_page_build_no_markup_from_text(shown: Page) -> None:
    own = shown.scripts["code"].partition('"use strict";')[2]
    assert "JSON.parse" in own
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", own)


def test_a_big_frame_makes_a_page_below_10_mb(shared_frames: Path, tmp_path: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "EdgeLounge_wireframe.txt")
    moved = np.array(frame.control_points)
    moved[:, 1:3] += np.random.default_rng(3).normal(scale=0.2, size=(frame.strut_count, 2, 3))
    ones = np.ones(frame.strut_count)
    twin = Twin(moved, frame.vertices, ones[:, None], ones[:, None], ones, ones, 0.1 * ones, 0.2 * ones)
    (tmp_path / "run").mkdir()
    write_twin(tmp_path / "run", twin)
    write_frame(tmp_path / "run" / "frame.json", frame)
    report = write_report(tmp_path / "run", tmp_path / "page.html")
    assert frame.strut_count > 1000 and report.size == report.path.stat().st_size < 10e6
    assert len(curves_in(Page(report.path).data["scenes"][0]["curves"])) == frame.strut_count


# --- What is refused


def refuse(word: str, source: Path, out: Path, *arguments: str | Path) -> None:
    before = sorted(out.parent.iterdir()) if out.parent.is_dir() else None
    assert word in refused("report", source, "--out", out, *arguments, "--quiet")
    assert (sorted(out.parent.iterdir()) if out.parent.is_dir() else None) == before


def test_a_damaged_run_is_refused_and_nothing_is_written(run: Path, tmp_path: Path) -> None:
    damaged = copy_of(run, tmp_path)
    (damaged / "twin.json").write_text((run / "twin.json").read_text(encoding="utf-8")[:2000], encoding="utf-8")
    refuse("twin.json", damaged, tmp_path / "page.html")
    shutil.copy(run / "twin.json", damaged)
    edit_json(damaged / "twin.json", lambda data: data["confidence"].__setitem__(0, -1.0))
    refuse("confidence[0]", damaged, tmp_path / "page.html")
    shutil.copy(run / "twin.json", damaged)
    (damaged / "frame.json").unlink()
    refuse("frame.json", damaged, tmp_path / "page.html")


def test_what_is_no_source_is_refused(tmp_path: Path, run: Path) -> None:
    (tmp_path / "empty").mkdir()
    refuse("no run, print job or dataset", tmp_path / "empty", tmp_path / "page.html")
    refuse("no such folder", tmp_path / "nothing", tmp_path / "page.html")
    refuse(".html", run, tmp_path / "page.png")
    refuse("cannot be written", run, tmp_path / "nowhere" / "page.html")


def test_an_existing_page_stays_when_the_next_cannot_be_made(run: Path, capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    write_report(run, out)
    before = out.read_bytes()
    with pytest.raises(InputError):
        write_report(tmp_path / "nothing", out)
    with pytest.raises(Cancelled):
        write_report(run, out, capture=capture, progress=lambda _: False)
    assert out.read_bytes() == before
    write_report(run, out, capture=capture)
    assert out.read_bytes() != before


def test_other_pictures_than_those_of_the_run_are_refused(run: Path, capture: Path, tmp_path: Path) -> None:
    other = copy_of(capture, tmp_path)
    image = next((other / "images").iterdir())
    picture = cv2.imread(str(image), cv2.IMREAD_UNCHANGED)
    assert picture is not None and cv2.imwrite(str(image), 255 - picture)
    refuse(image.name, run, tmp_path / "page.html", "--capture", other)


def test_options_of_a_run_are_refused_for_others(dataset: Path, capture: Path, tmp_path: Path) -> None:
    refuse("--capture", dataset, tmp_path / "page.html", "--capture", capture)
    refuse("--truth", dataset, tmp_path / "page.html", "--truth", capture / "truth.json")


# --- A print job


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated print that was stopped after two batches."""
    folder = tmp_path_factory.mktemp("report_job") / "job"
    plan = PlanOptions(batch_size=20, allow_contact=True, formats=("json",))
    options = SimulationOptions(plan=plan, rig=SimulatedRig(4, (150, 200)), seed=1)

    def before_the_third(at: Progress) -> bool:
        return (at.stage, at.iteration) != ("printing", 2)

    with pytest.raises(Cancelled):
        simulate_print(folder, named_frame("bridge"), options, progress=before_the_third)
    return folder


def test_the_page_of_a_job_holds_its_batches(job: Path, tmp_path: Path) -> None:
    told = PrintJob(job)
    assert told.answered == 2
    page = Page(write_report(job, tmp_path / "page.html").path)
    assert page.data["kind"] == "job" and page.data["facts"]["answered"] == 2
    assert np.allclose(curves_in(page.data["plan"]["curves"]), told.design.control_points, atol=1e-4)
    assert [scene["label"] for scene in page.data["scenes"]] == ["batch 0", "batch 1"]
    for batch, scene in enumerate(page.data["scenes"]):
        twin, plan = load_run(told.batch_folder(batch) / "run")
        assert scene["struts"] == np.flatnonzero(plan.printed).tolist()
        assert np.allclose(curves_in(scene["curves"]), twin.control_points[plan.printed], atol=1e-4)
        expected = bezier.evaluate(twin.control_points - told.design.control_points, np.linspace(0.0, 1.0, 201))
        away = np.linalg.norm(expected, axis=2).max(axis=1)[plan.printed]
        assert np.allclose(scene["quantities"]["displacement"], away, rtol=0.02, atol=1e-4)
        assert len(scene["views"]) == 4 and all("picture" in view for view in scene["views"])
        outcome = json.loads((told.batch_folder(batch) / "outcome.json").read_text(encoding="utf-8"))
        assert page.data["batches"][batch]["e_max"] == outcome["e_max"]
    assert "crops" not in page.data["scenes"][0] and page.data["scenes"][1]["crops"]


def test_errors_of_a_batch_are_against_what_really_stood(job: Path, tmp_path: Path) -> None:
    page = Page(write_report(job, tmp_path / "page.html").path)
    told = PrintJob(job)
    twin, plan = load_run(told.batch_folder(1) / "run")
    truth = frame_json.read(told.batch_folder(1) / "truth.json")
    both: Wireframe = truth.replace(printed=truth.printed & plan.printed)
    expected = evaluate(twin.control_points, twin.vertices, both).curves.max
    assert page.data["scenes"][1]["errors"]["curves"]["max"] == pytest.approx(expected)


def test_a_job_of_which_nothing_is_printed_shows_its_design(tmp_path: Path) -> None:
    fresh = small_job(tmp_path / "fresh", tower(), formats=("json",)).folder
    page = Page(write_report(fresh, tmp_path / "page.html").path)
    (scene,) = page.data["scenes"]
    assert scene["struts"] == [] and "design" in scene["note"] and page.data["batches"] == []
    assert len(curves_in(page.data["plan"]["curves"])) == tower().strut_count


def test_a_damaged_job_is_refused(job: Path, tmp_path: Path) -> None:
    damaged = copy_of(job, tmp_path)
    (PrintJob(damaged).batch_folder(0) / "run" / "twin.json").write_text("{", encoding="utf-8")
    refuse("twin.json", damaged, tmp_path / "page.html")


# --- A dataset


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three samples: two fitted, one not."""
    folder = make_dataset(
        tmp_path_factory.mktemp("report_dataset") / "set",
        ({"seed": 1, "missing": 1}, {"seed": 2}, {"seed": 3}),
        frame=tower(),
    )
    fit_dataset(folder)
    shutil.rmtree(read_dataset(folder).run_folder(2))
    return folder


def worst_first(data: Dataset) -> list[tuple[float, int]]:
    rows = []
    for entry in data.samples[:2]:
        capture, twin = read_capture(entry.folder), read_twin(data.run_folder(entry.index))
        assert capture.truth is not None
        rows.append((evaluate(twin.control_points, twin.vertices, capture.truth).curves.max, entry.index))
    return sorted(rows, reverse=True)


def test_the_page_of_a_dataset_shows_the_worst_samples_first(dataset: Path, tmp_path: Path) -> None:
    page = Page(write_report(dataset, tmp_path / "page.html").path)
    assert page.data["kind"] == "dataset" and page.data["facts"] == {"samples": 3, "fitted": 2, "failed": 0}
    order = [index for _, index in worst_first(read_dataset(dataset))]
    assert [scene["label"].split(":")[0] for scene in page.data["scenes"]] == [f"sample {index}" for index in order]
    rows = {row["index"]: row for row in page.data["samples"]}
    assert [rows[index]["scene"] for index in order] == [0, 1]
    assert rows[2]["problem"] == "not fitted" and rows[2]["scene"] is None
    assert all(len(scene["views"]) == 4 for scene in page.data["scenes"])


def test_a_damaged_sample_does_not_hide_the_others(dataset: Path, tmp_path: Path) -> None:
    damaged = copy_of(dataset, tmp_path)
    (read_dataset(damaged).run_folder(0) / "twin.json").write_text("{", encoding="utf-8")
    page = Page(write_report(damaged, tmp_path / "page.html").path)
    assert "twin.json" in page.data["samples"][0]["problem"] and len(page.data["scenes"]) == 1
    shutil.rmtree(damaged / "runs")
    refuse("dataset fit", damaged, tmp_path / "page2.html")


# --- The command


def test_the_command_tells_what_it_wrote(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    told = json.loads(done("report", run, "--out", out, "--json", "--quiet").stdout)
    assert told["kind"] == "run" and told["scenes"] == 1 and Path(told["page"]) == out and out.is_file()
    assert out.as_uri() in done("report", run, "--out", out, "--quiet").stdout
