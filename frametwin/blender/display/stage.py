"""What a picture or film without a window needs: a camera that sees everything, a legend, words, plain settings.

All of it carries the custom property `KEY`, by which `clear_stage` takes it away again.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import mathutils
import numpy as np

from frametwin.blender.display.colours import BINS, Legend
from frametwin.blender.display.legend_entries import DASHED, THIN, Entry
from frametwin.blender.display.quantities import quantity_named
from frametwin.blender.rendering import engines, versions
from frametwin.cameras import look_at

KEY = "frametwin_stage"
NAME = "FrameTwin stage"
AZIMUTH, ELEVATION = np.radians(-55.0), np.radians(22.0)
MARGIN = 1.12
BACKGROUND = (0.02, 0.022, 0.026)
WHITE = (0.9, 0.9, 0.9)


class PhotoStage:
    """A camera and what is drawn close before it.

    Parameters
    ----------
    scene
        Which gets all of it, and the settings for rendering.
    points
        (N, 3) in Blender units: what the camera shall see.
    size
        Height and width of the pictures in pixels.

    Attributes
    ----------
    width, height
        Of the picture, in Blender units.
    """

    def __init__(self, scene: bpy.types.Scene, points: np.ndarray, size: tuple[int, int]) -> None:
        self.scene = scene
        self.camera, self.width, self.height = _camera(points, size)
        self._link(self.camera)
        scene.camera = self.camera
        scene.world = _kept(bpy.data.worlds.new(NAME))
        scene.world.color = BACKGROUND
        _settings(scene, size)

    def add_legend(self, legend: Legend, entries: Sequence[Entry] = ()) -> None:
        """The bar of colours and its words, at the lower left, and beside it what has a colour of its own."""
        left, low, bar, thick = -0.46 * self.width, -0.42 * self.height, 0.3 * self.width, 0.02 * self.width
        edges = left + bar * np.linspace(0.0, 1.0, BINS + 1)
        for i, colour in enumerate(legend.colours.tolist()):
            corners = [(edges[i], low), (edges[i + 1], low), (edges[i + 1], low + thick), (edges[i], low + thick)]
            self._add_quad(corners, colour)
        unit = f" in {legend.unit}" if legend.unit else ""
        self.add_words(quantity_named(legend.quantity).name.lower() + unit, left, low + 1.6 * thick)
        for share, align in ((0.0, "LEFT"), (0.5, "CENTER"), (1.0, "RIGHT")):
            value = legend.ends[0] + share * (legend.ends[1] - legend.ends[0])
            self.add_words(f"{value:.3g}", left + share * bar, low - 1.3 * thick, align)
        for i, entry in enumerate(entries):
            x, y = left + bar + (0.05 + 0.3 * (i % 2)) * self.width, low + (1.6 - 1.5 * (i // 2)) * thick
            self._add_field(x, y, thick, entry)
            self.add_words(entry.words, x + 1.8 * thick, y)

    def _add_field(self, x: float, y: float, size: float, entry: Entry) -> None:
        high = size * (0.15 if entry.manner == THIN else 0.6)
        parts = ((0.0, 0.3), (0.6, 0.9), (1.2, 1.5)) if entry.manner == DASHED else ((0.0, 1.5),)
        for a, b in parts:
            y0 = y + 0.45 * size - 0.5 * high
            corners = [(x + a * size, y0), (x + b * size, y0), (x + b * size, y0 + high), (x + a * size, y0 + high)]
            self._add_quad(corners, list(entry.colour))

    def _add_quad(self, corners: list[tuple[float, float]], colour: list[float]) -> None:
        mesh = bpy.data.meshes.new(NAME)
        mesh.from_pydata([(x, y, 0.0) for x, y in corners], [], [(0, 1, 2, 3)])
        self._link(_painted(mesh, colour), self._place(0.0, 0.0))

    def add_words(self, text: str, x: float, y: float, align: str = "LEFT") -> bpy.types.Object:
        """Words at a place of the picture, in Blender units from its middle."""
        font = bpy.data.curves.new(NAME, "FONT")
        font.body, font.align_x, font.size = text, align, 0.024 * self.width
        return self._link(_painted(font, list(WHITE)), self._place(x, y))

    def across(self, points: np.ndarray) -> np.ndarray:
        """(N, 2) where points (N, 3) of the world are in the picture, in Blender units from its middle."""
        inverse = np.linalg.inv(np.array(self.camera.matrix_world))
        return np.asarray((points @ inverse[:3, :3].T + inverse[:3, 3])[:, :2])

    def _place(self, x: float, y: float) -> mathutils.Matrix:
        return self.camera.matrix_world @ mathutils.Matrix.Translation((x, y, -0.05 * self.width))

    def _link(self, obj: bpy.types.Object, place: mathutils.Matrix | None = None) -> bpy.types.Object:
        if place is not None:
            obj.matrix_world = place
        self.scene.collection.objects.link(obj)
        return obj


def clear_stage() -> None:
    """Remove everything that stages have made."""
    for collection in (bpy.data.objects, bpy.data.curves, bpy.data.meshes, bpy.data.cameras):
        bpy.data.batch_remove([item for item in collection if KEY in item])
    for collection in (bpy.data.materials, bpy.data.worlds):
        bpy.data.batch_remove([item for item in collection if KEY in item])


def _kept(item: bpy.types.ID) -> bpy.types.ID:
    item[KEY] = True
    return item


def _camera(points: np.ndarray, size: tuple[int, int]) -> tuple[bpy.types.Object, float, float]:
    """An orthographic camera that sees all points, and the sides of its picture in Blender units."""
    outward = np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
    pose = look_at(outward, np.zeros(3))
    local = points @ pose[:3, :3]
    low, high = local.min(axis=0), local.max(axis=0)
    extent = high - low
    share = size[1] / size[0]
    width = MARGIN * max(extent[0], (extent[1] / 0.8) * share)  # the legend has the lowest fifth
    height = width / share
    middle = 0.5 * (low + high)
    middle[1] += 0.08 * height  # y points down
    data = _kept(bpy.data.cameras.new(NAME))
    data.type, data.sensor_fit, data.ortho_scale = (
        "ORTHO",
        "HORIZONTAL" if share >= 1.0 else "VERTICAL",
        max(width, height),
    )
    data.clip_start, data.clip_end = 0.01 * width, 10.0 * (width + extent[2])
    camera = _kept(bpy.data.objects.new(NAME, data))
    matrix = np.eye(4)
    matrix[:3, :3] = pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    matrix[:3, 3] = pose[:3, :3] @ (middle - [0.0, 0.0, extent[2] + width])
    camera.matrix_world = mathutils.Matrix(matrix.tolist())
    return camera, width, height


def _painted(data: bpy.types.ID, colour: list[float]) -> bpy.types.Object:
    """An object of one flat colour."""
    material = _kept(bpy.data.materials.new(NAME))
    material.diffuse_color = (*colour, 1.0)
    tree = versions.node_tree(material)
    shader, output = (tree.nodes.new(kind) for kind in ("ShaderNodeEmission", "ShaderNodeOutputMaterial"))
    shader.inputs["Color"].default_value = (*colour, 1.0)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    data.materials.append(material)
    obj = _kept(bpy.data.objects.new(NAME, _kept(data)))
    obj.color = (*colour, 1.0)  # of what has no colour attribute
    return obj


def _settings(scene: bpy.types.Scene, size: tuple[int, int]) -> None:
    """Flat, unlit colours, smooth edges, nothing between the renderer and the file."""
    render = scene.render
    render.resolution_y, render.resolution_x = size
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = render.film_transparent = False
    render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Standard"
    versions.write_still_images(render.image_settings, "PNG")
    render.image_settings.color_mode = "RGB"
    if engines.workbench_works():
        render.engine = engines.WORKBENCH
        shading = scene.display.shading
        shading.light, shading.color_type, shading.background_type = "FLAT", "VERTEX", "WORLD"
        shading.show_object_outline, shading.show_cavity = False, False
        scene.display.render_aa = "8"
        return
    render.engine = engines.CYCLES
    scene.cycles.device, scene.cycles.samples, scene.cycles.max_bounces = "CPU", 16, 0
    scene.cycles.use_denoising = False
