"""The evidence: which runs there are, that none is made twice, what is measured, and the page made of it."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
import torch
from cli_tools import hear_interrupts

from frametwin.cameras.rigs import ring_rig
from frametwin.errors import InputError
from frametwin.fields.base import DeformationField
from frametwin.files import write_json
from frametwin.fitting.part_fit import KernelCloud
from frametwin.geometry import bezier
from frametwin.progress import Progress
from frametwin.raster.kernels import KernelLayout, anchored_kernels, effective_radius, isotropic_covariance
from scripts.evidence import paper, tables
from scripts.evidence.cases import EXPERIMENTS, RIVALS, Case, cases_of, plan_of
from scripts.evidence.figures import BEGIN, EVIDENCE, PAGES, TABLES, fill_pages, filled
from scripts.evidence.measure import measured, roughness, unlike
from scripts.evidence.page import page, write_page
from scripts.evidence.plots import FIGURES
from scripts.evidence.records import BINS, best, is_done, path_of, read_records, write_record
from scripts.evidence.runs import EverySoOften, run_all
from scripts.evidence.scenes import OWN, cube_with_one_bent_strut, frame_files, uppermost, whole_frame

DOCS = Path(__file__).resolve().parent.parent / "docs"
CASES = [Case("views", name, changes={"iterations": n}) for n, name in enumerate(("4-paper", "4-fast"), 3)]


def command(log: Path, code: int = 0) -> Any:
    """What writes down that a case was run, and its result."""
    program = (
        "import sys; from pathlib import Path; from scripts.evidence.cases import Case;"
        "from scripts.evidence.records import write_record; log, out, name, n, code = sys.argv[1:];"
        "open(log, 'a').write(name + '\\n');"
        "case = Case('views', name, changes={'iterations': int(n)});"
        "int(code) or write_record(Path(out), case, {'struts': 1}); sys.exit(int(code))"
    )

    def words(case: Case) -> list[str]:
        changes = [case.name, str(case.changes["iterations"])]
        return ["-c", program, str(log), str(log.parent / "out"), *changes, str(code)]

    return words


class TestCases:
    def test_names_are_files_of_their_own(self) -> None:
        for quick in (False, True):
            paths = [path_of(Path("out"), case) for case in cases_of(plan_of(quick))]
            assert len(set(paths)) == len(paths)

    def test_own_frames_are_enough_for_some(self) -> None:
        plan = plan_of(True)
        own = type(plan)(True, {name: plan.frames[name] for name in OWN})
        assert {case.experiment for case in cases_of(own)} == {"cube", "partial", "prints"}

    def test_the_head_of_the_bunny_is_one_piece_of_as_many_struts_as_the_papers(self) -> None:
        files = frame_files()
        if "bunny_full_tri_dense" not in files:
            pytest.skip("the frames beside the project are not here")
        bunny = whole_frame(files["bunny_full_tri_dense"])
        head = uppermost(bunny, 165)
        assert head.strut_count == 154 and nx.is_connected(nx.Graph(head.edges.tolist()))
        middles = [frame.vertices[frame.edges].mean(axis=1) for frame in (head, bunny)]
        assert (middles[1][:, 2] > middles[0][:, 2].min()).sum() < 154 + 15  # little else is as high
        degrees = [dict(nx.Graph(frame.edges.tolist()).degree) for frame in (head, bunny)]
        where = {tuple(point): i for i, point in enumerate(bunny.vertices.tolist())}
        for joint, point in enumerate(head.vertices.tolist()):
            assert head.grounded[joint] == (degrees[0][joint] < degrees[1][where[tuple(point)]])

    def test_quick_reduces_the_papers_method_alone(self) -> None:
        pavilion = Path("Pavilion.txt")
        frames = dict.fromkeys((*frame_files(), "Femur", "Coral", "Lounge", "Pavilion"), pavilion)
        cases = [cases_of(type(plan_of(quick))(quick, frames)) for quick in (False, True)]
        names = [[(case.experiment, case.name) for case in some] for some in cases]
        others = {("rivals", f"{frame}-{rival}") for frame in ("Coral", "Lounge", "Pavilion") for rival in RIVALS}
        assert set(names[0]) - set(names[1]) == others and set(names[1]) < set(names[0])
        assert {experiment for experiment, _ in names[1]} == set(EXPERIMENTS)
        for full, quick in zip([c for c in cases[0] if (c.experiment, c.name) not in others], cases[1], strict=True):
            assert quick.quick and not full.quick
            if full.kind == "fit":
                assert ("image_scale" in quick.changes) == (full.preset != "fast")
                assert full.changes.items() <= quick.changes.items()
                assert "image_scale" not in full.changes

    def test_frames_that_are_not_here_are_left_out(self) -> None:
        plan = plan_of(False)
        some = type(plan)(False, {name: plan.frames[name] for name in OWN} | {"Coral": Path("Coral.txt")})
        cases = cases_of(some, ("table1", "bending", "power"))
        assert {(case.experiment, case.conditions["frame"]) for case in cases} == {
            ("table1", "Coral"), ("bending", "Coral"),
        }  # fmt: skip

    def test_only_some(self) -> None:
        assert {case.experiment for case in cases_of(plan_of(True), ("prints",))} == {"prints"}
        assert cases_of(plan_of(True), ("none",)) == []


class TestRuns:
    def test_what_is_there_is_not_run_again(self, tmp_path: Path) -> None:
        log, said = tmp_path / "log", []
        assert run_all(CASES, tmp_path / "out", command(log), said.append) == []
        assert log.read_text().split() == ["4-paper", "4-fast"]
        assert run_all(CASES, tmp_path / "out", command(log), said.append) == []
        assert log.read_text().split() == ["4-paper", "4-fast"]
        assert said[-1] == "2 of 2 cases are there; 0 to run."

    def test_other_conditions_and_spoilt_files_are_run_again(self, tmp_path: Path) -> None:
        log, out = tmp_path / "log", tmp_path / "out"
        run_all(CASES, out, command(log), lambda text: None)
        path_of(out, CASES[1]).write_text("{")
        others = [Case("views", "4-paper", changes={"iterations": 9}), CASES[1]]
        run_all(others, out, command(log), lambda text: None)
        assert log.read_text().split() == ["4-paper", "4-fast", "4-paper", "4-fast"]
        assert all(is_done(out, case) for case in others) and not is_done(out, CASES[0])

    def test_one_that_fails_does_not_stop_the_others(self, tmp_path: Path) -> None:
        good, bad = (command(tmp_path / "log", code) for code in (0, 1))
        failed = run_all(CASES, tmp_path / "out", lambda c: (bad if c is CASES[0] else good)(c), lambda text: None)
        assert failed == [CASES[0]] and is_done(tmp_path / "out", CASES[1])

    def test_an_interrupt_stops_all(self, tmp_path: Path) -> None:
        with pytest.raises(KeyboardInterrupt):
            run_all(CASES, tmp_path / "out", command(tmp_path / "log", 130), lambda text: None)
        assert (tmp_path / "log").read_text().split() == ["4-paper"]
        assert not (tmp_path / "out").exists()

    @pytest.mark.skipif(os.name == "nt", reason="there, Ctrl-C reaches both processes by itself")
    def test_ctrl_c_ends_the_case_that_runs(self, tmp_path: Path) -> None:
        script = DOCS.parent / "scripts" / "reproduce_paper.py"
        words = [sys.executable, str(script), "--out", str(tmp_path / "out"), "--quick", "--only", "cube"]
        with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, preexec_fn=hear_interrupts) as process:
            assert process.stderr is not None
            assert "[1/4] cube paper\n" in (process.stderr.readline() for _ in range(3))
            process.send_signal(signal.SIGINT)
            rest = process.stderr.read()  # up to its end, and its child's
            assert process.wait() == 130
        assert rest == "Interrupted.\n"
        assert not list((tmp_path / "out").rglob("*.json"))

    def test_progress_is_said_now_and_then(self, monkeypatch: pytest.MonkeyPatch) -> None:
        now, said = [0.0], []
        monkeypatch.setattr("scripts.evidence.runs.perf_counter", lambda: now[0])
        progress = EverySoOften(said.append)
        for second in range(25):
            now[0] = float(second)
            progress(Progress(f"stage {second % 2}", second, 25))
        assert said == ["    stage 0 10/25", "    stage 0 20/25"]


class Moved(DeformationField):
    """Displacements and a Laplacian in closed form."""

    def __init__(self, displacement: Any, laplacian: Any) -> None:
        self._displacement, self._laplacian = displacement, laplacian

    def evaluate(self, points: Any) -> Any:
        return self._displacement(points)

    def laplacian(self, points: Any) -> Any:
        return self._laplacian(points)

    def tensors(self) -> dict[str, np.ndarray]:
        raise NotImplementedError

    def metadata(self) -> dict[str, str]:
        raise NotImplementedError

    @classmethod
    def restore(cls, tensors: Any, metadata: Any) -> Any:
        raise NotImplementedError


class TestMeasures:
    def test_roughness_in_closed_form(self) -> None:
        struts = bezier.straight([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[16.0, 0.0, 0.0], [0.0, 3.0, 4.0]])
        grown = roughness(Moved(lambda x: 0.03 * x + 5.0, np.zeros_like), struts)
        assert grown["stretch"] == pytest.approx(0.03) and grown["laplacian"] == 0.0
        # (x^2 / 100, 0, 0): pieces of 1 mm from x to x + 1 grow by (2 x + 1) / 100; the Laplacian is 2 / 100 per mm.
        bent = Moved(lambda x: x**2 * [0.01, 0.0, 0.0], lambda x: np.full_like(x, 0.02) * [1.0, 0.0, 0.0])
        rough = roughness(bent, struts[:1])
        assert rough["stretch"] == pytest.approx(np.sqrt(np.mean((0.01 * (2.0 * np.arange(16) + 1.0)) ** 2)))
        assert rough["laplacian"] == pytest.approx(20.0)

    def test_the_cube_has_one_strut_that_bows(self) -> None:
        plan, truth = cube_with_one_bent_strut(100.0, 12.0)
        apart = np.linalg.norm(truth.control_points - plan.control_points, axis=2).max(axis=1)
        assert plan.strut_count == 12 and (apart > 0.0).sum() == 1
        assert (plan.degree == 3).all() and plan.chord_lengths == pytest.approx(100.0)
        middles = bezier.evaluate(truth.control_points, np.array([0.5]))[:, 0]
        assert middles[apart > 0.0][0] == pytest.approx([50.0, -12.0, 100.0])

    def test_unlike_silhouettes(self) -> None:
        plan, truth = cube_with_one_bent_strut()
        cameras = ring_rig(plan, 3, size=(90, 120))
        assert unlike(plan, plan, cameras) == 0.0
        assert 0.0 < unlike(plan, truth, cameras) < 0.3
        assert unlike(plan, truth, cameras) == unlike(truth, plan, cameras)
        one, other = (plan.subset(np.arange(12) == k)[0] for k in (0, 11))  # at opposite corners
        assert unlike(one, other, cameras[:1]) == 1.0

    def test_kernels_are_shown_by_themselves(self) -> None:
        plan, _ = cube_with_one_bent_strut()
        cameras = ring_rig(plan, 3, size=(180, 240))
        layout = KernelLayout.even(12, 40)
        kernels = anchored_kernels(torch.from_numpy(np.array(plan.control_points)), layout)
        tau = plan.radius[layout.strut_of_kernel] / effective_radius(1.0, 0.9)
        covariances = isotropic_covariance(kernels, torch.from_numpy(tau)).numpy()
        cloud = KernelCloud(kernels.means.numpy(), covariances, np.full(layout.size, 0.9))
        assert unlike(cloud, plan, cameras) < 0.15  # kernels overshoot the ends of struts
        away = dataclasses.replace(cloud, means=cloud.means + np.array([500.0, 0.0, 0.0]))
        assert unlike(away, plan, cameras) > 0.9

    @pytest.mark.parametrize("preset", RIVALS)
    def test_the_cube_is_measured_by_the_rivals_too(self, preset: str) -> None:
        result = measured(Case("cube", preset, "cube", "", preset, {"iterations": 2, "image_scale": 0.1}))
        assert 5.0 < result["after"]["curves"]["max"] < 15.0  # the bow is 12 mm high, and two steps are next to nothing
        assert all(0.0 < result["unlike"][views] < 1.0 for views in ("new", "input"))

    def test_a_fit_is_measured(self) -> None:
        simulation = {"views": 4, "size": [120, 160], "missing": 3, "printed": 0.7}
        case = Case("opacity", "fast", "fit", str(frame_files()["bridge"]), "fast", simulation=simulation)
        result = measured(case)
        assert (result["struts"], result["printed"]) == (76, 53) and result["seconds"] > 0.0
        assert result["after"]["curves"]["mean"] < result["before"]["curves"]["mean"]
        assert len(result["histogram"]) == len(BINS) and 0 < sum(result["histogram"]) <= 53
        assert result["missing"]["struts"] == 3 and result["missing"]["there"] == pytest.approx(0.5)
        assert result["missing"]["shown"] < result["missing"]["shown_of_others"]
        assert set(result["unprinted"]) == {"stretch", "laplacian"}
        json.dumps(result, allow_nan=False)


def record(out: Path, experiment: str, name: str, quick: bool = False, **result: Any) -> None:
    changes = {"samples": 6} if quick else {}
    case = Case(experiment, name, "fit", "NodeFemur_wireframe.txt", "paper", changes, quick=quick)
    write_record(out, case, result)


def errors(mean: float, largest: float) -> dict[str, dict[str, float]]:
    return {group: {"mean": mean, "p95": mean, "max": largest} for group in ("curves", "joints", "equal_parameter")}


@pytest.fixture
def results(tmp_path: Path) -> Path:
    out = tmp_path / "results"
    common = {"struts": 772, "seconds": 12.34, "processor_seconds": 20.0, "megabytes": 900, "loss": [4.0, 2.0, 1.0]}
    histogram = [0] * len(BINS)
    histogram[2] = 772
    for name, quick, mean in (("Femur-paper", True, 0.5), ("Femur-fast", False, 0.0625), ("Coral-paper", True, 0.25)):
        record(out, "table1", name, quick, after=errors(mean, 3.0 * mean), histogram=histogram, **common)
    record(out, "table1", "Femur-paper", after=errors(0.125, 1.5), histogram=histogram, **common)
    partial = {**common, "printed": 38, "struts": 76}
    for name in ("bridge-0.5-fast", "bridge-0.5-paper", "bridge-1-fast"):
        record(out, "partial", name, after=errors(0.25, 0.5), histogram=histogram, **partial)
    for name in ("1", "2", "inf"):
        record(out, "power", name, after=errors(0.5, 1.5), histogram=histogram, **common)
    record(out, "prints", "bridge-adapted", e_max=[1.25, 2.5], batches=2, completed=True, collapsed_at_batch=None)
    record(out, "prints", "bridge-plain", e_max=[1.5], batches=2, completed=False, collapsed_at_batch=1)
    return out


class TestPage:
    def test_full_size_counts_where_there_are_both(self, results: Path) -> None:
        found = best(read_records(results), "table1")
        assert set(found) == {"Femur-paper", "Femur-fast", "Coral-paper"}
        assert not found["Femur-paper"]["conditions"]["quick"] and found["Coral-paper"]["conditions"]["quick"]

    def test_figures_stand_beside_the_papers(self, results: Path) -> None:
        lines = tables.table1(read_records(results)).splitlines()
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| Femur")]
        assert rows[0][:5] == ["Femur", "772", "0.125 / 1.50", "0.062 / 0.19", "0.115 / 1.82"]
        assert rows[1] == ["Femur", "772", *["12.3", "20", "900"] * 2, "61", "6190"]
        (coral,) = [line for line in lines if line.startswith("| Coral") and "0.209" in line]
        assert "0.250 / 0.75*" in coral  # reduced, and said so

    def test_partial_prints_are_in_order_beside_the_papers(self, results: Path) -> None:
        lines = [line for line in tables.partial(read_records(results)).splitlines() if line.startswith("| bridge")]
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
        mine = ["0.250 / 0.50", "12.3", "20"]
        assert rows[0] == ["bridge", "38 of 76", *mine, *mine, "72 to 73"]
        assert rows[1] == ["bridge", "38 of 76", "", "", "", *mine, "72 to 73"]

    def test_powers_are_in_order_and_show_how_far_the_loss_fell(self, results: Path) -> None:
        lines = [line for line in tables.power(read_records(results)).splitlines() if line.startswith("| ")][2:]
        assert [line.split("|")[1].strip() for line in lines] == ["1", "2", "without end"]
        assert all("| 0.250 |" in line for line in lines)

    def test_every_table_is_whole(self, results: Path) -> None:
        text = page(read_records(results))
        for block in text.split("\n\n"):
            rows = [line for line in block.splitlines() if line.startswith("|")]
            assert len({line.count("|") for line in rows}) <= 1
        assert "collapsed in batch 1" in text and ", ".join(f"{e:.1f}" for e in paper.E_MAX["bridge"]) in text

    def test_the_page_is_written_with_its_figures(self, results: Path, tmp_path: Path) -> None:
        written = write_page(tmp_path / "page", read_records(results))
        for experiment in ("table1", "power", "prints"):
            for name in FIGURES[experiment]:
                assert (written.parent / "evidence" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
                assert f"(evidence/{name}.png)" in written.read_text()
        assert not (written.parent / "evidence" / "views.png").exists()

    def test_files_of_other_kinds_are_named(self, results: Path) -> None:
        write_json(results / "full" / "table1" / "other.json", {"format": "other"})
        with pytest.raises(InputError, match="other.json: format"):
            read_records(results)

    def test_the_page_of_the_documentation_is_that_of_its_results(self) -> None:
        data = json.loads((DOCS / "evidence.json").read_text(encoding="utf-8"))
        assert (DOCS / "evidence.md").read_text(encoding="utf-8") == page(data["records"])


def test_readme_and_figures_show_what_the_evidence_says(tmp_path: Path) -> None:
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        assert filled(text, json.loads(EVIDENCE.read_text(encoding="utf-8"))["records"], path) == text
        assert any(BEGIN.format(name) in text for name in TABLES)
        (tmp_path / path.name).write_text(text, encoding="utf-8")
    # Another result changes both pages.
    data = json.loads(EVIDENCE.read_text(encoding="utf-8"))
    for record in data["records"]:
        if record["conditions"]["name"] == "Femur-fast":
            record["result"]["after"]["curves"] = {"mean": 0.1234, "p95": 0.2, "max": 7.891}
    other = tmp_path / "evidence.json"
    other.write_text(json.dumps(data), encoding="utf-8")
    copies = [tmp_path / path.name for path in PAGES]
    assert fill_pages(other, copies) == copies
    assert all("0.123 / 7.89" in copy.read_text(encoding="utf-8") for copy in copies)
    assert fill_pages(other, copies) == []
    with pytest.raises(InputError, match="does not end"):
        filled(BEGIN.format("fast") + "\n| a |\n", data["records"], tmp_path / "page.md")
