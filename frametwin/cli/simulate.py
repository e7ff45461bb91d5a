"""``frametwin simulate``: a capture of a print that has sagged."""

from __future__ import annotations

from pathlib import Path

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
    size_option,
)
from frametwin.cli.display import Display
from frametwin.wording import shortened


@click.command("simulate", short_help="Make a capture of a print that has sagged, with the truth.")
@click.argument("frame")
@click.option("--out", type=FOLDER, required=True, metavar="CAPTURE", help="The capture folder to write.")
@click.option("--views", type=click.IntRange(2, 1000), default=8, show_default=True, help="Number of cameras.")
@size_option
@click.option(
    "--peak",
    type=Positive(),
    help="Largest displacement in mm.  [default: 7 % of the longest side of what is printed]",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all that is random.")
@click.option(
    "--missing", type=click.IntRange(0), default=0, show_default=True, help="Number of struts that broke off."
)
@click.option(
    "--missing-share",
    type=Positive(1.0),
    default=0.5,
    show_default=True,
    help="How much of each of those is missing, as a share of its length.",
)
@click.option(
    "--printed",
    type=Positive(1.0),
    help="Share of the struts that is printed: batch by batch and from the ground up, each strut on those"
    " before it.  [default: what the frame says, usually all]",
)
@click.option(
    "--deformation",
    type=click.Choice(["sag", "tip-load", "warp", "rigid"]),
    default="sag",
    show_default=True,
    help="sag: gravity, one strut in four being soft; tip-load: the top pushed sideways; warp: a random"
    " smooth field; rigid: shifted and turned as a whole.",
)
@click.option(
    "--rig",
    type=click.Choice(["ring", "dome"]),
    default="ring",
    show_default=True,
    help="Cameras on a ring, or spread over a dome.",
)
@click.option(
    "--supersampling",
    type=click.IntRange(1, 16),
    default=1,
    show_default=True,
    help="Samples along each side of a pixel; 1 gives black and white only.",
)
@overwrite_option("CAPTURE")
@quiet_option
@json_option
def command(frame: str, out: Path, overwrite: bool, quiet: bool, as_json: bool, **settings: object) -> None:
    """Let the plan FRAME sag as a half-hardened print does, and take the silhouettes of what is left of it.

    CAPTURE is a folder with the plan (frame.json), the cameras (transforms.json), the pictures (images/), the
    real geometry (truth.json), how it was made (simulation.json) and, if struts are missing, which
    (defects.json). The cameras see the whole plan, also what is not printed yet.

    \b
    Examples:
      frametwin simulate bridge --out out/bridge
      frametwin simulate femur.json --out out/femur --peak 15 --missing 3
      frametwin simulate tower.json --out out/tower --printed 0.6 --views 10 --size 800x600
    """
    check_output_folder(out, overwrite, "transforms.json")
    plan = load_frame(frame)
    from frametwin.simulation.simulate import SimulationSettings, simulate, write_simulation

    checked = SimulationSettings(**settings)  # type: ignore[arg-type]
    with Display(quiet) as display:
        simulation = simulate(plan, checked, display)
        write_simulation(out, simulation, overwrite)
    struts = simulation.frame.printed
    missing = [int(i) for i in (struts & (simulation.present != [0.0, 1.0]).any(axis=1)).nonzero()[0]]
    if as_json:
        print_json(
            {
                "out": out,
                "frame": simulation.frame.name,
                "views": len(simulation.cameras),
                "struts": simulation.frame.strut_count,
                "printed": int(struts.sum()),
                "largest_displacement": simulation.peak,
                "missing": missing,
            }
        )
        return
    height, width = checked.size
    print_facts(
        f"capture: {out}",
        [
            ("frame", f"{simulation.frame.name}, {struts.sum()} of {len(struts)} struts printed"),
            ("views", f"{len(simulation.cameras)} of {width} x {height} pixels"),
            ("largest displacement", f"{simulation.peak:.4g} mm"),
            ("missing struts", shortened(missing)),
            ("next", f"frametwin fit {out} --out RUN"),
        ],
    )
