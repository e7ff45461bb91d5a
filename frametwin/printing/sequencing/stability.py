"""How well joints are supported while a frame is built: a local compliance for the planner, the beam model as judge."""

from __future__ import annotations

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.stiffness import FrameBeams
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.removal_kernels import summed_compliance


def end_stiffness(frame: Wireframe) -> np.ndarray:
    """Find the stiffness of each strut's end against displacements while its other end is clamped.

    Along the strut E A / L, across it that of a cantilever, 3 E I / L^3, for round rods.

    Returns
    -------
    (E, 3, 3) array
        In units of the stiffness of a cantilever of median length and radius, so that Young's modulus plays no part.
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


def total_compliance(frame: Wireframe, struts: np.ndarray) -> np.ndarray:
    """Find how compliant the print is after each strut: the sum over its joints that are not on the plate.

    A joint at the end of a cantilever of median length counts 1, one on two struts about a half, one that three struts
    support in three directions next to nothing.

    Parameters
    ----------
    frame
        The design.
    struts : (N,) int64 array
        In the order in which they are laid.

    Returns
    -------
    (N,) array
    """
    return summed_compliance(frame.edges, frame.grounded, end_stiffness(frame), struts)


def batch_sag(frame: Wireframe, sequence: PrintSequence) -> np.ndarray:
    """Find the largest displacement of a joint under the hardened struts' own weight after each batch (beam model).

    Returns
    -------
    (B,) array, mm

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
