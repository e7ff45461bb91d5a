"""What is drawn anew when the user chooses another quantity, range or opacity."""

from __future__ import annotations

from collections.abc import Container

import bpy

from frametwin.blender.display.twin_records import load_legend
from frametwin.blender.display.twins import Colours, is_twin, recolour_twin
from frametwin.blender.views.captures import restyle_pictures
from frametwin.errors import FrameTwinError

from . import session


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
    fixed = not view.automatic and view.high > view.low
    return Colours(quantity, *((view.low, view.high) if fixed else ()))


def recolour_active(view: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Colour the scene's twin as its settings say; called by Blender when one of them changes."""
    settings = view.id_data.frametwin
    if not is_twin(settings.twin):
        return
    view, legend = settings.view, load_legend(settings.twin)
    wanted = Colours(view.quantity, *(() if view.automatic else (view.low, view.high)))
    if legend is not None:
        shown = Colours(legend.quantity, *(() if legend.automatic else (legend.low, legend.high)))
        if shown == wanted:
            return  # as a new twin comes: colouring a large one anew would hold the interface for nothing
    try:
        recolour_twin(settings.twin, wanted.quantity, wanted.low, wanted.high)
    except FrameTwinError as error:
        session.tell(str(error), error=True)
