"""Which of Blender's renderers draws masks here, found out without endangering this process."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys

import bpy

from frametwin.capture.scene import WORKBENCH_WORKS
from frametwin.errors import InputError
from frametwin.scratch import scratch_environment, scratch_folder

WORKBENCH, CYCLES = "BLENDER_WORKBENCH", "CYCLES"

PROBE_SECONDS = 120.0

# The process ends at once: the bpy module may hang while Python shuts down.
_PROBE = """
import os, tempfile, bpy
scene = bpy.context.scene
scene.render.engine = "BLENDER_WORKBENCH"
scene.render.resolution_x = scene.render.resolution_y = 8
scene.render.resolution_percentage = 100
scene.camera = scene.camera or bpy.data.objects.new("probe", bpy.data.cameras.new("probe"))
scene.render.filepath = os.path.join(tempfile.gettempdir(), "probe.png")
bpy.ops.render.render(write_still=True)
good = os.path.isfile(scene.render.filepath)
os._exit(0 if good else 1)
"""


def mask_engine(wanted: str) -> str:
    """Blender's name of the engine for masks.

    Parameters
    ----------
    wanted
        ``"workbench"``, ``"cycles"``, or ``"auto"``: Workbench, four times as fast, where it works.

    Raises
    ------
    InputError
        If Workbench is wanted and does not work here.
    """
    if wanted == "cycles":
        return CYCLES
    if workbench_works():
        return WORKBENCH
    if wanted == "workbench":
        raise InputError.at(
            "scene", "engine", "Workbench does not work here", 'install libegl1 (Debian, Ubuntu), or use "cycles"'
        )
    return CYCLES


def workbench_works() -> bool:
    """Whether Workbench can render: without EGL it aborts the process, so a child process tries it, once.

    What was found is kept in the environment variable `WORKBENCH_WORKS`, for this process and those that it starts;
    whoever starts many processes can set it. A Blender with a window draws with the same graphics already.
    """
    if not bpy.app.background and not bpy.app.module:
        return True
    if os.environ.get(WORKBENCH_WORKS) not in ("0", "1"):
        os.environ[WORKBENCH_WORKS] = "1" if _probe() else "0"
    return os.environ[WORKBENCH_WORKS] == "1"


def _probe() -> bool:
    if bpy.app.module:
        command = [sys.executable, "-c", _PROBE]
    else:
        command = [bpy.app.binary_path, "--background", "--factory-startup", "--python-expr", _PROBE]
    try:
        with scratch_folder() as scratch:
            done = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **scratch_environment(scratch)},
                timeout=PROBE_SECONDS,
                check=False,
            )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def set_single_sample(scene: bpy.types.Scene) -> None:
    """Let Cycles follow one ray through the centre of every pixel, and no further than the first surface."""
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.seed = 1, 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    cycles.max_bounces = 0
    with contextlib.suppress(AttributeError):
        cycles.use_auto_tile = False
