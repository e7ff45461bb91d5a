"""What is told of a print while it is followed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from frametwin.wording import enumerated, having, listed

KINDS = ("moved", "fallen", "returned", "laid", "arm", "clear", "view-lost", "view-back", "batch")


@dataclass(frozen=True)
class Event:
    """Something that has happened to the print or before the cameras.

    Attributes
    ----------
    kind : str
        One of `KINDS`: joints have ``moved`` by more than the threshold since they were last told of; struts have
        ``fallen``, ``returned``, or been ``laid``; the ``arm`` has come into views, or all of them are ``clear`` of it;
        a view is lost, or back; a job has gone on to another ``batch``.
    time : float, s
        When the picture was taken, by the stream's clock.
    frame : int
        Number of the moment in the stream, from 0.
    facts : mapping
        For programs: ``joints``, ``distances`` (mm) and ``positions`` (mm); ``struts``; ``views``; ``answerable`` and
        ``awaited``; ``batch``.
    """

    kind: str
    time: float
    frame: int
    facts: Mapping[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """As for a line of JSON."""
        return {"kind": self.kind, "time": self.time, "frame": self.frame, **self.facts}

    def __str__(self) -> str:
        return _SENTENCES[self.kind](self.facts)


def _moved(facts: Mapping[str, Any]) -> str:
    joints, far = facts["joints"], facts["distances"]
    worst = max(range(len(joints)), key=lambda k: far[k])
    if len(joints) == 1:
        return f"joint {joints[0]} has moved by {far[0]:.2f} mm"
    return f"{len(joints)} joints have moved, joint {joints[worst]} by {far[worst]:.2f} mm"


def _clear(facts: Mapping[str, Any]) -> str:
    if facts["awaited"]:
        return f"nothing but the print is in view; still to be laid: {listed(facts['awaited'])}"
    if "batch" in facts:
        return f"nothing but the print is in view: batch {facts['batch']} can be answered"
    return "nothing but the print is in view"


def _view_lost(facts: Mapping[str, Any]) -> str:
    verbs = ("disagrees", "shows") if len(facts["views"]) == 1 else ("disagree", "show")
    return f"{enumerated(facts['views'])} {verbs[0]} with the other views, or {verbs[1]} nothing"


def _view_back(facts: Mapping[str, Any]) -> str:
    verb = "agrees" if len(facts["views"]) == 1 else "agree"
    return f"{enumerated(facts['views'])} {verb} with the other views again"


_SENTENCES = {
    "moved": _moved,
    "fallen": lambda facts: f"{having(facts['struts'])} fallen",
    "returned": lambda facts: f"{having(facts['struts'])} come back",
    "laid": lambda facts: f"{having(facts['struts'])} been laid",
    "arm": lambda facts: f"something else than the print is in view of {enumerated(facts['views'])}",
    "clear": _clear,
    "view-lost": _view_lost,
    "view-back": _view_back,
    "batch": lambda facts: f"the job has gone on to batch {facts['batch']}",
}
