"""A test coupon: single struts that lean over the plate beside a frame, laid first, to tell what the material does.

The first struts of a frame are short of load, and move too little to tell how soft the material is; by the time they
do, most of the frame stands where it sags. A strut that stands on the plate by one end alone droops by itself, as far
as it was made long for, and goes on creeping in sight of the cameras for as long as the print takes. Every strut flows
a little faster or slower than the others, so many short ones tell more than a long one.
"""

from __future__ import annotations

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.stiffness import Material
from frametwin.printing.process.added_struts import plate_of, with_struts
from frametwin.printing.process.material import PrintSettings

LEAN = np.radians(60.0)
"""From the vertical: what leans further droops more, but the tool has to get below it."""

DROOP = 0.04
"""By which share of its length the tip of a strut droops while it hardens; it creeps on to several times that."""

SHORTEST, LONGEST = 8.0, 0.5
"""Bounds of the length: in radii of the strut, below which it is mostly foot, and as a share of the frame's extent."""

PITCH, GAP = 8.0, 12.0
"""Air between neighbours, and between coupon and frame, in radii of the strut: the tool passes between."""

WIDEST_DOUBT = 1.2
"""Standard deviation of the logarithm of the weight beyond which lengths are not graded further."""

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def with_coupon(frame: Wireframe, count: int, weight: float = 1.0, doubt: float = WIDEST_DOUBT) -> Wireframe:
    """Add a coupon to a frame: its struts and joints come after those of the frame, and its batch before all others.

    Parameters
    ----------
    frame
        The design.
    count
        Struts of the coupon; with none, the frame is given back.
    weight
        Of struts over their stiffness, as in `frametwin.printing.process.creep.CreepParameters`.
    doubt
        Standard deviation of its logarithm: the less is known, the more the lengths differ.

    Raises
    ------
    InputError
        If nothing of the frame stands on the plate.
    """
    if count == 0:
        return frame
    plate = plate_of(frame)
    radius = float(np.median(frame.radius))
    feet, outwards = _places(frame, count, radius, plate)
    reach = _lengths(count, radius, weight, doubt)
    reach = np.clip(reach, SHORTEST * radius, max(SHORTEST * radius, LONGEST * frame.extent))
    axis = np.column_stack([np.sin(LEAN) * outwards, np.full(count, np.cos(LEAN))])
    points = np.stack([feet, feet + reach[:, None] * axis], axis=1).reshape(-1, 3)
    return with_struts(
        frame.replace(batch=frame.batch - frame.batch.min() + 1),
        points,
        frame.vertex_count + np.arange(2 * count).reshape(-1, 2),
        grounded=np.tile([True, False], count),
        batch=np.zeros(count, dtype=np.int64),
    )


def drooping_length(radius: float, weight: float, settings: PrintSettings | None = None) -> float:
    """Length in mm of a leaning strut whose tip droops by `DROOP` of it while it hardens.

    The tip of a cantilever of round section under an even load q across it moves by q L^4 / (8 E I).
    """
    settings = PrintSettings() if settings is None else settings
    material: Material = settings.material
    load = weight * material.weight * np.sin(LEAN) * settings.flow  # of a volume, as it acts on hardened struts
    return float(np.cbrt(2.0 * material.young * radius**2 * DROOP / load))


def _lengths(count: int, radius: float, weight: float, doubt: float) -> np.ndarray:
    """(N,) mm, graded from what droops as is wanted where the material is heavier by exp(``doubt``) to the contrary."""
    order = np.argsort(np.arange(count) * GOLDEN % 1.0, kind="stable")  # neighbours are of different lengths
    grades = np.linspace(-1.0, 1.0, count)[order] if count > 1 else np.zeros(1)
    return np.asarray(drooping_length(radius, weight) * np.exp(min(doubt, WIDEST_DOUBT) / 3.0 * grades))


def _places(frame: Wireframe, count: int, radius: float, plate: float) -> tuple[np.ndarray, np.ndarray]:
    """Feet (N, 3) on a rectangle around the frame, the longer sides first, and where (N, 2) is outwards."""
    low, high = (limit[:2] for limit in frame.bounds)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    pitch, gap = PITCH * radius, GAP * radius
    room = 1 + (2.0 * half / pitch).astype(int)  # along one side
    more = -(-max(0, count - 2 * int(room.sum())) // 4)
    room, gap = room + more, gap + 0.5 * more * pitch
    longer = int(half[1] > half[0])
    many = min(count, 2 * int(room[longer]))
    feet, outwards = np.full((count, 3), plate), np.zeros((count, 2))
    for along, first, number in ((longer, 0, many), (1 - longer, many, count - many)):
        for side, part in zip((1.0, -1.0), np.array_split(first + np.arange(number), 2), strict=True):
            feet[part, along] = middle[along] + (np.arange(len(part)) - 0.5 * (len(part) - 1)) * pitch
            feet[part, 1 - along] = middle[1 - along] + side * (half[1 - along] + gap)
            outwards[part, 1 - along] = side
    return feet, outwards
