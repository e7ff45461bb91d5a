"""Pictures by Blender for who is no Blender: in a child process, where Blender's module is installed."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from frametwin.capture import write_description
from frametwin.errors import InputError
from frametwin.files import staged_directory
from frametwin.formats import defects_json, frame_json
from frametwin.progress import ProgressCallback
from frametwin.runs import require_free
from frametwin.scene import Scene, from_dict, read_scene, write_scene
from frametwin.worker.client import WorkerClient


def blender_is_here() -> bool:
    """Whether Blender's module is installed beside this Python; nothing is imported."""
    return find_spec("bpy") is not None


def render(scene: Path, folder: Path, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """Render a scene file into a folder, in this very process: the job ``render`` of the worker.

    Returns
    -------
    ``blender``, its version, ``engine``, and ``remarks`` on what was done otherwise than asked, if there are any.

    Raises
    ------
    InputError
        If Blender's module is not installed, or the scene cannot be rendered.
    Cancelled
        If ``progress`` returns ``False``.
    """
    if not blender_is_here():
        remedy = "install it by 'python3 scripts/run.py setup'"
        raise InputError.at(scene, "scene", "needs Blender's module bpy, which is not installed", remedy)
    from frametwin.blender.render import render_scene

    rendered = render_scene(read_scene(scene), folder, progress)
    return made_with(rendered.blender, rendered.engine, rendered.remarks)


def render_capture(
    scene: dict[str, Any],
    plan: dict[str, Any],
    out: Path,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Render a scene and write a whole capture, in this very process: the job ``render-capture`` of the worker.

    Parameters
    ----------
    scene
        Content of a scene file; its truth becomes the capture's, and what is not whole of it ``defects.json``.
    plan
        Content of a frame file: the plan of the same struts.
    out, overwrite
        The capture folder, and whether it may be replaced if it is one.
    progress
        See `ProgressCallback`.

    Returns
    -------
    ``out``, ``views``, ``blender``, ``engine`` and ``remarks`` as `render`.

    Raises
    ------
    InputError
        As `render`; if plan and truth are not of the same struts, or the folder cannot be written.
    Cancelled
        If ``progress`` returns ``False``; nothing is left then.
    """
    from frametwin.blender.render import render_scene

    content = from_dict(scene, "scene of the request")
    frame = frame_json.parse({"name": "frame", **plan}, "plan of the request")
    require_free(out, overwrite, "transforms.json")
    defects = defects_json.to_dict(content.present, frame.printed)
    extra = {defects_json.FILE_NAME: defects} if len(defects["struts"]) else {}
    with staged_directory(out, overwrite) as stage:
        cameras = write_description(stage, frame, content.cameras, content.truth, extra, name=out)
        rendered = render_scene(replace(content, cameras=cameras), stage, progress)
    return {
        "out": str(out),
        "views": len(cameras),
        **made_with(rendered.blender, rendered.engine, rendered.remarks),
    }


def made_with(blender: str, engine: str, remarks: Sequence[str] = ()) -> dict[str, Any]:
    """What is noted of how pictures were made."""
    return {"blender": blender, "engine": engine, **({"remarks": list(remarks)} if remarks else {})}


def render_in_child(scene: Scene, folder: Path, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """Render a scene into a folder that exists; a Blender that crashes takes nothing with it.

    Returns, raises
        As `render`.
    """
    with tempfile.TemporaryDirectory(prefix="frametwin-") as temporary, WorkerClient(sys.executable) as worker:
        file = Path(temporary) / "scene.json"
        write_scene(file, scene)
        return worker.call("render", {"scene": str(file), "folder": str(folder.absolute())}, progress)
