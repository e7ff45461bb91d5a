"""What is drawn anew when the user chooses another quantity, range or opacity."""

from __future__ import annotations

import bpy

from frametwin.blender.captures import restyle_pictures
from frametwin.blender.twin_records import load_legend
from frametwin.blender.twins import is_twin, recolour_twin
from frametwin.errors import FrameTwinError

from . import session


def restyle_active(wanted: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Draw the pictures in the rig's cameras as the settings say; called by Blender when one of them changes."""
    rig = wanted.id_data.frametwin.rig
    if rig is not None:
        restyle_pictures(rig, opacity=wanted.opacity, front=wanted.front)


def recolour_afresh(view: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """As `recolour_active`, for another twin or quantity, of which other struts are the worst."""
    wanted = view.id_data.frametwin.view
    wanted.at, wanted.at_words = -1, ""
    recolour_active(view, context)


def recolour_active(view: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Colour the scene's twin as its settings say; called by Blender when one of them changes."""
    settings = view.id_data.frametwin
    if not is_twin(settings.twin):
        return
    wanted, legend = settings.view, load_legend(settings.twin)
    if legend is not None and legend.automatic and wanted.automatic and legend.quantity == wanted.quantity:
        return  # as a new twin comes: colouring a large one anew would hold the interface for nothing
    low, high = (None, None) if wanted.automatic else (wanted.low, wanted.high)
    try:
        recolour_twin(settings.twin, wanted.quantity, low, high)
    except FrameTwinError as error:
        session.tell(str(error), error=True)
