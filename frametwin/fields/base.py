"""What every deformation field can do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class DeformationField(ABC):
    """A displacement d(x) of every point x of space, in mm.

    Attributes
    ----------
    kind : the name under which files hold the field.
    """

    kind: ClassVar[str]

    @abstractmethod
    def evaluate(self, points: ArrayLike) -> Floats:
        """Displacements (N, 3) in mm of the points (N, 3) in mm."""

    @abstractmethod
    def laplacian(self, points: ArrayLike) -> Floats:
        """Vector Laplacian (N, 3) of the displacement at the points (N, 3), by component, in 1 / mm."""

    @abstractmethod
    def tensors(self) -> dict[str, np.ndarray]:
        """Everything that the field consists of, as named arrays."""

    @abstractmethod
    def metadata(self) -> dict[str, str]:
        """What else is needed to build it again; texts only."""

    @classmethod
    @abstractmethod
    def restore(cls, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> DeformationField:
        """Build the field from what `tensors` and `metadata` gave.

        Raises
        ------
        KeyError, ValueError
            If something is missing or does not fit together.
        """


def checked_points(points: ArrayLike) -> Floats:
    """Points as float64 (N, 3).

    Raises
    ------
    ValueError
        For any other shape.
    """
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"points must have the shape (N, 3), not {array.shape}")
    return array


def enlarged_box(bounds: ArrayLike, margin: float = 0.1) -> Floats:
    """The computational domain: a bounding box enlarged on every side (paper, section V.B).

    Parameters
    ----------
    bounds : (2, 3) lowest and highest corner in mm.
    margin : added to each side, as a share of the longest side, so that flat frames get a domain with a
        volume.

    Returns
    -------
    (2, 3) mm.
    """
    box = np.array(bounds, dtype=np.float64)
    grown = margin * float(np.ptp(box, axis=0).max())
    return box + np.array([[-grown], [grown]])


def checked_box(box: ArrayLike) -> Floats:
    """Box (2, 3) as a read-only copy.

    Raises
    ------
    ValueError
        If it is not a box with a volume.
    """
    array = np.array(box, dtype=np.float64)
    if array.shape != (2, 3) or not np.isfinite(array).all() or not (array[1] > array[0]).all():
        raise ValueError("a field's box needs a lowest and a highest corner (2, 3) with a volume between them")
    array.setflags(write=False)
    return array
