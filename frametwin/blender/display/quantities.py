"""The quantities that the colours of struts can show, and which of their values are the bad ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

HIGH, LOW, BOTH = "high", "low", "both"
"""Where the bad values are: the highest, the lowest, or the farthest from 0 on either side."""


@dataclass(frozen=True)
class Quantity:
    """A quantity.

    Attributes
    ----------
    key
        Its name in `frametwin.blender.display.statistics.strut_values`.
    name, description
        For the user.
    unit
        ``"mm"`` or none.
    attribute
        The named attribute of a twin's Curves that holds it.
    bad
        `HIGH`, `LOW` or `BOTH`.
    in_units
        Whether the attribute is in Blender units.
    """

    key: str
    name: str
    unit: str
    attribute: str
    bad: str
    description: str
    in_units: bool = False

    def automatic_range(self, values: np.ndarray) -> tuple[float, float]:
        """The ends of the colours that suit values (E,): from 0 where high is bad, else where the values are.

        Of what is equal all over, a range about it that shows no difference where there is none.
        """
        known = values[np.isfinite(values)]
        if not len(known):
            return 0.0, 1.0
        low, high = float(known.min()), float(known.max())
        if self.bad == BOTH:
            high = max(abs(low), abs(high)) or 1.0
            return -high, high
        if self.bad == HIGH:
            return min(0.0, low), high if high > min(0.0, low) else min(0.0, low) + 1.0
        least = max(0.02 * abs(high), 1e-6)
        return min(low, high - least), high

    def badness(self, values: np.ndarray) -> np.ndarray:
        """(E,) values that are the higher the worse they are; NaN where there is none."""
        return np.asarray(-values if self.bad == LOW else np.abs(values) if self.bad == BOTH else values)


_ALL = (
    Quantity("displacement", "Displacement", "mm", "displacement_mean", HIGH, "Mean distance from the plan, in mm"),
    Quantity(
        "displacement_max",
        "Largest displacement",
        "mm",
        "displacement_max",
        HIGH,
        "Largest distance from the plan along each strut, in mm",
    ),
    Quantity("opacity", "Opacity", "", "opacity", LOW, "Opacity along each strut: how much of it the pictures show"),
    Quantity("completeness", "Completeness", "", "completeness", LOW, "Share of the strut that is really there"),
    Quantity("radius", "Radius", "mm", "radius", LOW, "Radius along each strut, in mm", in_units=True),
    Quantity(
        "confidence",
        "Confidence",
        "",
        "confidence",
        LOW,
        "How well the views tell where the strut is: 0 not at all, 1 well",
    ),
    Quantity(
        "sigma",
        "Standard deviation",
        "mm",
        "sigma",
        HIGH,
        "How far the strut may be off across itself, in mm: one standard deviation",
    ),
    Quantity(
        "sigma_along",
        "Deviation along",
        "mm",
        "sigma_along",
        HIGH,
        "How far the strut may be off along itself, in mm: one standard deviation",
    ),
    Quantity(
        "gap",
        "Torn ends",
        "mm",
        "gap",
        HIGH,
        "How far an end of the strut is from its joint, in mm; 0 for ends that are not torn",
    ),
    Quantity("error", "Error", "mm", "error", HIGH, "Mean distance from the truth, in mm, where the capture has one"),
    Quantity(
        "error_max", "Largest error", "mm", "error_max", HIGH, "Largest distance from the truth along each strut, in mm"
    ),
    Quantity(
        "distance",
        "Height above plan",
        "mm",
        "distance",
        BOTH,
        "Distance from the strut's plan along each strut, in mm: below 0 where it hangs lower than planned",
    ),
    Quantity(
        "difference",
        "Distance from other",
        "mm",
        "difference",
        HIGH,
        "Distance from the twin that this one was compared with, along each strut, in mm",
    ),
    Quantity("batch", "Batch", "", "batch", HIGH, "In which batch the strut is printed"),
)

QUANTITIES = {quantity.key: quantity for quantity in _ALL}
"""By key, in the order in which they are offered."""


def quantity_named(key: str) -> Quantity:
    """A quantity; one that is not known is shown by the attribute of its name, and its highest values are bad."""
    return QUANTITIES.get(key) or Quantity(key, key.replace("_", " ").capitalize(), "", key, HIGH, "")


def quantity_shown_by(attribute: str) -> Quantity:
    """The quantity that an attribute holds; of one that the user has made, one of its own name."""
    found = next((quantity for quantity in _ALL if quantity.attribute == attribute), None)
    return found or quantity_named(attribute)
