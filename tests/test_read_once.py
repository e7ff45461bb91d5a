"""Files of a capture are read once for a command: what is checked, decoded, hashed and copied are the same bytes."""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from print_cases import LeaningPrint, print_batch, small_job
from small_frames import tower

from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import read_capture, write_capture
from frametwin.capture.picture import Picture
from frametwin.errors import InputError
from frametwin.fitting.api import fit_capture, write_run
from frametwin.progress import Progress
from frametwin.raster.silhouette import silhouettes
from frametwin.twin.twin import read_twin

_open_folders: list[tuple[str, Counter[str]]] = []


def _count(event: str, arguments: tuple[Any, ...]) -> None:
    """Told by Python of everything that happens; a hook cannot be taken out again."""
    if event != "open" or not _open_folders or not isinstance(arguments[0], str | os.PathLike):
        return
    path, mode = os.path.abspath(os.fspath(arguments[0])), arguments[1] or ""
    for folder, counts in _open_folders:
        if path.startswith(folder + os.sep) and not set("wxa+") & set(mode) and os.path.isfile(path):
            counts[Path(path).relative_to(folder).as_posix()] += 1


sys.addaudithook(_count)


@contextmanager
def counted_reads(folder: Path) -> Iterator[Counter[str]]:
    """How often each file of a folder is opened to be read, by its name in the folder."""
    counts: Counter[str] = Counter()
    _open_folders.append((os.path.abspath(folder), counts))
    try:
        yield counts
    finally:
        _open_folders.pop()


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file, by its name in the folder."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture
def photographed(tmp_path: Path) -> Path:
    """A capture with a view before printing for every view."""
    frame = tower()
    cameras = ring_rig(frame, 4, size=(120, 160))
    folder = tmp_path / "capture"
    empty = [np.zeros((120, 160), dtype=np.uint8)] * 4
    write_capture(folder, frame, cameras, silhouettes(frame, cameras), backgrounds=empty)
    return folder


def test_the_counter_counts(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    file = tmp_path / "a" / "b.txt"
    with counted_reads(tmp_path) as counts:
        file.write_bytes(b"abc")
        assert not counts
        file.read_bytes()
        with open(file, encoding="utf-8") as stream:
            stream.read()
    file.read_bytes()
    assert counts == {"a/b.txt": 2}


def test_a_fit_reads_every_file_once(photographed: Path, tmp_path: Path) -> None:
    with counted_reads(photographed) as counts:
        capture = read_capture(photographed)
        result = fit_capture(capture)
        write_run(tmp_path / "run", result, capture)
    names = digests(photographed)
    assert len(names) == 10 and counts == dict.fromkeys(names, 1)
    assert read_twin(tmp_path / "run").provenance["inputs"] == names


def test_the_hashes_are_those_of_what_was_fitted(photographed: Path) -> None:
    capture, names = read_capture(photographed), digests(photographed)
    shutil.rmtree(photographed)
    assert fit_capture(capture).twin.provenance["inputs"] == names


def test_an_answer_reads_every_file_once(tmp_path: Path) -> None:
    job = small_job(tmp_path / "job", tower(), formats=("json",))
    real = LeaningPrint(job.design)
    source = real.take(tmp_path / "pictures", print_batch(job, real))
    with counted_reads(source) as counts, counted_reads(job.folder) as inside:
        report = job.answer(source)
    names = digests(source)
    assert len(names) == 6 and counts == dict.fromkeys(names, 1)
    assert not any("/capture/" in name for name in inside)  # the copy is written and not read
    copy = job.batch_folder(0) / "capture"
    assert {name: digest for name, digest in digests(copy).items() if name != "frame.json"} == names
    assert report["pictures"] == {name: digest for name, digest in names.items() if name.startswith("images/")}
    assert read_twin(job.batch_folder(0) / "run").provenance["inputs"] == names


def test_pictures_that_vanish_after_they_were_read_are_not_missed(tmp_path: Path) -> None:
    job = small_job(tmp_path / "job", tower(), formats=("json",))
    real = LeaningPrint(job.design)
    source = real.take(tmp_path / "pictures", print_batch(job, real))
    names = digests(source)

    def sweep(progress: Progress) -> None:
        if progress.stage == "reading images" and source.exists():
            shutil.rmtree(source)

    job.answer(source, progress=sweep)
    assert not source.exists()
    assert names.items() <= digests(job.batch_folder(0) / "capture").items()


def test_a_picture_is_what_the_file_held(tmp_path: Path, photographed: Path) -> None:
    path = photographed / "images" / "camera_00.png"
    data = path.read_bytes()
    picture = Picture.read(path)
    assert (picture.path, picture.data, picture.size) == (path, data, (160, 120))
    assert picture.sha256 == hashlib.sha256(data).hexdigest()
    path.write_bytes(data[:-20])
    with pytest.raises(InputError, match="cut short"):
        Picture.read(path)
    path.unlink()
    with pytest.raises(InputError, match="missing"):
        Picture.read(path)
