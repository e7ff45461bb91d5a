"""Make the paper's tables and figures again, and a page that shows them beside the paper's.

    python scripts/reproduce_paper.py --out out/evidence --quick        reduced settings, for two quiet cores
    python scripts/reproduce_paper.py --out out/evidence                the paper's settings: hours
    python scripts/reproduce_paper.py --out out/evidence --only table1 views --pavilion FILE
    python scripts/reproduce_paper.py --out out/evidence --only none --page docs    the page anew, from what is there

Each case is a process of its own and leaves one JSON file. A case that is there already is not run again, so the
command goes on where it was stopped, by Ctrl-C or otherwise. Results with reduced settings lie beside those of full
size; the page shows those of full size where there are any. The Pavilion is not among the frames that come with the
project or lie beside it: give its file.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import NoReturn

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for the modules beside this one

from frametwin.errors import InputError
from scripts.command import exit_code, say
from scripts.evidence.cases import EXPERIMENTS, PAPER_FRAMES, Case, cases_of, plan_of
from scripts.evidence.figures import EVIDENCE, fill_pages
from scripts.evidence.records import read_records, write_record
from scripts.evidence.runs import EverySoOften, run_all


def parser() -> argparse.ArgumentParser:
    """The options."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="of the results")
    result.add_argument("--quick", action="store_true", help="reduced settings")
    result.add_argument("--only", nargs="+", choices=[*EXPERIMENTS, "none"], default=list(EXPERIMENTS), metavar="NAME")
    result.add_argument("--pavilion", type=Path, metavar="FILE", help="the frame of that name, in any format")
    result.add_argument("--page", type=Path, metavar="FOLDER", help="where to write the page; the results' by default")
    result.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    return result


def work(options: argparse.Namespace) -> int:
    """Run what is missing and write the page; 1 if a case failed."""
    plan = plan_of(options.quick, options.pavilion)
    cases = cases_of(plan, tuple(options.only))
    if options.one:
        return run_one(options.out, next(c for c in cases if [c.experiment, c.name] == options.one))

    def command(case: Case) -> list[str]:
        words = [__file__, "--out", str(options.out), "--only", case.experiment, "--one", case.experiment, case.name]
        pavilion = [] if options.pavilion is None else ["--pavilion", str(options.pavilion)]
        return [*words, *pavilion, *(["--quick"] if options.quick else [])]

    if find_spec("matplotlib") is None:
        raise InputError.at("Python", "matplotlib", "is not installed", "install it, as the set-up of the README does")
    if cases and (absent := [name for name in PAPER_FRAMES if name not in plan.frames]):
        say(f"Without these frames of the paper, which are not here: {', '.join(absent)}.")
    failed = run_all(cases, options.out, command, say)
    from scripts.evidence.page import write_page  # draws, which the runs need not wait for

    page = write_page(options.page or options.out, read_records(options.out))
    say(f"The page is {page}.")
    if page.parent.resolve() == EVIDENCE.parent:  # the project's own page, whose figures others show as well
        for filled in fill_pages():
            say(f"Its figures are now in {filled} too.")
    return 1 if failed else 0


def run_one(out: Path, case: Case) -> int:
    """Run a case in this process and write its result."""
    from scripts.evidence.measure import measured

    try:
        result = measured(case, EverySoOften(say))
    except KeyboardInterrupt:  # the process that runs all cases tells of it
        return 130
    write_record(out, case, {**result, "processor_seconds": round(process_time(), 1)})
    return 0


def interrupt(*_: object) -> NoReturn:
    """What a wish to end does."""
    raise KeyboardInterrupt


def main(words: Sequence[str] | None = None) -> int:
    """Run the command; its exit code."""
    options = parser().parse_args(words)
    signal.signal(signal.SIGTERM, interrupt)
    return exit_code(lambda: work(options))


if __name__ == "__main__":
    sys.exit(main())
