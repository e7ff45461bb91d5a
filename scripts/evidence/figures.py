"""Tables in README and docs that are filled from the evidence, so that nobody types a figure of ours by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from frametwin.errors import InputError
from frametwin.files import read_json, read_text, write_text
from scripts.evidence import paper
from scripts.evidence.cases import PAPER_FRAMES
from scripts.evidence.records import Record, best
from scripts.evidence.tables import errors, pair, table

ROOT = Path(__file__).resolve().parents[2]
EVIDENCE = ROOT / "docs" / "evidence.json"
BEGIN, END = "<!-- evidence: {} -->", "<!-- end of evidence -->"
"""What stands before and after a table."""


def in_short(records: Sequence[Record]) -> str:
    """The table of the README: `fast` beside the paper."""
    columns = [
        "frame",
        "struts",
        "`fast`, processor seconds",
        "`fast`, error",
        "the paper, seconds",
        "the paper, error",
    ]
    return table(columns, [[*row[:3], row[3], row[-2], row[-1]] for row in _rows(records)])


def in_full(records: Sequence[Record]) -> str:
    """The table of the page of figures."""
    columns = ["frame", "struts", "processor seconds", "curves mean / max", "joints mean / max",
               "equal parameter mean / max", "peak MB", "the paper: seconds on an RTX 4090", "mean / max"]  # fmt: skip
    return table(columns, _rows(records))


def _rows(records: Sequence[Record]) -> list[list[str]]:
    found = best(records, "table1")
    rows = []
    for frame in PAPER_FRAMES:
        record = found.get(f"{frame}-fast")
        if record is not None:
            result = record["result"]
            ours = [errors(record, group) for group in ("curves", "joints", "equal_parameter")]
            theirs = [f"{paper.SECONDS[frame]:.0f}", pair(paper.ERRORS[frame])]
            costs = [f"{result['processor_seconds']:.0f}", f"{result['megabytes']:.0f}"]
            rows.append([frame, str(result["struts"]), costs[0], *ours, costs[1], *theirs])
    return rows


TABLES: dict[str, Callable[[Sequence[Record]], str]] = {"fast": in_short, "fast in full": in_full}
PAGES = (ROOT / "README.md", ROOT / "docs" / "figures.md")


def filled(text: str, records: Sequence[Record], source: Path) -> str:
    """A page with its tables as the evidence has them.

    Raises
    ------
    InputError
        If a table begins that does not end.
    """
    for name, maker in TABLES.items():
        begin = BEGIN.format(name)
        before, found, rest = text.partition(begin)
        if not found:
            continue
        _, end, after = rest.partition(END)
        if not end:
            raise InputError.at(source, begin, "does not end", f"write {END} behind the table")
        text = f"{before}{begin}\n\n{maker(records)}\n{END}{after}"
    return text


def fill_pages(evidence: Path = EVIDENCE, pages: Sequence[Path] = PAGES) -> list[Path]:
    """Fill the tables of pages; those that have changed are written and returned."""
    records = read_json(evidence)["records"]
    changed = []
    for page in pages:
        text = read_text(page)
        new = filled(text, records, page)
        if new != text:
            write_text(page, new)
            changed.append(page)
    return changed


if __name__ == "__main__":
    for written in fill_pages():
        print(written)
