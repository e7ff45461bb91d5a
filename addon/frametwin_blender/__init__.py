"""FrameTwin in Blender's sidebar: registration alone."""

from __future__ import annotations

import bpy

from . import (
    adapt,
    cameras,
    computing,
    deform,
    fit,
    jobs_in_view,
    legend,
    menus,
    opening,
    overlay,
    plan,
    preferences,
    printing,
    properties,
    render,
    session,
    show_hide,
    status,
    support,
    twin,
)

if computing.HAS_SET_UP:
    from . import set_up

MODULES = (properties, preferences, status, plan, deform, cameras, render, fit, twin, adapt, printing)
"""In the order of their panels."""

WITHOUT_PANELS = (session, show_hide, support, opening, overlay, menus, *((set_up,) if computing.HAS_SET_UP else ()))
CLASSES = tuple(cls for module in (*MODULES, *WITHOUT_PANELS) for cls in module.CLASSES)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.frametwin = bpy.props.PointerProperty(type=properties.FrameTwinSettings)
    session.register()
    legend.register()
    jobs_in_view.register()
    status.register()
    menus.register()


def unregister() -> None:
    menus.unregister()
    status.unregister()
    jobs_in_view.unregister()
    legend.unregister()
    session.unregister()
    del bpy.types.Scene.frametwin
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
