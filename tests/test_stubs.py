"""Frames that stand on stubs, with more material at their joints than is left of the stubs between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.evaluation.evaluate import evaluate
from frametwin.fitting.api import FitResult, fit_views
from frametwin.fitting.presence import seen_opacity
from frametwin.fitting.stubs import STUB, are_stubs, tell_typical
from frametwin.formats import find_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.evidence import Pictures
from frametwin.printing.simulation.simulated_pictures import SimulatedRig, with_blobs
from frametwin.progress import Progress
from frametwin.raster.pyramid import Pyramid
from frametwin.raster.rods import Rods
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import Simulation, SimulationSettings, simulate
from frametwin.twin.twin import Twin

RADIUS, BLOB, CORNERS = 2.4, 1.5, 7
RIG = SimulatedRig(size=(600, 800), turn_error=0.05, shift_error=0.3, blob=BLOB)


def crown(printed: int = CORNERS - 2) -> Wireframe:
    """A ring on stubs as long as they are thick, of which so many sides are printed, and all stubs."""
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    ring = np.column_stack([70.0 * np.cos(angle), 70.0 * np.sin(angle), np.full(CORNERS, 2.0 * RADIUS)])
    vertices = np.concatenate([ring, ring * [1.0, 1.0, 0.0]])
    corner = np.arange(CORNERS)
    edges = np.concatenate(
        [np.column_stack([CORNERS + corner, corner]), np.column_stack([corner, (corner + 1) % CORNERS])]
    )
    frame = Wireframe.create(vertices, edges, radius=RADIUS, grounded=np.arange(2 * CORNERS) >= CORNERS, name="crown")
    return frame.replace(printed=np.arange(2 * CORNERS) < CORNERS + printed)


def moved(plan: Wireframe, seed: int = 0) -> Wireframe:
    """What became of a plan: joints off it by some tenths of a millimetre, feet less."""
    shift = np.random.default_rng(seed).normal(scale=0.3, size=plan.vertices.shape)
    return plan.moved_to(plan.vertices + np.where(plan.grounded[:, None], 0.2 * shift, shift))


def pictured(frame: Wireframe, cameras: tuple[Camera, ...], blob: float = BLOB) -> list[np.ndarray]:
    shown = with_blobs(frame, blob) if blob else frame.printed_part()[0]
    return [picture / np.float32(255) for picture in silhouettes(shown, cameras)]


def fitted(plan: Wireframe, real: Wireframe, blob: float = BLOB, told: bool = True, **changes: object) -> FitResult:
    """Fitted through cameras as a good calibration has them, its errors told."""
    true = RIG.cameras(plan)
    rig = RIG._calibrated(RIG.told(true, 3)).cameras
    cameras = [one.as_camera() for one in rig] if told else list(true)
    return fit_views(plan, cameras, pictured(real, true, blob), changes=changes)


def test_stubs_are_no_longer_than_two_diameters() -> None:
    assert are_stubs(np.array([3.9, 4.1, 3.9]), np.array([1.0, 1.0, 0.9])).tolist() == [True, False, False]
    assert STUB == 4.0


def test_many_stubs_are_not_typical_and_few_do_not_matter() -> None:
    radius = np.ones(100)
    lengths = np.where(np.arange(100) < 60, 2.0, 16.0)
    assert tell_typical(lengths, radius).tolist() == (lengths > 4.0).tolist()
    few = np.where(np.arange(100) < 3, 2.0, 16.0)
    assert tell_typical(few, radius).all()
    assert tell_typical(np.full(100, 2.0), radius).all()


@pytest.mark.parametrize("blob", [BLOB, 0.0])
@pytest.mark.parametrize("told", [True, False])
def test_a_ring_on_stubs_is_found_whatever_its_joints(blob: float, told: bool) -> None:
    plan = crown()
    real = moved(plan)
    twin = fitted(plan, real, blob, told).twin
    part = plan.printed
    assert twin.verdict.status == "good"
    assert (twin.completeness[part] > 0.9).all() and (twin.confidence[part] > 0.5).all()
    off = np.linalg.norm(twin.vertices - real.vertices, axis=1)
    assert off.mean() < 0.2 and off.max() < 0.5
    np.testing.assert_allclose(twin.joint_radius, max(1.0, blob) * RADIUS, rtol=0.08)
    np.testing.assert_allclose(twin.thickness[part], RADIUS, rtol=0.05)
    assert evaluate(twin.control_points, twin.vertices, real).curves.mean < 0.2
    assert all(camera["sigmas"] < 4.0 for camera in twin.cameras)


def test_a_side_that_fell_off_is_missed_and_no_stub_with_it() -> None:
    plan = crown()
    real = moved(plan)
    gone = CORNERS + 2
    present = real.printed & (np.arange(real.strut_count) != gone)
    twin = fitted(plan, real.replace(printed=present)).twin
    assert twin.completeness[gone] < 0.1
    assert (twin.completeness[present] > 0.9).all()


def test_a_stub_that_fell_with_its_sides_is_missed_too() -> None:
    """Nothing of it is left, the material of its joints neither."""
    plan = crown()
    real = moved(plan)
    struts = np.arange(real.strut_count)
    lost = np.isin(struts, [2, CORNERS + 1, CORNERS + 2])
    twin = fitted(plan, real.replace(printed=real.printed & ~lost)).twin
    assert (twin.completeness[lost] < 0.1).all()
    assert (twin.completeness[real.printed & ~lost] > 0.9).all()


def test_what_is_in_view_of_typical_struts_sets_the_scale_for_stubs() -> None:
    """Stubs behind the balls of their joints are in hardly any view, and believed to be there, however many."""
    plan = crown(2)
    cameras = ring_rig(plan, 6, size=(240, 320))
    part = plan.printed_part()[0]
    drawn = Rods(
        part.control_points,
        part.vertices,
        part.edges,
        np.repeat(part.radius[:, None], 6, axis=1),
        np.ones((part.strut_count, 6)),
        np.full(part.vertex_count, 2.0),
    )
    level = Pyramid(cameras, pictured(plan, cameras, 2.0)).level(1.0, 0.7)
    dark = replace(level, target=np.where(level.target > 0.99, level.target, np.float32(0.0)))  # rims alone differ
    opacity, weight = seen_opacity(drawn, dark)
    hidden = np.arange(part.strut_count) < CORNERS
    assert weight[hidden].sum(axis=1).max() < 0.02 * weight[~hidden].sum(axis=1).min()
    assert opacity[hidden].min() > 0.9


def sagged_on_stubs(seed: int) -> Simulation:
    """The half bowl, lifted onto stubs of 2.4 radii under its feet, and sagged."""
    bowl = find_frame("half_bowl")
    feet, radius = np.flatnonzero(bowl.grounded), float(bowl.radius[0])
    lifted = bowl.vertices + np.array([0.0, 0.0, 2.4 * radius])
    vertices = np.concatenate([lifted, lifted[feet] * np.array([1.0, 1.0, 0.0])])
    plate = np.arange(len(lifted), len(vertices))
    edges = np.concatenate([bowl.edges, np.column_stack([plate, feet])])
    grounded = np.isin(np.arange(len(vertices)), plate)
    frame = Wireframe.create(vertices, edges, radius=radius, grounded=grounded, name="bowl on stubs")
    return simulate(frame, SimulationSettings(size=(600, 800), seed=seed))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_frame_that_sagged_on_stubs_is_found_at_the_first_attempt(seed: int) -> None:
    """Stubs look dark in coarse pictures. Neither is the frame searched for elsewhere for it, nor are they left out."""
    capture, told = sagged_on_stubs(seed), list[Progress]()
    masks = [picture / np.float32(255) for picture in silhouettes(capture.truth, capture.cameras)]
    twin = fit_views(capture.frame, capture.cameras, masks, callback=told.append).twin
    off = np.linalg.norm(twin.vertices - capture.truth.vertices, axis=1)
    assert off.mean() < 0.05 and off.max() < 0.4
    own = [progress.stage == "smooth motion" for progress in told]
    assert own == sorted(own, reverse=True)  # no way back to where every joint is not yet free
    assert evaluate(twin.control_points, twin.vertices, capture.truth).strut_mean.max() < 0.2


def pixels_alone(frame: Wireframe, cameras: tuple[Camera, ...], strut: int) -> int:
    """How many pixels of all pictures are white by one strut alone."""
    without = frame.replace(printed=np.arange(frame.strut_count) != strut)
    return sum(
        np.count_nonzero(whole != less)
        for whole, less in zip(silhouettes(frame, cameras), silhouettes(without, cameras), strict=True)
    )


def test_stubs_that_are_missing_and_not_hidden_are_missed_and_no_others() -> None:
    capture = sagged_on_stubs(1)
    stubs = np.flatnonzero(are_stubs(capture.frame.chord_lengths, capture.frame.radius))
    shown = np.array([pixels_alone(capture.truth, capture.cameras, stub) for stub in stubs])
    lost = np.isin(np.arange(capture.frame.strut_count), stubs[np.argsort(-shown)[:3]])
    printed = capture.truth.replace(printed=~lost)
    masks = [picture / np.float32(255) for picture in silhouettes(printed, capture.cameras)]
    twin = fit_views(capture.frame, capture.cameras, masks).twin
    assert (twin.completeness[lost] < 0.2).all()
    assert (twin.completeness[~lost] > 0.8).all()


def told_of_joints(frame: Wireframe, joint_radius: float | None) -> Twin:
    """A twin that has everything printed where the frame has it, and balls at the joints."""
    there = frame.printed.astype(float)
    return Twin(
        control_points=frame.control_points,
        vertices=frame.vertices,
        thickness=np.repeat(frame.radius[:, None], 20, axis=1),
        opacity=np.repeat(there[:, None], 20, axis=1),
        completeness=there,
        confidence=there,
        joint_radius=None if joint_radius is None else np.full(frame.vertex_count, joint_radius),
    )


def test_material_at_joints_is_neither_unexplained_nor_taken_for_struts_to_come() -> None:
    """Stubs that are still to come begin in the balls of their joints."""
    whole = crown(CORNERS)
    lower = whole.replace(printed=np.arange(whole.strut_count) >= CORNERS)
    stubs = whole.subset(~lower.printed)[0]
    cameras = RIG.cameras(whole)
    pictures = Pictures(lower, cameras, pictured(lower, cameras, 2.0))
    with_balls = pictures.evidence(lower, told_of_joints(lower, 2.0 * RADIUS), stubs)
    without = pictures.evidence(lower, told_of_joints(lower, None), stubs)
    assert with_balls.unexplained < 0.02 < 0.1 < without.unexplained
    assert np.nanmax(without.whiteness) > 0.3
    assert np.nanmax(np.nan_to_num(with_balls.whiteness)) < 0.15
