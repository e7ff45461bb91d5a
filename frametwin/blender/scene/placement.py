"""Which scene an object is in, and what its modifiers, shape keys, parents and constraints make of it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import InputError


def label(obj: bpy.types.Object) -> str:
    """What to call an object in messages."""
    return f"object {obj.name}"


def scene_of(obj: bpy.types.Object, scene: bpy.types.Scene | None = None) -> bpy.types.Scene:
    """The scene whose units and time hold for an object.

    Returns
    -------
    ``scene`` where it is given; else the current scene if the object is in it, or the first one that has it. An
    object that is in no scene takes the current one.
    """
    if scene is not None:
        return scene
    holders = obj.users_scene
    current = bpy.context.scene
    return current if current in holders or not holders else holders[0]


def flush_edits(obj: bpy.types.Object) -> None:
    """Write what is being changed in Edit Mode to the object's data, and have it evaluated anew."""
    if obj.mode == "EDIT":
        obj.update_from_editmode()
        obj.data.update_tag()


def current_depsgraph(obj: bpy.types.Object, scene: bpy.types.Scene | None = None) -> bpy.types.Depsgraph:
    """The dependency graph in which the object is evaluated, brought up to date."""
    scene = scene_of(obj, scene)
    layers = list(scene.view_layers)
    if bpy.context.scene == scene:
        layers.insert(0, bpy.context.view_layer)
    layer = next((candidate for candidate in layers if candidate.objects.get(obj.name) == obj), layers[0])
    layer.update()
    return layer.depsgraph


def evaluated_object(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object:
    """The object as the dependency graph sees it.

    Raises
    ------
    InputError
        If the object is not part of it.
    """
    evaluated = obj.evaluated_get(depsgraph)
    if not evaluated.is_evaluated:
        raise InputError.at(
            label(obj),
            "visibility",
            f"scene {depsgraph.scene.name} does not evaluate it, since it is disabled or its collection is excluded",
            "enable it in viewports, or link it to a visible collection",
        )
    return evaluated


def _matrix_in(obj: bpy.types.Object, graph: bpy.types.Depsgraph) -> Matrix:
    """The object's matrix in units.

    Blender leaves the matrix of what is hidden as it was when it was seen last. It is made here of the object's own
    location and so on and of its parents'; where constraints, animation or bones place the object, it stays as it was.
    """
    evaluated = obj.evaluated_get(graph)
    if evaluated.is_evaluated and obj.visible_get(view_layer=graph.view_layer):
        return evaluated.matrix_world
    if len(obj.constraints) or obj.animation_data is not None or obj.parent_type != "OBJECT":
        return evaluated.matrix_world
    if obj.parent is None:
        return obj.matrix_basis
    return _matrix_in(obj.parent, graph) @ obj.matrix_parent_inverse @ obj.matrix_basis


FLAT = 1e-6
"""A scale that is as much smaller than the largest one, or more, is taken to be zero."""


@dataclass(frozen=True, eq=False)
class Placement:
    """How an object lies in the world.

    Attributes
    ----------
    matrix
        (4, 4) from the object's axes to the world, both in mm.
    unit
        Mm in a Blender unit.
    """

    matrix: np.ndarray
    unit: float

    @classmethod
    def of(
        cls,
        obj: bpy.types.Object,
        depsgraph: bpy.types.Depsgraph | None = None,
        scene: bpy.types.Scene | None = None,
    ) -> Placement:
        """With parents and constraints, in a dependency graph or as it is now in ``scene`` (or its own scene)."""
        graph = current_depsgraph(obj, scene) if depsgraph is None else depsgraph
        unit = mm_per_unit(graph.scene)
        matrix = np.array(_matrix_in(obj, graph), dtype=np.float64)
        matrix[:3, 3] *= unit
        return cls(matrix=matrix, unit=unit)

    @classmethod
    def quickly(cls, obj: bpy.types.Object, scene: bpy.types.Scene | None = None) -> Placement:
        """The same without evaluating the scene, if nothing but the object's own location and so on places it."""
        if obj.parent is not None or len(obj.constraints) or obj.animation_data is not None:
            return cls.of(obj, scene=scene)
        unit = mm_per_unit(scene_of(obj, scene))
        matrix = np.array(obj.matrix_basis, dtype=np.float64)
        matrix[:3, 3] *= unit
        return cls(matrix=matrix, unit=unit)

    @property
    def scale(self) -> float:
        """The object's scale: the cube root of its factor of volume, as `Wireframe.transformed` has it."""
        return float(np.cbrt(abs(np.linalg.det(self.matrix[:3, :3]))))

    def refuse_flat(self, source: str) -> None:
        """Refuse an object that is scaled to nothing along an axis: what is drawn flat is no frame to be printed.

        Raises
        ------
        InputError
            With the axes; ``source`` is what to call the object.
        """
        axes = np.linalg.norm(self.matrix[:3, :3], axis=0)
        least = FLAT * float(axes.max())
        flat = [name for name, size in zip("XYZ", axes.tolist(), strict=True) if size <= least]
        if flat:
            problem = f"is zero along {', '.join(flat)}"
            raise InputError.at(source, "scale", problem, "give the object a size there (sidebar > Item > Scale)")
        if np.linalg.svd(self.matrix[:3, :3], compute_uv=False)[-1] <= least:
            problem = "that of its parents makes it flat"
            raise InputError.at(source, "scale", problem, "give them a size, or unparent it")

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """World mm of points (..., 3) in mm along the object's axes."""
        return points @ self.matrix[:3, :3].T + self.matrix[:3, 3]

    def to_object(self, points: np.ndarray) -> np.ndarray:
        """The inverse of `to_world`; the scale must not be zero."""
        return (points - self.matrix[:3, 3]) @ np.linalg.inv(self.matrix[:3, :3]).T
