"""A picture of a twin with its colours and their legend, without a window."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path

import bpy
import mathutils
import numpy as np

from frametwin.blender import engines, versions
from frametwin.blender.colours import BINS, Legend, colour_map
from frametwin.blender.curves import wireframe_from_curve
from frametwin.blender.jobs import call_renderer
from frametwin.blender.twins import TwinObjects
from frametwin.blender.units import mm_per_unit
from frametwin.cameras import look_at
from frametwin.errors import FrameTwinError
from frametwin.files import PathLike, write_bytes
from frametwin.png import strip_png

AZIMUTH, ELEVATION = np.radians(-55.0), np.radians(22.0)
MARGIN = 1.12
BACKGROUND = (0.02, 0.022, 0.026)


def render_twin(shown: TwinObjects, path: PathLike, size: tuple[int, int] = (1200, 1600)) -> None:
    """Render the twin as it is coloured, seen from a corner above, with the legend below.

    Parameters
    ----------
    shown
        The twin in its scene, which is left as it was.
    path
        The PNG file, written whole or not at all.
    size
        Height and width in pixels.

    Raises
    ------
    FrameTwinError
        If Blender does not render, or the file cannot be written.
    """
    points = wireframe_from_curve(shown.twin).control_points.reshape(-1, 3)
    unit = mm_per_unit(bpy.context.scene)
    with _stage(shown, points / unit, size) as scene, tempfile.TemporaryDirectory(prefix="frametwin-") as scratch:
        file = Path(scratch) / "twin.png"
        scene.render.filepath = str(file)
        try:
            call_renderer(scene.name)
        except RuntimeError as error:
            raise FrameTwinError(f"Blender did not render: {' '.join(str(error).split())}") from error
        write_bytes(path, strip_png(file.read_bytes(), file))


@contextlib.contextmanager
def _stage(shown: TwinObjects, points: np.ndarray, size: tuple[int, int]) -> Iterator[bpy.types.Scene]:
    """A scene with nothing but the twin, a camera and the legend; all of it goes in the end."""
    scene = bpy.data.scenes.new("FrameTwin picture")
    made: list[bpy.types.ID] = []
    try:
        scene.collection.objects.link(shown.twin)
        camera, width, height = _camera(points, size)
        made += [camera, camera.data]
        scene.collection.objects.link(camera)
        scene.camera = camera
        for obj in _legend(shown.legend, camera.matrix_world, width, height):
            made += [obj, obj.data]
            scene.collection.objects.link(obj)
        world = bpy.data.worlds.new("FrameTwin picture")
        made.append(world)
        scene.world = world
        _settings(scene, size)
        yield scene
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.batch_remove([item for item in made if isinstance(item, bpy.types.Object)])
        bpy.data.batch_remove([item for item in made if _is_there(item) and item.users == 0])


def _is_there(item: bpy.types.ID) -> bool:
    try:
        return bool(item.name)
    except ReferenceError:
        return False


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
    data = bpy.data.cameras.new("FrameTwin picture")
    data.type, data.sensor_fit, data.ortho_scale = (
        "ORTHO",
        "HORIZONTAL" if share >= 1.0 else "VERTICAL",
        max(width, height),
    )
    data.clip_start, data.clip_end = 0.01 * width, 10.0 * (width + extent[2])
    camera = bpy.data.objects.new("FrameTwin picture", data)
    matrix = np.eye(4)
    matrix[:3, :3] = pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    matrix[:3, 3] = pose[:3, :3] @ (middle - [0.0, 0.0, extent[2] + width])
    camera.matrix_world = mathutils.Matrix(matrix.tolist())
    return camera, width, height


def _legend(legend: Legend, camera: mathutils.Matrix, width: float, height: float) -> list[bpy.types.Object]:
    """The bar of colours and its words, close before the camera."""
    depth = -0.05 * width
    left, low, bar, thick = -0.46 * width, -0.42 * height, 0.3 * width, 0.02 * width
    objects = []
    edges = left + bar * np.linspace(0.0, 1.0, BINS + 1)
    for i, colour in enumerate(colour_map()[:BINS].tolist()):
        corners = [(edges[i], low), (edges[i + 1], low), (edges[i + 1], low + thick), (edges[i], low + thick)]
        mesh = bpy.data.meshes.new("FrameTwin legend")
        mesh.from_pydata([(x, y, depth) for x, y in corners], [], [(0, 1, 2, 3)])
        objects.append(_painted(mesh, colour, camera))
    unit = f" in {legend.unit}" if legend.unit else ""
    words = [(legend.quantity.replace("_", " ") + unit, left, low + 1.6 * thick, "LEFT")]
    for share, align in ((0.0, "LEFT"), (0.5, "CENTER"), (1.0, "RIGHT")):
        value = legend.low + share * (legend.high - legend.low)
        words.append((f"{value:.3g}", left + share * bar, low - 1.3 * thick, align))
    for text, x, y, align in words:
        font = bpy.data.curves.new("FrameTwin legend", "FONT")
        font.body, font.align_x, font.size = text, align, 1.2 * thick
        obj = _painted(font, [0.9, 0.9, 0.9], camera)
        obj.matrix_world = camera @ mathutils.Matrix.Translation((x, y, depth))
        objects.append(obj)
    return objects


def _painted(data: bpy.types.ID, colour: list[float], place: mathutils.Matrix) -> bpy.types.Object:
    """An object of one flat colour."""
    name = "FrameTwin legend"
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*colour, 1.0)
    tree = versions.node_tree(material)
    shader, output = (tree.nodes.new(kind) for kind in ("ShaderNodeEmission", "ShaderNodeOutputMaterial"))
    shader.inputs["Color"].default_value = (*colour, 1.0)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    data.materials.append(material)
    obj = bpy.data.objects.new(name, data)
    obj.matrix_world = place
    return obj


def _settings(scene: bpy.types.Scene, size: tuple[int, int]) -> None:
    """Flat, unlit colours, smooth edges, nothing between the renderer and the file."""
    render = scene.render
    render.resolution_y, render.resolution_x = size
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = render.film_transparent = False
    render.dither_intensity = 0.0
    scene.world.color = BACKGROUND
    scene.view_settings.view_transform = "Standard"
    versions.write_still_images(render.image_settings, "PNG")
    render.image_settings.color_mode = "RGB"
    if engines.workbench_works():
        render.engine = engines.WORKBENCH
        shading = scene.display.shading
        shading.light, shading.color_type, shading.background_type = "STUDIO", "MATERIAL", "WORLD"
        shading.show_object_outline, shading.show_cavity = False, True
        scene.display.render_aa = "8"
        return
    render.engine = engines.CYCLES
    scene.cycles.device, scene.cycles.samples, scene.cycles.max_bounces = "CPU", 16, 0
    scene.cycles.use_denoising = False
