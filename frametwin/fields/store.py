"""Deformation fields as safetensors files: named arrays and texts, nothing that runs when it is read."""

from __future__ import annotations

import importlib
import json
import os
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from frametwin.errors import InputError
from frametwin.fields.base import DeformationField
from frametwin.files import write_bytes

FORMAT = "frametwin-field"
VERSION = "1"

_KINDS = {
    "lattice": ("frametwin.fields.lattice", "LatticeField"),
    "network": ("frametwin.fields.network", "NetworkField"),
    "free": ("frametwin.fields.free", "FreeField"),
    "nodes": ("frametwin.fields.nodes", "NodesField"),
}


def save_field(path: str | os.PathLike[str], field: DeformationField) -> None:
    """Write a field; the same field gives the same bytes.

    Parameters
    ----------
    path : usually ``field.safetensors``; replaced whole or not at all.
    field : any kind.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    metadata = {**field.metadata(), "format": FORMAT, "version": VERSION, "kind": field.kind}
    tensors = {name: np.array(array, order="C") for name, array in field.tensors().items()}
    write_bytes(path, _with_metadata(save(tensors), metadata))


def load_field(path: str | os.PathLike[str]) -> DeformationField:
    """Read a field of any kind.

    Raises
    ------
    InputError
        If the file is missing, cut, of another format or version, or does not hold a whole field.
    """
    if not Path(path).is_file():
        raise InputError.at(path, "file", "does not exist", "give the field.safetensors of a run")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = dict(file.metadata() or {})
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (SafetensorError, OSError) as error:
        raise InputError.at(path, "file", f"cannot be read as safetensors ({error})", "write it anew") from error
    remedy = "give a field that this version of FrameTwin wrote"
    for key, wanted in (("format", FORMAT), ("version", VERSION)):
        if metadata.get(key) != wanted:
            raise InputError.at(path, key, f"is {metadata.get(key)!r} where {wanted!r} is needed", remedy)
    if metadata.get("kind") not in _KINDS:
        known = ", ".join(sorted(_KINDS))
        raise InputError.at(path, "kind", f"is {metadata.get('kind')!r}, which is none of {known}", remedy)
    for name, array in tensors.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise InputError.at(path, name, "holds values that are not finite", "run the fit again")
    module, name = _KINDS[metadata["kind"]]
    restore = getattr(importlib.import_module(module), name).restore
    try:
        return restore(tensors, metadata)
    except (KeyError, ValueError, RuntimeError) as error:
        raise InputError.at(path, "file", f"does not hold a whole field ({error})", remedy) from error


def _with_metadata(data: bytes, metadata: dict[str, str]) -> bytes:
    """Put texts into a safetensors file in sorted order; the library's own order changes from run to run."""
    length = int.from_bytes(data[:8], "little")
    header = {"__metadata__": dict(sorted(metadata.items())), **json.loads(data[8 : 8 + length])}
    text = json.dumps(header, separators=(",", ":")).encode("utf-8")
    text += b" " * (-len(text) % 8)  # arrays begin at a multiple of eight
    return len(text).to_bytes(8, "little") + text + data[8 + length :]
