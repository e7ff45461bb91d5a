"""Light of a print from the directions in which its surface faces.

Matt surfaces show the light that comes from all around; as a function of their normal it is so smooth that nine
spherical harmonics hold it to within a few per cent (Ramamoorthi and Hanrahan, An Efficient Representation for
Irradiance Environment Maps, 2001). They are fitted to the pixels that are surely print. The rim of one strut that is
turned away from the light is then known from others of which that side faces the camera, and a dark side is no longer
taken for background. What the model lacks, such as shadows, is a factor that is smooth nearby.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.imaging.light import spread

FEWEST = 200
"""Pixels of print from which its shading is told."""

DARKEST = 0.05
"""Least light of a side, as a share of the typical one's: there is light from all around in any room."""

FACTORS = (0.1, 5.0)
"""Least and greatest factor of light, by which shadows and sheen change what the model says."""

RIM = 0.5
"""How far the change of that factor from the middle of a strut to its side goes on to the rim."""

_SURE = 0.5  # weight of pixels from which the model is told
_MOST_PIXELS = 20_000
_ROUNDS = 5
_OUTLYING = 1.5  # times the median rest, from which a pixel counts less
_RIDGE = 1e-4  # for normals that no strut of the view has


def harmonics(normals: np.ndarray) -> np.ndarray:
    """The nine spherical harmonics (..., 9) up to the second order, not normalised, of unit normals (..., 3)."""
    x, y, z = normals[..., 0], normals[..., 1], normals[..., 2]
    return np.stack([np.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3.0 * z * z - 1.0], axis=-1)


def shading(light: np.ndarray, terms: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Coefficients (K, 3) with which terms (N, K) explain light (N, 3), by robust least squares with weights (N,)."""
    counted = weight
    coefficients = np.zeros((terms.shape[1], 3))
    for _ in range(_ROUNDS):
        normal = terms.T @ (terms * counted[:, None])
        normal += _RIDGE * np.trace(normal) / len(normal) * np.eye(len(normal))
        coefficients = np.linalg.solve(normal, terms.T @ (light * counted[:, None]))
        rest = np.abs(light - terms @ coefficients).mean(axis=1)
        counted = weight / (1.0 + (rest / (_OUTLYING * np.median(rest) + 1e-9)) ** 2)
    return coefficients


def shaded_light(
    light: np.ndarray, normals: np.ndarray, seeds: np.ndarray, sigmas: tuple[Sequence[float], Sequence[float]]
) -> np.ndarray:
    """Light of the print (H, W, 3), known at some pixels, carried on to where its surface faces elsewhere.

    Parameters
    ----------
    light, normals : (H, W, 3) float32
        Of the photograph; and of the print, 0 where there is none.
    seeds : (H, W) float32
        Weight of each pixel that is print.
    sigmas
        Fine and wide windows in pixels, see `frametwin.imaging.light.spread`, over which the factor of light is told
        that the model lacks. How it changes from wide to fine is carried on.
    """
    usual, around = (spread(light, seeds, windows) for windows in sigmas)
    faced = (normals != 0.0).any(axis=-1)
    rows, columns = np.nonzero(faced & (seeds > _SURE))
    if len(rows) < FEWEST:
        return usual
    chosen = slice(None, None, max(1, len(rows) // _MOST_PIXELS))
    rows, columns = rows[chosen], columns[chosen]
    known = light[rows, columns]
    coefficients = shading(known, harmonics(normals[rows, columns]), seeds[rows, columns])
    least = np.maximum(DARKEST * np.median(known, axis=0), 1e-4)
    model = np.ones_like(light) * known.mean(axis=0)
    model[faced] = np.maximum(harmonics(normals[faced]) @ coefficients, least)
    factor, wide = (
        seen / np.maximum(spread(model, seeds, windows), 1e-6)
        for seen, windows in zip((usual, around), sigmas, strict=True)
    )
    factor = np.clip(factor + RIM * (factor - wide), 0.4 * factor, 1.8 * factor)
    return np.asarray(np.where(faced[..., None], np.clip(factor, *FACTORS) * model, usual), dtype=np.float32)
