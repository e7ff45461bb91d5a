"""Cameras as a sample states them, and as they truly are: ``true_cameras.json`` beside ``transforms.json``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.cameras import Camera, transforms_of
from frametwin.capture.capture import Capture
from frametwin.capture.transforms import FORMAT, VERSION, read_cameras
from frametwin.dataset.hashes import REMEDY
from frametwin.dataset.specification_values import ErrorValues
from frametwin.errors import InputError
from frametwin.geometry.rotations import rotation_matrices

TRUE_FILE = "true_cameras.json"
"""Cameras that took the pictures, in the format of ``transforms.json``; only where the stated ones differ."""


def stated_cameras(cameras: Sequence[Camera], values: ErrorValues) -> tuple[Camera, ...]:
    """The cameras with the errors of a sample, each in a direction of its own."""
    rng = np.random.default_rng([values.seed, 3])
    return tuple(_stated(camera, values, i in values.bumped, rng) for i, camera in enumerate(cameras))


def _stated(camera: Camera, values: ErrorValues, bumped: bool, rng: np.random.Generator) -> Camera:
    axis, step, bump = (vector / np.linalg.norm(vector) for vector in rng.normal(size=(3, 3)))
    aside, sign = rng.uniform(0.0, 2.0 * np.pi), 1.0 if rng.random() < 0.5 else -1.0
    pose = np.array(camera.camera_to_world)
    pose[:3, :3] = pose[:3, :3] @ rotation_matrices(np.radians(values.turned_deg) * axis)
    if bumped:
        pose[:3, :3] = pose[:3, :3] @ rotation_matrices(np.radians(values.bumped_deg) * bump)
    pose[:3, 3] += values.moved_mm * step
    factor = 1.0 + sign * values.focal
    wrong = replace(
        camera,
        camera_to_world=pose,
        fl_x=camera.fl_x * factor,
        fl_y=camera.fl_y * factor,
        cx=camera.cx + values.centre_px * np.cos(aside),
        cy=camera.cy + values.centre_px * np.sin(aside),
    )
    return wrong.without_distortion() if values.lens_ignored else wrong


def true_cameras_file(cameras: Sequence[Camera]) -> dict[str, Any]:
    """Content of ``true_cameras.json``, of cameras with the names of their pictures."""
    paths = [f"images/{camera.name}.png" for camera in cameras]
    return {"format": FORMAT, "version": VERSION, **transforms_of(cameras, paths)}


def with_true_cameras(capture: Capture) -> Capture:
    """The capture with the cameras that took its pictures, where the sample tells them; itself elsewhere.

    Raises
    ------
    InputError
        If the file is damaged, or is not of the same views.
    """
    path = Path(capture.root) / TRUE_FILE
    if not path.is_file():
        return capture
    known = {camera.name: camera for camera in read_cameras(path)}
    names = [view.camera.name for view in capture.views]
    if sorted(known) != sorted(names):
        raise InputError.at(path, "frames", "are not the views of transforms.json", REMEDY)
    views = tuple(replace(view, camera=known[view.camera.name]) for view in capture.views)
    return replace(capture, views=views)
