"""Masks and passes rendered by Blender, held against rays followed in numpy and the library's own silhouettes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from rod_rays import cameras, distance_to_rods, faulty, margin, rods, tower

from frametwin.blender.rendering import engines
from frametwin.blender.rendering import render_job as jobs
from frametwin.blender.rendering.console import quiet_console
from frametwin.blender.rendering.render import render_scene
from frametwin.cameras import Camera, look_at
from frametwin.capture.image_files import PICTURE_CHUNKS, decode_png, image_size
from frametwin.capture.scene import Scene
from frametwin.errors import Cancelled, FrameTwinError, InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress

EDGE = 0.25
"""Pixels about an outline within which a mask may be either: half of what is asked for."""

SURFACE = 0.05
"""Millimetres, a tenth of a pixel."""

SCENES = {
    "straight": lambda: Scene.whole(tower(), cameras()),
    "curved": lambda: Scene.whole(tower(curved=True), cameras()),
    "faulty": faulty,
    "faulty and straight": lambda: faulty(curved=False),
}


def mask_of(folder: Path, camera: Camera) -> np.ndarray:
    path = folder / "images" / f"{camera.name}.png"
    return decode_png(path.read_bytes(), path)


@pytest.fixture
def needs_workbench() -> None:
    if not engines.workbench_works():
        pytest.skip("Workbench needs EGL (libegl1), which is absent")


@pytest.fixture(params=["workbench", "cycles"])
def engine(request: pytest.FixtureRequest) -> str:
    if request.param == "workbench":
        request.getfixturevalue("needs_workbench")
    return request.param


@pytest.mark.parametrize("name", SCENES)
def test_a_mask_is_white_where_the_ray_of_the_pixel_meets_a_strut(name: str, engine: str, tmp_path: Path) -> None:
    scene = replace(SCENES[name](), engine=engine)
    found = render_scene(scene, tmp_path)
    assert (found.engine, found.views) == (engine, 2)
    assert found.rendering_seconds > 0.0
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["images", "left.png", "right.png"]
    for camera in scene.cameras:
        mask = mask_of(tmp_path, camera)
        assert mask.shape == (camera.height, camera.width)
        assert set(np.unique(mask)) == {0, 255}
        outside = margin(scene, camera)
        clear = np.abs(outside) > EDGE
        assert clear.mean() > 0.8
        np.testing.assert_array_equal(mask[clear] == 255, outside[clear] < 0.0)
        # Mistakes within the band weigh each other up: the outline is right on average to a thirtieth of a pixel.
        length = np.sum(np.abs(outside) < 0.5)
        assert abs(int(np.sum(mask == 255)) - int(np.sum(outside < 0.0))) < length / 30.0


@pytest.mark.parametrize("name", SCENES)
def test_masks_agree_with_the_exact_silhouettes(name: str, tmp_path: Path) -> None:
    pytest.importorskip("numba", reason="the library's own silhouettes need numba")
    from frametwin.raster.silhouette import silhouettes

    scene = SCENES[name]()
    scene = replace(scene, cameras=cameras(5.0)[:1], engine="auto")
    (camera,) = scene.cameras
    render_scene(scene, tmp_path)
    mask = mask_of(tmp_path, camera) == 255
    depth = camera.project(scene.truth.vertices)[1]
    drawn = [
        silhouettes(scene.truth, [camera], present=scene.present, thickness=scene.thickness + grown)[0] == 255
        for grown in (-EDGE * depth.min() / camera.fl_x, 0.0, EDGE * depth.max() / camera.fl_x)
    ]
    assert not (drawn[0] & ~mask).any()
    assert not (mask & ~drawn[2]).any()
    assert np.mean(mask != drawn[1]) < 1e-3


def small_ball(centre: list[float]) -> Wireframe:
    return Wireframe.create([centre, [centre[0] + 1e-3, *centre[1:]]], [[0, 1]], radius=0.25)


@pytest.mark.parametrize("place", [[0.0, 0.0, 0.0], [14.0, -9.0, 6.0], [-11.0, 13.0, -5.0]])
def test_a_known_point_is_rendered_where_the_camera_projects_it(place: list[float], tmp_path: Path) -> None:
    pose = look_at([90.0, 30.0, 40.0], [0.0, 0.0, 0.0])
    camera = Camera("view", 160, 120, 300.0, 270.0, 90.0, 52.0, pose)
    fine = camera.resized(160 * 16, 120 * 16)
    render_scene(Scene.whole(small_ball(place), (fine,)), tmp_path)
    rows, columns = np.nonzero(mask_of(tmp_path, fine))
    assert rows.size > 200
    centre = np.array([columns.mean() + 0.5, rows.mean() + 0.5]) / 16.0
    assert np.abs(centre - camera.project(place)[0]).max() < 0.05


def test_engines_agree(needs_workbench: None, tmp_path: Path) -> None:
    scene = faulty()
    for engine in ("workbench", "cycles"):
        render_scene(replace(scene, engine=engine), tmp_path / engine)
    for camera in scene.cameras:
        one, other = (mask_of(tmp_path / engine, camera) for engine in ("workbench", "cycles"))
        assert np.mean(one != other) < 1e-3


def test_the_same_scene_gives_the_same_files(tmp_path: Path) -> None:
    scene = replace(faulty(), passes=True)
    for run in ("first", "second"):
        render_scene(scene, tmp_path / run)
    for camera in scene.cameras:
        one, other = (tmp_path / run / "images" / f"{camera.name}.png" for run in ("first", "second"))
        assert one.read_bytes() == other.read_bytes()
        # Neither the date nor the machine is in them.
        assert image_size(one) == (camera.width, camera.height)
        data, position = one.read_bytes(), 8
        while position < len(data):
            assert data[position + 4 : position + 8] in PICTURE_CHUNKS
            position += 12 + int.from_bytes(data[position : position + 4], "big")


def test_a_print_of_which_nothing_is_there_is_black(engine: str, tmp_path: Path) -> None:
    whole = Scene.whole(tower(), cameras(), engine=engine)
    render_scene(replace(whole, present=np.zeros((24, 2)), passes=True), tmp_path)
    for camera in whole.cameras:
        assert not mask_of(tmp_path, camera).any()


@pytest.mark.parametrize("name", ["faulty", "straight"])
def test_passes_hold_depth_normal_and_strut_of_the_nearest_surface(name: str, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR", reason="the passes are read with the OpenEXR package, outside of Blender")
    from frametwin.imaging.exr import read_passes

    scene = replace(SCENES[name](), passes=True)
    render_scene(scene, tmp_path)
    pieces = rods(scene)
    for camera in scene.cameras:
        found = read_passes(tmp_path / "passes" / f"{camera.name}.exr")
        hit = found.strut >= 0
        assert found.depth.shape == found.strut.shape == (camera.height, camera.width)
        assert found.normal.shape == (camera.height, camera.width, 3)
        np.testing.assert_array_equal(np.isfinite(found.depth), hit)
        assert not found.normal[~hit].any()
        outside = margin(scene, camera)
        clear = np.abs(outside) > EDGE
        np.testing.assert_array_equal(hit[clear], outside[clear] < 0.0)

        # Depth along the optical axis leads from the pixel to a point on the surface, and none is before it.
        rows, columns = np.nonzero(hit)
        pixels = np.stack([columns + 0.5, rows + 0.5], axis=-1)
        points = camera.unproject(pixels, found.depth[hit])
        distance, each = distance_to_rods(points, pieces)
        assert np.abs(distance).max() < SURFACE
        before = camera.unproject(pixels, found.depth[hit] - 0.1)
        assert distance_to_rods(before, pieces)[0].min() > -SURFACE
        own = np.where(pieces.strut == found.strut[hit][:, None], each, np.inf).min(axis=1)
        assert np.abs(own).max() < SURFACE

        # The normal is the way on which the distance grows fastest.
        step = 1e-3
        slope = [
            (distance_to_rods(points + step * axis, pieces)[0] - distance_to_rods(points - step * axis, pieces)[0])
            / (2.0 * step)
            for axis in np.eye(3)
        ]
        cosine = np.sum(np.stack(slope, axis=-1) * found.normal[hit], axis=-1)
        np.testing.assert_allclose(np.linalg.norm(found.normal[hit], axis=-1), 1.0, atol=1e-4)
        assert np.percentile(cosine, 5) > 0.99
        assert np.median(cosine) > 0.999


def state() -> dict[str, Any]:
    """How many data-blocks of each kind there are, and what the user sees."""
    kinds = [p.identifier for p in bpy.data.bl_rna.properties if p.type == "COLLECTION"]
    scene = bpy.context.scene
    settings = {
        key: repr(getattr(scene.render, key))
        for key in ("engine", "filepath", "resolution_x", "resolution_y", "film_transparent", "dither_intensity")
    }
    return {
        **{kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds},
        **settings,
        "scene": scene.name,
        "view": scene.view_settings.view_transform,
        "camera": scene.camera and scene.camera.name,
    }


def stop_at_the_second(progress: Progress) -> bool:
    return progress.iteration < 1


def test_nothing_of_the_users_file_is_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = bpy.data.meshes.new("FrameTwin render")  # a name of ours that the user has taken
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("mine", mesh))
    bpy.context.scene.render.resolution_x = 123
    before = state()
    render_scene(replace(faulty(), passes=True), tmp_path)
    assert state() == before
    with pytest.raises(Cancelled):
        render_scene(faulty(), tmp_path, stop_at_the_second)
    assert state() == before

    def broken(*_: Any, **__: Any) -> None:
        raise RuntimeError("no memory")

    monkeypatch.setattr(jobs, "call_renderer", broken)
    with pytest.raises(FrameTwinError, match="no memory"):
        render_scene(faulty(), tmp_path)
    assert state() == before


def test_progress_tells_of_every_picture_and_can_cancel(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    render_scene(replace(faulty(), passes=True), tmp_path / "whole", lambda p: told.append((p.iteration, p.total)))
    assert told == [(i, 4) for i in range(5)]
    with pytest.raises(Cancelled):
        render_scene(faulty(), tmp_path / "part", stop_at_the_second)
    assert [path.name for path in (tmp_path / "part" / "images").iterdir()] == ["left.png"]


def test_blenders_chatter_is_not_heard(engine: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    render_scene(replace(faulty(), engine=engine), tmp_path)
    print("after")
    assert capfd.readouterr() == ("after\n", "")


def test_what_blender_said_last_is_kept_with_an_error(capfd: pytest.CaptureFixture[str]) -> None:
    import os

    with pytest.raises(RuntimeError) as caught, quiet_console():
        os.write(1, b"out of luck\n")
        raise RuntimeError("failed")
    assert caught.value.__notes__ == ["Blender said: out of luck"]
    assert capfd.readouterr().out == ""


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "images").write_text("a file", encoding="utf-8")
    with pytest.raises(InputError, match=r"images: folder: cannot be made"):
        render_scene(faulty(), tmp_path)


def test_cycles_takes_over_where_workbench_does_not_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(engines.WORKBENCH_WORKS, "0")
    assert render_scene(faulty(), tmp_path).engine == "cycles"
    with pytest.raises(InputError, match="scene: engine: Workbench does not work here; install libegl1"):
        render_scene(replace(faulty(), engine="workbench"), tmp_path)


def test_a_probe_that_fails_is_no_crash(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(engines.WORKBENCH_WORKS, raising=False)
    monkeypatch.setattr(engines, "_PROBE", "import os; os.abort()")
    assert not engines.workbench_works()
    assert engines.mask_engine("auto") == engines.CYCLES
