"""Under which joints temporary supports let a print sag least, by the beam model of a print that nothing corrects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.process.calibration import linear_drift
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.process.supports import supportable, supported_sequence, with_supports
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.given_order import GivenOrder, order_of_sequence
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.progress import Progress, ProgressCallback, report

LEAN = 0.1
"""Sideways pull as a share of the weight, in any direction: slender columns sway, and carry little then."""

TRIED = 16
"""Joints that are tried for each support, those that sag furthest."""

MOST_STEPS = 16
"""Into which the print is divided where joints are compared."""

WORTH = 0.98
"""Share of the sag that must be left at most: what helps less is not worth a column."""


def supported_frame(
    frame: Wireframe,
    sequence: PrintSequence,
    count: int,
    settings: OrderSettings,
    progress: ProgressCallback | None = None,
) -> tuple[Wireframe, GivenOrder]:
    """Add supports to a frame, and to its order.

    Parameters
    ----------
    frame, sequence
        The design and the order in which it is printed alone.
    count
        Columns at most; see `supports_for`.
    settings
        Of the tool; where contact is not allowed, no column is where the tool would touch it.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        See `supports_for`.
    """

    def printable(supported: Wireframe, order: PrintSequence) -> bool:
        try:
            plan_sequence(supported, settings, order_of_sequence(order, supported))
        except InputError:
            return False
        return True

    check = None if settings.allow_contact else printable
    supported, order = _with(frame, sequence, supports_for(frame, sequence, count, check, progress))
    return supported, order_of_sequence(order, supported, frame.name)


def supports_for(
    frame: Wireframe,
    sequence: PrintSequence,
    count: int,
    printable: Callable[[Wireframe, PrintSequence], bool] | None = None,
    progress: ProgressCallback | None = None,
) -> list[int]:
    """Choose joints to be supported, one after the other.

    Parameters
    ----------
    frame, sequence
        The design and its order.
    count
        Most joints that are chosen; fewer where no further one helps, or none has room below it.
    printable
        Whether the frame with its supports can be printed in an order; what cannot is passed over.
    progress
        Called before each; may cancel.

    Returns
    -------
    list of int
        Vertices, the most helpful first.

    Raises
    ------
    InputError
        If no joint has room for a column, none would help, or the tool cannot get past any.
    """
    joints: list[int] = []
    sag = _sag(frame, sequence, frame.vertex_count)
    while len(joints) < count:
        report(progress, Progress("placing supports", len(joints), count))
        room = np.flatnonzero(supportable(frame, joints))
        tried = []
        for joint in room[np.argsort(-sag[room], kind="stable")][:TRIED].tolist():
            supported = _with(frame, sequence, [*joints, joint])
            left = _sag(*supported, frame.vertex_count)
            tried.append((_worth(left), left, supported, joint))
        most = WORTH * _worth(sag)
        better = sorted((one for one in tried if one[0] < most), key=lambda one: one[0])
        chosen = next((one for one in better if printable is None or printable(*one[2])), None)
        if chosen is None:
            if not joints:
                raise InputError.at(frame.name, "supports", *_why_none(bool(len(room)), bool(better)))
            break
        _, sag, _, joint = chosen
        joints.append(joint)
    return joints


def _why_none(room: bool, better: bool) -> tuple[str, str]:
    """Why no joint is supported, and what to do: whether one has room for a column, and whether any would help."""
    if not room:
        return "no joint has room for a column below it", "print it without, slower or cooled"
    if not better:
        return "no column would let it sag less", "print it without, slower or cooled"
    return "the tool cannot get past a column below any joint that sags", "allow more tilt, or contact"


def _with(frame: Wireframe, sequence: PrintSequence, joints: list[int]) -> tuple[Wireframe, PrintSequence]:
    supported = with_supports(frame, joints)
    return supported, supported_sequence(sequence, supported, frame.strut_count)


def _worth(sag: np.ndarray) -> float:
    """What is to be made small: the fourth power mean of the sag (V,), which is that of the worst joints.

    The largest one alone would not fall before each of the equal parts of a symmetric frame has a column.
    """
    return float(np.mean(sag**4) ** 0.25)


def _sag(frame: Wireframe, sequence: PrintSequence, joints: int) -> np.ndarray:
    """(V,) array, mm: how far the first so many joints of a frame sag in a typical PLA, and sway by `LEAN`."""
    steps = min(MOST_STEPS, sequence.batch_count)
    coarse = replace(sequence, batch=sequence.batch * steps // sequence.batch_count, source="sequence")
    loads = np.array([[0.0, 0.0, -1.0], [LEAN, 0.0, 0.0], [0.0, LEAN, 0.0]])
    drift = linear_drift(frame, coarse, PrintSettings(increments=1), loads).sum(axis=0)[:joints]
    down, sideways = np.linalg.norm(drift[..., 0], axis=1), np.linalg.norm(drift[..., 1:], axis=(1, 2))
    return np.asarray(down + sideways)
