"""The files of a batch that is to be printed: the plan that the robot follows, and what it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.anticipation import drift_rate
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.job import job_files as files
from frametwin.printing.job.creep_forecast import CreepForecast
from frametwin.printing.job.job_files import JobSettings
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.toolpath.robot_files import write_robot_files


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
    rate : (V, 3) array, mm, optional
        Drift that is expected of the joints with each strut that is laid; see `drift_rate`.
    forecast
        Of jobs that aim by one.
    """

    batch: int
    plan: Wireframe
    sequence: PrintSequence
    contact: bool = False
    rate: np.ndarray | None = None
    forecast: CreepForecast | None = None

    @classmethod
    def after(
        cls,
        adapted: Wireframe,
        sequence: PrintSequence,
        batch: int,
        seen: Sequence[Observation],
        settings: JobSettings,
        contact: bool,
        forecast: CreepForecast | None = None,
    ) -> NextBatch:
        """What follows an answer.

        Parameters
        ----------
        adapted
            The plan that the answer gave.
        sequence, batch
            Which struts are printed now.
        seen
            How far joints drifted in the last batches, for jobs that anticipate; see `drift_rate`.
        settings
            Of the job.
        contact
            Touching printed struts has been accepted.
        forecast
            Of jobs that aim by one; see `JobSettings.forecast`.
        """
        if not settings.anticipate:
            return cls(batch, adapted, sequence, contact, forecast=forecast)
        rate = None if forecast is None else forecast.following(adapted).drift(sequence.in_batch(batch))
        if rate is None and (rate := drift_rate(seen)) is not None:
            rate[~(adapted.printed_vertices() | adapted.grounded)] = (
                0.0  # what is laid again drifts like its neighbours
            )
        return cls(batch, adapted, sequence, contact, rate, forecast)


def write_batch(folder: Path, going: NextBatch, settings: JobSettings, design: Wireframe) -> None:
    """Plan and waypoints of a batch, into a folder that exists."""
    frame_json.write(folder / files.PLAN, going.plan)
    if going.rate is not None:
        files.write_drift(folder, going.rate)
    waypoints = folder / files.WAYPOINTS
    waypoints.mkdir()
    write_robot_files(
        waypoints,
        going.plan,
        going.sequence,
        going.batch,
        settings.robot,
        design,
        allow_contact=going.contact,
        rate=going.rate,
    )
