"""Pictures of a simulated print: the library's silhouettes, or Blender's masks and photos."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rig_file import FILE_NAME as RIG_FILE
from frametwin.cameras.rig_file import Rig, RigCamera, rig_data
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import write_capture, write_description
from frametwin.capture.scene import PhotoLook, Scene
from frametwin.errors import InputError
from frametwin.files import staged_directory, write_json
from frametwin.geometry.rotations import rotation_matrices
from frametwin.geometry.wireframe import Wireframe, straight_control_points
from frametwin.printing.simulation.outcome import Standing
from frametwin.progress import ProgressCallback
from frametwin.ranges import PictureSize, ViewCount, at_least, check_settings, one_of, within
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
    turn_error, shift_error
        By how many degrees and mm each camera is off from where the job is told that it is, each in a direction of its
        own that the print's seed draws. A good calibration has 0.05 degrees and 0.3 mm. Only in the library's pictures.
    blob
        Radius of the ball of material at each joint, as a multiple of the thickest strut's there; 0 for none. Only in
        the library's pictures.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    views: ViewCount = 8
    size: PictureSize = (1200, 1600)
    render: Annotated[str, one_of(RENDERERS)] = "library"
    samples: Annotated[int, within(1, 4096)] = 8
    turn_error: Annotated[float, at_least(0.0)] = 0.0
    shift_error: Annotated[float, at_least(0.0)] = 0.0
    blob: Annotated[float, at_least(0.0)] = 0.0

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
        if self.render != "library" and (self.turn_error or self.shift_error or self.blob):
            remedy = "let the library take the pictures, or leave camera errors and blobs out"
            raise InputError.at("settings", "render", "takes pictures without camera errors and blobs", remedy)

    def cameras(self, design: Wireframe) -> tuple[Camera, ...]:
        """The cameras around a design."""
        low, high = design.bounds
        room = VIEW_MARGIN * design.extent
        box = np.stack([[*(low[:2] - room), low[2]], high + room])
        return ring_rig(box, self.views, size=self.size)

    def told(self, cameras: Sequence[Camera], seed: int) -> tuple[Camera, ...]:
        """The cameras as a calibration with errors has them."""
        if not (self.turn_error or self.shift_error):
            return tuple(cameras)
        rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
        return tuple(_misplaced(camera, rng, self.turn_error, self.shift_error) for camera in cameras)

    def _calibrated(self, told: Sequence[Camera]) -> Rig:
        """The rig of a calibration that knows how well it has done: poses err by so much, lenses do not."""
        turn, shift = np.radians(self.turn_error) / np.sqrt(3.0), self.shift_error / np.sqrt(3.0)
        covariance = np.diag([*np.zeros(9), *3 * [turn**2], *3 * [shift**2]])
        return Rig(tuple(RigCamera.of(camera, covariance) for camera in told), world="robot")

    def take(
        self,
        folder: Path,
        standing: Standing,
        cameras: Sequence[Camera],
        seed: int,
        renderer: Renderer | None = None,
        progress: ProgressCallback | None = None,
        told: Sequence[Camera] | None = None,
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
        told
            What the capture says of the cameras, where that is not the truth; see `told`.

        Returns
        -------
        Whether there is anything to be seen; nothing is written otherwise.
        """
        pictured = standing.pictured
        if not pictured.printed.any():
            return False
        if self.render == "library":
            seen = with_blobs(pictured, self.blob) if self.blob else pictured
            pictures = silhouettes(seen, cameras, progress=progress)
            write_capture(folder, pictured, cameras if told is None else told, pictures)
            (folder / FRAME).unlink()  # it tells what really stands
            if told is not None and (self.turn_error or self.shift_error):
                write_json(folder / RIG_FILE, rig_data(self._calibrated(told)))
            return True
        assert renderer is not None  # as `require` saw to
        look = PhotoLook(samples=self.samples, seed=seed)
        scene = Scene.whole(pictured, tuple(cameras), self.render, look=look)
        with staged_directory(folder) as stage:
            named = write_description(stage, pictured, cameras, name=folder)
            (stage / FRAME).unlink()
            renderer(replace(scene, cameras=named), stage, progress)
        return True


def with_blobs(frame: Wireframe, size: float) -> Wireframe:
    """The printed struts of a frame with a ball of material at each joint, so many times as thick as a strut there.

    A ball is drawn as a strut that is next to nothing long.
    """
    printed = frame.printed_part()[0]
    radius = np.zeros(printed.vertex_count)
    np.maximum.at(radius, printed.edges, np.repeat(printed.radius[:, None], 2, axis=1))
    joints = np.flatnonzero(radius > 0.0)
    tops = printed.vertices[joints] + np.array([0.0, 0.0, 1e-3])
    own = np.column_stack([joints, printed.vertex_count + np.arange(len(joints))])
    vertices = np.concatenate([printed.vertices, tops])
    return Wireframe.create(
        vertices,
        np.concatenate([printed.edges, own]),
        control_points=np.concatenate([printed.control_points, straight_control_points(vertices, own)]),
        radius=np.concatenate([printed.radius, size * radius[joints]]),
        name=frame.name,
    )


def _misplaced(camera: Camera, rng: np.random.Generator, degrees: float, mm: float) -> Camera:
    """A camera turned and shifted by so much, each in a random direction."""
    pose = np.array(camera.camera_to_world)
    turn, shift = rng.normal(size=3), rng.normal(size=3)
    pose[:3, :3] = pose[:3, :3] @ rotation_matrices(np.radians(degrees) * turn / np.linalg.norm(turn))
    pose[:3, 3] += mm * shift / np.linalg.norm(shift)
    return replace(camera, camera_to_world=pose)
