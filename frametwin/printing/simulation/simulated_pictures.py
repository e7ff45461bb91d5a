"""Pictures of a simulated print: the library's silhouettes, or Blender's masks and photos."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import write_capture, write_description
from frametwin.capture.scene import PhotoLook, Scene
from frametwin.errors import InputError
from frametwin.files import staged_directory
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.simulation.outcome import Standing
from frametwin.progress import ProgressCallback
from frametwin.ranges import check_settings, in_words, one_of, within
from frametwin.raster.silhouette import silhouettes

RENDERERS = ("library", "mask", "photo")

Renderer = Callable[[Scene, Path, ProgressCallback | None], Any]
"""Renders a scene into a folder that exists, as `frametwin.blender.rendering.client.render_in_child` does."""

FRAME = "frame.json"

VIEW_MARGIN = 0.15
"""How far the cameras' view reaches beyond the design, as a share of its longest side: prints sag and lean."""


@dataclass(frozen=True)
class SimulatedRig:
    """The rig of a simulated print: cameras that stay where they are, and what takes their pictures.

    Attributes
    ----------
    views
        Number of cameras, on a ring around the design.
    size
        Height and width of the pictures in pixels.
    render
        One of `RENDERERS`.
    samples
        Paths a pixel of photos.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    views: Annotated[int, within(2, 1000), in_words("a whole number from 2 to 1000, 8 are usual")] = 8
    size: Annotated[
        tuple[Annotated[int, within(8, 16384)], Annotated[int, within(8, 16384)]],
        in_words("height and width from 8 to 16384 pixels"),
    ] = (1200, 1600)
    render: Annotated[str, one_of(RENDERERS)] = "library"
    samples: Annotated[int, within(1, 4096)] = 8

    def __post_init__(self) -> None:
        check_settings(self)

    def require(self, renderer: Renderer | None) -> None:
        """Refuse pictures by Blender where no renderer was given.

        Raises
        ------
        InputError
            With what to do.
        """
        if self.render != "library" and renderer is None:
            remedy = "install it by 'python3 scripts/run.py setup', or let the library take the pictures"
            raise InputError.at("settings", "render", "needs Blender's module bpy, which is not installed", remedy)

    def cameras(self, design: Wireframe) -> tuple[Camera, ...]:
        """The cameras around a design."""
        low, high = design.bounds
        room = VIEW_MARGIN * design.extent
        box = np.stack([[*(low[:2] - room), low[2]], high + room])
        return ring_rig(box, self.views, size=self.size)

    def take(
        self,
        folder: Path,
        standing: Standing,
        cameras: Sequence[Camera],
        seed: int,
        renderer: Renderer | None = None,
        progress: ProgressCallback | None = None,
    ) -> bool:
        """Take pictures of what stands and write them as a capture folder: cameras and pictures, and nothing else.

        Parameters
        ----------
        folder
            The capture to be.
        standing
            Of a simulated print.
        cameras
            See `cameras`.
        seed
            Of the noise in photos.
        renderer
            Of masks and photos; see `require`.
        progress
            See `ProgressCallback`.

        Returns
        -------
        Whether there is anything to be seen; nothing is written otherwise.
        """
        pictured = standing.pictured
        if not pictured.printed.any():
            return False
        if self.render == "library":
            write_capture(folder, pictured, cameras, silhouettes(pictured, cameras, progress=progress))
            (folder / FRAME).unlink()  # it tells what really stands
            return True
        assert renderer is not None  # as `require` saw to
        look = PhotoLook(samples=self.samples, seed=seed)
        scene = Scene.whole(pictured, tuple(cameras), self.render, look=look)
        with staged_directory(folder) as stage:
            named = write_description(stage, pictured, cameras, name=folder)
            (stage / FRAME).unlink()
            renderer(replace(scene, cameras=named), stage, progress)
        return True
