"""Other ways in which a print can differ from its plan: moved as a whole, warped, pushed by the nozzle."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.displacement import largest_displacement
from frametwin.geometry.rotations import rotation_matrices
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.hardening import strut_stiffness
from frametwin.mechanics.sag import SAMPLES, SagSettings, sag, scaled_shape
from frametwin.mechanics.stiffness import FrameBeams, require_grounded
from frametwin.progress import Progress, ProgressCallback, report

DEFORMATIONS = ("sag", "warp", "rigid", "tip-load")
"""Kinds that `deform` knows."""

WAVES = 6
"""Plane waves in a random smooth warp."""

TOP_SHARE = 0.02
"""Vertices within this share of the print's height from its top are pushed by `tip_load`."""


def deform(
    frame: Wireframe,
    kind: str,
    settings: SagSettings,
    *,
    direction_deg: float = 0.0,
    progress: ProgressCallback | None = None,
) -> Wireframe:
    """Deform a frame in the way of that name.

    Parameters
    ----------
    frame
        The plan.
    kind
        One of `DEFORMATIONS`: ``"sag"``, ``"warp"`` (`smooth_warp`), ``"rigid"`` (`random_rigid_motion`) or
        ``"tip-load"`` (`tip_load`).
    settings
        The peak and the seed, and for beams how they harden.
    direction_deg
        Of a tip load.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        As the function of that kind.
    Cancelled
        If ``progress`` returns ``False``.
    """
    if kind == "sag":
        return sag(frame, settings, progress)
    report(progress, Progress("deforming", 0, 1))
    if kind == "tip-load":
        return tip_load(frame, settings, direction_deg=direction_deg)
    if kind == "warp":
        return smooth_warp(frame, settings.peak_of(frame), settings.seed)
    if kind == "rigid":
        return random_rigid_motion(frame, settings.peak_of(frame), settings.seed)
    raise ValueError(f"a deformation is one of {', '.join(DEFORMATIONS)}, not {kind!r}")


def rigid_motion(
    frame: Wireframe,
    rotation_deg: float | tuple[float, float, float] = 0.0,
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Wireframe:
    """Turn the whole frame about the centre of its bounding box, then shift it.

    Parameters
    ----------
    frame
        The plan; printed or not, grounded or not, everything moves.
    rotation_deg
        Degrees about the vertical, or a rotation vector (3,): its direction is the axis, its length the
        degrees.
    shift
        (3,) mm.

    Returns
    -------
    The moved frame; exact, as Bezier curves move with their control points.

    Raises
    ------
    InputError
        If a number is not finite, or there are not as many as needed.
    """
    vector = np.asarray(rotation_deg, dtype=np.float64)
    vector = np.array([0.0, 0.0, vector]) if vector.ndim == 0 else vector
    offset = np.asarray(shift, dtype=np.float64)
    for field, value in (("rotation_deg", vector), ("shift", offset)):
        if value.shape != (3,) or not np.isfinite(value).all():
            raise InputError.at("settings", field, f"is {value}", "give three finite numbers")
    rotation = rotation_matrices(np.radians(vector))
    centre = frame.bounds.mean(axis=0)
    return frame.replace(
        vertices=(frame.vertices - centre) @ rotation.T + centre + offset,
        control_points=(frame.control_points - centre) @ rotation.T + centre + offset,
    )


def random_rigid_motion(frame: Wireframe, peak: float, seed: int = 0) -> Wireframe:
    """Shift and turn the whole frame, half of the way by each, until its furthest point moved ``peak`` mm.

    Raises
    ------
    InputError
        If the peak is more than three quarters of the extent: the frame would lie somewhere else.
    """
    if not 0.0 < peak <= 0.75 * frame.extent:
        raise InputError.at("settings", "peak", f"is {peak:g} mm", f"give millimetres up to {0.75 * frame.extent:.4g}")
    rng = np.random.default_rng(seed)
    shift, axis = rng.normal(size=(2, 3))
    shift *= 0.5 * peak / np.linalg.norm(shift)
    arm = np.linalg.norm(np.ptp(frame.bounds, axis=0)) / 2.0
    axis *= np.degrees(0.5 * peak / arm) / np.linalg.norm(axis)

    def moved(scale: float) -> Wireframe:
        return rigid_motion(frame, tuple(scale * axis), tuple(scale * shift))

    def excess(scale: float) -> float:
        return largest_displacement(moved(scale).control_points - frame.control_points) - peak

    return moved(brentq(excess, 0.0, 4.0, xtol=1e-13, rtol=1e-12))


def smooth_warp(frame: Wireframe, peak: float, seed: int = 0) -> Wireframe:
    """Displace the frame by a random smooth field that knows nothing of beams; grounded vertices stay.

    The field is a sum of plane waves no shorter than the frame's longest side, faded out towards the grounded
    vertices. It is defined in all of space, so unprinted struts move as well.

    Parameters
    ----------
    frame
        The plan.
    peak
        Largest displacement of any point in mm.
    seed
        Of the waves.

    Returns
    -------
    The warped frame, its curves refitted from 31 displaced samples each.

    Raises
    ------
    InputError
        If the peak is not above 0 or nothing is free to move.
    """
    if not (np.isfinite(peak) and peak > 0.0):
        raise InputError.at("settings", "peak", f"is {peak}", "give a number above 0")
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(WAVES, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    waves = 2.0 * np.pi / frame.extent * directions * rng.uniform(0.3, 1.0, (WAVES, 1))
    phases = rng.uniform(0.0, 2.0 * np.pi, WAVES)
    amplitudes = rng.normal(size=(WAVES, 3))
    ground = frame.vertices[frame.grounded]

    def field(points: np.ndarray) -> np.ndarray:
        moved = np.sin(points @ waves.T + phases) @ amplitudes
        return moved * _fade(points, ground, 0.3 * frame.extent)[:, None]

    curve = bezier.evaluate(frame.control_points, np.arange(SAMPLES + 1) / SAMPLES)
    change = bezier.refit_matrix(SAMPLES) @ field(curve.reshape(-1, 3)).reshape(curve.shape)
    moved = field(frame.vertices)
    largest = largest_displacement(change)
    if not largest > 0.0:
        raise InputError.at(frame.name, "grounded", "holds every strut still", "ground fewer vertices")
    scale = peak / largest
    return frame.replace(vertices=frame.vertices + scale * moved, control_points=frame.control_points + scale * change)


def tip_load(frame: Wireframe, settings: SagSettings | None = None, *, direction_deg: float = 0.0) -> Wireframe:
    """Push the top of the print sideways, as a dragging nozzle or a draught would; its weight is left out.

    Parameters
    ----------
    frame
        The plan; see `frametwin.mechanics.sag.sag` for what happens to unprinted struts.
    settings
        Peak, and softness of the struts (as in `sag` with the same seed).
    direction_deg
        Direction of the push in the plane, counter-clockwise from x.

    Returns
    -------
    The deformed frame, its largest displacement at the peak.

    Raises
    ------
    InputError
        If nothing is printed, the print is not grounded, struts are loose, or the whole top is grounded.
    """
    settings = SagSettings() if settings is None else settings
    require_grounded(frame)
    peak = settings.peak_of(frame)
    hardening, material = settings.hardening, settings.material
    stiffness, _ = strut_stiffness(
        frame, hardening, peak=peak, seed=settings.seed, material=material, pieces=settings.pieces
    )
    beams = FrameBeams.build(
        frame,
        stiffness,
        axial_scale=hardening.axial(stiffness),
        material=material,
        weightless=True,
        pieces=settings.pieces,
    )
    height = frame.vertices[:, 2]
    printed = frame.printed_vertices()
    top = height[printed].max() - TOP_SHARE * np.ptp(height[printed])
    pushed = printed & ~frame.grounded & (height >= top)
    if not pushed.any():
        raise InputError.at(frame.name, "grounded", "holds the top of the print", "ground only vertices at its base")
    loads = np.zeros((frame.vertex_count, 6))
    angle = np.radians(direction_deg)
    loads[pushed, :2] = np.array([np.cos(angle), np.sin(angle)]) / pushed.sum()
    return scaled_shape(beams, beams.solve(loads), peak)


def _fade(points: np.ndarray, ground: np.ndarray, reach: float) -> np.ndarray:
    """Weights (N,) that rise smoothly from 0 on the ``ground`` (G, 3) to 1 well beyond ``reach`` mm from it.

    The distance is a smooth mean over the grounded points, dominated by the nearest, so the field has no
    creases halfway between them.
    """
    weight = np.ones(len(points))
    if len(ground) == 0:
        return weight
    for start in range(0, len(points), 4096):  # bounds the memory of all pairs
        part = slice(start, start + 4096)
        squared = np.sum((points[part, None] - ground) ** 2, axis=2)  # (N, G)
        with np.errstate(divide="ignore"):  # on the ground itself: 1 / inf = 0, as it should be
            distance = 1.0 / np.sqrt(np.mean(squared**-2.0, axis=1))
        weight[part] = distance / (distance + reach**2)
    return weight
