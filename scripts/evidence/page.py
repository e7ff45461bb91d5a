"""The page that shows all results, made of nothing but their files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from frametwin.files import write_json, write_text
from scripts.evidence.plots import FIGURES, draw
from scripts.evidence.records import FORMAT, Record
from scripts.evidence.tables import SECTIONS

NAME = "evidence"
HEAD = """---
hide: [toc]
---

# Evidence

The paper's tables and figures, made again by `scripts/reproduce_paper.py`, which has also written this page; the
results are in `evidence.json` beside it. The paper's own captures and truths are not published: ours are simulated, 8
views of 1600x1200 of a sag of 7 % of the extent with one strut in four not hardened. How far the paper's frames sag is
not told, so errors are to be compared by their order. `paper` is the paper's method, `fast` the project's own.
"""
STARRED = """
A star marks a fit with reduced settings (`--quick`): 6 samples on a strut instead of 50, pictures of a quarter of their
width, 512 points of the bending term instead of 2048; of `curve-driven` 5,000 steps instead of 10,000, of
`deformation-driven` 3,000 instead of 40,000, and 1,500 and 600 on the cube.
"""


def page(records: Sequence[Record]) -> str:
    """The text, of all experiments of which there is a result."""
    there = {record["conditions"]["experiment"] for record in records}
    parts = [HEAD + (STARRED if any(record["conditions"]["quick"] for record in records) else "")]
    for experiment, section in SECTIONS.items():
        if experiment in there:
            parts.append(section(records))
            parts += [f"![{title}]({NAME}/{name}.png)\n" for name, (title, _) in FIGURES.get(experiment, {}).items()]
    return "\n".join(parts)


def write_page(folder: Path, records: Sequence[Record]) -> Path:
    """Write the page, its figures and all results in one file beside it.

    Raises
    ------
    InputError
        If they cannot be written there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for experiment in {record["conditions"]["experiment"] for record in records}:
        draw(folder / NAME, experiment, records)
    write_json(folder / f"{NAME}.json", {"format": f"{FORMAT}-page", "version": 1, "records": list(records)})
    write_text(folder / f"{NAME}.md", page(records))
    return folder / f"{NAME}.md"
