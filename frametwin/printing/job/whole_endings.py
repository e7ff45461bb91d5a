"""Whether files that somebody else writes are whole, by how they end."""

from __future__ import annotations

import os
from pathlib import Path

PNG_END = b"IEND\xaeB`\x82"
JPEG_END = b"\xff\xd9"
_READ = 64
"""Bytes that are read: JSON may end in white space."""


def ends_whole(path: Path) -> bool:
    """Whether a picture or a JSON file ends as a whole one does; never of kinds whose end tells nothing.

    A PNG file ends with a chunk of its own (ISO/IEC 15948:2004, 11.2.5), a JPEG file with a marker (ITU-T T.81,
    B.1.1.3), and an object in JSON with its bracket.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    kind = path.suffix.lower()
    with open(path, "rb") as stream:
        stream.seek(-min(_READ, stream.seek(0, os.SEEK_END)), os.SEEK_END)
        end = stream.read()
    if kind == ".png":
        return end.endswith(PNG_END)
    if kind in (".jpg", ".jpeg"):
        return end.endswith(JPEG_END)
    return kind == ".json" and end.rstrip().endswith(b"}")
