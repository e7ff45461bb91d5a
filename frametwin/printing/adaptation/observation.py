"""How far joints moved while a batch was printed, as twins saw it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.adapt import AdaptSettings, lost_struts
from frametwin.twin.twin import Twin


@dataclass(frozen=True, eq=False)
class Observation:
    """How far joints drifted in a batch, as the twin saw it.

    Attributes
    ----------
    batch
        Its number.
    drift : (V, 3) array, mm
        From where the twin before saw the joint, or from where it was to be laid; 0 where nothing is known.
    known : (V,) bool array
        The twin tells where the joint is.
    struts
        How many were laid in the batch.
    """

    batch: int
    drift: np.ndarray
    known: np.ndarray
    struts: int = 1

    @classmethod
    def of(
        cls,
        batch: int,
        plan: Wireframe,
        twin: Twin,
        *,
        before: np.ndarray | None = None,
        struts: int = 1,
        settings: AdaptSettings | None = None,
    ) -> Observation:
        """What a twin of ``plan`` saw, ``printed`` being what it was asked for.

        Parameters
        ----------
        batch
            Its number.
        plan, twin
            What was expected, and what was found.
        before : (V, 3) array, mm, optional
            Where the joints were when the batch began, and where new ones were to be laid; default those of ``plan``.
        struts
            How many were laid in the batch.
        settings
            Of which struts the twin is believed; see `AdaptSettings`.
        """
        settings = AdaptSettings() if settings is None else settings
        sure = plan.printed & (twin.confidence >= settings.confidence)
        sure[lost_struts(plan, twin, settings)] = False
        known = plan.replace(printed=sure).printed_vertices() & ~plan.grounded
        start = plan.vertices if before is None else before
        return cls(batch, np.where(known[:, None], twin.vertices - start, 0.0), known, struts)
