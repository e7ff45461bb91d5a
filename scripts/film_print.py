"""A film of print jobs, batch by batch: what the robot was told, what stands, what would have missed, what fell.

    blender --background --python scripts/film_print.py -- JOB --out film.mp4
    blender --background --python scripts/film_print.py -- ADAPTED BLIND --out film.mp4      (side by side)
    python scripts/film_print.py -- ADAPTED BLIND --out film.mp4                             (with Blender's module bpy)

JOBs are folders as ``frametwin print simulate`` or ``frametwin print next`` leave them, of one design. Beside the film
there is a picture of every batch, ``film_batch_000.png`` and so on, and with --blend the scene itself.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # Blender's Python knows nothing of this project

from frametwin.printing.records.history import read_history
from frametwin.progress import ProgressLines
from scripts.command import arguments, exit_code, leave, picture_size, say


def parser() -> argparse.ArgumentParser:
    """The options, which follow ``--`` on Blender's command line."""
    result = argparse.ArgumentParser(prog="film_print.py", description=__doc__.split("\n\n")[0])
    result.add_argument("jobs", nargs="+", type=Path, metavar="JOB", help="folders of print jobs of one design")
    result.add_argument("--out", type=Path, required=True, metavar="FILM.mp4", help="the film to write")
    result.add_argument("--size", default="1920x1080", help="width x height of the pictures [1920x1080]")
    result.add_argument("--blend", type=Path, help="also save the scene, with all batches on the timeline")
    return result


def film(options: argparse.Namespace) -> int:
    """Read the jobs, stage and render them."""
    import bpy

    from frametwin.blender.display.films import render_film, stage_jobs
    from frametwin.blender.frames.plan_objects import use_millimetres

    size = picture_size(options.size)
    histories = [read_history(folder) for folder in options.jobs]
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    use_millimetres(bpy.context.scene)
    stage_jobs(histories, bpy.context.scene, size)
    if options.blend is not None:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.absolute()), compress=True)
    written = render_film(bpy.context.scene, options.out, ProgressLines(say))
    say(f"{written[0]} and {len(written) - 1} pictures")
    return 0


if __name__ == "__main__":
    leave(exit_code(lambda: film(parser().parse_args(arguments()))))
