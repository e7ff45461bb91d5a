"""What the rays through pixel centres meet, in plain numpy: Blender's pictures are held against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.cameras import Camera, look_at
from frametwin.capture.scene import Scene
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

PIECES = 24


@dataclass(frozen=True)
class Rods:
    """Straight pieces of struts: ends (S, 3), the radius at both (S, 2), strut (S,)."""

    start: np.ndarray
    end: np.ndarray
    radius: np.ndarray
    strut: np.ndarray


def rods(scene: Scene) -> Rods:
    """Pieces so short that bends do not matter; the radius is linear in each."""
    starts, ends, radii, struts = [], [], [], []
    knots = np.linspace(0.0, 1.0, scene.thickness.shape[1])
    for k in np.flatnonzero(scene.truth.printed):
        low, high = scene.present[k]
        if high <= low:
            continue
        u = np.union1d(np.linspace(low, high, PIECES + 1), knots[(knots > low) & (knots < high)])
        points = bezier.evaluate(scene.truth.control_points[k], u)
        starts.append(points[:-1])
        ends.append(points[1:])
        radius = np.interp(u, knots, scene.thickness[k])
        radii.append(np.column_stack([radius[:-1], radius[1:]]))
        struts.append(np.full(len(u) - 1, k))
    if not starts:
        return Rods(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0, dtype=int))
    return Rods(*(np.concatenate(parts) for parts in (starts, ends, radii, struts)))


def rays(camera: Camera) -> np.ndarray:
    """(H, W, 3) directions through the pixel centres in the world, of the depth 1 along the optical axis."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    return camera.unproject(np.stack([x, y], axis=-1), np.ones(x.shape)) - camera.centre


def margin(scene: Scene, camera: Camera) -> np.ndarray:
    """(H, W) how many pixels the ray of each pixel passes outside of the nearest outline; negative inside."""
    toward = rays(camera)
    unit = toward / np.linalg.norm(toward, axis=-1, keepdims=True)
    least = np.full(toward.shape[:2], np.inf)
    pieces = rods(scene)
    for a, b, radius in zip(pieces.start - camera.centre, pieces.end - camera.centre, pieces.radius, strict=True):
        e = b - a
        along_a, along_e = unit @ a, unit @ e
        across = e @ e - along_e**2
        t = np.clip((along_a * along_e - a @ e) / np.maximum(across, 1e-12), 0.0, 1.0)
        point = a + t[..., None] * e
        depth = np.sum(point * unit, axis=-1)
        distance = np.sqrt(np.maximum(np.sum(point**2, axis=-1) - depth**2, 0.0))
        least = np.minimum(
            least, (distance - radius[0] - t * (radius[1] - radius[0])) / depth * min(camera.fl_x, camera.fl_y)
        )
    return least


def distance_to_rods(points: np.ndarray, pieces: Rods) -> tuple[np.ndarray, np.ndarray]:
    """(P,) distance of points (P, 3) from the nearest surface, negative inside, and (P, S) from each piece's."""
    e = pieces.end - pieces.start
    offset = points[:, None] - pieces.start
    t = np.clip(np.sum(offset * e, axis=-1) / np.sum(e * e, axis=-1), 0.0, 1.0)
    radius = pieces.radius[:, 0] + t * np.diff(pieces.radius, axis=1)[:, 0]
    each = np.linalg.norm(offset - t[..., None] * e, axis=-1) - radius
    return each.min(axis=1), each


def tower(curved: bool = False) -> Wireframe:
    """A square tower with one diagonal on each side, 20 mm wide, two levels of 20 mm."""
    corners = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]]
    vertices = [[x, y, 20.0 * level] for level in range(3) for x, y in corners]
    edges = []
    for low in (0, 4):
        for i in range(4):
            here, after = low + i, low + (i + 1) % 4
            edges += [[here, here + 4], [here + 4, after + 4], [here, after + 4]]
    frame = Wireframe.create(vertices, edges, radius=1.0, name="tower")
    if not curved:
        return frame
    curves = frame.control_points.copy()
    curves[:, 1:3] += np.random.default_rng(5).normal(scale=2.0, size=(len(edges), 2, 3))
    return frame.replace(control_points=curves)


def cameras(scale: float = 1.0) -> tuple[Camera, ...]:
    """Two views of other sizes; one with oblong pixels and its principal point far from the middle."""
    first = look_at([95.0, 22.0, 45.0], [10.0, 10.0, 20.0])
    second = look_at([-40.0, 62.0, 8.0], [10.0, 10.0, 22.0])
    return (
        Camera("left", 160, 120, 190.0, 190.0, 80.0, 60.0, first).resized(round(160 * scale), round(120 * scale)),
        Camera("right", 96, 144, 170.0, 140.0, 61.7, 63.3, second).resized(round(96 * scale), round(144 * scale)),
    )


def faulty(curved: bool = True) -> Scene:
    """A partial print with missing and broken struts of uneven thickness."""
    frame = tower(curved)
    rng = np.random.default_rng(3)
    count = frame.strut_count
    frame = frame.replace(printed=np.arange(count) < count - 5)
    present = np.tile([0.0, 1.0], (count, 1))
    present[[1, 4]] = 0.0
    present[6], present[9], present[12] = [0.0, 0.45], [0.3, 1.0], [0.25, 0.6]
    return Scene(frame, present, 1.0 + 0.3 * rng.uniform(-1.0, 1.0, size=(count, 5)), cameras())
