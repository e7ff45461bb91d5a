"""Simulated captures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from frametwin.api.frames import frame_of
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback

if TYPE_CHECKING:
    from frametwin.simulation.simulate import Simulation


def simulate(frame: Wireframe | PathLike, *, progress: ProgressCallback | None = None, **settings: Any) -> Simulation:
    """Let a frame sag as a half-hardened print does, and take the silhouettes of what is left of it.

    Parameters
    ----------
    frame : Wireframe, path or str
        The plan: a frame, a frame file, or the name of a built-in frame such as ``"bridge"``.
    progress : callable, optional
        Called with a `Progress` after every step; returning ``False`` stops the simulation.
    **settings
        Attributes of `SimulationSettings` that differ from its defaults, such as ``views=10`` or ``missing=2``.

    Returns
    -------
    Simulation
        Plan, truth, cameras and pictures in memory; `fit` and `evaluate` take it as it is, and `write_simulation` makes
        a capture folder of it.

    Raises
    ------
    InputError
        If the frame or a setting cannot be used.
    Cancelled
        If ``progress`` returns ``False``.
    """
    from frametwin.simulation import simulate as simulation

    return simulation.simulate(frame_of(frame), simulation.SimulationSettings(**settings), progress)
