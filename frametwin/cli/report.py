"""``frametwin report``: one page of a run, a print job or a dataset."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.common import FOLDER, json_option, print_facts, print_json, quiet_option
from frametwin.cli.display import Display


@click.command("report", short_help="Write one page that shows a run, a print job or a dataset.")
@click.argument("source", type=FOLDER, metavar="RUN|JOB|DATASET")
@click.option(
    "--out", type=FOLDER, required=True, metavar="PAGE", help="The page to write, ending in .html; it is replaced."
)
@click.option("--capture", type=FOLDER, metavar="CAPTURE", help="Of a RUN: what it was made from, for its pictures.")
@click.option("--truth", type=FOLDER, metavar="FRAME", help="Of a RUN: the real geometry.  [default: the capture's]")
@quiet_option
@json_option
def command(source: Path, out: Path, capture: Path | None, truth: Path | None, quiet: bool, as_json: bool) -> None:
    """Write one HTML page that shows a RUN, a JOB or a DATASET; it needs no server and no network.

    The twin can be turned in 3D and is coloured by displacement, error, standard deviation or completeness, with the
    plan as a ghost; a click on a strut gives its numbers, lengths in mm. Below are the verdict, the worst struts in the
    photographs, and all views with outlines over them. A job has its batches on a slider, and can be looked at while it
    runs: write the page again after a batch. Of a dataset the samples with the largest errors are shown.

    \b
    Examples:
      frametwin report RUN --capture CAPTURE --out report.html
      frametwin report JOB --out JOB/report.html
      frametwin report out/demo --out demo.html
    """
    from frametwin.report import write_report

    with Display(quiet) as display:
        report = write_report(source, out, capture=capture, truth=truth, progress=display)
    if as_json:
        print_json({"source": source, "page": report.path, "kind": report.kind, "scenes": report.scenes})
        return
    facts = [("shows", f"a {report.kind}"), ("size", f"{report.size / 1e6:.1f} MB")]
    print_facts(f"page: {report.path}", [*facts, ("open", report.path.absolute().as_uri())])
