"""A digital twin that follows pictures as they come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from frametwin import __version__
from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.fitting.api import FitResult, whole_twin
from frametwin.fitting.confidence import confidence
from frametwin.fitting.frame_field import field_through
from frametwin.fitting.motion import Pose
from frametwin.fitting.part_fit import PartFit
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.pyramid import Pyramid
from frametwin.raster.rods import Rods
from frametwin.tracking.dark_views import DarkViews
from frametwin.tracking.events import Event
from frametwin.tracking.follower import Follower
from frametwin.tracking.look import Look, Looker
from frametwin.tracking.pictures import Reducer
from frametwin.tracking.settings import TrackSettings
from frametwin.tracking.watches import JointWatch, StrutWatch, Switch, names_of
from frametwin.twin.findings import DARK
from frametwin.twin.twin import Twin
from frametwin.twin.verdict import DOUBTFUL, Verdict

ARM_AFTER = 0.1
"""Seconds for which something else than the print must be in view to be told of."""

VIEW_LOST_AFTER = 2.0
"""The same for a view that disagrees with the others."""

SEEK_AGAIN = 0.5
"""Seconds between two searches for struts that are to be laid and not where they were planned."""

MOST_MISFIT = 0.15
"""Misfit of the typical view from which the twin is called doubtful; whole prints have 0.02 to 0.05."""

FIELD_CELLS = (2, 5)
"""Cells of the field that goes with a twin; as the fast fit has them."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """What was made of the pictures of one moment.

    Attributes
    ----------
    frame : int
        Its number, from 0.
    time : float, s
    events : tuple of Event
        What is to be told.
    views : tuple of str
        Cameras that were used.
    misfit : float
        Share of pixels on which twin and pictures disagree, of the typical view.
    seconds : float
        That it took.
    """

    frame: int
    time: float
    events: tuple[Event, ...]
    views: tuple[str, ...]
    misfit: float
    seconds: float


class Tracker:
    """Follows a print from picture to picture.

    Parameters
    ----------
    frame : Wireframe
        The plan; its printed struts are followed.
    cameras : sequence of Camera
        N, two or more.
    twin : Twin, optional
        Of the frame, from which to start; the plan as it is by default.
    awaited : (E,) bool array, optional
        Printed struts that are to be laid and need not be there yet.
    backgrounds : sequence of (H, W) or (H, W, 3) array of uint8 or None, optional
        The views before printing, where the pictures are photographs.
    settings : TrackSettings, optional
    batch : int, optional
        That is being printed; told with events.

    Raises
    ------
    InputError
        If there are fewer than two cameras, nothing is printed, or the twin is not one of the frame.
    """

    def __init__(
        self,
        frame: Wireframe,
        cameras: Sequence[Camera],
        twin: Twin | None = None,
        *,
        awaited: np.ndarray | None = None,
        backgrounds: Sequence[np.ndarray | None] | None = None,
        settings: TrackSettings | None = None,
        batch: int | None = None,
    ) -> None:
        if len(cameras) < 2:
            raise InputError.at("stream", "cameras", f"are {len(cameras)}", "give two or more")
        if not frame.printed.any():
            raise InputError.at(frame.name, "printed", "marks no strut", "print something before it is followed")
        if twin is not None:
            twin.as_wireframe(frame)  # refuses that of another frame
        self.frame, self.settings, self.batch = frame, settings or TrackSettings(), batch
        self.cameras = tuple(cameras)
        self._names = [camera.name for camera in cameras]
        self._part, self._struts, self._joints = frame.printed_part()
        self._reducer = Reducer(cameras, _scale(self._part, cameras, self.settings.finest), backgrounds)
        follower = Follower.of(self._part, self._struts, self._joints, twin)
        self._looker = Looker(follower, self._reducer.cameras, self.settings)
        self._dark_views = DarkViews(self._part, self._reducer.cameras, self.settings.follow[-1])
        self._pose = follower.anchor
        self._last: Look | None = None
        waiting = np.zeros(len(self._struts), dtype=bool) if awaited is None else np.asarray(awaited)[self._struts]
        if twin is not None:
            waiting = waiting | (twin.completeness[self._struts] < DARK)
        self._watch_struts = StrutWatch(waiting, self.settings.patience)
        self._watch_joints = JointWatch(self._positions(), self.settings.threshold, self.settings.patience)
        views = len(self.cameras)
        self._arm = Switch(1, ARM_AFTER, self.settings.settle)
        self._arm.on[:] = True  # until the pictures show that nothing is there
        self._lost = Switch(views, VIEW_LOST_AFTER, self.settings.patience)
        self._believed = np.ones(views, dtype=bool)
        self._told_clear: tuple[int, ...] | None = None
        self._told_arm, self._count, self._sought_at = False, 0, -np.inf

    # --- what is known

    @property
    def standing(self) -> np.ndarray:
        """(E,) bool: struts of the whole frame that stand, as far as was seen."""
        result = np.zeros(self.frame.strut_count, dtype=bool)
        result[self._struts] = self._watch_struts.standing
        return result

    @property
    def vertices(self) -> np.ndarray:
        """(V, 3) array, mm: where the joints are; those of which nothing is printed are as planned."""
        result = np.array(self.frame.vertices)
        result[self._joints] = self._positions()
        return result

    @property
    def control_points(self) -> np.ndarray:
        """(E, 4, 3) array, mm: where the struts are; those that are not printed are as planned."""
        result = np.array(self.frame.control_points)
        result[self._struts] = self._curves()
        return result

    @property
    def answerable(self) -> bool:
        """Whether nothing but the print is in view, and all that is to be laid has been."""
        return not self._arm.on[0] and not self._watch_struts.awaited.any()

    @property
    def has_followed(self) -> bool:
        """Whether any pictures have been followed yet."""
        return self._last is not None

    def result(self) -> FitResult:
        """The twin as it is now and the field that moves the plan to it, as a fit gives them.

        Raises
        ------
        ValueError
            If no pictures have been followed yet.
        """
        if self._last is None:
            raise ValueError("no pictures have been followed yet")
        look, there = self._last, self._watch_struts.standing
        curves, elastic = self._curves(), self._looker.follower.elastic
        known = np.where(there, confidence(elastic, look.terms), 0.0)
        drawn = self._looker.follower.drawn(self._pose, self.settings.finish[-1].pieces)
        part = PartFit(
            control_points=curves,
            vertices=self._positions(),
            thickness=drawn.radius,
            opacity=np.repeat(there[:, None].astype(np.float64), drawn.pieces, axis=1),
            confidence=known,
            field=field_through(self._part, curves, FIELD_CELLS, known),
            loss=(look.terms.loss,),
            timing={},
            joint_radius=drawn.joint_radius(),
        )
        twin = whole_twin(self.frame, self._struts, self._joints, part)
        return FitResult(twin.replace(**self._notes(look)), part.field)

    def _notes(self, look: Look) -> dict[str, Any]:
        off = look.misfit
        views = [
            {"name": name, "used": bool(used), "unexplained": float(more), "unseen": float(less)}
            for name, used, more, less in zip(self._names, look.used, off.unexplained, off.unseen, strict=True)
        ]
        typical = float(np.median(off.total[look.used]))
        problem = f"the pictures and the twin disagree on {typical:.0%} of their pixels"
        verdict = Verdict(DOUBTFUL, (problem,)) if typical > MOST_MISFIT else Verdict()
        provenance = {"frametwin": __version__, "preset": "track", "seed": 0, "frame": self._count - 1}
        return {"views": views, "verdict": verdict, "provenance": provenance}

    # --- going on

    def follow(
        self, pictures: Sequence[np.ndarray | None], time: float | None = None, sources: Sequence[str] = ()
    ) -> Tracked:
        """Go on to the pictures of the next moment.

        Parameters
        ----------
        pictures : sequence of (H, W) or (H, W, 3) array of uint8 or None
            One a camera, in their order; ``None`` where it gave none.
        time : float, s, optional
            When they were taken, by a clock of the caller's; the process's own by default.
        sources : sequence of str, optional
            What each picture is called where something is wrong with it, such as its file; by default as its camera.

        Raises
        ------
        InputError
            If the pictures are not those of the cameras.
        """
        began = perf_counter()
        now = began if time is None else float(time)
        # Its matrices are small: threads of the linear algebra would only get in the way of the splatter's.
        with threadpool_limits(limits=1, user_api="blas"):
            masks = self._reducer.masks(pictures, sources)
            dark = self._dark_views.find(self._drawn_standing(), masks)
            masks = [None if unlit else mask for mask, unlit in zip(masks, dark, strict=True)]
            look = self._looker.look(self._as_drawn(now), masks, self._believed, self._watch_struts.standing)
        events = self._events(look, np.array([mask is not None for mask in masks]), dark, now)
        used = () if look is None else tuple(names_of(np.flatnonzero(look.used), self._names))
        misfit = float("nan") if look is None else float(np.median(look.misfit.total[look.used]))
        frame, self._count = self._count, self._count + 1
        return Tracked(frame, now, tuple(events), used, misfit, perf_counter() - began)

    def _as_drawn(self, now: float) -> Pose:
        """The pose with what stands; now and then with what is to be laid, too, where nothing else is in view."""
        there = self._watch_struts.standing
        if self._watch_struts.awaited.any() and not self._arm.on[0] and now - self._sought_at >= SEEK_AGAIN:
            self._sought_at = now
            there = there | self._watch_struts.awaited
        return replace(self._pose, opacity=there[:, None].astype(np.float64))

    def _drawn_standing(self) -> Rods:
        opacity = self._watch_struts.standing[:, None].astype(np.float64)
        return self._looker.follower.drawn(replace(self._pose, opacity=opacity), self.settings.follow[-1].pieces)

    def _events(self, look: Look | None, given: np.ndarray, dark: np.ndarray, now: float) -> list[Event]:
        told: list[Event] = []

        def tell(kind: str, **facts: Any) -> None:
            batch = {} if self.batch is None else {"batch": self.batch}
            told.append(Event(kind, now, self._count, {**facts, **batch}))

        out = ~given if look is None else ~look.used
        for kind, views in zip(("view-lost", "view-back"), self._lost.look(out, now), strict=True):
            if len(views):
                tell(kind, views=names_of(views, self._names))
        if look is None:
            return told
        self._pose, self._last, self._believed = look.pose, look, look.used | ~given
        self._looker.follower = self._looker.follower.settled(look.pose)
        for kind, struts in self._watch_struts.look(look.gone, look.there, now).items():
            tell(kind, struts=self._struts[struts].tolist())
            if kind != "fallen":
                fresh = np.unique(self._part.edges[struts])
                self._watch_joints.forget(self._positions(), fresh)
        self._tell_joints(tell, now)
        self._tell_arm(tell, look, dark, now)
        return told

    def _tell_joints(self, tell: Any, now: float) -> None:
        known = np.zeros(len(self._joints), dtype=bool)
        known[self._part.edges[self._watch_struts.standing]] = True
        positions = self._positions()
        moved, far = self._watch_joints.look(positions, known, now)
        if len(moved):
            joints = self._joints[moved].tolist()
            tell("moved", joints=joints, distances=far.tolist(), positions=positions[moved].tolist())

    def _tell_arm(self, tell: Any, look: Look, dark: np.ndarray, now: float) -> None:
        hidden = dark & ~self._lost.on  # by an arm, for all that is known before the view is told of as lost
        rise, _ = self._arm.look(np.array([look.covered.any() or hidden.any()]), now)
        in_view = bool(self._arm.on[0])
        if look.covered.any() and not self._told_arm and (len(rise) or in_view):
            tell("arm", views=names_of(np.flatnonzero(look.covered), self._names))
            self._told_arm, self._told_clear = True, None
        waiting = tuple(self._struts[self._watch_struts.awaited].tolist())
        if not in_view and waiting != self._told_clear:
            self._told_arm, self._told_clear = False, waiting
            tell("clear", answerable=not waiting, awaited=list(waiting))

    def _positions(self) -> np.ndarray:
        return self._part.vertices + self._pose.joints[:, :3]

    def _curves(self) -> np.ndarray:
        elastic = self._looker.follower.elastic
        return elastic.displaced(self._part.control_points, self._pose.joints, self._pose.inner)


def _scale(frame: Wireframe, cameras: Sequence[Camera], detail: float) -> float:
    """Share of the pictures' size at which the typical strut has an apparent radius of so many pixels; 1 at most."""
    density = Pyramid(cameras, []).pixels_per_mm(frame.bounds.mean(axis=0))
    return min(1.0, detail / (density * float(np.median(frame.radius))))
