"""Cameras in Blender and back, judged by Blender's own projection; rigs, transforms.json and backgrounds."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from frametwin.blender.scene.collections import new_collection, remove_collection
from frametwin.blender.scene.units import mm_per_unit
from frametwin.blender.views.backgrounds import add_background
from frametwin.blender.views.cameras import activate, camera_from_blender, camera_to_blender
from frametwin.blender.views.rigs import cameras_from_collection, read_calibration, rig_around, rig_to_blender
from frametwin.blender.views.transforms import read_transforms, write_transforms
from frametwin.cameras import Camera, look_at, write_colmap_text
from frametwin.cameras.rigs import dome_rig, ring_rig
from frametwin.capture.image_files import write_png
from frametwin.capture.transforms import read_cameras
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

Link = Callable[[str, Any], bpy.types.Object]
PIXEL = 0.005  # of reprojection; the project wants 0.05
LENS = np.array([-0.21, 0.08, 0.0011, -0.0007, -0.013])

SIZES = {"landscape": (1600, 1200), "portrait": (900, 1500), "odd": (641, 479)}


def calibrated(size: tuple[int, int] = (1600, 1200), *, square: bool = True, seed: int = 0) -> Camera:
    """A camera about half a metre from the origin, its principal point well off the middle."""
    rng = np.random.default_rng(seed)
    width, height = size
    focal = 1.3 * max(size)
    return Camera(
        name=f"view_{seed}",
        width=width,
        height=height,
        fl_x=focal,
        fl_y=focal if square else 1.17 * focal,
        cx=0.43 * width,
        cy=0.58 * height,
        camera_to_world=look_at(500.0 * rng.normal(size=3), rng.normal(scale=20.0, size=3), rng.normal(size=3)),
    )


def assert_identical(found: Camera, wanted: Camera) -> None:
    for name in ("name", "width", "height", "fl_x", "fl_y", "cx", "cy"):
        assert getattr(found, name) == getattr(wanted, name), name
    np.testing.assert_array_equal(found.camera_to_world, wanted.camera_to_world)
    np.testing.assert_array_equal(found.distortion, wanted.distortion)


def blender_pixels(obj: bpy.types.Object, scene: bpy.types.Scene, points: np.ndarray) -> np.ndarray:
    """Pixels (N, 2) of points (N, 3) in mm by Blender's own projection, in the picture that the scene renders."""
    bpy.context.view_layer.update()
    share = [world_to_camera_view(scene, obj, Vector(point)) for point in points / mm_per_unit(scene)]
    percentage = scene.render.resolution_percentage
    size = np.array([scene.render.resolution_x, scene.render.resolution_y]) * percentage // 100
    return np.array([[x, 1.0 - y] for x, y, _ in share]) * size


def points_before(camera: Camera) -> np.ndarray:
    rng = np.random.default_rng(99)
    pixels = rng.uniform(size=(60, 2)) * (camera.width, camera.height)
    return camera.without_distortion().unproject(pixels, rng.uniform(200.0, 900.0, size=60))


# Into Blender


@pytest.mark.parametrize("scale", [1.0, 0.001])
@pytest.mark.parametrize("square", [True, False])
@pytest.mark.parametrize("shape", SIZES)
def test_blender_projects_as_the_camera_does(scene: Any, shape: str, square: bool, scale: float) -> None:
    scene.unit_settings.scale_length = scale
    for seed in range(4):
        camera = calibrated(SIZES[shape], square=square, seed=seed)
        obj = camera_to_blender(camera, scene)
        activate(obj, scene)
        assert scene.camera == obj
        points = points_before(camera)
        np.testing.assert_allclose(blender_pixels(obj, scene, points), camera.project(points)[0], rtol=0, atol=PIXEL)
        assert_identical(camera_from_blender(obj, scene), camera)


def test_a_camera_straight_above_loses_nothing(scene: Any) -> None:
    camera = replace(calibrated(), camera_to_world=look_at([0.0, 0.0, 600.0], [0.0, 0.0, 0.0]))
    obj = camera_to_blender(camera)
    activate(obj)
    points = points_before(camera)
    np.testing.assert_allclose(blender_pixels(obj, scene, points), camera.project(points)[0], rtol=0, atol=PIXEL)


def test_a_very_wide_lens_gets_a_larger_sensor(scene: Any) -> None:
    camera = replace(calibrated(), fl_x=30.0, fl_y=30.0)
    obj = camera_to_blender(camera)
    activate(obj)
    points = points_before(camera)
    np.testing.assert_allclose(blender_pixels(obj, scene, points), camera.project(points)[0], rtol=0, atol=PIXEL)


def test_the_frame_is_inside_of_the_clip_range(scene: Any, rich_frame: Wireframe) -> None:
    used = rich_frame.control_points.reshape(-1, 3)
    for scale in (1.0, 0.001):
        scene.unit_settings.scale_length = scale
        for camera in ring_rig(rich_frame, 3):
            for target in (rich_frame, None):
                data = camera_to_blender(camera, target=target).data
                depth = camera.project(used)[1] / mm_per_unit(scene)
                assert 0.0 < data.clip_start < depth.min() - 0.001 * rich_frame.radius.max()
                assert depth.max() < data.clip_end < 1e5 * data.clip_start


def test_cameras_of_different_pictures_share_a_scene(scene: Any) -> None:
    wanted = [calibrated(size, square=False, seed=i) for i, size in enumerate(SIZES.values())]
    objects = [camera_to_blender(camera) for camera in wanted]
    for obj, camera in zip(objects, wanted, strict=True):
        scene.render.resolution_percentage = 50
        activate(obj)
        assert (scene.render.resolution_x, scene.render.resolution_y) == (camera.width, camera.height)
        assert scene.render.resolution_percentage == 100
        for other, same in zip(objects, wanted, strict=True):  # whichever is active
            assert_identical(camera_from_blender(other), same)


def test_distortion_rides_along(scene: Any) -> None:
    camera = replace(calibrated(), distortion=LENS)
    obj = camera_to_blender(camera)
    activate(obj)
    points = points_before(camera)
    undistorted = camera.without_distortion().project(points)[0]
    np.testing.assert_allclose(blender_pixels(obj, scene, points), undistorted, rtol=0, atol=PIXEL)
    assert_identical(camera_from_blender(obj), camera)
    obj.data["frametwin_distortion"] = [0.1, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_array_equal(camera_from_blender(obj).distortion, [0.1, 0.0, 0.0, 0.0, 0.0])


def test_a_saved_file_keeps_the_digits(scene: Any, tmp_path: Path) -> None:
    camera = replace(calibrated(), distortion=LENS)
    camera_to_blender(camera)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert_identical(camera_from_blender(bpy.data.objects["view_0"]), camera)


# Out of Blender


def drawn_camera(link: Link, **settings: Any) -> bpy.types.Object:
    data = bpy.data.cameras.new("drawn")
    obj = link("drawn", data)
    obj.location, obj.rotation_euler = (0.4, -0.5, 0.3), (1.1, 0.1, 0.7)
    data.lens, data.sensor_width, data.sensor_height, data.shift_x, data.shift_y = 42.0, 30.0, 21.0, 0.11, -0.07
    for name, value in settings.items():
        setattr(data, name, value)
    return obj


@pytest.mark.parametrize("percentage", [100, 50])
@pytest.mark.parametrize("aspect", [(1.0, 1.0), (1.25, 1.0), (1.0, 1.6)])
@pytest.mark.parametrize("size", [(1600, 1200), (900, 1500)])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
def test_cameras_that_users_make_are_read(
    scene: Any, link: Link, fit: str, size: tuple[int, int], aspect: tuple[float, float], percentage: int
) -> None:
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, percentage
    render.pixel_aspect_x, render.pixel_aspect_y = aspect
    obj = drawn_camera(link, sensor_fit=fit)
    camera = camera_from_blender(obj)
    assert (camera.width, camera.height) == (size[0] * percentage // 100, size[1] * percentage // 100)
    assert camera.name == "drawn"
    points = points_before(camera)
    np.testing.assert_allclose(blender_pixels(obj, scene, points), camera.project(points)[0], rtol=0, atol=PIXEL)


def test_scale_parents_and_constraints_of_a_camera_are_seen_as_blender_does(scene: Any, link: Link) -> None:
    obj, parent = drawn_camera(link), link("parent", None)
    obj.scale = (2.0, 3.0, 0.5)
    obj.parent = parent
    parent.location, parent.rotation_euler, parent.scale = (0.1, 0.2, 0.3), (0.3, 0.2, 0.1), (1.5, 1.5, 1.5)
    target = link("target", None)
    target.location = (0.05, 0.0, 0.02)
    obj.constraints.new("TRACK_TO").target = target
    camera = camera_from_blender(obj)
    points = points_before(camera)
    found = blender_pixels(obj, scene, points)
    np.testing.assert_allclose(found, camera.project(points)[0], rtol=0, atol=2 * PIXEL)
    pixel, _ = camera.project([50.0, 0.0, 20.0])
    np.testing.assert_allclose(pixel, [camera.cx, camera.cy], rtol=0, atol=PIXEL)


def test_changes_by_hand_count(scene: Any) -> None:
    camera = calibrated()
    obj = camera_to_blender(camera)
    obj.data.lens *= 2.0
    found = camera_from_blender(obj)
    assert found.fl_x == pytest.approx(2.0 * camera.fl_x, rel=1e-6)
    assert found.cx == pytest.approx(camera.cx, abs=1e-3)
    np.testing.assert_array_equal(found.camera_to_world, camera.camera_to_world)
    obj.location.x += 0.05
    moved = camera_from_blender(obj)
    np.testing.assert_allclose(moved.centre - camera.centre, [50.0, 0.0, 0.0], rtol=0, atol=1e-4)
    obj.data["frametwin_size"] = [800, 600]
    assert camera_from_blender(obj).fl_x == pytest.approx(camera.fl_x, rel=1e-6)
    activate(obj)
    assert (scene.render.resolution_x, scene.render.resolution_y) == (800, 600)
    obj.name = "left"
    assert camera_from_blender(obj).name == "left"


def test_a_camera_that_blender_numbers_keeps_its_name(scene: Any) -> None:
    first, second = camera_to_blender(calibrated(seed=1)), camera_to_blender(calibrated(seed=1))
    assert second.name == "view_1.001"
    assert camera_from_blender(second).name == camera_from_blender(first).name == "view_1"


def test_what_is_no_pinhole_camera_is_refused_in_words(scene: Any, link: Link) -> None:
    def refused(words: str, **settings: Any) -> None:
        obj = drawn_camera(link, **{name: value for name, value in settings.items() if name == "type"})
        if "scale" in settings:
            obj.scale = settings["scale"]
        if "property" in settings:
            obj.data["frametwin_size"] = settings["property"]
        with pytest.raises(InputError) as refusal:
            camera_from_blender(obj)
        assert str(refusal.value).startswith(f"object {obj.name}: {words}")

    refused("lens type: is ORTHO; set the lens type to Perspective", type="ORTHO")
    refused("lens type: is PANO", type="PANO")
    refused("scale: mirrors the picture", scale=(-1.0, 1.0, 1.0))
    refused("scale: is zero", scale=(0.0, 1.0, 1.0))
    refused('custom property "frametwin_size": does not hold 2 numbers', property="large")
    refused('custom property "frametwin_size": is not positive', property=[0, 100])
    sheared, parent = drawn_camera(link), link("parent", None)
    sheared.parent, parent.scale = parent, (1.0, 2.0, 1.0)
    with pytest.raises(InputError, match="scale: its parents shear it"):
        camera_from_blender(sheared)
    for function in (camera_from_blender, activate):
        with pytest.raises(InputError, match="object parent: type: is EMPTY, not a camera"):
            function(parent)


# Rigs


def test_rigs_stand_in_a_collection_of_their_own(scene: Any, rich_frame: Wireframe) -> None:
    collection = rig_around(rich_frame, count=5, size=(120, 160), elevation_deg=30.0)
    wanted = ring_rig(rich_frame, 5, size=(120, 160), elevation_deg=30.0)
    assert [obj.name for obj in collection.objects] == [camera.name for camera in wanted]
    assert (collection.name, scene.camera) == ("Cameras", collection.objects[0])
    for found, camera in zip(cameras_from_collection(collection), wanted, strict=True):
        assert_identical(found, camera)
    dome = rig_around(rich_frame, "dome", scene, "Dome", count=4)
    assert [c.name for c in cameras_from_collection(dome)] == [c.name for c in dome_rig(rich_frame, 4)]
    with pytest.raises(InputError, match="rig: rig: 'square' is not known; give one of ring, dome"):
        rig_around(rich_frame, "square")
    with pytest.raises(InputError, match="rig: count"):
        rig_around(rich_frame, count=0)
    with pytest.raises(InputError, match="collection none: cameras: there is none"):
        cameras_from_collection(new_collection("none"))
    with pytest.raises(InputError, match="cameras: there is none"):
        rig_to_blender([])


def test_a_removed_collection_leaves_nothing(scene: Any, link: Link, rich_frame: Wireframe) -> None:
    collection = rig_around(rich_frame, count=3)
    inner = new_collection("inner", parent=collection)
    shared = link("shared", bpy.data.meshes.new("shared"))
    inner.objects.link(shared)
    replaced = collection.objects[0].data
    collection.objects[0].data = collection.objects[1].data
    bpy.data.cameras.remove(replaced)
    remove_collection(collection)
    assert not bpy.data.collections and list(bpy.data.objects) == [shared]
    assert not bpy.data.cameras


# transforms.json


def test_calibrations_of_colmap_are_read_from_a_folder_or_a_file(rich_frame: Wireframe, tmp_path: Path) -> None:
    cameras = ring_rig(rich_frame, 3)
    write_colmap_text(tmp_path, cameras)
    for path in (tmp_path, tmp_path / "cameras.txt", tmp_path / "images.txt"):
        for found, camera in zip(read_calibration(path), cameras, strict=True):
            np.testing.assert_allclose(found.camera_to_world, camera.camera_to_world, atol=1e-9)
    lens = struct.pack("<QIiQQ4d", 1, 5, 1, 640, 480, 500.0, 500.0, 320.0, 240.0)  # a pinhole camera
    image = struct.pack("<QI7dI", 1, 9, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 250.0, 5) + b"a.png\0" + struct.pack("<Q", 0)
    (tmp_path / "cameras.bin").write_bytes(lens)
    (tmp_path / "images.bin").write_bytes(image)
    for path in (tmp_path, tmp_path / "cameras.bin", tmp_path / "images.bin"):
        (camera,) = read_calibration(path)
        assert (camera.name, camera.width, camera.fl_x) == ("a.png", 640, 500.0)
        np.testing.assert_allclose(camera.centre, [0.0, 0.0, -250.0], atol=1e-12)
    assert len(read_calibration(tmp_path / "images.txt")) == 3  # the file that was picked counts


def test_transforms_json_goes_in_and_out_with_the_same_bits(scene: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    cameras = [replace(calibrated(size, square=False, seed=i)) for i, size in enumerate(SIZES.values())]
    cameras[1] = replace(cameras[1], distortion=LENS)
    before, after = tmp_path / "before.json", tmp_path / "after.json"
    write_transforms(before, rig_to_blender(cameras))
    assert [c.name for c in read_cameras(before)] == ["view_0", "view_1", "view_2"]
    for found, camera in zip(read_cameras(before), cameras, strict=True):
        np.testing.assert_array_equal(found.distortion, camera.distortion)
        np.testing.assert_array_equal(found.camera_to_world, camera.camera_to_world)
    entries = json.loads(before.read_text())
    entries["frames"][2]["file_path"] = "images/left/0007.JPG"
    before.write_text(json.dumps(entries))
    for scale in (1.0, 0.001):
        scene.unit_settings.scale_length = scale
        collection = read_transforms(before, scene, target=rich_frame)
        assert collection.name.startswith(tmp_path.name[:40])
        write_transforms(after, collection, scene)
        assert json.loads(after.read_text()) == entries


def test_pictures_of_transforms_json_become_backgrounds(scene: Any, small_views: Path) -> None:
    collection = read_transforms(small_views)
    shown = [obj.data.background_images for obj in collection.objects]
    assert [len(pictures) for pictures in shown] == [1, 0]
    assert Path(shown[0][0].image.filepath).name == "camera_00.png"
    assert len(read_transforms(small_views, backgrounds=False).objects[0].data.background_images) == 0


def test_pictures_elsewhere_are_not_opened(scene: Any, small_views: Path) -> None:
    outside = small_views.parent.parent / "outside.png"
    write_png(outside, np.zeros((12, 16), dtype=np.uint8))
    entries = json.loads(small_views.read_text())
    for place in ("../outside.png", str(outside), "images\\camera_00.png"):
        entries["frames"][1]["file_path"] = place
        small_views.write_text(json.dumps(entries))
        assert not read_transforms(small_views).objects[1].data.background_images


def test_a_picture_of_another_shape_leaves_the_scene_alone(scene: Any, small_views: Path) -> None:
    write_png(small_views.parent / "images" / "camera_00.png", np.zeros((16, 12), dtype=np.uint8))
    with pytest.raises(InputError, match="is 12 x 16 pixels, the camera's picture 16 x 12"):
        read_transforms(small_views)
    assert not bpy.data.objects and not bpy.data.collections


def test_names_that_are_no_files_are_refused(scene: Any, link: Link, tmp_path: Path) -> None:
    collection = rig_to_blender([calibrated(seed=1), calibrated(seed=2)])
    collection.objects[0].name = "left/right"
    with pytest.raises(InputError, match="object left/right: name: 'left/right' is no file name"):
        write_transforms(tmp_path / "transforms.json", collection)
    twice = rig_to_blender([calibrated(seed=1), calibrated(seed=1)], name="twice")
    with pytest.raises(InputError, match="collection twice: cameras: two are of the picture images/view_1.png"):
        write_transforms(tmp_path / "transforms.json", twice)
    assert not (tmp_path / "transforms.json").exists()


@pytest.fixture
def small_views(tmp_path: Path) -> Path:
    """A transforms.json of two views of 16 x 12, of which one has a picture."""
    folder = tmp_path / "capture"
    (folder / "images").mkdir(parents=True)
    cameras = ring_rig([[-10.0, -10.0, 0.0], [10.0, 10.0, 20.0]], 2, size=(12, 16))
    collection = rig_to_blender(cameras)
    write_transforms(folder / "transforms.json", collection)
    remove_collection(collection)
    write_png(folder / "images" / "camera_00.png", np.zeros((12, 16), dtype=np.uint8))
    return folder / "transforms.json"


# Backgrounds


def test_a_background_fills_the_frame_of_its_camera(scene: Any, tmp_path: Path) -> None:
    obj = camera_to_blender(calibrated((160, 120)))
    for name, size in (("whole.png", (120, 160)), ("half.png", (60, 80)), ("about.png", (41, 54))):
        write_png(tmp_path / name, np.zeros(size, dtype=np.uint8))
        shown = add_background(obj, tmp_path / name, opacity=0.25, front=True)
        assert list(obj.data.background_images) == [shown]
        assert obj.data.show_background_images
        assert tuple(shown.image.size) == size[::-1]
        assert (shown.frame_method, tuple(shown.offset), shown.scale, shown.rotation) == ("STRETCH", (0, 0), 1, 0)
        assert (shown.alpha, shown.display_depth) == (0.25, "FRONT")
    write_png(tmp_path / "tall.png", np.zeros((160, 120), dtype=np.uint8))
    for picture, words in ((tmp_path / "tall.png", "is 120 x 160 pixels"), (tmp_path / "none.png", "is missing")):
        with pytest.raises(InputError, match=words):
            add_background(obj, picture)
    assert len(obj.data.background_images) == 1  # the one before is still there
    with pytest.raises(InputError, match="object lamp: type"):
        add_background(bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT")), tmp_path / "whole.png")


def test_the_frame_of_a_shifted_camera_is_where_its_pixels_are(scene: Any) -> None:
    """The corners that Blender draws the background between are the corners of the picture."""
    camera = calibrated((900, 1500), square=False)
    obj = camera_to_blender(camera)
    activate(obj)
    bpy.context.view_layer.update()
    corners = np.array([obj.matrix_world @ corner for corner in obj.data.view_frame(scene=scene)]) * 1000.0
    pixels, _ = camera.project(corners)
    wanted = np.array([[900.0, 0.0], [900.0, 1500.0], [0.0, 1500.0], [0.0, 0.0]])
    np.testing.assert_allclose(pixels, wanted, rtol=0, atol=PIXEL)
