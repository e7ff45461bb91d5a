"""What a print tells of its material: creep, hardening and stiffness, fitted to twin after twin, with an error bar.

An extended Kalman filter (A. Gelb, "Applied optimal estimation", MIT Press 1974, ch. 6): the state are the logarithms
of what `CreepParameters` name, a lean of the whole print, and for each strut how fast it flows and how it is pulled
sideways. A twin is a measurement of how far joints moved in a batch; its derivatives come from the factors of the
batch's stiffness, by as many back substitutions as there are values seen. Struts that moved otherwise than expected
are known to be softer, or pulled, from then on, and are expected to go on like that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frametwin.printing.process.creep import CreepModel, CreepParameters, CreepStep, PrintState

GLOBAL = ("weight", "lean x", "lean y", "hardening", "rest", "axial")
"""What the first values of the state are: logarithms, but for the lean."""

SEEN = 0.1
"""Standard deviation in mm of how far a twin sees a joint move, along each axis, for each joint by itself."""

SHARED_NEW, SHARED_OLD = 0.2, 0.08
"""The same of what all joints have in common, for those that were new in the batch and for older ones. Cameras that are
0.05 degrees and 0.3 mm off from where they were calibrated shift a small print as a whole by about 0.2 mm; from one
batch to the next the shift hardly changes, but a joint that is new moved from where it was told to be."""

MODEL_ERROR = 0.05
"""Standard deviation of what the model misses, as a share of the movement."""

STRUT_SPEED, STRUT_PULL = 0.3, 0.1
"""Standard deviations from strut to strut: of the logarithm of how fast it flows, and of the sideways pull as a share
of the weight (paper, Sec. I: changes of the printing direction introduce unpredictable deformations)."""

MANY_STRUTS = 1200
"""Of frames with more struts, single struts are not told apart: the state would grow too long."""

COARSE_ERROR = 0.15
"""`MODEL_ERROR` where they are not."""

LARGEST_STEP = 2.0
"""Most by which the logarithm of the weight may change with one twin: the model is linear only nearby."""


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
    covariance : array
        Of the values.
    prints
        How many earlier prints stand behind them.
    skill : tuple of (missed, moved)
        Of the last batches: square mm by which the fitted model misses what joints moved, and in which they moved.
    """

    model: CreepModel
    values: np.ndarray
    covariance: np.ndarray
    prints: int = 0
    skill: tuple[tuple[float, float], ...] = ()

    @classmethod
    def start(cls, model: CreepModel, known: MaterialEstimate | None = None) -> MaterialFit:
        """Before the first twin, by what is known of the material."""
        known = GUESS if known is None else known
        struts = model.design.strut_count if model.design.strut_count <= MANY_STRUTS else 0
        values = np.concatenate([known.mean, np.zeros(3 * struts)])
        spread = [np.array(known.deviation), np.full(struts, STRUT_SPEED), np.full(2 * struts, STRUT_PULL)]
        return cls(model, values, np.diag(np.concatenate(spread) ** 2), known.prints)

    @property
    def estimate(self) -> MaterialEstimate:
        """Of the material as a whole."""
        deviation = np.sqrt(np.diag(self.covariance)[: len(GLOBAL)])
        return MaterialEstimate(tuple(self.values[: len(GLOBAL)].tolist()), tuple(deviation.tolist()), self.prints)

    @property
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

    @property
    def trust(self) -> float:
        """Share of a forecast that is acted upon, 0..1.

        The less the less certain the weight is (exp(-variance), the mode of a log-normal one), and the less of the last
        movements it explains. A print that does not move as the model has it is not printed against it.
        """
        variance = float(self.covariance[0, 0])
        certain = float(np.exp(-variance)) if variance < 0.5 else 0.0
        missed, moved = (sum(part) for part in zip(*self.skill, strict=True)) if self.skill else (0.0, 0.0)
        return certain * (float(np.clip(1.0 - missed / moved, 0.0, 1.0)) if moved > 0.0 else 1.0)

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
        joints = np.flatnonzero(record.known & ~self.model.design.grounded)
        if len(joints) == 0:
            return self
        seen = record.moved[joints].ravel()
        error = MODEL_ERROR if len(self.values) > len(GLOBAL) else COARSE_ERROR
        noise = np.diag(SEEN**2 + (error * seen) ** 2)
        shared = np.where(record.state.there[joints], SHARED_OLD, SHARED_NEW)
        noise += np.kron(np.outer(shared, shared), np.eye(3))
        fit = self
        for _ in range(rounds):
            moved, slope = fit._measured(record, joints, parts)
            across = self.covariance @ slope.T
            inner = slope @ across + noise
            left = seen - moved - slope @ (self.values - fit.values)
            change = across @ np.linalg.solve(inner, left)
            change[0] = np.clip(change[0], -LARGEST_STEP, LARGEST_STEP)
            fit = replace(self, values=self.values + change)
        covariance = self.covariance - across @ np.linalg.solve(inner, across.T)
        missed = fit._measured(record, joints, parts, slopes=False)[0]
        free = 3.0 * float(
            np.sum(SEEN**2 + shared**2)
        )  # what twins themselves are off by is not held against the forecast
        skill = (max(0.0, float(np.sum((seen - missed) ** 2)) - free), float(np.sum(seen**2)))
        return replace(fit, covariance=0.5 * (covariance + covariance.T), skill=(*self.skill, skill)[-3:])

    def _measured(
        self, record: BatchRecord, joints: np.ndarray, parts: int, slopes: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Movement (3 J,) of the joints in a batch by the model, and its derivatives (3 J, values)."""
        state = replace(record.state, laid=record.state.laid & record.standing)
        rows = (6 * joints[:, None] + np.arange(3)).ravel()
        slope = np.zeros((len(rows), len(self.values)))
        parameters, began = self.parameters, state.points
        for number, part in enumerate(np.array_split(record.struts, parts), 1):
            since, pause = state.clock, self.model.settings.pause if number == parts else 0.0
            state = state.with_struts(part, self.model.design.edges, self.model.seconds, pause)
            step = self.model.step(state, since, parameters)
            if slopes:
                slope += self._slope(step, rows, parameters)
            state = replace(state, points=state.points + step.moved[:, :3])
        return (state.points - began)[joints].ravel(), slope

    def _slope(self, step: CreepStep, rows: np.ndarray, parameters: CreepParameters) -> np.ndarray:
        """Derivatives (R, values) of what a step moves the rows (R,) by, by adjoint solutions."""
        result = np.zeros((len(rows), len(self.values)))
        if step.factor is None:
            return result
        moved = step.moved.ravel()
        place = np.full(len(moved), -1)
        place[step.free] = np.arange(len(step.free))
        unit = np.zeros((len(step.free), len(rows)))
        there = np.flatnonzero(place[rows] >= 0)
        unit[place[rows[there]], there] = 1.0
        adjoint = np.zeros((len(moved), len(rows)))
        adjoint[step.free] = step.factor.solve(unit)
        ends = adjoint[step.freedoms].transpose(2, 0, 1)  # (R, N, 12)
        bent = moved[step.freedoms]
        speed = np.einsum("rnf,nf->rn", ends, np.einsum("nfg,ng->nf", step.stiffness, bent))
        pull = np.einsum("rnf,nfk->krn", ends, step.sideways)
        result[:, 0] = moved[rows]
        result[:, 1:3] = pull.sum(axis=2).T
        result[:, 3] = speed @ self._flow_slope(parameters, step, "hardening")
        result[:, 4] = speed @ self._flow_slope(parameters, step, "rest")
        result[:, 5] = -np.einsum("rnf,nf->r", ends, np.einsum("nfg,ng->nf", step.along, bent))
        if len(self.values) > len(GLOBAL):
            count = self.model.design.strut_count
            for block, part in enumerate((speed, *pull)):
                result[:, len(GLOBAL) + block * count + step.struts] = part
        return result

    def _flow_slope(self, parameters: CreepParameters, step: CreepStep, name: str, change: float = 1e-4) -> np.ndarray:
        """Derivative (N,) of the logarithm of the struts' flow by the logarithm of a parameter."""
        other = replace(parameters, **{name: getattr(parameters, name) * np.exp(change)})
        flows = [self.model.flow(one, step.ages) for one in (parameters, other)]
        slope: np.ndarray = (np.log(flows[1]) - np.log(flows[0])) / change
        return slope
