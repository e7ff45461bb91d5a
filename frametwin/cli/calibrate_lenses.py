"""``frametwin calibrate intrinsics``: the lens of each camera."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.calibrate_common import tell_rig
from frametwin.cli.common import FOLDER, json_option, overwrite_option, quiet_option
from frametwin.cli.display import Display

MODELS = {"perspective": "OPENCV", "fisheye": "OPENCV_FISHEYE"}


@click.command("intrinsics", short_help="Find the lens of each camera.")
@click.argument("pictures", type=FOLDER)
@click.option("--board", required=True, metavar="BOARD", help="What is in the pictures, such as charuco:7x5:30.")
@click.option(
    "--model",
    type=click.Choice(list(MODELS)),
    default="perspective",
    show_default=True,
    help="Of the lenses; fisheye for wide angles of 120 degrees and more.",
)
@click.option("--out", type=FOLDER, required=True, metavar="RIG", help="The rig folder to write.")
@overwrite_option("RIG")
@quiet_option
@json_option
def intrinsics_command(
    pictures: Path, board: str, model: str, out: Path, overwrite: bool, quiet: bool, as_json: bool
) -> None:
    """Find the lens of each camera from PICTURES, a folder with a folder of pictures for each camera.

    Ten to twenty pictures each, the board at all places of the picture and tilted by 30 to 45 degrees. Focus and zoom
    must not change afterwards: turn autofocus off. Pictures that spoil the result are left out and named; the number of
    distortion terms is the one with which pictures held out are met best.

    \b
    Example:
      frametwin calibrate intrinsics pictures --board charuco:7x5:30:22.5:4X4_250 --out rig
    """
    from frametwin.calibration.boards import parse_board
    from frametwin.calibration.lens_steps import calibrate_intrinsics
    from frametwin.calibration.rig_folder import require_rig_or_free, write_folder

    chosen = parse_board(board)
    require_rig_or_free(out, overwrite)
    with Display(quiet) as display:
        rig, seen, evidence = calibrate_intrinsics(pictures, chosen, MODELS[model], display)
        write_folder(out, rig, lenses=seen, evidence=evidence, overwrite=overwrite)
    tell_rig(out, rig, "intrinsics", as_json)
