"""A film of print jobs, batch by batch, side by side, without a window."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.legend_entries import legend_entries
from frametwin.blender.display.pictures import render
from frametwin.blender.display.print_jobs import (
    FRAMES_A_BATCH,
    NOT_RENDERED,
    ROLE_KEY,
    WORDS_KEY,
    JobObjects,
    place_shift,
    show_at,
    show_job_steps,
)
from frametwin.blender.display.stage import PhotoStage
from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import InputError
from frametwin.files import PathLike, write_bytes
from frametwin.printing.records.history import PrintHistory
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.scratch import scratch_folder

FRAMES_A_SECOND = 24


def stage_jobs(
    histories: Sequence[PrintHistory], scene: bpy.types.Scene, size: tuple[int, int] = (1080, 1920)
) -> tuple[JobObjects, ...]:
    """Put jobs of one design side by side into an empty scene, with a camera, a legend and words for every batch.

    Parameters
    ----------
    histories
        The jobs; the colours of all go as far as those of the first.
    scene
        Whose timeline has them in the end, ready to be rendered.
    size
        Height and width of the pictures in pixels.

    Raises
    ------
    InputError
        If there is none, or they are of different designs.
    """
    if not histories or any(other.design.strut_count != histories[0].design.strut_count for other in histories):
        raise InputError.at("film", "jobs", "are not of one design", "give one job, or several of the same frame")
    top = histories[0].largest_displacement
    jobs = tuple(run_steps(show_job_steps(history, scene, place=i, top=top)) for i, history in enumerate(histories))
    unit, design = mm_per_unit(scene), histories[0].design
    corners = [
        (design.control_points.reshape(-1, 3) + place_shift(design, i)[:3, 3]) / unit for i in range(len(histories))
    ]
    stage = PhotoStage(scene, np.concatenate(corners), size)
    drawn = [obj for job in jobs for obj in job.collection.all_objects if obj[ROLE_KEY] not in NOT_RENDERED]
    stage.add_legend(jobs[0].legend, legend_entries(drawn))
    for history, job, points in zip(histories, jobs, corners, strict=True):
        middle = stage.across(points)
        x, y = 0.5 * float(middle[:, 0].min() + middle[:, 0].max()), 0.44 * stage.height
        stage.add_words("adapted to the twin" if history.adapts else "as designed", x, y, "CENTER")
        for i, batch in enumerate(job.batches):
            text = f"batch {i}: " + batch[WORDS_KEY].replace(" mm, ", " mm\n")
            words = stage.add_words(text, x, y - 0.05 * stage.height, "CENTER")
            words.data.size *= 0.7
            show_at(words, i, i == len(job.batches) - 1)
    scene.render.fps = FRAMES_A_SECOND
    return jobs


def render_film(scene: bpy.types.Scene, path: PathLike, progress: ProgressCallback | None = None) -> list[Path]:
    """Render the batches of a staged scene: a film, and a picture of every batch beside it.

    Parameters
    ----------
    scene
        As `stage_jobs` leaves it.
    path
        The film, ``.mp4``; pictures are named like it, with the number of the batch.
    progress
        Told of every batch.

    Returns
    -------
    The files that were written, the film first.

    Raises
    ------
    InputError
        If the name is another one.
    FrameTwinError
        If Blender does not render.
    Cancelled
        If ``progress`` returns ``False``.
    """
    target = Path(path)
    if target.suffix.lower() != ".mp4":
        raise InputError.at(target, "file", "is no .mp4", "name it film.mp4, say")
    batches = (scene.frame_end - scene.frame_start + 1) // FRAMES_A_BATCH
    pictures = []
    with scratch_folder() as scratch:
        for batch in range(batches):
            report(progress, Progress("rendering batches", batch, batches))
            scene.frame_set(scene.frame_start + batch * FRAMES_A_BATCH)
            file = scratch / f"batch_{batch:03d}.png"
            scene.render.filepath = str(file)
            render(scene)
            pictures.append(file)
        report(progress, Progress("joining the film", 0, 1))
        film = _joined(pictures, scratch / "film.mp4", scene)
        written = [target, *(target.with_name(f"{target.stem}_{file.name}") for file in pictures)]
        for made, wanted in zip([film, *pictures], written, strict=True):
            write_bytes(wanted, made.read_bytes())
    return written


def _joined(pictures: Sequence[Path], film: Path, like: bpy.types.Scene) -> Path:
    """The pictures one after the other, each for as long as a batch is on the timeline: nothing moves in between."""
    scene = bpy.data.scenes.new("FrameTwin film")
    try:
        scene.render.resolution_x, scene.render.resolution_y = like.render.resolution_x, like.render.resolution_y
        scene.render.resolution_percentage, scene.render.fps = 100, FRAMES_A_SECOND
        scene.view_settings.view_transform = "Standard"
        strips = scene.sequence_editor_create()
        strips = strips.strips if hasattr(strips, "strips") else strips.sequences
        for i, picture in enumerate(pictures):
            strip = strips.new_image(picture.stem, str(picture), 1, 1 + i * FRAMES_A_BATCH)
            strip.frame_final_duration = FRAMES_A_BATCH
        scene.frame_start, scene.frame_end = 1, len(pictures) * FRAMES_A_BATCH
        image = scene.render.image_settings
        if hasattr(image, "media_type"):
            image.media_type = "VIDEO"
        image.file_format = "FFMPEG"
        scene.render.ffmpeg.format, scene.render.ffmpeg.codec = "MPEG4", "H264"
        scene.render.ffmpeg.constant_rate_factor = "HIGH"
        scene.render.filepath = str(film)
        scene.render.use_file_extension = False
        render(scene, animation=True)
    finally:
        bpy.data.scenes.remove(scene)
    return film
