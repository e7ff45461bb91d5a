"""What the add-on remembers of how a capture is fitted, and what the worker is asked of it."""

# No postponed annotations here: Blender reads them as properties.
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from frametwin.capture.capture import Capture
from frametwin.errors import InputError

from .folders import given_folder
from .layouts import field
from .picture_settings import FOLDER
from .steps import settings_of

PRESETS = (
    ("fast", "Fast", "Blurred rods and second-order steps: seconds on a laptop, the most accurate"),
    ("paper", "Paper", "The paper's method: a neural network, minutes"),
    ("paper-letter", "Paper, to the letter", "The same by the letter of its text, which ends further off"),
    ("paper-lattice", "Paper, lattice", "The paper's kernels with a spline lattice in place of the network"),
    ("curve-driven", "Curve-driven", "Free control points, for comparison"),
    ("deformation-driven", "Deformation-driven", "Sparse control nodes, for comparison"),
)

MASKS = (
    ("auto", "In Any Light", "Photographs are compared with those before printing; keeps the shaded side of struts"),
    ("paper", "Paper's Rule", "What is bright and without colour is print, as in the paper"),
)

CAMERAS = (
    ("auto", "May Err", "They move within the errors of their calibration, where the pictures ask for it"),
    ("exact", "Exact", "They are believed to the last digit"),
)

ANCHORS = (
    ("auto", "More Probable", "The feet or the cameras, whichever is more probable"),
    ("feet", "Feet", "The feet on the plate stand where the plan has them"),
    ("cameras", "Cameras", "The cameras stand where their calibration has them"),
    ("plate", "Plate", "The markers on the plate, which the capture must have"),
)

LEAVE_OUT = "Leave Out"
"""What the panels call the folder that is ``--ignore`` of the command line."""


class FrameTwinFit(bpy.types.PropertyGroup):
    """How a capture is fitted."""

    capture: StringProperty(  # type: ignore[valid-type]
        name="Capture",
        description="Folder with frame.json, transforms.json and images; rendering fills it in",
        **FOLDER,
    )
    preset: EnumProperty(name="Preset", description="The method", items=PRESETS)  # type: ignore[valid-type]
    seed: IntProperty(name="Seed", min=0, description="Of what a preset draws at random")  # type: ignore[valid-type]
    warm: BoolProperty(  # type: ignore[valid-type]
        name="Start at This Twin",
        description="Begin at the twin that is shown, where it is one of the same frame: quicker for the next batch",
    )
    mask: EnumProperty(  # type: ignore[valid-type]
        name="Mask",
        description="How photographs become masks; pictures that are masks stay as they are",
        items=MASKS,
    )
    ignore: StringProperty(  # type: ignore[valid-type]
        name=LEAVE_OUT,
        description="Folder with pictures named as the views' own, white where nothing is to be looked at, such as the"
        " robot's arm. Empty: all is looked at",
        **FOLDER,
    )
    cameras: EnumProperty(  # type: ignore[valid-type]
        name="Cameras",
        description="Whether cameras may be a little elsewhere than the capture says",
        items=CAMERAS,
    )
    anchor: EnumProperty(  # type: ignore[valid-type]
        name="Anchor", description="What holds the world when cameras move", items=ANCHORS
    )


def mask_parameters(context: bpy.types.Context) -> dict[str, Any]:
    """What the worker is told of masks, as the panels say: as --mask and --ignore of the command line.

    Raises
    ------
    InputError
        If the folder is relative to a file that was not saved.
    """
    fit = settings_of(context).fit
    left_out = {"ignore": given_folder(fit.ignore, LEAVE_OUT)} if fit.ignore else {}
    return {"mask": fit.mask, **left_out}


def camera_changes(context: bpy.types.Context, capture: Capture) -> dict[str, str]:
    """Settings of the fast fit, as the panel says: as --cameras and --anchor of the command line.

    Raises
    ------
    InputError
        If the markers of the plate shall hold the world, and the capture tells of none.
    """
    fit = settings_of(context).fit
    if fit.preset != "fast":
        return {}  # the others take the cameras as they are, and the panel shows no choice
    if fit.anchor == "plate" and capture.plate is None:
        remedy = "choose another Anchor, or make the capture with a rig that was placed by a plate"
        raise InputError.at(capture.root, "plate", "the capture tells of no markers on the plate", remedy)
    hold = "cameras" if fit.anchor == "plate" else fit.anchor  # the markers are in what is known of them
    return {name: value for name, value in (("cameras", fit.cameras), ("hold", hold)) if value != "auto"}


def draw_mask(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """How photographs become masks."""
    fit, column = settings_of(context).fit, layout.column(align=True)
    field(column, context, fit, "mask")
    field(column, context, fit, "ignore")


CLASSES = ()
