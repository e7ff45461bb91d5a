"""Curves of a higher degree, of struts that are bent as no cubic can be, in a twin and in its file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.geometry import bezier

FIELD = "bent"

LOWEST, HIGHEST = 4, 30
"""Degrees of such curves."""


def checked_bent(bent: Any, struts: int, source: str) -> dict[int, np.ndarray]:
    """The curves (n + 1, 3) by strut, in mm, as read-only arrays.

    Raises
    ------
    InputError
        If one is of another shape or not finite, or of a strut that is not among the ``struts``.
    """
    if not isinstance(bent, Mapping):
        raise InputError.at(source, FIELD, "is not a mapping of struts to curves", "give {strut: control points}")
    result = {}
    for strut, points in bent.items():
        if isinstance(strut, bool) or not isinstance(strut, int | np.integer) or not 0 <= strut < struts:
            raise InputError.at(source, FIELD, f"names strut {strut!r:.40}", f"give a number from 0 to {struts - 1}")
        where = f"{FIELD} of strut {strut}"
        curve = checked_array(points, "f", (None, 3), source, where)
        if not LOWEST <= len(curve) - 1 <= HIGHEST:
            raise InputError.at(source, where, f"has {len(curve)} points", f"give {LOWEST + 1} to {HIGHEST + 1}")
        curve.setflags(write=False)
        result[int(strut)] = curve
    return result


def curves_with(control_points: np.ndarray, bent: Mapping[int, np.ndarray]) -> np.ndarray:
    """Cubic curves (E, 4, 3), of which some are ``bent``, all at the highest degree of any (E, n + 1, 3), in mm."""
    if not bent:
        return control_points
    degree = max(len(curve) for curve in bent.values()) - 1
    result = bezier.elevate(control_points, degree)
    for strut, curve in bent.items():
        result[strut] = bezier.elevate(curve, degree)
    return result


def bent_as_records(bent: Mapping[int, np.ndarray]) -> list[dict[str, Any]]:
    """As in the file of a twin."""
    return [{"strut": strut, "control_points": curve} for strut, curve in bent.items()]


def bent_from_records(records: Any, source: str) -> dict[int, Any]:
    """What `bent_as_records` made it of, still to be checked.

    Raises
    ------
    InputError
        If it is not a list of objects with those two fields, or names a strut twice.
    """
    wanted = {"strut", "control_points"}
    if not isinstance(records, list) or not all(isinstance(one, dict) and one.keys() == wanted for one in records):
        raise InputError.at(
            source,
            FIELD,
            "is not a list of struts and their curves",
            'write [{"strut": 0, "control_points": [...]}, ...]',
        )
    result: dict[int, Any] = {}
    for one in records:
        if not isinstance(one["strut"], int) or one["strut"] in result:
            raise InputError.at(
                source, FIELD, f"names strut {one['strut']!r:.40} wrongly or twice", "name each strut once"
            )
        result[one["strut"]] = one["control_points"]
    return result
