"""Twins and batches of a print job shown by how far they are from another; what came of it stays with the object."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import idprop
import numpy as np

from frametwin.blender.display.colouring import colour_struts, legend_of
from frametwin.blender.display.print_jobs import ROLE_KEY
from frametwin.blender.display.statistics import StrutValues
from frametwin.blender.display.twin_records import store_column
from frametwin.blender.display.twins import TwinObjects
from frametwin.blender.frames.strut_curves import (
    Attribute,
    Sampling,
    first_points,
    read_attribute,
    recorded_frame,
    recorded_struts,
    write_attribute,
)
from frametwin.errors import InputError
from frametwin.geometry.nearest import distances_to_curves
from frametwin.twin.comparison import Comparison, check_comparable, compare_struts

KEY = "frametwin_compared"
DIFFERENCE = "difference"
"""The quantity, and the attribute of points, with the distance in mm."""

MOST = 5
"""How many of the struts that moved most are kept."""

WHOLE = 0.5
"""A strut is compared if at least this share of it is there on both sides."""


@dataclass(frozen=True)
class Compared:
    """What came of a comparison: with what, over how many struts, mm, and the struts that are farthest."""

    other: str
    count: int
    mean: float
    largest: float
    struts: tuple[int, ...]
    distances: tuple[float, ...]

    @property
    def words(self) -> str:
        """All of it in a line."""
        if not self.count:
            return f"No strut is both here and in {self.other}"
        apart = f"{self.mean:.3g} mm from {self.other} on average, {self.largest:.3g} mm at most"
        return f"{self.count} struts compared: {apart} (strut {self.struts[0]})"


def compare_twins(before: TwinObjects, after: TwinObjects) -> Compared:
    """Work out how far a twin is from another of the same struts, as attribute and quantity of the second.

    Raises
    ------
    InputError
        If they are of other struts, or one has lost what its run holds.
    """
    old, new = before.frame(), after.frame()
    check_comparable(old, new, before.collection.name)
    there = _whole(before) & _whole(after)
    old_curves, new_curves = before.curves(), after.curves()
    comparison = compare_struts(old_curves, new_curves, there)
    store_column(after.collection, StrutValues(DIFFERENCE, "mm", comparison.of_strut))
    _write_distances(after.twin, np.where(there[:, None, None], old_curves, np.nan), new_curves)
    return _remember(after.twin, comparison, before.collection.name, np.arange(new.strut_count))


def _whole(shown: TwinObjects) -> np.ndarray:
    """(E,) whether a strut is there, not only a rest of it; NaN of what is not printed is less than anything."""
    return np.asarray(shown.values["completeness"].values >= WHOLE)


def compare_batches(job: bpy.types.Collection, first: int, second: int) -> Compared:
    """Colour what stands after one batch of a job by how far it is from where it stood after another.

    Raises
    ------
    InputError
        If the job has no such batches, or nothing stands in one of them.
    """
    before, after = (standing_in(job, batch) for batch in (first, second))
    if before == after:
        raise InputError.at(f"job {job.name}", "batches", "are one and the same", "choose two of them")
    old, new = recorded_frame(before), recorded_frame(after)
    numbers = recorded_struts(after)
    _, at_old, at_new = np.intersect1d(recorded_struts(before), numbers, return_indices=True)
    curves = np.full(new.control_points.shape, np.nan)
    curves[at_new] = old.control_points[at_old]
    there = np.zeros(new.strut_count, dtype=bool)
    there[at_new] = True
    comparison = compare_struts(curves, new.control_points, there)
    _write_distances(after, curves, new.control_points)
    colour_struts(after, StrutValues(DIFFERENCE, "mm", comparison.of_strut))
    return _remember(after, comparison, f"batch {first}", numbers)


def leave_batches(job: bpy.types.Collection) -> None:
    """Colour all batches of a job by their displacement from the design again, over one range."""
    standing = [obj for obj in job.all_objects if obj.get(ROLE_KEY) == "standing"]
    legends = [legend for obj in standing if KEY not in obj and (legend := legend_of(obj)) is not None]
    for obj in [obj for obj in standing if KEY in obj]:
        del obj[KEY]
        values = read_attribute(obj.data, "displacement_mean").astype(np.float64)
        top = legends[0].high if legends else None
        colour_struts(obj, StrutValues("displacement", "mm", values), 0.0, top)


def standing_in(job: bpy.types.Collection, batch: int) -> bpy.types.Object:
    """What stands after a batch of a job.

    Raises
    ------
    InputError
        If there is no such batch, or nothing stands.
    """
    batches = list(job.children)
    if not 0 <= batch < len(batches):
        problem = f"{batch} is none of the {len(batches)} that are shown"
        raise InputError.at(f"job {job.name}", "batch", problem, f"give 0 to {len(batches) - 1}")
    found = next((obj for obj in batches[batch].objects if obj.get(ROLE_KEY) == "standing"), None)
    if found is None:
        raise InputError.at(f"job {job.name}", f"batch {batch}", "has nothing that stands", "choose another batch")
    return found


def comparison_of(obj: bpy.types.Object) -> Compared | None:
    """What an object was compared with last; ``None`` if with nothing."""
    group = obj.get(KEY)
    if not isinstance(group, idprop.types.IDPropertyGroup):
        return None
    struts, distances = (tuple(group.get(name, ())) for name in ("struts", "distances"))
    return Compared(str(group["other"]), int(group["count"]), group["mean"], group["largest"], struts, distances)


def _write_distances(obj: bpy.types.Object, before: np.ndarray, after: np.ndarray) -> None:
    """Write the distance of an object's points on curves (E, n + 1, 3) from others such; NaN where those are."""
    sampling = Sampling.of(np.diff(first_points(obj.data)) - 1)
    known = np.isfinite(before[:, 0, 0])[sampling.strut]
    point, _ = sampling.points(after)
    distance = np.full(len(point), np.nan)
    distance[known] = distances_to_curves(point[known], before[sampling.strut[known]])
    write_attribute(obj.data, DIFFERENCE, Attribute("FLOAT", distance))
    obj.data.update_tag()


def _remember(obj: bpy.types.Object, comparison: Comparison, other: str, numbers: np.ndarray) -> Compared:
    most = comparison.moved_most(MOST)
    found = Compared(
        other,
        int(comparison.compared.sum()),
        comparison.mean,
        comparison.largest,
        tuple(numbers[most].tolist()),
        tuple(comparison.of_strut[most].tolist()),
    )
    kept = {"other": other, "count": found.count, "mean": found.mean, "largest": found.largest}
    lists = {"struts": found.struts, "distances": found.distances} if found.count else {}  # none may be empty
    obj[KEY] = {**kept, **lists}
    return found
