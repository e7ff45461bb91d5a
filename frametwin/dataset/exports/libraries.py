"""Packages that only some formats need, and what to do where they are missing."""

from __future__ import annotations

import importlib
from typing import Any

from frametwin.errors import InputError


def needed(module: str, package: str, kind: str) -> Any:
    """Import a module for a format.

    Raises
    ------
    InputError
        If it is not installed; the sentence has the command that installs it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        problem = f"{kind} needs the package {package}, which cannot be imported ({error})"
        remedy = 'run python -m pip install "frametwin[exports]"'
        raise InputError.at("settings", "format", problem, remedy) from error
