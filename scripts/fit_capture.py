"""From a capture, or a mere plan, to a .blend file with the digital twin in it and a picture, without a window.

    blender --background --python scripts/fit_capture.py -- CAPTURE --out OUT
    blender --background --python scripts/fit_capture.py -- FRAME --out OUT       (lets it sag, rigs and renders first)
    python scripts/fit_capture.py -- CAPTURE --out OUT                            (with Blender's module bpy)

OUT then holds ``run/`` (the twin and its field), ``twin.blend`` (plan, cameras with their pictures, twin),
``twin.png`` (the twin coloured by its displacement) and, of a plan, ``capture/``. The fit runs in a worker process, in
Blender's own Python where the extension is enabled; else, and for presets with PyTorch, name the Python of the
project's environment by --python or by the environment variable FRAMETWIN_PYTHON.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # Blender's Python knows nothing of this project

from frametwin.files import staged_directory
from frametwin.formats import find_frame, frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressLines
from frametwin.worker.client import WorkerClient
from frametwin.worker.interpreter import find_interpreter
from scripts.command import arguments, exit_code, leave, picture_size, say


def run(options: argparse.Namespace) -> int:
    """Do all of it, or nothing."""
    began = perf_counter()
    with staged_directory(options.out, options.overwrite) as stage:
        work(options, stage)
    say(f"{options.out}: twin.blend, twin.png and run, in {perf_counter() - began:.1f} s")
    return 0


def parser() -> argparse.ArgumentParser:
    """The options, which follow ``--`` on Blender's command line."""
    result = argparse.ArgumentParser(prog="fit_capture.py", description=__doc__.split("\n\n")[0])
    result.add_argument("source", metavar="CAPTURE", help="a capture folder; or a frame file or name, to be sagged")
    result.add_argument("--out", type=Path, required=True, help="the folder to write")
    result.add_argument("--overwrite", action="store_true", help="replace the folder if it exists")
    result.add_argument("--preset", default="fast", help="of the fit [fast]")
    result.add_argument("--seed", type=int, default=0, help="of the sag and the fit [0]")
    result.add_argument("--views", type=int, default=8, help="cameras around a plan [8]")
    result.add_argument("--size", default="1600x1200", help="width x height of the pictures of a plan [1600x1200]")
    result.add_argument("--python", help="the Python of the project's environment [FRAMETWIN_PYTHON]")
    return result


def work(options: argparse.Namespace, stage: Path) -> None:
    """Do all of it into a folder that is renamed in the end."""
    import bpy

    from frametwin.blender.frames.plan_objects import use_millimetres

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    use_millimetres(bpy.context.scene)
    chosen = find_interpreter(options.python, torch=options.preset != "fast")
    with WorkerClient(chosen.python, environment=chosen.environment) as worker:
        capture = Path(options.source)
        if not (capture / "transforms.json").is_file():
            capture = stage / "capture"
            make_capture(options, find_frame(options.source), capture, worker)
        request = {"capture": capture, "out": stage / "run", "preset": options.preset, "seed": options.seed}
        worker.call("fit", request, ProgressLines(say))
    show(capture, stage, options.out.absolute())


def make_capture(options: argparse.Namespace, plan: Wireframe, folder: Path, worker: WorkerClient) -> None:
    """Let a plan sag, put cameras around it and render them."""
    import bpy

    from frametwin.blender.background.stepwise import run_steps
    from frametwin.blender.display.prints import read_print, show_print_steps
    from frametwin.blender.frames.plan_objects import add_plan
    from frametwin.blender.views.captures import capture_parameters
    from frametwin.blender.views.rigs import cameras_from_collection, rig_around
    from frametwin.service.render_tasks import render_capture

    size = picture_size(options.size)
    scene = bpy.context.scene
    obj = add_plan(plan, scene)
    request = {"frame": frame_json.to_dict(plan), "settings": {"seed": options.seed}}
    bent = run_steps(show_print_steps(plan, worker.call("simulate", request, ProgressLines(say)), scene))
    rig = rig_around(plan, "ring", scene, count=options.views, size=size)
    parameters = capture_parameters(read_print(obj, bent, scene), cameras_from_collection(rig, scene), folder)
    render_capture(parameters["scene"], parameters["plan"], folder, progress=ProgressLines(say))
    for name in ("objects", "collections"):
        for item in list(getattr(bpy.data, name)):
            getattr(bpy.data, name).remove(item)


def show(capture: Path, stage: Path, out: Path) -> None:
    """Plan, cameras with their pictures and twin in a .blend file, and a picture of the twin.

    All is written to ``stage``, which becomes ``out``.
    """
    import bpy

    from frametwin.blender.background.stepwise import run_steps
    from frametwin.blender.display.pictures import render_twin
    from frametwin.blender.display.twins import TwinContent, show_twin_steps
    from frametwin.blender.views.captures import show_pictures
    from frametwin.blender.views.rigs import read_calibration, rig_to_blender
    from frametwin.capture.capture import read_capture

    known = read_capture(capture)
    rig = rig_to_blender(read_calibration(capture), target=known.frame)
    show_pictures(rig, capture, opacity=0.5, front=False)
    content = TwinContent.read(stage / "run", capture if known.truth is not None else None)
    shown = run_steps(show_twin_steps(replace(content, run_folder=str(out / "run"))))
    say("rendering the twin")
    render_twin(shown, stage / "twin.png")
    bpy.ops.file.pack_all()  # pictures and all: the file may be moved
    bpy.ops.wm.save_as_mainfile(filepath=str(stage / "twin.blend"), compress=True)


if __name__ == "__main__":
    leave(exit_code(lambda: run(parser().parse_args(arguments()))))
