"""One dataset folder as it is being made: which samples there are, and how one becomes part of it.

A sample is made in three steps, so that a Blender without the project's libraries can do the one in the middle:
`prepare` writes all but the pictures into a folder of its own, Blender renders into that, and `finish` hashes and
renames it. Whoever makes a sample holds its lock, and a lock dies with its process: nothing is left locked by a kill.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from frametwin import __version__
from frametwin.cameras.lens_warp import lens_warp
from frametwin.capture.board_scene import BOARDS_FILE, read_board_scene, write_board_scene
from frametwin.capture.capture import write_description
from frametwin.capture.image_files import write_png
from frametwin.capture.scene import PhotoLook, Scene, write_scene
from frametwin.dataset import folder as folders
from frametwin.dataset.calibration_shots import TRUTH_FILE, calibration_scene
from frametwin.dataset.camera_errors import TRUE_FILE, true_cameras_file
from frametwin.dataset.croissant import write_croissant
from frametwin.dataset.prints import SamplePrint, make_print
from frametwin.dataset.recipe import FORMAT, LIBRARY_RENDERER, RecipeFile, as_noted, read_recipe
from frametwin.dataset.specification import Sampler
from frametwin.dataset.specification_values import Specification
from frametwin.errors import FrameTwinError, InputError
from frametwin.files import PathLike, read_json, swap_in, write_bytes, write_json
from frametwin.formats import defects_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.curve_truth import curve_truth, write_curves
from frametwin.simulation.simulate import NOTES_FILE

SCENE_FILE = "scene.json"
LOCKS = ".locks"
RECIPE_COPY = "recipe.toml"


class Busy(FrameTwinError):
    """Another process is making the sample."""


@dataclass(frozen=True)
class Survey:
    """Indices of samples that have to be made and of those that are there, and what is wrong with damaged ones."""

    wanted: list[int] = field(default_factory=list)
    kept: list[int] = field(default_factory=list)
    damaged: dict[int, str] = field(default_factory=dict)


class DatasetRun:
    """The folder of a dataset and the recipe that fills it.

    Parameters
    ----------
    recipe
        Its file.
    out
        The folder.
    seed, count
        In place of the recipe's own.

    Raises
    ------
    InputError
        If the recipe, or a file that it names, cannot be used, or a number is out of range.
    """

    def __init__(self, recipe: PathLike, out: PathLike, seed: int | None = None, count: int | None = None) -> None:
        for name, value, least in (("seed", seed, 0), ("count", count, 1)):
            if value is not None and value < least:
                raise InputError.at("settings", name, f"is {value}", f"give a whole number from {least} up")
        self.source: RecipeFile = read_recipe(recipe)
        self.recipe = self.source.recipe
        self.out = Path(out).absolute()
        self.sampler = Sampler(self.source, seed)
        self.count = self.recipe.count if count is None else count

    @property
    def seed(self) -> int:
        """Of the dataset."""
        return self.sampler.seed

    def open(self) -> None:
        """Make the folder, or make sure that what is in it belongs to the same recipe and seed.

        Raises
        ------
        InputError
            If the folder holds something else, or cannot be written.
        """
        remedy = "choose another --out, or take the recipe and seed that it was begun with"
        stranger = self._stranger()
        if stranger is not None:
            raise InputError.at(self.out, "--out", f"holds {stranger}", remedy)
        try:
            self.out.mkdir(parents=True, exist_ok=True)
            # First of all, since it is what the folder is known by until there is a listing.
            write_bytes(self.out / RECIPE_COPY, self.source.path.read_bytes())
            (self.out / folders.SAMPLES).mkdir(exist_ok=True)
            (self.out / LOCKS).mkdir(exist_ok=True)
        except OSError as error:
            remedy = "choose a place that is writable"
            raise InputError.at(self.out, "--out", f"cannot be made ({error.strerror})", remedy) from error
        if not (self.out / folders.DATASET_FILE).exists():
            self.note()

    def _stranger(self) -> str | None:
        """What is in the folder, if that is no part of this dataset."""
        if not self.out.exists() or (self.out.is_dir() and not any(self.out.iterdir())):
            return None
        if (self.out / folders.DATASET_FILE).exists():
            known = self._known()
            if known.seed != self.seed:
                return "samples of another seed"
            same = as_noted(self.recipe, known.recipe, apart={"count"})
            return None if same else "samples of another recipe"
        copy = self.out / RECIPE_COPY
        if not copy.is_file() or copy.read_bytes() != self.source.path.read_bytes():
            return "something else"
        # The listing was lost; samples that are there say themselves what they are.
        for index in folders.sample_indices(self.out):
            try:
                found = folders.read_sample(self.folder(index)).specification
            except InputError:
                continue
            if found != self._notes(index):
                return "samples of another seed"
        return None

    def _known(self) -> folders.Dataset:
        file = self.out / folders.DATASET_FILE
        try:
            return folders.read_dataset(self.out)
        except InputError as error:
            remedy = "delete it and generate again: it is written anew from the samples"
            raise InputError.at(file, "file", f"is damaged ({error})", remedy) from error

    def note(self, failed: Sequence[tuple[int, str]] = (), tried: Collection[int] = ()) -> None:
        """Write what there is into ``dataset.json`` and ``croissant.json``.

        What failed earlier and is still missing stays noted, but for what is ``tried`` again now.
        """
        with FileLock(self.out / LOCKS / "dataset.lock"):
            file = self.out / folders.DATASET_FILE
            known = folders.read_dataset(self.out) if file.exists() else None
            reasons = (
                {} if known is None else {item.index: item.reason for item in known.failed if item.index not in tried}
            )
            reasons |= dict(failed)
            folders.write_dataset_json(
                self.out,
                name=self.recipe.name,
                description=self.recipe.description,
                recipe=self.recipe.model_dump(mode="json"),
                seed=self.seed,
                count=self.count if known is None else max(self.count, known.count),
                failed=reasons,
            )
            write_croissant(self.out)

    def indices(self, shard: tuple[int, int] = (1, 1)) -> list[int]:
        """Indices of the samples of one of ``n`` shards, ``(i, n)`` with i from 1.

        Raises
        ------
        InputError
            If there is no such shard.
        """
        if not (len(shard) == 2 and 1 <= shard[0] <= shard[1]):
            raise InputError.at("settings", "shard", f"is {shard}", "give i/n with i from 1 to n, as 2/3")
        return list(range(shard[0] - 1, self.count, shard[1]))

    def folder(self, index: int) -> Path:
        """Where a sample is, once it is made."""
        return self.out / folders.SAMPLES / folders.sample_name(index)

    def faults(self, index: int) -> list[str]:
        """What keeps a sample from being done, in words: it is missing, of another specification, or damaged."""
        folder = self.folder(index)
        if not folder.exists():
            return ["is missing"]
        try:
            if folders.read_sample(folder).specification != self._notes(index):
                return ["was made from other inputs"]
        except InputError as error:
            return [str(error)]
        return folders.check_sample(folder)

    def survey(self, indices: Sequence[int], progress: ProgressCallback | None = None) -> Survey:
        """Look which of some samples are done.

        Raises
        ------
        Cancelled
            If ``progress`` returns ``False``.
        """
        found = Survey()
        for i, index in enumerate(indices):
            faults = self.faults(index)
            (found.wanted if faults else found.kept).append(index)
            if faults and self.folder(index).exists():
                found.damaged[index] = faults[0]
            report(progress, Progress("checking samples", i + 1, len(indices)))
        return found

    def _notes(self, index: int) -> dict[str, Any]:
        return self.sampler.specification(index).model_dump(mode="json")

    @contextmanager
    def claim(self, index: int, wait: float = 0.0) -> Iterator[None]:
        """Be the only one who makes a sample, after waiting for that at most so many seconds.

        Raises
        ------
        Busy
            If another process is at it.
        """
        lock = FileLock(self.out / LOCKS / f"{folders.sample_name(index)}.lock")
        try:
            lock.acquire(timeout=wait)
        except Timeout as error:
            raise Busy(f"sample {index} is being made by another run") from error
        try:
            yield
        finally:
            lock.release()

    def stage(self, index: int) -> Path:
        """The folder in which a sample grows; only the holder of its lock touches it."""
        return self.out / folders.SAMPLES / f".{folders.sample_name(index)}.new.part"

    def prepare(
        self,
        index: int,
        shapes: tuple[Wireframe, Wireframe] | None = None,
        progress: ProgressCallback | None = None,
    ) -> Path:
        """Write everything of a sample that needs no Blender.

        Parameters
        ----------
        index
            Its number.
        shapes
            Plan and bent frame, for samples that come from a .blend file.
        progress
            Told of every step.

        Returns
        -------
        The folder in which it grows. If there is a ``scene.json`` in it, that has to be rendered into it.
        """
        specification = self.sampler.specification(index)
        plan, deformed = (self.sampler.plan(specification), None) if shapes is None else shapes
        rig = self.sampler.rig_file
        made = make_print(specification, plan, deformed, None if rig is None else rig[0], progress)
        self.give_up(index)
        stage = self.stage(index)
        stage.mkdir()
        notes = {
            "format": "frametwin-simulation",
            "version": 1,
            "largest_displacement": made.peak,
            "specification": specification.model_dump(mode="json"),
        }
        extra = {NOTES_FILE: notes}
        defects = defects_json.to_dict(made.present, made.plan.printed)
        if len(defects["struts"]):
            extra[defects_json.FILE_NAME] = defects
        stated = write_description(stage, made.plan, made.stated, made.truth, extra, name=self.folder(index))
        cameras = [replace(camera, name=shown.name) for camera, shown in zip(made.cameras, stated, strict=True)]
        if specification.errors is not None:
            write_json(stage / TRUE_FILE, true_cameras_file(cameras))
        write_curves(stage / "curves.npz", curve_truth(made.truth, made.present, made.thickness, cameras))
        scene = _scene(specification, made, cameras)
        if specification.render.style == LIBRARY_RENDERER:
            _draw(stage, scene, progress)
        else:
            write_scene(stage / SCENE_FILE, scene)
        if specification.calibration is not None:
            boards, known = calibration_scene(specification.calibration, made.plan, cameras)
            write_board_scene(stage / BOARDS_FILE, boards)
            (stage / TRUTH_FILE).parent.mkdir()
            write_json(stage / TRUTH_FILE, known)
        return stage

    def finish(self, index: int, made_with: dict[str, Any] | None = None) -> str:
        """Make a sample that has been rendered part of the dataset.

        Returns
        -------
        The hash of its content.

        Raises
        ------
        InputError
            If pictures are missing.
        """
        stage = self.stage(index)
        scene = stage / SCENE_FILE
        scene.unlink(missing_ok=True)
        boards = stage / BOARDS_FILE
        shots = [shot.file for shot in read_board_scene(boards).shots] if boards.is_file() else []
        boards.unlink(missing_ok=True)
        pictures = [view["file_path"] for view in read_json(stage / "transforms.json")["frames"]]
        missing = [name for name in [*pictures, *shots] if not (stage / name).is_file()]
        if missing:
            raise InputError.at(self.folder(index), missing[0], "was not rendered", "see what Blender said, try again")
        content = folders.write_sample_json(
            stage, index, self._notes(index), {"frametwin": __version__, **(made_with or {})}
        )
        folder = self.folder(index)
        if folder.is_symlink() or folder.is_file():
            folder.unlink()  # somebody has put it there; what it leads to is not touched
        swap_in(stage, folder)
        return content

    def tidy(self, index: int, wait: float = 2.0) -> None:
        """Remove what a process that died has left of a sample, unless another one is making it by now."""
        with suppress(Busy), self.claim(index, wait):
            self.give_up(index)

    def give_up(self, index: int) -> None:
        """Remove what there is of a sample that failed or was cut off; a sample that was there before stays."""
        for rest in (self.out / folders.SAMPLES).glob(f".{folders.sample_name(index)}.*part"):
            shutil.rmtree(rest, ignore_errors=True)


def _scene(specification: Specification, made: SamplePrint, cameras: Sequence[Any]) -> Scene:
    render = specification.render
    return Scene(
        truth=made.truth,
        present=made.present,
        thickness=made.thickness,
        cameras=tuple(cameras),
        style="mask" if render.style == LIBRARY_RENDERER else render.style,
        engine=render.engine,
        passes=render.passes,
        look=PhotoLook(**render.look),
    )


def _draw(stage: Path, scene: Scene, progress: ProgressCallback | None) -> None:
    (stage / "images").mkdir()
    warps = [lens_warp(camera) if camera.has_distortion else None for camera in scene.cameras]
    seen = [camera if warp is None else warp.pinhole for camera, warp in zip(scene.cameras, warps, strict=True)]
    pictures = silhouettes(scene.truth, seen, present=scene.present, thickness=scene.thickness, progress=progress)
    for camera, warp, picture in zip(scene.cameras, warps, pictures, strict=True):
        bent = picture if warp is None else np.rint(warp.linear(picture[..., None])[..., 0]).astype(np.uint8)
        write_png(stage / "images" / f"{camera.name}.png", bent)


@lru_cache(maxsize=4)
def opened(recipe: str, out: str, seed: int | None, count: int | None, digest: str | None) -> DatasetRun:
    """A run that is opened once a process.

    Raises
    ------
    InputError
        If the recipe is not the one (by `RecipeFile.digest`) that the run was begun with.
    """
    run = DatasetRun(recipe, out, seed, count)
    if digest is not None and run.source.digest != digest:
        raise InputError.at(recipe, "file", f"has been changed during the run ({FORMAT})", "start the run again")
    return run
