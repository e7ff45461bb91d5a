"""Files that are dropped into the 3D view or opened: what each is, by what it says of itself, and what it asks for."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import ClassVar

import bpy

from frametwin.cameras.rig_file import FORMAT as RIG
from frametwin.capture.transforms import FORMAT as CAPTURE
from frametwin.files import read_json
from frametwin.printing.records.history import FORMAT as JOB
from frametwin.twin.twin import FORMAT as TWIN

from . import session
from .cameras import import_cameras
from .fit import import_run, open_capture
from .import_rig import import_rig
from .plan import read_importable, take_frame
from .printing import show_job
from .steps import FileStep, settings_of

DRAWINGS = ".txt;.dxf;.3dm;.off"
"""Kinds of frame files for which Blender has no importer of its own."""


def kind_of(path: Path) -> str:
    """What a file holds: ``frame``, ``capture``, ``cameras``, ``rig``, ``run`` or ``job``.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    if path.suffix.lower() != ".json":
        return "frame"
    content = read_json(path)
    known = {CAPTURE: "capture", TWIN: "run", JOB: "job", RIG: "rig"}
    kind = known.get(str(content.get("format")), "capture" if "frames" in content else "frame")
    if kind == "capture" and not (path.parent / "frame.json").is_file():
        return "cameras"  # as another program or a calibration wrote them, without a plan
    return kind


def open_path(context: bpy.types.Context, path: Path) -> str:
    """Do with a file what it is for; returns what there is to tell.

    Raises
    ------
    FrameTwinError
        If the file or its folder cannot be used, or a job for it is under way.
    """
    kind, settings, folder = kind_of(path), settings_of(context), path.parent
    if kind == "capture":
        words = open_capture(context, folder)
        settings.fit.capture = str(folder)
        return f"{words}; press Fit to find the twin"
    if kind == "run":
        return import_run(context, folder)
    if kind == "job":
        settings.print.job = str(folder)
        session.start(show_job(context))
        return f"Job {folder}"
    if kind == "rig":
        return import_rig(context, path)
    if kind == "cameras":
        return import_cameras(context, path)
    return take_frame(context, read_importable(path))


class FRAMETWIN_OT_open_file(FileStep, bpy.types.Operator):
    """Open a frame, a capture (transforms.json), a rig (rig.json), a run (twin.json) or a print job (job.json)"""

    bl_idname = "frametwin.open_file"
    bl_label = "FrameTwin: Open File"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})  # type: ignore[valid-type]

    def act(self, context: bpy.types.Context) -> str:
        return open_path(context, Path(bpy.path.abspath(self.filepath)))


class _Dropped:
    """Whatever is dropped into the 3D view."""

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


class FRAMETWIN_FH_file(_Dropped, bpy.types.FileHandler):
    """Files of FrameTwin and other JSON files with frames or cameras"""

    bl_idname = "FRAMETWIN_FH_file"
    bl_label = "FrameTwin"
    bl_import_operator = "frametwin.open_file"
    bl_file_extensions = ".json"


class FRAMETWIN_FH_drawing(_Dropped, bpy.types.FileHandler):
    """Frames as other programs draw them"""

    bl_idname = "FRAMETWIN_FH_drawing"
    bl_label = "FrameTwin frame"
    bl_import_operator = "frametwin.import_frame"
    bl_file_extensions = DRAWINGS


CLASSES = (FRAMETWIN_OT_open_file, FRAMETWIN_FH_file, FRAMETWIN_FH_drawing)
