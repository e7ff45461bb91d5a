"""The errors that FrameTwin raises on purpose: each carries the parts of its sentence, and each class an exit code."""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

PARTS = ("source", "field", "problem", "remedy")


class FrameTwinError(Exception):
    """Base of every error that FrameTwin raises on purpose.

    Attributes
    ----------
    source : str
        The file or folder (or another name of the source) that is at fault.
    field : str
        The field inside it, such as ``edges[3]``, or ``file`` when the whole file is meant.
    problem : str
        What is wrong, in words that need no knowledge of the code.
    remedy : str
        What to do about it, without the full stop.
    exit_code : int
        With which a command ends that fails so.
    kind : str
        What the worker's protocol calls such an error.

    Notes
    -----
    The four parts are empty where an error was made of a whole sentence, and not by `at`. They survive copying and
    whatever else carries exceptions from one process to another.
    """

    exit_code: ClassVar[int] = 1
    kind: ClassVar[str] = "failed"

    source: str = ""
    field: str = ""
    problem: str = ""
    remedy: str = ""

    @classmethod
    def at(cls, source: str | os.PathLike[str], field: str, problem: str, remedy: str) -> Self:
        """An error of four parts, whose text is the sentence ``SOURCE: FIELD: problem; remedy.`` on a single line."""
        error = cls()
        error._take(os.fspath(source), field, problem, remedy)
        return error

    @property
    def parts(self) -> dict[str, str]:
        """The four parts by name; empty where the error was made of a whole sentence."""
        return {name: getattr(self, name) for name in PARTS} if self.source else {}

    def inside(self, source: str | os.PathLike[str]) -> Self:
        """The same problem as one of ``source``, which holds what is at fault: ``SOURCE: OLD SOURCE: FIELD: ...``."""
        told = copy.copy(self)
        if self.source:
            told._take(os.fspath(source), f"{self.source}: {self.field}", self.problem, self.remedy)
        else:
            told.args = (f"{os.fspath(source)}: {self}",)
        return told

    def with_field(self, field: str) -> Self:
        """The same problem under another name of its field: the one by which its user knows it."""
        told = copy.copy(self)
        told._take(self.source, field, self.problem, self.remedy)
        return told

    def rename(self, hidden: str, shown: str) -> None:
        """Name a file or folder that the user knows in place of one that stood in for it."""
        self.args = tuple(arg.replace(hidden, shown) if isinstance(arg, str) else arg for arg in self.args)
        for name, text in self.parts.items():
            setattr(self, name, text.replace(hidden, shown))

    def as_dict(self) -> dict[str, Any]:
        """Kind, sentence and parts for JSON; `error_from` is the way back."""
        return {"kind": self.kind, "message": str(self), **self.parts}

    def _take(self, *parts: str) -> None:
        for name, text in zip(PARTS, parts, strict=True):
            setattr(self, name, text)
        sentence = f"{self.source}: {self.field}: {self.problem}; {self.remedy}."
        self.args = (re.sub(r"\s*[\r\n]\s*", " ", sentence),)


class InputError(FrameTwinError):
    """The user's input cannot be used: one sentence naming file, field and remedy."""

    exit_code = 2
    kind = "input"


@dataclass(frozen=True)
class Doubt:
    """A reason not to print on.

    Attributes
    ----------
    kind : str
        Its name, by which it can be accepted.
    problem, remedy : str
        What is wrong and what to do, in words.
    """

    kind: str
    problem: str
    remedy: str


class Held(FrameTwinError):
    """A print job stops, and nothing is written, as printing on would build on something else than what is there.

    Nobody has typed anything wrong: somebody has to look at the print, or at the cameras.

    Attributes
    ----------
    doubts : tuple of Doubt
        All reasons, the first of which the sentence tells.
    """

    exit_code = 3
    kind = "held"

    doubts: tuple[Doubt, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Kind, sentence, parts and doubts for JSON."""
        return {**super().as_dict(), "doubts": [asdict(doubt) for doubt in self.doubts]}


class Cancelled(FrameTwinError):
    """The work was stopped by the user or by a callback."""

    exit_code = 130
    kind = "cancelled"


_BY_KIND: dict[str, type[FrameTwinError]] = {error.kind: error for error in (InputError, Held, Cancelled)}


def error_from(data: Mapping[str, Any]) -> FrameTwinError:
    """The error that `FrameTwinError.as_dict` wrote down; of the base class where the kind is another one."""
    error = _BY_KIND.get(data["kind"], FrameTwinError)(data["message"])
    for name in PARTS:
        setattr(error, name, data.get(name, ""))
    if isinstance(error, Held):
        error.doubts = tuple(Doubt(**doubt) for doubt in data.get("doubts", ()))
    return error
