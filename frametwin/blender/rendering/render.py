"""Rendering a `Scene` into the files of a capture: masks, photos and passes."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

from frametwin.blender.rendering import engines, versions
from frametwin.blender.rendering.boards import render_boards
from frametwin.blender.rendering.masks import render_masks
from frametwin.blender.rendering.passes import render_passes
from frametwin.blender.rendering.photos import render_photos
from frametwin.blender.rendering.private_scene import private_scene
from frametwin.blender.rendering.render_job import RenderJob, RenderReport, made_folder
from frametwin.capture.board_scene import BOARDS_FILE, BoardScene, read_board_scene
from frametwin.capture.scene import Scene, read_scene
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.scratch import scratch_folder

__all__ = ["RenderReport", "render_file", "render_scene"]


def render_file(path: str | Path, folder: str | Path, progress: ProgressCallback | None = None) -> RenderReport:
    """Render a scene file, and the calibration boards of a ``boards.json`` beside it if there is one.

    Parameters, raises
        As `render_scene`, and for files that are damaged.
    """
    boards = Path(path).with_name(BOARDS_FILE)
    board_scene = read_board_scene(boards) if boards.is_file() else None
    return render_scene(read_scene(path), folder, progress, board_scene)


def render_scene(
    scene: Scene,
    folder: str | Path,
    progress: ProgressCallback | None = None,
    boards: BoardScene | None = None,
) -> RenderReport:
    """Render every view of a scene.

    Nothing of the file that is open in Blender is changed: all happens in a scene of its own, which is removed.

    Parameters
    ----------
    scene
        What to render.
    folder
        Gets ``images/NAME.png``; for photos ``background/NAME.png``, the same views without the frame; with
        ``scene.passes`` also ``passes/NAME.exr``. NAME is the camera's. Folders are made where they are missing.
    progress
        Called before each picture; can cancel in between.
    boards
        Calibration boards to be photographed too.

    Raises
    ------
    InputError
        If the folder cannot be written, or the engine that is asked for does not work.
    Cancelled
        If ``progress`` says so.
    FrameTwinError
        If Blender does not render.
    """
    began = perf_counter()
    target = Path(folder)
    engine = engines.mask_engine(scene.engine) if scene.style == "mask" else engines.CYCLES
    result = RenderReport(
        engine="workbench" if engine == engines.WORKBENCH else "cycles",
        blender=versions.version(),
        views=len(scene.cameras),
    )
    with private_scene(scene) as private, scratch_folder() as scratch:
        rounds = (1 if scene.style == "mask" else 2) + scene.passes
        total = len(scene.cameras) * rounds + (0 if boards is None else len(boards.shots))
        job = RenderJob(private, scratch, result, progress, total=total)
        if scene.style == "mask":
            render_masks(job, engine, made_folder(target / "images"))
        else:
            render_photos(job, made_folder(target / "images"), made_folder(target / "background"))
        if scene.passes:
            render_passes(job, made_folder(target / "passes"))
        if boards is not None:
            render_boards(job, boards, target)
    report(progress, Progress("rendering", job.total, job.total))
    result.other_seconds = perf_counter() - began - result.rendering_seconds
    return result
