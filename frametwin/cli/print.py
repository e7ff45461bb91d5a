"""``frametwin print``: plan a print, check it, answer its batches, watch for them, and simulate the whole loop."""

from __future__ import annotations

import click

from frametwin.cli.print_check import check_command
from frametwin.cli.print_next import next_command, watch_command
from frametwin.cli.print_plan import plan_command
from frametwin.cli.print_simulate import simulate_command
from frametwin.cli.print_status import status_command


@click.group("print", short_help="Print adaptively: plan, check, answer batches, watch, simulate.")
def command() -> None:
    """Adaptive printing: after each batch the twin moves the struts that are still to come.

    A JOB is a folder. It holds the design, the order of its struts, and for every batch the plan that the robot
    follows, its waypoints, the pictures taken afterwards, the twin, and the plan for what follows. All of it can be
    read by hand. A job that is stopped or killed goes on where it was; no batch is answered twice or left out. Lengths
    are in mm; every command has --json, for programs. The exit code 3 says that a job holds: nothing is wrong with what
    was typed, but somebody has to look at the print or the cameras.

    \b
    By hand:         frametwin print plan FRAME --out JOB
                     print the waypoints of JOB/batches/000, take pictures
                     frametwin print next JOB --capture CAPTURE
                     print those of JOB/batches/001, take pictures, and so on
    Hands off:       frametwin print watch JOB CAPTURES
    Where are we?    frametwin print status JOB
    Is it right?     frametwin print check JOB
    Without a robot: frametwin print simulate bridge --out JOB
    """


for _command in (plan_command, check_command, next_command, watch_command, status_command, simulate_command):
    command.add_command(_command)
