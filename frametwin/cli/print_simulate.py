"""``frametwin print simulate``: the whole loop without a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin.cli.common import (
    FOLDER,
    Positive,
    json_option,
    load_frame,
    overwrite_option,
    print_facts,
    print_json,
    print_table,
    quiet_option,
    size_option,
)
from frametwin.cli.display import Display
from frametwin.cli.job_page import page_option, write_page
from frametwin.cli.print_common import (
    NOZZLE,
    accept_option,
    loop_options,
    order_options,
    split_nozzle,
    steering,
    supports_told,
)

if TYPE_CHECKING:
    from frametwin.printing.simulation.simulate import SimulatedPrint

PICTURE = "print.png"


@click.command("simulate", short_help="Print a frame without a robot, with or without adaptation.")
@click.argument("frame")
@click.option("--out", type=FOLDER, required=True, metavar="JOB", help="The job folder to write.")
@loop_options
@click.option("--no-adapt", "blind", is_flag=True, help="Print the design as it is, whatever happens.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all that is left to chance.")
@click.option(
    "--render",
    type=click.Choice(["library", "mask", "photo"]),
    default="library",
    show_default=True,
    help="Who takes the pictures: the library's own exact silhouettes, or Blender (masks, or photos).",
)
@click.option("--views", type=click.IntRange(2, 1000), default=8, show_default=True, help="Number of cameras.")
@size_option
@click.option("--sag", type=Positive(0.99), help="How far the print sags, as a share of its extent.  [default: usual]")
@click.option(
    "--speed",
    type=Positive(),
    help="Of the nozzle in mm/s: at half of it, struts take twice as long and flow half as far.  [default: 5]",
)
@click.option(
    "--draw",
    type=click.FloatRange(0.0),
    default=0.0,
    show_default=True,
    help="Pull of the nozzle at what stands while it draws a strut from there, as a multiple of the strut's weight.",
)
@click.option("--fit", is_flag=True, help="Find twins also without adaptation, to look at.")
@accept_option
@page_option
@order_options
@overwrite_option("JOB")
@quiet_option
@json_option
def simulate_command(**options: Any) -> None:
    """Print FRAME by simulation: each strut is laid where the robot believes its joint is, is soft at first, sags while
    it hardens, and falls if its start misses the material by more than a bead.

    After each batch pictures are taken and the job answers them as it would those of a real print; the simulated
    print knows nothing of the twin, and the twin sees nothing but pictures. JOB is a job like any other, with what
    really stands (truth.json) and what a batch came to (outcome.json) beside each batch, and print.png. Run the same
    command again to go on after an interruption. A print that collapses is a result: the exit code is 0.

    \b
    Examples:
      frametwin print simulate bridge --out out/adapted
      frametwin print simulate bridge --out out/blind --no-adapt
      frametwin print simulate half_bowl --out out/bowl --render mask --seed 3
    """
    _simulate(SimulateOptions(**options))


@dataclass(frozen=True)
class SimulateOptions:
    """The command line of a simulation; see its help."""

    frame: str
    out: Path
    way: str
    blind: bool
    anticipate: bool | None
    compensate: bool | None
    material: Path | None
    coupon: int
    supports: int
    reprint: bool | None
    seed: int
    render: str
    views: int
    size: tuple[int, int]
    sag: float | None
    speed: float | None
    draw: float
    fit: bool
    accept: tuple[str, ...]
    page: bool
    order: Path | None
    batch_size: int | None
    max_tilt_deg: float
    tip_radius: float | None
    cone_length: float | None
    cone_radius: float | None
    body_radius: float | None
    overwrite: bool
    quiet: bool
    as_json: bool

    @property
    def plan(self) -> dict[str, Any]:
        """Fields of `frametwin.printing.job.plan_job.PlanOptions`."""
        names = ("batch_size", "max_tilt_deg", "coupon", "supports", *NOZZLE)
        reprint = not self.blind if self.reprint is None else self.reprint
        return {
            **steering(self.way, self.anticipate, self.compensate, not self.blind),
            **split_nozzle({name: getattr(self, name) for name in names}),
            "reprint": reprint,
            "allow_contact": True,
            "waypoints": {} if self.speed is None else {"speed": self.speed},
        }


def _simulate(options: SimulateOptions) -> None:
    frame = load_frame(options.frame)
    from frametwin.blender.rendering.client import blender_renderer
    from frametwin.printing.job.plan_job import PlanOptions
    from frametwin.printing.process.material import PrintSettings
    from frametwin.printing.simulation.simulate import SimulationOptions, draw_print, simulate_print
    from frametwin.printing.simulation.simulated_pictures import SimulatedRig

    behaves = PrintSettings(draw=options.draw)
    wanted = SimulationOptions(
        plan=PlanOptions(**options.plan),
        print=behaves if options.sag is None else replace(behaves, sag=options.sag),
        rig=SimulatedRig(options.views, options.size, options.render),
        seed=options.seed,
        fit=options.fit,
        accept=options.accept,
    )
    with Display(options.quiet) as display:
        simulated = simulate_print(
            options.out,
            frame,
            wanted,
            order=options.order,
            material=options.material,
            overwrite=options.overwrite,
            renderer=blender_renderer(),
            progress=display,
        )
        draw_print(options.out / PICTURE, simulated)
        if options.page:
            write_page(options.out, display)
    if options.as_json:
        print_json({"out": options.out, **simulated.as_dict()})
    else:
        _tell(options.out, simulated, options.supports)


def _tell(out: Path, simulated: SimulatedPrint, asked: int) -> None:
    from frametwin.printing.job.summaries import supported_joints
    from frametwin.printing.simulation.simulate import verdict

    report = simulated.report
    rows = [
        [
            str(outcome.batch),
            str(len(outcome.laid)),
            str(len(outcome.attached)),
            str(len(outcome.lost)),
            f"{outcome.e_max:.2f}",
            _seconds(simulated.twin_seconds, k),
            f"{outcome.seconds:.0f}",
        ]
        for k, outcome in enumerate(simulated.outcomes)
    ]
    columns = ("batch", "laid", "attached", "lost in all", "E_max mm", "twin s", "printing s")
    name, way = simulated.job.design.name, "with" if simulated.job.settings.adapt else "without"
    print_table(f"{name}, printed {way} adaptation", columns, rows)
    facts = [("result", verdict(simulated))]
    if simulated.held is not None:
        facts.append(("stopped", str(simulated.held)))
    off = report.mean_deviation
    of_what_stands = f"{off:.3f} mm on average from the design, of what stands"
    facts.append(("deviation", "nothing of the frame stands" if math.isnan(off) else of_what_stands))
    facts.append(
        ("time", f"{sum(simulated.twin_seconds):.1f} s of twins in {sum(report.seconds) / 60.0:.0f} min of printing")
    )
    if asked:
        facts.append(("supports", supports_told(supported_joints(simulated.job), asked)))
    facts.append(("look at", f"{out / PICTURE}"))
    print_facts(f"job: {out}", facts)


def _seconds(values: tuple[float, ...], k: int) -> str:
    return f"{values[k]:.2f}" if k < len(values) and values[k] > 0.0 else ""
