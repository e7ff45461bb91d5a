"""A print that grows strut by strut, sags while it hardens, and collapses when struts find nothing to stick to.

The simulator knows the design, the sequence, its settings and a seed, and for each batch the plan that the robot
follows. It knows nothing of twins.
"""

from __future__ import annotations

import numpy as np

from frametwin.errors import InputError
from frametwin.evaluation.curve_distance import CurveSet
from frametwin.geometry import bezier
from frametwin.geometry.displacement import largest_deviation
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.sag import moved_frame
from frametwin.printing.process.added_struts import frame_alone, without_last
from frametwin.printing.process.calibration import own_weight, stiffness_between, weight_scale
from frametwin.printing.process.material import PrintSettings, ProcessVariation
from frametwin.printing.process.settling import bent_ends, settled
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.simulation.outcome import BatchOutcome, PrintReport, Standing


class GrowingPrint:
    """A simulated print, laid batch by batch.

    A strut sticks if its start is within a bead of the material at its joint, or on the plate; otherwise it falls.
    Its far end brings its joint into being, or is welded to it within a bead, or hangs free. After each part of a
    batch the print sags under what was laid and what still creeps; struts bent or stretched too far come off, and
    whatever is then not connected to the plate falls. A strut that is welded beside its joint, onto one of the
    joint's other struts, is drawn to the joint: in the model, struts meet nowhere else.

    Parameters
    ----------
    design
        What shall be printed.
    sequence
        In which order.
    settings
        See `PrintSettings`.
    seed
        Of everything that varies at random; the same seed, sequence and plans give the same print.
    variation
        Takes the place of what the seed would draw.
    scale
        Factor on the weight; `weight_scale` by default.
    added
        How many of the last struts are a test coupon or temporary supports, by which the print is not judged, and which
        do not count where the weight is scaled; see `frametwin.printing.process.coupon`.

    Raises
    ------
    InputError
        If the sequence is not one of the design, or the seed is below 0.
    """

    def __init__(
        self,
        design: Wireframe,
        sequence: PrintSequence,
        settings: PrintSettings | None = None,
        seed: int = 0,
        *,
        variation: ProcessVariation | None = None,
        scale: float | None = None,
        added: int = 0,
    ) -> None:
        sequence.end_in(design)
        self.design, self.sequence = design, sequence
        self.settings = PrintSettings() if settings is None else settings
        if variation is None:
            variation = ProcessVariation.draw(design.strut_count, self.settings, seed)
        self.variation = variation
        self._judged = without_last(design.strut_count, added)
        alone = frame_alone(design, sequence, added)
        self.scale = weight_scale(*alone, self.settings) if scale is None else scale
        self.settings = self.settings.of_print(seed)
        self.outcomes: list[BatchOutcome] = []
        self.clock = 0.0
        struts, joints = design.strut_count, design.vertex_count
        self._forwards = np.ones(struts, dtype=bool)  # laid from the first of its edge's joints to the second
        self._nodes = np.array(design.edges)  # a strut that hangs free has a node of its own, V + e
        self._points = np.concatenate([design.vertices, np.zeros((struts, 3))])
        self._curves = np.array(design.control_points)
        self._born = np.zeros(joints, dtype=bool)
        self._laid = np.zeros(struts, dtype=bool)
        self._standing = np.zeros(struts, dtype=bool)
        self._laid_at = np.zeros(struts)
        self._settled_at = 0.0
        self._as_laid = np.zeros((struts, 3))  # angles of both ends, length of the chord
        self._most_standing = 0

    @property
    def collapsed(self) -> bool:
        """The print has collapsed."""
        return bool(self.outcomes) and self.outcomes[-1].collapsed

    def lay(
        self, batch: int, plan: Wireframe, laying: PrintSequence | None = None, curves: np.ndarray | None = None
    ) -> BatchOutcome:
        """Lay a batch where ``plan`` says.

        Parameters
        ----------
        batch
            Its number.
        plan
            What the robot follows: the design's struts and joints, moved.
        laying
            What is laid, if other struts than the sequence has in that batch; struts that stand are left out.
        curves : (N, 4, 3) array, mm, optional
            Where its struts are laid, each from start to end, if not just as in the plan.

        Raises
        ------
        InputError
            If the plan has other struts than the design.
        """
        if not np.array_equal(plan.edges, self.design.edges) or plan.vertex_count != self.design.vertex_count:
            raise InputError.at(plan.name, "edges", "are not those of the design", "give a plan made from this design")
        laying = self.sequence.in_batch(batch) if laying is None else laying
        curves = laying.directed_curves(plan) if curves is None else curves
        ends = np.column_stack([laying.start, laying.end_in(plan)])
        began, struts = self.clock, laying.struts
        groups = np.array_split(np.flatnonzero(~self._standing[struts]), self.settings.increments)
        for number, group in enumerate(groups, 1):
            for i in group.tolist():
                self._lay_strut(int(struts[i]), int(ends[i, 0]), int(ends[i, 1]), curves[i])
            self.clock += self.settings.pause if number == len(groups) else 0.0
            self._settle()
        outcome = self._outcome(batch, struts, self.clock - began)
        self.outcomes.append(outcome)
        return outcome

    def standing(self) -> Standing:
        """What stands now."""
        design, nodes = self.design, self._nodes
        vertices = np.where(self._born[:, None], self._points[: design.vertex_count], design.vertices)
        whole = self._standing & (nodes < design.vertex_count).all(axis=1)
        frame = moved_frame(
            design.replace(printed=whole),
            vertices,
            np.where(whole[:, None, None], self._curves, design.control_points) - design.control_points,
        )
        free = np.flatnonzero(self._standing & ~whole)
        curves, edges = np.array(frame.control_points), np.array(frame.edges)
        curves[free] = self._curves[free]
        edges[free] = np.where(
            nodes[free] < design.vertex_count, nodes[free], len(vertices) + np.arange(len(free))[:, None]
        )
        points = np.concatenate([vertices, self._points[design.vertex_count + free]])
        pictured = frame.replace(
            vertices=points,
            edges=edges,
            control_points=curves,
            printed=self._standing,
            grounded=np.concatenate([design.grounded, np.zeros(len(free), dtype=bool)]),
        )
        return Standing(frame, pictured)

    def report(self) -> PrintReport:
        """What the print came to so far."""
        return PrintReport.of(self.design, self.outcomes, self.standing(), self._judged)

    def _lay_strut(self, strut: int, start: int, end: int, curve: np.ndarray) -> None:
        bead = 2.0 * self.settings.bead * float(self.design.radius[strut])
        first, last = curve[[0, 3]] + bead * self.variation.placement[strut]
        seconds = float(self.variation.seconds[strut])
        self._laid[strut], self._laid_at[strut] = True, self.clock + 0.5 * seconds
        self.clock += seconds
        if not self._sticks(start, first, bead):
            if not self.design.grounded[start]:
                return
            self._create_joint(start, first)
        node = end
        if not self._sticks(end, last, bead):
            if self._born[end]:
                node = self.design.vertex_count + strut
                self._points[node] = last
            else:
                self._create_joint(end, last)
        a, b = self._points[start], self._points[node]
        laid = curve + bezier.straight(a - curve[0], b - curve[3])
        laid[[0, 3]] = a, b
        forwards = self.design.edges[strut, 0] == start
        self._curves[strut] = laid if forwards else laid[::-1]
        self._nodes[strut] = (start, node) if forwards else (node, start)
        self._forwards[strut] = forwards
        self._standing[strut] = True
        self._as_laid[strut] = self._shape(np.array([strut]))[0]

    def _create_joint(self, joint: int, point: np.ndarray) -> None:
        if not self._born[joint]:
            self._born[joint], self._points[joint] = True, point

    def _sticks(self, joint: int, point: np.ndarray, bead: float) -> bool:
        """Whether a bead at a point touches material of a joint: the joint itself, or a strut that ends there."""
        if not self._born[joint]:
            return False
        if np.linalg.norm(point - self._points[joint]) <= bead:
            return True
        there = self._standing & (self._nodes == joint).any(axis=1)
        return bool(there.any()) and float(CurveSet.build(self._curves[there]).distances(point[None])[0]) <= bead

    def _settle(self) -> None:
        """Let the print deform under its weight for the time since it did so last; what is torn off falls."""
        struts = np.flatnonzero(self._standing)
        before, self._settled_at = self._settled_at, self.clock
        if len(struts) == 0:
            return
        settings, variation = self.settings, self.variation
        stiffness = stiffness_between(settings, self._laid_at[struts], before, self.clock, variation.speed[struts])
        weight = self.scale * own_weight(self.design, settings)[struts, None]
        load = weight * (variation.pull[struts] + self._drawn(struts, before))
        frame, nodes = self._part(struts)
        frame = settled(frame, stiffness, load, settings)
        self._points[nodes], self._curves[struts] = frame.vertices, frame.control_points
        now, laid = self._shape(struts), self._as_laid[struts]
        torn = (np.abs(now[:, :2] - laid[:, :2]) > settings.tear_angle).any(axis=1)
        torn |= np.abs(now[:, 2] / laid[:, 2] - 1.0) > settings.tear_stretch
        self._standing[struts[torn]] = False
        self._drop_unsupported()

    def _drawn(self, struts: np.ndarray, before: float) -> np.ndarray:
        """(N, 3) the nozzle's pull at struts that it has laid since then, as a multiple of their weight.

        Each is pulled at for as long as it takes, of the time that has passed.
        """
        fresh = self._laid_at[struts] >= before
        chord = self._curves[struts, 3] - self._curves[struts, 0]
        along = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-12)
        along[~self._forwards[struts]] *= -1.0
        share = self.variation.seconds[struts] / max(self.clock - before, 1e-12)
        return np.asarray(np.where(fresh, self.settings.draw * share, 0.0)[:, None] * along)

    def _part(self, struts: np.ndarray) -> tuple[Wireframe, np.ndarray]:
        """The struts as a frame of their own, and the nodes of its joints."""
        nodes, edges = np.unique(self._nodes[struts], return_inverse=True)
        joints = nodes < self.design.vertex_count
        grounded = np.zeros(len(nodes), dtype=bool)
        grounded[joints] = self.design.grounded[nodes[joints]]
        frame = Wireframe.create(
            self._points[nodes],
            edges.reshape(-1, 2),
            control_points=self._curves[struts],
            radius=self.design.radius[struts],
            grounded=grounded,
            name=self.design.name,
        )
        return frame, nodes

    def _drop_unsupported(self) -> None:
        """What is not connected to the plate falls; joints that nothing ends at any more are no longer there."""
        struts = np.flatnonzero(self._standing)
        if len(struts):
            frame, _ = self._part(struts)
            count, labels = frame.components()
            supported = np.zeros(count, dtype=bool)
            supported[labels[frame.grounded]] = True
            self._standing[struts[~supported[labels[frame.edges[:, 0]]]]] = False
        there = np.zeros(len(self._points), dtype=bool)
        there[self._nodes[self._standing].ravel()] = True
        self._born &= there[: len(self._born)]

    def _shape(self, struts: np.ndarray) -> np.ndarray:
        curves = self._curves[struts]
        return np.column_stack([bent_ends(curves), np.linalg.norm(curves[:, 3] - curves[:, 0], axis=1)])

    def _outcome(self, batch: int, struts: np.ndarray, seconds: float) -> BatchOutcome:
        standing, judged = self._standing, self._standing & self._judged
        count = int(judged.sum())
        lost = np.flatnonzero(self._laid & ~standing)
        hangs = standing & (self._nodes >= self.design.vertex_count).any(axis=1)
        share = int(self._judged[lost].sum()) / max(1, int((self._laid & self._judged).sum()))
        shrunk, self._most_standing = count < self._most_standing, max(self._most_standing, count)
        return BatchOutcome(
            batch=batch,
            laid=struts,
            attached=struts[standing[struts]],
            hanging=np.flatnonzero(hangs),
            lost=lost,
            standing=int(standing.sum()),
            e_max=largest_deviation(self.design.control_points[judged], self._curves[judged]),
            collapsed=self.collapsed or shrunk or share > self.settings.collapse_share,
            seconds=seconds,
        )
