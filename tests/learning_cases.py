"""Datasets for the tests of learning: prints of different frames, with masks or photographs, passes and curves."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from dataset_cases import MADE_WITH, edit_json, write_passes, write_true_curves
from photo_cases import codes
from small_frames import tower

from frametwin.cameras import to_nerfstudio
from frametwin.capture.capture import read_capture, write_capture
from frametwin.dataset.folder import sample_folder, write_dataset_json, write_sample_json
from frametwin.files import read_json
from frametwin.formats import defects_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import SimulationSettings, simulate, write_simulation

SIZE = (96, 128)
FRAMES = (tower(1), tower(2))
"""Of samples in turn: 12 struts and 24."""


def mixed_dataset(out: Path, count: int = 4, *, views: int = 3, passes: bool = False, photos: bool = False) -> Path:
    """Samples of two frames in turn; each scene is shown by two samples, and the odd ones lack a strut.

    Photographs are white on blue with noise, with backgrounds.
    """
    for index in range(count):
        folder = sample_folder(out, index)
        frame = FRAMES[index % 2]
        settings = SimulationSettings(views=views, size=SIZE, seed=index + 1, missing=index % 2, missing_share=0.6)
        simulation = simulate(frame, settings)
        write_simulation(folder, simulation)
        if photos:
            _photograph(folder, simulation.truth, simulation.present)
        write_true_curves(folder)
        if passes:
            write_passes(folder)
        note_sample(folder, index, frame)
    write_dataset_json(out, name="mixed", description="Towers.", recipe={"licence": "CC0-1.0"}, seed=0, count=count)
    return out


def note_sample(folder: Path, index: int, frame: Wireframe) -> None:
    """Write ``sample.json``; two samples in turn show one scene."""
    write_sample_json(folder, index, {"index": index, "scene": index // 2, "frame": frame.name}, MADE_WITH)


def _photograph(folder: Path, truth: Wireframe, present: np.ndarray) -> None:
    capture = read_capture(folder)
    cameras = [view.camera for view in capture.views]
    shares = [p[..., None] / 255.0 for p in silhouettes(truth, cameras, present=present, supersampling=4)]
    white, blue = np.array([0.6, 0.6, 0.58]), np.array([0.04, 0.1, 0.3])
    images = [codes(a * white + (1.0 - a) * blue, seed=i) for i, a in enumerate(shares)]
    before = [codes(np.zeros_like(a) + blue, seed=100 + i) for i, a in enumerate(shares)]
    defects = folder / defects_json.FILE_NAME
    notes = {defects.name: read_json(defects)} if defects.is_file() else {}
    shutil.rmtree(folder)
    write_capture(folder, capture.frame, cameras, images, truth=truth, backgrounds=before, extra=notes)


def give_lens(folder: Path, lens: tuple[float, float, float, float, float]) -> None:
    """Let the cameras of a sample have distortion; its curves are seen through it, its pictures stay as they are."""
    views = []
    for view in read_capture(folder).views:
        camera = replace(view.camera, distortion=np.array(lens))
        views.append(to_nerfstudio(camera, f"images/{view.image.path.name}"))
    edit_json(folder / "transforms.json", lambda data: data.update(frames=views))
    write_true_curves(folder)
