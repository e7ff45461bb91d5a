"""What the worker process renders, where Blender's module is installed: a scene file, or a whole capture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from frametwin.blender.rendering.client import made_with, render_here
from frametwin.capture.capture import write_description
from frametwin.capture.scene import from_dict
from frametwin.files import staged_directory
from frametwin.formats import defects_json, frame_json
from frametwin.progress import ProgressCallback
from frametwin.twin.runs import require_free


def render(scene: Path, folder: Path, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """Render a scene file into a folder: the job ``render``; see `render_here`."""
    return render_here(scene, folder, progress)


def render_capture(
    scene: dict[str, Any],
    plan: dict[str, Any],
    out: Path,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Render a scene and write a whole capture, the job ``render-capture``.

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
    ``out``, ``views``, ``blender``, ``engine`` and ``remarks`` as `render_here`.

    Raises
    ------
    InputError
        As `render_here`; if plan and truth are not of the same struts, or the folder cannot be written.
    Cancelled
        If ``progress`` returns ``False``; nothing is left then.
    """
    from frametwin.blender.rendering.render import render_scene

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
