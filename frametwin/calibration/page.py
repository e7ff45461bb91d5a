"""The page of a rig: residual maps, coverage, uncertainty in px over the picture and in mm at the print; one file."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.detection import Sighting
from frametwin.calibration.uncertainty import (
    lens_uncertainty,
    meeting_point,
    pixel_grid,
    point_uncertainty,
    rig_uncertainty,
)
from frametwin.cameras.lens_models import LENS_KEYS, rays
from frametwin.cameras.rig_file import Rig, RigCamera
from frametwin.files import write_text

Floats = NDArray[np.float64]

WIDTH = 420
"""Of a map, in pixels of the page."""

ARROW = 0.04
"""Length of the arrow of a usual residual, as a share of the picture's width."""

MOST_POINTS = 1500
"""Corners drawn for a camera."""

PRINT_SIZE = 200.0
"""Edge in mm of the cube about the print in which millimetres are told."""

STYLE = """body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:1400px;color:#1d2433;padding:0 1em}
h2{margin:2em 0 .3em;border-top:1px solid #d6dae0;padding-top:1em}
table{border-collapse:collapse;margin:.6em 0}td,th{padding:.2em .9em .2em 0;text-align:right}
td:first-child,th:first-child{text-align:left}
.maps{display:flex;flex-wrap:wrap;gap:18px}figure{margin:0;width:420px}figcaption{color:#5b6472;font-size:13px}
svg,img{width:420px;border:1px solid #d6dae0;background:#fff;display:block}
.note{background:#fff6dd;padding:.4em .8em;margin:.3em 0;border-left:4px solid #e0a100}"""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Corners of the last adjustment, with the residuals (N, 2) in px of each sighting."""

    sightings: tuple[Sighting, ...] = ()
    residuals: tuple[Floats, ...] = ()


def write_page(path: Path, rig: Rig, evidence: Evidence) -> None:
    """Write the page of a rig; it needs nothing else, and no network."""
    body = [
        "<h1>Rig</h1>",
        f"<p>{escape(_world(rig))} Board {escape(rig.board)}. {escape(rig.date)}</p>",
        *(f'<p class="note">{escape(note.get("text", ""))}</p>' for note in rig.notes),
        _overview(rig),
        *(_camera_part(camera, rig, evidence) for camera in rig.cameras),
        _left_out(rig),
    ]
    head = f'<meta charset="utf-8"><title>Rig of {len(rig.cameras)} cameras</title><style>{STYLE}</style>'
    write_text(
        path, f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n' + "\n".join(body) + "\n</body></html>\n"
    )


def _world(rig: Rig) -> str:
    count = f"{len(rig.cameras)} camera{'s' * (len(rig.cameras) != 1)}. "
    if rig.world == "none":
        return count + "The lenses are known, the poses are not yet."
    if rig.world == "camera":
        return count + f"The world is that of {rig.cameras[0].name}; the robot's is not known yet."
    return count + f"The world is the robot's, by {rig.placed_by.get('object')} at {rig.placed_by.get('at')}."


def print_points(rig: Rig) -> Floats:
    """(9, 3) middle and corners of the cube about the print, mm."""
    middle = meeting_point(rig.cameras)
    if rig.world == "robot" and "at" in rig.placed_by:
        middle = np.add(rig.placed_by["at"][:3], (0.0, 0.0, 0.5 * PRINT_SIZE))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    return middle + 0.5 * PRINT_SIZE * np.array([np.zeros(3), *corners])


def _overview(rig: Rig) -> str:
    posed = rig.world != "none" and all(camera.covariance is not None for camera in rig.cameras)
    columns = ["camera", "picture", "lens", "focal length", "terms", "pictures", "misses by"]
    columns.extend(["at the print"] if posed else [])
    points = print_points(rig) if posed else np.zeros((0, 3))
    rows = []
    for camera in rig.cameras:
        figures = camera.residuals
        terms = ", ".join(figures.get("distortion", [])) or "none"
        row = [camera.name, f"{camera.width} x {camera.height}", camera.model, _focal(camera), terms]
        row.extend([str(figures.get("pictures", "")), f"{figures.get('rms_px', float('nan')):.3f} px"])
        row += [_at_print(camera, points)] if posed else []
        rows.append(row)
    table = _table(columns, rows)
    if posed and len(rig.cameras) > 1:
        spread = rig_uncertainty(rig.cameras, points)
        seen = spread[np.isfinite(spread)]
        if seen.size:
            table += (
                f"<p>All cameras together locate a point of a {PRINT_SIZE:.0f} mm cube about the print to"
                f" {np.median(seen):.3f} mm (worst {seen.max():.3f} mm) as far as the calibration goes: one standard"
                " deviation, errors of detection in the pictures of the print not counted.</p>"
            )
    return table


def _focal(camera: RigCamera) -> str:
    if camera.covariance is None:
        return f"{camera.lens[0]:.1f} px"
    return f"{camera.lens[0]:.1f} &plusmn; {np.sqrt(camera.covariance[0, 0]):.1f} px"


def _at_print(camera: RigCamera, points: Floats) -> str:
    assert camera.camera_to_world is not None
    depth = (points - camera.centre) @ camera.camera_to_world[:3, 2]
    points = points[depth > 1.0]
    if not len(points):
        return "not in view"
    pixels = float(np.median(point_uncertainty(camera, points)))
    millimetres = pixels * float(np.median(depth[depth > 1.0])) / camera.lens[0]
    return f"{pixels:.2f} px = {millimetres:.3f} mm"


def _camera_part(camera: RigCamera, rig: Rig, evidence: Evidence) -> str:
    pairs = [
        (sighting.pixels, left)
        for sighting, left in zip(evidence.sightings, evidence.residuals, strict=True)
        if sighting.camera == camera.name
    ]
    figures = []
    if pairs:
        pixels, left = np.concatenate([p for p, _ in pairs]), np.concatenate([r for _, r in pairs])
        figures.append(_figure(_residual_map(camera, pixels, left), _residual_words(left)))
        figures.append(_figure(_coverage(camera, [p for p, _ in pairs]), f"Coverage: {len(pairs)} boards"))
    if camera.covariance is not None:
        grid, shape = pixel_grid(camera)
        spread = lens_uncertainty(camera, grid)
        figures.append(_uncertainty_map(spread, shape, camera, "Lens: where a far point is seen"))
        if rig.world != "none":
            spread = _over_the_picture(camera, grid, print_points(rig)[0])
            figures.append(
                _uncertainty_map(spread, shape, camera, "Lens and pose: where a point as far as the print is")
            )
    values = [[key, f"{value:.6g}", _sigma(camera, i)] for i, (key, value) in enumerate(_values(camera))]
    table = _table(["parameter", "value", "standard deviation"], values)
    return f'<h2>{escape(camera.name)}</h2><div class="maps">{"".join(figures)}</div>{table}'


def _values(camera: RigCamera) -> list[tuple[str, float]]:
    values = list(zip(LENS_KEYS[camera.model], camera.lens.tolist(), strict=True))
    if camera.camera_to_world is not None:
        values += [(key, 0.0) for key in ("rotation_x", "rotation_y", "rotation_z")]
        values += list(zip(("x", "y", "z"), camera.centre.tolist(), strict=True))
    return values


def _sigma(camera: RigCamera, i: int) -> str:
    if camera.covariance is None:
        return ""
    sigma = float(np.sqrt(max(camera.covariance[i, i], 0.0)))
    if camera.keys[i].startswith("rotation"):
        return f"{np.degrees(sigma):.4f} degrees"
    return f"{sigma:.3g}{' mm' if camera.keys[i] in ('x', 'y', 'z') else ''}" if sigma else "held"


def _over_the_picture(camera: RigCamera, grid: Floats, target: Floats) -> Floats:
    """Uncertainty in px of points as far as the print, over the picture."""
    assert camera.camera_to_world is not None
    directions = rays(camera.model, camera.lens, grid)
    good = np.isfinite(directions).all(axis=1)
    depth = float(np.linalg.norm(target - camera.centre))
    found = np.full(len(grid), np.nan)
    world = camera.centre + depth * directions[good] @ camera.camera_to_world[:3, :3].T
    found[good] = point_uncertainty(camera, world)
    return found


def _residual_words(left: Floats) -> str:
    rms = float(np.sqrt((left**2).sum(axis=1).mean()))
    return f"Residuals: {rms:.3f} px rms, an arrow of {ARROW:.0%} of the width is {2.0 * rms:.2f} px"


def _residual_map(camera: RigCamera, pixels: Floats, left: Floats) -> str:
    chosen = np.linspace(0, len(pixels) - 1, min(MOST_POINTS, len(pixels))).astype(int)
    rms = max(float(np.sqrt((left**2).sum(axis=1).mean())), 1e-9)
    ends = pixels + left * (ARROW * camera.width / (2.0 * rms))
    lines = [f"M{pixels[i, 0]:.1f} {pixels[i, 1]:.1f}L{ends[i, 0]:.1f} {ends[i, 1]:.1f}" for i in chosen]
    stroke = camera.width / 600.0
    path = f'<path d="{"".join(lines)}" stroke="#c2410c" stroke-width="{stroke:.2f}" fill="none"/>'
    return _svg(camera, path)


def _coverage(camera: RigCamera, boards: Sequence[Floats]) -> str:
    shapes = []
    for pixels in boards:
        hull = cv2.convexHull(pixels.astype(np.float32)).reshape(-1, 2)
        points = " ".join(f"{x:.0f},{y:.0f}" for x, y in hull)
        shapes.append(f'<polygon points="{points}"/>')
    style = f'fill="#2563eb" fill-opacity="0.12" stroke="#2563eb" stroke-width="{camera.width / 500.0:.2f}"'
    return _svg(camera, f"<g {style}>{''.join(shapes)}</g>")


def _svg(camera: RigCamera, inside: str) -> str:
    return f'<svg viewBox="0 0 {camera.width} {camera.height}">{inside}</svg>'


def _uncertainty_map(spread: Floats, shape: tuple[int, int], camera: RigCamera, title: str) -> str:
    """A heat map; its colours end at the 95th percentile, since corners of the picture go off."""
    values = spread.reshape(shape)
    top = max(float(np.nanpercentile(values, 95.0)), 1e-6) if np.isfinite(values).any() else 1.0
    share = np.nan_to_num(np.clip(values / top, 0.0, 1.0), nan=1.0)
    size = (WIDTH, max(1, round(WIDTH * camera.height / camera.width)))
    image = cv2.resize((255.0 * share).astype(np.uint8), size, interpolation=cv2.INTER_CUBIC)
    coloured = cv2.applyColorMap(image, cv2.COLORMAP_VIRIDIS)
    _, data = cv2.imencode(".png", coloured)
    inside = f'<img alt="{escape(title)}" src="data:image/png;base64,{base64.b64encode(data.tobytes()).decode()}">'
    middle = values[shape[0] // 2, shape[1] // 2]
    words = f"{title}: {middle:.3f} px in the middle, {np.nanmedian(values):.3f} px usually, yellow from {top:.3f} px"
    return _figure(inside, words)


def _figure(inside: str, words: str) -> str:
    return f"<figure>{inside}<figcaption>{escape(words)}</figcaption></figure>"


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{column}</th>" for column in columns)
    lines = "".join(
        "<tr>" + "".join(f"<td>{cell}</td>" for cell in [escape(row[0]), *row[1:]]) + "</tr>" for row in rows
    )
    return f"<table><tr>{head}</tr>{lines}</table>"


def _left_out(rig: Rig) -> str:
    if not rig.left_out:
        return "<h2>Left out</h2><p>Nothing.</p>"
    rows = [
        [note.get("camera", ""), escape(note.get("picture", "")), escape(note.get("reason", ""))]
        for note in rig.left_out
    ]
    return "<h2>Left out</h2>" + _table(["camera", "picture", "reason"], rows)
