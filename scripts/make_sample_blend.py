"""A sample .blend file with a finished twin: plan, simulated print, cameras with their pictures, and what a fit found.

    blender --background --python scripts/make_sample_blend.py -- --out sample.blend
    python scripts/make_sample_blend.py -- --out sample.blend          (with Blender's module bpy)

The plan sags by the seed, two of its struts are not whole, and the twin has its errors, since the truth is known. The
pictures are packed into the file. The fit runs in a worker process, in Blender's own Python where the extension is
enabled; else name the Python of the project's environment by --python or the environment variable FRAMETWIN_PYTHON.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # Blender's Python knows nothing of this project

from frametwin.errors import InputError
from frametwin.files import write_bytes
from frametwin.formats import find_frame, frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressLines
from frametwin.scratch import scratch_folder
from frametwin.worker.client import WorkerClient
from frametwin.worker.interpreter import find_interpreter
from scripts.command import arguments, exit_code, leave, picture_size, say


def run(options: argparse.Namespace) -> int:
    """Write the whole file, or nothing."""
    if options.out.suffix.lower() != ".blend":
        raise InputError.at(options.out, "file", "is no .blend", "name it sample.blend, say")
    if options.out.exists() and not options.overwrite:
        raise InputError.at(options.out, "file", "exists already", "name another one, or give --overwrite")
    began = perf_counter()
    plan, size = find_frame(options.frame), picture_size(options.size)
    chosen = find_interpreter(options.python, torch=False)
    with scratch_folder() as scratch, WorkerClient(chosen.python, environment=chosen.environment) as worker:
        words = make_scene(plan, size, options, worker, scratch)
        write_bytes(options.out, saved(scratch / "sample.blend"))
    say(f"{options.out}: {words}, in {perf_counter() - began:.1f} s")
    return 0


def parser() -> argparse.ArgumentParser:
    """The options, which follow ``--`` on Blender's command line."""
    result = argparse.ArgumentParser(prog="make_sample_blend.py", description=__doc__.split("\n\n")[0])
    result.add_argument("--out", type=Path, required=True, help="the .blend file to write")
    result.add_argument("--overwrite", action="store_true", help="replace the file if it exists")
    result.add_argument("--frame", default="bridge", help="a frame file, or the name of one of the project's [bridge]")
    result.add_argument("--seed", type=int, default=0, help="of the sag and of what is missing [0]")
    result.add_argument("--views", type=int, default=8, help="cameras around the plan [8]")
    result.add_argument("--size", default="800x600", help="width x height of the pictures [800x600]")
    result.add_argument("--python", help="the Python of the project's environment [FRAMETWIN_PYTHON]")
    return result


def make_scene(
    plan: Wireframe, size: tuple[int, int], options: argparse.Namespace, worker: WorkerClient, scratch: Path
) -> str:
    """Put all of it into an empty file; returns what there is to say of it."""
    import bpy

    from frametwin.blender.background.stepwise import run_steps
    from frametwin.blender.display.prints import read_print, show_print_steps
    from frametwin.blender.display.twins import TwinContent, show_twin_steps
    from frametwin.blender.frames.plan_objects import add_plan, make_active, use_millimetres
    from frametwin.blender.scene import visibility
    from frametwin.blender.views.captures import capture_parameters, show_pictures
    from frametwin.blender.views.rigs import cameras_from_collection, rig_around
    from frametwin.service.render_tasks import render_capture

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene, capture, found = bpy.context.scene, scratch / "capture", scratch / "run"
    use_millimetres(scene)
    obj = add_plan(plan, scene)
    wanted = {"frame": frame_json.to_dict(plan), "settings": {"seed": options.seed, "missing": 2}}
    bent = run_steps(show_print_steps(plan, worker.call("simulate", wanted, ProgressLines(say)), scene))
    rig = rig_around(plan, "ring", scene, count=options.views, size=size)
    parameters = capture_parameters(read_print(obj, bent, scene), cameras_from_collection(rig, scene), capture)
    render_capture(parameters["scene"], parameters["plan"], capture, progress=ProgressLines(say))
    request = {"capture": capture, "out": found, "preset": "fast", "seed": options.seed}
    worker.call("fit", request, ProgressLines(say))
    show_pictures(rig, capture, opacity=0.5, front=False)
    content = replace(TwinContent.read(found, capture), run_folder="")  # it is gone when the file is opened
    shown = run_steps(show_twin_steps(content, scene=scene))
    for other in (obj, bent):
        visibility.hide(other)
    make_active(shown.twin, select=False)
    show_colours(scene, plan)
    return f"{plan.strut_count} struts, {len(shown.missing)} of them not whole"


def show_colours(scene: Any, plan: Wireframe) -> None:
    """Let all 3D views see the frame, in the colours of the legend."""
    import bpy

    scene.view_settings.view_transform = "Standard"
    low, high = plan.bounds
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                space = area.spaces.active
                space.shading.color_type, space.shading.light = "VERTEX", "FLAT"
                space.clip_start, space.clip_end = 0.01 * plan.extent, 100.0 * plan.extent
                space.region_3d.view_location = 0.5 * (low + high)
                space.region_3d.view_distance = 1.2 * plan.extent


def saved(file: Path) -> bytes:
    """The present file with its pictures in it, as Blender writes it."""
    import bpy

    bpy.ops.file.pack_all()
    for image in bpy.data.images:
        image.filepath_raw = f"//{Path(image.filepath_raw).name}"  # not where they were while it was made
    bpy.ops.wm.save_as_mainfile(filepath=str(file), compress=True, copy=True)
    return file.read_bytes()


if __name__ == "__main__":
    leave(exit_code(lambda: run(parser().parse_args(arguments()))))
