"""The page of a report: the template with styles, scripts, the library that draws in 3D and the data in it."""

from __future__ import annotations

import html
from importlib import resources
from typing import Any

from frametwin import __version__
from frametwin.script_json import script_json

TEMPLATE, STYLE, LIBRARY, LICENCE = "report.html", "report.css", "three.min.js", "three.LICENSE.txt"
SCRIPTS = ("data.js", "charts.js", "model.js", "photographs.js", "report.js")
"""In the order in which they need each other."""


def page(content: dict[str, Any]) -> str:
    """One HTML file that needs nothing from elsewhere.

    Parameters
    ----------
    content
        As `frametwin.report.run_report.run_content` and its siblings give it; no NaN in it.
    """
    parts = {
        "<!--TITLE-->": html.escape(f"{content['title']} \u00b7 FrameTwin report"),
        "/*STYLE*/": _asset(STYLE),
        "/*LICENCE*/": html.escape(_asset(LICENCE)),
        "/*LIBRARY*/": _script(_asset(LIBRARY)),
        "/*SCRIPTS*/": _script("\n".join(_asset(name) for name in SCRIPTS)),
        "/*DATA*/": script_json({"version": __version__, **content}),
    }
    pieces = [_asset(TEMPLATE)]
    for mark, text in parts.items():  # split, so that no mark is looked for in what was put in
        place = next(i for i, piece in enumerate(pieces) if mark in piece and i % 2 == 0)
        before, after = pieces[place].split(mark, 1)
        pieces[place : place + 1] = [before, text, after]
    return "".join(pieces)


def _script(text: str) -> str:
    """A script that may stand in a page: nothing in it can end its element."""
    return text.replace("</script", "<\\/script")


def _asset(name: str) -> str:
    return resources.files("frametwin.report").joinpath("assets", name).read_text(encoding="utf-8")
