"""Data in a page of HTML."""

from __future__ import annotations

import json
from typing import Any


def script_json(value: Any) -> str:
    """JSON that may stand in a script: nothing in it can end the script or begin a comment.

    Raises
    ------
    ValueError
        If there is a number in it that JSON does not have, such as NaN.
    """
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for char in ("<", ">", "&", "\u2028", "\u2029"):
        text = text.replace(char, f"\\u{ord(char):04x}")
    return text
