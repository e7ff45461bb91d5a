"""The display of twins: colours are those of the legend in the evaluated mesh and in pictures, and what inputs do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from test_blender_twins import shifted

from frametwin.blender.display.colouring import legend_of
from frametwin.blender.display.colours import (
    GREY,
    LOOKS,
    MAPS,
    MISSING_COLOUR,
    PLAN_COLOUR,
    SEQUENTIAL,
    Legend,
    State,
    colour_map,
)
from frametwin.blender.display.display_inputs import (
    BATCH,
    BY_TIME,
    DASHES,
    EXAGGERATION,
    GHOST,
    SIDES,
    get_input,
    set_inputs,
)
from frametwin.blender.display.highlights import clear_highlight, highlight_struts, highlighted_struts
from frametwin.blender.display.legend_entries import DASHED, legend_entries
from frametwin.blender.display.quantities import QUANTITIES, quantity_named
from frametwin.blender.display.twins import TwinObjects, recolour_twin, show_twin
from frametwin.blender.frames.plan_objects import use_millimetres
from frametwin.blender.rendering import engines
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

SHIFT = (0.0, 0.0, 2.0)


@pytest.fixture
def shown(scene: Any, rich_frame: Wireframe) -> TwinObjects:
    """A twin in a scene of millimetres, without its ghost: strut 3 is missing, 11 to 17 are still to print."""
    use_millimetres(scene)
    shown = show_twin(shifted(rich_frame, SHIFT), rich_frame)
    set_inputs(shown.twin, {GHOST: False, SIDES: 6, DASHES: False})
    return shown


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is drawn of an object: (V, 3) vertices and colours, number of faces, and the attribute that views show."""

    points: np.ndarray
    colours: np.ndarray
    faces: int
    active: str

    @property
    def rings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Middles (R, 3), radii (R,) and colours (R, 3) of the rings of vertices of tubes with 6 sides."""
        rings = self.points[1:].reshape(-1, 6, 3)  # the first vertex carries the attribute
        middles = rings.mean(axis=1)
        radii = np.linalg.norm(rings - middles[:, None], axis=2).mean(axis=1)
        return middles, radii, self.colours[1:].reshape(-1, 6, 3)[:, 0]


def drawn(obj: bpy.types.Object) -> Drawn:
    graph = bpy.context.evaluated_depsgraph_get()
    graph.update()
    geometry = obj.evaluated_get(graph).evaluated_geometry()  # the mesh lives as long as this
    mesh = geometry.mesh
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    colours = np.empty(4 * len(mesh.vertices), dtype=np.float32)
    mesh.color_attributes["colour"].data.foreach_get("color", colours)
    return Drawn(
        points.reshape(-1, 3).astype(np.float64),
        colours.reshape(-1, 4)[:, :3],
        len(mesh.polygons),
        str(mesh.color_attributes.active_color_name),
    )


def rings_by_strut(obj: bpy.types.Object, frame: Wireframe) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The rings of each strut, by what is nearest."""
    middles, radii, colours = drawn(obj).rings
    fine = bezier.evaluate(frame.control_points, np.linspace(0.02, 0.98, 200))
    away = np.array([np.linalg.norm(line[:, None] - middles, axis=2).min(axis=0) for line in fine])
    nearest = np.where(away.min(axis=0) < 0.25, away.argmin(axis=0), -1)  # rings at joints are nobody's
    return [(middles[nearest == k], radii[nearest == k], colours[nearest == k]) for k in range(len(fine))]


def test_the_colours_are_those_of_the_legend(shown: TwinObjects, rich_frame: Wireframe) -> None:
    for name in MAPS:
        legend = recolour_twin(shown.collection, "confidence", map_name=name)
        rings = rings_by_strut(shown.twin, shown.frame())
        wanted = legend.colour_of(shown.values["confidence"].values)
        for k in range(18):
            _, _, colours = rings[k]
            assert len(colours)
            expected = wanted[k] if rich_frame.printed[k] else LOOKS[State.UNPRINTED].colour
            expected = MISSING_COLOUR if k == 3 else expected
            np.testing.assert_allclose(colours, np.tile(expected, (len(colours), 1)), atol=2e-3)
    assert drawn(shown.twin).active == "colour"


def test_the_legend_is_what_the_inputs_say(shown: TwinObjects) -> None:
    recolour_twin(shown.collection, "radius", 0.5, 1.5, GREY)
    legend = legend_of(shown.twin)
    assert legend is not None and (legend.quantity, legend.low, legend.high) == ("radius", 0.5, 1.5)
    assert legend.colour_map == GREY and legend.ends == (1.5, 0.5) and not legend.automatic
    np.testing.assert_array_equal(legend.colour_of(np.array([1.5, 0.5])), colour_map(GREY)[[0, -1]])
    set_inputs(shown.twin, {"Range To": 0.25, "Colour By": "made by the user"})
    changed = legend_of(shown.twin)
    assert changed is not None and (changed.quantity, changed.ends) == ("made by the user", (1.5, 0.25))


def test_bad_values_are_at_the_same_end_of_the_map() -> None:
    values = np.array([0.2, np.nan, 0.9, 0.6])
    for key in ("opacity", "completeness", "confidence", "radius"):
        quantity = QUANTITIES[key]
        assert quantity.automatic_range(values) == (0.2, 0.9) and np.nanargmax(quantity.badness(values)) == 0
    for key in ("displacement", "error", "sigma"):
        assert QUANTITIES[key].automatic_range(values) == (0.0, 0.9)
        assert np.nanargmax(QUANTITIES[key].badness(values)) == 2
    signed = np.array([-0.5, 0.3, np.nan])
    assert QUANTITIES["distance"].automatic_range(signed) == (-0.5, 0.5)
    assert np.nanargmax(QUANTITIES["distance"].badness(signed)) == 0
    for key in QUANTITIES:
        for equal in (np.full(3, 0.7), np.zeros(3), np.full(3, np.nan)):
            low, high = quantity_named(key).automatic_range(equal)
            assert high > low


def test_exaggeration_moves_the_whole_curve(shown: TwinObjects, rich_frame: Wireframe) -> None:
    set_inputs(shown.twin, {EXAGGERATION: 4.0})
    middles, _, _ = drawn(shown.twin).rings
    wanted = rich_frame.control_points + 4.0 * np.array(SHIFT)
    assert distance_to_curves(middles, wanted) < 0.05


def test_exaggeration_bends_what_is_bent(scene: Any) -> None:
    use_millimetres(scene)
    frame = Wireframe.create([[0, 0, 0], [60, 0, 0], [60, 0, 40], [0, 0, 40]], [[0, 1], [1, 2], [2, 3], [3, 0]])
    twin = shifted(frame, [0.0, 0.0, 0.0])
    sag = np.zeros((4, 4, 3))
    sag[0, 1:3, 2] = -2.0
    obj = show_twin(twin.replace(control_points=frame.control_points + sag), frame).twin
    set_inputs(obj, {GHOST: False, SIDES: 6, DASHES: False, EXAGGERATION: 5.0})
    middles, _, _ = drawn(obj).rings
    assert distance_to_curves(middles, frame.control_points + 5.0 * sag) < 0.05
    assert middles[:, 2].min() == pytest.approx(-5.0 * 2.0 * 0.75, abs=0.02)  # of a cubic's two middle points


def distance_to_curves(points: np.ndarray, curves: np.ndarray) -> float:
    fine = bezier.evaluate(curves, np.linspace(0.0, 1.0, 1001)).reshape(-1, 3)
    return max(float(np.linalg.norm(fine - point, axis=1).min()) for point in points)


def test_the_ghost_is_the_plan(shown: TwinObjects, rich_frame: Wireframe) -> None:
    alone = len(drawn(shown.twin).points)
    set_inputs(shown.twin, {GHOST: True, EXAGGERATION: 3.0})
    found = drawn(shown.twin)
    points, colours = found.points[alone:].reshape(-1, 3, 3), found.colours[alone:]
    assert distance_to_curves(points.mean(axis=1), rich_frame.control_points) < 0.05
    np.testing.assert_allclose(colours, np.tile(PLAN_COLOUR, (len(colours), 1)), atol=1e-6)


def test_dashes_leave_out_parts_of_what_is_missing_alone(shown: TwinObjects) -> None:
    whole = drawn(shown.twin)
    set_inputs(shown.twin, {DASHES: True})
    dashed = drawn(shown.twin)
    gone = whole.faces - dashed.faces
    assert gone == 10 * 6  # every other of the 20 pieces of strut 3
    assert (np.abs(dashed.colours - MISSING_COLOUR).max(axis=1) < 1e-3).any()


def test_batches_come_one_after_the_other_by_number_and_by_time(scene: Any, shown: TwinObjects) -> None:
    batches = np.array([0, 0, 2, 1, 5, 2**31 - 1] * 3)
    sizes = {}
    for last in (0, 1, 2, 5, -1):
        set_inputs(shown.twin, {BATCH: last})
        sizes[last] = len({tuple(ring) for ring in drawn(shown.twin).rings[0].round(4).tolist()})
    assert list(sizes.values()) == sorted(set(sizes.values())) and (batches <= 0).sum() == 6
    set_inputs(shown.twin, {BY_TIME: True})
    for frame, last in ((1, 0), (24, 0), (25, 1), (49, 2), (24 * 5 + 1, 5)):
        scene.frame_set(frame)
        found = len({tuple(ring) for ring in drawn(shown.twin).rings[0].round(4).tolist()})
        assert found == sizes[last]


def test_highlighting_draws_the_others_thin_and_keeps_the_colours(shown: TwinObjects, rich_frame: Wireframe) -> None:
    before = rings_by_strut(shown.twin, shown.frame())
    highlight_struts(shown.twin, np.array([2, 5]))
    after = rings_by_strut(shown.twin, shown.frame())
    assert highlighted_struts(shown.twin).tolist() == [2, 5] and bpy.context.mode == "OBJECT"
    for k in range(18):
        factor = 1.2 if k in (2, 5) else 0.2
        np.testing.assert_allclose(after[k][1], factor * before[k][1], rtol=1e-3)
        np.testing.assert_allclose(after[k][2], before[k][2], atol=1e-6)
    clear_highlight(shown.twin)
    for k, (_, radii, _) in enumerate(rings_by_strut(shown.twin, shown.frame())):
        np.testing.assert_allclose(radii, before[k][1], rtol=1e-6)
    assert not len(highlighted_struts(shown.twin))


def test_the_legend_names_what_is_there(shown: TwinObjects) -> None:
    assert [entry.words for entry in legend_entries([shown.twin])] == ["missing", "still to print"]
    set_inputs(shown.twin, {DASHES: True, GHOST: True})
    entries = legend_entries([shown.twin])
    assert [entry.words for entry in entries] == ["missing", "still to print", "plan"]
    assert entries[0].manner == DASHED and entries[0].colour == MISSING_COLOUR


def srgb(colour: np.ndarray) -> np.ndarray:
    """(..., 3) 0..255 of scene-linear colours, by the standard's formula."""
    curve = np.where(colour <= 0.0031308, 12.92 * colour, 1.055 * np.maximum(colour, 1e-9) ** (1.0 / 2.4) - 0.055)
    return np.asarray(255.0 * curve)


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_WORKBENCH", "BLENDER_EEVEE"])
def test_pictures_have_the_colours_of_the_legend(scene: Any, tmp_path: Path, engine: str) -> None:
    if engine != "CYCLES" and not engines.workbench_works():
        pytest.skip("drawing without a window needs libegl1")
    use_millimetres(scene)
    frame = Wireframe.create([[0, 0, 0], [0, 0, 40], [10, 0, 0], [10, 0, 40], [20, 0, 0], [20, 0, 40], [90, 0, 0]],
                             [[0, 1], [2, 3], [4, 5], [0, 6]], radius=3.0)  # fmt: skip
    shown = show_twin(shifted(frame, [0.0, 0.0, 0.0]), frame)
    set_inputs(shown.twin, {GHOST: False})
    legend = recolour_twin(shown.collection, "confidence", 0.0, 1.0)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    camera.data.type, camera.data.ortho_scale = "ORTHO", 30.0
    camera.location, camera.rotation_euler = (10.0, -100.0, 20.0), (np.pi / 2.0, 0.0, 0.0)
    scene.camera = camera
    is_older = engine == "BLENDER_EEVEE" and bpy.app.version < (5, 0, 0)
    scene.render.engine = "BLENDER_EEVEE_NEXT" if is_older else engine
    scene.render.resolution_x = scene.render.resolution_y = 30
    scene.render.filepath = str(tmp_path / "struts.png")
    scene.render.image_settings.color_mode, scene.render.dither_intensity = "RGB", 0.0
    scene.view_settings.view_transform = "Standard"
    scene.cycles.samples, scene.cycles.device, scene.cycles.use_denoising = 4, "CPU", False
    scene.eevee.taa_render_samples = 4
    shading = scene.display.shading
    shading.light, shading.color_type = "FLAT", "VERTEX"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(image.pixels[:]).reshape(30, 30, 4)[..., :3] * 255.0
    wanted = srgb(legend.colour_of(np.array([0.0, 1.0 / 3.0, 2.0 / 3.0])))
    for k, column in enumerate((5, 15, 25)):
        np.testing.assert_allclose(pixels[15, column], wanted[k], atol=1.6)


def test_a_legend_of_its_own() -> None:
    legend = Legend("x", "mm", 1.0, 3.0, colour_map(SEQUENTIAL), falling=True)
    np.testing.assert_array_equal(legend.colour_of(np.array([3.0, 99.0, 1.0, -5.0]))[[0, 1]], colour_map()[[0, 0]])
    np.testing.assert_array_equal(legend.colour_of(np.array([1.0, -5.0])), colour_map()[[-1, -1]])
    assert legend.colour_of(np.array([np.nan])).tolist() == [[0.2, 0.2, 0.2]]


def test_inputs_can_be_read_back(shown: TwinObjects) -> None:
    for name, value in ((EXAGGERATION, 2.5), (BATCH, 3), (GHOST, True), ("Colour Map", GREY)):
        set_inputs(shown.twin, {name: value})
        assert get_input(shown.twin, name) == value
