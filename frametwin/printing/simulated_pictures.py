"""Pictures of a simulated print: the library's silhouettes, or Blender's masks and photos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from frametwin.cameras import Camera
from frametwin.capture import write_capture, write_description
from frametwin.errors import InputError
from frametwin.files import staged_directory
from frametwin.printing.outcome import Standing
from frametwin.progress import ProgressCallback
from frametwin.raster.silhouette import silhouettes
from frametwin.rendering import blender_is_here, render_in_child
from frametwin.rigs import ring_rig
from frametwin.scene import PhotoLook, Scene
from frametwin.wireframe import Wireframe

RENDERERS = ("library", "mask", "photo")

FRAME = "frame.json"

ROOM = 0.15
"""How far the cameras' view reaches beyond the design, as a share of its longest side: prints sag and lean."""


@dataclass(frozen=True)
class Rig:
    """Cameras that stay where they are for the whole print, and what takes their pictures.

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

    views: int = 8
    size: tuple[int, int] = (1200, 1600)
    render: str = "library"
    samples: int = 8

    def __post_init__(self) -> None:
        rules = (
            ("views", 2 <= self.views <= 1000, "give a whole number from 2 to 1000, 8 are usual"),
            (
                "size",
                len(self.size) == 2 and all(8 <= side <= 16384 for side in self.size),
                "give height and width from 8 to 16384 pixels",
            ),
            ("render", self.render in RENDERERS, f"give one of {', '.join(RENDERERS)}"),
            ("samples", 1 <= self.samples <= 4096, "give a whole number from 1 to 4096"),
        )
        for name, fine, remedy in rules:
            if not fine:
                raise InputError.at("settings", name, f"is {getattr(self, name)!r}", remedy)

    def require(self) -> None:
        """Refuse pictures by Blender where it is not installed.

        Raises
        ------
        InputError
            With what to do.
        """
        if self.render != "library" and not blender_is_here():
            remedy = "install it by 'python3 scripts/run.py setup', or let the library take the pictures"
            raise InputError.at("settings", "render", "needs Blender's module bpy, which is not installed", remedy)

    def cameras(self, design: Wireframe) -> tuple[Camera, ...]:
        """The cameras around a design."""
        low, high = design.bounds
        room = ROOM * design.extent
        box = np.stack([[*(low[:2] - room), low[2]], high + room])
        return ring_rig(box, self.views, size=self.size)

    def take(
        self,
        folder: Path,
        standing: Standing,
        cameras: Sequence[Camera],
        seed: int,
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
        look = PhotoLook(samples=self.samples, seed=seed)
        scene = Scene.whole(pictured, tuple(cameras), self.render, look=look)
        with staged_directory(folder) as stage:
            named = write_description(stage, pictured, cameras, name=folder)
            (stage / FRAME).unlink()
            render_in_child(replace(scene, cameras=named), stage, progress)
        return True
