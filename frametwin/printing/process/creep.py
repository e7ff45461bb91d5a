"""How the joints of a growing print move while its struts creep: beams between joints, a batch at a time.

This is the model that the job has of its own print, coarser than the simulated one: struts are straight between their
joints, rotations are small within a batch, and nothing tears. Its parameters are what a material is: see
`CreepParameters`. A slow viscous thread moves as fast as an elastic beam of the same section is bent far (the analogy
of Stokes and Rayleigh), and a batch in which nothing is moved by much is one linear problem, on the shape that the
print has by then: so a print that leans is loaded as one that leans.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from frametwin.compiled.kept_loops import KeptLoops
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.beams import Sections, element_stiffness, loads_along_axes
from frametwin.mechanics.blocks import BlockFactor, BlockPattern
from frametwin.printing.process.calibration import LEAST_FLOW
from frametwin.printing.process.material import PrintSettings, flowed_between

beam_kernels = KeptLoops("frametwin.mechanics.beam_kernels")

BUBBLE = 3.0 / 14.0 / 3.0 / 24.0
"""An even load q bows a clamped beam by q L^4 / (24 E I) (x (1 - x))^2. The parabola nearest to that, 3/14 x (1 - x),
moves both inner control points by a third of its factor."""


LARGEST_MOVE = 1.0
"""Furthest that a joint moves in one step, as a share of the design's extent: beyond, small displacements say nothing,
and a frame that gives way entirely would move without end."""


@dataclass(frozen=True, eq=False)
class CreepParameters:
    """What a material does in a print.

    Attributes
    ----------
    weight
        Weight over stiffness of the struts, as a multiple of what `PrintSettings` say.
    hardening
        Seconds after which a strut flows only 1/e times as fast as when it was laid.
    rest
        How fast a hardened strut still flows, as a share of the speed when it was laid.
    axial
        Stiffness along a strut relative to that of its solid section.
    speed : (E,) array
        How fast each strut flows, relative to what is expected.
    pull : (E, 2) array
        Sideways load on each strut, as a multiple of its weight.
    """

    weight: float
    hardening: float
    rest: float
    axial: float
    speed: np.ndarray
    pull: np.ndarray


@dataclass(frozen=True, eq=False)
class PrintState:
    """A print at some moment.

    Attributes
    ----------
    points : (V, 3) array, mm
        Joints; where those that are not there yet shall be.
    there : (V,) bool array
        Joints that are there, the plate's among them.
    laid : (E,) bool array
        Struts that stand.
    laid_at : (E,) array, s
        When each was laid.
    clock
        Seconds since the print began.
    """

    points: np.ndarray
    there: np.ndarray
    laid: np.ndarray
    laid_at: np.ndarray
    clock: float

    @classmethod
    def before(cls, plan: Wireframe, laid_at: np.ndarray, clock: float) -> PrintState:
        """A plan whose ``printed`` marks what stands."""
        there = plan.printed_vertices() | plan.grounded
        return cls(np.array(plan.vertices), there, np.array(plan.printed), np.array(laid_at), clock)

    def with_struts(self, struts: np.ndarray, edges: np.ndarray, seconds: float, pause: float) -> PrintState:
        """Lay struts one after the other, and wait."""
        there, laid, laid_at = self.there.copy(), self.laid.copy(), self.laid_at.copy()
        laid[struts], there[edges[struts].ravel()] = True, True
        laid_at[struts] = self.clock + seconds * (np.arange(len(struts)) + 0.5)
        return replace(self, there=there, laid=laid, laid_at=laid_at, clock=self.clock + seconds * len(struts) + pause)


@dataclass(frozen=True, eq=False)
class Standing:
    """The struts of a print that stand on the plate, by whatever way.

    Attributes
    ----------
    struts : (N,) int64 array
        What hangs in the air for want of a lost strut is not among them, and does not move.
    edges : (N, 2) int64 array
        Their joints.
    free : (F,) int64 array
        Rows of the joints that are not held, six for each joint.
    pattern
        Of the stiffness between these.
    """

    struts: np.ndarray
    edges: np.ndarray
    free: np.ndarray
    pattern: BlockPattern

    @property
    def freedoms(self) -> np.ndarray:
        """(N, 12) int64 array: rows of the struts' ends."""
        return (6 * self.edges[:, :, None] + np.arange(6)).reshape(-1, 12)


@dataclass(frozen=True, eq=False)
class CreepStep:
    """The linear problem of some time in which struts creep.

    Attributes
    ----------
    moved : (V, 6) array
        Displacements in mm and rotations in rad of the joints.
    standing
        The struts, and which rows are free.
    start, end : (N, 3) array, mm
        Of the struts.
    sections
        Of the struts.
    weight : (N,) array, N/mm
        Of the struts.
    factor
        Of the stiffness of the free rows; ``None`` where nothing is free.
    ages : (2, N) array, s
        Of the struts, before and after.
    """

    moved: np.ndarray
    standing: Standing
    start: np.ndarray
    end: np.ndarray
    sections: Sections
    weight: np.ndarray
    factor: BlockFactor | None
    ages: np.ndarray

    @property
    def stiffness(self) -> np.ndarray:
        """(N, 12, 12) array, of each strut."""
        return element_stiffness(self.start, self.end, self.sections)

    @property
    def along(self) -> np.ndarray:
        """(N, 12, 12) array: the part of the stiffness that is along the strut."""
        none = np.zeros(len(self.weight))
        return element_stiffness(self.start, self.end, Sections(self.sections.axial, none, none))

    @property
    def sideways(self) -> np.ndarray:
        """(N, 12, 2) array: loads along x and y by a pull of 1."""
        return loads_along_axes(self.start, self.end, self.weight)[:, :, :2]


@dataclass(frozen=True, eq=False)
class CreepModel:
    """The struts of a design as they creep.

    Attributes
    ----------
    design
        What is printed.
    settings
        Flow, material, and how long a strut and a pause take; what `CreepParameters` tell is taken from those.
    """

    design: Wireframe
    settings: PrintSettings

    @cached_property
    def furthest(self) -> float:
        """That a joint moves in one step, mm; see `LARGEST_MOVE`."""
        return LARGEST_MOVE * self.design.extent

    @property
    def seconds(self) -> float:
        """That a strut takes."""
        return float(np.mean(self.settings.strut_seconds))

    def flow(self, parameters: CreepParameters, ages: np.ndarray) -> np.ndarray:
        """How far struts of these ages (2, N) in s, before and after, flow; see `PrintSettings.flowed`."""
        young, old = ages
        flowed = flowed_between(young, old, self.settings.hot_flow, parameters.hardening, parameters.rest)
        return np.maximum(flowed, LEAST_FLOW * self.settings.hot_flow)

    def step(
        self, state: PrintState, since: float, parameters: CreepParameters, bows: np.ndarray | None = None
    ) -> CreepStep:
        """Find how far the joints move between ``since`` and now.

        Parameters
        ----------
        state
            The print; what was laid since is there from then on.
        since : float, s
            The last moment at which it had settled.
        parameters
            Of the material.
        bows : (E, 2, 3) array, mm, optional
            To which is added by how much the inner control points of the struts move beyond what their ends do.
        """
        design, material = self.design, self.settings.material
        standing = _standing(design.edges.tobytes(), state.laid.tobytes(), design.grounded.tobytes())
        struts, edges, pattern = standing.struts, standing.edges, standing.pattern
        radius, points = design.radius[struts], np.ascontiguousarray(state.points, dtype=np.float64)
        ages = np.maximum(np.array([[since], [state.clock]]), 0.0)
        ages = np.maximum(ages - state.laid_at[struts], 0.0)
        soft = self.flow(parameters, ages) * parameters.speed[struts]
        solid = Sections.round(radius, material.young / soft, material.shear / soft)
        sections = replace(solid, axial=parameters.axial * solid.axial)
        weight = parameters.weight * material.weight * np.pi * radius**2
        load = weight[:, None] * np.column_stack([parameters.pull[struts], -np.ones(len(struts))])
        entries, moved, factor = np.empty(36 * len(pattern.rows) + 1), np.zeros(6 * design.vertex_count), None
        force, stiff = np.empty(len(moved)), np.stack([sections.axial, sections.bending, sections.twisting])
        beam_kernels.assemble(points, edges, stiff, load, pattern.slots, entries, force)
        if len(standing.free):
            factor = pattern.elimination.factorise(entries[:-1])
            moved[standing.free] = factor.solve(force[standing.free])
        moved = _bounded(moved.reshape(-1, 6), self.furthest)
        if bows is not None:
            own = np.empty((len(struts), 2, 3))
            beam_kernels.bows(points, edges, sections.bending, load, moved, np.array([BUBBLE]), own)
            bows[struts] += own
        start, end = points[edges[:, 0]], points[edges[:, 1]]
        return CreepStep(moved, standing, start, end, sections, weight, factor, ages)

    def after(
        self,
        state: PrintState,
        struts: np.ndarray,
        parameters: CreepParameters,
        *,
        parts: int = 1,
        pauses: int = 1,
        bows: np.ndarray | None = None,
    ) -> PrintState:
        """The print after a batch has been laid, settling after each of so many parts of it.

        ``pauses`` is more than one where the struts are those of so many batches, each of which ends with a pause.
        """
        for number, part in enumerate(np.array_split(struts, parts), 1):
            since = state.clock
            pause = pauses * self.settings.pause if number == parts else 0.0
            state = state.with_struts(part, self.design.edges, self.seconds, pause)
            step = self.step(state, since, parameters, bows)
            state = replace(state, points=state.points + step.moved[:, :3])
        return state


def _bounded(moved: np.ndarray, most: float) -> np.ndarray:
    """Movements (V, 6) none of which shifts a joint further than ``most`` mm; those without a value are left out."""
    sound = moved if np.isfinite(moved).all() else np.nan_to_num(moved, nan=0.0, posinf=0.0, neginf=0.0)
    shift = np.sqrt(np.sum(sound[:, :3] ** 2, axis=1, keepdims=True))
    if shift.max(initial=0.0) <= most:
        return sound
    return np.asarray(sound * np.minimum(1.0, most / np.maximum(shift, 1e-12)))


@lru_cache(maxsize=96)
def _standing(edges: bytes, laid: bytes, grounded: bytes) -> Standing:
    """The struts of a print that stand on the plate.

    From edges (E, 2) of int64, and laid (E,) and grounded (V,) of bool, as bytes: the forecasts of a print, round after
    round and answer after answer, come by the same ones.
    """
    ends, on_plate = np.frombuffer(edges, dtype=np.int64).reshape(-1, 2), np.frombuffer(grounded, dtype=bool)
    struts = np.flatnonzero(np.frombuffer(laid, dtype=bool))
    held_up = np.empty(len(struts), dtype=bool)
    beam_kernels.reached(ends[struts], on_plate, held_up)
    struts = struts[held_up]
    there = np.zeros(len(on_plate), dtype=bool)
    there[ends[struts]] = True
    joints = np.flatnonzero(there & ~on_plate)
    place = np.full(len(on_plate), -1)
    place[joints] = np.arange(len(joints))
    free = (6 * joints[:, None] + np.arange(6)).ravel()
    return Standing(struts, ends[struts], free, BlockPattern.of(place[ends[struts]], len(joints)))
