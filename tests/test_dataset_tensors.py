"""Data to learn from: tensors are what the files hold, batches are whole, a network learns from them."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from learning_cases import FRAMES, SIZE, give_lens, mixed_dataset, note_sample
from torch.utils.data import DataLoader

import frametwin
from frametwin import CaptureDataset, collate_captures, split_indices
from frametwin.capture.capture import read_capture
from frametwin.dataset.camera_errors import TRUE_FILE, stated_cameras, true_cameras_file
from frametwin.dataset.folder import sample_folder
from frametwin.dataset.sample_arrays import sample_arrays
from frametwin.dataset.specification_values import ErrorValues
from frametwin.dataset.strut_map import strut_map
from frametwin.dataset.tensor_kinds import COUNTED, KINDS, PARTS
from frametwin.dataset.true_curves import intervals_of
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.raster.silhouette import silhouettes

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Masks with passes."""
    return mixed_dataset(tmp_path_factory.mktemp("datasets") / "masks", passes=True)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Photographs with backgrounds, without passes."""
    return mixed_dataset(tmp_path_factory.mktemp("datasets") / "photos", 2, photos=True)


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return shutil.copytree(folder, tmp_path / "copy")


def unfilled(batch: dict[str, torch.Tensor], b: int) -> Iterator[tuple[str, torch.Tensor, torch.Tensor]]:
    """Each array of one sample of a batch without what was filled up, and all that was filled up."""
    for name, tensor in batch.items():
        if name not in KINDS:
            continue
        there = torch.ones(tensor[b].shape, dtype=torch.bool)
        shape = list(tensor[b].shape)
        for k, axis in enumerate(KINDS[name].shape):
            if axis in COUNTED:
                mark = batch[COUNTED[str(axis)]][b]
                there &= mark.reshape([-1 if i == k else 1 for i in range(len(shape))])
                shape[k] = int(mark.sum())
        yield name, tensor[b][there].reshape(shape), tensor[b][~there]


# --- what the tensors are


@pytest.mark.parametrize("which", ["folder", "photos"])
def test_shapes_and_types_are_those_of_the_table(which: str, request: pytest.FixtureRequest) -> None:
    dataset = CaptureDataset(request.getfixturevalue(which))
    absent = ("true_cameras", "backgrounds" if which == "folder" else "passes")
    assert dataset.parts == tuple(part for part in PARTS if part not in absent)
    for place in (0, 1):
        item = dataset[place]
        frame = FRAMES[place]
        sizes = {"N": 3, "C": 1 if which == "folder" else 3, "H": SIZE[0], "W": SIZE[1], "S": 33}
        sizes |= {"E": frame.strut_count, "V": frame.vertex_count}
        assert set(item) == {"index", *(kind.name for kind in KINDS.values() if kind.part not in absent)}
        assert int(item.pop("index")) == place
        for name, tensor in item.items():
            assert tuple(tensor.shape) == tuple(sizes.get(str(axis), axis) for axis in KINDS[name].shape), name
            assert tensor.dtype == getattr(torch, KINDS[name].dtype), name


def test_true_cameras_are_those_that_took_the_pictures(copy: Path) -> None:
    sample = sample_folder(copy, 0)
    stated = [view.camera for view in read_capture(sample).views]
    amounts = {"turned_deg": 0.4, "moved_mm": 2.0, "focal": 0.01, "centre_px": 1.5, "bumped_deg": 0.0}
    values = ErrorValues(**amounts, lens_ignored=False, bumped=(), seed=5)
    true = list(stated_cameras(stated, values))  # others than the stated ones, which is all that counts here
    (sample / TRUE_FILE).write_text(json.dumps(true_cameras_file(true)))
    item = CaptureDataset(copy)[0]  # with all parts that the first sample has
    for n, camera in enumerate(true):
        np.testing.assert_allclose(item["true_K"][n], camera.K, rtol=1e-6)
        np.testing.assert_allclose(item["true_camera_to_world"][n], camera.camera_to_world, rtol=1e-5, atol=1e-5)
        inverse = item["true_camera_to_world"][n] @ item["true_world_to_camera"][n]
        np.testing.assert_allclose(inverse, np.eye(4), atol=1e-3)
        np.testing.assert_allclose(item["K"][n], stated[n].K, rtol=1e-6)
        assert np.abs(item["camera_to_world"][n] - item["true_camera_to_world"][n]).max() > 1.0
    other = CaptureDataset(copy)[1]  # a sample without errors: its cameras are the true ones
    for name in ("K", "distortion", "fisheye", "camera_to_world", "world_to_camera"):
        assert torch.equal(other[name], other[f"true_{name}"])


def test_tensors_are_what_opencv_and_numpy_read_from_the_files(folder: Path) -> None:
    item = CaptureDataset(folder)[1]
    sample = sample_folder(folder, 1)
    transforms = json.loads((sample / "transforms.json").read_text())
    for n, frame in enumerate(transforms["frames"]):
        picture = cv2.imread(str(sample / frame["file_path"]), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(item["images"][n, 0], picture)
        np.testing.assert_array_equal(item["masks"][n], picture / np.float32(255.0))
        pose = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1.0, -1.0, 1.0])
        np.testing.assert_allclose(item["camera_to_world"][n], pose, atol=1e-4)
        K = [[frame["fl_x"], 0.0, frame["cx"]], [0.0, frame["fl_y"], frame["cy"]], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(item["K"][n], K, rtol=1e-6)
    with np.load(sample / "curves.npz") as curves:
        for name, key in (("points", "points"), ("pixels", "pixels"), ("pixel_depth", "depth"), ("visible", "visible")):
            np.testing.assert_array_equal(item[name], curves[key])
    truth = json.loads((sample / "truth.json").read_text())
    np.testing.assert_allclose(item["truth_control_points"], truth["control_points"], rtol=1e-6)
    plan = json.loads((sample / "frame.json").read_text())
    np.testing.assert_array_equal(item["edges"], plan["edges"])


def test_colours_of_photographs_are_red_green_blue(photos: Path) -> None:
    item = CaptureDataset(photos, parts=["images", "backgrounds"])[0]
    path = sorted((sample_folder(photos, 0) / "images").iterdir())[0]
    picture = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
    np.testing.assert_array_equal(item["images"][0].permute(1, 2, 0), picture)
    red, _, blue = item["backgrounds"].float().mean(dim=(0, 2, 3))
    assert blue > red + 50.0  # the table is blue


def test_projected_curves_land_on_the_print(folder: Path) -> None:
    for item in CaptureDataset(folder, parts=["masks", "cameras", "curves", "visibility"]):
        ones = torch.ones(*item["points"].shape[:2], 1)
        world = torch.cat([item["points"], ones], dim=-1)  # (E, S, 4)
        local = torch.einsum("nij,esj->nesi", item["world_to_camera"], world)[..., :3]
        seen = torch.einsum("nij,nesj->nesi", item["K"], local)
        pixels = seen[..., :2] / seen[..., 2:]
        visible = item["visible"]
        assert (pixels - item["pixels"])[visible].abs().max() < 0.01
        column, row = pixels.floor().long().unbind(-1)
        view = torch.arange(len(visible))[:, None, None].expand_as(visible)
        assert item["masks"][view[visible], row[visible], column[visible]].mean() > 0.99
        beside = (row + 6).clamp(max=SIZE[0] - 1)  # somewhere else is no print, or this would tell nothing
        assert item["masks"][view[visible], beside[visible], column[visible]].mean() < 0.8
        gone = ~item["point_present"].any(dim=1)
        assert not item["visible"][:, gone].any()


def test_curves_and_samples_are_the_same_curves(folder: Path) -> None:
    item = CaptureDataset(folder, parts=["curves"])[1]
    u = np.linspace(0.0, 1.0, 33)
    curves = bezier.evaluate(item["truth_control_points"].numpy().astype(np.float64), u)
    np.testing.assert_allclose(item["points"], curves, atol=1e-4)
    low, high = item["present"].numpy().T[..., None]
    np.testing.assert_array_equal(item["point_present"], (u >= low) & (u <= high) & (high > low))


def test_passes_say_which_strut_is_where(folder: Path) -> None:
    item = CaptureDataset(folder, parts=["masks", "visibility", "passes"])[0]
    seen = item["strut"] >= 0
    assert torch.equal(seen, item["masks"] > 0.5) and torch.equal(torch.isfinite(item["depth"]), seen)
    assert (item["normal"].norm(dim=1)[seen] - 1.0).abs().max() < 1e-5
    n, e, s = torch.nonzero(item["visible"]).unbind(1)
    column, row = item["pixels"][n, e, s].floor().long().unbind(-1)
    assert (item["strut"][n, row, column] == e).float().mean() > 0.9  # the rest lies in joints


def test_masks_of_photographs_are_the_exact_silhouettes(photos: Path) -> None:
    for index in (0, 1):
        capture = read_capture(sample_folder(photos, index))
        assert capture.truth is not None
        masks = CaptureDataset(photos, parts=["masks"])[index]["masks"].numpy()
        cameras = [view.camera for view in capture.views]
        present = intervals_of(capture.root, capture.frame.printed)
        exact = np.stack(silhouettes(capture.truth, cameras, present=present, supersampling=8)) / 255.0
        assert np.abs(masks - exact).mean() < 0.01
        assert abs(masks.sum() / exact.sum() - 1.0) < 0.01
        assert (np.abs(masks - exact) > 0.5).mean() < 1e-3


def test_masks_through_a_lens_without_passes_follow_the_curves(photos: Path, tmp_path: Path) -> None:
    copied = shutil.copytree(photos, tmp_path / "copy")
    give_lens(sample_folder(copied, 0), (-0.8, 0.0, 0.0, 0.0, 0.0))
    note_sample(sample_folder(copied, 0), 0, FRAMES[0])
    bent, straight = (CaptureDataset(path, parts=["masks", "visibility"])[0] for path in (copied, photos))
    moved = (bent["pixels"] - straight["pixels"]).norm(dim=-1) > 3.0
    n, e, s = torch.nonzero(bent["visible"] & moved).unbind(1)
    column, row = bent["pixels"][n, e, s].floor().long().unbind(-1)
    assert len(n) > 20 and bent["masks"][n, row, column].mean() > 0.99
    assert straight["masks"][n, row, column].mean() < 0.95


def test_painted_strut_maps_are_those_of_the_exact_silhouettes(folder: Path) -> None:
    for index in (0, 1):
        capture = read_capture(sample_folder(folder, index))
        arrays = sample_arrays(capture, ["curves", "passes"])
        for view, exact in zip(capture.views, arrays["strut"], strict=True):
            drawn = strut_map(arrays["points"], arrays["point_radius"], arrays["point_present"], view.camera)
            either, both = (drawn >= 0) | (exact >= 0), (drawn >= 0) & (exact >= 0)
            assert both.sum() / either.sum() > 0.9
            assert (drawn == exact)[both].mean() > 0.9  # the rest lies in joints


def test_the_documentation_lists_every_tensor() -> None:
    page = (ROOT / "docs" / "datasets.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line[:3] == "| `"]
    found = {row[0].strip("`"): row[1:] for row in rows if len(row) == 6}
    for name, kind in KINDS.items():
        shape = ", ".join(str(axis) for axis in kind.shape)
        assert found.pop(name) == [kind.part, shape, kind.dtype, kind.unit, kind.what]
    assert not found


# --- batches


@pytest.mark.parametrize("start", ["fork", "spawn"] if sys.platform == "linux" else ["spawn"])
def test_workers_hand_over_batches_of_unequal_samples(folder: Path, start: str) -> None:
    parts = ["masks", "cameras", "curves", "visibility"]
    dataset = CaptureDataset(folder, parts=parts)
    loader = DataLoader(
        dataset, batch_size=2, num_workers=2, collate_fn=collate_captures, multiprocessing_context=start
    )
    batches = list(loader)
    assert [batch["index"].tolist() for batch in batches] == [[0, 1], [2, 3]]
    for batch in batches:
        assert batch["is_strut"].sum(dim=1).tolist() == [frame.strut_count for frame in FRAMES]
        assert batch["is_joint"].sum(dim=1).tolist() == [frame.vertex_count for frame in FRAMES]
        for b in (0, 1):
            item = dataset[int(batch["index"][b])]
            for name, found, rest in unfilled(batch, b):
                assert torch.equal(found.nan_to_num(), item[name].nan_to_num()), name
                assert not rest.any(), name


def test_samples_with_other_numbers_of_views_make_a_batch(folder: Path, tmp_path: Path) -> None:
    more = mixed_dataset(tmp_path / "more", 1, views=5)
    parts = ["images", "cameras", "curves"]
    batch = collate_captures([CaptureDataset(path, parts=parts)[0] for path in (folder, more)])
    assert batch["is_view"].sum(dim=1).tolist() == [3, 5] and batch["images"].shape[:2] == (2, 5)
    assert not batch["images"][0, 3:].any() and batch["images"][1, 3:].any()


def test_a_batch_of_pictures_of_two_sizes_is_refused(folder: Path) -> None:
    item = CaptureDataset(folder, parts=["images"])[0]
    small = {**item, "images": item["images"][..., ::2]}
    with pytest.raises(InputError, match="images: differs in shape"):
        collate_captures([item, small])
    with pytest.raises(InputError, match="index: is not in all samples"):
        collate_captures([item, {"images": item["images"]}])


def test_a_damaged_file_is_named_through_a_worker(copy: Path) -> None:
    (sample_folder(copy, 1) / "curves.npz").write_bytes(b"no archive")
    loader = DataLoader(CaptureDataset(copy), batch_size=None, num_workers=1)
    with pytest.raises(InputError, match=r"000001.*curves\.npz: file: is cut short"):
        list(loader)


def test_what_is_not_there_is_named(folder: Path, photos: Path, tmp_path: Path) -> None:
    for arguments, words in (
        ({"indices": [7]}, "sample 7 is not there"),
        ({"indices": []}, "there is none"),
        ({"parts": ["colour"]}, "'colour' is unknown"),
        ({"parts": "images"}, "are no list of names"),
    ):
        with pytest.raises(InputError, match=words):
            CaptureDataset(folder, **arguments)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="background: folder: does not exist"):
        CaptureDataset(folder, parts=["backgrounds"])[0]
    with pytest.raises(InputError, match=r"passes.*the file does not exist"):
        CaptureDataset(photos, parts=["passes"])[0]
    with pytest.raises(InputError, match="is no dataset"):
        CaptureDataset(tmp_path)


def test_a_transform_takes_the_place_of_the_tensors(folder: Path) -> None:
    dataset = CaptureDataset(folder, parts=["masks"], transform=lambda item: item["masks"].mean())
    loader = DataLoader(dataset, batch_size=4)
    assert next(iter(loader)).shape == (4,)


# --- parts for training and for testing


def test_a_print_is_never_on_both_sides(folder: Path) -> None:
    parts = split_indices(folder, {"train": 0.5, "test": 0.5})
    assert sorted(parts["train"] + parts["test"]) == [0, 1, 2, 3]
    assert {index // 2 for index in parts["train"]}.isdisjoint(index // 2 for index in parts["test"])
    assert split_indices(folder, {"train": 0.5, "test": 0.5}) == parts
    choices = {tuple(split_indices(folder, {"a": 0.5, "b": 0.5}, seed)["a"]) for seed in range(8)}
    assert choices == {(0, 1), (2, 3)}
    assert [int(item["index"]) for item in CaptureDataset(folder, indices=parts["test"])] == parts["test"]


@pytest.mark.parametrize("shares", [{}, {"a": 0.5}, {"a": 1.2, "b": -0.2}, {"a": float("nan"), "b": 1.0}])
def test_shares_have_to_make_a_whole(folder: Path, shares: dict[str, float]) -> None:
    with pytest.raises(InputError, match="are no shares of a whole"):
        split_indices(folder, shares)


def test_every_part_has_a_print(folder: Path) -> None:
    parts = split_indices(folder, {"train": 0.99, "test": 0.01})
    assert len(parts["train"]) == len(parts["test"]) == 2
    with pytest.raises(InputError, match="ask for 3 parts of 2 prints"):
        split_indices(folder, {"train": 0.8, "validation": 0.1, "test": 0.1})


# --- learning


def test_a_small_network_learns_to_tell_the_print_from_the_background(photos: Path) -> None:
    generator = torch.Generator().manual_seed(3)
    dataset = CaptureDataset(photos, parts=["images", "masks"])
    loader = DataLoader(
        dataset, batch_size=2, shuffle=True, num_workers=2, collate_fn=collate_captures, generator=generator
    )
    network = torch.nn.Conv2d(3, 1, 3, padding=1)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.normal_(0.0, 0.1, generator=generator)
    optimiser = torch.optim.Adam(network.parameters(), lr=0.1)
    losses = []
    for _ in range(12):
        for batch in loader:
            images = batch["images"][batch["is_view"]].float() / 255.0
            masks = batch["masks"][batch["is_view"]]
            guess = network(images)[:, 0]
            loss = torch.nn.functional.binary_cross_entropy_with_logits(guess, masks)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            losses.append(loss.item())
    assert losses[-1] < 0.5 * losses[0]
    assert guess[masks == 1.0].mean() > guess[masks == 0.0].mean() + 1.0


def test_the_package_can_be_imported_without_torch() -> None:
    code = (
        "import sys\nsys.modules['torch'] = None\n"
        "import frametwin.dataset, frametwin.dataset.export\n"
        "from frametwin.dataset import split_indices\n"
        "try:\n    frametwin.dataset.CaptureDataset\nexcept ImportError as error:\n    print('torch' in str(error))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
    assert frametwin.CaptureDataset is CaptureDataset
