"""Small datasets for tests: simulated captures with their notes, in the layout of `frametwin.dataset.folder`."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
from click.testing import CliRunner, Result

from frametwin.capture.capture import read_capture
from frametwin.cli.main import Commands
from frametwin.dataset.fits import TABLE_FILE, FitRow
from frametwin.dataset.folder import read_dataset, read_sample, sample_folder, write_dataset_json, write_sample_json
from frametwin.dataset.true_curves import intervals_of
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.simulation.curve_truth import curve_truth, write_curves
from frametwin.simulation.simulate import SimulationSettings, simulate, write_simulation


def rows_of(folder: Path) -> dict[int, FitRow]:
    """What ``fit.json`` tells of every sample, by its index."""
    samples = json.loads((folder / TABLE_FILE).read_text(encoding="utf-8"))["samples"]
    return {sample["index"]: FitRow(**sample) for sample in samples}


SETTINGS: tuple[dict[str, Any], ...] = ({"seed": 1, "missing": 2}, {"seed": 2, "deformation": "warp"})
MADE_WITH = {"frametwin": "tests"}


def make_dataset(
    out: Path,
    samples: Sequence[dict[str, Any]] = SETTINGS,
    *,
    frame: Wireframe | None = None,
    size: tuple[int, int] = (120, 160),
    views: int = 4,
    name: str = "small",
    curves: bool = True,
    failed: dict[int, str] | None = None,
) -> Path:
    """Write a dataset of simulated prints; every sample has its own settings of `SimulationSettings`."""
    frame = named_frame("bridge") if frame is None else frame
    for index, changes in enumerate(samples):
        folder = sample_folder(out, index)
        settings = SimulationSettings(**{"views": views, "size": size, **changes})
        write_simulation(folder, simulate(frame, settings))
        if curves:
            write_true_curves(folder)
        write_sample_json(folder, index, {"index": index, "frame": frame.name, **changes}, MADE_WITH)
    note(out, name=name, count=len(samples) + len(failed or {}), failed=failed)
    return out


def note(out: Path, *, name: str = "small", count: int | None = None, failed: dict[int, str] | None = None) -> None:
    """Write ``dataset.json`` for the samples that are there."""
    write_dataset_json(
        out,
        name=name,
        description="Two bridges.",
        recipe={"name": name, "licence": "CC0-1.0"},
        seed=0,
        count=read_dataset(out).count if count is None else count,
        failed=failed,
    )


def note_again(out: Path, index: int = 0) -> None:
    """Hash a sample again after a test has changed it, so that its files are as noted but their meaning is not."""
    folder = sample_folder(out, index)
    sample = read_sample(folder)
    write_sample_json(folder, index, sample.specification, sample.made_with)
    note(out)


def write_true_curves(folder: Path, radius: np.ndarray | None = None) -> None:
    """Write the ``curves.npz`` of a sample; with ``radius`` (E, K) in mm in place of the truth's own."""
    capture = read_capture(folder)
    assert capture.truth is not None
    radius = np.repeat(capture.truth.radius[:, None], 2, axis=1) if radius is None else radius
    present = intervals_of(folder, capture.frame.printed)
    cameras = [view.camera for view in capture.views]
    write_curves(folder / "curves.npz", curve_truth(capture.truth, present, radius, cameras))


def edit_json(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change a JSON file in place."""
    data = json.loads(path.read_text(encoding="utf-8"))
    change(data)
    path.write_text(json.dumps(data), encoding="utf-8")


def edit_image(path: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Change the pixels of a picture in place."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert cv2.imwrite(str(path), change(image))


def run_command(command: click.Command, *arguments: str | Path) -> Result:
    """Run a command of the dataset group in this process, with exit codes as on the command line."""
    group = Commands("frametwin")
    group.get_command = lambda ctx, name: command if name == "it" else None  # type: ignore[method-assign]
    return CliRunner().invoke(group, ["it", *(str(argument) for argument in arguments)], prog_name="frametwin")
