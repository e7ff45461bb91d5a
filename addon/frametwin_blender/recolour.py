"""What is drawn anew when the user chooses another quantity, range or opacity."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

import bpy

from frametwin.blender.display.colouring import legend_of, shortest, suitable_map
from frametwin.blender.display.twins import Colours, is_twin, recolour_twin, twin_object
from frametwin.blender.views.captures import restyle_pictures
from frametwin.errors import FrameTwinError

from . import session


def show_colours(scene: bpy.types.Scene) -> None:
    """Let the 3D views show colours of attributes, and the scene's pictures as they are, where nobody chose otherwise.

    Only what is as Blender comes is changed: Solid shading by materials in studio light, and the view transform AgX,
    which would make other colours of those in the legend.
    """
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D" and area.spaces.active.shading.color_type == "MATERIAL":
                shading = area.spaces.active.shading
                shading.color_type = "VERTEX"
                if shading.light == "STUDIO":  # which would darken them
                    shading.light, shading.show_cavity, shading.cavity_type = "FLAT", True, "BOTH"
                    shading.cavity_ridge_factor = shading.curvature_ridge_factor = 0.0
    if scene.view_settings.view_transform == "AgX" and scene.view_settings.look == "None":
        scene.view_settings.view_transform = "Standard"


def restyle_active(wanted: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Draw the pictures in the rig's cameras as the settings say; called by Blender when one of them changes."""
    rig = wanted.id_data.frametwin.rig
    if rig is not None and wanted.overlay == "picture":
        restyle_pictures(rig, opacity=wanted.opacity, front=wanted.front)


def recolour_afresh(view: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """As `recolour_active`, for another twin or quantity, of which other struts are the worst."""
    wanted = view.id_data.frametwin.view
    wanted.at, wanted.at_words = -1, ""
    recolour_active(view, context)


def wanted_colours(view: bpy.types.PropertyGroup, known: Container[str]) -> Colours:
    """What the settings say, as far as a twin with these quantities can be shown so."""
    quantity = view.quantity if view.quantity in known else "displacement"
    ends = wanted_ends(view)
    return Colours(quantity, *(ends if view.high > view.low else (None, None)), wanted_map(view))


def wanted_ends(view: bpy.types.PropertyGroup) -> tuple[float | None, float | None]:
    """The ends of the range that was given; ``None`` for what suits the values."""
    return (None, None) if view.automatic else (shortest(view.low), shortest(view.high))


def wanted_map(view: bpy.types.PropertyGroup) -> str | None:
    """The colour map that was chosen; ``None`` for what suits the quantity."""
    return None if view.colour_map == "suitable" else view.colour_map


def recolour_active(view: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Colour the scene's twin as its settings say; called by Blender when one of them changes."""
    settings = view.id_data.frametwin
    if not is_twin(settings.twin):
        return
    view, obj = settings.view, twin_object(settings.twin)
    legend = None if obj is None else legend_of(obj)
    wanted = Colours(view.quantity, *wanted_ends(view), wanted_map(view))
    if legend is not None:
        low, high = (None, None) if legend.automatic else (legend.low, legend.high)
        suitable = suitable_map(legend.quantity)
        if Colours(legend.quantity, low, high, legend.colour_map) == replace(
            wanted, map_name=wanted.map_name or suitable
        ):
            return  # as a new twin comes: colouring a large one anew would hold the interface for nothing
    try:
        recolour_twin(settings.twin, wanted.quantity, wanted.low, wanted.high, wanted.map_name)
    except FrameTwinError as error:
        session.tell(str(error), error=True)
