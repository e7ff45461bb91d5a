"""Whether cameras are still where they were calibrated, told by the print that they see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rig_file import Rig
from frametwin.capture.capture import Capture
from frametwin.errors import InputError
from frametwin.fitting.api import fit_capture
from frametwin.fitting.judgement import FAR
from frametwin.progress import ProgressCallback
from frametwin.twin.twin import Twin
from frametwin.twin.verdict import WRONG

STILL, TOUCHED, UNKNOWN = "still", "touched", "unknown"
"""What is said of a camera; unknown where its picture shows nothing, or the whole twin is wrong."""

SAME_PLACE = (1e-3, 0.05)
"""Radians and mm by which two tellings of the same rig may differ."""


@dataclass(frozen=True)
class CameraCheck:
    """What is said of one camera.

    Attributes
    ----------
    name : str
    status : str
        One of `STILL`, `TOUCHED` and `UNKNOWN`.
    turn : float, degrees
        From where the rig has it, by the smallest turn.
    shift : float, mm
    focal : float
        Change of the focal length as a share of it.
    sigmas : float
        Largest correction in standard deviations of the rig; 0 where nothing asked for one.
    """

    name: str
    status: str
    turn: float = 0.0
    shift: float = 0.0
    focal: float = 0.0
    sigmas: float = 0.0


def check_cameras(
    rig: Rig, capture: Capture, callback: ProgressCallback | None = None
) -> tuple[tuple[CameraCheck, ...], Twin]:
    """Fit a capture through a rig's cameras and say of each whether it has been touched since its calibration.

    Parameters
    ----------
    rig
        The cameras as they were calibrated, with what is known of how well.
    capture
        Pictures of a print, made with `frametwin capture` from the same rig; it may stand in the plan's axes.
    callback
        Told of every step of the fit.

    Returns
    -------
    One for each view of the capture, and the twin.

    Raises
    ------
    InputError
        If a view is of no camera of the rig, or the capture has the cameras elsewhere to each other than the rig.
    """
    known = _by_name(rig, capture)
    cameras = [replace(view.camera, covariance=known[view.camera.name].covariance) for view in capture.views]
    views = tuple(replace(view, camera=camera) for view, camera in zip(capture.views, cameras, strict=True))
    twin = fit_capture(replace(capture, views=views), callback=callback).twin
    return tuple(_told(view.camera.name, twin) for view in views), twin


def _by_name(rig: Rig, capture: Capture) -> dict[str, Camera]:
    cameras = {name: rig.camera(name).as_camera() for name in rig.names}
    for view in capture.views:
        if view.camera.name not in cameras:
            remedy = f"make the capture with frametwin capture; the rig has {', '.join(rig.names)}"
            raise InputError.at(capture.root, view.camera.name, "is no camera of the rig", remedy)
    views = [view.camera for view in capture.views]
    own = [cameras[camera.name] for camera in views]
    for i, (there, here) in enumerate(zip(own, views, strict=True)):
        before, now = (np.linalg.inv(pair[0].camera_to_world) @ pair[i].camera_to_world for pair in (own, views))
        turned = np.abs(now[:3, :3] - before[:3, :3]).max() > SAME_PLACE[0]
        if turned or np.abs(now[:3, 3] - before[:3, 3]).max() > SAME_PLACE[1]:
            remedy = "make the capture again from this rig, with frametwin capture"
            raise InputError.at(capture.root, here.name, f"stands elsewhere than {there.name} of the rig", remedy)
    return cameras


def _told(name: str, twin: Twin) -> CameraCheck:
    used = next((bool(view["used"]) for view in twin.views if view["name"] == name), False)
    if twin.verdict.status == WRONG:
        return CameraCheck(name, UNKNOWN)
    if not used:
        unread = any(name in reason and "disagrees" not in reason for reason in twin.verdict.reasons)
        return CameraCheck(name, UNKNOWN if unread else TOUCHED)
    found: Mapping[str, Any] | None = next((camera for camera in twin.cameras if camera["name"] == name), None)
    if found is None:
        return CameraCheck(name, STILL)
    turn, shift = float(np.linalg.norm(found["turn_deg"])), float(np.linalg.norm(found["shift_mm"]))
    status = TOUCHED if found["sigmas"] > FAR else STILL
    return CameraCheck(name, status, turn, shift, float(found["focal_share"]), float(found["sigmas"]))
