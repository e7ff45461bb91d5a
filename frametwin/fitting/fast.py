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
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from frametwin.cameras import Camera
from frametwin.fields.base import DeformationField
from frametwin.fitting import presence
from frametwin.fitting.confidence import confidence
from frametwin.fitting.fast_settings import FastSettings
from frametwin.fitting.fast_stages import finish, recover, refine, search
from frametwin.fitting.fast_state import Problem, Record, State, drawn
from frametwin.fitting.frame_field import field_through, moved_curves
from frametwin.fitting.part_fit import PartFit
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback


@dataclass(frozen=True)
class FastFitter:
    """The fast fit with its settings; a `Fitter`. From an earlier field it starts without the coarse stages."""

    settings: FastSettings = FastSettings()

    def fit(
        self,
        printed: Wireframe,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        start: DeformationField | None = None,
        callback: ProgressCallback | None = None,
    ) -> PartFit:
        """See `frametwin.fitting.part_fit.Fitter.fit`."""
        # Its matrices are small: threads of the linear algebra would only get in the way of the splatter's.
        with threadpool_limits(limits=1, user_api="blas"):
            record = Record()  # whose clock runs from here on
            problem = Problem.of(printed, cameras, masks, self.settings, callback)
            state = State.planned(problem, record)
            if start is None:
                state = search(problem, state.lapped("set-up"))
            else:
                state = refine(problem, _started(problem, state, start).lapped("set-up"))
            return _result(problem, finish(problem, recover(problem, state)))


def _started(problem: Problem, state: State, field: DeformationField) -> State:
    """The plan as a field moves it."""
    moved = moved_curves(problem.frame, field) - problem.frame.control_points
    joints, inner = problem.elastic.freedoms_of(moved)
    return replace(state, pose=state.pose.moved(joints, inner)).anchored()


def _result(problem: Problem, state: State) -> PartFit:
    settings = problem.settings
    rods = drawn(problem, state, settings.kernels_per_strut)
    opacity = np.ones(rods.radius.shape)
    if settings.learn_opacity:
        opacity, _ = presence.seen_opacity(rods, problem.level(settings.finish[-1]))
    state = state.lapped("presence")
    certainty = confidence(problem.elastic, state.last_terms)
    field = field_through(problem.frame, rods.control_points, settings.field_cells, certainty)
    state = state.lapped("field")
    return PartFit(
        control_points=rods.control_points,
        vertices=rods.joints,
        thickness=rods.radius,
        opacity=opacity,
        confidence=certainty,
        field=field,
        loss=state.record.loss,
        timing=state.record.timing,
    )
