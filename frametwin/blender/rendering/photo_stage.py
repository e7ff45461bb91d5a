"""The stage of photos: the print in matte plastic on a painted table before black, lamps, and things beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import mathutils
import numpy as np

from frametwin.blender.rendering import materials
from frametwin.blender.rendering.private_scene import NAME, PrivateScene
from frametwin.capture.scene import PhotoLook

TABLE_REACH = (1.2, 3.0)
"""Distances from the middle of the table, in sizes of the frame, up to which it is lit and from which it is black."""

BALL, BALL_RINGS, SIDES = 2, 12, 24


@dataclass(frozen=True)
class Light:
    """A square soft light that looks at the frame; distance and side in sizes of the frame, angles in degrees."""

    azimuth: float
    elevation: float
    distance: float
    side: float


KEY = Light(azimuth=0.0, elevation=55.0, distance=3.0, side=2.0)
RIM = Light(azimuth=180.0, elevation=30.0, distance=3.0, side=1.5)


class PhotoStage:
    """Plastic, table, things and lights around the frame of a scene.

    Attributes
    ----------
    private
        The scene.
    ground
        (3,) the middle of the table, mm.
    table, clutter
        Objects that are there without the print as well.
    """

    def __init__(self, private: PrivateScene) -> None:
        self.private = private
        content, look = private.content, private.content.look
        low, high = content.truth.bounds
        radius = float(content.thickness.max())
        self.size = float(np.linalg.norm(high - low)) + 2.0 * radius
        self.centre = 0.5 * (low + high)
        self.ground = np.array([self.centre[0], self.centre[1], low[2] - radius])
        private.add_smooth_normals()
        materials.fill_plastic(private.material, look)
        materials.fill_surroundings(private.world, look.fill)
        self.table = self._add_table(look)
        self.clutter = [self._add_thing(piece) for piece in look.clutter]
        key = replace(KEY, elevation=look.light_elevation, side=look.light_side)
        self._lamps = [
            (light, self._add_light(light, irradiance)) for light, irradiance in ((key, look.key), (RIM, look.rim))
        ]
        self.turn_lamps(look.light_azimuth)

    def turn_lamps(self, azimuth: float) -> None:
        """Let the key light stand in this direction, and the other one opposite."""
        for light, item in self._lamps:
            turn, up = np.radians(azimuth + light.azimuth), np.radians(light.elevation)
            outward = np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
            rotation = mathutils.Vector(outward.tolist()).to_track_quat("Z", "Y").to_matrix().to_4x4()
            place = self.centre + light.distance * self.size * outward
            item.matrix_world = mathutils.Matrix.Translation(place) @ rotation

    def show(self, print_: bool = True, surroundings: bool = True) -> None:
        """What the camera sees; light is cast and shadows are thrown by all that is in the scene."""
        self.private.struts.visible_camera = print_
        self.table.visible_camera = surroundings
        for thing in self.clutter:
            thing.is_holdout = not surroundings  # it still hides what is behind it
        self.private.scene.render.film_transparent = not surroundings

    def _add_table(self, look: PhotoLook) -> bpy.types.Object:
        """A plane, black at its rim, as opaque as a real one: from below struts get no light but what it casts back."""
        bright, dark = TABLE_REACH[0] * self.size, TABLE_REACH[1] * self.size
        corners = [(-dark, -dark, 0.0), (dark, -dark, 0.0), (dark, dark, 0.0), (-dark, dark, 0.0)]
        table = self._add_mesh(corners, [(0, 1, 2, 3)])
        materials.fill_table(table.data.materials[0], look, bright, dark)
        table.location = self.ground
        return table

    def _add_thing(self, piece: tuple) -> bpy.types.Object:
        shape, x, y, width, height, turn, *colour = piece
        points, faces = SHAPES[shape]()
        thing = self._add_mesh((points * (width, width, height) * self.size).tolist(), faces)
        materials.fill_paint(thing.data.materials[0], tuple(colour))
        if shape == BALL:
            thing.data.shade_smooth()
        thing.location = self.ground + self.size * np.array([x, y, 0.0])
        thing.rotation_euler = (0.0, 0.0, np.radians(turn))
        return thing

    def _add_mesh(self, points: list, faces: list) -> bpy.types.Object:
        """A new object with a material of its own, which is still empty."""
        data = self.private.keep(bpy.data.meshes.new(NAME))
        data.from_pydata(points, [], faces)
        data.materials.append(self.private.keep(bpy.data.materials.new(NAME)))
        return self.private.add_object(data)

    def _add_light(self, light: Light, irradiance: float) -> bpy.types.Object:
        """A soft light, as strong as makes this irradiance in the middle of the frame."""
        data = self.private.keep(bpy.data.lights.new(NAME, "AREA"))
        data.shape, data.size = "SQUARE", light.side * self.size
        # A lamp of the power P sends the radiance P / (pi side^2) off its face.
        data.energy = irradiance * np.pi * (light.distance * self.size) ** 2
        item = self.private.add_object(data)
        item.visible_camera = False
        return item


def _prism(sides: int) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """An upright prism of width and height 1 on the ground."""
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    around = 0.5 * np.column_stack([np.cos(angle), np.sin(angle)])
    if sides == 4:
        around *= np.sqrt(2.0)
    points = np.concatenate([np.column_stack([around, np.full(sides, z)]) for z in (0.0, 1.0)])
    faces = [(i, (i + 1) % sides, sides + (i + 1) % sides, sides + i) for i in range(sides)]
    return points, [*faces, tuple(range(sides, 2 * sides)), tuple(reversed(range(sides)))]


def _ball() -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """A ball of width and height 1 on the ground."""
    down = np.pi * (np.arange(BALL_RINGS) + 0.5) / BALL_RINGS
    around = 2.0 * np.pi * np.arange(SIDES) / SIDES
    across, turn = np.meshgrid(down, around, indexing="ij")
    rings = 0.5 * np.stack([np.sin(across) * np.cos(turn), np.sin(across) * np.sin(turn), np.cos(across)], axis=-1)
    faces = [
        (r * SIDES + i, (r + 1) * SIDES + i, (r + 1) * SIDES + (i + 1) % SIDES, r * SIDES + (i + 1) % SIDES)
        for r in range(BALL_RINGS - 1)
        for i in range(SIDES)
    ]
    last = (BALL_RINGS - 1) * SIDES
    caps = [tuple(range(SIDES)), tuple(reversed(range(last, last + SIDES)))]
    return rings.reshape(-1, 3) + np.array([0.0, 0.0, 0.5]), [*faces, *caps]


SHAPES = (lambda: _prism(4), lambda: _prism(SIDES), _ball)
"""Of things on the table: points (V, 3) and faces, by the number in a `Piece`."""
