"""``frametwin print next`` and ``frametwin print watch``: the answer to a batch, and to each batch as it appears."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin.cli.calibrate_common import Place
from frametwin.cli.common import FOLDER, json_option, print_facts, print_json, quiet_option
from frametwin.cli.display import Display
from frametwin.cli.job_page import page_option, write_page
from frametwin.cli.print_common import accept_option
from frametwin.errors import InputError
from frametwin.wording import shortened

if TYPE_CHECKING:
    from frametwin.printing.job.job import PrintJob
    from frametwin.printing.job.raw_pictures import RawPictures


def reprint_option(function: Any) -> Any:
    """Add ``--reprint/--no-reprint``."""
    return click.option(
        "--reprint/--no-reprint",
        default=None,
        help="Lay lost struts again at the start of the next batch.  [default: as the job was planned]",
    )(function)


@click.command("next", short_help="Answer a batch with its pictures: twin, adapted plan, next waypoints.")
@click.argument("job", type=FOLDER)
@click.option(
    "--capture",
    type=FOLDER,
    required=True,
    help="The pictures: a folder with cameras and images/.",
)
@accept_option
@reprint_option
@page_option
@click.option("--cold", is_flag=True, help="Start the fit afresh and not from the last twin; slower, for comparison.")
@quiet_option
@json_option
def next_command(
    job: Path,
    capture: Path,
    accept: tuple[str, ...],
    reprint: bool | None,
    page: bool,
    cold: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Find the twin of the batch that was printed last, move what is still to come, write the next batch's waypoints.

    CAPTURE needs the cameras (transforms.json, or a COLMAP model) and the pictures that they name; background/ is
    used if it is there. The plan comes from the job. All that was read is copied into JOB/batches/NNN.

    The job stops in one sentence, and nothing is written, where printing on would build on something else than what is
    there: pictures of another batch or old ones, struts that are lost where others start, a twin that the views do
    not determine there, or that does not fit the pictures. --accept KIND goes on all the same.

    Exit codes: 0 answered, 1 failed, 2 the capture or the command line cannot be used, 3 the job holds (see above),
    130 interrupted.

    \b
    Examples:
      frametwin print next out/job --capture out/captures/000
      frametwin print next out/job --capture out/captures/007 --reprint
      frametwin print next out/job --capture out/captures/007 --accept lost-struts
    """
    from frametwin.printing.job.answer import AnswerOptions
    from frametwin.printing.job.job import PrintJob
    from frametwin.printing.job.summaries import answer_summary

    work = PrintJob(job)
    options = AnswerOptions(accept=frozenset(accept), reprint=reprint, warm=not cold)
    with Display(quiet) as display:
        report = work.answer(capture, options, display)
    if as_json:
        print_json({"job": job, **answer_summary(work, report)})
    else:
        print_facts(f"batch {report['batch']} of {job}", answer_facts(work, report))
    if page:
        with Display(quiet) as display:
            write_page(job, display)


@click.command("watch", short_help="Answer each new capture folder as it appears, until the print is finished.")
@click.argument("job", type=FOLDER)
@click.argument("captures", type=FOLDER)
@accept_option
@reprint_option
@page_option
@click.option(
    "--rig", type=FOLDER, help="Folders of CAPTURES hold raw pictures, named after the cameras of this calibrated rig."
)
@click.option(
    "--base", type=Place(), help="With --rig: where the plan's origin stands in the robot's base.  [default: 0,0,0]"
)
@click.option("--background", type=FOLDER, metavar="PICTURES", help="With --rig: the same views before printing.")
@click.option(
    "--every", type=click.FloatRange(0.05, 3600.0), default=0.1, show_default=True, help="Seconds between two looks."
)
@quiet_option
@json_option
def watch_command(**options: Any) -> None:
    """Answer every capture folder that appears in CAPTURES, in the order of their names, until JOB is finished.

    A folder is taken when transforms.json and all the pictures it names are there and have stopped growing: at once
    where they are PNG or JPEG files, whose end tells, else after half a second. One that
    cannot be used, or for which the job is held (see frametwin print next --help), is told of and left alone until
    it changes; nothing is printed on meanwhile. Ctrl-C stops at once, and the same command goes on. The exit code is 0
    when the print is finished, whatever was passed over, and 130 after Ctrl-C.

    With --rig a folder is taken when it holds a picture of each of the rig's cameras: whatever takes the pictures only
    has to save them.

    \b
    Examples:
      frametwin print watch out/job out/captures
      frametwin print watch out/job shots --rig rig --base 400,0,20 --background before
    """
    _watch(WatchOptions(**options))


@dataclass(frozen=True)
class WatchOptions:
    """The command line of watching for captures; see its help."""

    job: Path
    captures: Path
    accept: tuple[str, ...]
    reprint: bool | None
    page: bool
    rig: Path | None
    base: tuple[float, ...] | None
    background: Path | None
    every: float
    quiet: bool
    as_json: bool


def _watch(options: WatchOptions) -> None:
    from frametwin.printing.job.answer import AnswerOptions
    from frametwin.printing.job.job import PrintJob
    from frametwin.printing.job.summaries import answer_summary
    from frametwin.printing.job.watch import Watch

    raw = _raw_pictures(options)
    work = PrintJob(options.job)
    with Display(quiet=True) as display:
        look = Watch(
            work,
            options.captures,
            AnswerOptions(accept=frozenset(options.accept), reprint=options.reprint),
            say=(lambda sentence: None) if options.quiet else (lambda sentence: click.echo(sentence, err=True)),
            progress=display,
            poll=options.every,
            answered=(lambda report: write_page(options.job)) if options.page else (lambda report: None),
            raw=raw,
        )
        reports = look.run()
    if options.as_json:
        print_json({"job": options.job, "answered": [answer_summary(work, report) for report in reports]})
        return
    from frametwin.cli.print_status import tell_status

    tell_status(work)


def _raw_pictures(options: WatchOptions) -> RawPictures | None:
    if options.rig is None:
        for name, value in (("--base", options.base), ("--background", options.background)):
            if value is not None:
                raise InputError.at(name, "rig", "is missing", "give --rig too: captures hold their own cameras")
        return None
    from frametwin.cameras.rig_file import read_rig
    from frametwin.cameras.standing import standing_at
    from frametwin.printing.job.raw_pictures import RawPictures

    base = None if options.base is None else standing_at(options.base)
    return RawPictures(read_rig(options.rig), base, options.background)


def answer_facts(job: PrintJob, report: dict[str, Any]) -> list[tuple[str, str]]:
    """The same for people."""
    facts = [
        ("struts", f"{len(report['laid'])} laid, {report['standing']} of {job.design.strut_count} stand"),
        ("lost", shortened(report["lost"]) + (", laid again next" if report["again"] else "")),
        ("from the design", f"{report['e_max']:.2f} mm at most"),
    ]
    twin = report.get("twin")
    if twin is not None:
        facts.append(("since the last twin", f"{twin['largest_displacement']:.2f} mm at most"))
        facts.append(("twin", f"{report['seconds']['twin']:.1f} s, {twin['start']} start"))
    facts += [("accepted", f"{doubt['kind']}: {doubt['problem']}") for doubt in report["accepted"]]
    facts.append(("time", f"{report['seconds']['total']:.1f} s"))
    following = job.current
    if following is None:
        facts.append(("next", "nothing; the print is finished"))
        return facts
    summary = job.waypoint_summary(following)
    facts += [("contact", sentence) for sentence in summary["contacts"]]
    place = job.batch_folder(following) / "waypoints"
    facts.append(("next", f"batch {following}, {len(summary['struts'])} struts: print {place}"))
    return facts
