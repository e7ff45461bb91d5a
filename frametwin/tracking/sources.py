"""What is followed: a run's twin, or the batch of a print job that is being printed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.image_files import read_image_bytes
from frametwin.capture.transforms import read_cameras
from frametwin.capture.views import TRANSFORMS
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.fitting.camera_corrections import as_found
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.decoding import decoded, eight_bits
from frametwin.printing.job import job_files as files
from frametwin.printing.job.job import PrintJob
from frametwin.tracking.pictures import require_size
from frametwin.twin.runs import is_run, load_run
from frametwin.twin.twin import Twin


@dataclass(frozen=True, eq=False)
class Followed:
    """What is followed.

    Attributes
    ----------
    frame : Wireframe
        The plan; its printed struts are looked for.
    twin : Twin or None
        From which to start; the plan as it is where there is none.
    awaited : (E,) bool array
        Struts that are being laid.
    batch : int or None
        Of a job.
    job : PrintJob or None
    """

    frame: Wireframe
    twin: Twin | None
    awaited: np.ndarray
    batch: int | None = None
    job: PrintJob | None = None

    @property
    def gone_on(self) -> bool:
        """Whether a job has been answered meanwhile, so that something else is to be followed."""
        return self.job is not None and self.job.current != self.batch


def read_followed(path: PathLike) -> Followed:
    """Read what is to be followed.

    Raises
    ------
    InputError
        If it is neither a run nor a job, or a job that is finished.
    """
    path = Path(path)
    if is_run(path):
        twin, frame = load_run(path)
        return Followed(frame, twin, np.zeros(frame.strut_count, dtype=bool))
    if not (path / files.JOB).is_file():
        remedy = "give the folder that frametwin fit has written, or that of a print job"
        raise InputError.at(path, "folder", "is neither a run nor a print job", remedy)
    return of_job(PrintJob(path))


def of_job(job: PrintJob) -> Followed:
    """The batch of a job that is being printed.

    Raises
    ------
    InputError
        If the print is finished.
    """
    batch = job.current
    if batch is None:
        remedy = "follow the last twin of its batches instead"
        raise InputError.at(job.folder, "job", "is finished", remedy)
    expected = job.expectation(batch)
    awaited = np.zeros(expected.frame.strut_count, dtype=bool)
    awaited[expected.laid] = True
    return Followed(expected.frame, None, awaited, batch, job)


def cameras_for(followed: Followed, given: PathLike | None, stream: Path | None) -> tuple[Camera, ...]:
    """The cameras of a stream: those that were given, those beside its pictures, or those of the job's last batch.

    Where the twin that is followed has found cameras elsewhere than the rig has them, they are taken from there.

    Raises
    ------
    InputError
        If there are none.
    """
    places = [_transforms(Path(given))] if given is not None else []
    if not places and stream is not None:
        places.append(stream / TRANSFORMS)
    if given is None and followed.job is not None and followed.batch:
        places.append(followed.job.batch_folder(followed.batch - 1) / files.CAPTURE / TRANSFORMS)
    for place in places:
        if place.is_file() or given is not None:
            return _as_found(read_cameras(place), followed)
    remedy = f"put {TRANSFORMS} beside the pictures, or give --cameras"
    raise InputError.at("stream" if stream is None else stream, "cameras", "are not known", remedy)


def _as_found(cameras: Sequence[Camera], followed: Followed) -> tuple[Camera, ...]:
    corrections = () if followed.twin is None else followed.twin.cameras
    names = {camera.name for camera in cameras}
    own = [correction for correction in corrections if correction.get("name") in names]
    return tuple(as_found(cameras, own)) if len(own) == len(cameras) else tuple(cameras)


def _transforms(path: Path) -> Path:
    return path / TRANSFORMS if path.is_dir() else path


def backgrounds_for(
    cameras: Sequence[Camera], given: PathLike | None, stream: Path | None
) -> list[np.ndarray | None] | None:
    """The views before printing, named after the cameras; ``None`` where there are none.

    Raises
    ------
    InputError
        If the folder that was given does not exist, or a picture in it is missing, damaged or of another size than
        its camera's.
    """
    folder = Path(given) if given is not None else None if stream is None else stream / "background"
    if folder is None or (given is None and not folder.is_dir()):
        return None
    if not folder.is_dir():
        raise InputError.at(folder, "folder", "does not exist", "give the folder of the views before printing")
    found: list[np.ndarray | None] = []
    for camera in cameras:
        pictures = [path for path in sorted(folder.iterdir()) if path.stem == camera.name]
        if not pictures:
            problem = f"holds no picture of {camera.name}"
            raise InputError.at(folder, "background", problem, "put the view before printing there")
        picture = eight_bits(decoded(read_image_bytes(pictures[0]), pictures[0]))
        require_size(picture, camera, str(pictures[0]))
        found.append(picture)
    return found
