"""Step 1, the plan: where the frame comes from, and whether it can be printed."""

# No postponed annotations here: Blender reads them as properties.
from importlib.util import find_spec
from pathlib import Path
from typing import ClassVar

import bpy
import numpy as np

from frametwin.blender.frames.mesh_files import IMPORTERS, read_mesh_file
from frametwin.blender.frames.plan_objects import (
    PlanSummary,
    add_plan,
    plan_summary,
    points_of,
    show_struts,
    use_millimetres,
)
from frametwin.blender.frames.plans import READABLE
from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.wording import enumerated

from .file_formats import READ_UNITS, draw_import, in_mm
from .frames_offered import FRAME_ITEMS
from .in_view import hide_boxes_around, make_way
from .layouts import ICON, buttons
from .steps import FileStep, Panel, Step, draw_chosen, needs, plan_of, settings_of, write_text
from .views import see, suit_millimetres

NO_FRAMES = {
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".bmp", ".webp"), "a picture"),
    **dict.fromkeys((".blend", ".blend1"), "a file of Blender"),
    **dict.fromkeys((".zip", ".gz", ".7z", ".whl"), "an archive"),
}
"""Files that are chosen by mistake, and what they are."""

UNREADABLE = "unreadable"
"""Kind of the problem of a plan that cannot be read at all."""


def take_plan(context: bpy.types.Context, obj: bpy.types.Object, summary: PlanSummary, keep_twin: bool = False) -> str:
    """Make an object the scene's plan, in the place of the one before; returns what there is to say of it."""
    settings = settings_of(context)
    beside = make_way(context, obj, keep_twin)
    settings.plan, settings.print_object = obj, None
    note_summary(settings.about_plan, obj, summary)
    faults = f"; {words_of(summary)}" if summary.problems else ""
    return f"{obj.name}: {summary.struts} struts, {summary.joints} joints{faults}{beside}"


def words_of(summary: PlanSummary) -> str:
    """Whether anything is wrong with the plan, in words."""
    count = len(summary.problems)
    return f"{count} thing{'s' if count > 1 else ''} to look at" if count else "nothing is wrong with it"


def note_summary(about: bpy.types.PropertyGroup, obj: bpy.types.Object, summary: PlanSummary) -> None:
    """Remember a summary, so that the panel need not read the object each time that it is drawn."""
    about.checked, about.struts, about.joints = obj.name, summary.struts, summary.joints
    about.size, about.radius = summary.size, summary.radius
    about.problems.clear()
    for problem in summary.problems:
        item = about.problems.add()
        item.kind, item.sentence = problem.kind, problem.sentence
        item["struts"] = np.array(problem.struts, dtype=np.int32)


def note_unreadable(about: bpy.types.PropertyGroup, obj: bpy.types.Object, error: InputError) -> None:
    """Remember why the plan cannot be read (any more); what was known of it before holds no longer."""
    about.checked, about.struts = obj.name, 0
    about.problems.clear()
    item = about.problems.add()
    item.kind, item.sentence = UNREADABLE, str(error)


def take_frame(context: bpy.types.Context, frame: Wireframe) -> str:
    """Put a frame into the scene as its plan."""
    summary = PlanSummary.of(frame)
    plan = add_plan(frame, context.scene)
    words = take_plan(context, plan, summary)
    around = hide_boxes_around(context, plan)
    see(context, points_of(plan))
    return f"{words}; {enumerated(around)}, which stood around it, is hidden (Alt H shows it)" if around else words


class FRAMETWIN_OT_add_frame(Step, bpy.types.Operator):
    """Add one of the project's own frames as the plan, to try things out without a file"""

    bl_idname = "frametwin.add_frame"
    bl_label = "FrameTwin: Add Frame"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    frame: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Frame",
        description="Which of them; the one that is chosen in the panel if it is left open",
        items=[("PANEL", "As in the panel", ""), *FRAME_ITEMS],
        options={"SKIP_SAVE"},
    )

    def act(self, context: bpy.types.Context) -> str:
        about = settings_of(context).about_plan
        if self.frame != "PANEL":
            about.frame = self.frame
        return take_frame(context, named_frame(about.frame))


class FRAMETWIN_OT_import_frame(FileStep, bpy.types.Operator):
    """Read a frame file as the plan: frame.json, assembly or COMPAS JSON, OBJ, Node/Edge text, DXF, 3dm, meshes"""

    bl_idname = "frametwin.import_frame"
    bl_label = "FrameTwin: Import Frame"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(  # type: ignore[valid-type]
        default="*.json;*.obj;*.txt;*.dxf;*.3dm;*.stl;*.ply;*.off;*.glb;*.gltf", options={"HIDDEN"}
    )

    unit: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Unit", description="Of the lengths in the file, where it does not state one", items=READ_UNITS
    )

    def draw(self, context: bpy.types.Context) -> None:
        draw_import(self.layout, self, context)

    def act(self, context: bpy.types.Context) -> str:
        path = Path(bpy.path.abspath(self.filepath))
        return take_frame(context, in_mm(read_importable(path), self.unit, path))


def read_importable(path: Path) -> Wireframe:
    """Read a frame file in Blender, which imports meshes itself where it can.

    Raises
    ------
    InputError
        As `read_frame` and `read_mesh_file`; if it is of a kind that holds no frame.
    """
    suffix = path.suffix.lower()
    if suffix in NO_FRAMES:
        raise InputError.at(path, "file", f"is {NO_FRAMES[suffix]}, which holds no frame", "choose a frame or a mesh")
    if suffix in IMPORTERS:
        return read_mesh_file(path)
    library = {".dxf": "ezdxf", ".3dm": "rhino3dm"}.get(suffix)
    if library is not None and find_spec(library) is None:
        remedy = f"run outside of Blender: frametwin convert {path.name} {path.stem}.json"
        raise InputError.at(path, "file", f"is read by {library}, which this Python does not have", remedy)
    return read_frame(path)


class FRAMETWIN_OT_use_selected(Step, bpy.types.Operator):
    """Take the active mesh (its edges) or curve as the plan"""

    bl_idname = "frametwin.use_selected"
    bl_label = "FrameTwin: Use Selected as Plan"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        fine = context.object is not None and context.object.type in READABLE
        return needs(cls, fine, "Select a mesh or a curve first")

    def act(self, context: bpy.types.Context) -> str:
        return take_plan(context, context.object, plan_summary(context.object, context.scene))


class FRAMETWIN_OT_check_plan(Step, bpy.types.Operator):
    """Look through the plan again, after it was changed"""

    bl_idname = "frametwin.check_plan"
    bl_label = "FrameTwin: Check Plan"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, plan_of(context), "Import or add a frame first")

    def act(self, context: bpy.types.Context) -> str:
        plan, about = plan_of(context), settings_of(context).about_plan
        try:
            summary = plan_summary(plan, context.scene)
        except InputError as error:
            note_unreadable(about, plan, error)
            raise
        note_summary(about, plan, summary)
        return words_of(summary)


class FRAMETWIN_OT_select_culprits(Step, bpy.types.Operator):
    """Select the struts that are to blame, in Edit Mode"""

    bl_idname = "frametwin.select_culprits"
    bl_label = "FrameTwin: Select Culprits"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    kind: bpy.props.StringProperty()  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        plan = plan_of(context)
        return needs(cls, plan is not None and plan.type == "CURVE", "The plan is no curve object: import it as one")

    def act(self, context: bpy.types.Context) -> str:
        plan = plan_of(context)
        problem = next((p for p in settings_of(context).about_plan.problems if p.kind == self.kind), None)
        if problem is None:
            raise InputError(f"{plan.name} has no problem of this kind any more: press Check Again.")
        count = show_struts(plan, list(problem["struts"]))
        if count:
            see(context, points_of(plan, chosen=True))
        return f"{count} struts selected"


class FRAMETWIN_OT_use_millimetres(Step, bpy.types.Operator):
    """Make a unit of the scene a millimetre, so that the grid and the views suit frames"""

    bl_idname = "frametwin.use_millimetres"
    bl_label = "FrameTwin: Use Millimetres"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, plan_of(context) is None, "Change the unit before there is a plan, or scale it by hand")

    def act(self, context: bpy.types.Context) -> str:
        use_millimetres(context.scene)
        suit_millimetres(context)
        return "A unit of this scene is a millimetre"


class FRAMETWIN_PT_plan(Panel, bpy.types.Panel):
    """The frame as it was designed"""

    bl_label = "Plan"
    bl_idname = "FRAMETWIN_PT_plan"

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = settings_of(context), self.layout
        about, plan = settings.about_plan, plan_of(context)
        if plan is None and mm_per_unit(context.scene) != 1.0:
            layout.operator("frametwin.use_millimetres", text="Use Millimetres", icon="DRIVER_DISTANCE")
        row = buttons(layout, context, "Lattice Tower", "Add", more=ICON)
        row.prop(about, "frame", text="")
        row.operator("frametwin.add_frame", text="Add", icon="ADD")
        row = buttons(layout, context, "Import", "Use Selected", more=ICON / 2)
        row.operator("frametwin.import_frame", text="Import", icon="IMPORT")
        row.operator("frametwin.use_selected", text="Use Selected")
        if plan is None:
            return
        draw_chosen(layout, settings, "plan")
        if about.checked != plan.name:
            layout.operator("frametwin.check_plan", text="Check Again", icon="FILE_REFRESH")
            return
        if about.struts:
            column = layout.column(align=True)
            column.label(text=f"{about.struts} struts, {about.joints} joints")
            column.label(text="Size {:.0f} x {:.0f} x {:.0f} mm".format(*about.size))
            column.label(text=f"Strut radius {about.radius:.3g} mm")
        self._draw_problems(layout, about, context)

    def _draw_problems(
        self, layout: bpy.types.UILayout, about: bpy.types.PropertyGroup, context: bpy.types.Context
    ) -> None:
        for problem in about.problems:
            box = layout.box()
            write_text(box, problem.sentence, context, "ERROR")
            if problem.kind != UNREADABLE:
                box.operator("frametwin.select_culprits", text="Select").kind = problem.kind
        row = buttons(layout, context, "No Problems", "Check Again", more=ICON)
        if not about.problems:
            row.label(text="No Problems", icon="CHECKMARK")
        row.operator("frametwin.check_plan", text="Check Again", icon="FILE_REFRESH")


CLASSES = (
    FRAMETWIN_OT_add_frame,
    FRAMETWIN_OT_import_frame,
    FRAMETWIN_OT_use_selected,
    FRAMETWIN_OT_check_plan,
    FRAMETWIN_OT_select_culprits,
    FRAMETWIN_OT_use_millimetres,
    FRAMETWIN_PT_plan,
)
