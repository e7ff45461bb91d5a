"""Whether the way of the tool stays within what the robot may do, and whether files say the same; computed anew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from frametwin.printing.sequencing.check import Fault
from frametwin.printing.toolpath.exports.gcode import FILAMENT
from frametwin.printing.toolpath.exports.robot_program import BLEND
from frametwin.printing.toolpath.reach import within_reach
from frametwin.printing.toolpath.tool_path import ToolPath
from frametwin.printing.toolpath.ur_arms import Arm
from frametwin.printing.toolpath.waypoints import WaypointSettings
from frametwin.printing.toolpath.workspace import Workspace

ROUNDING = 1e-5
"""mm and mm/s; formats write fewer digits than numbers have."""

SAME_SPEED = 0.01
"""mm/s by which formats may differ, which round down."""

SAME_AXIS = 1e-5

SAME_PAUSE = 2e-3
"""s by which formats may differ, which write milliseconds."""

SAME_MATERIAL, LAST_DIGIT = 1e-3, 1e-6
"""Share of a strut's material that may be missing or too much, and mm of filament that each line may be off."""


def limit_faults(
    path: ToolPath, workspace: Workspace, max_tilt_deg: float, arm: Arm | None, tool: float | None
) -> Iterator[Fault]:
    """Find where the tool leaves its limits: workspace, speed, tilt, and the reach of the arm; the worst place of each.

    Parameters
    ----------
    path
        Of the tool.
    workspace
        Limits in the coordinates of the robot's base.
    max_tilt_deg
        How far the tool may lean from the vertical of the print, where that is less than the workspace allows.
    arm
        The robot, of `ARMS`; ``None`` for another one.
    tool
        From its flange to the tip in mm.
    """
    where = path.position @ workspace.base[:3, :3].T + workspace.base[:3, 3]
    outside = np.maximum(workspace.lower - where, where - workspace.upper).max(axis=1)
    n = int(np.argmax(outside))
    if outside[n] > ROUNDING:
        yield Fault("workspace", None, f"waypoint {n} is {outside[n]:.3g} mm outside of the workspace", waypoint=n)
    n = int(np.argmax(path.speed))
    if path.speed[n] > workspace.max_speed + ROUNDING:
        too_fast = path.speed[n] - workspace.max_speed
        yield Fault("speed", None, f"waypoint {n} is reached {too_fast:.3g} mm/s too fast", waypoint=n)
    n = int(np.argmin(path.speed))
    if path.speed[n] <= 0.0:
        yield Fault("speed", None, f"waypoint {n} has no speed", waypoint=n)
    allowed = min(max_tilt_deg, workspace.max_tilt_deg)
    tilt = np.degrees(np.arctan2(np.hypot(path.axis[:, 0], path.axis[:, 1]), path.axis[:, 2]))
    n = int(np.argmax(tilt))
    if tilt[n] > allowed + 1e-4:
        yield Fault("tilt", None, f"the tool leans {tilt[n] - allowed:.3g} degrees too far at waypoint {n}", waypoint=n)
    if arm is not None and tool is not None:
        turns = workspace.base[:3, :3] @ path.rotation
        bad = np.flatnonzero(~within_reach(arm, where - tool * turns[:, :, 2], turns))
        if len(bad):
            problem = f"waypoint {int(bad[0])} is out of a {arm.name}'s reach, as are {len(bad) - 1} others"
            yield Fault("reach", None, problem, waypoint=int(bad[0]))


def agreement_faults(path: ToolPath, others: Mapping[str, ToolPath]) -> Iterator[Fault]:
    """Find files that make the tool do something else than the first one.

    Parameters
    ----------
    path
        Of the first file.
    others
        Those of the other files, by format.
    """
    for format, other in others.items():
        if len(other.position) != len(path.position):
            numbers = f"{len(other.position)} waypoints where another has {len(path.position)}"
            yield Fault("file", None, f"its {format} file has {numbers}")
            continue
        differences = {
            "positions": np.abs(other.position - path.position).max() > ROUNDING,
            "axes": np.abs(other.axis - path.axis).max() > SAME_AXIS,
            "speeds": np.abs(other.speed - path.speed).max() > SAME_SPEED,
            "extrusion": not np.array_equal(other.extrude, path.extrude),
            "pauses": np.abs(other.dwell - path.dwell).max() > SAME_PAUSE,
        }
        wrong = [name for name, differs in differences.items() if differs]
        if wrong:
            yield Fault("file", None, f"its {format} file has other {' and '.join(wrong)} than another one")


def laying_faults(
    path: ToolPath, format: str, struts: np.ndarray, radius: np.ndarray, wanted: WaypointSettings
) -> Iterator[Fault]:
    """Find struts that a file lays otherwise than was asked for: faster, slower, with other pauses, blends or material.

    Parameters
    ----------
    path, format
        Of the tool, by the file of that format.
    struts : (N,) int64 array
        That it lays, one for each stretch along which material flows.
    radius : (N,) array, mm
        Of them.
    wanted
        What was asked for.
    """
    ways = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
    widest = np.zeros(len(path.position))
    for strut, size, (first, last) in zip(struts.tolist(), radius.tolist(), path.strut_runs(), strict=True):
        inner = slice(first + 1, last)
        widest[inner] = BLEND * np.minimum(ways[first : last - 1], ways[first + 1 : last])
        speeds = path.speed[first + 1 : last + 1]
        worst = float(speeds[np.argmax(np.abs(speeds - wanted.speed))])
        if abs(worst - wanted.speed) > SAME_SPEED:
            yield Fault("speed", strut, f"it is laid at {worst:.3g} mm/s where {wanted.speed:g} were asked for")
        pauses = np.zeros(last + 1 - first)
        pauses[0], pauses[-1] = wanted.start_dwell, wanted.end_dwell
        n = int(np.argmax(np.abs(path.dwell[first : last + 1] - pauses)))
        if abs(path.dwell[first + n] - pauses[n]) > SAME_PAUSE:
            waits = f"waits {path.dwell[first + n]:.3g} s at waypoint {first + n}"
            yield Fault("path", strut, f"the tool {waits} where {pauses[n]:g} were asked for")
        if path.filament is not None:
            pushed, takes = (
                path.filament[first + 1 : last + 1].sum(),
                (2.0 * size / FILAMENT) ** 2 * ways[first:last].sum(),
            )
            if abs(pushed - takes) > SAME_MATERIAL * takes + LAST_DIGIT * (last - first):
                problem = f"its {format} file pushes {pushed:.4g} mm of filament where it takes {takes:.4g}"
                yield Fault("path", strut, problem)
    n = int(np.argmax(path.blend - widest))
    if path.blend[n] > widest[n] + ROUNDING:
        problem = f"its {format} file blends {path.blend[n]:.3g} mm at waypoint {n} where {widest[n]:.3g} are the most"
        yield Fault("path", None, problem, waypoint=n)
