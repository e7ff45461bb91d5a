"""The list of a twin's struts: sorted, filtered, and each of them looked at by a click, in the list or in the view."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import bpy
import numpy as np

from frametwin.blender.display.quantities import QUANTITIES
from frametwin.blender.display.twin_records import load_values
from frametwin.blender.display.twins import RUN_KEY, find_twin, twin_object
from frametwin.blender.frames.strut_curves import struts_where
from frametwin.errors import FrameTwinError, InputError
from frametwin.twin.runs import load_run

from . import session
from .compared import draw_comparison
from .in_view import show_twin
from .steps import Panel, Step, needs, settings_of, twin_of, write_text
from .strut_table import BATCH, INDEX, StrutTable
from .translations import in_own_context
from .twin import AROUND, look_at_struts, torn_struts
from .views import is_through_camera

WORKSPACE = "Inspect"
NAMES = {key: quantity.name for key, quantity in QUANTITIES.items() if key != BATCH}
table: StrutTable | None = None


def key_of(collection: bpy.types.Collection) -> str:
    """What tells a twin from others: its collection and its run."""
    return f"{collection.name}|{collection.get(RUN_KEY, '')}"


def fill(context: bpy.types.Context) -> StrutTable:
    """Put the struts of the twin that is looked at into the list.

    Raises
    ------
    InputError
        If the collection holds no twin.
    """
    global table
    collection = twin_of(context)
    values, missing, uncertain = load_values(collection)
    count = len(values["displacement"].values)
    try:
        batch = load_run(Path(collection.get(RUN_KEY, "")))[1].batch
    except InputError:
        batch = np.zeros(count, dtype=np.int64)  # the run folder is gone
    kinds = {"missing": missing, "uncertain": uncertain, "torn": torn_struts(values)}
    kinds["radius guessed"] = struts_of_guessed_radius(collection)
    table = StrutTable(key_of(collection), values, batch, kinds)
    inspected = context.window_manager.frametwin_inspect
    inspected.at = -1
    inspected.struts.clear()
    for _ in range(count):
        inspected.struts.add()
    return table


def struts_of_guessed_radius(collection: bpy.types.Collection) -> np.ndarray:
    """Rising numbers of the printed struts whose radius no picture shows, in whole or in part."""
    obj = twin_object(collection)
    if obj is None:
        return np.zeros(0, dtype=np.int64)
    return np.intersect1d(struts_where(obj.data, "radius_guessed"), struts_where(obj.data, "printed"))


def table_of(context: bpy.types.Context) -> StrutTable | None:
    """The table of the twin that is looked at; ``None`` if another one is in the list, or none."""
    collection = twin_of(context)
    fresh = table is not None and collection is not None and table.key == key_of(collection)
    return table if fresh and len(context.window_manager.frametwin_inspect.struts) == table.count else None


def strut_chosen(inspected: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Look at the strut that was clicked in the list; called by Blender when it changes."""
    known = table_of(context)
    if known is None or not 0 <= inspected.at < known.count:
        return
    try:
        show_twin(twin_of(context), context.view_layer)
        move = not is_through_camera(context)
        look_at_struts(context, find_twin(twin_of(context)), np.array([inspected.at]), AROUND, move)
    except FrameTwinError as error:
        session.tell(str(error), error=True)


class FrameTwinStrut(bpy.types.PropertyGroup):
    """A row of the list; what it shows is in the table."""


class FrameTwinInspect(bpy.types.PropertyGroup):
    """How the struts are listed."""

    struts: bpy.props.CollectionProperty(type=FrameTwinStrut)  # type: ignore[valid-type]
    at: bpy.props.IntProperty(default=-1, update=strut_chosen)  # type: ignore[valid-type]
    by: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Sort by",
        description="The worst first",
        items=[
            ("colour", "Colour", "What the colours show"),
            (INDEX, "Number", "The strut's number in the frame"),
            ("completeness", "Completeness", "Share of the strut that is really there"),
            ("confidence", "Confidence", "How well the views tell where the strut is"),
            (BATCH, "Batch", "The batch in which it is printed"),
        ],
    )
    reverse: bpy.props.BoolProperty(name="Reverse", description="The best first")  # type: ignore[valid-type]
    kind: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Show",
        description="Which struts are listed",
        items=[
            ("all", "All Struts", "All of them"),
            ("missing", "Missing", "Those of which 15 % or more in one stretch is not there"),
            ("uncertain", "Uncertain", "Those that the views cannot place"),
            ("torn", "Torn", "Those an end of which hangs beside its joint"),
            ("radius guessed", "Radius Guessed", "Those whose radius no picture shows, in whole or in part"),
        ],
    )
    batch: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Batch", default=-1, min=-1, description="Only struts of this batch; -1 for all"
    )


class FRAMETWIN_UL_struts(bpy.types.UIList):
    """Struts with their values"""

    bl_idname = "FRAMETWIN_UL_struts"

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: Any,
        item: Any,
        icon: int,
        active: Any,
        active_name: str,
        strut: int,
    ) -> None:
        known = table_of(context)
        if known is None:
            return
        quantity = settings_of(context).view.quantity
        line = layout.row(align=True)
        for name in (INDEX, quantity, "completeness", "confidence", BATCH):
            line.label(text=known.text(strut, name))

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.PropertyGroup, name: str
    ) -> tuple[list[int], list[int]]:
        known = table_of(context)
        if known is None:
            return [], []
        inspected = context.window_manager.frametwin_inspect
        by = settings_of(context).view.quantity if inspected.by == "colour" else inspected.by
        flags = np.where(known.shown(inspected.kind, inspected.batch), self.bitflag_filter_item, 0)
        places = np.empty(known.count, dtype=np.int64)
        places[known.order(by, inspected.reverse)] = np.arange(known.count)
        return flags.tolist(), places.tolist()

    def draw_filter(self, context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
        inspected = context.window_manager.frametwin_inspect
        row = layout.row(align=True)
        row.prop(inspected, "kind", text="")
        row.prop(inspected, "batch")
        row = layout.row(align=True)
        row.prop(inspected, "by", text="")
        row.prop(inspected, "reverse", text="", icon="SORT_DESC" if inspected.reverse else "SORT_ASC")


class FRAMETWIN_OT_list_struts(Step, bpy.types.Operator):
    """List the struts of the twin, to sort and to filter them"""

    bl_idname = "frametwin.list_struts"
    bl_label = "FrameTwin: List Struts"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, twin_of(context), "Fit a capture or import a run first")

    def act(self, context: bpy.types.Context) -> str:
        return f"{fill(context).count} struts"


class StrutsPanel(Panel):
    """The list, and all values of the strut that was clicked."""

    compares = False
    """Whether to tell here what came of a comparison, where the panel for it is not at hand."""

    if TYPE_CHECKING:
        layout: bpy.types.UILayout

    def draw(self, context: bpy.types.Context) -> None:
        layout, known = self.layout, table_of(context)
        if known is None:
            layout.operator("frametwin.list_struts", text="List Struts", icon="LONGDISPLAY")
            return
        inspected = context.window_manager.frametwin_inspect
        head = layout.row(align=True)
        for text in ("Strut", "Colour", "Whole", "Sure", "Batch"):
            head.label(text=text)
        layout.template_list("FRAMETWIN_UL_struts", "", inspected, "struts", inspected, "at", rows=8)
        layout.operator("frametwin.pick_strut", text="Pick in View", icon="EYEDROPPER")
        if self.compares:
            draw_comparison(layout, context, twin_object(twin_of(context)))
        if 0 <= inspected.at < known.count:
            self._draw_values(context, known, inspected.at)

    def _draw_values(self, context: bpy.types.Context, known: StrutTable, strut: int) -> None:
        box = self.layout.box().column(align=True)
        found = [kind for kind, struts in known.kinds.items() if strut in struts]
        write_text(box, ", ".join([f"Strut {strut}", f"batch {known.text(strut, BATCH)}", *found]), context)
        for name, title in NAMES.items():
            if name in known.values:
                row = box.row()
                row.label(text=title)
                figure = row.row()
                figure.alignment = "RIGHT"
                figure.label(text=f"{known.text(strut, name)} {known.values[name].unit}")


class FRAMETWIN_PT_inspect(StrutsPanel, bpy.types.Panel):
    """Every strut and its values, at the top of the tab where the workspace is made for it"""

    bl_label = "Struts"
    bl_idname = "FRAMETWIN_PT_inspect"
    compares = True

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.workspace is not None and context.workspace.name == WORKSPACE and twin_of(context) is not None


def register() -> None:
    """Make the list a part of the window manager, which no file and no undo keeps."""
    bpy.types.WindowManager.frametwin_inspect = bpy.props.PointerProperty(type=FrameTwinInspect)


def unregister() -> None:
    """Take it away again."""
    global table
    table = None
    del bpy.types.WindowManager.frametwin_inspect


CLASSES = (
    FrameTwinStrut,
    FrameTwinInspect,
    FRAMETWIN_UL_struts,
    FRAMETWIN_OT_list_struts,
    FRAMETWIN_PT_inspect,
)

in_own_context((FrameTwinInspect,))
