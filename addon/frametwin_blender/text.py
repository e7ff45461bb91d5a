"""Sentences cut into lines that fit."""

from __future__ import annotations


def wrapped(text: str, width: int) -> list[str]:
    """Lines of at most ``width`` characters; long words such as paths are cut behind a slash, or anywhere."""
    lines = [""]
    for word in text.split():
        while len(word) > width:
            at = max(word.rfind("/", 1, width), word.rfind("\\", 1, width)) + 1 or width
            if lines[-1]:
                lines.append("")
            lines[-1] = word[:at]
            lines.append("")
            word = word[at:]
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return [line for line in lines if line]
