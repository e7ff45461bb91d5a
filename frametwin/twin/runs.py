"""Run folders and what to compare them with: reading, summing up, and refusing to write over something else."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.capture.capture_checks import check_truth
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.formats import defects_json, frame_json, read_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.findings import missing_struts, uncertain_struts
from frametwin.twin.twin import Twin, read_twin


def load_run(path: Path) -> tuple[Twin, Wireframe]:
    """Read a run folder, or its ``twin.json``: the twin, and the plan that it is a twin of.

    Raises
    ------
    InputError
        If a file is missing or damaged, or the two do not belong together.
    """
    twin = read_twin(path)
    frame = frame_json.read((path if path.is_dir() else path.parent) / "frame.json")
    twin.as_wireframe(frame)  # refuses a twin of another frame
    return twin, frame


def is_run(path: Path) -> bool:
    """Whether a path is that of a run folder or of its ``twin.json``."""
    return path.name == "twin.json" or (path / "twin.json").is_file()


@dataclass(frozen=True, eq=False)
class Truth:
    """The real geometry, and (E, 2) at which intervals its struts exist, where that is known."""

    frame: Wireframe
    present: np.ndarray | None


def read_truth(path: Path, plan: Wireframe) -> Truth:
    """Read the truth of a capture, or a frame file; what is printed is as in ``plan``.

    Raises
    ------
    InputError
        If there is none, it is damaged, or it is not the truth of ``plan``.
    """
    file = path / "truth.json" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        remedy = "give a capture that was simulated, or the frame file of the real geometry"
        raise InputError.at(path, "truth.json", "is missing, so the truth is not known", remedy)
    truth = read_frame(file)
    check_truth(truth, plan, file)
    defects = file.parent / defects_json.FILE_NAME
    known = file.name == "truth.json" and defects.is_file()
    present = defects_json.read(defects, plan.printed) if known else None
    return Truth(truth.replace(printed=plan.printed), present)


def fit_summary(twin: Twin, frame: Wireframe) -> dict[str, Any]:
    """What a fit found, as for a JSON file."""
    missing = missing_struts(twin, frame.printed)
    uncertain = uncertain_struts(twin, frame.printed)
    return {
        "frame": frame.name,
        "struts": frame.strut_count,
        "printed": int(frame.printed.sum()),
        "missing": [{"strut": int(i), "completeness": float(twin.completeness[i])} for i in missing],
        "uncertain": [{"strut": int(i), "confidence": float(twin.confidence[i])} for i in uncertain],
        "verdict": {"status": twin.verdict.status, "reasons": list(twin.verdict.reasons)},
        "sigma": None if twin.sigma_across is None else float(np.median(twin.sigma_across[frame.printed])),
        "views_left_out": [view["name"] for view in twin.views if not view["used"]],
        "loss": twin.loss[-1] if twin.loss else None,
        "seconds": float(twin.timing.get("total", 0.0)),
        "timing": dict(twin.timing),
    }


def require_free(
    folder: PathLike, overwrite: bool, mark: str, field: str = "out", way: str = "allow overwriting"
) -> None:
    """Refuse an output folder before the work begins, and not only when its result is written.

    Parameters
    ----------
    folder
        The folder to be.
    overwrite
        Whether it may be replaced.
    mark
        The file that shows that the folder is of the same kind. Other folders are never replaced, lest a slip of the
        finger deletes somebody's work.
    field
        What to call the folder in messages.
    way
        How overwriting is allowed, for messages.

    Raises
    ------
    InputError
        If there is a file, or a folder with something in it that may not be replaced, or no place to write.
    """
    path = Path(folder)
    above = next(parent for parent in (path, *path.absolute().parents) if parent.exists())
    if not above.is_dir():
        problem = "is the name of a file" if above == path else f"lies below the file {above}"
        raise InputError.at(path, field, problem, "choose another name for the folder")
    if not os.access(above, os.W_OK):
        raise InputError.at(path, field, "cannot be written", "choose a place that is writable")
    if not path.is_dir() or not any(path.iterdir()):
        return
    if not overwrite:
        raise InputError.at(path, field, "exists and is not empty", f"choose another folder, or {way}")
    if not (path / mark).is_file():
        raise InputError.at(path, field, f"holds something else (there is no {mark})", "choose another folder")
