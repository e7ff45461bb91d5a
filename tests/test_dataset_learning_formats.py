"""Exports for learning, read by the libraries that they are for: webdataset, datasets, pycocotools, pycolmap."""

from __future__ import annotations

import json
import os
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from dataset_cases import run_command
from learning_cases import FRAMES, SIZE, give_lens, mixed_dataset, note_sample

os.environ["HF_HUB_OFFLINE"] = os.environ["HF_DATASETS_OFFLINE"] = "1"  # before the library is imported

import pycolmap
import webdataset
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

import datasets
from frametwin import CaptureDataset, InputError
from frametwin.capture.capture import read_capture
from frametwin.cli.dataset_export import export_command
from frametwin.dataset.export import ExportSettings, export_dataset
from frametwin.dataset.exports import learning_samples
from frametwin.dataset.exports.coco_files import run_lengths
from frametwin.dataset.exports.ledger import WRITING
from frametwin.dataset.exports.settings import LEARNING_FORMATS
from frametwin.dataset.folder import SampleEntry, read_dataset, sample_folder
from frametwin.dataset.tensor_kinds import KINDS, POSES
from frametwin.errors import Cancelled

Made = tuple[Path, Path, Path]


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Masks with passes."""
    return mixed_dataset(tmp_path_factory.mktemp("datasets") / "masks", passes=True)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Photographs with backgrounds, without passes; the first sample was seen through a lens."""
    folder = mixed_dataset(tmp_path_factory.mktemp("datasets") / "photos", 2, photos=True)
    give_lens(sample_folder(folder, 0), (-0.1, 0.02, 0.001, -0.002, 0.003))
    note_sample(sample_folder(folder, 0), 0, FRAMES[0])
    return folder


@pytest.fixture(params=["masks", "photos"])
def dataset(request: pytest.FixtureRequest) -> Path:
    folder: Path = request.getfixturevalue(request.param)
    return folder


def arrays_agree(found: dict[str, Any], item: dict[str, torch.Tensor], names: list[str], scale: float = 1.0) -> None:
    """Arrays are those of the tensors; lengths are so many times as long."""
    for name in names:
        wanted = item[name].numpy()
        if scale != 1.0 and KINDS[name].unit == "mm":
            wanted = wanted.copy()
            wanted[(..., slice(3), 3) if name in POSES else ...] *= scale
        np.testing.assert_allclose(np.asarray(found[name]), wanted, rtol=1e-6, atol=1e-7, err_msg=name)


def array_names(item: dict[str, torch.Tensor]) -> list[str]:
    return [name for name in item if name in KINDS and KINDS[name].part in ("cameras", "curves", "visibility")]


# --- WebDataset


@pytest.mark.parametrize(("unit", "scale"), [(None, 1.0), ("m", 1e-3)])
def test_webdataset_reads_the_shards(dataset: Path, tmp_path: Path, unit: str | None, scale: float) -> None:
    export_dataset(dataset, tmp_path / "out", ExportSettings("webdataset", unit))
    shards = sorted(str(path) for path in (tmp_path / "out").glob("train-*.tar"))
    assert len(shards) == 1
    entries, tensors = read_dataset(dataset).samples, CaptureDataset(dataset)
    samples = list(webdataset.WebDataset(shards, shardshuffle=False).decode("rgb8"))
    assert [sample["__key__"] for sample in samples] == [f"{i:06d}" for i in range(len(entries))]
    for sample, entry, item in zip(samples, entries, tensors, strict=True):
        facts = sample["json"]
        assert (facts["index"], facts["content"], facts["unit"]) == (entry.index, entry.content, unit or "mm")
        arrays_agree(sample["arrays.npz"], item, array_names(item), scale)
        for n in range(3):
            picture = sample[f"image_{n:02d}.png"].transpose(2, 0, 1)
            np.testing.assert_array_equal(picture, item["images"][n].expand(3, -1, -1))
            share = sample[f"mask_{n:02d}.png"][..., 0] / 255.0
            np.testing.assert_allclose(share, item["masks"][n], atol=0.5 / 255.0 + 1e-6)
            assert (f"background_{n:02d}.png" in sample) == ("backgrounds" in item)
        assert ("passes.npz" in sample) == ("strut" in item)
        if "strut" in item:
            arrays_agree(sample["passes.npz"], item, ["depth", "normal", "strut"], scale)


def test_shards_are_cut_by_size_and_feed_a_loader_with_workers(masks: Path, tmp_path: Path) -> None:
    export_dataset(masks, tmp_path / "out", ExportSettings("webdataset", shard_mb=0.01))
    shards = sorted(str(path) for path in (tmp_path / "out").glob("*.tar"))
    assert [Path(shard).name for shard in shards] == [f"train-{k:06d}.tar" for k in range(4)]
    stream = webdataset.WebDataset(shards, shardshuffle=False).decode("l8").map(lambda sample: sample["json"]["index"])
    loader = webdataset.WebLoader(stream, batch_size=None, num_workers=2)
    assert sorted(loader) == [0, 1, 2, 3]


def test_the_same_dataset_gives_the_same_shards(masks: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        export_dataset(masks, tmp_path / name, ExportSettings("webdataset"))
    one, other = ((tmp_path / name / "train-000000.tar").read_bytes() for name in ("a", "b"))
    assert one == other
    with tarfile.open(tmp_path / "a" / "train-000000.tar") as tar:
        assert {member.mtime for member in tar} == {0}


# --- Hugging Face


@pytest.fixture
def load(tmp_path: Path) -> Any:
    """Loads by the library into a cache of the test's own."""
    datasets.disable_progress_bars()
    return lambda *arguments, **named: datasets.load_dataset(*arguments, cache_dir=str(tmp_path / "cache"), **named)


def test_hugging_face_reads_a_folder_with_its_card(dataset: Path, tmp_path: Path, load: Any) -> None:
    export_dataset(dataset, tmp_path / "out", ExportSettings("huggingface"))
    rows = load(str(tmp_path / "out"), split="train")
    entries, tensors = read_dataset(dataset).samples, CaptureDataset(dataset)
    assert rows["index"][:] == [entry.index for entry in entries]
    assert rows["content"][:] == [entry.content for entry in entries]
    for name in ("images", "masks"):
        assert isinstance(rows.features[name].feature, datasets.Image)
    for row, item in zip(rows, tensors, strict=True):
        for n in range(3):
            picture = np.asarray(row["images"][n]).reshape(*SIZE, -1).transpose(2, 0, 1)
            np.testing.assert_array_equal(picture, item["images"][n])
            np.testing.assert_allclose(np.asarray(row["masks"][n]) / 255.0, item["masks"][n], atol=0.5 / 255.0 + 1e-6)
            if "backgrounds" in item:
                before = np.asarray(row["backgrounds"][n]).transpose(2, 0, 1)
                np.testing.assert_array_equal(before, item["backgrounds"][n])
            if "strut" in item:
                np.testing.assert_array_equal(np.asarray(row["strut"][n]).astype(int) - 1, item["strut"][n])
                np.testing.assert_array_equal(np.asarray(row["depth"][n]), item["depth"][n])
        arrays_agree(row, item, array_names(item))


def test_columns_become_arrays_of_the_shapes_in_the_card(masks: Path, tmp_path: Path, load: Any) -> None:
    export_dataset(masks, tmp_path / "out", ExportSettings("huggingface", "m"))
    (file,) = (tmp_path / "out" / "data").iterdir()
    rows = load("parquet", data_files=str(file), split="train").with_format("torch")
    item = CaptureDataset(masks)[1]
    row = rows[1]
    assert tuple(row["truth_control_points"].shape) == (FRAMES[1].strut_count, 4, 3)
    np.testing.assert_allclose(row["truth_control_points"], 1e-3 * item["truth_control_points"], rtol=1e-6)
    np.testing.assert_allclose(row["depth"][0].squeeze(), 1e-3 * item["depth"][0], rtol=1e-6)
    card = (tmp_path / "out" / "README.md").read_text()
    assert "| `truth_control_points` | (E, 4, 3) | float32 | m |" in card
    assert all(f"| `{name}` |" in card for name in rows.column_names)


def test_parts_are_those_that_split_indices_gives(masks: Path, tmp_path: Path, load: Any) -> None:
    from frametwin import split_indices

    wanted = split_indices(masks, {"train": 0.5, "test": 0.5}, 3)
    settings = {"split": (0.5, 0.5), "split_seed": 3, "shard_mb": 0.01}
    export_dataset(masks, tmp_path / "hf", ExportSettings("huggingface", **settings))  # type: ignore[arg-type]
    parts = load(str(tmp_path / "hf"))
    assert {name: rows["index"][:] for name, rows in parts.items()} == wanted
    files = sorted(path.name for path in (tmp_path / "hf" / "data").iterdir())
    assert files == [f"{part}-{k:05d}-of-00002.parquet" for part in ("test", "train") for k in range(2)]
    export_dataset(masks, tmp_path / "coco", ExportSettings("coco", split=(0.5, 0.5), split_seed=3))
    for part, indices in wanted.items():
        images = json.loads((tmp_path / "coco" / "annotations" / f"{part}.json").read_text())["images"]
        assert sorted({image["sample"] for image in images}) == indices
    export_dataset(masks, tmp_path / "wds", ExportSettings("webdataset", split=(0.5, 0.5), split_seed=3))
    for part, indices in wanted.items():
        samples = webdataset.WebDataset(str(tmp_path / "wds" / f"{part}-000000.tar"), shardshuffle=False).decode()
        assert [sample["json"]["index"] for sample in samples] == indices


# --- COCO


@pytest.fixture(scope="module", params=["masks", "photos"])
def coco(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[COCO, Path, Path]:
    """As the library has read it, the export, and the dataset."""
    folder: Path = request.getfixturevalue(request.param)
    out = tmp_path_factory.mktemp("exports") / "coco"
    export_dataset(folder, out, ExportSettings("coco"))
    return COCO(str(out / "annotations" / "train.json")), out, folder


def views_of(coco: tuple[COCO, Path, Path]) -> Iterator[tuple[dict[str, Any], dict[str, torch.Tensor], int]]:
    """Every picture of an export, with the tensors of its sample and its number among the views."""
    read, _, folder = coco
    tensors = CaptureDataset(folder)
    for image in read.loadImgs(read.getImgIds()):
        names = [view.camera.name for view in read_capture(sample_folder(folder, image["sample"])).views]
        yield image, tensors[image["sample"]], names.index(image["view"])


def test_pycocotools_reads_pictures_and_cameras(coco: tuple[COCO, Path, Path]) -> None:
    _, out, _ = coco
    count = 0
    for image, item, n in views_of(coco):
        picture = cv2.imread(str(out / "images" / image["file_name"]), cv2.IMREAD_UNCHANGED)
        assert picture.shape[:2] == (image["height"], image["width"]) == SIZE
        np.testing.assert_allclose(image["K"], item["K"][n], rtol=1e-6)
        np.testing.assert_allclose(image["camera_to_world"], item["camera_to_world"][n], rtol=1e-5)
        count += 1
    assert count == 3 * len(CaptureDataset(coco[2]))


def test_masks_of_struts_are_those_of_the_passes_and_make_up_the_print(coco: tuple[COCO, Path, Path]) -> None:
    read, _, _ = coco
    for image, item, n in views_of(coco):
        (whole,) = read.loadAnns(read.getAnnIds([image["id"]], catIds=read.getCatIds(["print"])))
        covered = item["masks"][n].numpy() >= 0.5
        np.testing.assert_array_equal(read.annToMask(whole), covered)
        struts = read.loadAnns(read.getAnnIds([image["id"]], catIds=read.getCatIds(["strut"])))
        total = np.zeros(SIZE, dtype=int)
        for strut in struts:
            mask = read.annToMask(strut)
            total += mask
            assert strut["area"] == mask.sum() > 0
            rows, columns = np.nonzero(mask)
            box = [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
            np.testing.assert_allclose(strut["bbox"], box)
            if "strut" in item:
                np.testing.assert_array_equal(mask, item["strut"][n] == strut["strut"])
        assert total.max() == 1 and not total[~covered].any()  # no pixel twice, and none beside the print
        assert total[covered].mean() > 0.97
        if "strut" in item:
            assert {strut["strut"] for strut in struts} == set(np.unique(item["strut"][n])) - {-1}


def test_keypoints_lie_on_their_struts(coco: tuple[COCO, Path, Path]) -> None:
    read, _, _ = coco
    (category,) = read.loadCats(read.getCatIds(["strut"]))
    assert len(category["keypoints"]) == 9 and category["skeleton"] == [[k, k + 1] for k in range(1, 9)]
    hits = []
    for image, item, n in views_of(coco):
        for strut in read.loadAnns(read.getAnnIds([image["id"]], catIds=[category["id"]])):
            e, points = strut["strut"], np.array(strut["keypoints"]).reshape(9, 3)
            visible, there = item["visible"][n, e, ::4].numpy(), item["point_present"][e, ::4].numpy()
            np.testing.assert_array_equal(points[:, 2] == 2, visible)
            np.testing.assert_array_equal(points[:, 2] == 0, ~there)  # everything is inside of these pictures
            assert (points[~there] == 0.0).all() and strut["num_keypoints"] == there.sum()
            np.testing.assert_allclose(points[there, :2] + 0.5, item["pixels"][n, e, ::4][there], atol=0.006)
            mask = read.annToMask(strut)
            inner = points[2:-2][visible[2:-2], :2]  # joints belong to one strut each
            column, row = np.rint(inner).astype(int).T  # pixel centres lie at whole numbers
            hits += mask[row, column].tolist()
    assert len(hits) > 100 and np.mean(hits) > 0.97


def test_the_evaluation_of_coco_runs_and_finds_the_truth_perfect(coco: tuple[COCO, Path, Path]) -> None:
    read, _, _ = coco
    annotations = read.loadAnns(read.getAnnIds(catIds=[1]))
    for kind, key in (("segm", "segmentation"), ("keypoints", "keypoints")):
        found = [{name: a[name] for name in ("image_id", "category_id", key)} | {"score": 0.9} for a in annotations]
        evaluation = COCOeval(read, read.loadRes(found), kind)
        evaluation.params.catIds = [1]
        evaluation.params.kpt_oks_sigmas = np.full(9, 0.05)
        if kind == "keypoints":
            evaluation.params.maxDets = [100]
        evaluation.evaluate()
        evaluation.accumulate()
        precision = evaluation.eval["precision"][:, :, 0, 0, -1]
        assert precision[precision > -1].mean() > 0.99, kind


def test_run_lengths_are_what_pycocotools_makes_of_each_mask() -> None:
    labels = np.random.default_rng(0).integers(-1, 4, (13, 17)).astype(np.int32)
    labels[:, :3] = 2
    runs = run_lengths(labels)
    assert set(runs) == {0, 1, 2, 3}
    for value, counts in runs.items():
        wanted = coco_mask.encode(np.asfortranarray(labels == value).astype(np.uint8))
        found = coco_mask.frPyObjects({"size": [13, 17], "counts": counts}, 13, 17)
        np.testing.assert_array_equal(coco_mask.decode(found), coco_mask.decode(wanted))
    assert run_lengths(np.full((3, 4), -1)) == {}


def test_coco_links_pictures_where_asked(masks: Path, tmp_path: Path) -> None:
    image = next((sample_folder(masks, 0) / "images").iterdir())
    for link in (True, False):
        export_dataset(masks, tmp_path / str(link), ExportSettings("coco", link=link))
        assert os.path.samefile(tmp_path / str(link) / "images" / "000000" / image.name, image) == link


# --- COLMAP


@pytest.mark.parametrize(("unit", "scale"), [(None, 1.0), ("m", 1e-3)])
def test_pycolmap_reads_the_text_model(photos: Path, tmp_path: Path, unit: str | None, scale: float) -> None:
    export_dataset(photos, tmp_path / "out", ExportSettings("colmap", unit))
    for index in (0, 1):
        capture = read_capture(sample_folder(photos, index))
        model = pycolmap.Reconstruction(tmp_path / "out" / f"{index:06d}" / "sparse" / "0")
        assert model.num_points3D() == 24 * capture.frame.strut_count
        images = {image.name: image for image in model.images.values()}
        assert sorted(images) == sorted(view.image.path.name for view in capture.views)
        assert capture.truth is not None
        points = capture.truth.vertices
        for view in capture.views:
            image = images[view.image.path.name]
            camera = model.cameras[image.camera_id]
            assert camera.model.name == ("FULL_OPENCV" if index == 0 else "PINHOLE")
            seen = camera.img_from_cam(image.cam_from_world() * (scale * points))
            pixels, _ = view.camera.project(points)
            np.testing.assert_allclose(seen, pixels, atol=1e-6)


# --- nerfstudio


def test_nerfstudio_sends_its_rays_through_the_print(photos: Path, tmp_path: Path) -> None:
    """Where nerfstudio is installed; it needs other versions of much else, so it is not among what tests install."""
    parser = pytest.importorskip("nerfstudio.data.dataparsers.nerfstudio_dataparser")
    export_dataset(photos, tmp_path / "out", ExportSettings("nerfstudio"))
    for index in (0, 1):
        capture = read_capture(sample_folder(photos, index))
        assert capture.truth is not None
        config = parser.NerfstudioDataParserConfig(
            data=tmp_path / "out" / f"{index:06d}",
            orientation_method="none",
            center_method="none",
            auto_scale_poses=False,
            eval_mode="all",
            downscale_factor=1,
            load_3D_points=False,
        )
        outputs = config.setup().get_dataparser_outputs("train")
        names = [path.name for path in outputs.image_filenames]
        assert sorted(names) == sorted(view.image.path.name for view in capture.views)
        for n, name in enumerate(names):
            (camera,) = (view.camera for view in capture.views if view.image.path.name == name)
            pixels, _ = camera.project(capture.truth.vertices)
            places = torch.tensor(pixels[:, ::-1].copy(), dtype=torch.float32)  # rows first
            rays = outputs.cameras.generate_rays(torch.full((len(places), 1), n), coords=places)
            ways = 1e-3 * capture.truth.vertices - rays.origins.numpy()
            ways /= np.linalg.norm(ways, axis=1, keepdims=True)
            np.testing.assert_allclose(rays.directions.numpy(), ways, atol=1e-5)


# --- all of them


@pytest.mark.parametrize("kind", LEARNING_FORMATS)
def test_an_export_is_whole_or_not_at_all(masks: Path, tmp_path: Path, kind: str) -> None:
    with pytest.raises(Cancelled):
        export_dataset(masks, tmp_path / "out", ExportSettings(kind), progress=lambda step: step.iteration < 2)
    assert not list(tmp_path.iterdir())
    steps: list[tuple[int, int]] = []
    export_dataset(
        masks, tmp_path / "out", ExportSettings(kind), progress=lambda step: steps.append((step.iteration, step.total))
    )
    assert steps == sorted(steps) and set(steps) == {(k, 4) for k in range(5)}
    notes = json.loads((tmp_path / "out" / "export.json").read_text())
    assert notes["kind"] == kind and notes["parts"] == {"train": 4} and len(notes["samples"]) == 4


def files_in(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("kind", ["webdataset", "huggingface"])
@pytest.mark.parametrize("stop", [1, 2, 3])
def test_an_export_goes_on_where_it_was_stopped(
    masks: Path, tmp_path: Path, kind: str, stop: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = ExportSettings(kind, split=(0.5, 0.5), shard_mb=0.01)  # a file for each sample
    export_dataset(masks, tmp_path / "whole", settings)
    out, read = tmp_path / "out", []
    with pytest.raises(Cancelled):
        export_dataset(masks, out, settings, progress=lambda step: step.iteration < stop)
    assert not out.exists() and (out.with_name("out.part").is_dir() == (stop > 1))
    original = learning_samples._learning_sample

    def noting(entry: SampleEntry, *rest: Any) -> Any:
        read.append(entry.index)
        return original(entry, *rest)

    monkeypatch.setattr(learning_samples, "_learning_sample", noting)
    steps: list[int] = []
    export_dataset(masks, out, settings, progress=lambda step: steps.append(step.iteration))
    assert len(read) == 4 - (stop - 1) and steps == [0, 1, 2, 3, 4]
    assert files_in(out) == files_in(tmp_path / "whole")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "whole"]


def test_shards_of_another_export_are_not_mixed_in(masks: Path, tmp_path: Path) -> None:
    out, small = tmp_path / "out", ExportSettings("webdataset", shard_mb=0.01)
    with pytest.raises(Cancelled):
        export_dataset(masks, out, small, progress=lambda step: step.iteration < 3)
    kept = files_in(tmp_path / "out.part")
    with pytest.raises(InputError, match="shards: has shards of another export.*allow overwriting"):
        export_dataset(masks, out, ExportSettings("webdataset"))
    assert files_in(tmp_path / "out.part") == kept and not out.exists()
    export_dataset(masks, out, ExportSettings("webdataset"), overwrite=True)
    assert sorted(files_in(out)) == ["export.json", "train-000000.tar"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_folder_of_somebody_elses_is_left_alone(masks: Path, tmp_path: Path) -> None:
    (tmp_path / "out.part").mkdir()
    (tmp_path / "out.part" / "thesis.txt").write_text("mine")
    for overwrite in (False, True):
        with pytest.raises(InputError, match="holds files that are not of an export"):
            export_dataset(masks, tmp_path / "out", ExportSettings("webdataset"), overwrite=overwrite)
    assert files_in(tmp_path) == {"out.part/thesis.txt": b"mine"}


def test_half_a_shard_left_by_a_kill_is_not_used(masks: Path, tmp_path: Path) -> None:
    settings = ExportSettings("webdataset", shard_mb=0.01)
    export_dataset(masks, tmp_path / "whole", settings)
    with pytest.raises(Cancelled):
        export_dataset(masks, tmp_path / "out", settings, progress=lambda step: step.iteration < 3)
    (tmp_path / "out.part" / WRITING).write_bytes(b"half a shard")
    export_dataset(masks, tmp_path / "out", settings)
    assert files_in(tmp_path / "out") == files_in(tmp_path / "whole")


@pytest.mark.parametrize(
    ("kind", "module", "package"),
    [("huggingface", "pyarrow.parquet", "pyarrow"), ("coco", "pycocotools.mask", "pycocotools")],
)
def test_a_missing_package_is_named_with_the_command_that_installs_it(
    masks: Path, tmp_path: Path, kind: str, module: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    result = run_command(export_command, masks, "--format", kind, "--out", tmp_path / "out", "--quiet")
    assert result.exit_code == 2 and not list(tmp_path.iterdir())
    assert f"the package {package}" in result.stderr and 'pip install "frametwin[exports]"' in result.stderr


def test_a_sample_without_curves_is_named(masks: Path, tmp_path: Path) -> None:
    folder = mixed_dataset(tmp_path / "made", 1)
    (sample_folder(folder, 0) / "curves.npz").unlink()
    with pytest.raises(InputError, match=r"curves\.npz.*make the sample again"):
        export_dataset(folder, tmp_path / "out", ExportSettings("coco"))


def test_the_command_takes_shares_and_refuses_what_is_none(masks: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ["--format", "webdataset", "--out", out, "--quiet", "--split", "0.5,0.5"]
    assert run_command(export_command, masks, *options).exit_code == 0
    assert sorted(path.name for path in out.iterdir()) == ["export.json", "test-000000.tar", "train-000000.tar"]
    for text, kind, words in (
        ("half", "coco", "no list of shares"),
        ("0.5,0.6", "coco", "no shares of a whole"),
        ("0.2,0.2,0.2,0.4", "coco", "give 2 or 3"),
        ("0.5,0.5", "npz", "is not for the format npz"),
        ("0.8,0.1,0.1", "coco", "ask for 3 parts of 2 prints"),
    ):
        result = run_command(
            export_command, masks, "--format", kind, "--out", tmp_path / "no", "--quiet", "--split", text
        )
        assert result.exit_code == 2 and words in result.stderr, result.stderr
    assert not (tmp_path / "no").exists()
