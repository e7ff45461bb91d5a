"""One lens from pictures of a board: start, distortion terms chosen by held-out pictures, outliers, covariance.

Z. Zhang, "A flexible new technique for camera calibration", PAMI 22(11), 2000.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.bundle import Body, Bundle, Eye, Link, Solution, solve
from frametwin.calibration.detection import Sighting
from frametwin.calibration.looking import LeftOut
from frametwin.calibration.poses import board_poses
from frametwin.calibration.variety import check_variety
from frametwin.cameras.lens_models import FISHEYE, LENS_KEYS, PERSPECTIVE
from frametwin.cameras.rig_file import RigCamera
from frametwin.errors import InputError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

TERMS: dict[str, tuple[tuple[str, ...], ...]] = {
    PERSPECTIVE: (("p1", "p2"), ("k1", "p1", "p2"), ("k1", "k2", "p1", "p2"), ("k1", "k2", "p1", "p2", "k3")),
    FISHEYE: ((), ("k1",), ("k1", "k2"), ("k1", "k2", "k3"), ("k1", "k2", "k3", "k4")),
}
"""Distortion terms from the fewest to the most. Tangential ones are always among them: where they are left out although
the lens has them, a wrong principal point and a turned camera make up for them, and no held-out picture tells."""

FOLDS = 4
LEAST_PICTURES = 3
FEW_PICTURES = 8
FOCAL_SHARES = np.geomspace(0.35, 5.0, 14)
"""Focal lengths with which a start is tried, as shares of the longer side."""

SPOILS = 2.5
"""A picture whose corners miss by so many times the median of the pictures spoils the result."""

LEAST_PX = 0.03
"""Standard deviation of a corner that covariances take at least: what blur and markers nearby do to corners is common
to a board, and residuals do not show it."""

FEW_STRAYS = 0.2
"""A picture of which a larger share of the corners strays is left out as a whole."""

STRAY_SIGMAS, STRAY_LEAST = 5.0, 0.5
"""A corner further off than both (the second in px) is left out."""

ROBUST_PX = 0.5

NOMINAL_PX = 0.25
"""Standard deviation of a corner, before it is known, with which it is weighed against what is known beforehand."""

SQUARE_SHARE, MIDDLE_SHARE, TANGENTIAL = 0.002, 0.04, 0.002
"""What is known beforehand: how far pixels are from square, as a share of the focal length, how far the principal point
is from the middle, as a share of the longer side, and how large the tangential terms are; standard deviations. They
matter where pictures tell little."""


@dataclass(frozen=True, eq=False)
class Lens:
    """What was found of one camera.

    Attributes
    ----------
    camera
        Lens, covariance and residuals; no pose.
    terms
        Distortion terms that are used.
    held_out
        Root mean square error in px of held-out pictures for each choice of terms.
    used
        Sightings that were used, without stray corners.
    poses : list of (4, 4) arrays, mm
        From the board's axes to the camera's, for each of them.
    residuals : list of (N, 2) arrays, px
        For each of them.
    left_out
        Pictures and corners that were not.
    notes
        Sentences for the user.
    """

    camera: RigCamera
    terms: tuple[str, ...]
    held_out: dict[str, float]
    used: tuple[Sighting, ...]
    poses: tuple[Floats, ...]
    residuals: tuple[Floats, ...]
    left_out: tuple[LeftOut, ...]
    notes: tuple[str, ...] = field(default=())


def calibrate_lens(
    name: str,
    size: tuple[int, int],
    sightings: Sequence[Sighting],
    model: str = PERSPECTIVE,
    watch: Callable[[], object] | None = None,
) -> Lens:
    """Find the lens of a camera.

    Parameters
    ----------
    name
        The camera's name.
    size
        Width and height of its pictures.
    sightings
        The board in its pictures.
    model
        ``OPENCV`` or ``OPENCV_FISHEYE``.
    watch
        Called now and then; may raise to stop.

    Raises
    ------
    InputError
        If there are too few pictures, or the lens cannot be found from them.
    """
    if len(sightings) < LEAST_PICTURES:
        problem = f"the board is seen in {len(sightings)} of its pictures"
        raise InputError.at(f"camera {name}", "pictures", problem, "take ten to twenty with the board at all angles")
    every = TERMS[model][-1]
    start = _start(name, size, sightings, model)
    kept = list(sightings)
    found = _solved(model, start, size, kept, TERMS[model][2], watch)
    found, kept, single = _without_strays(found, kept, model, size, TERMS[model][2], watch)
    found, kept, spoilt = _without_outliers(found, kept, model, size, TERMS[model][2], watch)
    if len(kept) < LEAST_PICTURES:
        problem = "its pictures contradict each other"
        remedy = "check that the board is flat and --board is right, and take them again"
        raise InputError.at(f"camera {name}", "pictures", problem, remedy)
    held_out = _held_out(found, kept, model, size, watch)
    terms = _choose(held_out, TERMS[model])
    found = _solved(model, found.bundle.eyes[0].lens, size, kept, terms, watch)
    found, kept, more = _without_outliers(found, kept, model, size, terms, watch)
    px = max(found.sigma * NOMINAL_PX, LEAST_PX)
    found = solve(weighed(found.bundle, px), covariance=True, least_sigma=LEAST_PX / px)
    means = {"+".join(key) or "none": float(np.sqrt(values.mean())) for key, values in held_out.items()}
    notes = _notes(name, size, found, kept, every)
    return Lens(
        camera=_camera(name, size, model, found, found.sigma * px, kept, terms, means),
        terms=terms,
        held_out=means,
        used=tuple(kept),
        poses=tuple(body.pose for body in found.bundle.bodies),
        residuals=found.residuals,
        left_out=tuple([*single, *spoilt, *more]),
        notes=tuple(notes),
    )


def _start(name: str, size: tuple[int, int], sightings: Sequence[Sighting], model: str) -> Floats:
    """The focal length with which flat boards fit best, the principal point in the middle."""
    chosen = sightings[:: max(1, len(sightings) // 12)]
    best: tuple[float, Floats] | None = None
    for share in FOCAL_SHARES:
        lens = np.zeros(len(LENS_KEYS[model]))
        lens[:2] = share * max(size)
        lens[2:4] = 0.5 * np.array(size)
        found = [board_poses(model, lens, sighting) for sighting in chosen]
        errors = [poses[0][0] for poses in found if poses]
        if len(errors) >= max(2, len(chosen) // 2) and (best is None or np.median(errors) < best[0]):
            best = (float(np.median(errors)), lens)
    if best is None:
        remedy = "check --board and --model, and take pictures with the board tilted"
        raise InputError.at(f"camera {name}", "pictures", "no focal length fits them", remedy)
    return best[1]


def _free(model: str, terms: Sequence[str]) -> Bools:
    return np.array([key in ("fl_x", "fl_y", "cx", "cy", *terms) for key in LENS_KEYS[model]])


def _bundle(model: str, lens: Floats, size: tuple[int, int], sightings: Sequence[Sighting], free: Bools) -> Bundle:
    """One camera at the origin, and a board for each picture, at its better pose."""
    bodies = []
    for sighting in sightings:
        poses = board_poses(model, lens, sighting)
        pose = poses[0][1] if poses else _somewhere(sighting, lens)
        bodies.append(Body(pose))
    weight = 1.0 / NOMINAL_PX
    links = [Link(0, i, sighting.points, sighting.pixels, weight) for i, sighting in enumerate(sightings)]
    prior, mean = beforehand(model, lens, size)
    eye = Eye(model, lens, free, np.eye(4), fixed=True, prior=prior, prior_mean=mean)
    return Bundle((eye,), tuple(bodies), tuple(links))


def weighed(bundle: Bundle, px: float) -> Bundle:
    """A bundle whose corners have another standard deviation."""
    return replace(bundle, links=tuple(replace(link, weight=1.0 / px) for link in bundle.links))


def beforehand(model: str, lens: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """What is known of a lens before any picture: its inverse covariance (P, P), and the mean (P,) it is about."""
    prior, mean = np.zeros((len(lens), len(lens))), np.zeros(len(lens))
    mean[2:4] = 0.5 * np.array(size)
    prior[2, 2] = prior[3, 3] = (MIDDLE_SHARE * max(size)) ** -2
    prior[:2, :2] = np.array([[1.0, -1.0], [-1.0, 1.0]]) * (SQUARE_SHARE * lens[0]) ** -2
    for i, key in enumerate(LENS_KEYS[model]):
        prior[i, i] += TANGENTIAL**-2 if key in ("p1", "p2") else 0.0
    return prior, mean


def _somewhere(sighting: Sighting, lens: Floats) -> Floats:
    """A pose that faces the camera, where none can be computed."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    extent = float(np.linalg.norm(np.ptp(sighting.points, axis=0)))
    depth = lens[0] * extent / max(float(np.linalg.norm(np.ptp(sighting.pixels, axis=0))), 1.0)
    aside = (sighting.pixels.mean(axis=0) - lens[2:4]) / lens[:2]
    pose[:3, 3] = depth * np.array([*aside, 1.0])
    return pose


def _solved(
    model: str,
    lens: Floats,
    size: tuple[int, int],
    sightings: Sequence[Sighting],
    terms: Sequence[str],
    watch: Callable[[], object] | None,
) -> Solution:
    """Robustly, with each board at the better of its two poses."""
    free = _free(model, terms)
    lens = np.where(free, lens, 0.0)
    found = solve(_bundle(model, lens, size, sightings, free), robust_px=4.0 * ROBUST_PX, steps=30, watch=watch)
    again = _bundle(model, found.bundle.eyes[0].lens, size, sightings, free)
    return solve(again, robust_px=ROBUST_PX, watch=watch)


def _without_outliers(
    found: Solution,
    kept: list[Sighting],
    model: str,
    size: tuple[int, int],
    terms: Sequence[str],
    watch: Callable[[], object] | None,
) -> tuple[Solution, list[Sighting], list[LeftOut]]:
    """Leave out one picture after the other that does not go with the rest, then single corners."""
    left_out: list[LeftOut] = []
    while len(kept) > LEAST_PICTURES:
        errors = np.array([found.rms(i) for i in range(len(kept))])
        worst = int(errors.argmax())
        usual = float(np.median(np.delete(errors, worst)))
        if errors[worst] <= max(SPOILS * usual, 0.1):
            break
        reason = f"its corners miss by {errors[worst]:.2f} px where those of the others miss by {usual:.2f} px"
        left_out.append(LeftOut(kept[worst].camera, kept[worst].picture, reason))
        del kept[worst]
        found = _solved(model, found.bundle.eyes[0].lens, size, kept, terms, watch)
    found, kept, strays = _without_strays(found, kept, model, size, terms, watch)
    return found, kept, [*left_out, *strays]


def _without_strays(
    found: Solution,
    kept: list[Sighting],
    model: str,
    size: tuple[int, int],
    terms: Sequence[str],
    watch: Callable[[], object] | None,
) -> tuple[Solution, list[Sighting], list[LeftOut]]:
    """Leave out single corners of pictures that are fine otherwise."""
    left_out: list[LeftOut] = []
    strays = [
        stray if stray.sum() <= FEW_STRAYS * len(stray) else np.zeros_like(stray) for stray in stray_corners(found)
    ]
    for i, stray in enumerate(strays):
        if stray.any() and (~stray).sum() >= 6:
            reason = f"{int(stray.sum())} of its {len(stray)} corners lie elsewhere and are not used"
            left_out.append(LeftOut(kept[i].camera, kept[i].picture, reason))
            kept[i] = kept[i].only(~stray)
    if any(stray.any() for stray in strays):
        found = _solved(model, found.bundle.eyes[0].lens, size, kept, terms, watch)
    return found, kept, left_out


def stray_corners(found: Solution) -> list[Bools]:
    """For each link, which of its corners are far from where they belong."""
    distances = [np.linalg.norm(left, axis=1) for left in found.residuals]
    usual = float(np.median(np.concatenate(distances))) / 1.18  # the median of a plane Gaussian in sigmas
    return [distance > max(STRAY_SIGMAS * usual, STRAY_LEAST) for distance in distances]


def _held_out(
    found: Solution,
    sightings: Sequence[Sighting],
    model: str,
    size: tuple[int, int],
    watch: Callable[[], object] | None,
) -> dict[tuple[str, ...], Floats]:
    """(N,) mean squared error of each picture under lenses found without it, for each choice of terms."""
    start, folds = found.bundle.eyes[0].lens, min(FOLDS, len(sightings))
    result = {}
    for terms in TERMS[model]:
        free = _free(model, terms)
        errors = np.zeros(len(sightings))
        begin = _bundle(model, np.where(free, start, 0.0), size, sightings, free)
        whole = solve(begin, robust_px=ROBUST_PX, steps=15, watch=watch)
        for fold in range(folds):
            inside = [i for i in range(len(sightings)) if i % folds != fold]
            outside = [i for i in range(len(sightings)) if i % folds == fold]
            part = _part(whole.bundle, inside, free)
            lens = solve(part, robust_px=ROBUST_PX, steps=8, watch=watch).bundle.eyes[0].lens
            held = _part(whole.bundle, outside, np.zeros(len(free), dtype=bool), lens)
            left = solve(held, steps=6, watch=watch).residuals
            errors[outside] = [float((part**2).sum(axis=1).mean()) for part in left]
        result[terms] = errors
    return result


def _part(bundle: Bundle, chosen: Sequence[int], free: Bools, lens: Floats | None = None) -> Bundle:
    eye = replace(bundle.eyes[0], lens=bundle.eyes[0].lens if lens is None else lens, free=free)
    links = [replace(bundle.links[i], body=j) for j, i in enumerate(chosen)]
    return Bundle((eye,), tuple(bundle.bodies[i] for i in chosen), tuple(links))


def _choose(held_out: dict[tuple[str, ...], Floats], choices: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """The fewest terms that are not worse than the best by more than chance, picture by picture.

    One standard error, no more: a term too many costs little, one too few bends everything.
    """
    best = min(choices, key=lambda terms: float(held_out[terms].mean()))
    for terms in choices:
        if terms == best:
            break
        worse = held_out[terms] - held_out[best]
        chance = worse.std(ddof=1) / np.sqrt(len(worse))
        if worse.mean() <= chance and worse.mean() <= 0.05 * held_out[best].mean():
            return terms
    return best


def _camera(
    name: str,
    size: tuple[int, int],
    model: str,
    found: Solution,
    sigma_px: float,
    kept: Sequence[Sighting],
    terms: Sequence[str],
    held_out: dict[str, float],
) -> RigCamera:
    count = len(LENS_KEYS[model])
    covariance = found.eye_covariance(0)[:count, :count]
    figures = {
        "rms_px": float(np.sqrt(np.mean(np.concatenate([(left**2).sum(axis=1) for left in found.residuals])))),
        "sigma_px": sigma_px,
        "pictures": len(kept),
        "corners": sum(len(sighting.corners) for sighting in kept),
        "distortion": list(terms),
        "held_out_rms_px": held_out,
    }
    return RigCamera(name, size[0], size[1], model, found.bundle.eyes[0].lens, None, covariance, figures)


def _notes(
    name: str, size: tuple[int, int], found: Solution, kept: Sequence[Sighting], every: Sequence[str]
) -> list[str]:
    notes = []
    if len(kept) < FEW_PICTURES:
        notes.append(f"{name}: only {len(kept)} pictures could be used; ten to twenty are better")
    notes += [f"{name}: {text}" for text in check_variety([body.pose for body in found.bundle.bodies], kept, size)]
    sigma = np.sqrt(np.diag(found.eye_covariance(0)))[:2].max() / found.bundle.eyes[0].lens[0]
    if sigma > 0.01:
        notes.append(f"{name}: the focal length is only known to {100.0 * sigma:.1f} %; take more pictures, tilted")
    return notes
