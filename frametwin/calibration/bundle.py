"""Bundle adjustment: lenses, cameras and boards moved together until all corners are where they were seen.

B. Triggs et al., "Bundle adjustment: a modern synthesis", 1999.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from frametwin.calibration.bundle_terms import (
    Batch,
    Body,
    Bundle,
    Eye,
    Floats,
    Integers,
    Layout,
    Link,
    add_priors,
    batches_of,
    cost_of,
    link_residuals,
    moved,
    normal_equations,
    off_prior,
)

__all__ = ["Body", "Bundle", "Eye", "Link", "Solution", "solve"]

LARGEST_STEPS = 60

SETTLED = 1e-6
"""Step in px, about, after which nothing more changes."""


@dataclass(frozen=True, eq=False)
class Solution:
    """What came of it.

    Attributes
    ----------
    bundle
        With everything at its place.
    residuals
        (N, 2) px for each link: seen less computed, unweighted.
    sigma
        Standard deviation of one coordinate of a corner in px, by what is left over.
    covariance : (U, U) array
        Of all unknowns, of the size that ``sigma`` says; None if it was not asked for.
    eye_columns
        Unknowns of each camera: where its free lens parameters and its pose (turn about its own axes, centre in the
        world) stand; -1 for what is held.
    """

    bundle: Bundle
    residuals: tuple[Floats, ...]
    sigma: float
    covariance: Floats | None
    eye_columns: tuple[Integers, ...]

    def eye_covariance(self, i: int) -> Floats:
        """(P + 6, P + 6) covariance of lens and pose of a camera; zero for what is held."""
        assert self.covariance is not None
        columns = self.eye_columns[i]
        there = columns >= 0
        result = np.zeros((len(columns), len(columns)))
        result[np.ix_(there, there)] = self.covariance[np.ix_(columns[there], columns[there])]
        return result

    def rms(self, i: int) -> float:
        """Root mean square distance of the corners of a link, px."""
        return float(np.sqrt((self.residuals[i] ** 2).sum(axis=1).mean()))


def solve(
    bundle: Bundle,
    *,
    robust_px: float | None = None,
    covariance: bool = False,
    least_sigma: float = 0.0,
    steps: int = LARGEST_STEPS,
    watch: Callable[[], object] | None = None,
) -> Solution:
    """Adjust a bundle by Levenberg's and Marquardt's damped Gauss-Newton steps.

    Parameters
    ----------
    bundle
        Where to start; all that is not held is changed.
    robust_px
        Residual in px from which on corners count less and less (soft L1); None for plain least squares.
    covariance
        Whether to find the covariance.
    least_sigma
        What the covariance takes for the standard deviation of a corner (relative to its weight) at least.
    steps
        Most steps.
    watch
        Called before each step; may raise to stop.
    """
    layout = Layout(bundle)
    batches = batches_of(bundle)
    damping, cost = 1e-4, cost_of(bundle, batches, robust_px)
    for _ in range(steps if layout.count else 0):
        if watch is not None:
            watch()
        normal, gradient = normal_equations(bundle, batches, layout, robust_px)
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled, slope = normal / np.outer(scale, scale), gradient / scale
        step, trial, trial_cost = np.zeros(layout.count), bundle, cost
        while damping < 1e8:
            step = _damped_step(scaled, slope, damping)
            trial = moved(bundle, step / scale, layout)
            trial_cost = cost_of(trial, batches, robust_px)
            if trial_cost <= cost:
                break
            damping *= 10.0
        if not trial_cost <= cost:
            break
        gain, cost, bundle = cost - trial_cost, trial_cost, trial
        damping = max(0.1 * damping, 1e-12)
        if np.abs(step).max() < SETTLED or gain <= 1e-14 * cost:
            break
    left = link_residuals(bundle, batches)
    sigma = _sigma(bundle, batches, layout.count)
    matrix = _covariance(bundle, batches, layout, max(sigma, least_sigma)) if covariance else None
    return Solution(bundle, left, sigma, matrix, layout.eyes)


def _damped_step(scaled: Floats, slope: Floats, damping: float) -> Floats:
    try:
        return np.asarray(linalg.solve(scaled + damping * np.eye(len(scaled)), slope, assume_a="pos"))
    except linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(scaled + damping * np.eye(len(scaled)), slope, rcond=1e-12)[0])


def _sigma(bundle: Bundle, batches: Sequence[Batch], unknowns: int) -> float:
    """Standard deviation of a coordinate, with what the unknowns took up allowed for."""
    total, count = 2.0 * cost_of(bundle, batches, None), 2 * sum(len(link.points) for link in bundle.links)
    for eye in bundle.eyes:
        if eye.prior is not None:
            off = off_prior(eye)
            total -= float(off @ eye.prior @ off)
            count += len(eye.lens)
    return float(np.sqrt(max(total, 0.0) / max(count - unknowns, 1)))


def _covariance(bundle: Bundle, batches: Sequence[Batch], layout: Layout, sigma: float) -> Floats:
    """Inverse of the normal equations, corners as sure as sigma says; priors keep their own size."""
    without = replace(bundle, eyes=tuple(replace(eye, prior=None) for eye in bundle.eyes))
    normal = normal_equations(without, batches, layout, None)[0] / max(sigma, 1e-12) ** 2
    add_priors(bundle, layout, normal, np.zeros(layout.count))
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal * np.outer(scale, scale)
    try:
        inverse = linalg.cho_solve(linalg.cho_factor(scaled), np.eye(len(scaled)))
    except linalg.LinAlgError:
        inverse = np.linalg.pinv(scaled, hermitian=True)
    return np.asarray(0.5 * (inverse + inverse.T) * np.outer(scale, scale))
