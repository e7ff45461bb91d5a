"""The fast fit: second-order steps of rods in the frame's own motions.

Where the paper lets Adam move a network, this fit minimises the squared residual of the same pictures by
Gauss-Newton, which a splatter can give at the cost of one more gradient. What keeps single struts from hopping to
their neighbours is the frame's own stiffness. At first the frame may only move as it would under smooth loads
(`frametwin.fitting.loads`), then every joint and strut is free, and each step pays elastic energy. Pictures grow from
a quarter of a pixel to about four pixels of strut radius. Struts whose pixels stay black are put back where their
neighbours expect them, tried again, and else declared missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from frametwin.cameras import Camera
from frametwin.fields.base import DeformationField
from frametwin.fitting import gauge, presence
from frametwin.fitting.camera_freedoms import FREEDOMS
from frametwin.fitting.confidence import confidence
from frametwin.fitting.consistency import Consistent, consistent_fit
from frametwin.fitting.fast_settings import FastSettings
from frametwin.fitting.fast_state import Problem, drawn, level_of
from frametwin.fitting.frame_field import field_through
from frametwin.fitting.known_start import KnownStart
from frametwin.fitting.part_fit import PartFit, ViewsFit
from frametwin.fitting.uncertainty import Uncertainty, uncertainty
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback
from frametwin.raster.rods import Rods

GONE = 0.1
"""Share of a strut that is there, below which it is drawn as its joints alone would have it."""


@dataclass(frozen=True)
class FastFitter:
    """The fast fit with its settings; a `Fitter`. From an earlier field it starts without the coarse stages."""

    settings: FastSettings = FastSettings()

    def fit(
        self,
        printed: Wireframe,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        start: DeformationField | KnownStart | None = None,
        callback: ProgressCallback | None = None,
    ) -> PartFit:
        """See `frametwin.fitting.part_fit.Fitter.fit`."""
        # Its matrices are small: threads of the linear algebra would only get in the way of the splatter's.
        with threadpool_limits(limits=1, user_api="blas"):
            problem = Problem.of(printed, cameras, masks, self.settings, callback)
            known = KnownStart(start) if isinstance(start, DeformationField) else start
            return _result(consistent_fit(problem, known))


def _result(found: Consistent) -> PartFit:
    problem, state = found.problem, found.state
    settings = problem.settings
    rods = drawn(problem, state, settings.kernels_per_strut)
    doubt = _uncertainty(found, rods)  # from what was drawn last
    opacity = np.ones(rods.radius.shape)
    if settings.learn_opacity:
        opacity, _ = presence.believed_opacity(rods, level_of(problem, state, settings.finish[-1]))
        gone = opacity.mean(axis=1) < GONE
        rods = drawn(problem, replace(state, pose=state.pose.straightened(gone)), settings.kernels_per_strut)
    state = state.lapped("presence")
    known = confidence(problem.elastic, state.last_terms)
    torn, struts = found.torn, len(rods.edges)
    led = known * torn.attached(struts).all(axis=1)  # what hangs loose says nothing of the space about its joint
    field = field_through(problem.frame, rods.control_points, settings.field_cells, led)
    state = state.lapped("field")
    part = PartFit(
        control_points=rods.control_points,
        vertices=rods.joints[: torn.planned],
        thickness=rods.radius,
        opacity=opacity,
        confidence=doubt.confidence,
        field=field,
        loss=state.record.loss,
        timing=state.record.timing,
        views=_views(found),
        joint_radius=rods.joint_radius()[: torn.planned],
        sigma_across=doubt.across,
        sigma_along=doubt.along,
        attached=torn.attached(struts),
        gap=torn.gaps(rods.joints, struts),
    )
    return found.halves.joined(part, settings.degree)


def _uncertainty(found: Consistent, rods: Rods) -> Uncertainty:
    problem, state = found.problem, found.state
    stage = problem.settings.finish[0]
    level, seen = level_of(problem, state, stage), drawn(problem, state, stage.pieces)
    return uncertainty(
        problem.elastic,
        state.last_terms,
        rods.radius[:, 0],
        float(np.median(found.misfit.total[found.used])),
        presence.strut_whiteness(seen, level),
        presence.outline_misfit(seen, level),
        gauge.world_deviation(
            problem.elastic,
            state.pose,
            problem.level(stage).cameras,
            problem.covariances,
            found.holds,
            problem.foot_deviation,
        ),
    )


def _views(found: Consistent) -> ViewsFit:
    """What was made of each view; cameras of those that were left out stay where the rig has them."""
    cameras = np.zeros((len(found.used), FREEDOMS))
    if found.state.cameras is not None:
        cameras[found.used] = found.state.cameras
    sigmas = np.zeros(len(found.used))
    sigmas[found.used] = np.abs(cameras[found.used] / found.problem.deviations).max(axis=1)
    return ViewsFit(cameras, sigmas, found.used, found.misfit.unexplained, found.misfit.unseen, found.holds)
