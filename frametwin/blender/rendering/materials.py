"""Materials and worlds of rendered scenes, as node trees."""

from __future__ import annotations

import bpy

from frametwin.blender.rendering.versions import node_tree
from frametwin.capture.scene import PhotoLook

STRUT_ATTRIBUTE = "strut"
"""Integer attribute of every face: the strut that it belongs to."""

STRUT_PASS = "Strut"
"""Pass of the strut index plus one; 0 is nothing."""

LAYER_STREAK = 0.1
"""Height over length of the streaks that make a layer."""

TABLE_SHINE = 0.1
"""Specular level of the table's paint, 0.5 being that of ordinary plastic."""

PAINT_ROUGHNESS = 0.6
"""Of things on the table."""

LAYER_DEPTH = 0.3
"""Height of the bumps as a share of the layer height."""


def fill_flat(material: bpy.types.Material) -> None:
    """White and shining by itself, seen alike from everywhere; writes the strut index plus one into a pass."""
    tree = node_tree(material)
    emission, output = _nodes(tree, "ShaderNodeEmission", "ShaderNodeOutputMaterial")
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    attribute, plus, index = _nodes(tree, "ShaderNodeAttribute", "ShaderNodeMath", "ShaderNodeOutputAOV")
    attribute.attribute_type, attribute.attribute_name = "GEOMETRY", STRUT_ATTRIBUTE
    plus.operation, plus.inputs[1].default_value = "ADD", 1.0
    index.aov_name = STRUT_PASS
    tree.links.new(attribute.outputs["Fac"], plus.inputs[0])
    tree.links.new(plus.outputs[0], index.inputs["Value"])


def fill_black(world: bpy.types.World) -> None:
    """Nothing but black around the frame, for every engine."""
    world.color = (0.0, 0.0, 0.0)
    tree = node_tree(world)
    background, output = _nodes(tree, "ShaderNodeBackground", "ShaderNodeOutputWorld")
    background.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    tree.links.new(background.outputs[0], output.inputs["Surface"])


def fill_plastic(material: bpy.types.Material, look: PhotoLook) -> None:
    """Matte plastic that was laid in layers: streaks across the vertical, in its shape and in its colour."""
    tree = node_tree(material)
    shader, output = _nodes(tree, "ShaderNodeBsdfPrincipled", "ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    shader.inputs["Roughness"].default_value = look.strut_roughness
    place, stretch, noise = _nodes(tree, "ShaderNodeTexCoord", "ShaderNodeMapping", "ShaderNodeTexNoise")
    stretch.inputs["Scale"].default_value = (LAYER_STREAK, LAYER_STREAK, 1.0)
    noise.inputs["Scale"].default_value = 1.0 / look.layer_height
    noise.inputs["Detail"].default_value = 2.0
    tree.links.new(place.outputs["Object"], stretch.inputs["Vector"])
    tree.links.new(stretch.outputs[0], noise.inputs["Vector"])
    value = noise.outputs[0]  # 0..1, 0.5 on average
    bump, shade, colour = _nodes(tree, "ShaderNodeBump", "ShaderNodeMapRange", "ShaderNodeVectorMath")
    bump.inputs["Strength"].default_value = look.layer_bump
    bump.inputs["Distance"].default_value = LAYER_DEPTH * look.layer_height
    tree.links.new(value, bump.inputs["Height"])
    tree.links.new(bump.outputs[0], shader.inputs["Normal"])
    shade.inputs["To Min"].default_value = 1.0 - 2.0 * look.layer_colour
    shade.inputs["To Max"].default_value = 1.0 + 2.0 * look.layer_colour
    tree.links.new(value, shade.inputs["Value"])
    colour.operation = "MULTIPLY"
    colour.inputs[0].default_value = look.strut_colour
    tree.links.new(shade.outputs[0], colour.inputs[1])
    tree.links.new(colour.outputs[0], shader.inputs["Base Color"])


def fill_table(material: bpy.types.Material, look: PhotoLook, bright: float, dark: float) -> None:
    """Painted table, lit up to the distance ``bright`` from its middle and black from ``dark`` on."""
    tree = node_tree(material)
    shader, output = _nodes(tree, "ShaderNodeBsdfPrincipled", "ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    shader.inputs["Roughness"].default_value = look.table_roughness
    place, length, fade = _nodes(tree, "ShaderNodeTexCoord", "ShaderNodeVectorMath", "ShaderNodeMapRange")
    colour, shine = _nodes(tree, "ShaderNodeVectorMath", "ShaderNodeMath")
    length.operation = "LENGTH"
    fade.interpolation_type = "SMOOTHSTEP"
    for name, number in (("From Min", bright), ("From Max", dark), ("To Min", 1.0), ("To Max", 0.0)):
        fade.inputs[name].default_value = number
    colour.operation = "MULTIPLY"
    colour.inputs[0].default_value = look.table_colour
    tree.links.new(place.outputs["Object"], length.inputs[0])
    tree.links.new(length.outputs["Value"], fade.inputs["Value"])
    tree.links.new(fade.outputs[0], colour.inputs[1])
    tree.links.new(colour.outputs[0], shader.inputs["Base Color"])
    shine.operation, shine.inputs[1].default_value = "MULTIPLY", TABLE_SHINE
    tree.links.new(fade.outputs[0], shine.inputs[0])
    tree.links.new(shine.outputs[0], shader.inputs["Specular IOR Level"])


def fill_paint(material: bpy.types.Material, colour: tuple[float, float, float]) -> None:
    """Matte paint of one colour."""
    tree = node_tree(material)
    shader, output = _nodes(tree, "ShaderNodeBsdfPrincipled", "ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    shader.inputs["Base Color"].default_value = (*colour, 1.0)
    shader.inputs["Roughness"].default_value = PAINT_ROUGHNESS


def fill_matte(material: bpy.types.Material, grey: float) -> None:
    """A perfectly matte surface of one grey, as paper and ink."""
    tree = node_tree(material)
    shader, output = _nodes(tree, "ShaderNodeBsdfDiffuse", "ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    shader.inputs["Color"].default_value = (grey, grey, grey, 1.0)


def fill_even(world: bpy.types.World, light: float) -> None:
    """The same light from everywhere."""
    tree = node_tree(world)
    background, output = _nodes(tree, "ShaderNodeBackground", "ShaderNodeOutputWorld")
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    background.inputs["Strength"].default_value = light
    tree.links.new(background.outputs[0], output.inputs["Surface"])


def fill_surroundings(world: bpy.types.World, fill: float) -> None:
    """Even light from everywhere, though black where the camera looks at it."""
    world.color = (0.0, 0.0, 0.0)
    tree = node_tree(world)
    background, output, path, strength = _nodes(
        tree, "ShaderNodeBackground", "ShaderNodeOutputWorld", "ShaderNodeLightPath", "ShaderNodeMapRange"
    )
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    strength.inputs["To Min"].default_value, strength.inputs["To Max"].default_value = fill, 0.0
    tree.links.new(path.outputs["Is Camera Ray"], strength.inputs["Value"])
    tree.links.new(strength.outputs[0], background.inputs["Strength"])
    tree.links.new(background.outputs[0], output.inputs["Surface"])


def _nodes(tree: bpy.types.NodeTree, *kinds: str) -> list[bpy.types.Node]:
    return [tree.nodes.new(kind) for kind in kinds]
