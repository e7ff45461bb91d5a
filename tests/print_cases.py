"""A print for tests that knows nothing of the project's physics: what is laid leans over, batch by batch."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Collection
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import write_capture
from frametwin.geometry.wireframe import Wireframe, straight_control_points
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.toolpath.workspace import Workspace
from frametwin.raster.silhouette import silhouettes

SIZE = (300, 400)
VIEWS = 5
LEAN = np.array([1.2, 0.5, -0.4])
"""mm by which the top of the design goes sideways and down in every batch; the plate stays."""


class LeaningPrint:
    """Straight struts that are laid where the plan says and lean with all that stands.

    A strut starts on the real joint; its end comes into being where the plan has it. After every batch each joint
    moves by ``lean`` times the square of its share of the height.
    """

    def __init__(self, design: Wireframe, lean: np.ndarray = LEAN) -> None:
        self.design, self.lean = design, lean
        self.vertices = np.array(design.vertices)
        self.printed = np.zeros(design.strut_count, dtype=bool)

    def lay(self, struts: np.ndarray, plan: Wireframe) -> Wireframe:
        """Lay a batch; what stands then."""
        held = self.design.replace(printed=self.printed).printed_vertices()
        new = np.unique(self.design.edges[struts])
        new = new[~held[new] & ~self.design.grounded[new]]
        self.vertices[new] = plan.vertices[new]
        self.printed[struts] = True
        there = self.design.replace(printed=self.printed).printed_vertices()
        self.vertices += np.where(there[:, None], self.step, 0.0)
        return self.standing()

    @property
    def step(self) -> np.ndarray:
        """(V, 3) mm by which each joint moves in a batch once it is there."""
        share = self.design.vertices[:, 2] / self.design.vertices[:, 2].max()
        return (share**2)[:, None] * self.lean

    def standing(self, without: Collection[int] = ()) -> Wireframe:
        """What stands, as a frame."""
        printed = self.printed.copy()
        printed[list(without)] = False
        curves = straight_control_points(self.vertices, self.design.edges)
        return self.design.replace(vertices=self.vertices, control_points=curves, printed=printed)

    def take(self, folder: Path, standing: Wireframe | None = None) -> Path:
        """Pictures of what really stands, as a user has them: cameras and pictures, no frame."""
        standing = self.standing() if standing is None else standing
        cameras = cameras_of(self.design)
        write_capture(folder, standing, cameras, silhouettes(standing, cameras))
        (folder / "frame.json").unlink()
        return folder


def turned_workspace() -> Workspace:
    """The print stands turned and shifted before the robot."""
    base = np.eye(4)
    base[:3, :3] = Rotation.from_euler("z", 35.0, degrees=True).as_matrix()
    base[:3, 3] = [500.0, -120.0, 40.0]
    return Workspace([400.0, -250.0, 39.0], [600.0, 0.0, 250.0], base, max_speed=100.0)


def cameras_of(design: Wireframe) -> tuple[Camera, ...]:
    """Cameras that see the design and what it leans over."""
    room = 0.2 * design.extent
    return ring_rig(np.stack([design.bounds[0] - room, design.bounds[1] + room]), VIEWS, size=SIZE)


def take_with(folder: Path, real: Wireframe, cameras: tuple[Camera, ...], told: tuple[Camera, ...]) -> Path:
    """Pictures by some cameras that are told to be others."""
    named = [dataclasses.replace(camera, name=other.name) for camera, other in zip(told, cameras, strict=True)]
    write_capture(folder, real, named, silhouettes(real, cameras))
    (folder / "frame.json").unlink()
    return folder


def small_job(folder: Path, design: Wireframe, batch_size: int = 8, **options: object) -> PrintJob:
    """A job for a small frame, which meets what stands and does not forecast, unless told so."""
    wanted = {"batch_size": batch_size, "allow_contact": True, "compensate": False, **options}
    return plan_job(folder, design, PlanOptions(**wanted))  # type: ignore[arg-type]


def print_batch(job: PrintJob, real: LeaningPrint) -> Wireframe:
    """Let the robot print the job's current batch."""
    batch = job.current
    assert batch is not None
    return real.lay(job.expectation(batch).laid, job.plan(batch))


def fingerprint(folder: Path) -> str:
    """Of all files of a folder but the lock: names and content."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.name != ".lock":
            digest.update(path.relative_to(folder).as_posix().encode())
            digest.update(path.read_bytes() if path.is_file() else b"")
    return digest.hexdigest()
