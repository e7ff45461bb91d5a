"""``frametwin calibrate``: boards to print, and cameras calibrated from pictures of them."""

from __future__ import annotations

import click

from frametwin.cli.calibrate_board import board_command
from frametwin.cli.calibrate_check import check_command
from frametwin.cli.calibrate_lenses import intrinsics_command
from frametwin.cli.calibrate_poses import extrinsics_command, place_command


@click.group("calibrate", short_help="Calibrate cameras: board, intrinsics, extrinsics, place, check.")
def command() -> None:
    """From cameras to a rig: each lens, where the cameras stand, and where the robot's world is.

    A RIG is a folder: the cameras with how well each is known (rig.json), the same for other tools
    (transforms.json), and a page to look at (report.html). Lengths are in mm; every command has --json, for programs.

    \b
    A sheet to print:   frametwin calibrate board --kind charuco --out board.pdf
    Each lens:          frametwin calibrate intrinsics PICTURES --board charuco:7x5:25 --out RIG
    Their places:       frametwin calibrate extrinsics RIG MOMENTS
    The robot's world:  frametwin calibrate place RIG OBJECT --object cuboid --at 300,0,0
    Then, each time:    frametwin capture RIG PICTURES --frame PLAN --out CAPTURE
    Touched since?      frametwin calibrate check RIG CAPTURE

    A BOARD is written KIND:COLUMNSxROWS:SQUARE_MM[:MARKER_MM[:DICTIONARY]]. Columns and rows are inner corners of a
    checkerboard, squares of a ChArUco board, tags of an AprilGrid; the square of an AprilGrid is the distance from one
    tag to the next. "cuboid" is the block of 50 x 60 x 70 mm with markers on its five visible faces.
    """


for _command in (board_command, intrinsics_command, extrinsics_command, place_command, check_command):
    command.add_command(_command)
