"""Step 6, the twin: colours, statistics, the struts to look at, export."""

# No postponed annotations here: Blender reads them as properties.
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import bpy
import numpy as np

from frametwin.blender.display.display_inputs import BATCH, DASHES, EXAGGERATION, GHOST
from frametwin.blender.display.exports import export_twin
from frametwin.blender.display.highlights import clear_highlight, highlight_struts
from frametwin.blender.display.quantities import LOW, quantity_named
from frametwin.blender.display.statistics import StrutValues, statistics_of, worst_struts
from frametwin.blender.display.twin_records import load_values, load_verdict
from frametwin.blender.display.twins import TwinObjects, find_twin, remove_twin, twin_object
from frametwin.blender.frames.plan_objects import make_active
from frametwin.blender.scene import visibility
from frametwin.blender.scene.units import mm_per_unit
from frametwin.blender.views.framing import MARGIN
from frametwin.errors import InputError
from frametwin.twin.verdict import GOOD, Verdict

from .display_inputs import draw_input
from .file_formats import FORMATS, UNIT_ITEMS, FrameExport
from .in_view import show_twin
from .layouts import buttons, is_narrow
from .steps import (
    Panel,
    Step,
    draw_chosen,
    draw_shown,
    needs,
    plan_of,
    print_of,
    settings_of,
    twin_of,
    write_text,
)
from .translations import translated
from .views import see

REASONS = 3
"""Of the verdict that are shown."""

FRAME = 16
"""What a box takes of the width of a text, in pixels."""

KINDS = (
    ("worst", "Worst", "Those of the worst values of what the colours show"),
    ("missing", "Missing", "Those of which 15 % or more in one stretch is not there"),
    ("uncertain", "Uncertain", "Those that the views cannot place"),
    ("torn", "Torn", "Those an end of which hangs beside its joint"),
)
"""Struts that are highlighted together."""

AROUND = 2.5
"""How much more than a strut that is stepped to is seen, in its lengths."""


def chosen_struts(context: bpy.types.Context, kind: str) -> np.ndarray:
    """The struts of one kind: ``worst``, ``missing``, ``uncertain`` or ``torn``.

    Raises
    ------
    InputError
        If the twin has none.
    """
    shown, view = find_twin(twin_of(context)), settings_of(context).view
    worst = worst_struts(badness_of(shown, view.quantity), view.count)
    found = {"worst": worst, "missing": shown.missing, "uncertain": shown.uncertain, "torn": torn_struts(shown.values)}
    struts = found[kind]
    if not len(struts):
        raise InputError.at(shown.twin.name, "struts", f"none is {kind}", "there is nothing to look at here")
    return struts


def torn_struts(values: Mapping[str, StrutValues]) -> np.ndarray:
    """Struts an end of which is torn off its joint."""
    gap = values.get("gap")
    return np.zeros(0, dtype=np.int64) if gap is None else np.flatnonzero(np.nan_to_num(gap.values) > 0.0)


def badness_of(shown: TwinObjects, name: str) -> np.ndarray:
    """(E,) how bad each strut is by one quantity: of confidence and the like, the lowest values are the worst."""
    found = shown.values.get(name, shown.values["displacement"])
    return quantity_named(found.quantity).badness(found.values)


def look_at_struts(
    context: bpy.types.Context, shown: TwinObjects, struts: np.ndarray, margin: float = MARGIN, move: bool = True
) -> None:
    """Highlight struts of the twin, and move the view to them if ``move``."""
    make_active(shown.twin, select=False)
    highlight_struts(shown.twin, struts)
    if move:
        see(context, places_of(context, shown, struts), margin)


def places_of(context: bpy.types.Context, shown: TwinObjects, struts: Any = slice(None)) -> np.ndarray:
    """(N, 3) control points of struts of the twin, in Blender units."""
    return shown.frame().control_points[struts].reshape(-1, 3) / mm_per_unit(context.scene)


class _TwinStep(Step):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, twin_of(context), "Fit a capture or import a run first")


class FRAMETWIN_OT_select_struts(_TwinStep, bpy.types.Operator):
    """Show struts of the twin in full and the others thin"""

    bl_idname = "frametwin.select_struts"
    bl_label = "FrameTwin: Highlight Struts"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Kind",
        items=KINDS,
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return f"Show the {properties.kind} struts of the twin in full and the others thin"

    def act(self, context: bpy.types.Context) -> str:
        struts = chosen_struts(context, self.kind)
        show_twin(twin_of(context), context.view_layer)
        look_at_struts(context, find_twin(twin_of(context)), struts)
        return f"{len(struts)} struts highlighted"


class FRAMETWIN_OT_step_strut(_TwinStep, bpy.types.Operator):
    """Look at the next of the worst struts, or the one before"""

    bl_idname = "frametwin.step_strut"
    bl_label = "FrameTwin: Next of the Worst Struts"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    step: bpy.props.IntProperty(default=1)  # type: ignore[valid-type]

    def act(self, context: bpy.types.Context) -> str:
        struts, view = chosen_struts(context, "worst"), settings_of(context).view
        show_twin(twin_of(context), context.view_layer)
        shown = find_twin(twin_of(context))
        view.at = (view.at + self.step) % len(struts) if view.at >= 0 else 0
        strut = int(struts[view.at])
        look_at_struts(context, shown, np.array([strut]), AROUND)
        values = shown.values.get(view.quantity, shown.values["displacement"])
        view.at_words = f"Strut {strut}: {values.values[strut]:.3g} {values.unit}"
        return f"Strut {strut}: {values.quantity} {values.values[strut]:.4g} {values.unit}"


class FRAMETWIN_OT_leave_struts(_TwinStep, bpy.types.Operator):
    """Show all struts of the twin in full again"""

    bl_idname = "frametwin.leave_struts"
    bl_label = "FrameTwin: Whole Twin"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def act(self, context: bpy.types.Context) -> None:
        show_twin(twin_of(context), context.view_layer)
        shown = find_twin(twin_of(context))
        make_active(shown.twin, select=False)
        clear_highlight(shown.twin)
        settings_of(context).view.at, settings_of(context).view.at_words = -1, ""
        see(context, places_of(context, shown))


class FRAMETWIN_OT_export_twin(FrameExport, _TwinStep, bpy.types.Operator):
    """Write the twin: a frame file (.json), lines (.obj), or a table of every strut's values (.csv)"""

    bl_idname = "frametwin.export_twin"
    bl_label = "FrameTwin: Export Twin"
    bl_options: ClassVar = {"REGISTER"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.json;*.obj;*.csv", options={"HIDDEN"})  # type: ignore[valid-type]
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})  # type: ignore[valid-type]
    format: bpy.props.EnumProperty(name="Format", items=FORMATS)  # type: ignore[valid-type]
    unit: bpy.props.EnumProperty(name="Unit", description="Of the lines", items=UNIT_ITEMS)  # type: ignore[valid-type]

    def default_name(self, context: bpy.types.Context) -> str:
        return twin_of(context).name

    def act(self, context: bpy.types.Context) -> str:
        path = Path(bpy.path.abspath(self.filepath))
        export_twin(find_twin(twin_of(context)), path, self.unit)
        return f"Wrote {path}"


class FRAMETWIN_OT_remove_twin(_TwinStep, bpy.types.Operator):
    """Take the twin out of the scene and show the print or the plan again; its run folder stays on disk"""

    bl_idname = "frametwin.remove_twin"
    bl_label = "FrameTwin: Remove Twin"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def act(self, context: bpy.types.Context) -> None:
        collection = twin_of(context)
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        settings_of(context).twin = None
        remove_twin(collection)
        left = print_of(context) or plan_of(context)
        if left is not None:
            visibility.show(left)


class FRAMETWIN_PT_twin(Panel, bpy.types.Panel):
    """Where every strut really is"""

    bl_label = "Twin"
    bl_idname = "FRAMETWIN_PT_twin"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings, collection = self.layout, settings_of(context), twin_of(context)
        if collection is None:
            write_text(layout, "Fit a capture first, or import a run.", context, "INFO")
            layout.prop(settings, "twin", text="")
            layout.operator("frametwin.import_run", text="Import Run", icon="IMPORT")
            return
        row = draw_chosen(layout, settings, "twin")
        row.operator("frametwin.remove_twin", text="", icon="TRASH")
        self._draw_verdict(layout, context, load_verdict(collection))
        self._draw_colours(layout, settings.view)
        values, missing, uncertain = load_values(collection)
        if settings.view.quantity in values:
            self._draw_statistics(layout, values[settings.view.quantity])
        elif settings.view.quantity.startswith("error"):
            write_text(layout, "The capture has no truth to compare with.", context, "INFO")
        elif settings.view.quantity == "difference":
            write_text(layout, "Choose another twin under Compare.", context, "INFO")
        else:
            write_text(layout, "This twin does not say.", context, "INFO")
        counts = {"missing": len(missing), "uncertain": len(uncertain), "torn": len(torn_struts(values))}
        self._draw_selection(layout, settings.view, counts)
        self._draw_display(layout, twin_object(collection))
        self._draw_objects(layout, settings, collection)
        layout.operator("frametwin.export_twin", text="Export Twin", icon="EXPORT")

    def _draw_verdict(self, layout: bpy.types.UILayout, context: bpy.types.Context, verdict: Verdict | None) -> None:
        """Whether the twin is to be trusted, and why not: the first reasons, the rest is in its run folder."""
        if verdict is None:
            return
        box = layout.box().column(align=True)
        icon = "CHECKMARK" if verdict.status == GOOD else "ERROR"
        box.label(text=f"Verdict: {verdict.status}", icon=icon)
        for reason in verdict.reasons[:REASONS]:
            write_text(box, f"{reason[:1].upper()}{reason[1:]}.", context, beside=FRAME)
        rest = len(verdict.reasons) - REASONS
        if rest > 0:
            write_text(box, f"{rest} more in twin.json of the run.", context, beside=FRAME)

    def _draw_colours(self, layout: bpy.types.UILayout, view: bpy.types.PropertyGroup) -> None:
        layout.prop(view, "quantity", text="")
        row = layout.row(align=True)
        row.prop(view, "automatic", text="Automatic Range" if view.automatic else "Auto", toggle=True)
        if not view.automatic:
            row.prop(view, "low", text="")
            row.prop(view, "high", text="")
        row.prop(view, "legend", text="", icon="COLOR", toggle=True)
        sub = row.row(align=True)
        sub.enabled = view.legend
        sub.prop(view, "histogram", text="", icon="SEQ_HISTOGRAM", toggle=True)
        layout.prop(view, "colour_map", text="")

    def _draw_display(self, layout: bpy.types.UILayout, obj: bpy.types.Object | None) -> None:
        if obj is None:
            return
        draw_input(layout, obj, EXAGGERATION, "Exaggeration", slider=True)
        row = layout.row(align=True)
        for name, text in ((DASHES, "Dashes"), (GHOST, "Plan")):
            draw_input(row, obj, name, text, toggle=True)
        draw_input(layout, obj, BATCH, "Up to Batch")

    def _draw_statistics(self, layout: bpy.types.UILayout, found: StrutValues) -> None:
        numbers = statistics_of(found.values)
        if quantity_named(found.quantity).bad == LOW:
            rows = (("Mean", numbers.mean), ("5th percentile", numbers.p5), ("Lowest", numbers.min))
        else:
            rows = (("Mean", numbers.mean), ("95th percentile", numbers.p95), ("Highest", numbers.max))
        box = layout.box().column(align=True)
        for name, value in rows:
            row = box.column() if is_narrow(bpy.context) else box.row()
            row.label(text=name)
            figure = row.row()
            figure.alignment = "RIGHT"
            figure.label(text=f"{value:.3f} {found.unit}")

    def _draw_selection(
        self, layout: bpy.types.UILayout, view: bpy.types.PropertyGroup, counts: Mapping[str, int]
    ) -> None:
        row = layout.row(align=True)
        row.operator("frametwin.step_strut", text="", icon="TRIA_LEFT").step = -1
        row.operator("frametwin.select_struts", text="Worst").kind = "worst"
        (layout if is_narrow(bpy.context) else row).prop(view, "count", text="")
        row.operator("frametwin.step_strut", text="", icon="TRIA_RIGHT").step = 1
        if view.at_words:
            layout.label(text=view.at_words)
        texts = {kind: f"{count} {translated(kind)}" for kind, count in counts.items()}
        row = buttons(layout, bpy.context, *texts.values())
        for kind, text in texts.items():
            sub = row.row(align=True)
            sub.enabled = counts[kind] > 0
            sub.operator("frametwin.select_struts", text=text).kind = kind
        layout.operator("frametwin.leave_struts", text="Whole Twin", icon="OBJECT_DATAMODE")

    def _draw_objects(
        self, layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, collection: bpy.types.Collection
    ) -> None:
        draw_shown(layout, ("Twin", twin_object(collection)), ("Print", settings.print_object))


CLASSES = (
    FRAMETWIN_OT_select_struts,
    FRAMETWIN_OT_step_strut,
    FRAMETWIN_OT_leave_struts,
    FRAMETWIN_OT_export_twin,
    FRAMETWIN_OT_remove_twin,
    FRAMETWIN_PT_twin,
)
