"""The files of a batch that is to be printed: the plan that the robot follows, and what it is told."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from frametwin.formats import frame_json
from frametwin.printing import job_files as files
from frametwin.printing.job_files import JobSettings
from frametwin.printing.robot_files import write_robot_files
from frametwin.printing.sequence import PrintSequence
from frametwin.wireframe import Wireframe


@dataclass(frozen=True, eq=False)
class NextBatch:
    """A batch that is to be printed.

    Attributes
    ----------
    batch
        Its number.
    plan
        What the robot follows, ``printed`` marking what stands.
    sequence
        In which order.
    contact
        Touching printed struts has been accepted.
    """

    batch: int
    plan: Wireframe
    sequence: PrintSequence
    contact: bool = False


def write_batch(folder: Path, going: NextBatch, settings: JobSettings, design: Wireframe) -> None:
    """Plan and waypoints of a batch, into a folder that exists."""
    frame_json.write(folder / files.PLAN, going.plan)
    waypoints = folder / files.WAYPOINTS
    waypoints.mkdir()
    write_robot_files(
        waypoints, going.plan, going.sequence, going.batch, settings.robot, design, allow_contact=going.contact
    )
