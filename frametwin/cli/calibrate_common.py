"""What the calibration commands share: options, and how a rig is told."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin.cli.common import print_facts, print_json

if TYPE_CHECKING:
    from frametwin.cameras.rig_file import Rig, RigCamera


class Place(click.ParamType):
    """Three numbers, and a turn in degrees."""

    name = "X,Y,Z[,DEGREES]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(float(part) for part in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) not in (3, 4) or not all(abs(number) <= 1e6 for number in numbers):
            self.fail(f"{value!r} is not X,Y,Z in mm, and a turn in degrees if there is one", param, ctx)
        return numbers


def tell_rig(folder: Path, rig: Rig, step: str, as_json: bool) -> None:
    """Print what became of a calibration, for programs or for people.

    Parameters
    ----------
    folder
        Of the rig.
    rig
        As it was written.
    step
        Whose pictures that were left out are told.
    as_json
        Whether for programs.
    """
    new = [note for note in rig.left_out if note.get("step") == step]
    if as_json:
        print_json(
            {
                "rig": folder,
                "world": rig.world,
                "board": rig.board,
                "cameras": [_camera_row(camera) for camera in rig.cameras],
                "object": rig.placed_by or None,
                "notes": [note["text"] for note in rig.notes],
                "left_out": new,
            }
        )
        return
    facts = [(camera.name, _camera_words(camera)) for camera in rig.cameras]
    facts += [("left out", f"{note['camera']}/{note['picture']}: {note['reason']}") for note in new]
    facts += [("note", note["text"]) for note in rig.notes]
    facts.append(("page", str(folder / "report.html")))
    print_facts(f"rig: {folder}", facts)


def _camera_row(camera: RigCamera) -> dict[str, Any]:
    import numpy as np

    row: dict[str, Any] = {"name": camera.name, "model": camera.model, "fl_x": camera.lens[0], "fl_y": camera.lens[1]}
    sigmas = None if camera.covariance is None else np.sqrt(np.diag(camera.covariance))
    row["sigma"] = None if sigmas is None else dict(zip(camera.keys, sigmas.tolist(), strict=True))
    if camera.camera_to_world is not None:
        row["centre"] = camera.centre
    return {**row, **camera.residuals}


def _camera_words(camera: RigCamera) -> str:
    import numpy as np

    figures = camera.residuals
    words = f"focal length {camera.lens[0]:.2f} x {camera.lens[1]:.2f} px"
    if camera.covariance is not None:
        words += f" (+- {np.sqrt(camera.covariance[0, 0]):.2f})"
    words += f", distortion {' '.join(figures.get('distortion', [])) or 'none'}"
    words += f", misses by {figures.get('rms_px', float('nan')):.2f} px in {figures.get('pictures', 0)} pictures"
    if camera.camera_to_world is not None:
        x, y, z = camera.centre
        words += f", at {x:.1f}, {y:.1f}, {z:.1f} mm"
        if camera.covariance is not None and camera.covariance[-3:, -3:].any():
            words += f" (+- {np.sqrt(np.linalg.eigvalsh(camera.covariance[-3:, -3:])[-1]):.2f})"
    return words
