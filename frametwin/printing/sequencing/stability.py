"""How well joints are held while a frame is built: a local measure for the planner, the beam model as judge."""

from __future__ import annotations

import numba as nb
import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.stiffness import FrameBeams
from frametwin.printing.records.sequence import PrintSequence

SOFTEST = 100.0
"""Greatest flexibility that a joint is given; one held by nothing at all counts as no joint."""


def end_stiffness(frame: Wireframe) -> np.ndarray:
    """(E, 3, 3) stiffness of each strut's end against displacements while its other end is clamped.

    Along the strut E A / L, across it that of a cantilever, 3 E I / L^3, for round rods; in units of the stiffness of a
    cantilever of median length and radius, so that Young's modulus plays no part.
    """
    chord = frame.control_points[:, 3] - frame.control_points[:, 0]
    length = np.linalg.norm(chord, axis=1)
    tangent = chord / length[:, None]
    radius, unit = frame.radius, float(np.median(frame.radius)) ** 4 / float(np.median(length)) ** 3
    across = radius**4 / length**3 / unit
    along = 4.0 / 3.0 * radius**2 / length / unit
    outer = tangent[:, :, None] * tangent[:, None, :]
    result: np.ndarray = along[:, None, None] * outer + across[:, None, None] * (np.eye(3) - outer)
    return result


@nb.njit(cache=True, error_model="numpy")
def flexibility(k: np.ndarray) -> float:
    """Greatest displacement of a joint under a unit force, from its stiffness (3, 3); 0 for one that holds nothing."""
    q = (k[0, 0] + k[1, 1] + k[2, 2]) / 3.0
    if q <= 1e-12:
        return 0.0
    off = k[0, 1] ** 2 + k[0, 2] ** 2 + k[1, 2] ** 2
    a, b, c = k[0, 0] - q, k[1, 1] - q, k[2, 2] - q
    p = np.sqrt((a * a + b * b + c * c + 2.0 * off) / 6.0)
    if p <= 1e-9 * q:
        return min(SOFTEST, 1.0 / q)
    d = a * (b * c - k[1, 2] ** 2) - k[0, 1] * (k[0, 1] * c - k[1, 2] * k[0, 2])
    d += k[0, 2] * (k[0, 1] * k[1, 2] - b * k[0, 2])
    angle = np.arccos(min(1.0, max(-1.0, d / (2.0 * p**3)))) / 3.0
    least = q + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)  # of the three eigenvalues (Smith, CACM 4(4), 1961)
    return min(SOFTEST, 1.0 / max(least, 1.0 / SOFTEST))


def looseness(frame: Wireframe, struts: np.ndarray) -> np.ndarray:
    """(N,) sum of the joints' flexibility after each of ``struts`` (N,) was laid, grounded joints left out.

    A joint at the end of a cantilever of median length counts 1, one on two struts about a half, one that three struts
    hold in three directions next to nothing.
    """
    return _looseness(frame.edges, frame.grounded, end_stiffness(frame), struts)


@nb.njit(cache=True, error_model="numpy")
def _looseness(edges: np.ndarray, grounded: np.ndarray, stiffness: np.ndarray, struts: np.ndarray) -> np.ndarray:
    held = np.zeros((len(grounded), 3, 3))
    result = np.zeros(len(struts))
    total = 0.0
    for n in range(len(struts)):
        for vertex in edges[struts[n]]:
            if not grounded[vertex]:
                total -= flexibility(held[vertex])
                held[vertex] += stiffness[struts[n]]
                total += flexibility(held[vertex])
        result[n] = total
    return result


def batch_sag(frame: Wireframe, sequence: PrintSequence) -> np.ndarray:
    """(B,) largest displacement of a joint in mm under the hardened struts' own weight, after each batch (beam model).

    Raises
    ------
    InputError
        If the sequence is not one of this frame.
    """
    sequence.end_in(frame)
    result = np.zeros(sequence.batch_count)
    for batch in range(sequence.batch_count):
        stands = frame.replace(printed=sequence.laid_before(batch + 1, frame.strut_count))
        joints = FrameBeams.build(stands).solve()
        result[batch] = np.linalg.norm(joints[:, :3], axis=1).max()
    return result
