"""A click on a strut of the twin, in the 3D view: its values, and its place in the list."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import ClassVar

import bpy
import numpy as np

from frametwin.blender.display.twins import RUN_KEY
from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import FrameTwinError, InputError
from frametwin.geometry import bezier
from frametwin.twin.runs import load_run

from .inspect_struts import NAMES, fill, table_of
from .steps import Step, needs, settings_of, twin_of

REACH = 20
"""Pixels from a click to a strut that it means, at a resolution scale of 1."""

MOVING = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "MOUSEMOVE"}
"""Events that move the view while a strut is being picked."""


class FRAMETWIN_OT_pick_strut(Step, bpy.types.Operator):
    """Click a strut of the twin in the 3D view, to see its values and to find it in the list"""

    bl_idname = "frametwin.pick_strut"
    bl_label = "FrameTwin: Pick Strut"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    strut: bpy.props.IntProperty(default=-1, options={"SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, twin_of(context), "Fit a capture or import a run first")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if context.area is None or context.area.type != "VIEW_3D":
            self.report({"ERROR"}, "Point at a 3D view, where the twin is.")
            return {"CANCELLED"}
        context.window.cursor_modal_set("EYEDROPPER")
        context.area.header_text_set("Click a strut; Esc or right click to leave it")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in {"ESC", "RIGHTMOUSE"}:
            self._leave(context)
            return {"CANCELLED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return (
                {"PASS_THROUGH"}
                if event.type in {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"}
                else {"RUNNING_MODAL"}
            )
        self._leave(context)
        region = next(region for region in context.area.regions if region.type == "WINDOW")
        place = np.array([event.mouse_x - region.x, event.mouse_y - region.y], dtype=float)
        try:
            self.strut = strut_at(context, region, place)
        except FrameTwinError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if self.strut < 0:
            self.report({"INFO"}, "There is no strut")
            return {"CANCELLED"}
        return self.execute(context)

    def _leave(self, context: bpy.types.Context) -> None:
        context.window.cursor_modal_restore()
        context.area.header_text_set(None)

    def act(self, context: bpy.types.Context) -> str:
        known = table_of(context) or fill(context)
        if not 0 <= self.strut < known.count:
            raise InputError(f"The twin has no strut {self.strut}: it has 0 to {known.count - 1}.")
        context.window_manager.frametwin_inspect.at = self.strut
        quantity = settings_of(context).view.quantity
        return f"Strut {self.strut}: {NAMES.get(quantity, quantity).lower()} {known.text(self.strut, quantity)}"


def strut_at(context: bpy.types.Context, region: bpy.types.Region, place: np.ndarray) -> int:
    """The strut of the twin nearest to a pixel (2,) of a 3D view; -1 if none is near.

    Raises
    ------
    InputError
        If the twin's run folder cannot be read.
    """
    twin, _ = load_run(Path(str(twin_of(context).get(RUN_KEY, ""))))
    curves = twin.curves / mm_per_unit(context.scene)
    view = next(area for area in context.window.screen.areas if region in list(area.regions)).spaces.active.region_3d
    reach = REACH * context.preferences.system.ui_scale
    return nearest_strut(curves, np.array(view.perspective_matrix), (region.width, region.height), place, reach)


def nearest_strut(
    curves: np.ndarray, matrix: np.ndarray, size: tuple[int, int], place: np.ndarray, reach: float
) -> int:
    """The strut nearest to a pixel; -1 if none is near.

    Parameters
    ----------
    curves : (E, n + 1, 3) array, Blender units
        Of the struts.
    matrix : (4, 4) array
        From the world to what a view shows, from -1 to 1.
    size
        Width and height of the view in pixels.
    place : (2,) array, pixels
        From the lower left corner.
    reach
        Pixels at most from there to the strut.
    """
    points = bezier.evaluate(curves, np.linspace(0.0, 1.0, 17))
    seen = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=-1) @ matrix.T
    ahead = seen[..., 3] > 0.0
    pixels = (0.5 + 0.5 * seen[..., :2] / np.where(ahead, seen[..., 3], 1.0)[..., None]) * size
    start, step = pixels[:, :-1], np.diff(pixels, axis=1)
    share = ((place - start) * step).sum(axis=-1) / np.maximum((step**2).sum(axis=-1), 1e-12)
    away = np.linalg.norm(start + np.clip(share, 0.0, 1.0)[..., None] * step - place, axis=-1)
    least = np.where(ahead[:, :-1] & ahead[:, 1:], away, np.inf).min(axis=1)
    strut = int(np.argmin(least))
    return strut if least[strut] <= reach else -1


CLASSES = (FRAMETWIN_OT_pick_strut,)
