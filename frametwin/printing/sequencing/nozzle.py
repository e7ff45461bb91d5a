"""The tool: a nozzle with a conical tip below an extruder's body, a body of revolution about the tool's axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.ranges import at_least, check_settings, check_values, in_words

TIP_SHARE = 0.8
"""Radius of the flat end of a nozzle, in radii of the strut it lays: a strand is a little wider than its nozzle."""

BEAD_SHARE = 4.0
"""Reach of the soft bead about the tip, in strut radii: two rods that meet at a right angle, one under the tip and
one beside it, touch the cone within 2.1 of them; at 45 degrees within 3.6."""

CLEARANCE_SHARE = 0.1
"""Air that is kept to what is printed, in strut radii."""

HALF_ANGLE = math.radians(12.0)
CONE_SHARE = 4.0
"""Half the opening of the default cone, and its length in median struts: the slender tips of wireframe extruders."""

BODY_SHARE = 1.25
"""Radius of the extruder's body in radii of the cone's upper end."""


Length = Annotated[float, at_least(1e-9, below=1e6), in_words("a length in mm above 0, below a kilometre")]
Gap = Annotated[float, at_least(0.0, below=1e6), in_words("a length in mm from 0 up, below a kilometre")]


@dataclass(frozen=True)
class Nozzle:
    """A tool that is symmetric about its axis. Its tip is at the origin, its axis points away from the print; mm.

    Attributes
    ----------
    tip_radius
        Of the flat end.
    cone_length
        From the tip to the extruder's body.
    cone_radius
        Of the cone's upper end; at least `tip_radius`.
    body_radius
        Of the cylinder above; at least `cone_radius`.
    body_length
        Of the cylinder. As long as the frame is large, the tool can be drawn back along its axis from
        wherever it may stand: nothing of it comes where nothing of it was.
    bead
        How near to the tip the nozzle may touch struts that the strut being laid is joined to.
    clearance
        Air between the nozzle and every printed strut, apart from the bead.

    Raises
    ------
    InputError
        If a size is impossible.
    """

    tip_radius: Length
    cone_length: Length
    cone_radius: Length
    body_radius: Length
    body_length: Length
    bead: Gap
    clearance: Gap = 0.0

    def __post_init__(self) -> None:
        check_settings(self)
        if self.cone_radius < self.tip_radius:
            raise _refuse("cone_radius", self.cone_radius, f"give at least the tip's radius, {self.tip_radius:g} mm")
        if self.body_radius < self.cone_radius:
            raise _refuse("body_radius", self.body_radius, f"give at least the cone's radius, {self.cone_radius:g} mm")
        if self.bead < self.tip_radius:
            raise _refuse("bead", self.bead, f"give at least the tip's radius, {self.tip_radius:g} mm")

    @classmethod
    def fitting(cls, frame: Wireframe, **sizes: float) -> Nozzle:
        """A nozzle that suits the struts of ``frame``; what is in ``sizes`` is taken from there.

        Raises
        ------
        InputError
            If a size is impossible.
        """
        sizes = check_values(cls, sizes)
        radius = float(np.median(frame.radius))
        length = float(np.median(frame.lengths))
        tip = sizes.get("tip_radius", TIP_SHARE * radius)
        cone = sizes.get("cone_length", CONE_SHARE * length)
        upper = sizes.get("cone_radius", tip + cone * math.tan(HALF_ANGLE))
        values = {
            "tip_radius": tip,
            "cone_length": cone,
            "cone_radius": upper,
            "body_radius": BODY_SHARE * upper,
            "body_length": 2.0 * frame.extent,
            "bead": max(tip, BEAD_SHARE * radius),
            "clearance": CLEARANCE_SHARE * radius,
        }
        return cls(**{**values, **sizes})

    def long_enough(self, frame: Wireframe) -> Nozzle:
        """This nozzle with a body that towers above ``frame``, as the arm that carries it would.

        What such a tool misses, it also misses when it is drawn back along its axis.
        """
        return replace(self, body_length=max(self.body_length, 2.0 * frame.extent))

    @property
    def length(self) -> float:
        """From the tip to the upper end of the body, mm."""
        return self.cone_length + self.body_length

    @property
    def profile(self) -> np.ndarray:
        """(2, 4) array, mm: lower and upper end and the radii there, of the cone and of the body; both are convex."""
        low = [0.0, self.cone_length, self.tip_radius, self.cone_radius]
        return np.array([low, [self.cone_length, self.length, self.body_radius, self.body_radius]])

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Find the distance of points from the surface, the tip being at the origin and the axis along z.

        Parameters
        ----------
        points : (..., 3) array, mm

        Returns
        -------
        (...) array, mm
            Below 0 inside. Exact outside; inside, the depth below the nearest face of the deeper of the two parts.
        """
        points = np.asarray(points, dtype=np.float64)
        rho, height = np.hypot(points[..., 0], points[..., 1]), points[..., 2]
        return np.minimum(*(_frustum_distance(rho, height, *part) for part in self.profile))

    def lowest(self, normal: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Find how far the nozzle reaches against a direction, from its tip.

        Parameters
        ----------
        normal : (3,) array
            Unit vector of the direction.
        axes : (..., 3) array
            Unit vectors along the tool, from the tip upwards.

        Returns
        -------
        (...) array, mm
            Least coordinate along ``normal`` of any point of the nozzle; 0 is that of the tip.
        """
        along = np.asarray(axes, dtype=np.float64) @ np.asarray(normal, dtype=np.float64)
        across = np.sqrt(np.maximum(0.0, 1.0 - along**2))
        rims = [(part[end], part[2 + end]) for part in self.profile for end in (0, 1)]
        return np.min([height * along - radius * across for height, radius in rims], axis=0)

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def _refuse(field: str, value: Any, remedy: str) -> InputError:
    return InputError.at("nozzle", field, f"is {value!r}", remedy)


def _frustum_distance(
    rho: np.ndarray, height: np.ndarray, low: float, high: float, lower: float, upper: float
) -> np.ndarray:
    """Signed distance from a frustum about z; its outline in the half-plane of radius and height is convex."""
    side = np.array([upper - lower, high - low])
    size = float(np.hypot(*side))
    beyond = ((rho - lower) * side[1] - (height - low) * side[0]) / size
    inside = np.maximum(np.maximum(low - height, height - high), beyond)
    along = np.clip(((rho - lower) * side[0] + (height - low) * side[1]) / size**2, 0.0, 1.0)
    edge = np.hypot(rho - lower - along * side[0], height - low - along * side[1])
    bottom = np.hypot(np.maximum(0.0, rho - lower), height - low)
    top = np.hypot(np.maximum(0.0, rho - upper), height - high)
    return np.where(inside <= 0.0, inside, np.minimum(np.minimum(edge, bottom), top))
