"""What the robot is told for one batch: waypoints in the formats that are wanted, and a summary."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from frametwin.checked_json import convert_fields, told_of
from frametwin.errors import InputError
from frametwin.files import write_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.toolpath.exports import SUFFIXES, write_waypoints
from frametwin.printing.toolpath.exports.assembly import write_assembly
from frametwin.printing.toolpath.reach import check_reach
from frametwin.printing.toolpath.ur_arms import ARMS
from frametwin.printing.toolpath.waypoints import WaypointSettings, waypoints_of
from frametwin.printing.toolpath.workspace import Workspace
from frametwin.ranges import at_least, check_settings, one_of, some

FORMATS = (*SUFFIXES, "assembly")
SUMMARY = "summary.json"


Formats = Annotated[tuple[Annotated[str, one_of(FORMATS)], ...], some(f"some of {', '.join(FORMATS)}")]

ArmName = Annotated[str, one_of(ARMS)]
ToolLength = Annotated[float, at_least(0.0, noun="millimetres")]


def check_arm(arm: str | None, tool: float | None) -> None:
    """Refuse an arm without a tool, and a tool without an arm.

    Raises
    ------
    InputError
        If just one of them is given.
    """
    if arm is not None and tool is None:
        remedy = "give the length from the flange to the nozzle's tip in mm"
        raise InputError.at("settings", "tool", f"is missing for the {ARMS[arm].name}", remedy)
    if tool is not None and arm is None:
        raise InputError.at("settings", "robot", "is missing for the tool", f"give one of {', '.join(ARMS)}")


@dataclass(frozen=True)
class RobotSettings:
    """What the robot is told, and where it may go.

    Attributes
    ----------
    workspace
        Nothing outside of it is ever written.
    waypoints
        How struts are laid.
    formats
        Of `FORMATS`; ``assembly`` is the whole plan and no waypoints.
    arm
        The robot, of `ARMS`: nothing that it cannot reach is written either (see `reach`). ``None`` for another robot,
        whose reach nobody looks at.
    tool
        From the arm's flange to the nozzle's tip, along the flange's z, in mm.

    Raises
    ------
    InputError
        If a format or an arm is unknown, or an arm is given without a tool or a tool without an arm.
    """

    workspace: Workspace
    waypoints: WaypointSettings = WaypointSettings()
    formats: Formats = ("json", "urscript", "gcode")
    arm: ArmName | None = None
    tool: ToolLength | None = None

    def __post_init__(self) -> None:
        check_settings(self)
        check_arm(self.arm, self.tool)

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        return {
            "workspace": self.workspace.as_dict(),
            "waypoints": dataclasses.asdict(self.waypoints),
            "formats": list(self.formats),
            "arm": self.arm,
            "tool": self.tool,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source: str) -> RobotSettings:
        """Settings out of a JSON file.

        Raises
        ------
        InputError
            If a setting is missing, unknown or of another kind.
        """
        for key, kind in (("workspace", dict), ("waypoints", dict), ("formats", list)):
            if type(data.get(key)) is not kind:
                raise InputError.at(source, f"robot.{key}", "is missing or of another kind", "plan the job again")
        known = {item.name for item in dataclasses.fields(Workspace)}
        unknown = sorted(data["workspace"].keys() - known)
        if unknown or data["workspace"].keys() != known:
            field = unknown[0] if unknown else sorted(known - data["workspace"].keys())[0]
            raise InputError.at(source, f"workspace.{field}", "is missing or unknown", "plan the job again")
        with told_of(source, "robot.waypoints"):
            waypoints = WaypointSettings(**convert_fields(WaypointSettings, data["waypoints"], source))
        arm, tool = data.get("arm"), data.get("tool")
        if "ur10e_tool" in data:  # written when there was but one arm
            arm, tool = (None if data["ur10e_tool"] is None else "ur10e"), data["ur10e_tool"]
        with told_of(source, "robot.workspace"):
            workspace = Workspace(**data["workspace"])
        with told_of(source, "robot"):
            return cls(workspace, waypoints, tuple(data["formats"]), arm, tool)


def waypoint_file(batch: int, format: str) -> str:
    """The name of a batch's file in one of `FORMATS`.

    That of a program for ABB or KUKA is the program's own, and short enough for the oldest controllers (8.3).
    """
    if format in ("rapid", "krl"):
        return f"ft_{batch:03d}{SUFFIXES[format]}"
    kind = f"_{format}" if format in ("compas", "assembly") else ""
    return f"batch_{batch:03d}{kind}{SUFFIXES.get(format, '.json')}"


def write_robot_files(
    folder: Path,
    plan: Wireframe,
    sequence: PrintSequence,
    batch: int,
    settings: RobotSettings,
    design: Wireframe,
    allow_contact: bool = False,
    rate: np.ndarray | None = None,
) -> dict[str, Any]:
    """Write what the robot is told for a batch.

    Parameters
    ----------
    folder
        Exists, and is empty.
    plan
        Where the struts of the batch are to be laid, and those before it are.
    sequence, batch, settings
        The order, the batch's number, and what is wanted.
    design
        From which deviations are counted.
    allow_contact
        Write waypoints that touch printed struts, and say so in the summary, whatever the settings say.
    rate : (V, 3) array, mm, optional
        Drift of the joints with each strut that is laid; see `anticipation.drift_rate`.

    Returns
    -------
    The summary, as it is written to ``summary.json``: ``batch``, ``struts``, ``seconds`` that the robot takes,
    ``contacts`` in sentences, ``reach`` (who looked at it, or ``None``), and ``files``.

    Raises
    ------
    InputError
        If a waypoint is outside of the workspace, out of reach or too fast, or a strut cannot be laid without contact.
    """
    wanted = settings.waypoints
    if allow_contact and not wanted.allow_contact:
        wanted = dataclasses.replace(wanted, allow_contact=True)
    waypoints = waypoints_of(plan, sequence, batch, wanted, design, rate=rate)
    settings.workspace.check(waypoints)
    reach = None
    if settings.arm is not None and settings.tool is not None:
        reach = check_reach(waypoints, settings.workspace, ARMS[settings.arm], settings.tool)
    names = []
    for name in settings.formats:
        path = folder / waypoint_file(batch, name)
        if name == "assembly":
            write_assembly(path, plan, sequence)
        else:
            write_waypoints(path, waypoints, name, settings.workspace)
        names.append(path.name)
    summary = {
        "batch": batch,
        "struts": waypoints.struts,
        "seconds": waypoints.seconds,
        "contacts": list(waypoints.contacts),
        "reach": reach,
        "files": names,
    }
    write_json(folder / SUMMARY, summary)
    return summary
