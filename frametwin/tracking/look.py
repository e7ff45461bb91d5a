"""One look at the pictures of a moment: where the frame is, what of it is there, and which views can be believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.motion import Pose
from frametwin.fitting.view_misfit import FEWEST, ViewMisfit, disagreeing
from frametwin.raster import rods
from frametwin.raster.rods import Rods, Terms
from frametwin.tracking.evidence import Evidence
from frametwin.tracking.follower import Follower
from frametwin.tracking.intruders import hidden_pixels, intruders, polyline
from frametwin.tracking.settings import TrackSettings
from frametwin.tracking.sight import Sight
from frametwin.tracking.watches import GONE

COVERED = 0.08
"""Share of a view's pieces in plain view that something dark must hide to be told of; the views that see them are then
asked alone whether a strut has gone."""


RISEN, LEAST_RISE = 1.5, 0.03
"""Blurred steps are tried, too, when the misfit of the typical view has risen to so many times what it was, and so much
more: the print has jumped."""

NEARER = 0.8
"""They are believed if they bring it down to this share."""

AT_FIRST = 0.05
"""Misfit that is taken to be usual before the first look; whole prints have 0.02 to 0.05."""


@dataclass(frozen=True, eq=False)
class Look:
    """What was found at one moment, of E struts, V joints and N views.

    Attributes
    ----------
    pose : Pose
        Where the frame is.
    terms : Terms
        What the pictures said before the last step.
    gone, there : (E,) array, 0..1
        Share of each strut's pieces that nearly all views show to be gone, and that most show to be there.
    used : (N,) bool array
        Views that agree with the others.
    covered : (N,) bool array
        Views in which something else than the print is seen, white or dark.
    misfit : ViewMisfit
        Of all views, on the pixels that count; everything where there was no picture.
    """

    pose: Pose
    terms: Terms
    gone: np.ndarray
    there: np.ndarray
    used: np.ndarray
    covered: np.ndarray
    misfit: ViewMisfit


class Looker:
    """Looks at one moment after the other.

    Parameters
    ----------
    follower : Follower
    cameras : sequence of Camera
        N, without distortion, of the masks' sizes.
    settings : TrackSettings
    """

    def __init__(self, follower: Follower, cameras: Sequence[Camera], settings: TrackSettings) -> None:
        self.follower, self.cameras, self.settings = follower, tuple(cameras), settings
        self._frame = follower.elastic.frame
        self._usual = AT_FIRST

    def look(
        self, pose: Pose, masks: Sequence[np.ndarray | None], believed: np.ndarray, sought: np.ndarray
    ) -> Look | None:
        """Follow the frame from a pose; ``None`` where too few cameras gave a picture.

        Parameters
        ----------
        pose : Pose
            Where it was, its opacity 0 where struts are not there.
        masks : sequence of (H, W) array of float32 or None
        believed : (N,) bool array
            Views that agreed with the others the last time.
        sought : (E,) bool array
            Struts that may have been lost from sight by moving far; blurred steps go after them.
        """
        given = np.array([mask is not None for mask in masks])
        if given.sum() < fewest_pictures(len(masks)):
            return None
        sight, covered = self._sight(pose, masks, given)
        used = given & believed if (given & believed).sum() >= FEWEST else given
        found = self._followed(pose, self._of(sight, used), used, self.settings.follow)
        off = self._typical(found[0], sight, used)
        if self._lost(found[2], pose, sought).any() or off > RISEN * self._usual + LEAST_RISE:
            other = self._followed(pose, self._of(sight, used), used, (*self.settings.search, *self.settings.follow))
            nearer = self._typical(other[0], sight, used) < NEARER * off
            if nearer or other[2].gone.sum() < found[2].gone.sum() - 0.5:
                found = other
        now, _, evidence = found
        sight, dark = self._without_hidden(now, sight, evidence, used)
        if dark.any():
            now, _, evidence = self._followed(pose, self._of(sight, used), used, self.settings.follow)
        misfit = self._misfit(now, sight, given)
        self._usual = float(np.median(misfit.total[used]))
        agreeing = given.copy()
        named = np.flatnonzero(given)
        agreeing[named[disagreeing(misfit.total[named])]] = False
        if (agreeing != used).any() and agreeing.sum() >= FEWEST:
            used = agreeing
            now, _, evidence = self._followed(pose, self._of(sight, used), used, self.settings.follow)
        now, terms = self.follower.followed(now, self._of(sight, used), self.settings.finish)
        trusted = used & ~dark
        judged = evidence if trusted.sum() < FEWEST else evidence.of_views(trusted[used])
        if covered.any():  # the print itself may have moved by more than it was allowed to
            covered = self._intruded(now, sight)[1] & given
        return Look(now, terms, judged.gone, evidence.there, used, covered | dark, misfit)

    def evidence(self, pose: Pose, sight: Sight) -> Evidence:
        """What each view says of each strut of a pose."""
        stage = self.settings.follow[-1]
        return Evidence.of(self.follower.drawn(pose, stage.pieces), sight, stage)

    def _followed(
        self, pose: Pose, sight: Sight, used: np.ndarray, stages: Sequence[Stage]
    ) -> tuple[Pose, Terms, Evidence]:
        now, terms = self.follower.followed(pose, sight, stages)
        return now, terms, self.evidence(now, sight).of_views(used)

    def _typical(self, pose: Pose, sight: Sight, used: np.ndarray) -> float:
        """Misfit of the typical view."""
        return float(np.median(self._misfit(pose, sight, used).total[used]))

    def _lost(self, evidence: Evidence, pose: Pose, sought: np.ndarray) -> np.ndarray:
        return sought & (pose.opacity[:, 0] > 0.5) & (evidence.gone >= GONE)

    def _drawn(self, pose: Pose) -> Rods:
        return self.follower.drawn(pose, self.settings.finish[-1].pieces)

    def _sight(self, pose: Pose, masks: Sequence[np.ndarray | None], given: np.ndarray) -> tuple[Sight, np.ndarray]:
        """The moment, without what is white and no print, and in which views (N,) that is."""
        shapes = [(camera.height, camera.width) for camera in self.cameras]
        shown = [
            np.zeros(shape, dtype=np.float32) if mask is None else mask
            for mask, shape in zip(masks, shapes, strict=True)
        ]
        valid = [np.full(shape, bool(there)) for shape, there in zip(shapes, given, strict=True)]
        sight = Sight(self._frame, self.cameras, shown, valid)
        regions, covered = self._intruded(pose, sight)
        if not covered.any():
            return sight, covered
        pairs = zip(valid, regions, strict=True)
        free = [own if region is None else own & ~_enlarged(region, own) for own, region in pairs]
        return sight.with_valid(free), covered & given

    def _intruded(self, pose: Pose, sight: Sight) -> tuple[list[np.ndarray | None], np.ndarray]:
        """Where something white is no print, view by view, and in which views (N,) that is."""
        stage = self.settings.follow[-1]
        level = sight.level(stage)
        drawn = level.pictures(np.float32(1.0) - rods.transmittance(self.follower.drawn(pose, stage.pieces), level))
        radius = sight.pixels_per_mm(stage) * float(np.median(self._frame.radius))
        regions = intruders(level.pictures(level.target), drawn, radius)
        return regions, np.array([region is not None for region in regions])

    def _without_hidden(
        self, pose: Pose, sight: Sight, evidence: Evidence, used: np.ndarray
    ) -> tuple[Sight, np.ndarray]:
        """The moment without pieces that something dark hides, and in which views (N,) that is much."""
        dark = np.zeros(len(used), dtype=bool)
        hidden, plain = evidence.hidden, evidence.plain
        share = hidden.sum(axis=(1, 2)) / np.maximum(plain.sum(axis=(1, 2)), 1)
        dark[np.flatnonzero(used)] = share > COVERED
        # Where an arm is known to be, pieces at its edge are not to be believed either.
        hidden |= evidence.doubtful & (share > COVERED)[:, None, None]
        if not hidden.any():
            return sight, dark
        points = polyline(self._drawn(pose).control_points, hidden.shape[2])
        valid = list(sight.valid)
        for row, view in enumerate(np.flatnonzero(used)):
            if hidden[row].any():
                camera = self.cameras[view]
                region = hidden_pixels(hidden[row], points, pose.radius, camera, (camera.height, camera.width))
                valid[view] = valid[view] & ~region
        return sight.with_valid(valid), dark

    def _of(self, sight: Sight, used: np.ndarray) -> Sight:
        """The moment with some of the views alone."""
        if used.all():
            return sight
        return sight.with_valid([own if ok else np.zeros_like(own) for own, ok in zip(sight.valid, used, strict=True)])

    def _misfit(self, pose: Pose, sight: Sight, given: np.ndarray) -> ViewMisfit:
        stage = self.settings.follow[-1]
        level = sight.level(stage)
        through, residual = sight.compared(self.follower.drawn(pose, stage.pieces), stage)
        own = np.where(sight.counted(stage), np.float32(1.0) - through, np.float32(0.0))
        unexplained, unseen = np.ones(len(given)), np.ones(len(given))
        pairs = zip(level.pictures(own), level.pictures(residual), strict=True)
        for view, (drawn, off) in enumerate(pairs):
            if given[view]:
                unexplained[view] = np.maximum(-off, 0.0).sum() / max(float((drawn - off).sum()), 1.0)
                unseen[view] = np.maximum(off, 0.0).sum() / max(float(drawn.sum()), 1.0)
        return ViewMisfit(unexplained, unseen)


def fewest_pictures(cameras: int) -> int:
    """Pictures that a look takes, of so many cameras: in small rigs one of them may fail, as long as two are left."""
    return min(FEWEST, max(2, cameras - 1))


def _enlarged(region: np.ndarray, like: np.ndarray) -> np.ndarray:
    """A region (h, w) bool of a reduced picture in one of the size of another (H, W)."""
    height, width = like.shape
    return cv2.resize(region.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
