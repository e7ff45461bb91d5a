"""Whether pictures of a board differ enough to tell a lens: tilt, likeness, coverage."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.detection import Sighting

Floats = NDArray[np.float64]

FLAT_DEG = 15.0
"""Boards that all face the camera to within this angle do not tell focal length from distance."""

ALIKE_DEG, ALIKE_SHARE = 5.0, 0.05
"""Two pictures are alike whose boards differ by less than this angle and this share of the picture's diagonal."""

FEW_DIFFERENT = 5

NEAR_PX, MOST_NAMED = 24.0, 4
"""Corners closer together than this lie within the window of 11 px around each other that is usual."""

GRID = (6, 4)
EMPTY_SHARE = 0.4


def check_variety(poses: Sequence[Floats], sightings: Sequence[Sighting], size: tuple[int, int]) -> list[str]:
    """Sentences on what is wrong with a set of pictures; none if it is fine.

    Parameters
    ----------
    poses : list of (4, 4) arrays
        From the board's axes to the camera's, for each picture.
    sightings
        The corners.
    size
        Width and height of the pictures.
    """
    sentences = []
    tilt = largest_tilt(poses)
    if tilt < FLAT_DEG:
        sentences.append(
            f"the poses are too flat: no board is tilted by more than {tilt:.0f} degrees, so focal length and distance"
            " can hardly be told apart; tilt it by 30 to 45 degrees"
        )
    different = different_pictures(poses, sightings, size)
    if different < min(FEW_DIFFERENT, len(poses)):
        sentences.append(
            f"the poses are too similar: {len(poses)} pictures show only {different} different"
            f" place{'s' * (different != 1)} of the board; move and turn it between them"
        )
    empty = empty_share(sightings, size)
    if empty > EMPTY_SHARE:
        sentences.append(
            f"no corner was ever seen in {100.0 * empty:.0f} % of the picture; bring the board to its edges and corners"
        )
    small = [(closest_corners(sighting), sighting.picture) for sighting in sightings]
    small = sorted(item for item in small if item[0] < NEAR_PX)
    if small:
        named = ", ".join(f"{picture} ({distance:.0f} px)" for distance, picture in small[:MOST_NAMED])
        more = f" and {len(small) - MOST_NAMED} more" if len(small) > MOST_NAMED else ""
        sentences.append(
            f"corners lie close together in {named}{more}: they were measured in smaller windows, and are less certain;"
            " bring the board nearer"
        )
    return sentences


def closest_corners(sighting: Sighting) -> float:
    """Smallest distance in px between two corners of a picture."""
    apart = np.linalg.norm(sighting.pixels[:, None] - sighting.pixels, axis=2)
    return float((apart + np.diag(np.full(len(apart), np.inf))).min())


def largest_tilt(poses: Sequence[Floats]) -> float:
    """Largest angle between a board's face and the line of sight to it, in degrees from facing the camera."""
    tilts = []
    for pose in poses:
        sight = pose[:3, 3] / np.linalg.norm(pose[:3, 3])
        tilts.append(np.degrees(np.arccos(np.clip(abs(float(pose[:3, 2] @ sight)), 0.0, 1.0))))
    return float(max(tilts))


def different_pictures(poses: Sequence[Floats], sightings: Sequence[Sighting], size: tuple[int, int]) -> int:
    """How many pictures are left when those alike count once."""
    near = ALIKE_SHARE * float(np.hypot(*size))
    kept: list[int] = []
    for i in range(len(poses)):
        middle = sightings[i].pixels.mean(axis=0)
        alike = False
        for j in kept:
            turn = poses[i][:3, :3].T @ poses[j][:3, :3]
            angle = np.degrees(np.arccos(np.clip(0.5 * (np.trace(turn) - 1.0), -1.0, 1.0)))
            alike |= bool(angle < ALIKE_DEG and np.linalg.norm(middle - sightings[j].pixels.mean(axis=0)) < near)
        kept += [] if alike else [i]
    return len(kept)


def empty_share(sightings: Sequence[Sighting], size: tuple[int, int]) -> float:
    """Share of a grid over the picture in which no corner was ever seen."""
    pixels = np.concatenate([sighting.pixels for sighting in sightings]) / size
    cells = np.clip((pixels * GRID).astype(int), 0, np.array(GRID) - 1)
    seen = np.zeros(GRID, dtype=bool)
    seen[cells[:, 0], cells[:, 1]] = True
    return float(1.0 - seen.mean())
