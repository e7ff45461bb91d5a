"""What a fit found out about its cameras, as a twin keeps it, and the cameras as they were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting.camera_freedoms import CENTRE, FOCAL, FREEDOMS, LENS, SHIFT, TURN, corrected
from frametwin.fitting.part_fit import ViewsFit


def as_records(found: ViewsFit, cameras: Sequence[Camera]) -> list[dict[str, Any]]:
    """Corrections of the cameras as a twin's file has them; empty where the rig was taken as it is."""
    if found.holds == "rig":
        return []
    return [
        {
            "name": camera.name,
            "turn_deg": np.rad2deg(own[TURN]).tolist(),
            "shift_mm": own[SHIFT].tolist(),
            "focal_share": float(np.expm1(own[FOCAL])),
            "centre_px": own[CENTRE].tolist(),
            "k1": float(own[LENS]),
            "sigmas": float(sigmas),
            "held_by": found.holds,
        }
        for camera, own, sigmas in zip(cameras, found.cameras, found.sigmas, strict=True)
    ]


def as_found(cameras: Sequence[Camera], records: Sequence[Mapping[str, Any]]) -> list[Camera]:
    """Cameras where a fit found them, by name; those that it says nothing of stay.

    Parameters
    ----------
    cameras
        Without lens distortion. What was found of the lens itself is left out: a pinhole camera has none.
    records
        A twin's ``cameras``.
    """
    by_name = {record["name"]: record for record in records}
    freedoms = np.zeros((len(cameras), FREEDOMS))
    for own, camera in zip(freedoms, cameras, strict=True):
        record = by_name.get(camera.name)
        if record is not None:
            own[TURN], own[SHIFT] = np.deg2rad(record["turn_deg"]), record["shift_mm"]
            own[FOCAL], own[CENTRE] = np.log1p(record["focal_share"]), record["centre_px"]
    return corrected(cameras, freedoms)
