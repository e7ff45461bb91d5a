"""Small datasets for tests: simulated captures with their notes, in the layout of `frametwin.dataset.folder`."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
import OpenEXR
from click.testing import CliRunner, Result

from frametwin.capture.capture import read_capture
from frametwin.cli.main import Commands
from frametwin.dataset.fits import TABLE_FILE, FitRow
from frametwin.dataset.folder import read_dataset, read_sample, sample_folder, write_dataset_json, write_sample_json
from frametwin.dataset.true_curves import intervals_of, read_true_curves
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes
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


def write_passes(folder: Path, change: Callable[[dict[str, np.ndarray]], None] = lambda channels: None) -> None:
    """Passes of a sample: strut by strut, the nearest one wins; depths are those before the centreline."""
    capture = read_capture(folder)
    assert capture.truth is not None
    curves, _ = read_true_curves(capture, capture.truth)
    (folder / "passes").mkdir(exist_ok=True)
    for view in capture.views:
        camera = view.camera
        depth = np.full((camera.height, camera.width), 1e10, dtype=np.float32)
        strut = np.zeros_like(depth)
        for e in np.flatnonzero(curves.intervals[:, 1] > curves.intervals[:, 0]):
            alone = np.zeros_like(curves.intervals)
            alone[e] = curves.intervals[e]
            (mask,) = silhouettes(capture.truth, [camera], present=alone)
            rows, columns = np.nonzero(mask)
            if not rows.size:
                continue
            u = np.linspace(0.0, 1.0, 200)
            points = bezier.evaluate(capture.truth.control_points[e], u)
            pixels, along = camera.project(points)
            places = np.stack([columns, rows], axis=1) + 0.5
            near = np.linalg.norm(places[:, None] - pixels, axis=2).argmin(axis=1)
            ray = points - camera.centre
            tangent = np.gradient(points, axis=0)
            sine = np.linalg.norm(np.cross(ray, tangent), axis=1) / np.linalg.norm(ray, axis=1)
            sine = np.maximum(sine / np.linalg.norm(tangent, axis=1), 0.05)
            found = (along - capture.truth.radius[e] / sine)[near]
            nearer = found < depth[rows, columns]
            depth[rows[nearer], columns[nearer]] = found[nearer]
            strut[rows[nearer], columns[nearer]] = e + 1
        normal = -camera.forward
        channels = {"Depth.Z": depth, "Strut.X": strut}
        channels |= {f"Normal.{axis}": np.full_like(depth, normal[i]) for i, axis in enumerate("XYZ")}
        change(channels)
        header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
        named = {f"ViewLayer.{name}": values for name, values in channels.items()}
        OpenEXR.File(header, named).write(str(folder / "passes" / f"{camera.name}.exr"))
