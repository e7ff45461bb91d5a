"""FrameTwin in Blender's sidebar: registration alone."""

from __future__ import annotations

import bpy

from . import (
    adapt,
    cameras,
    computing,
    deform,
    fit,
    legend,
    plan,
    preferences,
    printing,
    properties,
    render,
    session,
    twin,
)

if computing.HAS_SET_UP:
    from . import set_up

MODULES = (properties, preferences, plan, deform, cameras, render, fit, twin, adapt, printing)
"""In the order of their panels."""

WITHOUT_PANELS = (session, set_up) if computing.HAS_SET_UP else (session,)
CLASSES = tuple(cls for module in (*MODULES, *WITHOUT_PANELS) for cls in module.CLASSES)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.frametwin = bpy.props.PointerProperty(type=properties.FrameTwinSettings)
    session.register()
    legend.register()


def unregister() -> None:
    legend.unregister()
    session.unregister()
    del bpy.types.Scene.frametwin
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
