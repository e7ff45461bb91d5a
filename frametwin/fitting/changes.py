"""Settings that can be changed by name."""

from __future__ import annotations

import dataclasses
from typing import Any, Self

from frametwin.checked_json import name_problem


class Changeable:
    """Base of settings dataclasses."""

    def replace(self, **changes: Any) -> Self:
        """A copy with other values in some settings, checked anew.

        Raises
        ------
        InputError
            If a setting is unknown or out of its range.
        """
        known = [f.name for f in dataclasses.fields(self)]  # type: ignore[arg-type]
        for name in changes:
            if name not in known:
                raise name_problem("settings", name, "is not a setting", known)
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]
