"""How heavy the struts of a simulated print must be for it to sag as far as is wanted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.beams import factorise
from frametwin.mechanics.stiffness import FrameBeams
from frametwin.printing.process.material import USUAL_SPEED, PrintSettings
from frametwin.printing.records.sequence import PrintSequence

LEAST_FLOW = 1e-4
"""Of all the flow while hardening: what is taken for none, so that stiffnesses stay comparable."""


def own_weight(frame: Wireframe, settings: PrintSettings) -> np.ndarray:
    """(E,) array, N/mm: weight of each strut as the material has it."""
    return settings.material.weight * np.pi * frame.radius**2


DOWN = np.array([[0.0, 0.0, -1.0]])
"""Gravity alone, as directions of load for `linear_drift`."""


def weight_scale(design: Wireframe, sequence: PrintSequence, settings: PrintSettings) -> float:
    """Find the factor on the weight with which a print sags as ``settings.sag`` says; 1 if that is ``None``.

    By the linear analysis of a print of the design at the usual speed in which every strut attaches and nothing varies:
    it is found once for a frame and a sequence, and is the same for every seed and every plan.
    """
    if settings.sag is None:
        return 1.0
    drift = linear_drift(design, sequence, replace(settings, speed=USUAL_SPEED), DOWN).sum(axis=(0, 3))
    furthest = float(np.linalg.norm(drift, axis=1).max())
    return settings.sag * design.extent / furthest if furthest > 0.0 else 1.0


def linear_drift(design: Wireframe, sequence: PrintSequence, settings: PrintSettings, loads: np.ndarray) -> np.ndarray:
    """Find how far each joint drifts in each batch of a print of the design in which every strut attaches.

    Parameters
    ----------
    design, sequence, settings
        The print.
    loads : (K, 3) array
        Loads on the struts, as multiples of their weight; each acts alone.

    Returns
    -------
    (B, V, 3, K) array, mm
        0 for joints that are not there yet.
    """
    seconds = float(np.mean(settings.strut_seconds))
    laid = np.zeros(design.strut_count, dtype=bool)
    laid_at = np.zeros(design.strut_count)
    drift = np.zeros((sequence.batch_count, design.vertex_count, 3, len(loads)))
    clock = 0.0
    for batch in range(sequence.batch_count):
        groups = np.array_split(sequence.struts[sequence.batch == batch], settings.increments)
        for number, group in enumerate(groups, 1):
            before = clock
            laid[group], laid_at[group] = True, clock + seconds * (np.arange(len(group)) + 0.5)
            clock += seconds * len(group) + (settings.pause if number == len(groups) else 0.0)
            stiffness = np.ones(design.strut_count)
            stiffness[laid] = stiffness_between(settings, laid_at[laid], before, clock)
            drift[batch] += _creep(design.replace(printed=laid), stiffness, loads, settings)
    return drift


def _creep(frame: Wireframe, stiffness: np.ndarray, loads: np.ndarray, settings: PrintSettings) -> np.ndarray:
    """(V, 3, K) array, mm: how far the joints of the printed struts move under each of the loads (K, 3)."""
    weight, axial = own_weight(frame, settings), settings.axial * stiffness
    parts = [
        FrameBeams.build(
            frame,
            stiffness,
            axial_scale=axial,
            material=settings.material,
            load=weight[:, None] * load,
            pieces=settings.pieces,
        )
        for load in loads
    ]
    matrix = parts[0].stiffness()
    free = np.repeat(~frame.grounded, 6) & (matrix.diagonal() > 0.0)
    moved = np.zeros((6 * frame.vertex_count, len(loads)))
    if free.any():
        forces = np.stack([part.loads().ravel() for part in parts], axis=1)
        moved[free] = factorise(matrix[free][:, free].tocsc()).solve(forces[free])
    return moved.reshape(frame.vertex_count, 6, -1)[:, :3]


def stiffness_between(
    settings: PrintSettings, laid_at: np.ndarray, before: float, now: float, speed: np.ndarray | float = 1.0
) -> np.ndarray:
    """Find the stiffness of beams that bend as far as struts flow in some time.

    Parameters
    ----------
    settings
        See `PrintSettings`.
    laid_at : (N,) array, s
        When the struts were laid.
    before, now : float, s
        From when to when they flow.
    speed : (N,) array or float
        How fast each flows, relative to what is expected; see `ProcessVariation`.

    Returns
    -------
    (N,) array
        Relative to the hardened material.
    """
    flowed = speed * settings.flowed(np.maximum(before - laid_at, 0.0), np.maximum(now - laid_at, 0.0))
    stiffness: np.ndarray = 1.0 / np.maximum(flowed, LEAST_FLOW * settings.hot_flow)
    return stiffness
