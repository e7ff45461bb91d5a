"""What one sample is: drawn from the recipe by the dataset's seed and the sample's index, and by nothing else.

Every part of a sample has a stream of random numbers of its own, spawned from the seed and the number of the scene, so
that a recipe that asks for other cameras still shows the same prints.
"""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path

import numpy as np

from frametwin.capture.transforms import read_cameras
from frametwin.dataset.drawing import (
    draw_calibration,
    draw_deformation,
    draw_errors,
    draw_printing,
    draw_render,
    draw_rig,
    weighted,
)
from frametwin.dataset.recipe import Deformation, RecipeFile
from frametwin.dataset.specification_values import Specification
from frametwin.errors import InputError
from frametwin.files import PathLike, dump_json, file_hash
from frametwin.formats import find_frame, frame_json
from frametwin.geometry.parametric import FRAMES
from frametwin.geometry.wireframe import Wireframe

PARTS = ("frame", "deformation", "printing", "rig", "look", "lens", "errors", "calibration")
"""The streams, in the order in which they are spawned."""


class Sampler:
    """Draws the specifications of a recipe's samples.

    Parameters
    ----------
    source
        The recipe.
    seed
        In place of the recipe's own.

    Raises
    ------
    InputError
        If a file that the recipe names is missing or damaged.
    """

    def __init__(self, source: RecipeFile, seed: int | None = None) -> None:
        self.source = source
        self.recipe = source.recipe
        self.seed = self.recipe.seed if seed is None else seed
        self.frames = [self._frame(choice.frame, i) for i, choice in enumerate(self.recipe.frames)]
        self._blends = {
            d.file: (self.source.resolve(d.file), _sha256(self.source.resolve(d.file), source.path, "deformations"))
            for d in self.recipe.deformations
            if d.file is not None
        }

        # Told now, and not once a sample, if the file is not as it should be.
        self._file_views = None if self.rig_file is None else len(read_cameras(self.rig_file[0]))

    @cached_property
    def rig_file(self) -> tuple[Path, str] | None:
        """The file with the cameras, and its hash."""
        if self.recipe.rig.file is None:
            return None
        path = self.source.resolve(self.recipe.rig.file)
        return path, _sha256(path, self.source.path, "rig.file")

    def _frame(self, name: str, i: int) -> tuple[Wireframe, str]:
        if name not in FRAMES and not self.source.resolve(name).exists():
            problem = f"there is no frame {name!r} beside the recipe, nor one of the project's own of that name"
            remedy = f"correct the path, or name one of {', '.join(FRAMES)}"
            raise InputError.at(self.source.path, f"frames[{i}].frame", problem, remedy)
        frame = find_frame(name, self.source.path.parent.resolve())
        return frame, hashlib.sha256(dump_json(frame_json.to_dict(frame)).encode()).hexdigest()

    def specification(self, index: int) -> Specification:
        """What the sample of this index is."""
        variants = len(self.recipe.rig.views)
        scene = index // variants
        streams = np.random.SeedSequence([self.seed, scene]).spawn(len(PARTS))
        rng = {part: np.random.Generator(np.random.Philox(s)) for part, s in zip(PARTS, streams, strict=True)}
        choice = weighted(rng["deformation"], self.recipe.deformations)
        deformation = self.recipe.deformations[choice]
        frame, digest, radius = self._choose_frame(rng["frame"], deformation)
        views = self.recipe.rig.views[index % variants] if self._file_views is None else self._file_views
        boards = self.recipe.calibration
        return Specification(
            index=index,
            scene=scene,
            frame=frame,
            frame_sha256=digest,
            radius=radius,
            deformation=draw_deformation(rng["deformation"], deformation),
            printing=draw_printing(rng["printing"], self.recipe.printing),
            rig=draw_rig(rng, self.recipe.rig, self.recipe.rig.views[index % variants]),
            rig_sha256=None if self.rig_file is None else self.rig_file[1],
            render=draw_render(rng["look"], self.recipe.render, views),
            errors=None if self.recipe.errors is None else draw_errors(rng["errors"], self.recipe.errors, views),
            calibration=None if boards is None else draw_calibration(rng["calibration"], boards),
        )

    def plan(self, specification: Specification) -> Wireframe:
        """The plan that a specification names, with its radius; not for those that come from a .blend."""
        for frame, digest in self.frames:
            if digest == specification.frame_sha256:
                radius = specification.radius
                return frame if radius is None else frame.replace(radius=np.full(frame.strut_count, radius))
        raise LookupError(specification.frame)

    def blend_file(self, specification: Specification) -> Path | None:
        """The .blend that holds plan and truth of a sample, if it comes from one."""
        if specification.deformation.kind != "blend":
            return None
        return next(path for path, digest in self._blends.values() if digest == specification.frame_sha256)

    def _choose_frame(self, rng: np.random.Generator, deformation: Deformation) -> tuple[str, str, float | None]:
        if deformation.file is not None:
            path, digest = self._blends[deformation.file]
            return path.name, digest, None
        i = weighted(rng, self.recipe.frames)
        choice = self.recipe.frames[i]
        return Path(choice.frame).name, self.frames[i][1], choice.radius


def _sha256(path: Path, recipe: PathLike, field: str) -> str:
    if not path.is_file():
        remedy = "correct the path, which counts from the recipe"
        raise InputError.at(recipe, field, f"there is no file {path}", remedy)
    return file_hash(path, "make it readable")
