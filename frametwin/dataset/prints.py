"""The print that a sample shows: plan, truth, what of every strut is there and how thick, and the cameras.

Everything here follows from a `Specification`; nothing is drawn but from the seeds that stand in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from frametwin.cameras import Camera
from frametwin.cameras.rigs import RIGS, box_around
from frametwin.capture.transforms import read_cameras
from frametwin.dataset.camera_errors import stated_cameras
from frametwin.dataset.specification_values import (
    DeformationValues,
    PrintingValues,
    RigValues,
    Specification,
)
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.displacement import largest_displacement
from frametwin.geometry.rotations import rotation_matrices
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.deformations import deform, rigid_motion
from frametwin.mechanics.hardening import Hardening
from frametwin.mechanics.sag import SagSettings
from frametwin.progress import ProgressCallback
from frametwin.simulation.defects import drop_struts
from frametwin.simulation.print_order import print_share

KNOTS = 9
"""Places along every strut at which its thickness is drawn; it is linear between them."""

WIDEST = 2.5
"""Thickness leaves its mean by no more standard deviations than this."""

ELEVATIONS = {"ring": (20.0, 45.0), "dome": (10.0, 70.0)}


@dataclass(frozen=True, eq=False)
class SamplePrint:
    """A print and the cameras around it.

    Attributes
    ----------
    plan, truth : with what is printed.
    present : (E, 2) interval of the curve parameter at which each strut is there.
    thickness : (E, K) real radius in mm at even parameters.
    cameras : of the views, as they truly are.
    stated : the same as the sample states them.
    """

    plan: Wireframe
    truth: Wireframe
    present: np.ndarray
    thickness: np.ndarray
    cameras: tuple[Camera, ...]
    stated: tuple[Camera, ...]

    @property
    def peak(self) -> float:
        """Largest displacement of a printed strut in mm."""
        part = self.plan.printed
        return largest_displacement(self.truth.control_points[part] - self.plan.control_points[part])


def make_print(
    specification: Specification,
    plan: Wireframe,
    deformed: Wireframe | None = None,
    rig_file: PathLike | None = None,
    progress: ProgressCallback | None = None,
) -> SamplePrint:
    """Make the print of a sample.

    Parameters
    ----------
    specification
        What it is.
    plan
        The plan that it names.
    deformed
        For samples from a .blend file: the plan as it was bent there.
    rig_file
        For rigs from a file: the transforms.json.
    progress
        Told of every step.

    Raises
    ------
    InputError
        If the frame does not bear what is asked for, such as more missing struts than there are.
    """
    printing = specification.printing
    if printing.printed is not None:
        plan = print_share(plan, printing.printed)
    # One thread: with several, sums may come out in another order, and with other last digits.
    with threadpool_limits(1):
        truth = deformed_print(plan, specification.deformation, deformed, progress)
    present, dropped = drop_struts(plan, printing.missing, printing.seed, share=printing.missing_share)
    thickness = real_thickness(plan, printing, dropped)
    cameras = cameras_of(plan, truth, specification.rig, rig_file)
    errors = specification.errors
    stated = cameras if errors is None else stated_cameras(cameras, errors)
    return SamplePrint(plan, truth, present, thickness, cameras, stated)


def deformed_print(
    plan: Wireframe,
    values: DeformationValues,
    deformed: Wireframe | None = None,
    progress: ProgressCallback | None = None,
) -> Wireframe:
    """The plan, deformed: first as its kind says, then shifted and turned with its base."""
    settings = SagSettings(
        peak_fraction=values.peak_fraction,
        hardening=Hardening(unhardened_fraction=values.unhardened),
        seed=values.seed,
    )
    if values.kind == "none":
        truth = plan
    elif values.kind == "blend":
        if deformed is None:
            raise ValueError("a sample of the kind 'blend' needs the bent frame")
        truth = deformed.replace(printed=plan.printed, batch=plan.batch, radius=plan.radius)
    else:
        truth = deform(plan, values.kind, settings, direction_deg=values.direction_deg, progress=progress)
    if values.drift_deg or any(values.drift_mm):
        truth = rigid_motion(truth, values.drift_deg, (*values.drift_mm, 0.0))
    return truth


def real_thickness(plan: Wireframe, values: PrintingValues, without: np.ndarray) -> np.ndarray:
    """Real radius (E, K) in mm: smooth noise along every strut, and stretches that are under-extruded.

    Parameters
    ----------
    plan
        Its radius is the mean.
    values
        Deviation, and number and thickness of thin struts.
    without
        Struts that are not drawn for being thin, since they are missing already.
    """
    rng = np.random.default_rng([values.seed, 1])
    noise = rng.normal(size=(plan.strut_count, KNOTS + 2))
    smooth = (noise[:, :-2] + 2.0 * noise[:, 1:-1] + noise[:, 2:]) / np.sqrt(6.0)
    factor = 1.0 + values.thickness_variation * np.clip(smooth, -WIDEST, WIDEST)
    candidates = np.setdiff1d(np.flatnonzero(plan.printed), without)
    if values.thin > len(candidates):
        remedy = f"give a number up to {len(candidates)}"
        raise InputError.at(plan.name, "thin", f"is {values.thin} where {len(candidates)} struts are whole", remedy)
    thin = np.sort(rng.choice(candidates, values.thin, replace=False))
    factor[thin] *= _thin_stretches(rng, values.thin, values.thin_to)
    return np.asarray(plan.radius[:, None] * factor)


def _thin_stretches(rng: np.random.Generator, count: int, share: float) -> np.ndarray:
    """Factors (count, K): a stretch of half of the knots, anywhere, keeps ``share`` of the radius."""
    half = (KNOTS + 1) // 2
    first = rng.integers(0, KNOTS - half + 1, size=(count, 1))
    knots = np.arange(KNOTS)[None]
    return np.where((knots >= first) & (knots < first + half), share, 1.0)


def cameras_of(
    plan: Wireframe, truth: Wireframe, values: RigValues, rig_file: PathLike | None = None
) -> tuple[Camera, ...]:
    """The cameras; they see the whole plan, also what is not printed yet, and all of the deformed frame."""
    if rig_file is not None:
        return read_cameras(rig_file)
    cameras = RIGS[values.kind](
        box_around(plan, truth),
        values.views,
        size=values.size,
        elevation_deg=values.elevation_deg or ELEVATIONS[values.kind],
        fov_deg=values.fov_deg,
        margin=values.margin,
        start_deg=values.start_deg,
    )
    rng = np.random.default_rng([values.seed, 2])
    placed = tuple(_jittered(camera, rng, values.jitter_mm, values.jitter_deg) for camera in cameras)
    if values.lens is None:
        return placed
    return tuple(
        replace(camera, distortion=np.array(coefficients), model=values.lens.model)
        for camera, coefficients in zip(placed, values.lens.coefficients, strict=True)
    )


def _jittered(camera: Camera, rng: np.random.Generator, shift: float, turn: float) -> Camera:
    """A camera off its place and its aim by up to ``shift`` mm and ``turn`` degrees."""
    step, axis = rng.normal(size=(2, 3))
    far, angle = rng.random(2)
    if not (shift or turn):
        return camera
    pose = np.array(camera.camera_to_world)
    pose[:3, 3] += shift * far * step / np.linalg.norm(step)
    pose[:3, :3] = pose[:3, :3] @ rotation_matrices(np.radians(turn) * angle * axis / np.linalg.norm(axis))
    return replace(camera, camera_to_world=pose)
