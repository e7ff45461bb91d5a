"""What differs between the generations of Blender, 4.5 LTS to 5.2 LTS."""

from __future__ import annotations

import contextlib
import warnings

import bpy

from frametwin.blender.rendering.console import quiet_console


def version() -> str:
    """Blender's version, such as ``4.5.15 LTS``."""
    return bpy.app.version_string


def node_tree(owner: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    """The empty node tree of a material or world. From 5.0 on it is always there, and asking for it is deprecated."""
    if owner.node_tree is None or bpy.app.version < (5, 0, 0):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree


def write_still_images(settings: bpy.types.ImageFormatSettings, file_format: str) -> None:
    """Set the kind of file: one picture a file, ``PNG`` or ``OPEN_EXR``."""
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format = file_format


def write_multilayer_images(settings: bpy.types.ImageFormatSettings) -> None:
    """Set the kind of file: OpenEXR with every pass in it."""
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"


def choose_denoiser(scene: bpy.types.Scene) -> bool:
    """Switch on the denoiser for rendering; whether this build has one."""
    try:
        with quiet_console():  # it looks for graphics cards and tells that there are none
            scene.cycles.use_denoising = True
            scene.cycles.denoiser = "OPENIMAGEDENOISE"
    except TypeError:  # an enumeration without this entry
        scene.cycles.use_denoising = False
        return False
    scene.cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    for setting, value in (("denoising_prefilter", "NONE"), ("denoising_quality", "FAST")):
        with contextlib.suppress(AttributeError, TypeError):  # a matter of speed only
            setattr(scene.cycles, setting, value)
    return True
