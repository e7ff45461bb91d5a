"""A capture without cameras: a print that has sagged, and the silhouettes that a rig would see of it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rigs import RIGS, box_around
from frametwin.capture.capture import write_capture
from frametwin.files import PathLike
from frametwin.formats import defects_json
from frametwin.geometry.displacement import largest_displacement
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.deformations import DEFORMATIONS, deform
from frametwin.mechanics.sag import SagSettings
from frametwin.progress import ProgressCallback
from frametwin.ranges import PictureSize, Seed, ViewCount, above, at_least, check_settings, one_of, within
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.defects import drop_struts
from frametwin.simulation.print_order import print_share

NOTES_FILE = "simulation.json"


@dataclass(frozen=True)
class SimulationSettings:
    """What is simulated. Same settings, same frame: same capture.

    Attributes
    ----------
    views
        Number of cameras, at least 2.
    size
        Height and width of the pictures in pixels.
    peak
        Largest displacement of any point in mm; ``None`` for 7 % of the longest side of what is printed.
    seed
        Of everything random: which struts are soft, which are missing, the waves of a warp.
    missing
        How many printed struts are missing.
    missing_share
        How much of each of these is missing, as a share of its length.
    printed
        Share of the struts that is printed, from the ground up (`print_share`); ``None`` for what the frame
        itself says.
    rig
        ``"ring"`` or ``"dome"``: how the cameras stand around the frame.
    deformation
        ``"sag"`` (gravity on struts of which one in four is soft), ``"tip-load"`` (the top pushed sideways),
        ``"warp"`` (a random smooth field) or ``"rigid"`` (the whole frame shifted and turned).
    supersampling
        Samples along each side of a pixel; 1 gives pictures of black and white only.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    views: ViewCount = 8
    size: PictureSize = (1200, 1600)
    peak: Annotated[float, above(0.0, noun="millimetres")] | None = None
    seed: Seed = 0
    missing: Annotated[int, at_least(0)] = 0
    missing_share: Annotated[float, above(0.0, up_to=1.0, noun="a share")] = 0.5
    printed: Annotated[float, above(0.0, up_to=1.0, noun="a share")] | None = None
    rig: Annotated[str, one_of(RIGS)] = "ring"
    deformation: Annotated[str, one_of(DEFORMATIONS)] = "sag"
    supersampling: Annotated[int, within(1, 16)] = 1

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True, eq=False)
class DeformedPrint:
    """A print that is not where its plan says.

    Attributes
    ----------
    frame
        The plan, with what has been printed.
    truth
        Where its struts really are.
    present
        (E, 2) interval of the curve parameter at which each strut of the truth is there.
    settings
        What it was made with.
    """

    frame: Wireframe
    truth: Wireframe
    present: np.ndarray
    settings: SimulationSettings

    @property
    def peak(self) -> float:
        """Largest displacement of a printed strut in mm."""
        part = self.frame.printed
        return largest_displacement(self.truth.control_points[part] - self.frame.control_points[part])


@dataclass(frozen=True, eq=False)
class Simulation(DeformedPrint):
    """A simulated capture in memory.

    Attributes
    ----------
    cameras
        Of the views.
    images
        (H, W) uint8 for each view, white where the print is.
    """

    cameras: tuple[Camera, ...]
    images: list[np.ndarray]


def deform_print(
    frame: Wireframe, settings: SimulationSettings | None = None, progress: ProgressCallback | None = None
) -> DeformedPrint:
    """Deform a frame, and let struts be missing; nothing is drawn.

    Parameters
    ----------
    frame
        The plan.
    settings
        See `SimulationSettings`; those of the pictures do not count.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        If the frame does not stand on the ground, the peak is out of reach, or more struts shall be missing
        than are printed.
    Cancelled
        If ``progress`` returns ``False``.
    """
    settings = SimulationSettings() if settings is None else settings
    plan = frame if settings.printed is None else print_share(frame, settings.printed)
    # A seed of its own: with the same one, the struts that are missing would be those that are soft.
    defect_seed = int(np.random.SeedSequence(settings.seed).generate_state(1)[0])
    present, _ = drop_struts(plan, settings.missing, defect_seed, share=settings.missing_share)
    truth = deform(plan, settings.deformation, SagSettings(peak=settings.peak, seed=settings.seed), progress=progress)
    return DeformedPrint(plan, truth, present, settings)


def simulate(
    frame: Wireframe, settings: SimulationSettings | None = None, progress: ProgressCallback | None = None
) -> Simulation:
    """Deform a frame, put cameras around it and take its silhouettes.

    The cameras see the whole plan, also what is not printed yet, and all of the deformed frame.

    Parameters
    ----------
    frame
        The plan.
    settings
        See `SimulationSettings`.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        As `deform_print`.
    Cancelled
        If ``progress`` returns ``False``.
    """
    made = deform_print(frame, settings, progress)
    settings, truth = made.settings, made.truth
    cameras = RIGS[settings.rig](box_around(made.frame, truth), settings.views, size=settings.size)
    images = silhouettes(truth, cameras, present=made.present, supersampling=settings.supersampling, progress=progress)
    return Simulation(made.frame, truth, made.present, settings, cameras, images)


def write_simulation(folder: PathLike, simulation: Simulation, overwrite: bool = False) -> None:
    """Write a simulation as a capture folder, whole or not at all.

    Beside the files of a capture there is ``simulation.json``, which says how it was made, and, where struts
    are missing, ``defects.json``, which says where.

    Raises
    ------
    InputError
        If the folder holds something already and ``overwrite`` is false, or cannot be written.
    """
    notes = {
        "format": "frametwin-simulation",
        "version": 1,
        "largest_displacement": simulation.peak,
        **dataclasses.asdict(simulation.settings),
    }
    extra = {NOTES_FILE: notes}
    defects = defects_json.to_dict(simulation.present, simulation.frame.printed)
    if len(defects["struts"]):
        extra[defects_json.FILE_NAME] = defects
    write_capture(
        folder,
        simulation.frame,
        simulation.cameras,
        simulation.images,
        truth=simulation.truth,
        extra=extra,
        overwrite=overwrite,
    )
