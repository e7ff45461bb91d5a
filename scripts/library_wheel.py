"""The wheel of the library as the Blender extension carries it, under a version that changes with what is in it.

Blender unpacks a wheel of an extension only where no wheel of that name and version is unpacked already. The library's
own version stays the same from one release to the next, so that an extension that was built again would go on with the
library of the one before. A local version (PEP 440), as ``+h5f0c2a91b3d7`` behind it, tells the two apart; pip takes it
where the version itself is asked for.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path

DIGITS = 12
"""Hexadecimal digits of the content's hash."""


def stamp(wheel: Path) -> Path:
    """Give a wheel the local version of its content, in place of one that it may have.

    Parameters
    ----------
    wheel
        The file, which is replaced.

    Returns
    -------
    Its new path, beside the old one.
    """
    name, version, *tags = wheel.stem.split("-")
    public, old = version.partition("+")[0], f"{name}-{version}.dist-info/"
    with zipfile.ZipFile(wheel) as archive:
        members = {each.removeprefix(old): archive.read(each) for each in archive.namelist() if not each.endswith("/")}
        own = {each.removeprefix(old) for each in archive.namelist() if each.startswith(old)}
    members["METADATA"] = _with_version(members["METADATA"], public)
    del members["RECORD"]
    stamped = f"{public}+h{_digest(members)}"
    members["METADATA"] = _with_version(members["METADATA"], stamped)
    new = f"{name}-{stamped}.dist-info/"
    placed = {f"{new}{each}" if each in own else each: data for each, data in members.items()}
    record = f"{new}RECORD"
    made = wheel.with_name("-".join([name, stamped, *tags]) + ".whl")
    wheel.unlink()
    with zipfile.ZipFile(made, "w") as archive:
        for path, data in {**placed, record: _record(placed, record)}.items():
            archive.writestr(zipfile.ZipInfo(path), data, zipfile.ZIP_DEFLATED)  # without the time: the same each time
    return made


def _digest(members: Mapping[str, bytes]) -> str:
    """Of names and content, in whatever order they come."""
    whole = hashlib.sha256()
    for path in sorted(members):
        whole.update(f"{path}\0{hashlib.sha256(members[path]).hexdigest()}\n".encode())
    return whole.hexdigest()[:DIGITS]


def _with_version(metadata: bytes, version: str) -> bytes:
    return re.sub(rb"^Version: .*$", f"Version: {version}".encode(), metadata, count=1, flags=re.MULTILINE)


def _record(members: Mapping[str, bytes], own: str) -> bytes:
    """The list of all files of a wheel with their hashes, and of itself without one."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    for path, data in members.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        rows.writerow([path, f"sha256={digest}", len(data)])
    rows.writerow([own, "", ""])
    return text.getvalue().encode()
