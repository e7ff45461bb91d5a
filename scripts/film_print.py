"""A film of print jobs, batch by batch: what the robot was told, what stands, what would have missed, what fell.

    blender --background --python scripts/film_print.py -- JOB --out film.mp4
    blender --background --python scripts/film_print.py -- ADAPTED BLIND --out film.mp4      (side by side)
    python scripts/film_print.py -- ADAPTED BLIND --out film.mp4                             (with Blender's module bpy)

JOBs are folders as ``frametwin print simulate`` or ``frametwin print next`` leave them, of one design. Beside the film
there is a picture of every batch, ``film_batch_000.png`` and so on, and with --blend the scene itself.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:  # Blender's Python knows nothing of the project that this script belongs to
    sys.path.insert(0, str(ROOT))

from frametwin.errors import Cancelled, FrameTwinError, InputError  # noqa: E402
from frametwin.printing.records.history import read_history  # noqa: E402
from frametwin.progress import ProgressLines  # noqa: E402


def main(arguments: Sequence[str]) -> int:
    """0 if all went well, 2 for input that cannot be used, 1 for other failures, 130 if interrupted."""
    options = parser().parse_args(arguments)
    try:
        film(options)
    except InputError as error:
        say(str(error))
        return 2
    except (Cancelled, KeyboardInterrupt):
        say("Interrupted.")
        return 130
    except FrameTwinError as error:
        say(str(error))
        return 1
    return 0


def parser() -> argparse.ArgumentParser:
    """The options, which follow ``--`` on Blender's command line."""
    result = argparse.ArgumentParser(prog="film_print.py", description=__doc__.split("\n\n")[0])
    result.add_argument("jobs", nargs="+", type=Path, metavar="JOB", help="folders of print jobs of one design")
    result.add_argument("--out", type=Path, required=True, metavar="FILM.mp4", help="the film to write")
    result.add_argument("--size", default="1080x1920", help="height x width of the pictures [1080x1920]")
    result.add_argument("--blend", type=Path, help="also save the scene, with all batches on the timeline")
    return result


def film(options: argparse.Namespace) -> None:
    """Read the jobs, stage and render them."""
    import bpy

    from frametwin.blender.display.films import render_film, stage_jobs
    from frametwin.blender.frames.plan_objects import use_millimetres

    size = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", options.size)
    if size is None:
        raise InputError.at("settings", "--size", f"is {options.size!r}", "give height x width, as 1080x1920")
    histories = [read_history(folder) for folder in options.jobs]
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    use_millimetres(bpy.context.scene)
    stage_jobs(histories, bpy.context.scene, (int(size[1]), int(size[2])))
    if options.blend is not None:
        bpy.ops.wm.save_as_mainfile(filepath=str(options.blend.absolute()), compress=True)
    written = render_film(bpy.context.scene, options.out, ProgressLines(say))
    say(f"{written[0]} and {len(written) - 1} pictures")


def say(sentence: str) -> None:
    """A line on standard error."""
    print(sentence, file=sys.stderr, flush=True)


if __name__ == "__main__":
    code = main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    sys.exit(code)
