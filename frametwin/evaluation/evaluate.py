"""How far a twin is from the truth: between the curves, at the joints, and at equal parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.evaluation.curve_distance import CurveSet, counts_by_length, points_at, ragged
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

SAMPLES = 48
"""Intervals between samples on a strut of median length; longer ones take more."""


@dataclass(frozen=True)
class Statistics:
    """Mean, 95th percentile and maximum in mm; weighted by length for curves, plain for joints."""

    mean: float
    p95: float
    max: float

    @classmethod
    def of(cls, values: np.ndarray, weights: np.ndarray | None = None) -> Statistics:
        """Statistics of values (N,), at least one, with weights (N,) that are equal by default."""
        weights = np.ones(len(values)) if weights is None else weights
        order = np.argsort(values)
        passed = np.cumsum(weights[order])
        p95 = values[order][np.searchsorted(passed, 0.95 * passed[-1])]
        return cls(float(np.average(values, weights=weights)), float(p95), float(values.max()))


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of a twin in mm. What is not printed, or missing in the truth, is NaN in the arrays.

    Attributes
    ----------
    curves
        Distance between the two sets of curves, both ways: from points of each to the nearest of the other.
    joints
        Distance between each joint of the twin and of the truth.
    equal_parameter
        Distance between points at the same parameter of the same strut.
    strut_mean, strut_max
        (E,) the first of these for each strut.
    strut_equal_mean, strut_equal_max
        (E,) the last of these for each strut.
    joint
        (V,) the second for each joint.
    """

    curves: Statistics
    joints: Statistics
    equal_parameter: Statistics
    strut_mean: np.ndarray
    strut_max: np.ndarray
    strut_equal_mean: np.ndarray
    strut_equal_max: np.ndarray
    joint: np.ndarray

    def summary(self) -> dict[str, dict[str, float]]:
        """The nine figures by name, as for a JSON file."""
        names = ("curves", "joints", "equal_parameter")
        return {name: dict(vars(getattr(self, name))) for name in names}

    def as_dict(self) -> dict[str, Any]:
        """Everything, as for a JSON file; NaN becomes ``None``."""
        arrays = {
            "struts": {
                "curves_mean": self.strut_mean,
                "curves_max": self.strut_max,
                "equal_parameter_mean": self.strut_equal_mean,
                "equal_parameter_max": self.strut_equal_max,
            },
            "joint_errors": {"distance": self.joint},
        }
        plain = {
            group: {name: _without_nan(values) for name, values in columns.items()} for group, columns in arrays.items()
        }
        return {"unit": "mm", **self.summary(), **plain}


def _without_nan(values: np.ndarray) -> list[float | None]:
    return [None if np.isnan(value) else value for value in values.tolist()]


def evaluate(
    control_points: np.ndarray, vertices: np.ndarray, truth: Wireframe, present: np.ndarray | None = None
) -> Errors:
    """Compare curves and joints with the truth.

    Curves are sampled evenly in the parameter, about as densely on all struts, with weights of length; the
    two ways of the distance between curves count alike in the mean. Distances are exact: to the curves, not
    to samples on them. Struts that are missing in the truth count only where they exist: a point of the
    twin's strut counts if the nearest point of the whole true strut exists.

    Parameters
    ----------
    control_points
        (E, n + 1, 3) mm, the curves to judge: a twin's (`Twin.curves`), or the plan's for the error before fitting.
    vertices
        (V, 3) mm, their joints.
    truth
        The real geometry, whose printed struts count.
    present
        (E, 2) interval of the parameter at which each strut of the truth exists; all of it by default.

    Raises
    ------
    InputError
        If there are other numbers of struts or joints than in the truth, or nothing of it exists.
    """
    curves, joints = np.asarray(control_points, dtype=np.float64), np.asarray(vertices, dtype=np.float64)
    _check_shapes(curves, joints, truth)
    span = _existing(truth, present)
    there = span[:, 1] > span[:, 0]
    u, strut, weight = _samples(truth.control_points, span)
    real = points_at(truth.control_points, strut, u)
    equal = np.linalg.norm(points_at(curves, strut, u) - real, axis=1)
    forth = CurveSet.build(curves, np.where(there[:, None], [0.0, 1.0], 0.0)).distances(real)
    own_u, own_strut, own_weight = _samples(curves, np.where(there[:, None], [0.0, 1.0], 0.0))
    own = points_at(curves, own_strut, own_u)
    exists = _beside_what_exists(own, own_strut, truth.control_points, span)
    own, own_strut, own_weight = own[exists], own_strut[exists], own_weight[exists]
    back = CurveSet.build(truth.control_points, span).distances(own)
    both = np.concatenate([forth, back])
    weights = np.concatenate([weight / weight.sum(), own_weight / own_weight.sum()])
    where = np.concatenate([strut, own_strut])
    strut_mean, strut_max = _by_strut(both, weights, where, truth.strut_count)
    equal_mean, equal_max = _by_strut(equal, weight, strut, truth.strut_count)
    joint = np.linalg.norm(joints - truth.vertices, axis=1)
    joint[~_existing_joints(truth, span)] = np.nan
    if np.isnan(joint).all():
        raise InputError.at(truth.name, "present", "no strut reaches a joint", "give a truth with a whole strut")
    return Errors(
        curves=Statistics.of(both, weights),
        joints=Statistics.of(joint[~np.isnan(joint)]),
        equal_parameter=Statistics.of(equal, weight),
        strut_mean=strut_mean,
        strut_max=strut_max,
        strut_equal_mean=equal_mean,
        strut_equal_max=equal_max,
        joint=joint,
    )


def _check_shapes(curves: np.ndarray, joints: np.ndarray, truth: Wireframe) -> None:
    points = max(4, curves.shape[1]) if curves.ndim == 3 else 4  # of higher degree if need be
    for field, found, wanted in (
        ("control_points", curves.shape, (truth.strut_count, points, 3)),
        ("vertices", joints.shape, (truth.vertex_count, 3)),
    ):
        if found != wanted:
            raise InputError.at(
                truth.name,
                field,
                f"are of the shape {found} where the truth has {wanted}",
                "compare a twin with the truth of the same frame",
            )


def _existing(truth: Wireframe, present: np.ndarray | None) -> np.ndarray:
    """(E, 2) interval at which each strut exists, empty for those that are not printed."""
    span = np.tile([0.0, 1.0], (truth.strut_count, 1)) if present is None else np.array(present, dtype=float)
    span[~truth.printed] = 0.0
    if not (span[:, 1] > span[:, 0]).any():
        raise InputError.at(truth.name, "printed", "no strut of the truth exists", "give a truth with printed struts")
    return span


def _existing_joints(truth: Wireframe, span: np.ndarray) -> np.ndarray:
    """(V,) bool: an existing strut reaches the joint."""
    there = span[:, 1] > span[:, 0]
    reached = np.zeros(truth.vertex_count, dtype=bool)
    reached[truth.edges[there & (span[:, 0] == 0.0), 0]] = True
    reached[truth.edges[there & (span[:, 1] == 1.0), 1]] = True
    return reached


def _samples(curves: np.ndarray, span: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parameters, struts and weights (N,): samples at both ends and between, weighted by length."""
    counts = np.where(span[:, 1] > span[:, 0], counts_by_length(curves, SAMPLES) + 1, 0)
    strut, k = ragged(counts)
    step = (span[:, 1] - span[:, 0]) / np.maximum(counts - 1, 1)
    u = span[strut, 0] + k * step[strut]
    degree = curves.shape[1] - 1
    velocity = np.einsum("nb,nbx->nx", bezier.bernstein(degree - 1, u), degree * np.diff(curves, axis=1)[strut])
    at_end = (k == 0) | (k == counts[strut] - 1)  # the trapezoidal rule
    return u, strut, np.linalg.norm(velocity, axis=1) * step[strut] * np.where(at_end, 0.5, 1.0)


def _beside_what_exists(points: np.ndarray, strut: np.ndarray, curves: np.ndarray, span: np.ndarray) -> np.ndarray:
    """(N,) bool: the nearest point to each of ``points`` (N, 3) on the whole of its own curve exists."""
    beside = np.ones(len(points), dtype=bool)
    low, high = span.T
    for i in np.flatnonzero((high > low) & ((low > 0.0) | (high < 1.0))):
        mine = np.flatnonzero(strut == i)
        to_rest = [
            CurveSet.build(curves[i : i + 1], np.array([rest])).distances(points[mine])
            for rest in ((0.0, low[i]), (high[i], 1.0))
            if rest[1] > rest[0]
        ]
        to_existing = CurveSet.build(curves[i : i + 1], span[i : i + 1]).distances(points[mine])
        beside[mine] = to_existing < np.min(to_rest, axis=0)
    return beside


def _by_strut(values: np.ndarray, weights: np.ndarray, strut: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Weighted mean and maximum (E,) of values (N,) by strut, NaN for struts without any."""
    total = np.bincount(strut, weights, count)
    mean, highest = np.full(count, np.nan), np.full(count, np.nan)
    some = total > 0.0
    mean[some] = np.bincount(strut, weights * values, count)[some] / total[some]
    np.fmax.at(highest, strut, values)
    return mean, highest
