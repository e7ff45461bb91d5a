"""Adaptive printing: plan a job, answer its batches, or print without a robot."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from frametwin.api.frames import frame_of
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback

if TYPE_CHECKING:
    from frametwin.printing.job.job import PrintJob
    from frametwin.printing.simulation.simulate import SimulatedPrint


def plan_print(
    frame: Wireframe | PathLike,
    folder: PathLike,
    *,
    order: PathLike | None = None,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
    **options: Any,
) -> PrintJob:
    """Find an order in which a frame can be printed, and write a job with the waypoints of its first batch.

    Parameters
    ----------
    frame : Wireframe, path or str
        The design: a frame, a frame file, or the name of a built-in frame such as ``"bridge"``.
    folder : path
        The job folder to be.
    order : path, optional
        A file with an order to keep: a plan of pychoreo, an RL3DP path, or a sequence of FrameTwin.
    overwrite : bool
        Whether a job that is in the folder may be replaced.
    progress : callable, optional
        Called with a `Progress` after every step; returning ``False`` stops the search.
    **options
        Attributes of `PlanOptions` that differ from its defaults, such as ``batch_size=10`` or ``max_tilt_deg=0.0``.

    Returns
    -------
    PrintJob
        The job; the robot's files lie in ``job.batch_folder(0) / "waypoints"``.

    Raises
    ------
    InputError
        If the frame cannot be printed, a waypoint lies outside of the workspace, or the folder cannot be written.
    Cancelled
        If ``progress`` returns ``False``.
    """
    from frametwin.printing.job.plan_job import PlanOptions, plan_job

    return plan_job(
        folder, frame_of(frame), PlanOptions(**options), order=order, overwrite=overwrite, progress=progress
    )


def read_print(folder: PathLike) -> PrintJob:
    """Open a print job.

    Parameters
    ----------
    folder : path
        As written by `plan_print` or by ``frametwin print plan``.

    Returns
    -------
    PrintJob
        The job: ``job.current`` is the batch to print next, ``job.states()`` tells of all batches.

    Raises
    ------
    InputError
        If it is no job, or damaged.
    """
    from frametwin.printing.job.job import PrintJob

    return PrintJob(folder)


def answer_print(
    job: PrintJob | PathLike,
    capture: PathLike,
    *,
    accept: Collection[str] = (),
    reprint: bool | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Answer the batch that was printed last: find its twin, move what is still to come, write the next waypoints.

    Parameters
    ----------
    job : PrintJob or path
        The job, or its folder.
    capture : path
        Folder of the pictures taken after the batch: ``transforms.json`` and the pictures it names.
    accept : collection of str
        Doubts in spite of which to print on, such as ``{"lost-struts"}``.
    reprint : bool, optional
        Whether lost struts are laid again at the start of the next batch; by default as the job was planned.
    progress : callable, optional
        Called with a `Progress` after every step; returning ``False`` stops the answer.

    Returns
    -------
    dict
        The report, as it is written to the batch's ``report.json``.

    Raises
    ------
    InputError
        If the capture cannot be used, or the print is finished.
    FrameTwinError
        If the job holds, since the pictures, or the twin found from them, are not such that one may print on; it is as
        it was.
    Cancelled
        If ``progress`` returns ``False``; the job is as it was.
    """
    from frametwin.printing.job.answer import AnswerOptions
    from frametwin.printing.job.job import PrintJob

    work = job if isinstance(job, PrintJob) else PrintJob(job)
    return work.answer(capture, AnswerOptions(accept=frozenset(accept), reprint=reprint), progress)


def simulate_print(
    frame: Wireframe | PathLike,
    folder: PathLike,
    *,
    adapt: bool = True,
    views: int = 8,
    size: tuple[int, int] | None = None,
    seed: int = 0,
    order: PathLike | None = None,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
    **options: Any,
) -> SimulatedPrint:
    """Print a frame without a robot: lay a batch, take pictures, answer them, and so on.

    The simulated print knows nothing of the twin, and the twin sees nothing but pictures. A simulation that was stopped
    goes on when it is called again.

    Parameters
    ----------
    frame : Wireframe, path or str
        The design: a frame, a frame file, or the name of a built-in frame such as ``"bridge"``.
    folder : path
        The job folder to be, or that of the same simulation, stopped before.
    adapt : bool
        Whether what is still to come is moved to meet the twin, and lost struts are laid again.
    views : int
        Number of cameras, on a ring around the design.
    size : (2,) int, px, optional
        Of the pictures, as in `SimulationSettings`.
    seed : int
        Of all that is left to chance.
    order, overwrite, progress
        See `plan_print`.
    **options
        Further attributes of `PlanOptions`, such as ``compensate=False``.

    Returns
    -------
    SimulatedPrint
        The job, what stands in the end, and how every batch went.

    Raises
    ------
    InputError
        If the frame cannot be printed, or the folder holds something else.
    Cancelled
        If ``progress`` returns ``False``; batches that were answered stay.
    """
    from frametwin.printing.job.plan_job import PlanOptions
    from frametwin.printing.simulation import simulate
    from frametwin.printing.simulation.simulated_pictures import SimulatedRig

    plan = PlanOptions(**{"adapt": adapt, "reprint": adapt, "allow_contact": True, **options})
    rig = SimulatedRig(views=views) if size is None else SimulatedRig(views=views, size=size)
    wanted = simulate.SimulationOptions(plan=plan, rig=rig, seed=seed)
    return simulate.simulate_print(folder, frame_of(frame), wanted, order=order, overwrite=overwrite, progress=progress)
