"""The bundle of a whole rig: boards that one camera saw alone, boards at shared moments, and the object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.bundle import Body, Bundle, Eye, Link, Solution, solve
from frametwin.calibration.detection import Sighting
from frametwin.calibration.intrinsics import LEAST_PX, NOMINAL_PX, ROBUST_PX, STRAY_LEAST, STRAY_SIGMAS, beforehand
from frametwin.calibration.looking import LeftOut
from frametwin.calibration.poses import board_poses
from frametwin.cameras.lens_models import LENS_KEYS
from frametwin.cameras.rig_file import RigCamera

Floats = NDArray[np.float64]

SPOILS_JOINT, LEAST_SPOILED_PX = 4.0, 1.0
"""A sighting of a moment is left out that misses by so many times the usual, and by so many px at least."""


LARGEST_RATIO = 8.0
"""How many times less sure than a board's the corners of an object may count."""


@dataclass(frozen=True, eq=False)
class Joint:
    """All that is known of a rig, at its present place.

    Attributes
    ----------
    cameras
        Their lenses; poses are in ``places``.
    places : (4, 4) arrays by name
        Camera to world.
    alone
        Sightings of boards by one camera, from calibrating its lens.
    moments
        Sightings of boards at shared moments.
    boards : (4, 4) arrays by moment
        Board to world.
    thing
        Sightings of the object.
    thing_pose : (4, 4) array
        Where the object stands; held. None without an object, when the first camera is held.
    motion_mm
        How far the board moved between the pictures of a moment, one standard deviation; 0 for true moments.
    board_px, thing_px
        Standard deviation of a board's corners and of the object's, whose squares are smaller.
    """

    cameras: tuple[RigCamera, ...]
    places: dict[str, Floats]
    alone: tuple[Sighting, ...]
    moments: tuple[Sighting, ...]
    boards: dict[str, Floats]
    thing: tuple[Sighting, ...] = ()
    thing_pose: Floats | None = None
    motion_mm: float = 0.0
    board_px: float = NOMINAL_PX
    thing_px: float = NOMINAL_PX

    @property
    def sightings(self) -> tuple[Sighting, ...]:
        """In the order of the links of `bundle_of`."""
        return (*self.alone, *self.moments, *self.thing)


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The outcome: the joint problem at its solution, the solution itself, and what was left out."""

    joint: Joint
    solution: Solution
    left_out: tuple[LeftOut, ...]

    def camera(self, i: int) -> RigCamera:
        """A camera with its pose, covariance and residuals."""
        camera, eye = self.joint.cameras[i], self.solution.bundle.eyes[i]
        shared = (*self.joint.moments, *self.joint.thing)
        offset = len(self.joint.alone)
        own = [self.solution.residuals[offset + j] for j, s in enumerate(shared) if s.camera == camera.name]
        figures = dict(camera.residuals)
        if own:
            together = np.concatenate(own)
            figures["moments"] = {
                "rms_px": float(np.sqrt((together**2).sum(axis=1).mean())),
                "pictures": len(own),
                "corners": len(together),
            }
        figures["sigma_px"] = self.solution.sigma * self.joint.board_px
        covariance = self.solution.eye_covariance(i)
        return replace(
            camera, lens=eye.lens, camera_to_world=eye.camera_to_world, covariance=covariance, residuals=figures
        )


def without_doubles(alone: Sequence[Sighting], moments: Sequence[Sighting]) -> tuple[Sighting, ...]:
    """Sightings of single cameras but those of pictures that come again as moments."""
    again = {(sighting.camera, sighting.picture): sighting for sighting in moments}

    def is_double(sighting: Sighting) -> bool:
        other = again.get((sighting.camera, sighting.picture))
        if other is None:
            return False
        same = np.intersect1d(sighting.corners, other.corners, return_indices=True)
        shift = sighting.pixels[same[1]] - other.pixels[same[2]]
        return bool(len(shift)) and bool(np.abs(shift).max() < 1e-3)

    return tuple(sighting for sighting in alone if not is_double(sighting))


def bundle_of(joint: Joint) -> Bundle:
    """The problem as `frametwin.calibration.bundle.solve` takes it."""
    numbers = {camera.name: i for i, camera in enumerate(joint.cameras)}
    eyes = [
        _eye(camera, joint.places[camera.name], joint.thing_pose is None and i == 0)
        for i, camera in enumerate(joint.cameras)
    ]
    bodies, links = [], []

    def link(sighting: Sighting, body: int, px: float, motion: Floats | None = None) -> None:
        links.append(Link(numbers[sighting.camera], body, sighting.points, sighting.pixels, 1.0 / px, motion))

    for sighting in joint.alone:
        camera = joint.cameras[numbers[sighting.camera]]
        poses = board_poses(camera.model, camera.lens, sighting)
        bodies.append(Body(joint.places[camera.name] @ poses[0][1]))
        link(sighting, len(bodies) - 1, joint.board_px)
    order = {moment: len(bodies) + i for i, moment in enumerate(joint.boards)}
    bodies += [Body(pose) for pose in joint.boards.values()]
    for sighting in joint.moments:
        link(sighting, order[sighting.picture], joint.board_px, _motion(joint, sighting))
    if joint.thing_pose is not None:
        bodies.append(Body(joint.thing_pose, fixed=True))
        for sighting in joint.thing:
            link(sighting, len(bodies) - 1, joint.thing_px)
    return Bundle(tuple(eyes), tuple(bodies), tuple(links))


def _motion(joint: Joint, sighting: Sighting) -> Floats | None:
    """What a board may have moved between the pictures of a moment: a shift, and a turn that moves its rim as far."""
    if joint.motion_mm <= 0.0:
        return None
    radius = 0.5 * float(np.linalg.norm(np.ptp(sighting.points, axis=0)))
    return np.array([joint.motion_mm / radius] * 3 + [joint.motion_mm] * 3)


def _eye(camera: RigCamera, place: Floats, fixed: bool) -> Eye:
    terms = camera.residuals.get("distortion", LENS_KEYS[camera.model][4:])
    free = np.array([i < 4 or key in terms for i, key in enumerate(LENS_KEYS[camera.model])])
    prior, mean = beforehand(camera.model, camera.lens, (camera.width, camera.height))
    return Eye(camera.model, camera.lens, free, place, fixed, prior, mean)


def _at(joint: Joint, solution: Solution) -> Joint:
    """The problem moved to a solution, so that it can be changed and solved again."""
    bundle = solution.bundle
    places = {camera.name: eye.camera_to_world for camera, eye in zip(joint.cameras, bundle.eyes, strict=True)}
    cameras = tuple(replace(camera, lens=eye.lens) for camera, eye in zip(joint.cameras, bundle.eyes, strict=True))
    offset = len(joint.alone)
    boards = {moment: bundle.bodies[offset + i].pose for i, moment in enumerate(joint.boards)}
    return replace(joint, cameras=cameras, places=places, boards=boards)


def adjust(joint: Joint, watch: Callable[[], object] | None = None) -> Adjusted:
    """Bundle adjustment of a rig: robustly, without what does not go with the rest, then with its covariance."""
    solution = solve(bundle_of(joint), robust_px=4.0 * ROBUST_PX, watch=watch, steps=40)
    joint = _weighed(_at(joint, solution), solution)
    solution = solve(bundle_of(joint), robust_px=ROBUST_PX, watch=watch)
    joint, left_out = _without_spoilt(_at(joint, solution), solution)
    if left_out:
        solution = solve(bundle_of(joint), robust_px=ROBUST_PX, watch=watch)
        joint = _at(joint, solution)
    strays = _strays(joint, solution)
    if any(stray.any() for stray in strays):
        joint, dropped = _without_strays(joint, strays)
        left_out += dropped
    least = LEAST_PX / joint.board_px
    solution = solve(bundle_of(joint), robust_px=4.0 * ROBUST_PX, covariance=True, least_sigma=least, watch=watch)
    return Adjusted(_at(joint, solution), solution, tuple(left_out))


def _weighed(joint: Joint, solution: Solution) -> Joint:
    """With corners as sure as they are seen to be; where boards moved within moments, nothing tells that."""
    alone, moments, thing = _groups(joint)
    boards = [left for group in (alone, moments) for left in solution.residuals[group]]
    board_px = max(_usual_distance(boards), LEAST_PX) if boards and joint.motion_mm <= 0.0 else NOMINAL_PX
    things = solution.residuals[thing]
    thing_px = float(np.clip(_usual_distance(things), board_px, LARGEST_RATIO * board_px)) if things else board_px
    return replace(joint, board_px=board_px, thing_px=thing_px)


def _groups(joint: Joint) -> tuple[slice, slice, slice]:
    """Sightings of single cameras, of moments, and of the object: each kind has its own usual error."""
    a, b = len(joint.alone), len(joint.alone) + len(joint.moments)
    return slice(0, a), slice(a, b), slice(b, b + len(joint.thing))


def _usual_distance(residuals: Sequence[Floats]) -> float:
    """Standard deviation of a coordinate, by the median distance of the corners (1.18 sigmas)."""
    return float(np.median(np.concatenate([np.linalg.norm(left, axis=1) for left in residuals]))) / 1.18


def _without_spoilt(joint: Joint, solution: Solution) -> tuple[Joint, list[LeftOut]]:
    """Leave out sightings that miss by far more than others of their kind, the worst of each moment."""
    errors = np.array([solution.rms(i) for i in range(len(joint.sightings))])
    every, dropped = joint.sightings, []
    keep = np.ones(len(every), dtype=bool)
    for group in _groups(joint)[1:]:
        if not len(errors[group]):
            continue
        usual = float(np.median(errors[group]))
        worst: dict[str, int] = {}
        for i in range(group.start, group.stop):
            moment = every[i].picture
            if errors[i] > max(SPOILS_JOINT * usual, LEAST_SPOILED_PX) and errors[i] >= errors[worst.get(moment, i)]:
                worst[moment] = i
        for i in worst.values():
            keep[i] = False
            reason = (
                f"its corners miss by {errors[i]:.2f} px where those of the others miss by {usual:.2f} px:"
                " the board or the camera moved, or it is another moment"
            )
            dropped.append(LeftOut(every[i].camera, every[i].picture, reason))
    _, moments_at, thing_at = _groups(joint)
    moments = tuple(s for s, kept in zip(every[moments_at], keep[moments_at], strict=True) if kept)
    thing = tuple(s for s, kept in zip(every[thing_at], keep[thing_at], strict=True) if kept)
    seen = {sighting.picture for sighting in moments}
    boards = {moment: pose for moment, pose in joint.boards.items() if moment in seen}
    return replace(joint, moments=moments, thing=thing, boards=boards), dropped


def _strays(joint: Joint, solution: Solution) -> list[NDArray[np.bool_]]:
    """For each sighting, which of its corners are far from where those of its kind are; none of loose moments."""
    found: list[NDArray[np.bool_]] = []
    for k, group in enumerate(_groups(joint)):
        residuals = solution.residuals[group]
        if not residuals:
            continue
        limit = max(STRAY_SIGMAS * _usual_distance(residuals), STRAY_LEAST)
        limit = np.inf if k == 1 and joint.motion_mm > 0.0 else limit
        found += [np.linalg.norm(left, axis=1) > limit for left in residuals]
    return found


def _without_strays(joint: Joint, strays: Sequence[NDArray[np.bool_]]) -> tuple[Joint, list[LeftOut]]:
    dropped, kept = [], []
    for sighting, stray in zip(joint.sightings, strays, strict=True):
        if stray.any() and (~stray).sum() >= 4:
            reason = f"{int(stray.sum())} of its {len(stray)} corners lie elsewhere and are not used"
            dropped.append(LeftOut(sighting.camera, sighting.picture, reason))
            sighting = sighting.only(~stray)
        kept.append(sighting)
    a, b = len(joint.alone), len(joint.alone) + len(joint.moments)
    return replace(joint, alone=tuple(kept[:a]), moments=tuple(kept[a:b]), thing=tuple(kept[b:])), dropped
