"""FrameTwin in Blender's sidebar: registration alone."""

from __future__ import annotations

import bpy

from . import (
    adapt,
    adopting,
    cameras,
    compare,
    computing,
    deform,
    fit,
    import_rig,
    inspect_struts,
    inspect_view,
    jobs_in_view,
    legend,
    masks,
    menus,
    opening,
    overlay,
    photographs,
    pick_strut,
    plan,
    preferences,
    printing,
    properties,
    render,
    rig_gizmo,
    session,
    setting_presets,
    show_hide,
    status,
    support,
    translations,
    twin,
)

if computing.HAS_SET_UP:
    from . import set_up

MODULES = (
    *(properties, preferences, status, inspect_struts, plan, deform, cameras, render),
    *(photographs, fit, twin, adapt, printing, compare),
)
"""In the order of their panels."""

WITHOUT_PANELS = (
    *(session, show_hide, support, opening, overlay, import_rig, masks),
    *(inspect_view, pick_strut, menus, setting_presets, rig_gizmo),
)
OPTIONAL = (set_up,) if computing.HAS_SET_UP else ()
CLASSES = tuple(cls for module in (*MODULES, *WITHOUT_PANELS, *OPTIONAL) for cls in module.CLASSES)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.frametwin = bpy.props.PointerProperty(type=properties.FrameTwinSettings)
    translations.register()
    session.register()
    adopting.register()
    legend.register()
    jobs_in_view.register()
    status.register()
    menus.register()
    inspect_struts.register()
    setting_presets.register()


def unregister() -> None:
    setting_presets.unregister()
    inspect_struts.unregister()
    menus.unregister()
    status.unregister()
    jobs_in_view.unregister()
    legend.unregister()
    adopting.unregister()
    session.unregister()
    translations.unregister()
    del bpy.types.Scene.frametwin
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
