"""``frametwin dataset view``: a page that stands alone, with every picture that it names beside it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from dataset_cases import edit_image, make_dataset, note_again, rows_of, run_command

from frametwin.capture.capture import read_capture
from frametwin.cli.dataset_view import view_command
from frametwin.dataset.fits import fit_dataset
from frametwin.dataset.folder import sample_folder
from frametwin.dataset.view import write_page
from frametwin.errors import Cancelled, InputError
from frametwin.geometry.parametric import named_frame
from frametwin.twin.twin import read_twin

NASTY = "<b>&\"'</script><!--\u2028 ok"
SAMPLES = ({"seed": 1, "missing": 2}, {"seed": 2, "deformation": "warp"}, {"seed": 3, "views": 3})


class Page(HTMLParser):
    """What is in a page: its elements, and the JSON in it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.folder = path.parent
        self.text = path.read_text(encoding="utf-8")
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.json = ""
        self.title = ""
        self.feed(self.text)
        self.close()
        self.data: dict[str, Any] = json.loads(self.json)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "input", "link", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "title":
            self.title += data
        if self.open and self.open[-1] == "script" and self.elements[-1][1].get("type") == "application/json":
            self.json += data

    def pictures(self, row: dict[str, Any]) -> list[Path]:
        folder = self.folder / unquote(self.data["pictures"]) / f"{row['index']:06d}"
        return [folder / f"{i}.jpg" for i in range(row["views"])]

    def detail(self, row: dict[str, Any]) -> dict[str, Any]:
        path = self.folder / unquote(self.data["pictures"]) / f"{row['index']:06d}" / "data.js"
        found = re.fullmatch(r"frametwin\((.*)\);\n", path.read_text(encoding="utf-8"), re.DOTALL)
        assert found is not None
        return dict(json.loads(found[1]))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    frame = named_frame("bridge").replace(name=NASTY.replace("\u2028", ""))
    folder = make_dataset(
        tmp_path_factory.mktemp("datasets") / "a b#c%20d",
        samples=SAMPLES,
        frame=frame,
        name=NASTY,
        size=(150, 200),
        views=4,
        failed={7: NASTY},
    )
    fit_dataset(folder)
    write_page(folder)
    return folder


@pytest.fixture
def dataset(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "dataset")


def test_the_page_is_well_formed_and_stands_alone(made: Path) -> None:
    page = Page(made / "index.html")
    assert page.open == []
    assert not re.search(r"https?:|//[a-z]+\.", page.text.replace("location.", ""))
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "base") and not attributes.get("src") and not attributes.get("href")


def test_everything_that_the_page_names_is_there(made: Path) -> None:
    page = Page(made / "index.html")
    assert len(page.data["rows"]) == 3 and min(row["views"] for row in page.data["rows"]) >= 3
    for row in page.data["rows"]:
        for path in page.pictures(row):
            image = cv2.imread(str(path))
            assert image is not None and [image.shape[1], image.shape[0]] == row["size"]
        detail = page.detail(row)
        assert len(detail["views"]) == row["views"]
        for view in detail["views"]:
            sample = page.folder / unquote(page.data["folder"]) / "samples" / f"{row['index']:06d}"
            assert (sample / view["image"]).is_file() and view["background"] is None


def test_names_cannot_break_out_of_the_page(made: Path) -> None:
    page = Page(made / "index.html")
    assert page.title == f"{NASTY} · FrameTwin dataset" and page.data["name"] == NASTY
    assert page.data["failed"] == [{"index": 7, "reason": NASTY}]
    assert page.data["rows"][0]["frame"] == NASTY.replace("\u2028", "")
    assert page.text.count("<script") == 2 and page.text.count("</script>") == 2 and "<b>" not in page.text
    for path in made.glob("view/*/data.js"):
        assert not set("<>&\u2028") & set(path.read_text(encoding="utf-8"))


def test_rows_can_be_sorted_by_what_was_measured(made: Path) -> None:
    page, table = Page(made / "index.html"), rows_of(made)
    assert [row["index"] for row in page.data["rows"]] == [0, 1, 2]
    for row in page.data["rows"]:
        measured = table[row["index"]]
        for name in (
            "curves_mean",
            "curves_max",
            "joints_mean",
            "joints_max",
            "equal_max",
            "seconds",
            "found",
            "false",
        ):
            assert row["figures"][name] == getattr(measured, name)
        assert row["struts"] == 76 and row["views"] == measured.views and row["moved"] > 1.0
    assert [row["missing"] for row in page.data["rows"]] == [2, 0, 0]
    assert "warp" in page.data["rows"][1]["words"]


def test_the_detail_view_draws_the_curves_of_the_files(made: Path) -> None:
    page = Page(made / "index.html")
    detail = page.detail(page.data["rows"][0])
    capture, twin = read_capture(sample_folder(made, 0)), read_twin(made / "runs" / "000000")
    assert capture.truth is not None
    for name, curves in (("plan", capture.frame), ("truth", capture.truth), ("twin", twin)):
        shown = np.array(detail["curves"][name]).reshape(-1, 4, 3)
        np.testing.assert_allclose(shown, curves.control_points, atol=6e-4)
    point = capture.frame.vertices[5]
    for shown_view, view in zip(detail["views"], capture.views, strict=True):
        x, y, z = np.array(shown_view["m"]).reshape(3, 4) @ np.append(point, 1.0)
        fl_x, fl_y, cx, cy = shown_view["k"]
        np.testing.assert_allclose([fl_x * x / z + cx, fl_y * y / z + cy], view.camera.project(point)[0], atol=1e-9)
    assert len(detail["present"]) == 2 and sum(detail["printed"]) == 76
    assert detail["specification"]["seed"] == 1 and len(detail["struts"]["max"]) == 76


def test_pictures_are_made_again_only_where_something_changed(dataset: Path) -> None:
    write_page(dataset)
    before = {path: path.stat().st_mtime_ns for path in dataset.glob("view/*/*")}
    write_page(dataset)
    assert {path: path.stat().st_mtime_ns for path in dataset.glob("view/*/*")} == before
    shutil.rmtree(dataset / "runs" / "000001")
    page = write_page(dataset)
    assert page.samples == 3 and page.fitted == 2
    changed = {path.parent.name for path in dataset.glob("view/*/*") if path.stat().st_mtime_ns != before[path]}
    assert changed == {"000001"}


def test_a_run_of_other_pictures_is_not_shown(dataset: Path) -> None:
    image = next((sample_folder(dataset, 0) / "images").iterdir())
    edit_image(image, lambda pixels: np.maximum(pixels, 255 * (np.indices(pixels.shape).sum(axis=0) == 0)).astype("u1"))
    note_again(dataset)
    assert write_page(dataset).fitted == 2
    page = Page(dataset / "index.html")
    assert (
        "other pictures" in page.data["rows"][0]["error"] and "twin" not in page.detail(page.data["rows"][0])["curves"]
    )


def test_a_sample_that_is_damaged_does_not_hide_the_others(dataset: Path) -> None:
    (sample_folder(dataset, 1) / "transforms.json").write_text("{")
    note_again(dataset, 1)
    page = write_page(dataset)
    assert (page.samples, page.fitted) == (3, 2)
    row = Page(dataset / "index.html").data["rows"][1]
    assert row["views"] == 0 and "transforms.json" in row["error"]


def test_pictures_of_samples_that_are_gone_are_removed(dataset: Path) -> None:
    shutil.rmtree(sample_folder(dataset, 2))
    (dataset / "view" / "mine").mkdir()
    note_again(dataset)
    write_page(dataset)
    assert sorted(path.name for path in (dataset / "view").iterdir()) == ["000000", "000001", "mine"]


def test_a_page_elsewhere_points_back_at_the_dataset(dataset: Path, tmp_path: Path) -> None:
    result = run_command(view_command, dataset, "--out", tmp_path / "pages" / "one.html", "--quiet")
    assert result.exit_code == 0 and "file://" in result.stdout and "3 of them fitted" in result.stdout
    page = Page(tmp_path / "pages" / "one.html")
    assert page.data["pictures"] == "one_view" and page.data["folder"] == "../dataset"
    assert all(path.is_file() for row in page.data["rows"] for path in page.pictures(row))


def test_a_dataset_that_is_not_fitted_has_a_page_too(tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "d", samples=[{"seed": 1}], views=2)
    assert write_page(dataset).fitted == 0
    page = Page(dataset / "index.html")
    assert page.data["rows"][0]["figures"] is None and set(page.detail(page.data["rows"][0])["curves"]) == {
        "plan",
        "truth",
    }


def test_wrong_places_and_stopping(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        write_page(dataset, tmp_path)
    assert run_command(view_command, tmp_path).exit_code == 2
    with pytest.raises(Cancelled):
        write_page(dataset, tmp_path / "page.html", progress=lambda step: step.iteration < 1)
    assert not (tmp_path / "page.html").exists()


def test_a_browser_shows_the_list_and_the_detail(made: Path, tmp_path: Path) -> None:
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no browser to look at the page with")
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
    flags += ("--disable-component-update", "--disable-sync", "--virtual-time-budget=3000")
    command = [browser, *flags, f"--user-data-dir={tmp_path}", "--dump-dom", (made / "index.html").as_uri() + "#1/2"]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL).stdout
    assert shown.count('<article class="sample"') == 3
    worst = max(rows_of(made).values(), key=lambda row: row.curves_max or 0.0)
    first = re.search(r'data-index="(\d)"', shown)
    assert first is not None and int(first[1]) == worst.index  # the worst one comes first
    assert re.search(r"<dialog[^>]* open", shown) and "camera_02" in shown and f"{worst.curves_max:.3f}" in shown
