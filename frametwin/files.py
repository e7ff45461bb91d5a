"""Files and folders, read strictly and written whole or not at all: the names that other modules take from here."""

from frametwin.staged_folders import missing_parents, remove_leftovers, staged_directory, swap_in
from frametwin.strict_json import check_format, dump_json, parse_json, read_json, write_json
from frametwin.whole_files import (
    PathLike,
    decode_text,
    file_hash,
    read_bytes,
    read_text,
    synced_together,
    write_bytes,
    write_text,
)

__all__ = [
    "PathLike",
    "check_format",
    "decode_text",
    "dump_json",
    "file_hash",
    "missing_parents",
    "parse_json",
    "read_bytes",
    "read_json",
    "read_text",
    "remove_leftovers",
    "staged_directory",
    "swap_in",
    "synced_together",
    "write_bytes",
    "write_json",
    "write_text",
]
