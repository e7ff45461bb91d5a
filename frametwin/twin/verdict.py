"""Whether a twin is to be trusted, in one word and with reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from frametwin.errors import InputError

GOOD, DOUBTFUL, WRONG = "good", "doubtful", "wrong"
STATUSES = (GOOD, DOUBTFUL, WRONG)


@dataclass(frozen=True)
class Verdict:
    """What a fit thinks of its own twin.

    Attributes
    ----------
    status : str
        One of `STATUSES`.
    reasons : tuple of str
        Why it is not good, in words; the gravest first. Notes on a good one, such as views that were left out.
    """

    status: str = GOOD
    reasons: tuple[str, ...] = ()

    @classmethod
    def of(cls, wrong: Sequence[str], doubtful: Sequence[str], notes: Sequence[str] = ()) -> Verdict:
        """The worst of what was found."""
        status = WRONG if wrong else DOUBTFUL if doubtful else GOOD
        return cls(status, (*wrong, *doubtful, *notes))

    @classmethod
    def checked(cls, value: Any, source: str) -> Verdict:
        """A verdict out of JSON, or as it is.

        Raises
        ------
        InputError
            If it is not one.
        """
        given = dict(value) if isinstance(value, Mapping) else vars(value) if isinstance(value, cls) else {}
        status, reasons = given.get("status"), given.get("reasons")
        if status not in STATUSES:
            raise InputError.at(source, "verdict.status", f"is {status!r}", f"write one of {', '.join(STATUSES)}")
        if not isinstance(reasons, list | tuple) or not all(isinstance(reason, str) for reason in reasons):
            raise InputError.at(source, "verdict.reasons", "is not a list of texts", 'write ["...", ...]')
        return cls(status, tuple(reasons))
