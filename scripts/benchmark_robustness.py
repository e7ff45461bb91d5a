"""How far the fast fit is off when cameras, views and joints are not what it was told.

    python scripts/benchmark_robustness.py                               every fault on the project's own frames
    python scripts/benchmark_robustness.py --frames half_bowl --faults exact turned-0.3-moved-2 --seeds 0 1
    python scripts/benchmark_robustness.py --size 800x600 --json out/robustness.json

Every row is a fit of 8 exact silhouettes of a sagged frame whose cameras or pictures were then spoilt; see `FAULTS`. It
tells the mean and largest distance between the curves of twin and truth and the mean at the joints in mm, the share of
struts that lie within two of the standard deviations that the twin gives, the views that were left out, what held the
world, and the verdict. Under ``--exact`` the same with cameras believed to the last digit, as a comparison.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from frametwin.cameras import Camera
from frametwin.evaluation.evaluate import evaluate
from frametwin.files import write_json
from frametwin.fitting.api import fit_views
from frametwin.formats import find_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import SimulationSettings, simulate
from frametwin.wording import parsed_size

RADIUS_SHARE = 0.06
OWN = ("bridge", "half_bowl", "lattice_tower")


@dataclass(frozen=True, eq=False)
class Case:
    """What a fit is given, and what is true."""

    cameras: tuple[Camera, ...]
    masks: tuple[np.ndarray, ...]
    truth: Wireframe
    torn: tuple[tuple[int, int], ...] = ()
    """Strut and side of ends off their joints; ``truth`` has a vertex more for each."""


Fault = Callable[[Case, np.random.Generator], Case]


def changed(camera: Camera, **values: Any) -> Camera:
    """A camera with other values in some fields."""
    fields = ("name", "width", "height", "fl_x", "fl_y", "cx", "cy", "camera_to_world")
    return Camera(**{**{name: getattr(camera, name) for name in fields}, **values})


def moved(camera: Camera, rng: np.random.Generator, degrees: float, mm: float) -> Camera:
    """A camera turned and shifted by so much, each in a random direction."""
    pose = np.array(camera.camera_to_world)
    turn, shift = rng.normal(size=3), rng.normal(size=3)
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(np.deg2rad(degrees) * turn / np.linalg.norm(turn)).as_matrix()
    pose[:3, 3] += mm * shift / np.linalg.norm(shift)
    return changed(camera, camera_to_world=pose)


def every_camera(degrees: float = 0.0, mm: float = 0.0, focal: float = 0.0, centre: float = 0.0) -> Fault:
    """Every camera errs by so much, in directions of its own."""

    def spoil(case: Case, rng: np.random.Generator) -> Case:
        cameras = []
        for camera in case.cameras:
            camera = moved(camera, rng, degrees, mm)
            factor, angle = 1.0 + focal * rng.choice([-1.0, 1.0]), rng.uniform(0.0, 2.0 * np.pi)
            cameras.append(
                changed(
                    camera,
                    fl_x=camera.fl_x * factor,
                    fl_y=camera.fl_y * factor,
                    cx=camera.cx + centre * np.cos(angle),
                    cy=camera.cy + centre * np.sin(angle),
                )
            )
        return replace(case, cameras=tuple(cameras))

    return spoil


def bumped(case: Case, rng: np.random.Generator) -> Case:
    """One camera was turned by 2 degrees since it was calibrated."""
    cameras = list(case.cameras)
    cameras[3] = moved(cameras[3], rng, 2.0, 0.0)
    return replace(case, cameras=tuple(cameras))


def swapped(case: Case, rng: np.random.Generator) -> Case:
    """Two pictures belong to each other's cameras."""
    masks = list(case.masks)
    masks[1], masks[4] = masks[4], masks[1]
    return replace(case, masks=tuple(masks))


def black(case: Case, rng: np.random.Generator) -> Case:
    """One picture shows nothing."""
    masks = list(case.masks)
    masks[2] = np.zeros_like(masks[2])
    return replace(case, masks=tuple(masks))


def arm(value: float) -> Fault:
    """A robot arm covers a quarter of two views."""

    def spoil(case: Case, rng: np.random.Generator) -> Case:
        masks = list(case.masks)
        for view in (1, 5):
            mask = masks[view].copy()
            width = mask.shape[1]
            mask[:, width // 3 : width // 3 + width // 4] = value
            masks[view] = mask
        return replace(case, masks=tuple(masks))

    return spoil


def blobs(size: float) -> Fault:
    """Balls of material at the joints, so many times as thick as the thickest strut there."""

    def spoil(case: Case, rng: np.random.Generator) -> Case:
        truth = case.truth
        radius = np.zeros(truth.vertex_count)
        np.maximum.at(radius, truth.edges, np.repeat(truth.radius[:, None], 2, axis=1))
        masks = []
        for camera, mask in zip(case.cameras, case.masks, strict=True):
            seen, _ = camera.project(truth.vertices)
            depth = truth.vertices @ camera.world_to_camera[2, :3] + camera.world_to_camera[2, 3]
            masks.append(with_discs(mask, seen, size * radius * camera.fl_x / depth))
        return replace(case, masks=tuple(masks))

    return spoil


def with_discs(mask: np.ndarray, centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """White discs at pixels (N, 2) of radii (N,), with soft rims a pixel wide."""
    result = mask.copy()
    for (x, y), radius in zip(centres, radii, strict=True):
        left, top = max(0, int(x - radius - 1)), max(0, int(y - radius - 1))
        part = result[top : int(y + radius + 2), left : int(x + radius + 2)]
        rows, columns = np.mgrid[: part.shape[0], : part.shape[1]] + 0.5
        distance = np.hypot(columns + left - x, rows + top - y)
        np.maximum(part, np.clip(radius - distance + 0.5, 0.0, 1.0), out=part)
    return result


def base_moved(degrees: float, shift: Sequence[float]) -> Fault:
    """The base was moved, with the print on it, under cameras that are exact: the plan stays where it was."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
    motion[:3, 3] = shift

    def spoil(case: Case, rng: np.random.Generator) -> Case:
        cameras = tuple(changed(c, camera_to_world=motion @ c.camera_to_world) for c in case.cameras)
        rotation, truth = motion[:3, :3].T, case.truth
        points = {name: getattr(truth, name) @ rotation + motion[:3, 3] for name in ("vertices", "control_points")}
        return replace(case, cameras=cameras, truth=truth.replace(**points))

    return spoil


def torn(count: int, apart: float) -> Fault:
    """Ends of struts hang beside their joints, so many mm apart; the struts turned about their other ends."""

    def spoil(case: Case, rng: np.random.Generator) -> Case:
        truth, ends = case.truth, torn_candidates(case.truth, rng)[:count]
        curves = np.array(truth.control_points)
        for strut, side in ends:
            pivot, arm = curves[strut, 3 - 3 * side].copy(), curves[strut, 3 * side] - curves[strut, 3 - 3 * side]
            axis = np.cross(arm, rng.normal(size=3))
            angle = 2.0 * np.arcsin(min(1.0, 0.5 * apart / float(np.linalg.norm(arm))))
            rotation = Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle).as_matrix()
            curves[strut] = pivot + (curves[strut] - pivot) @ rotation.T
            curves[strut, 3 - 3 * side] = pivot
        spoilt = truth.detached(np.array(ends), control_points=curves)
        masks = tuple(mask / np.float32(255) for mask in silhouettes(spoilt, case.cameras))
        return replace(case, masks=masks, truth=spoilt, torn=tuple(ends))

    return spoil


def torn_candidates(truth: Wireframe, rng: np.random.Generator) -> list[tuple[int, int]]:
    """One end of each slender strut between joints that others hold too, in random order."""
    shared = (truth.degree[truth.edges] > 1).all(axis=1) & (truth.chord_lengths > 8.0 * truth.radius)
    sides = rng.integers(0, 2, truth.strut_count)
    ends = [(int(e), int(sides[e])) for e in rng.permutation(np.flatnonzero(shared))]
    return [(e, side) for e, side in ends if not truth.grounded[truth.edges[e, side]]]


def both(first: Fault, second: Fault) -> Fault:
    """One after the other."""
    return lambda case, rng: second(first(case, rng), rng)


FAULTS: dict[str, Fault] = {
    "exact": every_camera(),
    "turned-0.02": every_camera(degrees=0.02),
    "turned-0.1": every_camera(degrees=0.1),
    "moved-0.5": every_camera(mm=0.5),
    "turned-0.3-moved-2": every_camera(degrees=0.3, mm=2.0),
    "turned-1": every_camera(degrees=1.0),
    "focal-2%": every_camera(focal=0.02),
    "centre-10px": every_camera(centre=10.0),
    "bumped": bumped,
    "swapped": swapped,
    "black": black,
    "arm-black": arm(0.0),
    "arm-white": arm(1.0),
    "blobs-1.5": blobs(1.5),
    "blobs-2.5": blobs(2.5),
    "blobs-1.5-turned-0.05-moved-0.3": both(blobs(1.5), every_camera(degrees=0.05, mm=0.3)),
    "torn-3": torn(3, 5.0),
    "base-moved-5mm": base_moved(0.0, (3.0, 4.0, 0.0)),
    "base-turned-3": base_moved(3.0, (0.0, 0.0, 0.0)),
}
"""Degrees, mm, shares and pixels are sizes of the error of every camera, its direction being random."""


def measure(name: str, fault: str, seed: int, size: tuple[int, int], cameras: str) -> dict[str, Any]:
    """One fit of one spoilt capture."""
    plan = find_frame(name)
    plan = plan.replace(radius=np.full(plan.strut_count, RADIUS_SHARE * np.median(plan.chord_lengths)))
    made = simulate(plan, SimulationSettings(size=size, seed=seed))
    case = Case(tuple(made.cameras), tuple(image / np.float32(255) for image in made.images), made.truth)
    case = FAULTS[fault](case, np.random.default_rng([seed, 7]))
    began = perf_counter()
    twin = fit_views(made.frame, case.cameras, case.masks, changes={"cameras": cameras}).twin
    seconds = perf_counter() - began
    ends = [twin.control_points[strut, 3 * side] for strut, side in case.torn]
    errors = evaluate(twin.curves, np.array([*twin.vertices, *ends]), case.truth)
    assert twin.sigma_across is not None and twin.attached is not None
    found = {(int(strut), int(side)) for strut, side in np.argwhere(~twin.attached)}
    return {
        "frame": name,
        "fault": fault,
        "seed": seed,
        "cameras": cameras,
        "mean": errors.curves.mean,
        "max": errors.curves.max,
        "joints": errors.joints.mean,
        "within_two_sigma": float((errors.strut_mean <= 2.0 * twin.sigma_across).mean()),
        "sigma": float(np.median(twin.sigma_across)),
        "left_out": [view["name"] for view in twin.views if not view["used"]],
        "held_by": twin.cameras[0]["held_by"] if twin.cameras else "rig",
        "torn_found": len(found & set(case.torn)),
        "torn_false": len(found - set(case.torn)),
        "verdict": twin.verdict.status,
        "seconds": seconds,
    }


def main(words: Sequence[str] | None = None) -> int:
    """Measure and print a table, row by row."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--frames", nargs="+", default=list(OWN), metavar="FRAME", help="built-in names, or files")
    parser.add_argument("--faults", nargs="+", default=list(FAULTS), choices=list(FAULTS), metavar="FAULT")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--size", default="1600x1200", metavar="WIDTHxHEIGHT")
    parser.add_argument("--exact", action="store_true", help="believe the cameras to the last digit")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows there")
    options = parser.parse_args(words)
    size = parsed_size(options.size)
    if size is None:
        parser.error("--size: write WIDTHxHEIGHT, such as 1600x1200")
    rows = []
    print(
        "| frame | fault | seed | mean / max mm | joints mm | within 2 sigma | left out | torn, false | held by |"
        " verdict | s |"
    )
    print("| --- " * 11 + "|")
    for name in options.frames:
        for fault in options.faults:
            for seed in options.seeds:
                mode = "exact" if options.exact else "auto"
                row = measure(name, fault, seed, size, mode)
                rows.append(row)
                print(
                    f"| {Path(name).stem} | {fault} | {seed} | {row['mean']:.3f} / {row['max']:.2f} |"
                    f" {row['joints']:.3f} | {row['within_two_sigma']:.2f} | {len(row['left_out'])} |"
                    f" {row['torn_found']}, {row['torn_false']} | {row['held_by']} | {row['verdict']} |"
                    f" {row['seconds']:.1f} |",
                    flush=True,
                )
    if options.json is not None:
        write_json(options.json, {"rows": rows})
    return 0


if __name__ == "__main__":
    sys.exit(main())
