"""A scene of its own for rendering, beside the user's: built from a `Scene`, removed without a trace."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import bpy
import mathutils
import numpy as np

from frametwin.blender.rendering import materials
from frametwin.cameras import Camera, to_blender
from frametwin.capture.scene import Scene
from frametwin.capture.strut_mesh import SIDES, StrutMesh, resolution_for, strut_mesh

NAME = "FrameTwin render"
NEAR_SHARE = 0.05
FAR_FACTOR = 20.0
"""Planes between which a camera sees, as parts of the distances of the nearest and the farthest strut."""

SHADED_SIDES = 24
"""Least sides of tubes whose surface is seen, not only their outline."""


class PrivateScene:
    """Blender data of one `Scene`; 1 Blender unit is 1 mm.

    Attributes
    ----------
    scene
        The Blender scene. It is not the one in the window.
    struts
        The object of all struts.
    material, world
        Of the struts and around them, flat white and black at first.
    """

    def __init__(self, content: Scene) -> None:
        self.content = content
        self._made: list[bpy.types.ID] = []
        try:
            self._build()
        except BaseException:
            self.remove()
            raise

    def keep(self, block: bpy.types.ID) -> bpy.types.ID:
        """Remember a data-block that goes when the scene goes."""
        self._made.append(block)
        return block

    def add_object(self, data: bpy.types.ID) -> bpy.types.Object:
        """A new object with this data in the scene."""
        item = self.keep(bpy.data.objects.new(NAME, data))
        self.scene.collection.objects.link(item)
        return item

    def add_smooth_normals(self) -> None:
        """Give the mesh the normals of the round struts that it stands for."""
        if len(self.mesh.vertices):
            self.struts.data.normals_split_custom_set_from_vertices(self.mesh.normals)

    def show_struts_alone(self) -> None:
        """Flat white struts and nothing else before black."""
        materials.fill_flat(self.material)
        materials.fill_black(self.world)
        for item in self.scene.collection.objects:
            item.hide_render = item.type != "CAMERA" and item != self.struts

    def look_through(self, camera: Camera) -> None:
        """Set the one camera of the scene and the picture's size."""
        settings = to_blender(camera)
        item, lens, render = self.scene.camera, self.scene.camera.data, self.scene.render
        item.matrix_world = mathutils.Matrix(settings.matrix_world.tolist())
        for field in ("sensor_fit", "sensor_width", "sensor_height", "lens", "shift_x", "shift_y"):
            setattr(lens, field, getattr(settings, field))
        for field in ("resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y"):
            setattr(render, field, getattr(settings, field))
        depth = camera.project(self.content.truth.control_points, distort=False)[1]
        radius = float(self.content.thickness.max())
        far = max(float(depth.max()) + radius, radius)
        near = float(np.min(depth, where=depth > radius, initial=far))
        lens.clip_start, lens.clip_end = NEAR_SHARE * near, FAR_FACTOR * far

    def remove(self) -> None:
        """Take everything out of the file again."""
        for block in reversed(self._made):
            with contextlib.suppress(ReferenceError):  # removed by somebody else
                collection = getattr(bpy.data, _COLLECTIONS[block.id_type])
                collection.remove(block)
        self._made.clear()

    def _build(self) -> None:
        content = self.content
        self.scene = self.keep(bpy.data.scenes.new(NAME))
        shaded = content.passes or content.style != "mask"
        resolution = resolution_for(
            content.truth, content.thickness, content.cameras, least_sides=SHADED_SIDES if shaded else SIDES[0]
        )
        self.mesh = strut_mesh(content.truth, content.present, content.thickness, resolution)
        mesh = self.keep(blender_mesh(self.mesh, NAME))
        self.material = self.keep(bpy.data.materials.new(NAME))
        mesh.materials.append(self.material)
        self.struts = self.add_object(mesh)
        self.world = self.keep(bpy.data.worlds.new(NAME))
        self.scene.world = self.world
        self.show_struts_alone()
        self.scene.camera = self.add_object(self.keep(bpy.data.cameras.new(NAME)))
        self._own_settings()

    def _own_settings(self) -> None:
        """What is alike for every kind of picture: nothing between the renderer and the file."""
        scene, render = self.scene, self.scene.render
        scene.unit_settings.system = "NONE"
        render.resolution_percentage = 100
        render.use_border = render.film_transparent = False
        render.use_compositing = render.use_sequencer = False
        render.use_file_extension = render.use_overwrite = True
        render.use_persistent_data = False  # measured: gains nothing
        render.dither_intensity = 0.0
        for field in dir(render):
            if field.startswith("use_stamp"):
                setattr(render, field, False)
        with contextlib.suppress(TypeError):  # a colour configuration of the user's: black and white stay what they are
            scene.view_settings.view_transform = "Raw"
        scene.view_settings.exposure, scene.view_settings.gamma = 0.0, 1.0


_COLLECTIONS = {
    "SCENE": "scenes",
    "MESH": "meshes",
    "MATERIAL": "materials",
    "OBJECT": "objects",
    "WORLD": "worlds",
    "CAMERA": "cameras",
    "LIGHT": "lights",
}


@contextlib.contextmanager
def private_scene(content: Scene) -> Iterator[PrivateScene]:
    """A `PrivateScene` that is removed at the end, whatever happens, with the render result if that is new."""
    results = {image for image in bpy.data.images if image.type == "RENDER_RESULT"}
    private = None
    try:
        private = PrivateScene(content)
        yield private
    finally:
        if private is not None:
            private.remove()
        for image in [image for image in bpy.data.images if image.type == "RENDER_RESULT"]:
            if image not in results:
                bpy.data.images.remove(image)


def blender_mesh(mesh: StrutMesh, name: str) -> bpy.types.Mesh:
    """A Blender mesh with the strut of every face as the attribute `materials.STRUT_ATTRIBUTE`."""
    data = bpy.data.meshes.new(name)
    corners = np.concatenate([mesh.quads.ravel(), mesh.triangles.ravel()])
    quads, triangles = len(mesh.quads), len(mesh.triangles)
    starts = np.concatenate([4 * np.arange(quads), 4 * quads + 3 * np.arange(triangles)]).astype(np.int32)
    data.vertices.add(len(mesh.vertices))
    data.vertices.foreach_set("co", mesh.vertices.ravel())
    data.loops.add(corners.size)
    data.loops.foreach_set("vertex_index", corners)
    data.polygons.add(quads + triangles)
    data.polygons.foreach_set("loop_start", starts)
    data.update(calc_edges=True)
    data.attributes.new(materials.STRUT_ATTRIBUTE, "INT", "FACE").data.foreach_set("value", mesh.strut)
    return data
