"""An independent check of a print job: its order, and what the files for the robot make the tool do.

Planner and check share the geometry of struts and nozzle, and nothing else: files are read back as a robot's controller
would, the tool is followed at finely sampled poses, on its ways between struts too, and limits are compared anew. What
runs into what is looked for twice, by different geometry (`frametwin.printing.job.second_look`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from frametwin.errors import InputError
from frametwin.files import file_hash
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.anticipation import Anticipation
from frametwin.printing.job import job_files as files
from frametwin.printing.job.check_record import BatchLook, JobCheck
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.second_look import TOLERANCE, StandingPoints
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.check import (
    UP,
    Fault,
    begun_in_the_air,
    check_sequence,
    collision_fault,
    on_plate,
    plate_fault,
    plate_height,
)
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.tool_collisions import POSE_STEP, SampledStruts, ToolPoses, collision_depths
from frametwin.printing.toolpath.path_check import agreement_faults, laying_faults, limit_faults
from frametwin.printing.toolpath.robot_files import waypoint_file
from frametwin.printing.toolpath.tool_path import ToolPath, read_tool_path
from frametwin.printing.toolpath.ur_arms import ARMS
from frametwin.progress import Progress, ProgressCallback, report

BESIDE = 0.5
"""A strut lies beside its joint, or beside its plan, if the tip is further off than this, in strut radii."""

SAMPLES = 257
"""Points of a strut's curve to which waypoints are compared."""

SECOND_STEP = 1.0
"""Distance in strut radii between poses of the second look."""


def check_job(job: PrintJob, batch: int | None = None, progress: ProgressCallback | None = None) -> JobCheck:
    """Check a job: the order of its design, and the waypoints of every batch that has some.

    What is found, by kind: ``"in the air"``, ``"left out"``, ``"collision"`` and ``"plate"`` of the order and of
    waypoints; ``"workspace"``, ``"speed"``, ``"tilt"``, ``"reach"``, ``"start"`` and ``"end"`` (beside the joint),
    ``"gap"`` (a strut begins, or ends at a joint, where no material is), ``"path"`` (beside the plan of the
    strut, not all of it, or with other pauses, blends or material than asked for)
    and ``"file"`` (other struts than those of the batch, or files that
    contradict each other) of waypoints alone.

    Parameters
    ----------
    job
        Nothing of it is changed.
    batch
        Look at its waypoints alone, and not at the order.
    progress
        Called for every few struts; may cancel.

    Raises
    ------
    InputError
        If the batch has no waypoints, or a file is missing or damaged.
    Cancelled
        If ``progress`` returns ``False``.
    """
    current = job.current
    there = range(job.sequence.batch_count if current is None else current + 1)
    if batch is not None and batch not in there:
        remedy = f"give one from 0 to {there[-1]}"
        raise InputError.at(job.folder, "batch", f"{batch} has no waypoints", remedy)
    nozzle = job.settings.robot.waypoints.nozzle or Nozzle.fitting(job.design)
    faults = []
    if batch is None:
        faults += check_sequence(job.design, job.sequence_at(0), nozzle, progress)
    looked_at = tuple(there) if batch is None else (batch,)
    waypoints = poses = 0
    looks = []
    for number in looked_at:
        report(progress, Progress("checking waypoints", number, len(there)))
        look = _BatchCheck.build(job, number, nozzle)
        faults += look.faults(progress, len(there))
        waypoints, poses = waypoints + len(look.path.position), poses + look.pose_count
        looks.append(look.told())
    return JobCheck(tuple(faults), looked_at, waypoints, poses, tuple(looks))


@dataclass(eq=False)
class _BatchCheck:
    """One batch: what stands before it, what is to be laid, and the way of the tool."""

    job: PrintJob
    batch: int
    nozzle: Nozzle
    sequence: PrintSequence
    ahead: Anticipation
    paths: dict[str, ToolPath]
    hashes: dict[str, str]
    pose_count: int = 0
    nearest: tuple[float, int, int] = (float("inf"), -1, -1)

    @classmethod
    def build(cls, job: PrintJob, batch: int, nozzle: Nozzle) -> _BatchCheck:
        robot = job.settings.robot
        folder = job.batch_folder(batch) / files.WAYPOINTS
        paths = {
            format: read_tool_path(folder / waypoint_file(batch, format), format, robot.workspace)
            for format in robot.formats
            if format != "assembly"
        }
        if not paths:
            problem, remedy = "holds no waypoints", "plan the job with another format than assembly"
            raise InputError.at(folder, "formats", problem, remedy)
        ahead, sequence = job.anticipation(batch), job.sequence_at(batch)
        names = [waypoint_file(batch, format) for format in robot.formats]
        hashes = {name: file_hash(folder / name) for name in names if (folder / name).is_file()}
        return cls(job, batch, nozzle.long_enough(ahead.plan), sequence, ahead, paths, hashes)

    @property
    def path(self) -> ToolPath:
        """Of the first file, with which the others are compared."""
        return next(iter(self.paths.values()))

    def faults(self, progress: ProgressCallback | None, total: int) -> list[Fault]:
        robot, path = self.job.settings.robot, self.path
        arm = None if robot.arm is None else ARMS[robot.arm]
        found = [*self._in_the_air(), *agreement_faults(path, dict(list(self.paths.items())[1:]))]
        for each in self.paths.values():
            limits = limit_faults(each, robot.workspace, robot.waypoints.max_tilt_deg, arm, robot.tool)
            found += [fault for fault in limits if fault not in found]
        runs, struts = path.strut_runs(), self.ahead.laying.struts
        if len(runs) != len(struts):
            problem = f"its waypoints lay {len(runs)} struts where the batch has {len(struts)}"
            return [replace(fault, batch=self.batch) for fault in (*found, Fault("file", None, problem))]
        for format, each in self.paths.items():
            if len(each.strut_runs()) == len(struts):
                laid = laying_faults(each, format, struts, self.ahead.plan.radius[struts], robot.waypoints)
                found += [fault for fault in laid if fault not in found]
        found = [self._at_strut(fault, runs, struts) for fault in found]
        for place, strut in enumerate(struts.tolist()):
            report(progress, Progress("checking waypoints", self.batch, total))
            found += self._of_strut(place, strut, runs)
        return [replace(fault, batch=self.batch) for fault in found]

    def told(self) -> BatchLook:
        """What an operator wants to know."""
        path, workspace = self.path, self.job.settings.robot.workspace
        waits = self.job.settings.robot.waypoints
        where = path.position @ workspace.base[:3, :3].T + workspace.base[:3, 3]
        ways = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
        seconds = float((ways / np.maximum(path.speed[1:], 1e-9)).sum())
        laying = self.ahead.laying
        air, strut, other = self.nearest
        return BatchLook(
            batch=self.batch,
            struts=tuple(laying.struts.tolist()),
            files=self.hashes,
            waypoints=len(path.position),
            poses=self.pose_count,
            length=float(bezier.arc_length(laying.directed_curves(self.ahead.plan)).sum()),
            seconds=seconds + len(laying) * (waits.start_dwell + waits.end_dwell),
            fastest=float(path.speed.max()),
            tilt_deg=float(np.degrees(np.arccos(np.clip(path.axis[:, 2], -1.0, 1.0))).max()),
            lower=tuple(where.min(axis=0).tolist()),
            upper=tuple(where.max(axis=0).tolist()),
            air=air,
            nearest=() if other < 0 else (strut, other),
        )

    def _at_strut(self, fault: Fault, runs: list[tuple[int, int]], struts: np.ndarray) -> Fault:
        """The fault of a waypoint as one of the strut that is laid there, or that the tool is on its way to."""
        if fault.waypoint is None:
            return fault
        place = int(np.searchsorted([last for _, last in runs], fault.waypoint))
        return replace(fault, strut=int(struts[min(place, len(struts) - 1)]))

    def _in_the_air(self) -> list[Fault]:
        """Of the batch, and of all that is to come where it is the current one."""
        late = begun_in_the_air(self.ahead.plan, self.sequence, since=self.batch)
        if self.batch == self.job.current:
            return late
        return [fault for fault in late if fault.strut in self.ahead.laying.struts]

    def _of_strut(self, place: int, strut: int, runs: list[tuple[int, int]]) -> Iterator[Fault]:
        """What is wrong with one strut of the batch, on the way to it and from it too."""
        ahead, (first, last) = self.ahead, runs[place]
        frame = ahead.frame(place + 0.5)  # as the print is expected to be by then
        laying = ahead.laying
        curves = laying.directed_curves(frame)
        radius, path = float(frame.radius[strut]), self.path
        start, end = laying.start[place], laying.end_in(frame)[place]
        away = float(np.linalg.norm(path.position[first] - frame.vertices[start]))
        if away > BESIDE * radius:
            yield Fault("start", strut, f"it begins {away:.3g} mm beside its joint")
        there = ahead.plan.printed_vertices() | ahead.plan.grounded
        there[[*laying.start[:place], *laying.end_in(frame)[:place]]] = True
        away = float(np.linalg.norm(path.position[last] - frame.vertices[end]))
        if there[end] and away > BESIDE * radius:
            yield Fault("end", strut, f"it ends {away:.3g} mm beside a joint that is there already")
        if first == 0 or last == len(path.position) - 1:
            where = "begins" if first == 0 else "ends"
            yield Fault("path", strut, f"the way of the tool {where} on it, and not beside and above the print")
        yield from _beside_plan(strut, path.position[first : last + 1], curves[place], BESIDE * radius)
        standing = np.flatnonzero(ahead.plan.printed)
        order = np.concatenate([standing, laying.struts])
        struts = SampledStruts.build(
            np.concatenate([frame.control_points[standing], curves]), frame.radius[order], frame.edges[order]
        )
        poses = self._poses(len(standing) + place, curves[place], place, runs)
        self.pose_count += len(poses.tip)
        depth = collision_depths(struts, poses, self.nozzle)[0]
        collision = collision_fault(strut, order, depth, frame.radius[order])
        if collision is not None:
            yield collision
        yield from self._second_look(place, frame, curves, poses, known=collision is not None)
        low = poses.tip[:, 2] + np.minimum(0.0, self.nozzle.lowest(UP, poses.axis))
        sunk = plate_height(self.job.design) - float(low.min())
        if sunk > 1e-6 * self.job.design.extent:
            yield plate_fault(strut, sunk)

    def _second_look(
        self, place: int, frame: Wireframe, curves: np.ndarray, poses: ToolPoses, known: bool
    ) -> Iterator[Fault]:
        """Whether the strut meets material, and what the tool comes nearest to; of collisions what is not known yet."""
        laying, standing = self.ahead.laying, np.flatnonzero(self.ahead.plan.printed)
        strut, numbers = int(laying.struts[place]), np.concatenate([standing, laying.struts[:place]])
        there = StandingPoints(
            np.concatenate([frame.control_points[standing], curves[:place]]), frame.radius[numbers], numbers
        )
        radius = float(frame.radius[strut])
        joints = [("begins", laying.start[place], 0), ("ends", laying.end_in(frame)[place], -1)]
        for verb, joint, end in joints:
            wanted = end == 0 or np.isin(joint, frame.edges[numbers])
            tip = poses.tip[poses.laid == (0.0 if end == 0 else 1.0)][-1 if end == 0 else 0]
            gap = float(there.gap_to(tip).min(initial=np.inf)) - radius
            if wanted and gap > 0.0 and not on_plate(self.job.design, tip[2], radius):
                away = f"{gap:.3g} mm away from anything that is printed" if np.isfinite(gap) else "nothing is printed"
                above = float(tip[2]) - plate_height(self.job.design)
                yield Fault("gap", strut, f"it {verb} {above:.3g} mm above the plate, and {away}")
        if not len(numbers):
            return
        joined = there.joined_to(curves[place], radius, np.isin(frame.edges[numbers], frame.edges[strut]).any(axis=1))
        stride = max(1, round(SECOND_STEP / POSE_STEP))
        nearest = there.nearest(poses.tip[::stride], poses.axis[::stride], self.nozzle, joined)
        if nearest.air < self.nearest[0]:
            self.nearest = (nearest.air, strut, nearest.strut)
        depth = self.nozzle.clearance - nearest.air
        if depth > TOLERANCE * radius and not known:
            problem = f"the nozzle goes {depth:.3g} mm into strut {nearest.strut}, as the second look alone has found"
            yield Fault("collision", strut, problem, (nearest.strut,), depth)

    def _poses(self, place: int, curve: np.ndarray, run: int, runs: list[tuple[int, int]]) -> ToolPoses:
        """From the highest point of the way to the strut, along it, and to the highest point of the way on."""
        first, last = runs[run]
        height, step = self.path.position[:, 2], POSE_STEP * float(self.job.design.radius.min())
        before = 0 if run == 0 else _highest(height, runs[run - 1][1], first)
        after = len(height) - 1 if run == len(runs) - 1 else _highest(height, last, runs[run + 1][0])
        parts = [self.path.poses(a, b, step) for a, b in ((before, first), (first, last), (last, after))]
        along = np.linspace(0.0, 1.0, SAMPLES)
        points = bezier.evaluate(curve, along)
        near = [int(np.argmin(((points - tip) ** 2).sum(axis=1))) for tip in parts[1][0]]
        laid = np.concatenate([np.zeros(len(parts[0][0])), along[near], np.ones(len(parts[2][0]))])
        tip, axis = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        return ToolPoses(np.array([place]), np.array([0, len(tip)]), tip, axis, laid)


def _highest(height: np.ndarray, first: int, last: int) -> int:
    """The highest waypoint from one to another, the first of several."""
    return first + int(np.argmax(height[first : last + 1]))


def _beside_plan(strut: int, points: np.ndarray, curve: np.ndarray, most: float) -> Iterator[Fault]:
    """Find out whether waypoints (N, 3) follow a curve (4, 3), all of it, and in its sense, to ``most`` mm."""
    samples = bezier.evaluate(curve, np.linspace(0.0, 1.0, SAMPLES))
    away = np.linalg.norm(points[:, None] - samples, axis=2)
    beside = away.min(axis=1).max()
    if beside > most:
        yield Fault("path", strut, f"its waypoints lie up to {beside:.3g} mm beside its plan")
        return
    left_out = _from_polyline(samples, points).max()
    if left_out > most:
        yield Fault("path", strut, f"its waypoints leave out {left_out:.3g} mm of its plan")
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(samples, axis=0), axis=1))])[away.argmin(axis=1)]
    back = float((np.maximum.accumulate(along) - along).max())
    if back > most:
        yield Fault("path", strut, f"its waypoints go {back:.3g} mm back over what they have laid")


def _from_polyline(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(N,) array, mm: distances of points (N, 3) from the straight ways between corners (M, 3)."""
    start, way = corners[:-1], np.diff(corners, axis=0)
    from_start = points[:, None] - start
    share = (from_start * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-12)
    nearest: np.ndarray = np.linalg.norm(from_start - np.clip(share, 0.0, 1.0)[..., None] * way, axis=2).min(axis=1)
    return nearest
