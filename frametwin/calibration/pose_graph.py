"""Where cameras stand to each other at first: boards that two cameras see at one moment vote for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.detection import Sighting
from frametwin.calibration.poses import board_poses, rms_of
from frametwin.cameras.rig_file import RigCamera

Floats = NDArray[np.float64]

RIVAL = 3.0
"""A second pose of a flat board is kept if its error is below so many times that of the first (plus a pixel)."""

AGREE = 0.05
"""Votes count until they differ by this share of the distance to the board."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pose (4, 4) of a board before a camera, and whether the board is taken as turned by half a turn."""

    pose: Floats
    turned: bool


@dataclass(frozen=True, eq=False)
class Start:
    """Where a bundle begins.

    Attributes
    ----------
    cameras : (4, 4) arrays by name
        Camera to world; the world is the first camera.
    boards : (4, 4) arrays by moment
        Board to world.
    sightings
        With the corners numbered as the boards lie.
    groups
        Names of cameras that are tied together; more than one if some are not.
    """

    cameras: dict[str, Floats]
    boards: dict[str, Floats]
    sightings: tuple[Sighting, ...]
    groups: tuple[tuple[str, ...], ...]


def turned(sighting: Sighting) -> Sighting:
    """The sighting of a board that is lying the other way round."""
    return replace(sighting, points=sighting.points * (-1.0, -1.0, 1.0))


def find_start(cameras: Sequence[RigCamera], sightings: Sequence[Sighting], symmetric: bool) -> Start:
    """Poses of cameras and boards.

    Parameters
    ----------
    cameras
        With known lenses.
    sightings
        Of boards; equal picture names are the same moment.
    symmetric
        Whether the board looks the same after half a turn.
    """
    lenses = {camera.name: camera for camera in cameras}
    candidates = {
        (sighting.camera, sighting.picture): _candidates(lenses[sighting.camera], sighting, symmetric)
        for sighting in sightings
    }
    placed: dict[str, Floats] = {cameras[0].name: np.eye(4)}
    votes = _votes([camera.name for camera in cameras], candidates)
    groups = [[cameras[0].name]]
    while len(placed) < len(cameras):
        open_pairs = [(pair, vote) for pair, vote in votes.items() if pair[0] in placed and pair[1] not in placed]
        if open_pairs:
            (known, new), (_, relative) = max(open_pairs, key=lambda item: item[1][0])
            placed[new] = placed[known] @ relative
            groups[-1].append(new)
        else:
            new = next(camera.name for camera in cameras if camera.name not in placed)
            placed[new] = np.eye(4)
            groups.append([new])
    boards, kept = _boards(lenses, placed, sightings, candidates, symmetric)
    return Start(placed, boards, kept, tuple(tuple(group) for group in groups))


def _candidates(camera: RigCamera, sighting: Sighting, symmetric: bool) -> list[Candidate]:
    found = []
    for is_turned in (False, True) if symmetric else (False,):
        poses = board_poses(camera.model, camera.lens, turned(sighting) if is_turned else sighting)
        found += [Candidate(pose, is_turned) for error, pose in poses if error < RIVAL * poses[0][0] + 1.0]
    return found


def _votes(
    names: Sequence[str], candidates: dict[tuple[str, str], list[Candidate]]
) -> dict[tuple[str, str], tuple[float, Floats]]:
    """For each pair of cameras that share moments: how many agree, and the pose of the second in the first's axes."""
    votes = {}
    moments: dict[str, set[str]] = {name: set() for name in names}
    for (camera, moment), found in candidates.items():
        if found:
            moments[camera].add(moment)
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            shared = sorted(moments[first] & moments[second])
            proposals = [_relatives(candidates[first, moment], candidates[second, moment]) for moment in shared]
            if not proposals:
                continue
            best = max((relative for group in proposals for relative in group), key=lambda r: _support(r, proposals))
            support = _support(best, proposals)
            votes[first, second] = support, best
            votes[second, first] = support, np.linalg.inv(best)
    return votes


def _relatives(first: Sequence[Candidate], second: Sequence[Candidate]) -> list[Floats]:
    return [a.pose @ np.linalg.inv(b.pose) for a in first for b in second]


def _support(relative: Floats, proposals: Sequence[Sequence[Floats]]) -> float:
    """How many moments agree with a relative pose, each by up to 1."""
    total = 0.0
    reach = max(float(np.linalg.norm(relative[:3, 3])), 1e-6)
    for group in proposals:
        nearest = min(_difference(relative, other, reach) for other in group)
        total += max(0.0, 1.0 - nearest / AGREE)
    return total + 1e-9 * len(proposals)


def _difference(a: Floats, b: Floats, reach: float) -> float:
    """Turn in radians and shift as a share of a distance, added."""
    turn = np.arccos(np.clip(0.5 * (np.trace(a[:3, :3].T @ b[:3, :3]) - 1.0), -1.0, 1.0))
    return float(turn + np.linalg.norm(a[:3, 3] - b[:3, 3]) / reach)


def _boards(
    lenses: dict[str, RigCamera],
    placed: dict[str, Floats],
    sightings: Sequence[Sighting],
    candidates: dict[tuple[str, str], list[Candidate]],
    symmetric: bool,
) -> tuple[dict[str, Floats], tuple[Sighting, ...]]:
    """For each moment the pose with which all cameras that see the board agree best."""
    boards: dict[str, Floats] = {}
    kept: list[Sighting] = []
    for moment in sorted({sighting.picture for sighting in sightings}):
        own = [sighting for sighting in sightings if sighting.picture == moment]
        best = None
        for sighting in own:
            for candidate in candidates[sighting.camera, moment]:
                pose = placed[sighting.camera] @ candidate.pose
                error = sum(min(_error(lenses, placed, pose, other, symmetric)[0], 100.0) for other in own)
                if best is None or error < best[0]:
                    best = (error, pose)
        if best is None:
            continue
        boards[moment] = best[1]
        kept += [_error(lenses, placed, best[1], sighting, symmetric)[1] for sighting in own]
    return boards, tuple(kept)


def _error(
    lenses: dict[str, RigCamera], placed: dict[str, Floats], pose: Floats, sighting: Sighting, symmetric: bool
) -> tuple[float, Sighting]:
    """Error in px of a sighting, in that of its two numberings that fits better."""
    camera = lenses[sighting.camera]
    local = np.linalg.inv(placed[sighting.camera]) @ pose
    ways = [sighting, turned(sighting)] if symmetric else [sighting]
    errors = [rms_of(camera.model, camera.lens, local, way) for way in ways]
    best = int(np.argmin(errors))
    return errors[best], ways[best]
