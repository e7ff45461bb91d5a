"""What the twin of a batch tells of the next: where its cameras are, what material joints have, what is not bent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.cameras import Camera
from frametwin.fields.base import DeformationField
from frametwin.fitting.camera_corrections import freedoms_of
from frametwin.fitting.judgement import WHOLE
from frametwin.fitting.known_start import KnownStart
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.twin import Twin

LARGER = 1.01
"""Size of joints, relative to their thickest strut's, from which a twin says that they have material of their own."""


def start_after(twin: Twin, field: DeformationField, frame: Wireframe, cameras: Sequence[Camera]) -> KnownStart:
    """From where a fit starts after the twin of the batch before.

    Parameters
    ----------
    twin : Twin
        Of that batch. Where it took its cameras as exact, they are not free from the first step on.
    field : DeformationField
        From the plan of this batch to where the print is expected.
    frame : Wireframe
        That plan, ``printed`` marking what is printed by now.
    cameras : sequence of Camera
        N, without distortion.
    """
    known = freedoms_of(cameras, twin.cameras) if twin.cameras else None
    return KnownStart(field, known, _joint_size(frame, twin), _cubic(frame, twin))


def _cubic(frame: Wireframe, twin: Twin) -> np.ndarray:
    """(K,) struts, counted among those that are printed by now, which the twin saw whole and did not find bent."""
    struts = np.flatnonzero(frame.printed)
    return np.flatnonzero((twin.completeness[struts] >= WHOLE) & ~np.isin(struts, list(twin.bent)))


def _joint_size(frame: Wireframe, twin: Twin) -> np.ndarray | None:
    """The sizes as the twin has them; joints of which it does not know yet are like the typical one."""
    if twin.joint_radius is None:
        return None
    printed, struts, joints = frame.printed_part()
    thickest, radius = np.zeros(len(joints)), np.median(twin.thickness[struts], axis=1)
    np.maximum.at(thickest, printed.edges, np.repeat(radius[:, None], 2, axis=1))
    found = twin.joint_radius[joints]
    known = (found > 0.0) & (thickest > 0.0)
    size = found[known] / thickest[known]
    if not len(size) or float(np.median(size)) < LARGER:
        return None
    result = np.full(len(joints), float(np.median(size)))
    result[known] = size
    return result
