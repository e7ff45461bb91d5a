"""Frames of the project's own, for demonstrations and tests: a bridge, a bowl and a tower.

Each is a deterministic function of a few whole numbers. All stand on the ground, are connected, and no two
struts pass within two radii of each other except where they meet in a joint. Their struts are put into
batches that can be printed in order: every batch touches the ground or an earlier one.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import RADIUS_SHARE, Wireframe

Floats = NDArray[np.float64]

DIGITS = 6  # coordinates are whole nanometres, so that files are short and the same on every machine


@dataclass
class _Plan:
    """Joints under names of their own, each in a stage of the print, and the struts between them."""

    joints: dict[Hashable, tuple[float, float, float]] = field(default_factory=dict)
    stages: dict[Hashable, int] = field(default_factory=dict)
    struts: list[tuple[Hashable, Hashable]] = field(default_factory=list)
    curved: dict[int, Floats] = field(default_factory=dict)  # strut -> control points (4, 3)

    def joint(self, key: Hashable, position: tuple[float, float, float], stage: int) -> None:
        x, y, z = (round(float(value), DIGITS) + 0.0 for value in position)  # + 0.0 turns -0.0 into 0.0
        self.joints[key] = (x, y, z)
        self.stages[key] = stage

    def strut(self, a: Hashable, b: Hashable) -> None:
        self.struts.append((a, b))

    def arc(self, a: Hashable, b: Hashable) -> None:
        """A level strut along the circle about the z axis that runs through both joints."""
        start, end = np.array(self.joints[a]), np.array(self.joints[b])
        angle = np.arctan2(start[0] * end[1] - start[1] * end[0], start[:2] @ end[:2])
        # The classic circular arc: handles of 4/3 tan(angle/4) radii along the tangents.
        handle = 4.0 / 3.0 * np.tan(angle / 4.0) * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        points = np.array([start, start + handle @ start, end - handle @ end, end])
        self.curved[len(self.struts)] = points.round(DIGITS) + 0.0
        self.strut(a, b)

    def frame(self, name: str) -> Wireframe:
        """The frame, with a radius of 6 % of the median length, to a hundredth of a millimetre."""
        index = {key: i for i, key in enumerate(self.joints)}
        vertices = np.array(list(self.joints.values()))
        edges = np.array([[index[a], index[b]] for a, b in self.struts])
        control_points = bezier.straight(vertices[edges[:, 0]], vertices[edges[:, 1]])  # (E, 4, 3)
        for strut, points in self.curved.items():
            control_points[strut] = points
        return Wireframe.create(
            vertices,
            edges,
            control_points=control_points,
            radius=round(RADIUS_SHARE * float(np.median(bezier.arc_length(control_points))), 2),
            batch=[max(self.stages[a], self.stages[b]) for a, b in self.struts],
            name=name,
        )


def arched_bridge(panels: int = 8) -> Wireframe:
    """A foot bridge: on each side an arched truss on two feet, the deck and the top tied across.

    Parameters
    ----------
    panels
        Even number of panels of 25 mm, at least 4. The rise grows with the length; eight panels make 76
        struts, 200 x 36 x 54 mm.

    Raises
    ------
    ValueError
        For an odd or smaller number.
    """
    if panels < 4 or panels % 2:
        raise ValueError(f"a bridge needs an even number of panels, at least 4, not {panels}")
    plan, length, half_width = _Plan(), 25.0 * panels, 18.0
    for side, y in (("left", half_width), ("right", -half_width)):
        for i in range(panels + 1):
            parabola = 4.0 * i * (panels - i) / panels**2
            x, stage = 25.0 * i - length / 2.0, min(i, panels - i)
            plan.joint((side, "low", i), (x, y, 0.10 * length * parabola), stage)
            if 0 < i < panels:
                plan.joint((side, "high", i), (x, y, 0.27 * length * parabola), stage)
    for side in ("left", "right"):
        low = [(side, "low", i) for i in range(panels + 1)]
        high = [low[0], *((side, "high", i) for i in range(1, panels)), low[panels]]
        for i in range(panels):
            plan.strut(low[i], low[i + 1])
            plan.strut(high[i], high[i + 1])
        for i in range(1, panels):
            plan.strut(low[i], high[i])
        for i in range(1, panels // 2):  # diagonals rise towards the feet, as in a Pratt truss
            plan.strut(high[i], low[i + 1])
            plan.strut(high[panels - i], low[panels - i - 1])
    for i in range(panels + 1):
        plan.strut(("left", "low", i), ("right", "low", i))
        if 0 < i < panels:
            plan.strut(("left", "high", i), ("right", "high", i))
    plan.strut(("left", "low", 0), ("right", "low", 1))
    plan.strut(("left", "low", panels), ("right", "low", panels - 1))
    return plan.frame("bridge")


def half_bowl(columns: int = 12, levels: int = 4) -> Wireframe:
    """A bowl, the lower half of a sphere of 152 mm cut off by a base ring of 60 mm; its rings are curved
    struts.

    Parameters
    ----------
    columns
        Struts in each ring, at least 5.
    levels
        Rings above the base ring, at least 1. Twelve columns and four levels make 156 struts.

    Raises
    ------
    ValueError
        For smaller numbers.
    """
    if columns < 5 or levels < 1:
        raise ValueError(f"a bowl needs 5 columns and 1 level or more, not {columns} and {levels}")
    plan, radius, base_radius = _Plan(), 76.0, 30.0
    low = np.arcsin(base_radius / radius)  # counted from the lowest point of the sphere
    for level in range(levels + 1):
        polar = low + (np.pi / 2.0 - low) * level / levels
        r, z = radius * np.sin(polar), radius * (np.cos(low) - np.cos(polar))
        for j in range(columns):
            azimuth = 2.0 * np.pi * j / columns
            plan.joint((level, j), (r * np.cos(azimuth), r * np.sin(azimuth), z), level)
    for level in range(levels + 1):
        for j in range(columns):
            after = (j + 1) % columns
            if level:
                plan.strut((level - 1, j), (level, j))
                turned = level % 2
                plan.strut((level - 1, after if turned else j), (level, j if turned else after))
            plan.arc((level, j), (level, after))
    return plan.frame("half_bowl")


def lattice_tower(layers: int = 13) -> Wireframe:
    """A hexagonal tower round a hexagonal core, tapering upwards, braced in both directions.

    Parameters
    ----------
    layers
        Layers of 19.2 mm, at least 1. Thirteen make 804 struts, 80 x 70 x 250 mm.

    Raises
    ------
    ValueError
        For fewer layers.
    """
    if layers < 1:
        raise ValueError(f"a tower needs 1 layer or more, not {layers}")
    plan = _Plan()
    turn = np.arange(12) * np.pi / 6.0
    # Even joints of the outer ring are the hexagon's corners, odd ones the middles of its sides.
    reach = np.where(np.arange(12) % 2 == 0, 1.0, np.cos(np.pi / 6.0))
    for level in range(layers + 1):
        taper, z = 1.0 - 0.2 * level / layers, 250.0 / 13.0 * level
        for j in range(12):
            r = 40.0 * taper * reach[j]
            plan.joint(("outer", level, j), (r * np.cos(turn[j]), r * np.sin(turn[j]), z), level)
        for j in range(0, 12, 2):
            r = 20.0 * taper
            plan.joint(("core", level, j), (r * np.cos(turn[j]), r * np.sin(turn[j]), z), level)
    for level in range(layers + 1):
        for ring, step in (("outer", 1), ("core", 2)):
            for j in range(0, 12, step):
                after = (j + step) % 12
                plan.strut((ring, level, j), (ring, level, after))
                if level:
                    plan.strut((ring, level - 1, j), (ring, level, j))
                    turned = (level + j // step) % 2
                    low, high = (after, j) if turned else (j, after)
                    plan.strut((ring, level - 1, low), (ring, level, high))
        for j in range(0, 12, 2):
            plan.strut(("core", level, j), ("outer", level, j))
    return plan.frame("lattice_tower")


FRAMES: dict[str, Callable[[], Wireframe]] = {
    "bridge": arched_bridge,
    "half_bowl": half_bowl,
    "lattice_tower": lattice_tower,
}


def named_frame(name: str) -> Wireframe:
    """One of ``FRAMES`` by its name.

    Raises
    ------
    InputError
        For a name that is not there.
    """
    if name not in FRAMES:
        raise InputError.at("frame", name, "there is no such frame", f"use one of {', '.join(FRAMES)}")
    return FRAMES[name]()
