"""What a simulated print came to, batch by batch and in the end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.evaluation.evaluate import evaluate
from frametwin.geometry.wireframe import Wireframe


@dataclass(frozen=True, eq=False)
class BatchOutcome:
    """What a batch came to.

    Attributes
    ----------
    batch
        Its number.
    laid : (N,) int64 array
        Struts that the robot laid.
    attached : (A,) int64 array
        Those of them that stand in the end.
    hanging : (H,) int64 array
        Those of all standing struts whose far end missed its joint.
    lost : (L,) int64 array
        All struts laid so far that do not stand: never attached, torn off, or fallen with what supported them.
    standing
        Number of struts that stand.
    e_max
        Largest distance in mm of a point of a standing strut from where the design has it, at equal parameter.
    collapsed
        See `PrintSettings.collapse_share`; once true it stays so.
    seconds
        That the robot took for the batch.
    """

    batch: int
    laid: np.ndarray
    attached: np.ndarray
    hanging: np.ndarray
    lost: np.ndarray
    standing: int
    e_max: float
    collapsed: bool
    seconds: float


@dataclass(frozen=True, eq=False)
class Standing:
    """What stands of a print.

    Attributes
    ----------
    frame
        The design's struts and joints where they really are. ``printed`` marks the struts that stand and end on
        their joints; the others are drawn between where their joints are, for want of better.
    pictured
        Every strut that stands, also those that hang free at one end: what a camera sees.
    """

    frame: Wireframe
    pictured: Wireframe

    @property
    def present(self) -> np.ndarray:
        """(E, 2) array: interval of the curve parameter at which each strut of ``frame`` is there."""
        return np.where(self.frame.printed[:, None], [0.0, 1.0], 0.0)


@dataclass(frozen=True)
class PrintReport:
    """What the whole print came to.

    Attributes
    ----------
    completed
        Every strut stands on both its joints, and the print never collapsed.
    collapsed_at_batch
        The first batch after which it had, or ``None``.
    e_max
        In mm, after each batch.
    attached, lost
        Numbers of struts after each batch: of its own that stand, and of all so far that do not.
    seconds
        Of printing, by batch.
    mean_deviation
        In mm: mean distance between the curves that stand and those of the same struts in the design, both ways
        (`frametwin.evaluation.evaluate.Errors.curves`).
    """

    completed: bool
    collapsed_at_batch: int | None
    e_max: tuple[float, ...]
    attached: tuple[int, ...]
    lost: tuple[int, ...]
    seconds: tuple[float, ...]
    mean_deviation: float

    @classmethod
    def of(
        cls, design: Wireframe, outcomes: list[BatchOutcome], standing: Standing, judged: np.ndarray | None = None
    ) -> PrintReport:
        """Sum up the batches that were laid, at least one, and what stands after them.

        ``judged`` (E,) are the struts by which the print is judged; all by default.
        """
        collapsed = [outcome.batch for outcome in outcomes if outcome.collapsed]
        frame = standing.frame
        if judged is not None:
            design, frame = (one.subset(judged)[0] for one in (design, frame))
        return cls(
            completed=not collapsed and bool(frame.printed.all()),
            collapsed_at_batch=collapsed[0] if collapsed else None,
            e_max=tuple(outcome.e_max for outcome in outcomes),
            attached=tuple(len(outcome.attached) for outcome in outcomes),
            lost=tuple(len(outcome.lost) for outcome in outcomes),
            seconds=tuple(outcome.seconds for outcome in outcomes),
            mean_deviation=mean_deviation(design, frame),
        )


def mean_deviation(design: Wireframe, frame: Wireframe) -> float:
    """Mean distance in mm between the printed curves of ``frame`` and those of the design, both ways; NaN for none."""
    if not frame.printed.any():
        return float("nan")
    return evaluate(design.control_points, design.vertices, frame).curves.mean
