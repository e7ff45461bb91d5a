"""Folders that a worker is to make, and how nothing of them is left."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

from frametwin.files import PathLike, missing_parents, remove_leftovers


class NewFolder:
    """A folder that is to be made by somebody else, whole or not at all; remembers what was there before.

    Parameters
    ----------
    path
        The folder. If it is there already, it is nobody's to remove.
    """

    def __init__(self, path: PathLike) -> None:
        self.path = Path(os.path.realpath(path))
        self._is_new = not self.path.exists()
        self._made = missing_parents(self.path)

    def remove(self) -> None:
        """Remove the folder, which its maker is known to have finished, and what `remove_leftovers` does."""
        if self._is_new:
            shutil.rmtree(self.path, ignore_errors=True)
        self.remove_leftovers()

    def remove_leftovers(self) -> None:
        """Remove what a maker that was killed has left beside it, and parents made for it if they are empty."""
        remove_leftovers(self.path)
        for parent in self._made:
            with contextlib.suppress(OSError):
                parent.rmdir()
