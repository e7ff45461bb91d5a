"""Struts that are bent as no cubic can be, drawn and written as they are."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bowed_struts import bowed, with_pieces
from cli_tools import done
from rod_cases import camera_at

from frametwin.dataset.sample_view import _rounded
from frametwin.formats import frame_json, read_frame
from frametwin.geometry import bezier
from frametwin.geometry.displacement import strut_displacements
from frametwin.geometry.nearest import distances_to_curves
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.pieces import cubic_pieces, pieces_deviation, pieces_needed
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes
from frametwin.report.run_report import run_content
from frametwin.twin.twin import Twin, write_twin

U = np.linspace(0.0, 1.0, 41)
PACKAGE = Path(__file__).parent.parent / "frametwin"


@pytest.fixture(scope="module")
def plan() -> Wireframe:
    return named_frame("bridge")


@pytest.fixture(scope="module")
def twin(plan: Wireframe) -> Twin:
    """The plan, but struts 3 and 5 bow by six radii, and 5's is told at a higher degree."""
    by = 6.0 * plan.radius[:, None] * np.array([0.0, 0.0, -1.0])
    bent = {3: bowed(plan.control_points[3], by[3]), 5: bezier.elevate(bowed(plan.control_points[5], by[5]), 6)}
    ones = np.ones((plan.strut_count, 20))
    return Twin(
        control_points=plan.control_points,
        vertices=plan.vertices,
        thickness=plan.radius[:, None] * ones,
        opacity=ones,
        completeness=ones[:, 0],
        confidence=ones[:, 0],
        bent=bent,
    )


@pytest.fixture
def run(plan: Wireframe, twin: Twin, tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    folder.mkdir()
    write_twin(folder, twin)
    frame_json.write(folder / "frame.json", plan)
    return folder


def true_bow(plan: Wireframe, strut: int, u: np.ndarray) -> np.ndarray:
    """(N,) by which a strut of the twin bows, in mm: 16 u^2 (1 - u)^2 of six radii."""
    return 96.0 * plan.radius[strut] * u**2 * (1.0 - u) ** 2


def test_pieces_of_a_quartic_are_off_by_the_error_of_hermite_interpolation() -> None:
    quartic = np.zeros((5, 3))
    quartic[4, 2] = 384.0  # z = 384 u^4, whose fourth derivative over 384 is 24
    for count in (1, 2, 3, 5):
        pieces = cubic_pieces(quartic, count)
        found = bezier.evaluate(pieces, U)  # (count, 41, 3)
        places = (np.arange(count)[:, None] + U) / count
        off = np.linalg.norm(found - bezier.evaluate(quartic, places.ravel()).reshape(found.shape), axis=2)
        assert off.max() == pytest.approx(24.0 / count**4)
        assert off.max() <= pieces_deviation(quartic, count) < 3.0 * off.max()
        np.testing.assert_allclose(pieces[1:, 1] - pieces[1:, 0], pieces[:-1, 3] - pieces[:-1, 2])  # smooth


def test_as_many_pieces_are_made_as_are_needed() -> None:
    rng = np.random.default_rng(4)
    for curve in rng.normal(size=(20, 6, 3)):
        count = pieces_needed(curve, 0.01)
        assert pieces_deviation(curve, count) <= 0.01 < pieces_deviation(curve, count - 1)
        pieces = bezier.evaluate(cubic_pieces(curve, count), U)
        places = (np.arange(count)[:, None] + U) / count
        assert (
            np.linalg.norm(pieces - bezier.evaluate(curve, places.ravel()).reshape(pieces.shape), axis=2).max() < 0.01
        )
        cubic = curve[:4]
        assert pieces_needed(cubic, 1e-12) == 1 and pieces_needed(cubic, 1e-12, 4) == 4
        np.testing.assert_allclose(cubic_pieces(cubic, 2)[0], bezier.split(cubic, 0.5)[0])


def test_the_nearest_point_of_a_bent_strut_is_found() -> None:
    curve = bowed(bezier.straight([0.0, 0.0, 0.0], [40.0, 0.0, 0.0]), np.array([0.0, 0.0, 5.0]))
    points = np.random.default_rng(5).uniform([0, -5, 0], [40, 5, 5], (50, 3))
    fine = bezier.evaluate(curve, np.linspace(0.0, 1.0, 20001))
    wanted = [np.linalg.norm(fine - point, axis=1).min() for point in points]
    np.testing.assert_allclose(distances_to_curves(points, np.tile(curve, (50, 1, 1))), wanted, atol=1e-4)


def test_the_displacement_of_a_bent_strut_is_that_of_its_curve(plan: Wireframe, twin: Twin) -> None:
    away = strut_displacements(twin.change_from(plan))
    expected = np.zeros(plan.strut_count)
    expected[[3, 5]] = 6.0 * plan.radius[[3, 5]]
    np.testing.assert_allclose(away, expected, atol=1e-9)


def test_silhouettes_show_bent_struts_as_they_are(plan: Wireframe, twin: Twin) -> None:
    centre = plan.vertices.mean(axis=0)
    camera = camera_at(centre + plan.extent * np.array([0.9, 0.8, 0.3]), (300, 400), 320.0, centre)
    seen = silhouettes(twin.as_wireframe(plan), [camera], curves=twin.curves)[0]
    by = np.array([0.0, 0.0, -6.0 * plan.radius[5]])
    cut = with_pieces(plan, {3: twin.bent[3], 5: bowed(plan.control_points[5], by)})
    wanted = silhouettes(cut, [camera])[0]
    cubic = silhouettes(twin.as_wireframe(plan), [camera])[0]
    assert (seen != wanted).sum() <= 0.002 * (wanted > 0).sum()
    assert (cubic != wanted).sum() > 20 * max(1, (seen != wanted).sum())


def test_lines_of_a_run_follow_bent_struts_and_a_frame_says_that_it_cannot(
    plan: Wireframe, twin: Twin, run: Path, tmp_path: Path
) -> None:
    told = done("convert", run, tmp_path / "twin.obj", "--scale", "2").stdout
    assert "bent" not in told
    lines = [line.split()[1:] for line in (tmp_path / "twin.obj").read_text().splitlines() if line.startswith("l ")]
    points = read_frame(tmp_path / "twin.obj")
    assert len(lines) == plan.strut_count and [i for i, line in enumerate(lines) if len(line) > 2] == [3, 5]
    rows = [line.split()[1:] for line in (tmp_path / "twin.obj").read_text().splitlines() if line.startswith("v ")]
    for strut in (3, 5):
        chain = np.array([rows[int(number) - 1] for number in lines[strut]], dtype=float)
        u = np.linspace(0.0, 1.0, len(chain))
        wanted = bezier.evaluate(plan.control_points[strut], u)
        wanted[:, 2] -= true_bow(plan, strut, u)
        np.testing.assert_allclose(chain, 2.0 * wanted, atol=1e-9)
    assert points.strut_count > plan.strut_count
    assert "2 struts are bent as no cubic can be" in done("convert", run, tmp_path / "twin.json").stdout
    np.testing.assert_array_equal(read_frame(tmp_path / "twin.json").control_points, twin.control_points)


def javascript(script: str) -> Any:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node to run a page's script with")
    told = subprocess.run([node, "-e", script], capture_output=True, text=True, check=True)
    return json.loads(told.stdout)


def test_a_report_draws_bent_struts_by_their_curves(plan: Wireframe, twin: Twin, run: Path) -> None:
    scene = run_content(run)["scenes"][0]
    assert scene["degree"] == 6
    told = np.frombuffer(base64.b64decode(scene["curves"]), "<f4").reshape(plan.strut_count, 7, 3)
    np.testing.assert_allclose(told, twin.curves, atol=1e-4)
    assert scene["quantities"]["displacement"][3] == pytest.approx(6.0 * plan.radius[3], rel=1e-3)
    text = (PACKAGE / "report" / "assets" / "data.js").read_text(encoding="utf-8")
    maths = text[text.index("/** How many numbers") : text.index("/** Range of a quantity")]
    maths += text[text.index("function floats") : text.index("const QUANTITIES")]
    maths += text[text.index("/** Curves one after") : text.index("/** The scene, decoded once")]
    places = [0.0, 0.25, 0.6, 1.0]
    script = f"{maths} const curves = curvesIn({json.dumps(scene['curves'])}, {scene['degree']});"
    script += f"const plan = curvesIn({json.dumps(scene['plan']['curves'])});"
    script += f"const on = [3, 7].map((i) => {places}.map((u) => [...pointOn(curves, i, u, [0, 0, 0])]));"
    script += "console.log(JSON.stringify([on, elevated(plan, 3, 6), sizeOf(curves)]));"
    found, elevated, size = javascript(script)
    np.testing.assert_allclose(found, bezier.evaluate(twin.curves[[3, 7]], places), atol=1e-4)
    np.testing.assert_allclose(np.reshape(elevated, (7, 3)), bezier.elevate(plan.control_points[3], 6), atol=1e-4)
    assert size == 21


def test_the_page_of_a_dataset_draws_bent_struts_by_their_curves(plan: Wireframe, twin: Twin) -> None:
    page = (PACKAGE / "dataset" / "page.html").read_text(encoding="utf-8")
    maths = page[page.index("function bernstein(") : page.index("function showView(")]
    shown = {"curves": {"twin": _rounded(twin.curves), "plan": _rounded(plan.control_points)}, "views": [{}]}
    shown |= {"printed": plan.printed.astype(int).tolist(), "present": {}}
    script = f"{maths} const CHORDS = 16, S = {json.dumps({'data': shown, 'view': 0})};"
    script += "const project = (camera, x, y, z) => [x, y, z];"
    script += "console.log(JSON.stringify([chains('twin'), chains('plan')]));"
    found, planned = javascript(script)
    u = np.linspace(0.0, 1.0, 17)
    np.testing.assert_allclose(found, bezier.evaluate(twin.curves, u), atol=1e-2)
    np.testing.assert_allclose(planned, bezier.evaluate(plan.control_points, u), atol=1e-2)
