"""What a fit found out about its cameras, as a twin keeps it, and the cameras as they were found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.fitting.camera_freedoms import CENTRE, FOCAL, FREEDOMS, LENS, SHIFT, TURN, corrected
from frametwin.fitting.part_fit import ViewsFit
from frametwin.geometry.rotations import turns_of


def as_records(found: ViewsFit, cameras: Sequence[Camera]) -> list[dict[str, Any]]:
    """Corrections of the cameras as a twin's file has them; empty where the rig was taken as it is."""
    if found.holds == "rig":
        return []
    return [
        as_record(camera.name, own, float(sigmas), found.holds)
        for camera, own, sigmas in zip(cameras, found.cameras, found.sigmas, strict=True)
    ]


def as_record(name: str, freedoms: np.ndarray, sigmas: float, held_by: str) -> dict[str, Any]:
    """The correction of one camera, (10,) freedoms, as a twin's file has it."""
    return {
        "name": name,
        "turn_deg": np.rad2deg(freedoms[TURN]).tolist(),
        "shift_mm": freedoms[SHIFT].tolist(),
        "focal_share": float(np.expm1(freedoms[FOCAL])),
        "centre_px": freedoms[CENTRE].tolist(),
        "k1": float(freedoms[LENS]),
        "sigmas": sigmas,
        "held_by": held_by,
    }


def corrections_between(before: Camera, after: Camera) -> np.ndarray:
    """(10,) freedoms that make one camera another one of the same lens; `corrected` undone."""
    result = np.zeros(FREEDOMS)
    result[TURN] = turns_of((before.camera_to_world[:3, :3].T @ after.camera_to_world[:3, :3]).T)
    result[SHIFT] = after.centre - before.centre
    result[FOCAL] = np.log(after.fl_x / before.fl_x)
    result[CENTRE] = after.cx - before.cx, after.cy - before.cy
    return result


def as_found(
    cameras: Sequence[Camera], records: Sequence[Mapping[str, Any]], source: str = "twin.json"
) -> list[Camera]:
    """Cameras where a fit found them, by name; those that it says nothing of stay.

    Parameters
    ----------
    cameras
        Without lens distortion. What was found of the lens itself is left out: a pinhole camera has none.
    records
        A twin's ``cameras``.
    source
        Where they stand; only named in messages.

    Raises
    ------
    InputError
        If a correction is not one.
    """
    freedoms = freedoms_of(cameras, records, source)
    freedoms[:, LENS] = 0.0
    return corrected(cameras, freedoms)


def freedoms_of(
    cameras: Sequence[Camera], records: Sequence[Mapping[str, Any]], source: str = "twin.json"
) -> np.ndarray:
    """(N, 10) freedoms of cameras as a fit found them, by name; zeros of those that it says nothing of.

    See `as_found`.
    """
    by_name = {record.get("name"): (f"cameras[{i}]", record) for i, record in enumerate(records)}
    freedoms = np.zeros((len(cameras), FREEDOMS))
    for own, camera in zip(freedoms, cameras, strict=True):
        if camera.name in by_name:
            own[:] = _freedoms(*by_name[camera.name], source)
    return freedoms


def _freedoms(place: str, record: Mapping[str, Any], source: str) -> np.ndarray:
    """(10,) freedoms of a camera."""
    result = np.zeros(FREEDOMS)
    for key, part, shape in (("turn_deg", TURN, (3,)), ("shift_mm", SHIFT, (3,)), ("centre_px", CENTRE, (2,))):
        result[part] = checked_array(record.get(key), "f", shape, source, f"{place}.{key}")
    result[TURN] = np.deg2rad(result[TURN])
    share = float(checked_array(record.get("focal_share"), "f", (), source, f"{place}.focal_share"))
    if not share > -1.0:
        raise InputError.at(source, f"{place}.focal_share", f"{share:g} is no change of a focal length", "fit again")
    result[FOCAL] = np.log1p(share)
    result[LENS] = checked_array(record.get("k1", 0.0), "f", (), source, f"{place}.k1")
    return result
