"""The group of all commands, and what becomes of errors: exit codes and one sentence each."""

from __future__ import annotations

import gc
import importlib
import sys
from typing import Any

import click

from frametwin import __version__
from frametwin.cli import interrupts
from frametwin.errors import Cancelled, FrameTwinError, InputError

COMMANDS = (
    "demo",
    "simulate",
    "calibrate",
    "capture",
    "mask",
    "fit",
    "track",
    "evaluate",
    "report",
    "print",
    "dataset",
    "convert",
    "info",
    "prepare",
)
"""In the order in which they are listed; each is a module of this package with a ``command``."""

DONE, WRONG_INPUT, INTERRUPTED = 0, InputError.exit_code, Cancelled.exit_code
"""Other errors bring their exit codes with them; see `frametwin.errors`."""


class Commands(click.Group):
    """Commands whose modules are imported when they are needed, and whose errors become exit codes."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of a command."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"frametwin.cli.{cmd_name}").command
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run; an interrupt counts as cancelled, so that click does not print an empty line for it."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            raise Cancelled("interrupted") from interrupt

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run a command line and leave the process with its exit code; see `click.Command.main`."""
        sys.exit(self._run(*args, **{"prog_name": "frametwin", **extra, "standalone_mode": False}))

    def _run(self, *args: Any, **extra: Any) -> int:
        try:
            result = super().main(*args, **extra)
            return result if isinstance(result, int) else DONE
        except click.exceptions.UsageError as error:
            return _usage(error)
        except click.ClickException as error:
            return _say(error.format_message(), error.exit_code)
        except (Cancelled, KeyboardInterrupt, click.Abort):
            return _say("Interrupted.", INTERRUPTED)
        except FrameTwinError as error:
            return _say(str(error), error.exit_code)
        except Exception:
            if not interrupts.requested():
                raise
            return _say("Interrupted.", INTERRUPTED)  # an interrupt may surface as another error


def _say(sentence: str, code: int) -> int:
    click.echo(" ".join(sentence.split()), err=True)
    return code


def _usage(error: click.UsageError) -> int:
    """One sentence on what is wrong with the command line, and where help is; the help itself if asked for."""
    if error.ctx is None or isinstance(error, getattr(click.exceptions, "NoArgsIsHelpError", ())):
        error.show()
        return WRONG_INPUT
    path = error.ctx.command_path
    message = error.format_message().rstrip(".")
    return _say(f"{path}: {message}; see '{path} --help'.", WRONG_INPUT)


@click.command(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, message="frametwin %(version)s")
def cli() -> None:
    """Find where every strut of a wireframe print really is, from its plan and about eight pictures.

    \b
    Try it:            frametwin demo
    Your own pictures: frametwin fit CAPTURE --out RUN
    No pictures yet:   frametwin simulate FRAME --out CAPTURE

    A FRAME is the plan: frame.json, an OBJ with lines, a DXF drawing, a Rhino model, a mesh, the JSON of an
    assembly or of COMPAS, a pair of Node/Edge text files, or one of the built-in frames bridge, half_bowl and
    lattice_tower. A CAPTURE is a folder with the plan (frame.json), the cameras (transforms.json, or a COLMAP
    model) and the pictures (images/). A RUN is the folder that a fit writes: the digital twin (twin.json) and
    the field of its deformation. Lengths are in mm.

    \b
    Exit codes (from 1 to 3, one sentence on standard error says what is wrong and what to do):
      0    done
      1    failed
      2    the input or the command line cannot be used
      3    a print job holds: look at the print before you print on
      130  interrupted

    Output folders are written whole or not at all.
    """


def main() -> None:
    """Entry point of the command ``frametwin``."""
    interrupts.install()
    try:
        cli()
    finally:
        interrupts.ignore()
        gc.freeze()  # at the end of the process the interpreter looks at every object thrice, for a tenth of a second
