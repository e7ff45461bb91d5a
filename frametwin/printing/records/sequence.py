"""The order in which the struts of a frame are laid: which, from which end, with which tool axis, in which batch."""

from __future__ import annotations

import dataclasses
from dataclasses import InitVar, dataclass

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe


@dataclass(frozen=True, eq=False)
class PrintSequence:
    """Directed struts in the order in which they are laid. All arrays are checked, copied and read-only.

    Attributes
    ----------
    struts : (N,) int64 array
        Indices of the frame's struts; each at most once.
    start : (N,) int64 array
        Vertex at which each strut is begun: one of its ends.
    axis : (N, 3) array
        Unit vectors along the tool, from the nozzle's tip upwards, while each strut is laid.
    batch : (N,) int64 array
        Rising from 0: the cameras look after the last strut of each. Numbers are left out where all struts of a batch
        were lost and are laid again in a later one.

    Raises
    ------
    InputError
        If the arrays do not fit each other; the message names ``source``.
    """

    struts: np.ndarray
    start: np.ndarray
    axis: np.ndarray
    batch: np.ndarray
    source: InitVar[str] = "sequence"

    def __post_init__(self, source: str) -> None:
        struts = checked_array(self.struts, "i", (None,), source, "struts")
        count = len(struts)
        arrays = {
            "struts": struts,
            "start": checked_array(self.start, "i", (count,), source, "start"),
            "axis": checked_array(self.axis, "f", (count, 3), source, "axis"),
            "batch": checked_array(self.batch, "i", (count,), source, "batch"),
        }
        if count == 0:
            raise InputError.at(source, "struts", "is empty", "give at least one strut")
        if len(np.unique(struts)) != count or struts.min() < 0:
            raise InputError.at(source, "struts", "names a strut twice, or one below 0", "name each strut once")
        if np.abs(np.linalg.norm(arrays["axis"], axis=1) - 1.0).max() > 1e-6:
            raise InputError.at(source, "axis", "holds vectors of another length than 1", "give unit vectors")
        if arrays["batch"][0] != 0 or (np.diff(arrays["batch"]) < 0).any():
            raise InputError.at(source, "batch", "does not rise from 0", "number the batches 0, 1, 2 ...")
        for name, value in arrays.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.struts)

    @property
    def batch_count(self) -> int:
        """Number of batches."""
        return int(self.batch[-1]) + 1

    def in_batch(self, batch: int) -> PrintSequence:
        """The struts of one batch alone, in their order, as batch 0.

        Raises
        ------
        InputError
            If it has none, or none any more.
        """
        mask = self.batch == batch
        if not mask.any():
            problem = f"{batch} has no struts, or none that are not laid again later"
            raise InputError.at("sequence", "batch", problem, "give the number of another one")
        return dataclasses.replace(
            self,
            struts=self.struts[mask],
            start=self.start[mask],
            axis=self.axis[mask],
            batch=np.zeros(int(mask.sum()), dtype=np.int64),
            source="sequence",
        )

    def end_in(self, frame: Wireframe) -> np.ndarray:
        """Find the vertex at which each strut ends.

        Returns
        -------
        (N,) int64 array

        Raises
        ------
        InputError
            If the sequence is not one of this frame.
        """
        if self.struts.max() >= frame.strut_count:
            problem = f"names strut {int(self.struts.max())} of a frame with {frame.strut_count}"
            raise InputError.at(frame.name, "sequence", problem, "give the sequence of this frame")
        ends = frame.edges[self.struts]
        wrong = np.flatnonzero((ends != self.start[:, None]).all(axis=1))
        if len(wrong):
            problem = f"strut {int(self.struts[wrong[0]])} does not begin at vertex {int(self.start[wrong[0]])}"
            raise InputError.at(frame.name, "sequence", problem, "give the sequence of this frame")
        return np.where(ends[:, 0] == self.start, ends[:, 1], ends[:, 0])

    def part(self, struts: np.ndarray, vertices: np.ndarray) -> PrintSequence:
        """The order of some struts alone, as a sequence of `Wireframe.subset`.

        Parameters
        ----------
        struts : (E,) bool array
            Those of the frame to keep.
        vertices : (V',) int64 array
            The frame's vertices that they use, rising.
        """
        kept = struts[self.struts]
        return dataclasses.replace(
            self,
            struts=(np.cumsum(struts) - 1)[self.struts[kept]],
            start=np.searchsorted(vertices, self.start[kept]),
            axis=self.axis[kept],
            batch=np.unique(self.batch[kept], return_inverse=True)[1],
            source="sequence",
        )

    def laid_before(self, batch: int, strut_count: int) -> np.ndarray:
        """Mark the struts of a frame (E,) that are laid in an earlier batch."""
        mask = np.zeros(strut_count, dtype=bool)
        mask[self.struts[self.batch < batch]] = True
        return mask

    def directed_curves(self, frame: Wireframe) -> np.ndarray:
        """Give control points (N, 4, 3) in mm of the struts in their order, each from its start to its end."""
        self.end_in(frame)
        curves = frame.control_points[self.struts]
        backwards = frame.edges[self.struts, 0] != self.start
        return np.where(backwards[:, None, None], curves[:, ::-1], curves)
