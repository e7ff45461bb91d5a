"""Where the robot may go and how fast; nothing is written for it that would leave these limits."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.toolpath.waypoints import KINDS, Waypoints
from frametwin.ranges import above, check_settings, within

ROUNDING = 1e-9
"""mm; waypoints may lie outside by so much."""


@dataclass(frozen=True, eq=False)
class Workspace:
    """Limits of the tool's tip, in the coordinates of the robot's base.

    Attributes
    ----------
    lower, upper : (3,) array, mm
        Corners of the box.
    base : (4, 4) array, mm
        Rigid transform from the coordinates of the print to those of the robot's base.
    max_speed : float, mm/s
    max_tilt_deg
        Of the tool against the vertical of the print.

    Raises
    ------
    InputError
        If the box is empty, the transform is not rigid, or a limit is out of its range.
    """

    lower: np.ndarray
    upper: np.ndarray
    base: np.ndarray = field(default_factory=lambda: np.eye(4))
    max_speed: Annotated[float, above(0.0, up_to=1e6, noun="mm/s")] = 250.0
    max_tilt_deg: Annotated[float, within(0.0, 180.0, "degrees")] = 90.0

    def __post_init__(self) -> None:
        for name, shape in (("lower", (3,)), ("upper", (3,)), ("base", (4, 4))):
            value = checked_array(getattr(self, name), "f", shape, "workspace", name)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if not (self.lower < self.upper).all():
            raise InputError.at("workspace", "upper", "is not above the lower corner", "give two corners of a box")
        turn = self.base[:3, :3]
        rigid = np.abs(turn.T @ turn - np.eye(3)).max() < 1e-6 and np.linalg.det(turn) > 0.0
        if not rigid or not np.array_equal(self.base[3], [0.0, 0.0, 0.0, 1.0]):
            raise InputError.at("workspace", "base", "is not a rotation and a shift", "give a rigid transform")
        check_settings(self, "workspace")

    @classmethod
    def around(cls, frame: Wireframe, margin: float | None = None, **limits: Any) -> Workspace:
        """A box around a frame, as wide as it is long on every side and above unless ``margin`` mm say otherwise."""
        room = frame.extent if margin is None else margin
        low, high = frame.bounds
        floor = low[2] - float(frame.radius.max())
        return cls(np.array([*(low[:2] - room), floor]), high + room, **limits)

    def positions(self, waypoints: Waypoints) -> np.ndarray:
        """(N, 3) array, mm: waypoints in the robot's base."""
        return self.in_base(waypoints.position)

    def in_base(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) array, mm: points of the frame in the robot's base."""
        return points @ self.base[:3, :3].T + self.base[:3, 3]

    def rotations(self, waypoints: Waypoints) -> np.ndarray:
        """(N, 3, 3) array: rotations of the tool in the robot's base."""
        return self.base[:3, :3] @ waypoints.rotation

    def check(self, waypoints: Waypoints) -> None:
        """Refuse waypoints that leave the limits; between two points in the box all is in the box.

        Raises
        ------
        InputError
            The sentence names the waypoint, its strut, and by how much it is outside.
        """
        where = self.positions(waypoints)
        beyond = np.maximum(self.lower - where, where - self.upper)  # (N, 3)
        worst = int(np.argmax(beyond.max(axis=1, initial=-np.inf)))
        if beyond[worst].max() > ROUNDING:
            side = "xyz"[int(np.argmax(beyond[worst]))]
            problem = f"is {beyond[worst].max():.3g} mm outside of the workspace in {side}"
            raise self.refusal(waypoints, worst, problem, "move the print, or give the workspace that the robot has")
        tilt = np.degrees(np.arccos(np.clip(waypoints.axis[:, 2], -1.0, 1.0)))
        worst = int(np.argmax(tilt))
        if tilt[worst] > self.max_tilt_deg + 1e-6:
            problem = f"leans {tilt[worst] - self.max_tilt_deg:.3g} degrees more than the allowed {self.max_tilt_deg:g}"
            raise self.refusal(waypoints, worst, problem, "plan the order with less tilt")
        worst = int(np.argmax(waypoints.speed))
        if waypoints.speed[worst] > self.max_speed * (1.0 + 1e-9):
            problem = (
                f"is {waypoints.speed[worst] - self.max_speed:.3g} mm/s faster than the allowed {self.max_speed:g}"
            )
            raise self.refusal(waypoints, worst, problem, "give lower speeds")
        still = np.flatnonzero(waypoints.speed <= 0.0)
        if len(still):
            raise self.refusal(waypoints, int(still[0]), "has no speed", "give speeds above 0")

    @staticmethod
    def refusal(waypoints: Waypoints, n: int, problem: str, remedy: str) -> InputError:
        """What to raise because of waypoint ``n``: it and its strut are named."""
        kind = KINDS[int(waypoints.kind[n])]
        field_name = f"waypoint {n} ({kind}, strut {int(waypoints.strut[n])})"
        return InputError.at(f"batch {waypoints.batch}", field_name, problem, remedy)

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        return {
            "lower": self.lower, "upper": self.upper, "base": self.base, "max_speed": self.max_speed,
            "max_tilt_deg": self.max_tilt_deg,
        }  # fmt: skip


def rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Turn rotations (N, 3, 3) into axis times angle (N, 3), as UR controllers write them; angles up to pi."""
    from scipy.spatial.transform import Rotation

    result: np.ndarray = Rotation.from_matrix(rotations).as_rotvec()
    length = np.linalg.norm(result, axis=1, keepdims=True)
    return np.where(length > math.pi, result * (1.0 - 2.0 * math.pi / np.maximum(length, 1e-12)), result)
