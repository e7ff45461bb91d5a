"""One call of the renderer: what its steps share, what it costs, what it tells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import bpy

from frametwin.blender.rendering.console import quiet_console
from frametwin.blender.rendering.private_scene import PrivateScene
from frametwin.cameras import Camera
from frametwin.cameras.lens_warp import LensWarp, lens_warp
from frametwin.errors import FrameTwinError, InputError
from frametwin.progress import Progress, ProgressCallback, report


@dataclass
class RenderReport:
    """How a scene was rendered.

    Attributes
    ----------
    engine
        Of the pictures: ``"workbench"`` or ``"cycles"``.
    blender
        Blender's version.
    views
        Number of cameras.
    rendering_seconds, other_seconds
        Time inside of Blender's renderer, and everything beside it.
    remarks
        What was done otherwise than asked, in words.
    """

    engine: str
    blender: str
    views: int
    rendering_seconds: float = 0.0
    other_seconds: float = 0.0
    remarks: list[str] = field(default_factory=list)


@dataclass
class RenderJob:
    """What all steps of one call share: the scene, a scratch folder, the report and the count of pictures."""

    private: PrivateScene
    scratch: Path
    result: RenderReport
    progress: ProgressCallback | None
    total: int
    done: int = 0

    def views(self, pictures: int = 1, finer: float = 1.0) -> Iterator[tuple[int, Camera, LensWarp | None]]:
        """Number and camera of every view, with the scene set to look through it.

        Parameters
        ----------
        pictures
            How many of a view are counted as done when the caller goes on.
        finer
            See `lens_warp`.

        Yields
        ------
        For a lens that distorts also how its picture comes from the pinhole camera's that the scene looks through.
        """
        for i, camera in enumerate(self.private.content.cameras):
            self.report_progress()
            warp = lens_warp(camera, finer) if camera.has_distortion else None
            self.private.look_through(camera if warp is None else warp.pinhole)
            yield i, camera, warp
            self.done += pictures

    def report_progress(self) -> None:
        """Tell how many pictures are done.

        Raises
        ------
        Cancelled
            If the listener says so.
        """
        report(self.progress, Progress("rendering", self.done, self.total))

    def render(self, suffix: str) -> Path:
        """Render the scene as it is set; the file that Blender wrote."""
        path = self.scratch / f"view{suffix}"
        path.unlink(missing_ok=True)
        scene = self.private.scene
        scene.render.filepath = str(path)
        began = perf_counter()
        try:
            call_renderer(scene.name)
        except RuntimeError as error:
            raise FrameTwinError(f"Blender did not render: {' '.join(str(error).split())}") from error
        self.result.rendering_seconds += perf_counter() - began
        if not path.is_file():
            raise FrameTwinError(f"Blender wrote no picture to {path}: is its disk full, or another render going on?")
        return path


def call_renderer(scene: str, animation: bool = False) -> None:
    """Let Blender render the scene of this name to the path that is set in it: one picture, or its whole timeline."""
    with quiet_console():
        bpy.ops.render.render(write_still=not animation, animation=animation, scene=scene)


def made_folder(folder: Path) -> Path:
    """The folder, made with its parents where it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError.at(
            folder, "folder", f"cannot be made ({error.strerror})", "choose a place that is writable"
        ) from error
    return folder
