"""The page of a checked print job that a robot's operator signs: one sheet of paper."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path

from frametwin import __version__
from frametwin.errors import InputError
from frametwin.files import write_json, write_text
from frametwin.printing.job.sign_off import FAIL, SignOff

MOST_FAULTS = 12
"""That are listed on the page."""

MOST_BATCHES = 30

_STYLE = """
body { font: 10pt/1.35 system-ui, sans-serif; max-width: 180mm; margin: 8mm auto; padding: 0 4mm; color: #111; }
h1 { font-size: 14pt; margin: 0 0 1mm; } h2 { font-size: 10.5pt; margin: 4mm 0 1mm; }
table { border-collapse: collapse; width: 100%; } td, th { text-align: left; padding: .4mm 2mm .4mm 0; }
th { font-weight: 600; border-bottom: .3mm solid #999; } td.n, th.n { text-align: right; }
.FAIL { color: #b00020; font-weight: 700; } .verdict { font-weight: 700; margin: 1mm 0 2mm; }
code { font-size: 8pt; word-break: break-all; } .sign td { padding-top: 7mm; border-bottom: .3mm solid #111; }
@media print { body { margin: 0; } }
"""


def write_check(path: Path, page: SignOff) -> None:
    """Write a page that ends in ``.html``, or the same as ``.json``; whole or not at all.

    Raises
    ------
    InputError
        If the name ends otherwise, or the file cannot be written.
    """
    check_name(path)
    if path.suffix.lower() == ".json":
        write_json(path, page.as_dict())
    else:
        write_text(path, html_page(page))


def check_name(path: Path) -> None:
    """Refuse a name that says nothing of the kind of file.

    Raises
    ------
    InputError
        If it ends neither in .html nor in .json.
    """
    if path.suffix.lower() not in (".html", ".json"):
        raise InputError.at(path, "out", "ends neither in .html nor in .json", "give a name that does")


def html_page(page: SignOff) -> str:
    """The page, which needs nothing from elsewhere."""
    check = page.check
    lines = _rows([(line.name, line.result, line.told) for line in page.lines], marked=1)
    faults = "".join(f"<li>{escape(str(fault))}</li>" for fault in check.faults[:MOST_FAULTS])
    more = len(check.faults) - MOST_FAULTS
    faults += f"<li>and {more} more</li>" if more > 0 else ""
    batches = _rows(
        [
            (
                str(look.batch),
                str(len(look.struts)),
                str(look.waypoints),
                f"{look.length:.0f}",
                f"{look.seconds / 60.0:.1f}",
                f"{look.air:.3g}" if look.nearest else "",
                " ".join(f"{name} {digest[:8]}" for name, digest in look.files.items()),
            )
            for look in check.looks[:MOST_BATCHES]
        ]
    )
    left = len(check.looks) - MOST_BATCHES
    batches += f"<tr><td colspan=7>and {left} more batches</td></tr>" if left > 0 else ""
    head = "<th>batch<th>struts<th>waypoints<th>mm laid<th>min<th>mm of air<th>files, first digits of their SHA-256"
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{escape(page.job)} &middot; print check</title><style>{_STYLE}</style>
<h1>Print check: {escape(page.job)}</h1>
<p>{escape(page.design)}, {page.struts} struts in {page.batches} batches; {check.waypoints} waypoints of
{len(check.batches)} batches looked at, at {check.poses} poses of the tool. FrameTwin {__version__}.</p>
<p class="verdict {"" if check.fine else FAIL}">{escape(page.verdict)}</p>
<table><tr><th>check<th>result<th>what was found</tr>{lines}</table>
{f"<h2>Faults</h2><ul>{faults}</ul>" if faults else ""}
<h2>Batches</h2><table><tr>{head}</tr>{batches}</table>
<h2>Signed off</h2>
<table class="sign"><tr><td>Name<td>Date<td>Signature</tr></table>
</html>
"""


def text_lines(page: SignOff) -> list[tuple[str, str]]:
    """The same for a terminal, as names and values."""
    lines = [(line.name, f"{line.result:<5} {line.told}".rstrip()) for line in page.lines]
    minutes = sum(look.seconds for look in page.check.looks) / 60.0
    laid = sum(look.length for look in page.check.looks)
    counts = f"{page.check.waypoints} waypoints, {page.check.poses} poses, {laid:.0f} mm laid in {minutes:.1f} min"
    return [("looked at", counts), *lines, ("verdict", page.verdict)]


def _rows(rows: Iterable[tuple[str, ...]], marked: int | None = None) -> str:
    """Rows of a table; the cell in one column is marked by what it says."""
    return "".join(
        "<tr>"
        + "".join(
            f"<td{f' class={cell}' if k == marked and cell == FAIL else ''}>{escape(cell)}"
            for k, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
