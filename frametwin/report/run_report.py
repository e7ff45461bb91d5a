"""The report of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from frametwin.capture.capture import Capture, read_capture
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback
from frametwin.report.scene import Scene
from frametwin.report.twin_content import add_pictures, errors_of, twin_content
from frametwin.twin.runs import Truth, load_run, read_truth
from frametwin.twin.twin import Twin

WIDTH = 1000
"""Of a view in pixels, at the most."""


def run_content(
    run: Path, capture: Path | None = None, truth: Path | None = None, progress: ProgressCallback | None = None
) -> dict[str, Any]:
    """What the page of a run shows.

    Parameters
    ----------
    run
        Its folder, or its ``twin.json``.
    capture
        The pictures that it was made from.
    truth
        A frame file of the real geometry; that of the capture, where it has one, by default.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        If something is damaged, or does not belong to the run.
    """
    twin, frame = load_run(run)
    taken = None if capture is None else _capture(capture, twin, frame)
    known = _truth(frame, taken, truth)
    errors = errors_of(twin, known)
    scene = Scene.of_twin(frame.name, frame, twin, errors)
    told = twin_content(scene, twin, errors, None if known is None else known.frame)
    if taken is not None:
        add_pictures(told, scene, taken, WIDTH, crops=True, progress=progress)
    made = twin.provenance
    return {
        "kind": "run",
        "title": frame.name,
        "facts": {
            "struts": frame.strut_count,
            "printed": int(frame.printed.sum()),
            "preset": made.get("preset"),
            "seed": made.get("seed"),
            "made by": None if made.get("frametwin") is None else f"frametwin {made['frametwin']}",
        },
        "scenes": [told],
    }


def _capture(folder: Path, twin: Twin, frame: Wireframe) -> Capture:
    """The capture of a run; refused where it holds other pictures than the run was made from."""
    taken = read_capture(folder, frame)
    made_from = twin.provenance.get("inputs")
    hashes = dict(made_from) if isinstance(made_from, dict) else {}
    for name, digest in taken.hashes.items():
        if name in hashes and hashes[name] != digest:
            raise InputError.at(
                folder / name, "file", "is not the one that the run was made from", "give the capture of the run"
            )
    return taken


def _truth(frame: Wireframe, capture: Capture | None, given: Path | None) -> Truth | None:
    if given is not None:
        return read_truth(given, frame)
    return None if capture is None or capture.truth is None else read_truth(capture.root, frame)
