"""Struts that are missing from a print, whole or in part."""

from __future__ import annotations

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe


def drop_struts(frame: Wireframe, count: int, seed: int = 0, *, share: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Choose printed struts at random and say how much of each is there.

    A strut that is partly missing broke off or stopped short: one piece from one of its ends is left, chosen
    at random, but never a piece that would hang in the air because nothing else printed meets that end.

    Parameters
    ----------
    frame
        The print.
    count
        How many struts to drop.
    seed
        Of the choice.
    share
        How much of each chosen strut is missing, as a share of its arc length: 0.5 for half of it, 1 for all.

    Returns
    -------
    present, dropped
        (E, 2) interval of the curve parameter that exists, ``[0, 1]`` for whole struts, ``[0, 0]`` for struts
        that are missing entirely or not printed; and (count,) rising indices of the chosen struts.

    Raises
    ------
    InputError
        If there are fewer printed struts than ``count``, or ``share`` is not above 0 and up to 1.
    """
    printed = np.flatnonzero(frame.printed)
    if not 0 <= count <= len(printed):
        raise InputError.at(
            frame.name,
            "missing",
            f"is {count} where {len(printed)} struts are printed",
            f"give a number from 0 to {len(printed)}",
        )
    if not 0.0 < share <= 1.0:
        raise InputError.at("settings", "share", f"is {share}", "give a number above 0 and up to 1")
    rng = np.random.default_rng(seed)
    dropped = np.sort(rng.choice(printed, size=count, replace=False))
    from_end = rng.random(count) < 0.5
    present = np.zeros((frame.strut_count, 2))
    present[printed, 1] = 1.0
    present[dropped] = 0.0
    if share == 1.0:
        return present, dropped

    degree = np.bincount(frame.edges[printed].ravel(), minlength=frame.vertex_count)
    holds = (degree > 1) | frame.grounded
    start_holds, end_holds = holds[frame.edges[dropped]].T
    from_end = np.where(start_holds == end_holds, from_end, end_holds)
    kept = np.where(from_end, share, 1.0 - share)  # where the piece that is left is cut off
    cut = _parameter_at(frame.control_points[dropped], kept)
    present[dropped] = np.where(
        from_end[:, None],
        np.stack([cut, np.ones(count)], axis=1),
        np.stack([np.zeros(count), cut], axis=1),
    )
    return present, dropped


def _parameter_at(control_points: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Curve parameters (N,) at which the ``share`` (N,) of each curve's arc length has passed."""
    parameters = np.linspace(0.0, 1.0, 257)
    steps = np.linalg.norm(np.diff(bezier.evaluate(control_points, parameters), axis=1), axis=2)
    lengths = np.concatenate([np.zeros((len(steps), 1)), np.cumsum(steps, axis=1)], axis=1)
    wanted = share * lengths[:, -1]
    return np.array([np.interp(w, row, parameters) for w, row in zip(wanted, lengths, strict=True)])
