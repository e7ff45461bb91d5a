"""Making datasets: the same samples whoever makes them, in whatever order, however often they are interrupted."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import psutil
import pytest
from cli_tools import done, refused

from frametwin.capture.capture import read_capture
from frametwin.dataset.folder import read_dataset, read_sample
from frametwin.dataset.generate import GenerateSettings, Report, generate
from frametwin.dataset.run import DatasetRun
from frametwin.errors import Cancelled, InputError
from frametwin.imaging.masks import read_masks

ROOT = Path(__file__).resolve().parent.parent
COUNT = 6
STYLE = "mask" if find_spec("bpy") else "silhouette"
RECIPE = f"""
format = "frametwin-recipe"
version = 1
name = "tiny"
count = {COUNT}
[[frames]]
frame = "bridge"
[[frames]]
frame = "half_bowl"
[[deformations]]
kind = "sag"
peak_fraction = [0.03, 0.08]
[[deformations]]
kind = "warp"
drift_mm = [0, 2]
[printing]
printed = [0.5, 1.0]
missing = [0, 2]
thin = [0, 2]
thickness_variation = 0.04
[rig]
views = 3
size = [90, 120]
jitter_mm = 1.0
[render]
style = "STYLE"
"""


def recipe_in(folder: Path, style: str = STYLE, name: str = "tiny.toml", **changes: str) -> Path:
    text = RECIPE.replace("STYLE", style)
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def contents(out: Path) -> dict[int, str]:
    """Hashes of all samples; every one of them is looked at, not only the list."""
    listed = {entry.index: entry.content for entry in read_dataset(out).samples}
    assert listed == {entry.index: read_sample(entry.folder).content for entry in read_dataset(out).samples}
    return listed


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recipe_in(tmp_path_factory.mktemp("recipes"))


@pytest.fixture(scope="module")
def reference(recipe: Path) -> Path:
    """The dataset, made in one go by one process."""
    out = recipe.parent / "reference"
    report = generate(recipe, out)
    assert report.made == list(range(COUNT)) and not report.failed and not report.damaged
    return out


def test_samples_are_captures_with_their_truth(reference: Path) -> None:
    for entry in read_dataset(reference).samples:
        capture = read_capture(entry.folder)
        assert capture.truth is not None and len(capture.views) == 3
        assert {mask.shape for mask in read_masks(capture)} == {(90, 120)}
        names = {path.name for path in entry.folder.iterdir()}
        assert names >= {"sample.json", "curves.npz", "simulation.json"} and "scene.json" not in names
        made_with = read_sample(entry.folder).made_with
        assert ("blender" in made_with) == (STYLE == "mask") and made_with["frametwin"]
    assert {path.name for path in (reference / "samples").iterdir()} == {f"{i:06d}" for i in range(COUNT)}
    assert len(set(contents(reference).values())) == COUNT


def test_two_workers_make_the_same_samples(recipe: Path, reference: Path, tmp_path: Path) -> None:
    generate(recipe, tmp_path / "d", GenerateSettings(workers=2, per_process=2))
    assert contents(tmp_path / "d") == contents(reference)


def test_three_shards_make_the_same_samples(recipe: Path, reference: Path, tmp_path: Path) -> None:
    seen: list[int] = []
    for i in (3, 1, 2):
        seen += generate(recipe, tmp_path / "d", GenerateSettings(shard=(i, 3))).made
    assert sorted(seen) == list(range(COUNT)) and contents(tmp_path / "d") == contents(reference)


def test_a_sample_can_be_made_by_itself(recipe: Path, reference: Path, tmp_path: Path) -> None:
    report = generate(recipe, tmp_path / "d", GenerateSettings(shard=(5, COUNT)))
    assert report.made == [4] and contents(tmp_path / "d") == {4: contents(reference)[4]}


def test_another_seed_makes_other_samples(recipe: Path, reference: Path, tmp_path: Path) -> None:
    generate(recipe, tmp_path / "d", GenerateSettings(seed=1, count=1))
    assert contents(tmp_path / "d")[0] != contents(reference)[0]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_run_that_is_killed_at_random_moments_goes_on(recipe: Path, reference: Path, tmp_path: Path) -> None:
    out, rng = tmp_path / "d", np.random.default_rng(7)
    command = [sys.executable, "-m", "frametwin", "dataset", "generate", str(recipe), "--out", str(out), "--quiet"]
    for _ in range(3):
        process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE)
        before = len(list((out / "samples").glob("0*"))) if out.exists() else 0
        deadline = time.monotonic() + 120.0
        while time.monotonic() < deadline and process.poll() is None:
            if len(list((out / "samples").glob("0*"))) > before:
                break
            time.sleep(0.02)
        time.sleep(rng.uniform(0.0, 0.5))  # into the middle of the next sample, whatever it is doing there
        family = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        process.send_signal(signal.SIGKILL)
        process.communicate()
        _, alive = psutil.wait_procs(family, timeout=20.0)
        assert not alive, "a child outlived its parent"
    kept = len(list((out / "samples").glob("0*")))
    assert 1 <= kept <= COUNT
    report = generate(recipe, out)
    assert not report.failed and not report.busy and len(report.kept) == kept
    assert contents(out) == contents(reference)
    assert {path.name for path in (out / "samples").iterdir()} == {f"{i:06d}" for i in range(COUNT)}


def test_what_is_damaged_is_found_by_its_hash_and_made_again(recipe: Path, reference: Path, tmp_path: Path) -> None:
    import shutil

    out = tmp_path / "d"
    shutil.copytree(reference, out)
    damage = {0: "images/camera_00.png", 1: "truth.json", 2: "curves.npz", 3: "sample.json"}
    for index, name in damage.items():
        path = out / "samples" / f"{index:06d}" / name
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1  # one bit: size and place are as before
        path.write_bytes(bytes(data))
    shutil.rmtree(out / "samples" / "000004" / "images")
    report = generate(recipe, out)
    assert report.kept == [5] and report.made == [0, 1, 2, 3, 4] and sorted(report.damaged) == [0, 1, 2, 3, 4]
    assert contents(out) == contents(reference)
    assert generate(recipe, out) == Report(kept=list(range(COUNT)), seconds=pytest.approx(0.0, abs=600.0))


def test_a_lost_listing_is_written_anew_from_the_samples(recipe: Path, reference: Path, tmp_path: Path) -> None:
    import shutil

    out = tmp_path / "d"
    shutil.copytree(reference, out)
    (out / "dataset.json").write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match=r"dataset.json: file: is damaged .*; delete it and generate again"):
        generate(recipe, out)
    (out / "dataset.json").unlink()
    with pytest.raises(InputError, match="samples of another seed"):
        generate(recipe, out, GenerateSettings(seed=8))
    assert generate(recipe, out).kept == list(range(COUNT)) and contents(out) == contents(reference)
    (out / "dataset.json").unlink()
    other = recipe_in(tmp_path, name="other.toml", **{"[0.03, 0.08]": "[0.03, 0.09]"})
    with pytest.raises(InputError, match="holds something else"):
        generate(other, out)


def test_a_run_that_was_killed_in_its_first_moments_goes_on(tmp_path: Path) -> None:
    recipe, out = recipe_in(tmp_path, "silhouette"), tmp_path / "d"
    out.mkdir()
    (out / "recipe.toml").write_bytes(recipe.read_bytes())
    (out / "samples").mkdir()
    assert generate(recipe, out, GenerateSettings(count=1)).made == [0]


def test_something_else_in_the_place_of_a_sample_gives_way(tmp_path: Path) -> None:
    recipe, out = recipe_in(tmp_path, "silhouette"), tmp_path / "d"
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "thesis.txt").write_text("years of work", encoding="utf-8")
    generate(recipe, out, GenerateSettings(count=1))
    (out / "samples" / "000001").write_text("a file", encoding="utf-8")
    (out / "samples" / "000002").symlink_to(tmp_path / "elsewhere")
    report = generate(recipe, out, GenerateSettings(count=3))
    assert report.made == [1, 2] and not report.failed and sorted(contents(out)) == [0, 1, 2]
    assert (tmp_path / "elsewhere" / "thesis.txt").exists()
    assert {path.name for path in (out / "samples").iterdir()} == {"000000", "000001", "000002"}


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_process_is_told_and_leaves_nothing(tmp_path: Path, workers: int) -> None:
    recipe, out = recipe_in(tmp_path, "silhouette", **{"size = [90, 120]": "size = [900, 1200]"}), tmp_path / "d"
    words = ["dataset", "generate", str(recipe), "--out", str(out), "--workers", str(workers), "--json", "--quiet"]
    run = subprocess.Popen(
        [sys.executable, "-m", "frametwin", *words],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120.0
    both = [out / "samples" / "000000", out / "samples" / "000001"]  # so that either worker is past its start
    while time.monotonic() < deadline and not all(sample.exists() for sample in both):
        time.sleep(0.02)
    children = psutil.Process(run.pid).children(recursive=True)
    next(child for child in children if "frametwin.worker" in child.cmdline()).kill()
    data = json.loads(run.communicate()[0])
    assert run.returncode == 1 and len(data["failed"]) == 1 and len(data["made"]) == COUNT - 1
    assert "SIGKILL" in next(iter(data["failed"].values()))
    assert not [path for path in (out / "samples").iterdir() if path.name.startswith(".")]
    assert generate(recipe, out).made == [int(index) for index in data["failed"]]


def test_a_longer_run_keeps_what_is_there(recipe: Path, reference: Path, tmp_path: Path) -> None:
    out = tmp_path / "d"
    generate(recipe, out, GenerateSettings(count=1))
    report = generate(recipe, out, GenerateSettings(count=2))
    assert report.kept == [0] and report.made == [1] and read_dataset(out).count == 2
    assert contents(out) == {index: contents(reference)[index] for index in (0, 1)}


def test_another_recipe_or_seed_is_refused(recipe: Path, reference: Path, tmp_path: Path) -> None:
    before = {path: path.read_bytes() for path in reference.rglob("*") if path.is_file()}
    other = recipe_in(tmp_path, name="other.toml", **{"[0.03, 0.08]": "[0.03, 0.09]"})
    with pytest.raises(InputError, match="samples of another recipe"):
        generate(other, reference)
    with pytest.raises(InputError, match="samples of another seed"):
        generate(recipe, reference, GenerateSettings(seed=5))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work", encoding="utf-8")
    with pytest.raises(InputError, match="holds something else"):
        generate(recipe, tmp_path / "mine")
    assert {path: path.read_bytes() for path in reference.rglob("*") if path.is_file()} == before


def test_a_sample_that_fails_is_told_and_stops_nothing(tmp_path: Path) -> None:
    changes = {"missing = [0, 2]": "missing = 77", "thin = [0, 2]": "thin = 0"}
    bad = recipe_in(tmp_path, "silhouette", **changes)  # the bridge has 76 struts, half of the half-bowl 78
    report = generate(bad, tmp_path / "d")
    frames = [DatasetRun(bad, tmp_path / "d").sampler.specification(index).frame for index in range(COUNT)]
    bridges = [index for index, frame in enumerate(frames) if frame == "bridge"]
    assert 0 < len(bridges) < COUNT and sorted(report.failed) == bridges
    assert all("missing" in reason for reason in report.failed.values())
    assert sorted([*report.made, *report.failed]) == list(range(COUNT))
    noted = {item.index: item.reason for item in read_dataset(tmp_path / "d").failed}
    assert noted == report.failed
    assert not [path for path in (tmp_path / "d" / "samples").iterdir() if path.name.startswith(".")]


def test_cancelling_keeps_what_is_done(tmp_path: Path) -> None:
    recipe = recipe_in(tmp_path, "silhouette")
    with pytest.raises(Cancelled):
        generate(recipe, tmp_path / "d", progress=lambda step: not (step.stage == "samples" and step.iteration == 3))
    assert sorted(contents(tmp_path / "d")) == [0, 1, 2] and not read_dataset(tmp_path / "d").failed
    assert generate(recipe, tmp_path / "d").kept == [0, 1, 2]


def test_two_runs_at_once_share_the_work(tmp_path: Path) -> None:
    recipe = recipe_in(tmp_path, "silhouette")
    run = DatasetRun(recipe, tmp_path / "d")
    run.open()
    with run.claim(2):  # as if another process was making it
        report = generate(recipe, tmp_path / "d")
    assert report.busy == [2] and report.made == [0, 1, 3, 4, 5] and not report.failed
    assert generate(recipe, tmp_path / "d").made == [2]


def test_a_cluster_that_exists_does_the_work(tmp_path: Path) -> None:
    from distributed import LocalCluster

    recipe = recipe_in(tmp_path, "silhouette")
    generate(recipe, tmp_path / "here", GenerateSettings(count=3))
    with LocalCluster(
        n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
    ) as cluster:
        report = generate(recipe, tmp_path / "there", GenerateSettings(count=3, scheduler=cluster.scheduler_address))
    assert report.made == [0, 1, 2] and contents(tmp_path / "there") == contents(tmp_path / "here")


def test_a_scheduler_that_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("frametwin.dataset.farm.PATIENCE", "1s")
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        generate(recipe_in(tmp_path, "silhouette"), tmp_path / "d", GenerateSettings(scheduler="tcp://127.0.0.1:9"))


def test_the_command(tmp_path: Path) -> None:
    recipe = recipe_in(tmp_path, "silhouette")
    out = tmp_path / "d"
    result = done("dataset", "generate", recipe, "--out", out, "--count", 2)
    assert "2 samples" in result.stdout and "frametwin dataset validate" in result.stdout
    data = json.loads(done("dataset", "generate", recipe, "--out", out, "--count", 2, "--json", "--quiet").stdout)
    assert data["kept"] == [0, 1] and data["made"] == []
    assert "i from 1 to n" in refused("dataset", "generate", recipe, "--out", out, "--shard", "4/3")
    assert "does not exist" in refused("dataset", "generate", tmp_path / "no.toml", "--out", out)


def test_settings_out_of_range_are_refused(recipe: Path, tmp_path: Path) -> None:
    for name, value in (("seed", -1), ("count", 0), ("shard", (0, 3)), ("workers", 0), ("per_process", 0)):
        with pytest.raises(InputError, match=name):
            generate(recipe, tmp_path / "d", GenerateSettings(**{name: value}))
    assert not (tmp_path / "d").exists()
