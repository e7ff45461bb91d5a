"""Hashes of samples, and reading what datasets and samples say of themselves."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest
from dataset_cases import edit_json, make_dataset

from frametwin.dataset.folder import (
    check_sample,
    hash_sample,
    read_dataset,
    read_sample,
    sample_folder,
    write_dataset_json,
    write_sample_json,
)
from frametwin.dataset.hashes import content_hash, hash_file, load_npz, sample_content
from frametwin.errors import InputError


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_dataset(tmp_path_factory.mktemp("datasets") / "made", failed={2: "the disk was full"})


@pytest.fixture
def dataset(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "dataset")


def write_exr(path: Path, parts: dict[str, dict[str, np.ndarray]], comment: str) -> None:
    header = {"type": OpenEXR.scanlineimage, "comments": comment}
    written = [
        OpenEXR.Part({**header, "name": name, "compression": OpenEXR.ZIP_COMPRESSION}, dict(channels))
        for name, channels in parts.items()
    ]
    OpenEXR.File(written).write(str(path))


def test_content_of_pictures_is_their_pixels(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 256, (40, 30, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), image, [cv2.IMWRITE_PNG_COMPRESSION, 0])
    cv2.imwrite(str(tmp_path / "b.png"), image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    first, second = hash_file(tmp_path / "a.png"), hash_file(tmp_path / "b.png")
    assert first.sha256 != second.sha256 and first.content == second.content
    image[3, 4, 1] ^= 1
    cv2.imwrite(str(tmp_path / "b.png"), image)
    assert content_hash(tmp_path / "b.png") != first.content
    flat = np.zeros((6, 4), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), flat)
    cv2.imwrite(str(tmp_path / "b.png"), flat.reshape(4, 6))
    assert content_hash(tmp_path / "a.png") != content_hash(tmp_path / "b.png")  # the shape counts


def test_content_of_exr_is_its_channels_by_name(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    depth, x, y = (rng.random((5, 7)).astype(np.float32) for _ in range(3))
    write_exr(tmp_path / "a.exr", {"depth": {"Z": depth}, "normal": {"X": x, "Y": y}}, "made on Monday")
    write_exr(tmp_path / "b.exr", {"normal": {"Y": y, "X": x}, "depth": {"Z": depth}}, "made on Tuesday")
    assert content_hash(tmp_path / "a.exr") == content_hash(tmp_path / "b.exr")
    assert hash_file(tmp_path / "a.exr").sha256 != hash_file(tmp_path / "b.exr").sha256
    write_exr(tmp_path / "b.exr", {"depth": {"Z": depth}, "normal": {"X": y, "Y": x}}, "made on Monday")
    assert content_hash(tmp_path / "a.exr") != content_hash(tmp_path / "b.exr")


def test_content_of_npz_is_its_arrays_by_name(tmp_path: Path) -> None:
    a, b = np.arange(6.0).reshape(2, 3), np.array(["x", "yy"])
    np.savez(tmp_path / "a.npz", a=a, b=b)
    np.savez_compressed(tmp_path / "b.npz", b=b, a=np.asfortranarray(a))
    assert content_hash(tmp_path / "a.npz") == content_hash(tmp_path / "b.npz")
    np.savez(tmp_path / "b.npz", a=a.astype(np.float32), b=b)
    assert content_hash(tmp_path / "a.npz") != content_hash(tmp_path / "b.npz")


@pytest.mark.parametrize("name", ["a.png", "a.exr", "a.npz"])
@pytest.mark.parametrize("data", [b"", b"nothing of the kind"])
def test_damaged_content_is_refused(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=name):
        content_hash(tmp_path / name)


def test_pickles_are_not_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", a=np.array([{}], dtype=object))
    with pytest.raises(InputError, match="plain arrays"):
        load_npz(tmp_path / "a.npz")


def test_a_sample_is_what_was_written(made: Path) -> None:
    folder = sample_folder(made, 0)
    sample = read_sample(folder)
    assert sample.index == 0 and sample.specification["missing"] == 2 and sample.made_with == {"frametwin": "tests"}
    names = {"frame.json", "transforms.json", "truth.json", "simulation.json", "defects.json", "curves.npz"}
    assert set(sample.files) == names | {f"images/{path.name}" for path in (folder / "images").iterdir()}
    assert dict(sample.files) == hash_sample(folder) and check_sample(folder) == []


def test_the_hash_of_a_sample_depends_on_content_and_specification_alone(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    before = read_sample(folder)
    image = next((folder / "images").iterdir())
    pixels = cv2.imread(str(image), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(image), pixels, [cv2.IMWRITE_PNG_COMPRESSION, 0])
    assert write_sample_json(folder, 0, before.specification, {"blender": "99"}) == before.content
    assert write_sample_json(folder, 0, {**before.specification, "seed": 9}, {}) != before.content
    renamed = {f"other/{name}": entry for name, entry in before.files.items()}
    assert sample_content(renamed, before.specification) != before.content


def test_a_dataset_lists_what_is_there(made: Path) -> None:
    dataset = read_dataset(made)
    assert (dataset.name, dataset.seed, dataset.count) == ("small", 0, 3)
    assert [entry.index for entry in dataset.samples] == [0, 1] and dataset.absent == []
    assert [entry.content for entry in dataset.samples] == [
        read_sample(entry.folder).content for entry in dataset.samples
    ]
    assert [(entry.index, entry.reason) for entry in dataset.failed] == [(2, "the disk was full")]
    assert dataset.run_folder(1) == made / "runs" / "000001"


def test_a_dataset_forgets_failures_that_have_been_mended(dataset: Path) -> None:
    (dataset / "samples" / "000007").mkdir()  # not finished: nothing is noted in it
    (dataset / "samples" / ".000008.new.part").mkdir()
    write_dataset_json(dataset, name="n", description="", recipe={}, seed=3, count=9, failed={1: "no", 5: "never"})
    found = read_dataset(dataset)
    assert [entry.index for entry in found.samples] == [0, 1] and [entry.index for entry in found.failed] == [5]
    assert found.absent == [2, 3, 4, 6, 7, 8]


def test_changes_are_seen(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    images = sorted((folder / "images").iterdir())
    images[0].unlink()
    data = bytearray(images[1].read_bytes())
    data[-20] ^= 1
    images[1].write_bytes(bytes(data))
    (folder / "truth.json").write_text("{}")
    (folder / "thumbs.db").write_text("")
    problems = check_sample(folder)
    assert len(problems) == 4
    for words in ("images/camera_00.png is missing", "thumbs.db is there, but", "images/camera_01.png has changed"):
        assert any(
            words.replace("camera_00", images[0].stem).replace("camera_01", images[1].stem) in p for p in problems
        )
    assert any(p.startswith("truth.json has 2 bytes where") for p in problems)


def test_notes_that_do_not_fit_each_other_are_seen(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    edit_json(folder / "sample.json", lambda data: data["specification"].update(seed=77))
    assert check_sample(folder) == ["sample.json: the hash of the sample is not that of its files and specification"]


def _without(key: str) -> Callable[[dict[str, Any]], None]:
    return lambda data: data.pop(key)


SAMPLE_DAMAGES: list[tuple[Callable[[dict[str, Any]], object], str]] = [
    (_without("format"), "format: is missing"),
    (lambda d: d.update(version=2), "version: 2 is not known"),
    (_without("index"), "index: is missing"),
    (lambda d: d.update(index=-1), "index: is -1"),
    (lambda d: d.update(index=True), "index: is not a whole number"),
    (lambda d: d.update(content="abc"), "content: is not a SHA-256"),
    (lambda d: d.update(files=[]), "files: is not an object"),
    (lambda d: d["files"].update({"../x": {}}), "'../x' is not a file of the sample"),
    (lambda d: d["files"].update({"/x": {}}), "is not a file of the sample"),
    (lambda d: d["files"].update({"x": 3}), r"files\['x'\]: is not an object"),
    (lambda d: d["files"].update({"x": {"bytes": 3}}), r"files\['x'\].sha256: is missing"),
    (lambda d: d.update(specification=None), "specification: is not an object"),
]


@pytest.mark.parametrize(("damage", "words"), SAMPLE_DAMAGES)
def test_damaged_samples(dataset: Path, damage: Callable[[dict[str, Any]], None], words: str) -> None:
    folder = sample_folder(dataset, 0)
    edit_json(folder / "sample.json", damage)
    with pytest.raises(InputError, match=words):
        read_sample(folder)
    assert len(check_sample(folder)) == 1


DATASET_DAMAGES: list[tuple[Callable[[dict[str, Any]], object], str]] = [
    (lambda d: d.update(format="frametwin-sample"), "format: is 'frametwin-sample'"),
    (_without("samples"), "samples: is missing"),
    (lambda d: d.update(samples=[1]), r"samples\[0\]: is not an object"),
    (lambda d: d["samples"][0].update(folder="../elsewhere"), r"samples\[0\].folder"),
    (lambda d: d["samples"][0].update(folder="samples/.."), r"samples\[0\].folder"),
    (lambda d: d["samples"][1].update(index=0), "hold index 0 twice"),
    (lambda d: d["failed"][0].update(reason=None), r"failed\[0\].reason: is not a text"),
    (lambda d: d.update(count="3"), "count: is not a whole number"),
]


@pytest.mark.parametrize(("damage", "words"), DATASET_DAMAGES)
def test_damaged_datasets(dataset: Path, damage: Callable[[dict[str, Any]], None], words: str) -> None:
    edit_json(dataset / "dataset.json", damage)
    with pytest.raises(InputError, match=words):
        read_dataset(dataset)


def test_what_is_no_dataset(tmp_path: Path, dataset: Path) -> None:
    with pytest.raises(InputError, match="is no dataset"):
        read_dataset(tmp_path / "nothing")
    text = (dataset / "dataset.json").read_text()
    (dataset / "dataset.json").write_text(text[: len(text) // 2])
    with pytest.raises(InputError, match="cut short"):
        read_dataset(dataset)


def test_a_sample_that_cannot_be_hashed_gets_no_notes(dataset: Path) -> None:
    folder = sample_folder(dataset, 0)
    (folder / "sample.json").unlink()
    next((folder / "images").iterdir()).write_bytes(b"\x89PNG")
    with pytest.raises(InputError, match="damaged"):
        write_sample_json(folder, 0, {}, {})
    assert not (folder / "sample.json").exists()


def test_notes_are_plain_json(made: Path) -> None:
    data = json.loads((sample_folder(made, 1) / "sample.json").read_text())
    assert data["format"] == "frametwin-sample" and data["version"] == 1
    assert set(data["files"]["frame.json"]) == {"bytes", "sha256", "content"}
