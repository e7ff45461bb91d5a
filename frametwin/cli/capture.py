"""``frametwin capture``: a capture from raw pictures of a calibrated rig."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.calibrate_common import Place
from frametwin.cli.common import (
    FOLDER,
    check_output_folder,
    json_option,
    load_frame,
    overwrite_option,
    print_facts,
    print_json,
    quiet_option,
)
from frametwin.cli.display import Display


@click.command("capture", short_help="Make a capture from raw pictures of a rig.")
@click.argument("rig", type=FOLDER)
@click.argument("pictures", type=FOLDER)
@click.option("--frame", required=True, metavar="PLAN", help="The plan, with what has been printed.")
@click.option("--out", type=FOLDER, required=True, metavar="CAPTURE", help="The capture folder to write.")
@click.option(
    "--base",
    type=Place(),
    help="Where the plan's origin stands in the robot's base in mm, as for print plan.  [default: 0,0,0]",
)
@click.option("--background", type=FOLDER, metavar="PICTURES", help="The same views before printing.")
@click.option("--moment", metavar="NAME", help="Which pictures, where each camera has a folder with several.")
@overwrite_option("CAPTURE")
@quiet_option
@json_option
def command(
    rig: Path,
    pictures: Path,
    frame: str,
    out: Path,
    base: tuple[float, ...] | None,
    background: Path | None,
    moment: str | None,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Put raw PICTURES of a calibrated RIG's cameras together with the plan.

    PICTURES holds a picture for each camera, named after it, or a folder of each camera with pictures. CAPTURE is in
    the plan's axes, in mm, and also holds how well the cameras are known (rig.json).

    \b
    Examples:
      frametwin capture rig shots --frame bridge.json --out capture
      frametwin capture rig shots --frame bridge.json --base 400,0,20 --background before --out capture
    """
    check_output_folder(out, overwrite, "transforms.json")
    plan = load_frame(frame)
    from frametwin.calibration.rig_capture import capture_from_rig
    from frametwin.cameras.rig_file import read_rig
    from frametwin.cameras.standing import standing_at

    found = read_rig(rig)
    with Display(quiet) as display:
        missing = capture_from_rig(
            found,
            pictures,
            plan,
            out,
            base=None if base is None else standing_at(base),
            background=background,
            moment=moment,
            overwrite=overwrite,
            progress=display,
        )
    views = len(found.cameras) - len(missing)
    if as_json:
        print_json({"out": out, "frame": plan.name, "views": views, "missing": list(missing)})
        return
    facts = [("frame", plan.name), ("views", f"{views} of the rig's {len(found.cameras)} cameras")]
    facts += [("missing", ", ".join(missing))] if missing else []
    facts.append(("next", f"frametwin fit {out} --out RUN"))
    print_facts(f"capture: {out}", facts)
