"""What is rendered, described without Blender: ``scene.json`` (format ``frametwin-scene``, version 1)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.cameras import Camera, from_nerfstudio, to_nerfstudio
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, write_json
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.ranges import check_settings, in_words, within

FORMAT = "frametwin-scene"
VERSION = 1
STYLES = ("mask", "photo")
ENGINES = ("auto", "workbench", "cycles")
WORKBENCH_WORKS = "FRAMETWIN_WORKBENCH"
"""Environment variable in which processes tell each other of the engine that had to be tried: ``1`` where it works,
``0`` where it does not."""

FORBIDDEN_IN_NAMES = '<>:"/\\|?*'


_Channel = Annotated[float, within(0.0, 1.0)]
Colour = Annotated[tuple[_Channel, _Channel, _Channel], in_words("three numbers from 0 to 1")]
_Place = Annotated[float, within(-5.0, 5.0)]
_Extent = Annotated[float, within(1e-3, 2.0)]
_Turn = Annotated[float, within(-360.0, 360.0)]
Piece = Annotated[
    tuple[Annotated[int, within(0, 2)], _Place, _Place, _Extent, _Extent, _Turn, _Channel, _Channel, _Channel],
    in_words("nine numbers: shape (0 box, 1 cylinder, 2 ball), x, y, width, height, degrees, red, green, blue"),
]
"""A thing on the table beside the print: shape, place of its middle from the frame's, width and height (all in sizes of
the frame), turn about the vertical, and colour."""


@dataclass(frozen=True)
class PhotoLook:
    """How photos look: numbers only, each within the range given (linear colours, lengths in mm).

    Attributes
    ----------
    strut_colour
        (3,) reflectance 0..1 of the printed plastic, linear RGB.
    strut_roughness
        0 (mirror) .. 1 (chalk).
    layer_height
        Mm, distance between the layers that are seen on the plastic; 0.02..10.
    layer_bump
        0..1, how deep the layers are for the light.
    layer_colour
        0..0.5, share by which the reflectance varies along the layers.
    table_colour, table_roughness
        Of the table below the frame, as for the struts.
    key, rim
        Irradiance of the large soft light above one side and of the smaller one on the other side; 0..10, where a
        white surface that faces an irradiance of pi is just white in the picture at exposure 0.
    fill
        0..3, light that comes evenly from everywhere (never seen by the camera itself); 0 gives deep shadows.
    light_azimuth, light_elevation
        Degrees of the key light from world x towards world y, and above the table; the rim light stands opposite.
    light_side
        Side of the square key light in sizes of the frame, 0.02..4: a small one throws hard shadows.
    clutter
        Things on the table, see `Piece`.
    exposure
        Stops, -5..5; 1 doubles every value.
    view_exposures
        Stops by which single views are brighter beside, in the order of the cameras; 0 for those that are not named.
    reference_exposure
        Stops by which the pictures without the print are brighter.
    reference_turn
        Degrees by which the lamps stood elsewhere, about the vertical, when the pictures without the print were taken.
    defocus
        Standard deviation of the blur of the lens in px, 0..10.
    vignetting
        0..0.9, share of the light that is lost in the corners.
    electrons
        What a pixel collects when it is just white, 100..1000000: fewer mean more shot noise.
    read_noise
        Electrons, standard deviation, 0..1000.
    samples
        Paths a pixel, 1..4096.
    denoise
        Whether Blender's denoiser cleans the picture (not the sensor noise, which comes after). Builds without one
        take four times the samples in its place.
    layered
        Whether print and surroundings are rendered apart and put together, which takes about a fifth of the time; the
        picture is the same but for its noise.
    seed
        Of the paths and of the sensor noise, together with the number of the view; 0..2147483647.
    """

    strut_colour: Colour = (0.78, 0.78, 0.76)
    strut_roughness: Annotated[float, within(0.0, 1.0)] = 0.55
    layer_height: Annotated[float, within(0.02, 10.0)] = 0.4
    layer_bump: Annotated[float, within(0.0, 1.0)] = 0.25
    layer_colour: Annotated[float, within(0.0, 0.5)] = 0.06
    table_colour: Colour = (0.006, 0.035, 0.20)
    table_roughness: Annotated[float, within(0.0, 1.0)] = 0.7
    key: Annotated[float, within(0.0, 10.0)] = 1.6
    rim: Annotated[float, within(0.0, 10.0)] = 0.7
    fill: Annotated[float, within(0.0, 3.0)] = 0.55
    light_azimuth: Annotated[float, within(-3600.0, 3600.0)] = 30.0
    light_elevation: Annotated[float, within(5.0, 90.0)] = 55.0
    light_side: Annotated[float, within(0.02, 4.0)] = 2.0
    clutter: tuple[Piece, ...] = ()
    exposure: Annotated[float, within(-5.0, 5.0)] = 0.0
    view_exposures: tuple[Annotated[float, within(-5.0, 5.0)], ...] = ()
    reference_exposure: Annotated[float, within(-5.0, 5.0)] = 0.0
    reference_turn: Annotated[float, within(-180.0, 180.0)] = 0.0
    defocus: Annotated[float, within(0.0, 10.0)] = 0.0
    vignetting: Annotated[float, within(0.0, 0.9)] = 0.0
    electrons: Annotated[float, within(100.0, 1e6)] = 8000.0
    read_noise: Annotated[float, within(0.0, 1000.0)] = 12.0
    samples: Annotated[int, within(1, 4096)] = 8
    denoise: bool = True
    layered: bool = True
    seed: Annotated[int, within(0, 2**31 - 1)] = 0

    def __post_init__(self) -> None:
        check_settings(self, "look")


@dataclass(frozen=True, eq=False)
class Scene:
    """A print, the cameras that see it and the kind of picture that is wanted.

    Attributes
    ----------
    truth
        The real geometry; only struts with ``truth.printed`` are there.
    present
        (E, 2) interval of the curve parameter at which each strut is there; ``[0, 0]``: not at all.
    thickness
        (E, K) real strut radius in mm at even parameters, linear in between, K >= 2.
    cameras
        Pictures are named after them. A lens that distorts is resampled from a pinhole camera's wider picture.
    style
        ``"mask"`` (white struts on black) or ``"photo"``.
    engine
        Of masks: ``"workbench"``, ``"cycles"``, or ``"auto"`` for the faster one that works here.
    passes
        Whether depth, normal and strut index are written too.
    look
        How photos look.

    Raises
    ------
    InputError
        For shapes that do not fit together, values out of range, and camera names that
        are no file names or not different from each other.
    """

    truth: Wireframe
    present: np.ndarray
    thickness: np.ndarray
    cameras: tuple[Camera, ...]
    style: str = "mask"
    engine: str = "auto"
    passes: bool = False
    look: PhotoLook = PhotoLook()

    def __post_init__(self) -> None:
        count = self.truth.strut_count
        present = checked_array(self.present, "f", (count, 2), "scene", "present")
        if np.any((present < 0.0) | (present > 1.0)) or np.any(present[:, 0] > present[:, 1]):
            raise InputError.at("scene", "present", "is not an interval", "give two rising numbers from 0 to 1 a strut")
        thickness = checked_array(self.thickness, "f", (count, None), "scene", "thickness")
        if thickness.shape[1] < 2 or np.any(thickness <= 0.0):
            raise InputError.at("scene", "thickness", "is not usable", "give two or more radii above 0 mm a strut")
        for field, value in (("present", present), ("thickness", thickness)):
            value.setflags(write=False)
            object.__setattr__(self, field, value)
        for field, allowed in (("style", STYLES), ("engine", ENGINES)):
            if getattr(self, field) not in allowed:
                raise InputError.at("scene", field, f"is {getattr(self, field)!r}", f"give one of {', '.join(allowed)}")
        object.__setattr__(self, "cameras", tuple(self.cameras))
        _check_cameras(self.cameras)

    @classmethod
    def whole(cls, truth: Wireframe, cameras: tuple[Camera, ...], style: str = "mask", **more: Any) -> Scene:
        """The scene of a print without faults: whole struts as thick as the frame says."""
        present = np.tile([0.0, 1.0], (truth.strut_count, 1))
        return cls(truth, present, np.repeat(truth.radius[:, None], 2, axis=1), cameras, style, **more)


def _check_cameras(cameras: tuple[Camera, ...]) -> None:
    if not cameras:
        raise InputError.at("scene", "cameras", "there is none", "give at least one camera")
    seen: set[str] = set()
    for camera in cameras:
        name = camera.name
        if not name.strip(". ") or any(ord(char) < 32 or char in FORBIDDEN_IN_NAMES for char in name):
            raise InputError.at("scene", "cameras", f"{name!r} is no name for a file", "name cameras like camera_00")
        if name.casefold() in seen:
            raise InputError.at("scene", "cameras", f"{name!r} occurs twice", "give each camera a name of its own")
        seen.add(name.casefold())


def to_dict(scene: Scene) -> dict[str, Any]:
    """Content of the file."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "style": scene.style,
        "engine": scene.engine,
        "passes": scene.passes,
        "look": dataclasses.asdict(scene.look),
        "cameras": [to_nerfstudio(camera, camera.name) for camera in scene.cameras],
        "truth": frame_json.to_dict(scene.truth),
        "present": scene.present,
        "thickness": scene.thickness,
    }


def from_dict(data: dict[str, Any], path: PathLike) -> Scene:
    """The scene of the parsed file ``path``.

    Raises
    ------
    InputError
        As `read_scene`.
    """
    check_format(data, path, FORMAT, VERSION)
    known = {"format", "version", *(field.name for field in fields(Scene))}
    unknown = sorted(data.keys() - known)
    if unknown:
        raise InputError.at(path, unknown[0], "is not a field of a scene", "remove it")
    look = _object(data, "look", path)
    unknown = sorted(look.keys() - {field.name for field in fields(PhotoLook)})
    if unknown:
        raise InputError.at(path, f"look.{unknown[0]}", "is not a setting of photos", "remove it")
    frames = data.get("cameras")
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise InputError.at(path, "cameras", "is not a list of cameras", "give entries as in transforms.json")
    cameras = tuple(from_nerfstudio(frame, source=f"{path}: cameras[{i}]") for i, frame in enumerate(frames))
    try:
        return Scene(
            truth=frame_json.parse(_object(data, "truth", path), path),
            present=data.get("present"),  # type: ignore[arg-type]  # checked there
            thickness=data.get("thickness"),  # type: ignore[arg-type]
            cameras=cameras,
            style=data.get("style", "mask"),
            engine=data.get("engine", "auto"),
            passes=bool(checked_array(data.get("passes", False), "b", (), str(path), "passes")),
            look=PhotoLook(**look),
        )
    except InputError as error:
        if error.source == str(path):
            raise
        raise error.inside(path) from error


def _object(data: dict[str, Any], key: str, path: PathLike) -> dict[str, Any]:
    value = data.get(key, {} if key == "look" else None)
    if not isinstance(value, dict):
        raise InputError.at(path, key, "is not a JSON object", "put its fields between { and }")
    return value


def write_scene(path: PathLike, scene: Scene) -> None:
    """Write a scene file; reading it gives back the same bits.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_json(Path(path), to_dict(scene))


def read_scene(path: PathLike) -> Scene:
    """Read a scene file.

    Raises
    ------
    InputError
        If the file is missing or damaged, of another format or version, or does not hold a valid scene.
    """
    return from_dict(read_json(path), path)
