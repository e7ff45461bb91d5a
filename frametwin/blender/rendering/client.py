"""Client that asks Blender for pictures: its module beside this Python, or a child process that has it.

Nothing of Blender is imported before a picture is wanted, so that the library may ask whether it is there.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from frametwin.capture.scene import Scene, write_scene
from frametwin.errors import InputError
from frametwin.progress import ProgressCallback
from frametwin.scratch import scratch_folder
from frametwin.worker.client import WorkerClient


def blender_is_here() -> bool:
    """Whether Blender's module is installed beside this Python; nothing is imported."""
    return find_spec("bpy") is not None


def render_here(scene: Path, folder: Path, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """Render a scene file into a folder, in this very process.

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
    from frametwin.blender.rendering.render import render_file

    rendered = render_file(scene, folder, progress)
    return made_with(rendered.blender, rendered.engine, rendered.remarks)


def render_in_child(scene: Scene, folder: Path, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """Render a scene into a folder that exists; a Blender that crashes takes nothing with it.

    Returns, raises
        As `render_here`.
    """
    with scratch_folder() as scratch, WorkerClient(sys.executable) as worker:
        file = scratch / "scene.json"
        write_scene(file, scene)
        return worker.call("render", {"scene": str(file), "folder": str(folder.absolute())}, progress)


def blender_renderer() -> Callable[[Scene, Path, ProgressCallback | None], dict[str, Any]] | None:
    """`render_in_child` where Blender's module is installed, ``None`` elsewhere."""
    return render_in_child if blender_is_here() else None


def made_with(blender: str, engine: str, remarks: Sequence[str] = ()) -> dict[str, Any]:
    """What is noted of how pictures were made."""
    return {"blender": blender, "engine": engine, **({"remarks": list(remarks)} if remarks else {})}
