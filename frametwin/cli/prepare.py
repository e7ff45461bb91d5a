"""``frametwin prepare``: compile what the other commands need, so that the first fit does not wait for it."""

from __future__ import annotations

import click

from frametwin.cli.common import json_option, print_facts, print_json, quiet_option
from frametwin.cli.display import Display


@click.command("prepare", short_help="Compile what fits and prints need, once after installing.")
@quiet_option
@json_option
def command(quiet: bool, as_json: bool) -> None:
    """Compile the loops of fits and prints, once after installing; from then on every command starts at once.

    Without it the first fit on a machine takes a minute or two longer. It may be stopped and called again: what was
    compiled is kept. After an update it compiles what has changed.

    \b
    Examples:
      frametwin prepare --json
      frametwin prepare --quiet
    """
    from frametwin.service.prepare import prepare

    with Display(quiet) as display:
        done = prepare(display)
    if as_json:
        print_json({"compiled": [vars(each) for each in done]})
        return
    print_facts("compiled", [(each.name, f"{each.seconds:.1f} s") for each in done])
