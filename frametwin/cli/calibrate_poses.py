"""``frametwin calibrate extrinsics`` and ``place``: where the cameras stand."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.calibrate_common import Place, tell_rig
from frametwin.cli.common import FOLDER, json_option, quiet_option
from frametwin.cli.display import Display


@click.command("extrinsics", short_help="Find where the cameras stand to each other.")
@click.argument("rig", type=FOLDER)
@click.argument("moments", type=FOLDER)
@click.option("--board", metavar="BOARD", help="What is in the pictures.  [default: the board of the lenses]")
@quiet_option
@json_option
def extrinsics_command(rig: Path, moments: Path, board: str | None, quiet: bool, as_json: bool) -> None:
    """Find the poses of a RIG's cameras from MOMENTS, a folder of pictures for each camera.

    Pictures of the same name were taken at the same moment. Not every camera has to see every board, but boards that
    two cameras see must tie all of them together. All cameras, lenses and boards are adjusted at once; views that do
    not go with the rest are left out and named. RIG is changed: its world is that of its first camera until "place".

    \b
    Example:
      frametwin calibrate extrinsics rig moments
    """
    from frametwin.calibration.boards import parse_board
    from frametwin.calibration.extrinsics import calibrate_extrinsics
    from frametwin.calibration.placement import folder_of
    from frametwin.calibration.rig_folder import need_seen, write_folder
    from frametwin.calibration.sightings_file import LENSES
    from frametwin.cameras.rig_file import read_rig

    chosen = None if board is None else parse_board(board)
    before, folder = read_rig(rig), folder_of(rig)
    lenses = need_seen(folder, LENSES, "intrinsics")
    with Display(quiet) as display:
        placed = calibrate_extrinsics(before, lenses, moments, chosen, display)
        write_folder(
            folder, placed.rig, lenses=lenses, moments=placed.moments, evidence=placed.evidence, overwrite=True
        )
    tell_rig(folder, placed.rig, "extrinsics", as_json)


@click.command("place", short_help="Make the world the robot's.")
@click.argument("rig", type=FOLDER)
@click.argument("pictures", type=FOLDER)
@click.option(
    "--object",
    "thing",
    required=True,
    metavar="BOARD",
    help="cuboid, or a board that lies face up, such as checkerboard:5x4:8 on the block's top.",
)
@click.option(
    "--at",
    type=Place(),
    required=True,
    help="Where it stands in the robot's base: the middle of the block's bottom, or of the board; its first edge (the"
    " board's columns) runs along x, turned by DEGREES about z.",
)
@quiet_option
@json_option
def place_command(rig: Path, pictures: Path, thing: str, at: tuple[float, ...], quiet: bool, as_json: bool) -> None:
    """Move the world of a RIG into the robot's, by an object at a known place.

    PICTURES has a folder of pictures for each camera that sees the object; all show it at the same place. RIG is
    changed. Everything is adjusted once more with the object held, so that the covariances are those in the robot's
    world. It can be done again at any time.

    \b
    Examples:
      frametwin calibrate place rig block --object cuboid --at 300,0,0
      frametwin calibrate place rig block --object checkerboard:5x4:8 --at 300,0,70,90
    """
    from frametwin.calibration.boards import parse_board
    from frametwin.calibration.placement import folder_of, place_rig
    from frametwin.calibration.rig_folder import need_seen, write_folder
    from frametwin.calibration.sightings_file import LENSES, MOMENTS
    from frametwin.cameras.rig_file import read_rig

    chosen = parse_board(thing, "--object")
    before, folder = read_rig(rig), folder_of(rig)
    lenses, moments = need_seen(folder, LENSES, "intrinsics"), need_seen(folder, MOMENTS, "extrinsics")
    with Display(quiet) as display:
        placed, seen = place_rig(before, lenses, moments, pictures, chosen, at, display)
        write_folder(
            folder,
            placed.rig,
            lenses=lenses,
            moments=placed.moments,
            thing=seen,
            evidence=placed.evidence,
            overwrite=True,
        )
    tell_rig(folder, placed.rig, "place", as_json)
