"""The bundle of a whole rig: boards that one camera saw alone, boards at shared moments, and the object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.bundle import Body, Bundle, Eye, Link, Solution, solve
from frametwin.calibration.detection import Sighting
from frametwin.calibration.intrinsics import NOMINAL_PX, ROBUST_PX, SPOILS, beforehand, stray_corners
from frametwin.calibration.looking import LeftOut
from frametwin.calibration.poses import board_poses
from frametwin.cameras.lens_models import LENS_KEYS
from frametwin.cameras.rig_file import RigCamera

Floats = NDArray[np.float64]

LEAST_SPOILED_PX = 0.3
"""A sighting that misses by less is never left out."""


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
    looseness
        By how much more the corners of a moment miss than those of one picture, for boards that moved between the
        pictures of a moment; 1 for moments that are moments.
    """

    cameras: tuple[RigCamera, ...]
    places: dict[str, Floats]
    alone: tuple[Sighting, ...]
    moments: tuple[Sighting, ...]
    boards: dict[str, Floats]
    thing: tuple[Sighting, ...] = ()
    thing_pose: Floats | None = None
    looseness: float = 1.0

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
        figures["sigma_px"] = self.solution.sigma * NOMINAL_PX
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

    def link(sighting: Sighting, body: int, loose: float = 1.0) -> None:
        if loose > 1.0:  # what a board's motion adds is common to its corners: they count as three, not as many
            loose *= float(np.sqrt(max(len(sighting.corners) / 3.0, 1.0)))
        weight = 1.0 / (NOMINAL_PX * loose)
        links.append(Link(numbers[sighting.camera], body, sighting.points, sighting.pixels, weight))

    for sighting in joint.alone:
        camera = joint.cameras[numbers[sighting.camera]]
        poses = board_poses(camera.model, camera.lens, sighting)
        bodies.append(Body(joint.places[camera.name] @ poses[0][1]))
        link(sighting, len(bodies) - 1)
    order = {moment: len(bodies) + i for i, moment in enumerate(joint.boards)}
    bodies += [Body(pose) for pose in joint.boards.values()]
    for sighting in joint.moments:
        link(sighting, order[sighting.picture], joint.looseness)
    if joint.thing_pose is not None:
        bodies.append(Body(joint.thing_pose, fixed=True))
        for sighting in joint.thing:
            link(sighting, len(bodies) - 1)
    return Bundle(tuple(eyes), tuple(bodies), tuple(links))


def _eye(camera: RigCamera, place: Floats, fixed: bool) -> Eye:
    terms = camera.residuals.get("distortion", LENS_KEYS[camera.model][4:])
    free = np.array([i < 4 or key in terms for i, key in enumerate(LENS_KEYS[camera.model])])
    prior, mean = beforehand(camera.lens, (camera.width, camera.height))
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
    left_out: list[LeftOut] = []
    solution = solve(bundle_of(joint), robust_px=4.0 * ROBUST_PX, watch=watch, steps=40)
    joint = _at(joint, solution)
    solution = solve(bundle_of(joint), robust_px=ROBUST_PX, watch=watch)
    for _ in range(3):
        joint, dropped = _without_spoilt(_at(joint, solution), solution)
        if not dropped:
            break
        left_out += dropped
        solution = solve(bundle_of(joint), robust_px=ROBUST_PX, watch=watch)
    joint = _at(joint, solution)
    strays = stray_corners(solution)
    if any(stray.any() for stray in strays):
        joint, dropped = _without_strays(joint, strays)
        left_out += dropped
    solution = solve(bundle_of(joint), covariance=True, watch=watch)
    return Adjusted(_at(joint, solution), solution, tuple(left_out))


def _without_spoilt(joint: Joint, solution: Solution) -> tuple[Joint, list[LeftOut]]:
    """Leave out sightings that miss by far more than others; the worst of a moment first, the others may then fit."""
    errors = np.array([solution.rms(i) for i in range(len(joint.sightings))])
    offset = len(joint.alone)
    usual = float(np.median(errors[offset:]))
    limit = max(SPOILS * usual, LEAST_SPOILED_PX)
    worst: dict[str, int] = {}
    for i, sighting in enumerate((*joint.moments, *joint.thing)):
        group = sighting.picture if i < len(joint.moments) else "\0object"
        if errors[offset + i] > limit and (group not in worst or errors[offset + i] > errors[offset + worst[group]]):
            worst[group] = i
    dropped = [
        LeftOut(
            (*joint.moments, *joint.thing)[i].camera,
            (*joint.moments, *joint.thing)[i].picture,
            f"its corners miss by {errors[offset + i]:.2f} px where those of the others miss by {usual:.2f} px:"
            " the board or the camera moved, or it is another moment",
        )
        for i in sorted(worst.values())
    ]
    count = len(joint.moments)
    moments = tuple(s for i, s in enumerate(joint.moments) if i not in worst.values())
    thing = tuple(s for i, s in enumerate(joint.thing) if count + i not in worst.values())
    if joint.thing and not thing:
        return joint, []
    seen = {sighting.picture for sighting in moments}
    boards = {moment: pose for moment, pose in joint.boards.items() if moment in seen}
    return replace(joint, moments=moments, thing=thing, boards=boards), dropped


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
