"""How heavy the struts of a simulated print must be for it to sag as far as is wanted."""

from __future__ import annotations

import numpy as np

from frametwin.printing.material import PrintSettings
from frametwin.printing.sequence import PrintSequence
from frametwin.stiffness import FrameBeams
from frametwin.wireframe import Wireframe


def own_weight(frame: Wireframe, settings: PrintSettings) -> np.ndarray:
    """(E,) N/mm as the material has it."""
    return settings.material.weight * np.pi * frame.radius**2


def weight_scale(design: Wireframe, sequence: PrintSequence, settings: PrintSettings) -> float:
    """The factor on the weight with which a print sags as ``settings.sag`` says; 1 if that is ``None``.

    By the linear analysis of a print of the design in which every strut attaches and nothing is left to chance:
    it is found once for a frame and a sequence, and is the same for every seed and every plan.
    """
    if settings.sag is None:
        return 1.0
    furthest = float(np.linalg.norm(linear_drift(design, sequence, settings), axis=1).max())
    return settings.sag * design.extent / furthest if furthest > 0.0 else 1.0


def linear_drift(design: Wireframe, sequence: PrintSequence, settings: PrintSettings) -> np.ndarray:
    """(V, 3) mm that each joint moves from when it comes into being to the end, by the weight the material has."""
    pull = own_weight(design, settings)[:, None] * [0.0, 0.0, -1.0]
    seconds = float(np.mean(settings.seconds))
    laid = np.zeros(design.strut_count, dtype=bool)
    born, taken = np.zeros(design.strut_count), np.zeros(design.strut_count)
    drift = np.zeros((design.vertex_count, 3))
    clock = 0.0
    for batch in range(sequence.batch_count):
        for group in np.array_split(sequence.struts[sequence.batch == batch], settings.increments):
            before, clock = clock, clock + seconds * len(group)
            born[group] = before + seconds * np.arange(1, len(group) + 1)
            laid[group] = True
            middle = 0.5 * (np.maximum(before, born) + clock) - born
            stiffness = np.where(laid, settings.stiffness(settings.soft, np.maximum(middle, 0.0)), 1.0)
            load = np.where(laid, settings.weight_taken(clock - born) - taken, 0.0)
            taken = taken + load
            beams = FrameBeams.build(
                design.replace(printed=laid),
                stiffness,
                axial_scale=np.maximum(stiffness, settings.softest_axial),
                material=settings.material,
                load=load[:, None] * pull,
                pieces=settings.pieces,
            )
            drift += beams.solve()[:, :3]
    return drift
