"""The fast fit: second-order steps of rods in the frame's own motions.

Where the paper lets Adam move a network, this fit minimises the squared residual of the same pictures by
Gauss-Newton, which a splatter can give at the cost of one more gradient. What keeps single struts from hopping to
their neighbours is the frame's own stiffness. At first the frame may only move as it would under smooth loads
(`frametwin.fitting.loads`), then every joint and strut is free, and each step pays elastic energy. Pictures grow from
half a pixel to about four pixels of strut radius. Struts whose pixels stay black are put back where their
neighbours expect them, tried again, and else declared missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np
from threadpoolctl import threadpool_limits

from frametwin.cameras import Camera
from frametwin.fitting import presence
from frametwin.fitting.confidence import confidence
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.fast_settings import CoarseStage, FastSettings, Stage
from frametwin.fitting.loads import load_answers, rigid_motions, smooth_warps
from frametwin.fitting.motion import Pose, as_rods, free_step, smooth_descent, start_pose
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.raster import rods
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Terms

WEAK = 1e-4
"""What is left of the say of a strut that is astray, while its neighbours place it."""


@dataclass(frozen=True, eq=False)
class FastFit:
    """What a fast fit found, for the struts that were fitted.

    Attributes
    ----------
    control_points : (E, 4, 3) mm.
    vertices : (V, 3) mm.
    thickness : (E, K) mm.
    opacity : (E, K) 0..1.
    confidence : (E,) 0..1.
    loss_history : mean squared residual of a pixel, after each step; sizes of pictures change in between.
    timing : seconds by stage.
    """

    control_points: np.ndarray
    vertices: np.ndarray
    thickness: np.ndarray
    opacity: np.ndarray
    confidence: np.ndarray
    loss_history: list[float]
    timing: dict[str, float]


def fit_fast(
    frame: Wireframe,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    settings: FastSettings | None = None,
    callback: ProgressCallback | None = None,
    start: np.ndarray | None = None,
) -> FastFit:
    """Find where every strut of a frame is, from its silhouettes.

    Parameters
    ----------
    frame
        The plan of what has been printed (see `Wireframe.printed_part`).
    cameras
        One for each picture, without lens distortion.
    masks
        (H, W) pictures, 1 where a strut is seen and 0 elsewhere; sizes may differ.
    settings
        See `FastSettings`.
    callback
        Told of every step; can stop the fit.
    start
        (E, 4, 3) control points from which to start, for instance those of the last batch's field; the coarse
        stages are then skipped.

    Raises
    ------
    Cancelled
        If the callback stops the fit.
    """
    # Its matrices are small: threads of the linear algebra would only get in the way of the splatter's.
    with threadpool_limits(limits=1, user_api="blas"):
        return _Run(frame, Pyramid(cameras, masks), settings or FastSettings(), callback).fit(start)


@dataclass(eq=False)
class _Run:
    """One fit under way."""

    frame: Wireframe
    pyramid: Pyramid
    settings: FastSettings
    callback: ProgressCallback | None
    history: list[float] = field(default_factory=list)
    timing: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clock = perf_counter()
        self.elastic = ElasticFrame(self.frame)
        self.density = self.pyramid.pixels_per_mm(self.frame.bounds.mean(axis=0))
        self.anchor = self.pose = start_pose(self.elastic)
        self.steps = 0
        chosen = self.settings
        stages: tuple[CoarseStage | Stage, ...] = (*chosen.coarse, *chosen.refine, *chosen.recover, *chosen.finish)
        self.total = sum(stage.iterations for stage in stages)
        self._levels: dict[tuple[float, float], Level] = {}

    def fit(self, start: np.ndarray | None) -> FastFit:
        """Run all stages."""
        self._lap("set-up")
        if start is None:
            self._search()
        else:
            joints, inner = self.elastic.freedoms_of(start - self.frame.control_points)
            self.anchor = self.pose = self.pose.moved(joints, inner)
            self._refine()
        self._recover(self.settings.refine[-1])
        self._lap("recover")
        for stage in self.settings.finish:
            terms = self._stage(stage)
        self._lap("finish")
        return self._result(self.settings.finish[-1], terms)

    def _search(self) -> None:
        """The frame's own motions first; where they leave struts astray, also motions that ask nothing of the frame.

        The better of the two stays.
        """
        rigid = rigid_motions(self.frame.vertices)
        plan = self.pose
        found: list[tuple[float, int, Pose, Pose]] = []
        for kind in (load_answers, smooth_warps):
            self.anchor = self.pose = plan
            motions = [rigid, kind(self.elastic, self.settings.cells)]
            if kind is smooth_warps:
                motions.append(load_answers(self.elastic, self.settings.cells))
            self._coarse(np.concatenate(motions, axis=1), 1.0 if kind is load_answers else 0.0)
            self.anchor = self.pose
            self._lap("coarse")
            loss = self._refine()
            found.append((loss, len(found), self.pose, self.anchor))
            if self._astray(self.settings.refine[-1]).mean() <= self.settings.troubled:
                break
        _, _, self.pose, self.anchor = min(found, key=lambda outcome: outcome[:2])

    def _refine(self) -> float:
        for stage in self.settings.refine:
            terms = self._stage(stage)
        self._lap("refine")
        return terms.loss

    def _lap(self, name: str) -> None:
        now = perf_counter()
        self.timing[name] = self.timing.get(name, 0.0) + now - self.clock
        self.clock = now

    def _level(self, detail: float, blur: float) -> tuple[Level, float]:
        """The pictures for a stage, and their pixels per millimetre. Kept while the size stays the same."""
        scale = min(1.0, detail / (self.density * float(np.median(self.frame.radius))))
        key = (scale, blur)
        if key not in self._levels:
            self._levels = {k: v for k, v in self._levels.items() if k[0] < 0.5}
            self._levels[key] = self.pyramid.level(scale, blur)
        return self._levels[key], scale * self.density

    def _report(self, name: str, loss: float, level: Level) -> None:
        self.steps += 1
        self.history.append(2.0 * loss / level.target.size)
        if self.callback is not None:
            curves = as_rods(self.elastic, self.pose, 1).control_points
            report(
                self.callback,
                Progress(name, min(self.steps, self.total), self.total, self.history[-1], curves),
            )

    def _coarse(self, motions: np.ndarray, pull: float) -> None:
        for stage in self.settings.coarse:
            stage = replace(stage, pull=pull * stage.pull)
            level, density = self._level(stage.detail, stage.blur)
            descent = smooth_descent(self.elastic, motions, self.pose, level, stage, stage.longest / density)
            for pose, loss in descent:
                self.pose = pose
                self._report("smooth motion", loss, level)

    def _stage(self, stage: Stage, astray: np.ndarray | None = None) -> Terms:
        level, density = self._level(stage.detail, stage.blur)
        for _ in range(stage.iterations):
            terms = rods.gauss_newton(as_rods(self.elastic, self.pose, stage.pieces), level)
            heard = terms if astray is None else _without(terms, self.frame.edges, astray)
            joints, inner = free_step(self.elastic, heard, self.pose, self.anchor, stage.pull, stage.drag)
            furthest = np.percentile(np.linalg.norm(joints[:, :3], axis=1), 99) * density
            share = stage.share * min(1.0, stage.longest / max(furthest, 1e-12))
            self.pose = self.pose.moved(share * joints, share * inner)
            if self.settings.learn_thickness and stage.detail > 1.0:
                self.pose = presence.learn_thickness(self.pose, self.frame.radius, terms.widths)
            self._report("joints and struts", terms.loss, level)
        return terms

    def _recover(self, stage: Stage) -> None:
        """Give struts that lie on black another chance, then take what is still not there as missing."""
        if self._astray(stage).any():
            self._stage(replace(stage, iterations=2, drag=0.0), self._astray(stage))
            for again in self.settings.recover:
                self._stage(again)
        if self.settings.learn_opacity:
            level, _ = self._level(stage.detail, stage.blur)
            opacity, _ = presence.seen_opacity(as_rods(self.elastic, self.pose, stage.pieces), level)
            shortest = presence.shortest_gap(self.frame.chord_lengths, self.frame.radius, stage.pieces)
            self.pose = replace(self.pose, opacity=presence.without_gaps(opacity, self.settings.absent, shortest))

    def _astray(self, stage: Stage) -> np.ndarray:
        level, _ = self._level(stage.detail, stage.blur)
        drawn = as_rods(self.elastic, self.pose, stage.pieces)
        return presence.strut_whiteness(drawn, level) < self.settings.suspicious

    def _result(self, stage: Stage, terms: Terms) -> FastFit:
        count, kernels = len(self.frame.edges), self.settings.kernels_per_strut
        level, _ = self._level(stage.detail, stage.blur)
        drawn = as_rods(self.elastic, self.pose, kernels)
        opacity = np.ones((count, kernels))
        if self.settings.learn_opacity:
            opacity, _ = presence.seen_opacity(drawn, level)
        self._lap("presence")
        return FastFit(
            control_points=drawn.control_points,
            vertices=drawn.joints,
            thickness=drawn.radius,
            opacity=opacity,
            confidence=confidence(self.elastic, terms),
            loss_history=self.history,
            timing=self.timing,
        )


def _without(terms: Terms, edges: np.ndarray, astray: np.ndarray) -> Terms:
    """The terms with next to nothing from struts that are astray and from joints that only they reach."""
    say = np.where(astray, WEAK, 1.0)
    joint_say = np.full(len(terms.joint_gradient), WEAK)
    np.maximum.at(joint_say, edges, np.repeat(say[:, None], 2, axis=1))
    return replace(
        terms,
        hessian=terms.hessian * say[:, None, None],
        gradient=terms.gradient * say[:, None],
        joint_hessian=terms.joint_hessian * joint_say[:, None, None],
        joint_gradient=terms.joint_gradient * joint_say[:, None],
    )
