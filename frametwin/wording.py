"""Struts in sentences."""

from __future__ import annotations

from collections.abc import Iterable


def listed(struts: Iterable[int], most: int = 8) -> str:
    """Struts by number: "strut 3", "struts 3 and 4", "struts 3, 4 and 20 others"."""
    words = [str(int(strut)) for strut in struts]
    if len(words) > most:
        return f"struts {', '.join(words[:most])} and {len(words) - most} others"
    if len(words) == 1:
        return f"strut {words[0]}"
    return f"struts {', '.join(words[:-1])} and {words[-1]}"


def having(struts: Iterable[int], most: int = 8) -> str:
    """Struts as a subject: "strut 3 has", "struts 3 and 4 have"."""
    words = listed(struts, most)
    return f"{words} {'has' if words.startswith('strut ') else 'have'}"
