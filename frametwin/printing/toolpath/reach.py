"""Which waypoints an arm of Universal Robots can take at all: in closed form, and by compas_fab where it is installed.

Joint limits, collisions of the arm and the way from one waypoint to the next are not looked at.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.printing.toolpath.ur_arms import Arm
from frametwin.printing.toolpath.waypoints import Waypoints
from frametwin.printing.toolpath.workspace import Workspace


def within_reach(arm: Arm, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Tell for which poses the inverse kinematics of an arm has a solution.

    Parameters
    ----------
    arm : Arm
        One of `ARMS`.
    position : (N, 3) array, mm
        Of the flange in the robot's base.
    rotation : (N, 3, 3) array
        Of the flange.

    Returns
    -------
    (N,) bool array

    Notes
    -----
    The wrist's centre must lie outside of a cylinder about the base's axis (joint 1); then joints 5 and 6 follow, and
    the fourth joint must be within reach of the two long links in the plane of the arm. (K. P. Hawkins, "Analytic
    inverse kinematics for the Universal Robots UR-5/UR-10 arms", Georgia Tech, 2013.)
    """
    wrist = position - arm.d6 * rotation[:, :, 2]
    radius = np.hypot(wrist[:, 0], wrist[:, 1])
    result = np.zeros(len(position), dtype=bool)
    with np.errstate(invalid="ignore", divide="ignore"):
        for shoulder in (1.0, -1.0):
            heading = np.arctan2(wrist[:, 1], wrist[:, 0]) + shoulder * np.arccos(arm.d4 / radius) + 0.5 * np.pi
            normal = np.stack([np.sin(heading), -np.cos(heading), np.zeros_like(heading)], axis=1)
            turned = np.clip(np.einsum("nx,nx->n", rotation[:, :, 2], normal), -1.0, 1.0)  # cosine of joint 5
            for flip in (1.0, -1.0):
                result |= _arm_reaches(arm, wrist, rotation, heading, normal, flip * np.sqrt(1.0 - turned**2))
    return result & (radius >= arm.d4)


def _arm_reaches(
    arm: Arm, wrist: np.ndarray, rotation: np.ndarray, heading: np.ndarray, normal: np.ndarray, sine: np.ndarray
) -> np.ndarray:
    """(N,) bool for one choice of joints 1 and 5; ``sine`` is that of joint 5."""
    # The fifth joint's axis is across the arm's normal and the flange's z; where those coincide any direction serves.
    across = np.cross(normal, rotation[:, :, 2])
    size = np.linalg.norm(across, axis=1, keepdims=True)
    free = size[:, 0] < 1e-9
    fifth = np.where(size < 1e-9, np.array([0.0, 0.0, -1.0]), across / np.maximum(size, 1e-12))
    fifth *= np.where(sine < 0.0, -1.0, 1.0)[:, None]
    joint4 = wrist - arm.d4 * normal - arm.d5 * fifth  # in the plane of the two long links
    outwards = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
    far = np.hypot(np.einsum("nx,nx->n", joint4, outwards), joint4[:, 2] - arm.d1)
    slack = np.where(free, arm.d5, 0.0)
    return (far <= arm.a2 + arm.a3 + slack) & (far >= abs(arm.a2 - arm.a3) - slack)


def unreachable(waypoints: Waypoints, limits: Workspace, arm: Arm, tool_length: float) -> np.ndarray:
    """Rising numbers of the waypoints that an arm cannot take.

    Parameters
    ----------
    waypoints, limits
        What to reach, and where the print stands in the robot's base.
    arm
        One of `ARMS`.
    tool_length
        From the flange to the nozzle's tip along the flange's z, mm.
    """
    position, rotation = _flange(waypoints, limits, tool_length)
    return np.flatnonzero(~within_reach(arm, position, rotation))


def unreachable_by_compas_fab(waypoints: Waypoints, limits: Workspace, arm: Arm, tool_length: float) -> np.ndarray:
    """As `unreachable`, with the analytical solver of compas_fab.

    Raises
    ------
    InputError
        If compas_fab is not installed, or is there but cannot be imported.
    """
    try:
        from compas.geometry import Frame
        from compas_fab.backends.kinematics.solvers.offset_wrist_kinematics import OffsetWristKinematics
    except ImportError as error:
        problem, remedy = "is not installed", "install it, or ask for the built-in check"
        if compas_fab_is_installed():
            problem, remedy = f"cannot be imported ({error})", "install another version of it, or remove it"
        raise InputError.at("reach", "compas_fab", problem, remedy) from error
    metres = [length / 1000.0 for length in (arm.d1, -arm.a2, -arm.a3, arm.d4, arm.d5, arm.d6)]
    solver: Any = OffsetWristKinematics(metres)
    bad = []
    for n, (point, turn) in enumerate(
        zip(*frames_for_compas_fab(*_flange(waypoints, limits, tool_length)), strict=True)
    ):
        try:
            solutions = solver.inverse(Frame(point.tolist(), turn[:, 0].tolist(), turn[:, 1].tolist()))
        except ValueError:  # out of reach
            solutions = []
        if not any(solution is not None for solution in solutions):
            bad.append(n)
    return np.array(bad, dtype=np.int64)


def compas_fab_is_installed() -> bool:
    """Whether compas_fab can be found, with what it stands on; nothing is imported."""
    return all(find_spec(name) is not None for name in ("compas", "compas_fab"))


def frames_for_compas_fab(position: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turn flanges (N, 3) in mm and (N, 3, 3) into what compas_fab's solver takes: (N, 3) in m and (N, 3, 3).

    Its base is half a turn about z from the controller's, and its flange looks along x: the flange's z is its x, and
    the flange's x is its -y (compared with its forward kinematics, compas_fab 2.0.1).
    """
    half_turn = np.array([-1.0, -1.0, 1.0])
    turned = half_turn[:, None] * rotation
    axes = np.stack([turned[:, :, 2], -turned[:, :, 0], -turned[:, :, 1]], axis=2)
    return position * half_turn / 1000.0, axes


def check_reach(waypoints: Waypoints, limits: Workspace, arm: Arm, tool_length: float) -> str:
    """Refuse waypoints that an arm cannot take: by compas_fab where it is installed, else in closed form.

    Returns
    -------
    Who looked: ``"compas_fab"`` or ``"built-in"``.

    Raises
    ------
    InputError
        The sentence names the first such waypoint and its strut; or compas_fab is installed and cannot be used.
    """
    installed = compas_fab_is_installed()
    look, by = (unreachable_by_compas_fab, "compas_fab") if installed else (unreachable, "built-in")
    bad = look(waypoints, limits, arm, tool_length)
    if len(bad):
        problem = f"is out of a {arm.name}'s reach with a tool of {tool_length:g} mm, as are {len(bad) - 1} others"
        remedy = "move the print nearer (the base), or plan the order with less tilt"
        raise limits.refusal(waypoints, int(bad[0]), problem, remedy)
    return by


def _flange(waypoints: Waypoints, limits: Workspace, tool_length: float) -> tuple[np.ndarray, np.ndarray]:
    rotation = limits.rotations(waypoints)
    return limits.positions(waypoints) - tool_length * rotation[:, :, 2], rotation
