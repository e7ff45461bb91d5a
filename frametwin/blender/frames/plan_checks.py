"""What is wrong with a plan, in words, and which struts are to blame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from frametwin.blender.frames.curves import strut_numbers
from frametwin.blender.frames.welding import weld
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe


@dataclass(frozen=True)
class PlanProblem:
    """A fault of a plan.

    Attributes
    ----------
    kind : ``nothing_grounded``, ``floating``, ``separate``, ``short`` or ``doubled``.
    sentence : What is wrong, in words.
    struts : Rising indices of the struts that are to blame.
    """

    kind: str
    sentence: str
    struts: tuple[int, ...]


def plan_problems(frame: Wireframe) -> tuple[PlanProblem, ...]:
    """Find what would keep a frame from being printed as drawn; one problem of each kind, none in a sound frame.

    Parts that hang in the air, parts that stand by themselves, struts shorter than they are thick, and struts drawn
    twice (ends and middles not further apart than the radius).
    """
    return tuple(_parts(frame) + _short(frame) + _doubled(frame))


def _parts(frame: Wireframe) -> list[PlanProblem]:
    count, labels = frame.components()
    part = labels[frame.edges[:, 0]]  # (E,)
    stands = np.zeros(count, dtype=bool)
    stands[labels[frame.grounded & (labels >= 0)]] = True
    size = np.bincount(part, minlength=count)
    problems = []
    if not stands.any():
        sentence = "No strut stands on the base: mark the joints that do, or move the frame down."
        problems.append(_problem("nothing_grounded", sentence, np.ones(frame.strut_count, dtype=bool)))
    elif not stands.all():
        hang = ~stands[part]
        sentence = (
            f"{_struts(hang)} hanging in the air: {_number(int((~stands).sum()), 'part')} without a way to the base."
        )
        problems.append(_problem("floating", sentence, hang))
    main = int(np.argmax(np.where(stands, size, 0))) if stands.any() else int(np.argmax(size))
    apart = (part != main) & (stands[part] | ~stands.any())
    if apart.any():
        parts = len(np.unique(part[apart]))
        sentence = f"{_struts(apart)} not joined to the rest: {_number(parts, 'part')} apart from the largest one."
        problems.append(_problem("separate", sentence, apart))
    return problems


def _short(frame: Wireframe) -> list[PlanProblem]:
    short = frame.lengths < 2.0 * frame.radius
    return [_problem("short", f"{_struts(short)} shorter than thick.", short)] if short.any() else []


def _doubled(frame: Wireframe) -> list[PlanProblem]:
    radius = float(frame.radius.min())
    joints = weld(frame.control_points[:, [0, 3]].reshape(-1, 3), 0.5 * radius).reshape(-1, 2)
    # Joint numbers tell apart struts between other joints; the middles, bent struts between the same ones.
    _, pair = np.unique(np.sort(joints, axis=1), axis=0, return_inverse=True)
    middle = weld(bezier.evaluate(frame.control_points, [0.5])[:, 0], radius)
    _, group = np.unique(np.stack([pair.ravel(), middle], axis=1), axis=0, return_inverse=True)
    twice = np.bincount(group.ravel())[group.ravel()] > 1
    return [_problem("doubled", f"{_struts(twice)} drawn more than once in one place.", twice)] if twice.any() else []


def _problem(kind: str, sentence: str, mask: np.ndarray) -> PlanProblem:
    return PlanProblem(kind, sentence, tuple(np.flatnonzero(mask).tolist()))


def _number(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _struts(mask: np.ndarray) -> str:
    count = int(mask.sum())
    return f"{_number(count, 'strut')} {'is' if count == 1 else 'are'}"


def select_struts(obj: bpy.types.Object, struts: Iterable[int]) -> int:
    """Select exactly these struts of a frame's curve object, to be seen in Edit Mode; from there or Object Mode.

    Returns
    -------
    How many were found; those that the user deleted are not.

    Raises
    ------
    InputError
        If the object is not a curve that can be read.
    """
    chosen = np.isin(strut_numbers(obj), np.fromiter(struts, dtype=np.int64))
    if len(chosen) != len(obj.data.splines):  # splines of several segments: select none of them
        chosen = np.zeros(len(obj.data.splines), dtype=bool)
    for spline, on in zip(obj.data.splines, chosen.tolist(), strict=True):
        points = spline.bezier_points
        if on:
            spline.hide = False
            points.foreach_set("hide", np.zeros(len(points), dtype=bool))
        flags = np.full(len(points), on, dtype=bool)
        for name in ("select_control_point", "select_left_handle", "select_right_handle"):
            points.foreach_set(name, flags)
    obj.data.update_tag()
    return int(chosen.sum())
