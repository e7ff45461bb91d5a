"""The description of what is rendered: checked, written and read back."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.cameras.rigs import ring_rig
from frametwin.capture.scene import PhotoLook, Scene, read_scene, write_scene
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe


def example(frame: Wireframe) -> Scene:
    rng = np.random.default_rng(7)
    count = frame.strut_count
    present = np.sort(rng.uniform(size=(count, 2)), axis=1)
    present[0] = [0.0, 0.0]
    return Scene(
        truth=frame.replace(printed=np.arange(count) % 3 > 0),
        present=present,
        thickness=rng.uniform(0.5, 1.5, size=(count, 4)),
        cameras=ring_rig(frame, 3, size=(48, 64)),
        style="photo",
        engine="cycles",
        passes=True,
        look=PhotoLook(exposure=0.3, samples=4, seed=17, denoise=False, strut_colour=(0.1, 0.2, 1 / 3)),
    )


def test_a_scene_is_read_back_bit_by_bit(curved_frame: Wireframe, tmp_path: Path) -> None:
    scene = example(curved_frame)
    write_scene(tmp_path / "scene.json", scene)
    found = read_scene(tmp_path / "scene.json")
    for field in ("vertices", "edges", "control_points", "radius", "printed", "grounded", "batch"):
        np.testing.assert_array_equal(getattr(found.truth, field), getattr(scene.truth, field))
    np.testing.assert_array_equal(found.present, scene.present)
    np.testing.assert_array_equal(found.thickness, scene.thickness)
    assert [c.name for c in found.cameras] == ["camera_00", "camera_01", "camera_02"]
    for one, other in zip(found.cameras, scene.cameras, strict=True):
        np.testing.assert_array_equal(one.camera_to_world, other.camera_to_world)
        np.testing.assert_array_equal(one.K, other.K)
    assert (found.style, found.engine, found.passes, found.look) == ("photo", "cycles", True, scene.look)


def test_a_whole_print_is_as_thick_as_its_frame_says(straight_frame: Wireframe) -> None:
    scene = Scene.whole(straight_frame, ring_rig(straight_frame, 2), passes=True)
    assert (scene.style, scene.engine, scene.passes) == ("mask", "auto", True)
    np.testing.assert_array_equal(scene.present, np.tile([0.0, 1.0], (straight_frame.strut_count, 1)))
    np.testing.assert_array_equal(scene.thickness, np.repeat(straight_frame.radius[:, None], 2, axis=1))
    with pytest.raises(ValueError, match="read-only"):
        scene.present[0] = 0.5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"present": np.ones((2, 2))}, "present"),
        ({"present": np.tile([0.6, 0.4], (24, 1))}, "present: is not an interval"),
        ({"present": np.tile([0.0, 1.1], (24, 1))}, "present: is not an interval"),
        ({"thickness": np.ones((24, 1))}, "thickness: is not usable"),
        ({"thickness": np.zeros((24, 2))}, "thickness: is not usable"),
        ({"style": "drawing"}, "style: is 'drawing'; give one of mask, photo"),
        ({"engine": "eevee"}, "engine: is 'eevee'"),
        ({"cameras": ()}, "cameras: there is none"),
    ],
)
def test_what_does_not_fit_is_refused(straight_frame: Wireframe, changes: dict[str, Any], words: str) -> None:
    scene = Scene.whole(straight_frame, ring_rig(straight_frame, 2))
    with pytest.raises(InputError, match=words):
        dataclasses.replace(scene, **changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": "../escape"}, "no name for a file"),
        ({"name": ".."}, "no name for a file"),
        ({"name": "CAMERA_01"}, "'camera_01' occurs twice"),
    ],
)
def test_cameras_that_blender_cannot_be_are_refused(
    straight_frame: Wireframe, changes: dict[str, Any], words: str
) -> None:
    first, second = ring_rig(straight_frame, 2)
    with pytest.raises(InputError, match=words):
        Scene.whole(straight_frame, (dataclasses.replace(first, **changes), second))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("key", -0.1),
        ("strut_colour", (0.5, 0.5, 1.2)),
        ("strut_colour", (0.5, 0.5)),
        ("samples", 0),
        ("samples", 2.5),
        ("seed", -1),
        ("exposure", np.nan),
        ("denoise", 1),
        ("layer_height", 0.0),
        ("electrons", 10.0),
    ],
)
def test_numbers_of_a_look_have_their_ranges(field: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"look: {field}: "):
        PhotoLook(**{field: value})


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("format", "frametwin-frame", "format: is 'frametwin-frame'"),
        ("version", 2, "version: 2 is not known"),
        ("lights", [], "lights: is not a field of a scene"),
        ("look.colour", 1, r"look\.colour: is not a setting of photos"),
        ("look.key", 99.0, "look: key: is 99"),
        ("cameras", {}, "cameras: is not a list"),
        ("truth", None, "truth: is not a JSON object"),
        ("present", None, "present: is missing"),
        ("passes", "yes", "passes: "),
    ],
)
def test_damaged_files_are_answered_by_name_and_field(
    straight_frame: Wireframe, tmp_path: Path, path: str, value: Any, words: str
) -> None:
    file = tmp_path / "scene.json"
    write_scene(file, example(straight_frame))
    data = json.loads(file.read_text(encoding="utf-8"))
    *parents, last = path.split(".")
    place = data
    for key in parents:
        place = place[key]
    place[last] = value
    file.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(InputError, match=rf"scene\.json: .*{words}"):
        read_scene(file)
