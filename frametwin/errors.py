"""The errors that a user can cause; commands turn each class into an exit code."""

from __future__ import annotations

import os
import re


class FrameTwinError(Exception):
    """Base of every error that FrameTwin raises on purpose (exit code 1 unless a subclass says otherwise)."""


class InputError(FrameTwinError):
    """The user's input cannot be used (exit code 2): one sentence naming file, field and remedy."""

    @classmethod
    def at(cls, path: str | os.PathLike[str], field: str, problem: str, remedy: str) -> InputError:
        """Build the sentence ``PATH: FIELD: problem; remedy.`` on a single line.

        Parameters
        ----------
        path
            The file or folder (or another name of the source) that is at fault.
        field
            The field inside it, such as ``edges[3]``, or ``file`` when the whole file is meant.
        problem
            What is wrong, in words that need no knowledge of the code.
        remedy
            What to do about it, without the full stop.
        """
        sentence = f"{os.fspath(path)}: {field}: {problem}; {remedy}."
        return cls(re.sub(r"\s*[\r\n]\s*", " ", sentence))


class Cancelled(FrameTwinError):
    """The work was stopped by the user or by a callback (exit code 130)."""
