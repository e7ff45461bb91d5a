"""What a fast fit is given and what it changes: the constant problem, and the state that goes from stage to stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting.camera_freedoms import (
    FREEDOMS,
    CameraPrior,
    CameraTerms,
    camera_terms,
    deviations_of,
    pixel_noise,
    rig_covariances,
    with_cameras,
)
from frametwin.fitting.cropping import cropped
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.fast_settings import CoarseStage, FastSettings, Stage
from frametwin.fitting.gauge import foot_deviation
from frametwin.fitting.lenses import lens_blurs
from frametwin.fitting.levels import Levels
from frametwin.fitting.motion import Pose, as_rods, start_pose
from frametwin.fitting.stubs import are_stubs
from frametwin.fitting.window import Window
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.raster import rods
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Rods, Terms, ViewTerms

AnyStage = CoarseStage | Stage


def crisp_stages(settings: FastSettings, levels: Levels) -> tuple[Stage, ...]:
    """The very last stages of pictures in black and white, at their full size or reduced."""
    full = all(levels.scale(stage.detail) == 1.0 for stage in settings.crisp)
    return settings.crisp if full else settings.crisp_reduced


def _all_stages(settings: FastSettings, levels: Levels) -> tuple[AnyStage, ...]:
    last = crisp_stages(settings, levels)
    return (*settings.coarse, *settings.refine, *settings.recover, *settings.finish, *last)


@dataclass(frozen=True, eq=False)
class Problem:
    """What stays as it is during a fit.

    Attributes
    ----------
    frame : Wireframe
        The plan of what is printed: E struts, V joints.
    elastic : ElasticFrame
        How it can move, and how stiff it is.
    levels : Levels
        Its pictures.
    settings : FastSettings
    covariances : (N, 10, 10) array
        How well each camera is known; see `frametwin.fitting.camera_freedoms.rig_covariances`.
    callback : ProgressCallback or None
        Told of every step.
    stiffness : (E,) array or None
        By what factor each strut is stiffer than by its section; ``None`` for 1.
    window : Window or None
        The part of the pictures in which the struts are, where the frame is a part of one; the rest of it is there.
    resting : int
        Joints of the rest.
    """

    frame: Wireframe
    elastic: ElasticFrame
    levels: Levels
    settings: FastSettings
    covariances: np.ndarray
    callback: ProgressCallback | None
    stiffness: np.ndarray | None = None
    window: Window | None = None
    resting: int = 0

    @classmethod
    def of(
        cls,
        frame: Wireframe,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        settings: FastSettings,
        callback: ProgressCallback | None,
    ) -> Problem:
        """The problem of a frame and its pictures; see `frametwin.fitting.part_fit.Fitter`."""
        elastic = ElasticFrame(frame)
        parts = cropped(frame, cameras, masks)
        cameras_seen, seen = parts
        asked = Levels(frame, Pyramid(cameras_seen, []))  # for their sizes alone
        largest = max(asked.scale(stage.detail) for stage in _all_stages(settings, asked))
        levels = Levels(frame, Pyramid(cameras_seen, seen, lens_blurs(elastic, *parts), largest))
        known = rig_covariances(cameras, settings.rig_errors)
        return cls(frame, elastic, levels, settings, known, callback)

    @property
    def steps(self) -> int:
        """Steps of all stages, as far as is known beforehand."""
        return sum(stage.iterations for stage in _all_stages(self.settings, self.levels))

    def level(self, stage: AnyStage) -> Level:
        """The pictures at the size and blur of a stage."""
        level = self.levels.at(stage.detail, stage.blur)
        if isinstance(stage, Stage) and stage.spread is not None:
            level = replace(level, spread=stage.spread)
        return level if self.window is None else self.window.part_of(level, self.scales(level))

    def scales(self, level: Level) -> np.ndarray:
        """(N,) pixels of a level to one of the full picture, view by view."""
        return level.shapes[:, 1] / self.levels.widths

    @property
    def prior(self) -> CameraPrior:
        """What is known of the cameras before any picture is looked at."""
        return CameraPrior.of(self.covariances, self.noise)

    @property
    def deviations(self) -> np.ndarray:
        """(N, 10) standard deviations of each camera's freedoms."""
        return deviations_of(self.covariances)

    @property
    def noise(self) -> float:
        """Standard deviation of a pixel on an edge."""
        return pixel_noise(self.settings.outline_error)

    @property
    def outline_error(self) -> float:
        """The same of an outline as a whole, in mm at the frame."""
        return self.settings.outline_error / self.levels.density

    @property
    def foot_deviation(self) -> float:
        """mm, of a foot on the plate, as `frametwin.fitting.gauge.held_world` takes it."""
        return foot_deviation(self.elastic.frame, self.outline_error)

    @property
    def stubs(self) -> np.ndarray:
        """(E,) array of bool: struts that show little beside their joints; see `frametwin.fitting.stubs`."""
        return are_stubs(self.frame.chord_lengths, self.frame.radius)

    def exact_cameras(self) -> np.ndarray:
        """(N, 10) freedoms of cameras that are where the rig has them."""
        return np.zeros((self.levels.view_count, FREEDOMS))

    def with_frame(self, frame: Wireframe) -> Problem:
        """The same with another frame of as many struts as have a stiffness."""
        elastic = ElasticFrame(frame)
        return replace(
            self, frame=frame, elastic=elastic if self.stiffness is None else elastic.stiffened(self.stiffness)
        )

    def of_views(self, chosen: np.ndarray) -> Problem:
        """The same with some of the views alone."""
        return replace(self, levels=self.levels.of_views(chosen), covariances=self.covariances[chosen])


@dataclass(frozen=True, eq=False)
class Record:
    """How a fit has gone so far.

    Attributes
    ----------
    loss : tuple of float
        Mean squared residual of a pixel at each step; sizes of pictures change in between.
    timing : mapping of str to float, s
        By stage.
    since : float, s
        When the present stage began, by the process's clock.
    """

    loss: tuple[float, ...] = ()
    timing: Mapping[str, float] = field(default_factory=dict)
    since: float = field(default_factory=perf_counter)

    def stepped(self, loss: float) -> Record:
        """With one more step."""
        return replace(self, loss=(*self.loss, loss))

    def lapped(self, name: str) -> Record:
        """With the time since the last lap put down to a stage."""
        now = perf_counter()
        spent = self.timing.get(name, 0.0) + now - self.since
        return replace(self, timing={**self.timing, name: spent}, since=now)


@dataclass(frozen=True, eq=False)
class State:
    """Where a fit stands. Stages take a state and give the next one.

    All unknowns are here: those of the frame in `pose`, those of anything else in a field of its own, which `drawn`
    and `terms_of` then heed and `frametwin.fitting.fast_stages.free_stage` moves.

    Attributes
    ----------
    pose : Pose
        Where the frame is.
    anchor : Pose
        From where the elastic energy of free steps is measured: where the frame's smooth motions have left it.
    record : Record
        How the fit got here.
    terms : Terms or None
        What the pictures said before the last free step.
    cameras : (N, 10) array or None
        Freedoms of the cameras (see `frametwin.fitting.camera_freedoms`); ``None`` where the rig is taken as exact.
    joint_size : (V,) array or None
        Radius of the material at each joint relative to its thickest strut's; ``None`` for 1 everywhere.
    strained : bool
        Whether the print is bent where no smooth motion of its frame is.
    """

    pose: Pose
    anchor: Pose
    record: Record
    terms: Terms | None = None
    cameras: np.ndarray | None = None
    joint_size: np.ndarray | None = None
    strained: bool = False

    @classmethod
    def planned(cls, problem: Problem, record: Record) -> State:
        """The plan itself."""
        pose = start_pose(problem.elastic)
        return cls(pose, pose, record)

    @property
    def freedoms(self) -> np.ndarray:
        """(N, 10) freedoms of the cameras, where they are free.

        Raises
        ------
        ValueError
            If the rig is taken as exact.
        """
        if self.cameras is None:
            raise ValueError("the cameras are taken as exact")
        return self.cameras

    @property
    def last_terms(self) -> Terms:
        """What the pictures said before the last free step.

        Raises
        ------
        ValueError
            If there was none.
        """
        if self.terms is None:
            raise ValueError("no stage has been gone through yet")
        return self.terms

    def anchored(self) -> State:
        """With the elastic energy measured from here on."""
        return replace(self, anchor=self.pose)

    def lapped(self, name: str) -> State:
        """With the time since the last lap put down to a stage."""
        return replace(self, record=self.record.lapped(name))


def drawn(problem: Problem, state: State, pieces: int) -> Rods:
    """What the splatter draws of a state, each strut as so many straight pieces."""
    return replace(as_rods(problem.elastic, state.pose, pieces), joint_size=state.joint_size)


def level_of(problem: Problem, state: State, stage: AnyStage) -> Level:
    """The pictures of a stage, with the cameras where the state has them."""
    level = problem.level(stage)
    if state.cameras is None or not state.cameras.any():
        return level  # and what was drawn there
    return with_cameras(level, state.cameras, problem.scales(level))


def terms_of(problem: Problem, state: State, stage: Stage) -> Terms:
    """Loss of a state, and its Gauss-Newton terms."""
    return rods.gauss_newton(drawn(problem, state, stage.pieces), level_of(problem, state, stage))


def view_terms_of(problem: Problem, state: State, stage: Stage) -> tuple[ViewTerms, CameraTerms]:
    """The terms of every view by itself, and the cameras'."""
    level, rods_seen = level_of(problem, state, stage), drawn(problem, state, stage.pieces)
    terms = rods.gauss_newton_by_view(rods_seen, level)
    return terms, camera_terms(rods_seen, terms, level.cameras, problem.scales(level))


def stepped(problem: Problem, state: State, name: str, loss: float, level: Level) -> State:
    """Note a step that has led to a state, and tell of it.

    Parameters
    ----------
    problem, state
        After the step.
    name : str
        Of the step, for people.
    loss : float
        Half the sum of squared residuals, over all pixels of ``level``.

    Raises
    ------
    Cancelled
        If the callback stops the fit.
    """
    state = replace(state, record=state.record.stepped(2.0 * loss / level.target.size))
    if problem.callback is not None:
        done, history = len(state.record.loss), state.record.loss
        curves = drawn(problem, state, 1).control_points
        report(problem.callback, Progress(name, min(done, problem.steps), problem.steps, history[-1], curves))
    return state
