"""Arms of Universal Robots: their Denavit-Hartenberg lengths, and where their flanges are.

Source: Universal Robots, "DH Parameters for calculations of kinematics and dynamics" (universal-robots.com, Articles),
and for UR16e and UR30 also the maker's ``ur_description``. These are nominal lengths; every single robot has a
calibration of its own, which differs from them by fractions of a millimetre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

QUARTER = np.pi / 2.0

TWISTS = (QUARTER, 0.0, 0.0, QUARTER, -QUARTER, 0.0)
"""Of the six joints, rad; the same for all arms."""


@dataclass(frozen=True)
class Arm:
    """An arm with six joints and an offset wrist.

    Attributes
    ----------
    name : str
        As its maker writes it.
    d1, a2, a3, d4, d5, d6 : float, mm
        Lengths as in the table of the source, but a2 and a3 without their signs.
    """

    name: str
    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float

    def flange(self, joints: ArrayLike) -> np.ndarray:
        """The pose (4, 4) of the flange in the controller's base, in mm, at joints (6,) in rad."""
        pose = np.eye(4)
        offsets, lengths = (self.d1, 0.0, 0.0, self.d4, self.d5, self.d6), (0.0, -self.a2, -self.a3, 0.0, 0.0, 0.0)
        for angle, d, a, twist in zip(np.asarray(joints, dtype=np.float64), offsets, lengths, TWISTS, strict=True):
            c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
            pose = pose @ [[c, -s * ct, s * st, a * c], [s, c * ct, -c * st, a * s], [0, st, ct, d], [0, 0, 0, 1]]
        return pose


ARMS: dict[str, Arm] = {
    arm.name.lower(): arm
    for arm in (
        Arm("UR3", 151.9, 243.65, 213.25, 112.35, 85.35, 81.9),
        Arm("UR5", 89.159, 425.0, 392.25, 109.15, 94.65, 82.3),
        Arm("UR10", 127.3, 612.0, 572.3, 163.941, 115.7, 92.2),
        Arm("UR3e", 151.85, 243.55, 213.2, 131.05, 85.35, 92.1),
        Arm("UR5e", 162.5, 425.0, 392.2, 133.3, 99.7, 99.6),
        Arm("UR10e", 180.7, 612.7, 571.55, 174.15, 119.85, 116.55),
        Arm("UR16e", 180.7, 478.4, 360.0, 174.15, 119.85, 116.55),
        Arm("UR20", 236.3, 862.0, 728.7, 201.0, 159.3, 154.3),
        Arm("UR30", 236.3, 637.0, 503.7, 201.0, 159.3, 154.3),
    )
}
"""Arms by the names that settings have for them."""
