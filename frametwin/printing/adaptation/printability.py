"""Whether a frame will stand while it is printed, told before the robot moves.

The print is computed as it is planned, with what is known of the material. Where a strut would turn or stretch further
than its joints bear before the next ones hold it, the frame cannot be printed like that; what would help is found by
computing the print once more with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.material_fit import GLOBAL, GUESS, MaterialFit
from frametwin.printing.process.creep import PrintState

MOST_TURN, MOST_STRETCH = 30.0, 0.2
"""Degrees and share by which a strut may turn, and grow or shrink, after it was laid. Simulated joints tear at 45 and
0.25; the forecast is an estimate."""

Aiming = Callable[[MaterialFit], Wireframe]
"""The plan that the robot will follow, by what is known of the material and of the speed; nothing is printed yet."""


@dataclass(frozen=True)
class Fall:
    """The first strut of a planned print that would not hold.

    Attributes
    ----------
    strut, batch
        Which, and while which batch is laid.
    reason
        ``"buckling"`` where it gives way under what it carries, ``"sag"`` where it goes down by its own weight.
    moved
        How far its end that moves most has gone by then, in mm.
    remedy
        What would help, in words.
    """

    strut: int
    batch: int
    reason: str
    moved: float
    remedy: str

    @property
    def problem(self) -> str:
        """In words, for a sentence that begins with the frame."""
        way = "would buckle under what it carries" if self.reason == "buckling" else "would sag away"
        return f"cannot be printed like that: strut {self.strut} {way}, by {self.moved:.0f} mm in batch {self.batch}"


def first_fall(fit: MaterialFit, aimed: Aiming, batches: Sequence[np.ndarray]) -> Fall | None:
    """Find the first strut that would not hold while a plan is printed; ``None`` if all do.

    Parameters
    ----------
    fit
        What is known of the material.
    aimed
        See `Aiming`: what would help is aimed anew.
    batches
        Struts of each batch, in order.
    """
    plan = aimed(fit)
    found = _fall(fit, plan, plan.grounded, batches)
    if found is None:
        return None
    strut, batch, joint, movement = found
    moved = float(np.linalg.norm(movement))
    reason = "buckling" if -movement[2] < 0.5 * moved else "sag"
    most = float(plan.lengths[strut])  # linear beams that fall go anywhere
    return Fall(strut, batch, reason, min(moved, most), _remedy(fit, aimed, batches, joint))


@dataclass(frozen=True)
class Outlook:
    """Whether a print would stand in a material of which nothing is known but that it is a usual one.

    Attributes
    ----------
    typical, soft
        The first strut that would not hold in a typical PLA, and in one whose struts are `SOFT` times as heavy for
        their stiffness, which is how far the guess may be wrong; ``None`` where all do.
    """

    typical: Fall | None
    soft: Fall | None

    @property
    def sentence(self) -> str:
        """What to tell the user."""
        if self.typical is not None:
            return f"in a typical PLA the frame {self.typical.problem}; {self.typical.remedy}"
        if self.soft is not None:
            return f"stands in a typical PLA; in one {SOFT:.1f} times as soft the frame {self.soft.problem}"
        return f"stands in a typical PLA, and in one {SOFT:.1f} times as soft"

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        falls = {"typical": self.typical, "soft": self.soft}
        return {name: None if fall is None else asdict(fall) for name, fall in falls.items()}


SOFT = float(np.exp(GUESS.deviation[0]))
"""Standard deviation of a guessed material's weight over stiffness, as a factor."""

OUTLOOK_STEPS = 24
"""Most steps into which a print is divided for an outlook."""


def outlook(fit: MaterialFit, plan: Wireframe, batches: Sequence[np.ndarray]) -> Outlook:
    """Compute a print in a guessed material, and in one that is softer by as much as the guess may be wrong.

    Parameters
    ----------
    fit
        Of a guess.
    plan
        As the robot will follow it, nothing being printed yet.
    batches
        Struts of each batch, in order; of many, some are computed together.
    """
    groups = np.array_split(np.arange(len(batches)), min(len(batches), OUTLOOK_STEPS))
    steps = [np.concatenate([batches[k] for k in group.tolist()]) for group in groups]
    values = np.array(fit.values)
    values[0] += np.log(SOFT)
    falls = []
    for one in (fit, replace(fit, values=values)):
        fall = first_fall(one, lambda _: plan, steps)
        falls.append(None if fall is None else replace(fall, batch=int(groups[fall.batch][0])))
        if fall is not None:
            break
    return Outlook(falls[0], falls[-1])


def _remedy(fit: MaterialFit, aimed: Aiming, batches: Sequence[np.ndarray], joint: int) -> str:
    """What would let the print stand: to print slower, cooling, a prop, a prop with one of these, or nothing."""
    ways = {
        "print at half the speed": _slower(fit),
        "cool so that struts harden in half the time": _cooled(fit),
    }
    plans = {words: aimed(one) for words, one in ways.items()}
    grounded = fit.model.design.grounded
    held = grounded.copy()
    held[joint] = True

    def standing(feet: np.ndarray) -> str:
        return ", or ".join(words for words, one in ways.items() if _fall(one, plans[words], feet, batches) is None)

    prop = f"put a temporary prop under joint {joint} (or try supports)"
    if words := standing(grounded):
        return words
    if _fall(fit, aimed(fit), held, batches) is None:
        return prop
    if words := standing(held):
        return f"{words}, and {prop}"
    return "take thicker or shorter struts there, try supports or more of them, or print the frame in parts"


def _slower(fit: MaterialFit) -> MaterialFit:
    """At half the speed of the nozzle."""
    settings = fit.model.settings
    return replace(fit, model=replace(fit.model, settings=replace(settings, speed=0.5 * settings.speed)))


def _cooled(fit: MaterialFit) -> MaterialFit:
    """Cooled so that struts harden in half the time."""
    values = fit.values.copy()
    values[GLOBAL.index("hardening")] -= np.log(2.0)
    return replace(fit, values=values)


def _fall(
    fit: MaterialFit, plan: Wireframe, held: np.ndarray, batches: Sequence[np.ndarray]
) -> tuple[int, int, int, np.ndarray] | None:
    """The first strut that turns or stretches too far, the batch, its joint that moves most, and that movement (3,)."""
    model = replace(fit.model, design=fit.model.design.replace(grounded=held))
    count = plan.strut_count
    state = PrintState.before(plan.replace(printed=[False] * count, grounded=held), np.zeros(count), 0.0)
    chords = plan.vertices[plan.edges[:, 1]] - plan.vertices[plan.edges[:, 0]]
    laid_as = chords.copy()
    for batch, struts in enumerate(batches):
        now = state.points[plan.edges[struts]]
        laid_as[struts] = now[:, 1] - now[:, 0]
        state = model.after(state, struts, fit.parameters)
        chord = state.points[plan.edges[:, 1]] - state.points[plan.edges[:, 0]]
        turn = np.degrees(
            np.arctan2(np.linalg.norm(np.cross(laid_as, chord), axis=1), np.einsum("ex,ex->e", laid_as, chord))
        )
        stretch = np.abs(np.linalg.norm(chord, axis=1) / np.linalg.norm(laid_as, axis=1) - 1.0)
        share = np.where(state.laid, np.maximum(turn / MOST_TURN, stretch / MOST_STRETCH), 0.0)
        share[~np.isfinite(share)] = np.inf
        if share.max() > 1.0:
            strut = int(np.argmax(share))
            ends = plan.edges[strut]
            moved = state.points[ends] - plan.vertices[ends]
            far = int(np.argmax(np.linalg.norm(moved, axis=1)))
            return strut, batch, int(ends[far]), moved[far]
    return None
