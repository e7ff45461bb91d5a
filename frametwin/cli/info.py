"""``frametwin info``: what a file or folder holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin.cli.common import (
    json_option,
    load_frame,
    print_facts,
    print_json,
)
from frametwin.wording import shortened, size_text

if TYPE_CHECKING:
    import numpy as np

    from frametwin.geometry.wireframe import Wireframe


@click.command("info", short_help="Say what a frame, a capture or a run holds.")
@click.argument("source", metavar="IN")
@json_option
def command(source: str, as_json: bool) -> None:
    """Check IN and say what it holds. IN is a frame in any format, a capture or a run.

    Loose struts are printed ones without a connection to the ground by printed struts; a simulation refuses
    them. Components are counted over all struts.

    \b
    Examples:
      frametwin info bridge
      frametwin info NodeFemur_wireframe.txt
      frametwin info CAPTURE --json
    """
    from frametwin.capture.views import has_cameras
    from frametwin.twin.runs import is_run

    path = Path(source)
    if is_run(path):
        data = _run(path)
    elif has_cameras(path):
        data = {**_capture(path), **_unit(path)}
    else:
        data = {"kind": "frame", **describe(load_frame(source)), **_unit(path)}
    if as_json:
        print_json(data)
    else:
        print_facts(f"{data['kind']}: {source}", _facts(data))


def describe(frame: Wireframe) -> dict[str, Any]:
    """What there is to say about a frame; lengths in mm."""
    return {
        "name": frame.name,
        "struts": frame.strut_count,
        "joints": frame.vertex_count,
        "printed": int(frame.printed.sum()),
        "grounded": int(frame.grounded.sum()),
        "components": frame.components()[0],
        "loose_struts": loose_struts(frame),
        "unused_joints": int((frame.degree == 0).sum()),
        "batches": len({int(batch) for batch in frame.batch}),
        "straight": frame.is_straight,
        "extent": frame.extent,
        "bounds": frame.bounds,
        "radius": _spread(frame.radius),
        "strut_length": _spread(frame.lengths),
    }


def loose_struts(frame: Wireframe) -> list[int]:
    """Printed struts without a connection to a grounded vertex by printed struts."""
    if not frame.printed.any():
        return []
    part, edge_ids, _ = frame.printed_part()
    _, labels = part.components()
    held = set(labels[part.grounded].tolist())
    return [
        int(strut)
        for strut, label in zip(edge_ids, labels[part.edges[:, 0]].tolist(), strict=True)
        if label not in held
    ]


def _unit(path: Path) -> dict[str, str]:
    """The unit of the file, where its lengths had to be converted."""
    from frametwin.formats import foreign_unit

    unit = foreign_unit(path)
    return {} if unit is None else {"unit_of_the_file": unit}


def _spread(values: np.ndarray) -> dict[str, float]:
    import numpy as np

    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}


def _capture(path: Path) -> dict[str, Any]:
    from frametwin.capture.capture import read_capture
    from frametwin.formats import defects_json

    capture = read_capture(path)
    sizes = sorted({(view.camera.height, view.camera.width) for view in capture.views})
    data = {
        "kind": "capture",
        "views": len(capture.views),
        "sizes": [size_text(*size) for size in sizes],
        "backgrounds": sum(view.background is not None for view in capture.views),
        "distorted_views": sum(view.camera.has_distortion for view in capture.views),
        "truth": capture.truth is not None,
    }
    if (path / defects_json.FILE_NAME).is_file():
        present = defects_json.read(path, capture.frame.printed)
        data["struts_missing"] = defects_json.to_dict(present, capture.frame.printed)["struts"].tolist()
    return {**data, **describe(capture.frame)}


def _run(path: Path) -> dict[str, Any]:
    from frametwin.twin.findings import missing_struts, uncertain_struts
    from frametwin.twin.runs import load_run

    twin, frame = load_run(path)
    return {
        "kind": "run",
        "preset": twin.provenance.get("preset"),
        "seed": twin.provenance.get("seed"),
        "made_by": twin.provenance.get("frametwin"),
        "seconds": twin.timing.get("total"),
        "loss": twin.loss[-1] if twin.loss else None,
        "kernels_per_strut": twin.thickness.shape[1],
        "missing": missing_struts(twin, frame.printed).tolist(),
        "uncertain": uncertain_struts(twin, frame.printed).tolist(),
        **describe(frame),
    }


_NAMES = {"made_by": "made by frametwin", "sizes": "picture sizes (width x height)", "batches": "print batches"}
_UNITS = {"extent": "mm", "seconds": "s"}


def _facts(data: dict[str, Any]) -> list[tuple[str, str]]:
    return [
        (_NAMES.get(key, key.replace("_", " ")), _text(key, value))
        for key, value in data.items()
        if key != "kind" and value is not None
    ]


def _text(key: str, value: Any) -> str:
    if key == "unit_of_the_file":
        return f"{value}, converted to mm"
    if key == "bounds":
        return ", ".join(
            f"{axis} {low:.4g} to {high:.4g}" for axis, low, high in zip("xyz", *value.tolist(), strict=True)
        ) + " mm"  # fmt: skip
    if isinstance(value, dict):
        low, middle, high = (f"{value[name]:.4g}" for name in ("min", "median", "max"))
        return f"{low} mm" if low == high else f"{low} to {high} mm, median {middle}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        if not value or isinstance(value[0], str):
            return ", ".join(value) or "none"
        return f"{len(value)} ({shortened(value)})"
    number = f"{value:.4g}" if isinstance(value, float) else str(value)
    return f"{number} {_UNITS[key]}" if key in _UNITS else number
