"""What has to hold for a while before it is told: of struts, joints, views and the arm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

STANDING, AWAITED, FALLEN = 0, 1, 2
"""States of a strut."""

GONE, THERE = 0.4, 0.7
"""Share of a strut's pieces that must be gone for it to be fallen, and there for it to be laid or back."""


class Lasting:
    """Conditions that count once they have held for some time without a break.

    Parameters
    ----------
    count : int
        Number of conditions.
    least : float, s
        How long each must hold.
    """

    def __init__(self, count: int, least: float) -> None:
        self._since = np.full(count, np.nan)
        self._least = least

    def hold(self, conditions: np.ndarray, time: float) -> np.ndarray:
        """(N,) bool: those that have held long enough by now, of conditions (N,) bool at a time in s.

        At least two looks are needed, however far apart: a single picture proves nothing.
        """
        began = np.isnan(self._since) & conditions
        self._since[~conditions] = np.nan
        self._since[began] = time
        with np.errstate(invalid="ignore"):
            return conditions & ~began & (time - self._since >= self._least - 1e-9)


class StrutWatch:
    """Which struts stand.

    Parameters
    ----------
    awaited : (E,) bool array
        Struts that are to be laid; the others stand.
    patience : float, s
    """

    def __init__(self, awaited: np.ndarray, patience: float) -> None:
        self.state = np.where(awaited, AWAITED, STANDING)
        self._lasting = Lasting(len(awaited), patience)

    @property
    def standing(self) -> np.ndarray:
        """(E,) bool."""
        return self.state == STANDING

    @property
    def awaited(self) -> np.ndarray:
        """(E,) bool."""
        return self.state == AWAITED

    def look(self, gone: np.ndarray, there: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """Struts that have ``fallen``, been ``laid`` or ``returned``, by shares (E,) of their pieces gone and there."""
        other = np.where(self.standing, gone >= GONE, there >= THERE)
        sure = self._lasting.hold(other, time)
        found = {
            "fallen": np.flatnonzero(sure & self.standing),
            "laid": np.flatnonzero(sure & self.awaited),
            "returned": np.flatnonzero(sure & (self.state == FALLEN)),
        }
        self.state[found["fallen"]] = FALLEN
        self.state[found["laid"]] = self.state[found["returned"]] = STANDING
        self._lasting.hold(other & ~sure, time)
        return {kind: struts for kind, struts in found.items() if len(struts)}


class JointWatch:
    """Which joints have moved by more than a threshold since they were last told of.

    Parameters
    ----------
    positions : (V, 3) array, mm
        Where they are at first.
    threshold : float, mm
    patience : float, s
    """

    def __init__(self, positions: np.ndarray, threshold: float, patience: float) -> None:
        self._told = np.array(positions)
        self._threshold = threshold
        self._lasting = Lasting(len(positions), patience)

    def look(self, positions: np.ndarray, known: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Joints that have moved, and by how many mm.

        Parameters
        ----------
        positions : (V, 3) array, mm
        known : (V,) bool array
            Joints that are seen; of others nothing is told.
        time : float, s
        """
        far = np.linalg.norm(positions - self._told, axis=1)
        moved = np.flatnonzero(self._lasting.hold(known & (far > self._threshold), time))
        distances = far[moved]
        self._told[moved] = positions[moved]
        return moved, distances

    def forget(self, positions: np.ndarray, joints: np.ndarray) -> None:
        """Take joints (N,) for new ones, which have not moved."""
        self._told[joints] = positions[joints]


class Switch:
    """A state that is either on or off, and changes once the other has held for some time."""

    def __init__(self, count: int, on_after: float, off_after: float) -> None:
        self.on = np.zeros(count, dtype=bool)
        self._rise, self._fall = Lasting(count, on_after), Lasting(count, off_after)

    def look(self, conditions: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Indices that have come on, and that have gone off, by conditions (N,) bool."""
        rise = self._rise.hold(conditions & ~self.on, time)
        fall = self._fall.hold(~conditions & self.on, time)
        self.on = (self.on | rise) & ~fall
        return np.flatnonzero(rise), np.flatnonzero(fall)


def names_of(indices: np.ndarray, names: Sequence[str]) -> list[str]:
    """The names at indices (N,)."""
    return [names[int(i)] for i in indices]
