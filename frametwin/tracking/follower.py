"""Gauss-Newton steps from where the twin was a moment ago to where it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.motion import Pose, as_rods, free_step, start_pose
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.rods import Rods, Terms
from frametwin.tracking.sight import Sight
from frametwin.twin.twin import Twin

SETTLING = 0.2
"""Share by which the anchor goes after the frame with every picture. It holds what the pictures do not show, and must
not hold back what they do."""

FURTHEST = 99.0
"""Percentile of the joints' steps that is kept below a stage's longest step."""


@dataclass(frozen=True, eq=False)
class Follower:
    """What stays as it is while a frame is followed: how it can move, and from where its elastic energy is measured.

    Attributes
    ----------
    elastic : ElasticFrame
        Of what is printed of the plan: E struts, V joints.
    anchor : Pose
        From where it is measured: where the frame is when it stands still, which `settled` brings about.
    joint_size : (V,) array or None
        Radius of the material at each joint relative to its thickest strut's.
    """

    elastic: ElasticFrame
    anchor: Pose
    joint_size: np.ndarray | None = None

    @classmethod
    def of(cls, printed: Wireframe, struts: np.ndarray, joints: np.ndarray, twin: Twin | None) -> Follower:
        """From the plan, or from a twin of the whole frame.

        Parameters
        ----------
        printed : Wireframe
            What is printed of the plan.
        struts, joints : (E,) and (V,) array of int
            Its struts and joints among those of the whole frame.
        twin : Twin or None
            Of the whole frame.
        """
        elastic = ElasticFrame(printed)
        pose = start_pose(elastic)
        if twin is None:
            return cls(elastic, pose)
        moved = twin.control_points[struts] - printed.control_points
        freedoms, inner = elastic.freedoms_of(moved)
        freedoms[:, :3] = twin.vertices[joints] - printed.vertices
        # Torn ends would not be at their joints: what is left goes into the struts themselves, as far as it can.
        radius = np.median(twin.thickness[struts], axis=1)
        pose = replace(pose.moved(freedoms, inner), radius=np.where(radius > 0.0, radius, printed.radius))
        return cls(elastic, pose, _joint_size(printed, pose.radius, joints, twin))

    def settled(self, pose: Pose) -> Follower:
        """With the anchor gone after a pose."""
        joints = SETTLING * (pose.joints - self.anchor.joints)
        return replace(self, anchor=self.anchor.moved(joints, SETTLING * (pose.inner - self.anchor.inner)))

    def drawn(self, pose: Pose, pieces: int) -> Rods:
        """What the splatter draws of a pose."""
        return replace(as_rods(self.elastic, pose, pieces), joint_size=self.joint_size)

    def followed(self, pose: Pose, sight: Sight, stages: Sequence[Stage]) -> tuple[Pose, Terms]:
        """All steps of some stages.

        Returns
        -------
        Where the frame is then, and what the pictures said before the last step.
        """
        terms = None
        for stage in stages:
            longest = stage.longest / sight.pixels_per_mm(stage)
            for _ in range(stage.iterations):
                terms = sight.terms(self.drawn(pose, stage.pieces), stage)
                joints, inner = free_step(self.elastic, terms, pose, self.anchor, stage.pull, stage.drag)
                far = float(np.percentile(np.linalg.norm(joints[:, :3], axis=1), FURTHEST))
                share = stage.share * min(1.0, longest / max(far, 1e-12))
                pose = pose.moved(share * joints, share * inner)
        assert terms is not None  # a stage has one step or more, and there is one stage or more
        return pose, terms


def _joint_size(printed: Wireframe, radius: np.ndarray, joints: np.ndarray, twin: Twin) -> np.ndarray | None:
    if twin.joint_radius is None:
        return None
    thickest = np.zeros(printed.vertex_count)
    np.maximum.at(thickest, printed.edges, np.repeat(radius[:, None], 2, axis=1))
    known = twin.joint_radius[joints]
    return np.where((known > 0.0) & (thickest > 0.0), known / np.maximum(thickest, 1e-12), 1.0)
