"""How fast and how true a twin follows a stream: a bowl that leans, arms that hide half of some views, a jump, a fall.

``python scripts/benchmark_tracking.py [--size 1600x1200] [--views 8]``

Pictures are drawn beforehand and held as PNG; a moment takes as long as decoding, following and making the twin.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rigs import box_around, ring_rig
from frametwin.geometry.parametric import half_bowl
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes
from frametwin.tracking.events import Event
from frametwin.tracking.pictures import WORKERS
from frametwin.tracking.tracker import Tracker
from frametwin.wording import parsed_size

STEP = 0.2
"""Seconds between two moments."""

JUMP = np.array([6.0, 3.0, 0.0])
FALLEN = 100

Moment = tuple[str, np.ndarray, tuple[int, ...], int | None]


def schedule() -> list[Moment]:
    """Of every moment: what happens, by how many mm the rim has gone, which struts are not there, an arm's colour."""
    way = [np.array([x, 0.3 * x, -0.1 * x]) for x in np.linspace(0.0, 3.0, 16)]
    moments: list[Moment] = [("leans", by, (), None) for by in way[:6]]
    moments += [("white arm", by, (), 255) for by in way[6:11]]
    moments += [("dark arm", by, (), 0) for by in way[11:]]
    moments += [("still", way[-1], (), None)] * 6
    moments += [("jump", way[-1] + JUMP, (), None)] * 6
    moments += [("fall", way[-1] + JUMP, (FALLEN,), None)] * 6
    return moments


def real(plan: Wireframe, by: np.ndarray, without: Sequence[int]) -> Wireframe:
    """The print where it is: it leans by the square of the height."""
    height = float(plan.vertices[:, 2].max())
    printed = plan.printed.copy()
    printed[list(without)] = False

    def leant(points: np.ndarray) -> np.ndarray:
        return np.asarray(points + (points[..., 2:] / height) ** 2 * by)

    return plan.replace(vertices=leant(plan.vertices), control_points=leant(plan.control_points), printed=printed)


def encoded(frame: Wireframe, cameras: Sequence[Camera], arm: int | None) -> list[np.ndarray]:
    """The pictures as PNG, with an arm over the left half of three of them."""
    pictures = silhouettes(frame, cameras)
    for view in range(3) if arm is not None else ():
        height, width = pictures[view].shape
        pictures[view][: round(0.9 * height), : width // 2] = arm
    return [cv2.imencode(".png", picture)[1] for picture in pictures]


def decoded(picture: np.ndarray) -> np.ndarray:
    """A picture of a moment, as a folder's are read."""
    return np.asarray(cv2.imdecode(picture, cv2.IMREAD_UNCHANGED))


def main() -> None:
    """Follow the stream and print one line a moment, then a summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="1600x1200")
    parser.add_argument("--views", type=int, default=8)
    options = parser.parse_args()
    size = parsed_size(options.size)
    if size is None:
        parser.error("--size is width x height, such as 1600x1200")
    plan = half_bowl()
    cameras = ring_rig(box_around(plan, real(plan, np.array([12.0, 6.0, 0.0]), ())), options.views, size=size)
    tracker, readers = Tracker(plan, cameras), ThreadPoolExecutor(WORKERS)
    wall, cpu, told = [], [], list[Event]()
    worst: dict[str, list[float]] = {}
    for n, (name, by, without, arm) in enumerate(schedule()):
        truth = real(plan, by, without)
        pictures = encoded(truth, cameras, arm)
        began, used = time.perf_counter(), time.process_time()
        images = list(readers.map(decoded, pictures))
        tracked = tracker.follow(images, n * STEP)
        tracker.result()
        wall.append(time.perf_counter() - began)
        cpu.append(time.process_time() - used)
        error = np.linalg.norm(tracker.vertices - truth.vertices, axis=1)
        worst.setdefault(name, []).append(float(error.max()))
        told += tracked.events
        events = "; ".join(str(event) for event in tracked.events)
        print(f"{n:3d} {name:10} {error.mean():.3f} / {error.max():.2f} mm  {events}")
    summary = {
        "struts": plan.strut_count,
        "seconds a moment": float(np.median(wall[1:])),
        "processor seconds a moment": float(np.median(cpu[1:])),
        "largest error of a joint at the end, mm": {name: errors[-1] for name, errors in worst.items()},
        "told after, s": {event.kind: round(event.time, 2) for event in reversed(told)},
    }
    print(json.dumps(summary, indent=2))


if __name__ == "__main__":
    main()
