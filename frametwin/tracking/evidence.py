"""What each view says of each piece of strut: there, not there, or nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frametwin.fitting.fast_settings import Stage
from frametwin.raster import rods
from frametwin.raster.rods import Rods
from frametwin.tracking.sight import Sight

PLAIN = 0.2
"""A view says something of a piece that it has in plain view on this share of the pixels of the typical one."""

BRIGHT, DARK = 0.6, 0.4
"""Share of a piece's pixels that are white, above which it is there, and below which it is not."""

WHITE = 0.8
"""The same share from which a piece is believed where an arm is known to be in the view."""

MOST_DARK = 0.7
"""A piece is gone if it is dark in so large a share of the views that have it in plain view."""

FEWEST = 2
"""Views that have to have a piece in plain view before it can be called gone."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """The verdict of N views on E struts of P pieces.

    Attributes
    ----------
    weight : (N, E, P) array, pixels
        How much of each piece is in plain view, on pixels that count.
    white : (N, E, P) array, 0..1
        How much of that is white.
    """

    weight: np.ndarray
    white: np.ndarray

    @classmethod
    def of(cls, drawn: Rods, sight: Sight, stage: Stage) -> Evidence:
        """Ask every view by itself."""
        level = sight.level(stage)
        through, residual = sight.compared(drawn, stage)
        found = []
        for view in range(len(level.cameras)):
            one = slice(view, view + 1)
            alone = replace(level, cameras=level.cameras[one], shapes=level.shapes[one], offsets=level.offsets[one])
            found.append(rods.opacity_terms(drawn, alone, through, residual))
        evidence = np.array(found)  # (N, E, P, 2)
        weight = evidence[..., 0]
        white = drawn.opacity - evidence[..., 1] / np.maximum(weight, 1e-12)
        return cls(weight, np.clip(white, 0.0, 1.0))

    def of_views(self, chosen: np.ndarray) -> Evidence:
        """That of some of the views (N,) bool alone."""
        return Evidence(self.weight[chosen], self.white[chosen])

    @property
    def plain(self) -> np.ndarray:
        """(N, E, P) bool: pieces of which a view says something."""
        some = self.weight[self.weight > 0.0]
        return self.weight > PLAIN * float(np.median(some)) if some.size else np.zeros(self.weight.shape, dtype=bool)

    @property
    def votes(self) -> tuple[np.ndarray, np.ndarray]:
        """(E, P) views in which each piece is bright, and in which it is dark."""
        plain = self.plain
        return (plain & (self.white > BRIGHT)).sum(axis=0), (plain & (self.white < DARK)).sum(axis=0)

    @property
    def gone(self) -> np.ndarray:
        """(E,) share of each strut's pieces that nearly all views show to be not there."""
        bright, dark = self.votes
        return ((dark >= FEWEST) & (dark >= MOST_DARK * (dark + bright))).mean(axis=1)

    @property
    def there(self) -> np.ndarray:
        """(E,) share of each strut's pieces that most views show to be there."""
        bright, dark = self.votes
        return ((bright >= FEWEST) & (bright > dark)).mean(axis=1)

    @property
    def hidden(self) -> np.ndarray:
        """(N, E, P) bool: pieces that are dark in a view while most others show them."""
        bright, dark = self.votes
        return self.plain & (self.white < DARK) & ((bright >= FEWEST) & (bright > dark))

    @property
    def doubtful(self) -> np.ndarray:
        """(N, E, P) bool: pieces that are not quite white in a view while some others show them."""
        bright, _ = self.votes
        return self.plain & (self.white < WHITE) & (bright >= FEWEST)
