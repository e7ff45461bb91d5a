"""``frametwin print plan``: a print job from a frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from frametwin.cli.common import (
    FOLDER,
    Positive,
    check_output_folder,
    json_option,
    load_frame,
    overwrite_option,
    print_facts,
    print_json,
    quiet_option,
)
from frametwin.cli.display import Display
from frametwin.cli.print_common import (
    ROBOTS,
    Formats,
    Numbers,
    loop_options,
    order_options,
    read_base,
    split_nozzle,
    steering,
    supports_told,
)
from frametwin.wording import counted, duration_text, typed


@click.command("plan", short_help="Plan the order of a frame and write a job with its first batch.")
@click.argument("frame")
@click.option("--out", type=FOLDER, required=True, metavar="JOB", help="The job folder to write.")
@order_options
@click.option(
    "--allow-contact", is_flag=True, help="Let the tool touch what is printed where there is no other way, and say so."
)
@loop_options
@click.option(
    "--formats",
    type=Formats(),
    default="json,urscript,gcode",
    show_default=True,
    help="Of the waypoints: json, urscript (Universal Robots), gcode, rapid (ABB), krl (KUKA), compas, assembly.",
)
@click.option(
    "--workspace",
    type=Numbers("X0,Y0,Z0,X1,Y1,Z1"),
    metavar="X0,Y0,Z0,X1,Y1,Z1",
    help="Lower and upper corner in mm, in the robot's base, of where the tool's tip may go; nothing outside is ever"
    " written.  [default: the frame with its own length to spare on all sides and above]",
)
@click.option(
    "--base",
    metavar="X,Y,Z[,DEGREES]",
    help="Where the frame's origin stands in the robot's base in mm, and its turn about z; or a JSON file with a rigid"
    " 4 x 4 matrix under 'base'.  [default: at the base's origin]",
)
@click.option(
    "--max-speed", type=Positive(), default=250.0, show_default=True, help="Of the tool's tip in mm/s, anywhere."
)
@click.option(
    "--robot",
    type=click.Choice(ROBOTS, case_sensitive=False),
    help="The robot: what its arm cannot reach with the tool is refused too (by compas_fab where that is installed).",
)
@click.option(
    "--tool", type=click.FloatRange(0.0), metavar="MM", help="Length of the robot's tool, from its flange to the tip."
)
@click.option("--ur10e-tool", type=click.FloatRange(0.0), hidden=True)  # what --robot ur10e --tool was before
@click.option("--speed", type=Positive(), help="Of the tool's tip while it lays a strut, in mm/s.  [default: 5]")
@click.option(
    "--cameras",
    type=click.Choice(("auto", "exact")),
    default="auto",
    show_default=True,
    help="Find cameras along with each batch where the pictures ask for it, or take them as they are.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the search for an order.")
@overwrite_option("JOB")
@quiet_option
@json_option
def plan_command(frame: str, out: Path, overwrite: bool, quiet: bool, as_json: bool, **settings: Any) -> None:
    """Find an order in which FRAME can be printed, and write JOB with the waypoints of the first batch.

    Every strut starts on the plate or on something printed, and the nozzle reaches it without touching anything.
    An order that comes with the frame (batches, layers, or --order FILE) is kept and checked. Where there is none, the
    struts that are stuck are named.

    \b
    Examples:
      frametwin print plan bridge --out out/job
      frametwin print plan femur.json --out out/job --batch-size 40 --base 400,0,20 --workspace 150,-400,0,900,400,600
      frametwin print plan FRAME --out out/job --robot ur10e --tool 210
      frametwin print plan FRAME --out out/job --coupon
      frametwin print plan FRAME --out out/job --supports 4
      frametwin print plan tower.json --out out/job --order pychoreo_plan.json --max-tilt 0 --formats gcode
    """
    check_output_folder(out, overwrite, "job.json")
    plan = load_frame(frame)
    from frametwin.printing.job.plan_job import PlanOptions, guessed_outlook, plan_job
    from frametwin.printing.job.summaries import plan_summary
    from frametwin.printing.toolpath.ur_arms import ARMS

    order, material = settings.pop("order"), settings.pop("material")
    steered = steering(*(settings.pop(name) for name in ("way", "anticipate", "compensate")))
    base = read_base(settings.pop("base"))
    speed, reprint = settings.pop("speed"), bool(settings.pop("reprint"))
    waypoints = {} if speed is None else {"speed": speed}
    former = settings.pop("ur10e_tool")
    if former is not None:
        settings |= {"robot": settings["robot"] or "ur10e", "tool": former}
    options = PlanOptions(**split_nozzle(settings), **steered, base=base, waypoints=waypoints, reprint=reprint)
    with Display(quiet) as display:
        job = plan_job(out, plan, options, order=order, material=material, overwrite=overwrite, progress=display)
        told = None if material is not None else guessed_outlook(job, display)
    data = plan_summary(job)
    if as_json:
        print_json({"out": out, **data, "outlook": None if told is None else told.as_dict()})
        return
    first, arm = data["first"], job.settings.robot.arm
    added = ((data["coupon"], "a coupon"), (data["support_struts"], "temporary supports"))
    others = " and ".join(f"{count} of them {what}" for count, what in added if count)
    struts = f"{counted(data['struts'], 'strut')}{others and f' ({others})'} in {counted(data['batches'], 'batch')}"
    supports = [("supports", supports_told(data["supported"], options.supports))] if data["supported"] else []
    low, high = (", ".join(f"{value:.0f}" for value in corner) for corner in data["workspace"])
    print_facts(
        f"job: {out}",
        [
            ("frame", f"{data['frame']}, {struts}"),
            *supports,
            ("workspace", f"from ({low}) to ({high}) mm in the robot's base, up to {data['max_speed']:g} mm/s"),
            (
                "first batch",
                f"{counted(data['first']['struts'], 'strut')}, {duration_text(data['first']['seconds'])} of printing",
            ),
            *([] if arm is None else [("reach", f"a {ARMS[arm].name} takes all waypoints of it ({first['reach']})")]),
            *[("contact", sentence) for sentence in first["contacts"]],
            *([] if told is None else [("forecast", told.sentence)]),
            ("waypoints", f"{job.batch_folder(0) / 'waypoints'}"),
            ("next", f"print them, take pictures, then: frametwin print next {typed(out)} --capture CAPTURE"),
        ],
    )
