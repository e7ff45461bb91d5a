"""The prints that samples show: deformed, partly printed, with faults, seen by their cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.cameras import to_nerfstudio
from frametwin.cameras.rigs import ring_rig
from frametwin.dataset.prints import KNOTS, SamplePrint, cameras_of, deformed_print, make_print, real_thickness
from frametwin.dataset.recipe import RecipeFile, parse_recipe
from frametwin.dataset.specification import Sampler
from frametwin.dataset.specification_values import Specification
from frametwin.errors import InputError
from frametwin.files import write_json
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe


def drawn(index: int = 0, frame: str = "bridge", **tables: Any) -> tuple[Sampler, Specification]:
    data = {"format": "frametwin-recipe", "version": 1, "name": "t", "count": 9, "frames": [{"frame": frame}], **tables}
    sampler = Sampler(RecipeFile(parse_recipe(data, "recipe.toml"), Path("recipe.toml")))
    return sampler, sampler.specification(index)


def made(index: int = 0, frame: str = "bridge", **tables: Any) -> SamplePrint:
    sampler, specification = drawn(index, frame, **tables)
    return make_print(specification, sampler.plan(specification))


@pytest.mark.parametrize(("kind", "printed"), [("sag", 0.6), ("tip-load", 0.6), ("warp", 1.0)])
def test_the_largest_displacement_is_the_share_that_was_drawn(kind: str, printed: float) -> None:
    tables = {"deformations": [{"kind": kind, "peak_fraction": 0.05}], "printing": {"printed": printed}}
    result = made(**tables)
    part, _, _ = result.plan.printed_part()
    assert result.peak == pytest.approx(0.05 * part.extent, rel=1e-4)
    assert result.plan.printed.sum() == round(printed * 76)
    ground = result.plan.grounded
    assert np.allclose(result.truth.vertices[ground], result.plan.vertices[ground], atol=1e-9)


def test_a_drifting_base_moves_the_whole_print_rigidly() -> None:
    plan = named_frame("half_bowl")
    values = drawn(3, "half_bowl", deformations=[{"kind": "none", "drift_mm": 2.0, "drift_deg": 3.0}])[1].deformation
    truth = deformed_print(plan, values)
    before, after = plan.vertices - plan.vertices.mean(axis=0), truth.vertices - truth.vertices.mean(axis=0)
    rotation = np.linalg.lstsq(before, after, rcond=None)[0].T
    assert np.allclose(before @ rotation.T, after, atol=1e-9)
    assert np.degrees(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0))) == pytest.approx(3.0, abs=1e-5)
    assert np.allclose(rotation[2], [0.0, 0.0, 1.0], atol=1e-9)  # about the vertical
    centre = plan.bounds.mean(axis=0)
    moved = bezier.evaluate(truth.control_points, np.array([0.0]))[0, 0]
    turned = rotation @ (plan.control_points[0, 0] - centre) + centre
    assert np.hypot(*(moved - turned)[:2]) == pytest.approx(2.0, rel=1e-4) and abs((moved - turned)[2]) < 1e-9


def test_a_sag_on_a_drifting_base_is_the_sag_moved() -> None:
    table = {"kind": "sag", "peak_fraction": 0.05}
    still, moving = (made(1, deformations=[{**table, "drift_mm": drift}]) for drift in (0.0, 2.5))
    shift = moving.truth.vertices - still.truth.vertices
    assert np.allclose(shift, shift[0], atol=1e-9) and np.linalg.norm(shift[0]) == pytest.approx(2.5, rel=1e-4)


def test_bent_frames_keep_their_shape_and_take_the_plans_state() -> None:
    plan = named_frame("bridge")
    bent = plan.transformed(np.diag([1.0, 1.0, 0.9, 1.0])).replace(radius=plan.radius * 2.0)
    values = drawn()[1].deformation.model_copy(update={"kind": "blend"})
    truth = deformed_print(plan, values, bent)
    assert np.array_equal(truth.control_points, bent.control_points) and np.array_equal(truth.radius, plan.radius)
    with pytest.raises(ValueError, match="bent frame"):
        deformed_print(plan, values)


def test_missing_and_thin_struts_are_others() -> None:
    result = made(printing={"missing": 5, "missing_share": 0.4, "thin": 6, "thin_to": 0.5})
    missing = np.flatnonzero((result.present != [0.0, 1.0]).any(axis=1))
    factor = result.thickness / result.plan.radius[:, None]
    thin = np.flatnonzero((factor < 0.99).any(axis=1))
    assert len(missing) == 5 and len(thin) == 6 and not set(missing) & set(thin)
    assert factor.shape == (76, KNOTS) and np.array_equal(np.unique(factor.round(12)), [0.5, 1.0])
    assert ((factor[thin] == 0.5).sum(axis=1) == (KNOTS + 1) // 2).all()


def test_thickness_varies_smoothly_by_what_was_asked_for() -> None:
    plan = named_frame("lattice_tower")
    values = drawn(printing={"thickness_variation": 0.05})[1].printing
    factor = real_thickness(plan, values, np.array([], dtype=np.int64)) / plan.radius[:, None]
    assert factor.mean() == pytest.approx(1.0, abs=0.005) and factor.std() == pytest.approx(0.05, rel=0.05)
    assert np.abs(factor - 1.0).max() <= 0.05 * 2.5 + 1e-12
    assert np.diff(factor, axis=1).std() < factor.std()  # neighbours are alike, as white noise is not
    assert np.array_equal(real_thickness(plan, values, np.array([])) / plan.radius[:, None], factor)


def test_too_many_thin_struts_are_refused() -> None:
    with pytest.raises(InputError, match="thin: is 80 where 76 struts are whole"):
        made(printing={"thin": 80})


def test_every_camera_sees_plan_and_truth(curved_frame: Wireframe) -> None:
    result = made(rig={"kind": "dome", "views": 12, "size": [120, 160]}, printing={"printed": 0.5})
    points = np.concatenate([result.plan.control_points, result.truth.control_points]).reshape(-1, 3)
    for camera in result.cameras:
        pixels, depth = camera.project(points)
        assert (depth > 0.0).all() and (pixels >= 0.0).all() and (pixels <= [camera.width, camera.height]).all()


def test_jitter_stays_within_its_bounds_and_none_changes_nothing() -> None:
    size = [120, 160]
    still, shaken = (
        made(rig={"views": 6, "size": size, **jitter}).cameras for jitter in ({}, {"jitter_mm": 3.0, "jitter_deg": 2.0})
    )
    moved = [np.linalg.norm(a.centre - b.centre) for a, b in zip(still, shaken, strict=True)]
    turned = [
        np.degrees(np.arccos(np.clip(a.forward @ b.forward, -1.0, 1.0))) for a, b in zip(still, shaken, strict=True)
    ]
    assert min(moved) > 0.0 and max(moved) <= 3.0 and min(turned) > 0.0 and max(turned) <= 2.0
    plain = made(rig={"views": 6, "size": size}).cameras
    assert all(np.array_equal(a.camera_to_world, b.camera_to_world) for a, b in zip(still, plain, strict=True))


def test_cameras_of_a_real_rig_are_taken_as_they_are(tmp_path: Path) -> None:
    plan = named_frame("bridge")
    cameras = ring_rig(plan, 3, size=(60, 80))
    frames = [to_nerfstudio(camera, f"images/{camera.name}.png") for camera in cameras]
    write_json(tmp_path / "transforms.json", {"frames": frames})
    values = drawn()[1].rig
    found = cameras_of(plan, plan, values, tmp_path / "transforms.json")
    assert [camera.name for camera in found] == [camera.name for camera in cameras]
    for a, b in zip(found, cameras, strict=True):
        assert np.array_equal(a.camera_to_world, b.camera_to_world) and np.array_equal(a.K, b.K)
