"""What an object file calls: asked before it is linked, since a linker that misses something ends the process.

The layout is that of ELF for 64 bits, little end first (System V ABI, "Object Files").
"""

from __future__ import annotations

import struct

MAGIC = b"\x7fELF\x02\x01"
SYMBOLS = 2
"""Type of the section that lists symbols."""

_HEADER = struct.Struct("<40xQ10xHHH")  # where the sections' headers are, their size, their number, and one of names
_SECTION = struct.Struct("<4xI16xQQI12xQ")  # type, place, size, section of names, size of an entry
_SYMBOL = struct.Struct("<I2xH16x")  # place of the name, section that has it or 0

OFFSETS = b"_GLOBAL_OFFSET_TABLE_"
"""Which every linker makes itself."""


def missing_symbols(code: bytes) -> list[str]:
    """Names of what an object file calls and does not have itself.

    Raises
    ------
    ValueError
        If it is no such file, or not whole.
    """
    if not code.startswith(MAGIC):
        raise ValueError("no object file of 64 bits")
    try:
        place, size, count, _ = _HEADER.unpack_from(code)
        sections = [_SECTION.unpack_from(code, place + k * size) for k in range(count)]
        missing = []
        for kind, start, length, names, entry in sections:
            if kind != SYMBOLS:
                continue
            first = sections[names][1]
            for at in range(start, start + length, max(entry, _SYMBOL.size)):
                name, owner = _SYMBOL.unpack_from(code, at)
                if owner == 0 and name:
                    missing.append(code[first + name : code.index(b"\0", first + name)])
    except (struct.error, IndexError) as error:
        raise ValueError("half an object file") from error
    return [name.decode() for name in missing if name != OFFSETS]
