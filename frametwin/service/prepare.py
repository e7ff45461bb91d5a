"""Compiling what the commands need, once after installing and not in the middle of the first fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from frametwin.cameras.rigs import ring_rig
from frametwin.fitting import presence
from frametwin.fitting.camera_freedoms import camera_terms, coupling_to_freedoms
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.motion import free_step, joint_system, start_pose
from frametwin.geometry.parametric import half_bowl
from frametwin.printing.adaptation.material_fit import MaterialFit
from frametwin.printing.adaptation.rest_of_print import remaining_movement, steps_of
from frametwin.printing.job.check import check_job
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.process.creep import CreepModel, PrintState
from frametwin.printing.process.material import PrintSettings
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.raster import rods
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Rods
from frametwin.raster.silhouette import silhouettes
from frametwin.scratch import scratch_folder

PIECES = 4


@dataclass(frozen=True)
class Prepared:
    """What was compiled, or found to be compiled.

    Attributes
    ----------
    name : str
    seconds : float
    """

    name: str
    seconds: float


def prepare(progress: ProgressCallback | None = None) -> list[Prepared]:
    """Compile the loops of fits, of twins that follow a stream, and of print jobs, by using each on a small frame.

    numba keeps machine code beside the sources, or in the user's cache where these cannot be written: this takes half a
    minute once, and a second from then on.

    Raises
    ------
    Cancelled
        If ``progress`` says so; what was compiled stays.
    """
    steps = _steps()
    done = []
    for k, (name, work) in enumerate(steps):
        report(progress, Progress(f"compiling {name}", k, len(steps)))
        began = perf_counter()
        work()
        done.append(Prepared(name, perf_counter() - began))
    report(progress, Progress("compiling", len(steps), len(steps)))
    return done


def _steps() -> list[tuple[str, Callable[[], object]]]:
    frame = half_bowl(5, 1)
    cameras = ring_rig(frame, 2, size=(24, 32))
    level: Level = Pyramid(cameras, [np.zeros((24, 32), dtype=np.float32)] * 2).level(1.0, 0.7)
    drawn = Rods(
        control_points=np.array(frame.control_points),
        joints=np.array(frame.vertices),  # arrays that can be written are another type for numba
        edges=frame.edges,
        radius=np.repeat(frame.radius[:, None], PIECES, axis=1),
        opacity=np.ones((frame.strut_count, PIECES)),
    )

    def factors() -> None:
        elastic = ElasticFrame(frame)
        matrix, right = elastic.assemble(elastic.stiffness), np.zeros((6 * frame.vertex_count, 2))
        for alone in (True, False):
            elastic.anchored(matrix).factorise(alone).solve(right)
        for precision in (np.float32, np.float64):
            matrix @ right.astype(precision)

    def steps() -> None:
        elastic, terms = ElasticFrame(frame), rods.gauss_newton(drawn, level)
        joint_system(elastic, terms)
        pose = start_pose(elastic)
        free_step(elastic, terms, pose, pose, 0.1, 0.1)

    def moving_cameras() -> None:
        terms = camera_terms(drawn, rods.gauss_newton_by_view(drawn, level), level.cameras, np.ones(len(cameras)))
        coupling_to_freedoms(ElasticFrame(frame), terms)

    def forecasts() -> None:
        fit = MaterialFit.start(CreepModel(frame, PrintSettings()))
        began = PrintState.before(frame.replace(printed=[False] * frame.strut_count), np.zeros(frame.strut_count), 0.0)
        remaining_movement(fit, began, steps_of([np.arange(frame.strut_count)]))

    def print_job() -> None:
        with scratch_folder() as scratch:
            check_job(plan_job(scratch / "job", frame, PlanOptions(allow_contact=True)))

    return [
        ("silhouettes", lambda: silhouettes(frame, cameras)),
        ("pictures of rods", lambda: rods.transmittance(drawn, level)),
        ("steps of the fit", steps),
        ("what is there of a strut", lambda: presence.strut_whiteness(drawn, level)),
        ("factors of a frame's stiffness", factors),
        ("cameras that may move", moving_cameras),
        ("forecasts of prints", forecasts),
        ("orders and checks of prints", print_job),
    ]
