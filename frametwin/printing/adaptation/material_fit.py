"""What a print tells of its material: creep, hardening and stiffness, fitted to twin after twin, with an error bar.

An extended Kalman filter (A. Gelb, "Applied optimal estimation", MIT Press 1974, ch. 6): the state are the logarithms
of what `CreepParameters` name, a lean of the whole print, for each strut how fast it flows and how it is pulled
sideways, where the joints are, and by how much all twins are shifted. A twin is a measurement of where joints are; how
that depends on the material comes from the factors of the batch's stiffness, by as many back substitutions as there are
values seen. As the joints are part of the state, a slow drift is told from what twins are off by, batch after batch in
the same way, as soon as it has added up. Struts that moved otherwise than expected are known to be softer, or pulled,
from then on, and are expected to go on like that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from frametwin.printing.adaptation.state_covariance import StateCovariance
from frametwin.printing.adaptation.state_rows import StateRows
from frametwin.printing.process.creep import CreepModel, CreepParameters, CreepStep, PrintState

GLOBAL = ("weight", "lean x", "lean y", "hardening", "rest", "axial")
"""What the first values of the state are: logarithms, but for the lean."""

SEEN = 0.07
"""Standard deviation in mm of where a twin sees a joint, along each axis, from batch to batch."""

SEEN_LATER = 0.05
"""The same of how that changes from batch to batch: what stands beside a joint changes what misleads there."""

LAID = 0.2
"""The same of where a new joint is, and of what twins are off by there time after time: nozzles do not come exactly
where they are told, and blobs at joints mislead by the same amount in every batch."""

SHIFTED, WANDERING = 0.2, 0.03
"""The same of what all joints have in common, and of how that changes from twin to twin. Cameras that are 0.05 degrees
and 0.3 mm off from where they were calibrated shift a small print as a whole by about 0.2 mm."""

DOUBT = 0.15
"""Share by which forecast movements are taken to be wrong as a whole (standard deviation), even where the material is
known."""

BELIEVED = (LAID**2 + SHIFTED**2) / DOUBT**2
"""Square mm of movement that count as foretold rightly before any was seen: the first movements are no larger than what
twins are off by, and say little for or against a forecast."""

MODEL_ERROR = 0.05
"""Standard deviation along each axis of what the model misses, as a share of the movement."""

STRUT_SPEED, STRUT_PULL = 0.3, 0.1
"""Standard deviations from strut to strut: of the logarithm of how fast it flows, and of the sideways pull as a share
of the weight (paper, Sec. I: changes of the printing direction introduce unpredictable deformations)."""

MANY_STRUTS = 1200
"""Of frames with more struts, single struts are not told apart: the state would grow too long."""

COARSE_ERROR = 0.15
"""`MODEL_ERROR` where they are not."""

MOST_VARIANCE = 1.0
"""Of the logarithm of the weight: while it is known to no better than a factor of e, nothing is aimed."""

LARGEST_STEP = 2.0
"""Most by which the logarithm of the weight may change with one twin: the model is linear only nearby."""

LARGEST_TURN = 0.25
"""Angle in rad beyond which a strut with a free end, as those of a coupon are, has turned too far from its plan: the
model is one of small displacements, and a strut that is falling over, or has, says nothing by how far."""


@dataclass(frozen=True)
class MaterialEstimate:
    """What is known of a material: mean and standard deviation, of `GLOBAL` in its order.

    Attributes
    ----------
    mean, deviation
        Six numbers each; logarithms, but for the lean.
    prints
        How many prints it was learnt from; 0 for a guess.
    """

    mean: tuple[float, ...]
    deviation: tuple[float, ...]
    prints: int = 0


GUESS = MaterialEstimate(
    mean=(0.0, 0.0, 0.0, float(np.log(600.0)), float(np.log(0.08)), float(np.log(0.2))),
    deviation=(1.5, 0.1, 0.1, 0.5, 0.7, 0.7),
)
"""Of a thermoplastic nobody knows: hot ends harden in minutes, and stiffness may be off by a factor of five."""


@dataclass(frozen=True, eq=False)
class BatchRecord:
    """What happened in a batch, as far as the job knows.

    Attributes
    ----------
    state
        Before it; joints that were not there were to be laid at its points.
    struts : (N,) int64 array
        What was laid and stands, in order.
    standing : (E,) bool array
        What stands afterwards.
    moved : (V, 3) array, mm
        How far joints moved, as the twin saw it; see `Observation`.
    known : (V,) bool array
        Joints of which that is known.
    """

    state: PrintState
    struts: np.ndarray
    standing: np.ndarray
    moved: np.ndarray
    known: np.ndarray


@dataclass(frozen=True, eq=False)
class MaterialFit:
    """The state of the fit.

    Attributes
    ----------
    model
        How prints creep.
    values : (6 + 3 E,) or (6,) array
        See `GLOBAL`; then for each strut the logarithm of its speed, its pull along x, and along y.
    shift : (3,) array, mm
        By which twins are off everywhere.
    points : (V, 3) array, mm
        Where the joints are.
    covariance
        Of the values, the shift, and the coordinates of the points, in this order; 0 of points that are not there.
    known
        What was known of the material before the print.
    skill : tuple of (along, foretold)
        Of the last batches: products of how far joints moved and how far the fitted model moves them, and squares of
        the latter, summed, square mm.
    """

    model: CreepModel
    values: np.ndarray
    shift: np.ndarray
    points: np.ndarray
    covariance: StateCovariance
    known: MaterialEstimate = GUESS
    skill: tuple[tuple[float, float], ...] = ()

    @classmethod
    def start(cls, model: CreepModel, known: MaterialEstimate | None = None) -> MaterialFit:
        """Before the first twin, by what is known of the material."""
        known = GUESS if known is None else known
        struts = model.design.strut_count if model.design.strut_count <= MANY_STRUTS else 0
        values = np.concatenate([known.mean, np.zeros(3 * struts)])
        spread = [np.array(known.deviation), np.full(struts, STRUT_SPEED), np.full(2 * struts, STRUT_PULL)]
        points = np.array(model.design.vertices)
        spread += [np.full(3, SHIFTED), np.zeros(points.size)]
        covariance = StateCovariance.independent(np.concatenate(spread) ** 2)
        return cls(model, values, np.zeros(3), points, covariance, known)

    @property
    def estimate(self) -> MaterialEstimate:
        """Of the material as a whole, in this print."""
        deviation = np.sqrt(self.covariance.variance[: len(GLOBAL)])
        return MaterialEstimate(
            tuple(self.values[: len(GLOBAL)].tolist()), tuple(deviation.tolist()), self.known.prints
        )

    @cached_property
    def parameters(self) -> CreepParameters:
        """The material as it is taken to be."""
        count = self.model.design.strut_count
        weight, hardening, rest, axial = np.exp(self.values[[0, 3, 4, 5]])
        own = self.values[len(GLOBAL) :].reshape(3, -1) if len(self.values) > len(GLOBAL) else np.zeros((3, count))
        return CreepParameters(
            float(weight),
            float(hardening),
            float(rest),
            float(axial),
            np.exp(own[0]),
            (self.values[1:3, None] + own[1:]).T,
        )

    @cached_property
    def trust(self) -> float:
        """Share of a forecast that is acted upon, 0..1.

        The less the less certain the weight is, and the less joints moved along with the forecast: the share is the
        slope of the line through zero by which the last movements follow the forecast ones. That single struts are
        softer than others, or seen beside where they are, scatters about this line and does not make it flatter. A
        print that does not move as the model has it is not printed against it.
        """
        variance = float(self.covariance.variance[0])
        certain = float(np.exp(-(variance**2))) if variance < MOST_VARIANCE else 0.0
        along, foretold = (sum(part) for part in zip(*self.skill, strict=True)) if self.skill else (0.0, 0.0)
        return certain * float(np.clip((along + BELIEVED) / (foretold + BELIEVED), 0.0, 1.0))

    def updated(self, record: BatchRecord, parts: int = 3, rounds: int = 2) -> MaterialFit:
        """The fit after another twin.

        Parameters
        ----------
        record
            What happened.
        parts
            Into which the batch is divided; see `CreepModel.after`.
        rounds
            Times that the model is made linear anew.
        """
        there = record.state.there | self._ends(record.struts)
        joints = np.flatnonzero(there & self._ends(record.standing) & ~self.model.design.grounded)
        seen = (record.known & self._foretellable(record))[joints]
        if not len(joints):
            return self
        began = self._joined_by(record)
        struts = np.union1d(np.flatnonzero(record.standing), record.struts)
        place = StateRows.of(began.covariance, self._told_apart(struts), joints, began.points.size)
        before, three = began.covariance.of(place.active), np.repeat(seen, 3)
        told = (record.state.points + record.moved)[joints][seen] - self.shift
        fit = self
        for _ in range(rounds):
            moved, slope = fit._measured(record, joints, parts, place.values)
            ahead = moved + slope @ (self.values - fit.values)[place.values]
            carried = place.carried(before, slope, WANDERING**2, self._missed(moved))
            left = told.ravel() - (began.points[joints].ravel() + ahead)[three]
            twin = carried.seen(three, left, SEEN**2)
            change = twin.change
            change[0] = np.clip(change[0], -LARGEST_STEP, LARGEST_STEP)
            fit = began._changed(place, change, ahead)
        covariance = replace(began.covariance, rows=place.active, among=twin.corrected(before, carried))
        return replace(fit, covariance=covariance, skill=(*self.skill, fit._skill(record, joints[seen], parts))[-3:])

    def _foretellable(self, record: BatchRecord) -> np.ndarray:
        """(V,) bool: joints that move as the model has it: all but free ends of struts that have turned far."""
        design, moved = self.model.design, np.where(record.known[:, None], record.moved, 0.0)
        now = record.state.points + moved
        struts = np.flatnonzero(record.standing & (design.degree[design.edges] == 1).any(axis=1))
        ends = design.edges[struts]
        planned, chord = (points[ends[:, 1]] - points[ends[:, 0]] for points in (design.vertices, now))
        along = np.sum(planned * chord, axis=1) / (np.linalg.norm(planned, axis=1) * np.linalg.norm(chord, axis=1))
        upright = np.ones(design.vertex_count, dtype=bool)
        upright[ends[along < np.cos(LARGEST_TURN)].ravel()] = False
        return upright | (design.degree > 1)

    def _told_apart(self, struts: np.ndarray) -> np.ndarray:
        """Rows of the values that struts depend on."""
        own = np.arange(len(GLOBAL), len(self.values)).reshape(3, -1)
        return np.concatenate([np.arange(len(GLOBAL)), own[:, struts].ravel() if own.size else own.ravel()])

    def _ends(self, struts: np.ndarray) -> np.ndarray:
        """(V,) bool: joints at which one of the struts ends."""
        ends = np.zeros(self.model.design.vertex_count, dtype=bool)
        ends[self.model.design.edges[struts].ravel()] = True
        return ends

    def _joined_by(self, record: BatchRecord) -> MaterialFit:
        """With the joints that come into being in a batch, where they were to be laid."""
        points, first = np.array(self.points), len(self.covariance) - self.points.size
        known = self.covariance.variance[first::3] > 0.0
        fresh = np.flatnonzero(~record.state.there | ~known)
        points[fresh] = record.state.points[fresh]
        rows = (first + 3 * fresh[:, None] + np.arange(3)).ravel()
        return replace(self, points=points, covariance=self.covariance.with_independent(rows, LAID**2))

    def _missed(self, moved: np.ndarray) -> np.ndarray:
        """Variance of what the model misses of movements, and of how what twins are off by changes, square mm."""
        error = MODEL_ERROR if len(self.values) > len(GLOBAL) else COARSE_ERROR
        far = np.linalg.norm(moved.reshape(-1, 3), axis=1)
        return np.asarray(SEEN_LATER**2 + (error * np.repeat(far, 3)) ** 2)

    def _changed(self, place: StateRows, change: np.ndarray, moved: np.ndarray) -> MaterialFit:
        """With the joints moved, and then everything that is active changed."""
        values, points, count = np.array(self.values), np.array(self.points), len(place.values)
        values[place.values] += change[:count]
        points[place.joints] += (moved + change[count + 3 :]).reshape(-1, 3)
        return replace(self, values=values, shift=self.shift + change[count : count + 3], points=points)

    def _skill(self, record: BatchRecord, joints: np.ndarray, parts: int) -> tuple[float, float]:
        """How far joints moved along with the model, and how far it moves them; see `skill`."""
        seen = record.moved[joints].ravel()
        foretold = self._measured(record, joints, parts, np.zeros(0, dtype=np.int64))[0]
        return float(seen @ foretold), float(foretold @ foretold)

    def _measured(
        self, record: BatchRecord, joints: np.ndarray, parts: int, told: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Movement (3 J,) of the joints in a batch by the model, and its derivatives (3 J, K) by some values (K,).

        These are none, or all on which the batch depends; see `_told_apart`.
        """
        state = replace(record.state, laid=record.state.laid & record.standing)
        rows = (6 * joints[:, None] + np.arange(3)).ravel()
        slope = np.zeros((len(told), len(rows)))  # transposed, as what comes of one value is found together
        place = np.full(len(self.values), -1)
        place[told] = np.arange(len(told))
        parameters, began = self.parameters, state.points
        for number, part in enumerate(np.array_split(record.struts, parts), 1):
            since, pause = state.clock, self.model.settings.pause if number == parts else 0.0
            state = state.with_struts(part, self.model.design.edges, self.model.seconds, pause)
            step = self.model.step(state, since, parameters)
            if len(told):
                self._add_slope(slope, place, step, rows, parameters)
            state = replace(state, points=state.points + step.moved[:, :3])
        return (state.points - began)[joints].ravel(), slope.T

    def _add_slope(
        self, slope: np.ndarray, place: np.ndarray, step: CreepStep, rows: np.ndarray, parameters: CreepParameters
    ) -> None:
        """Add the derivatives of what a step moves the rows (R,) by, found by adjoint solutions.

        ``slope`` is (K, R), and ``place`` (values,) tells which of the K derivatives is that by a value.
        """
        if step.factor is None:
            return
        moved, free, freedoms = step.moved.ravel(), step.standing.free, step.standing.freedoms
        where = np.full(len(moved), -1)
        where[free] = np.arange(len(free))
        unit = np.zeros((len(free), len(rows)))
        there = np.flatnonzero(where[rows] >= 0)
        unit[where[rows[there]], there] = 1.0
        adjoint = np.zeros((len(moved), len(rows)))
        adjoint[free] = step.factor.solve(unit)
        ends = adjoint[freedoms]  # (N, 12, R)
        bent = moved[freedoms][:, :, None]
        loads = np.concatenate([step.stiffness @ bent, step.sideways, step.along @ bent], axis=2)  # (N, 12, 4)
        speed, *pull, along = (loads.transpose(0, 2, 1) @ ends).transpose(1, 0, 2)  # each (N, R)
        flows = [self._flow_slope(parameters, step, name) for name in ("hardening", "rest")]
        slope[place[: len(GLOBAL)]] += np.stack(
            [moved[rows], *(part.sum(axis=0) for part in pull), *(flow @ speed for flow in flows), -along.sum(axis=0)]
        )
        if len(self.values) > len(GLOBAL):
            count = self.model.design.strut_count
            for block, part in enumerate((speed, *pull)):
                slope[place[len(GLOBAL) + block * count + step.standing.struts]] += part

    def _flow_slope(self, parameters: CreepParameters, step: CreepStep, name: str, change: float = 1e-4) -> np.ndarray:
        """Derivative (N,) of the logarithm of the struts' flow by the logarithm of a parameter."""
        other = replace(parameters, **{name: getattr(parameters, name) * np.exp(change)})
        flows = [self.model.flow(one, step.ages) for one in (parameters, other)]
        slope: np.ndarray = (np.log(flows[1]) - np.log(flows[0])) / change
        return slope
