"""``frametwin dataset view``: one page with every sample."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.common import FOLDER, json_option, print_facts, print_json, quiet_option, workers_option
from frametwin.cli.display import Display


@click.command("view", short_help="Write a page that shows every sample, with plan, truth and twin drawn over.")
@click.argument("folder", type=FOLDER, metavar="DIR")
@click.option(
    "--out",
    type=FOLDER,
    metavar="FILE",
    help="The page to write; its pictures go beside it.  [default: DIR/index.html]",
)
@workers_option
@quiet_option
@json_option
def view_command(folder: Path, out: Path | None, workers: int, quiet: bool, as_json: bool) -> None:
    """Write a page that shows the dataset in DIR: every view of every sample with plan, truth and twin drawn over.

    It opens in a browser from disk, with no server and no network. Samples can be sorted by error and filtered; a
    click on one shows its pictures at full size, layer by layer, with errors and specification. The page needs its
    pictures beside it, and the dataset where it is.

    \b
    Examples:
      frametwin dataset view out/demo
      frametwin dataset view out/demo --out pages/demo.html
    """
    from frametwin.dataset.view import write_page

    with Display(quiet) as display:
        page = write_page(folder, out, workers=workers, progress=display)
    if as_json:
        print_json({"dataset": folder, "page": page.path, "samples": page.samples, "fitted": page.fitted})
        return
    print_facts(
        f"page: {page.path}",
        [("samples", f"{page.samples}, {page.fitted} of them fitted"), ("open", page.path.absolute().as_uri())],
    )
