"""What became of a print job, batch by batch, for those who look at it: read without anything heavy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.records.sequence_file import read_sequence

FORMAT, VERSION = "frametwin-print-job", 1


@dataclass(frozen=True, eq=False)
class BatchHistory:
    """A batch that was printed and answered.

    Attributes
    ----------
    batch
        Its number.
    planned
        The plan that the robot followed, ``printed`` marking what stood before.
    standing
        What stood afterwards, ``printed`` marking it: of a simulation the real geometry, else the twin.
    adapted
        The plan for what follows, ``printed`` marking what stands.
    laid : (N,) int64 array
        Struts of the batch.
    missed : (M,) int64 array
        Those of them that would have been begun beside the material had they been laid as designed: further from it
        than a bead, which is the strut's diameter.
    lost : (L,) int64 array
        Struts laid so far that do not stand.
    collapsed
        Whether the print has collapsed, where that is known.
    """

    batch: int
    planned: Wireframe
    standing: Wireframe
    adapted: Wireframe
    laid: np.ndarray
    missed: np.ndarray
    lost: np.ndarray
    collapsed: bool


@dataclass(frozen=True, eq=False)
class PrintHistory:
    """A print job: its design, whether plans were moved to meet the twin, and the batches so far."""

    name: str
    design: Wireframe
    adapts: bool
    batches: tuple[BatchHistory, ...]

    @property
    def largest_displacement(self) -> float:
        """Of any joint of what stands, from the design, in mm; the upper end of a range for all batches."""
        return max(
            (float(joint_displacement(self.design, batch.standing).max()) for batch in self.batches), default=0.0
        )


def joint_displacement(design: Wireframe, standing: Wireframe) -> np.ndarray:
    """Find how far the joints of what stands are from the design: (V,) in mm, 0 where nothing stands."""
    moved = np.linalg.norm(standing.vertices[: design.vertex_count] - design.vertices, axis=1)
    return np.where(standing.printed_vertices()[: design.vertex_count], moved, 0.0)


def read_history(folder: PathLike, progress: Callable[[int], None] | None = None) -> PrintHistory:
    """Read a job's folder.

    Parameters
    ----------
    folder
        As ``frametwin print plan`` or ``frametwin print simulate`` make it.
    progress
        Told how many batches have been read.

    Raises
    ------
    InputError
        If it is no job, no batch of it has been answered, or a file is damaged.
    """
    root = Path(folder)
    if not (root / "job.json").is_file():
        raise InputError.at(root, "job.json", "is missing, so this is no print job", "give the folder of a job")
    job = read_json(root / "job.json")
    check_format(job, root / "job.json", FORMAT, VERSION)
    design = frame_json.read(root / "design.json")
    sequence = read_sequence(root / "sequence.json")
    batches: list[BatchHistory] = []
    before: Wireframe | None = None
    while (root / "batches" / f"{len(batches):03d}" / "report.json").is_file():
        inside = root / "batches" / f"{len(batches):03d}"
        batch = _read_batch(inside, len(batches), design, sequence, before)
        batches.append(batch)
        before = batch.standing
        if (inside / "sequence.json").is_file():
            sequence = read_sequence(inside / "sequence.json")
        if progress is not None:
            progress(len(batches))
    if not batches:
        raise InputError.at(root, "batches", "none has been answered", "answer the first one by frametwin print next")
    settings = job.get("settings")
    adapts = bool(settings.get("adapt", True)) if isinstance(settings, dict) else True
    return PrintHistory(str(job.get("name", root.name)), design, adapts, tuple(batches))


def _read_batch(
    folder: Path, number: int, design: Wireframe, sequence: PrintSequence, before: Wireframe | None
) -> BatchHistory:
    report = read_json(folder / "report.json")
    outcome = read_json(folder / "outcome.json") if (folder / "outcome.json").is_file() else report
    adapted = frame_json.read(folder / "adapted.json")
    real = folder / "standing.json"
    laying = sequence.in_batch(number)
    return BatchHistory(
        batch=number,
        planned=frame_json.read(folder / "plan.json"),
        standing=frame_json.read(real) if real.is_file() else adapted,
        adapted=adapted,
        laid=laying.struts,
        missed=laying.struts[_misses(design, laying, before)],
        lost=_indices(outcome, "lost", design.strut_count, folder),
        collapsed=outcome.get("collapsed") is True,
    )


def _misses(design: Wireframe, laying: PrintSequence, before: Wireframe | None) -> np.ndarray:
    """(N,) whether a strut laid as designed would begin further than a bead from the material at its start."""
    if before is None:
        return np.zeros(len(laying), dtype=bool)
    gap = joint_displacement(design, before)[laying.start]
    return np.asarray(gap > 2.0 * design.radius[laying.struts])


def _indices(data: dict[str, Any], field: str, count: int, folder: Path) -> np.ndarray:
    values = data.get(field, [])
    fine = isinstance(values, list) and all(type(value) is int and 0 <= value < count for value in values)
    if not fine:
        raise InputError.at(folder, field, "is not a list of struts of the design", "simulate the job again")
    return np.array(values, dtype=np.int64)
