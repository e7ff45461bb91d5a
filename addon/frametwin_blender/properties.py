"""What the add-on remembers in a scene. Lengths are millimetres, whatever the scene's unit."""

# No postponed annotations here: Blender reads them as properties.
from math import radians

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from frametwin.blender.display.colours import MAPS
from frametwin.blender.display.quantities import QUANTITIES
from frametwin.blender.display.twins import is_twin

from .fit_settings import FrameTwinFit
from .frames_offered import FRAME_ITEMS
from .in_view import can_be_chosen, distance_changed, plan_chosen, twin_chosen
from .picture_settings import FrameTwinPictures
from .recolour import recolour_active, recolour_afresh, restyle_active
from .translations import in_own_context

COLOURS = tuple((found.key, found.name, found.description) for found in QUANTITIES.values())

COLOUR_MAPS = (
    ("suitable", "Suitable Colours", "The map that suits the quantity"),
    *((name, name, f"Colours from {name.lower()}") for name in MAPS),
)

OVERLAYS = (
    ("picture", "Picture", "The picture, over or under the curves"),
    ("outline", "Outline", "The outline of the print in the picture, over the twin"),
    (
        "difference",
        "Difference",
        "Orange where there is print and no twin, blue where there is a twin and no print",
    ),
)

MASKS = ("mask", "Masks", "What is taken for print in the picture")
"""What Show Masks lays over the views."""


class FrameTwinProblem(bpy.types.PropertyGroup):
    """Something wrong with the plan; its struts are kept as a custom property."""

    kind: StringProperty()  # type: ignore[valid-type]
    sentence: StringProperty()  # type: ignore[valid-type]


class FrameTwinPlan(bpy.types.PropertyGroup):
    """What is known of the plan since it was last checked."""

    checked: StringProperty(description="Name of the object that was checked")  # type: ignore[valid-type]
    struts: IntProperty()  # type: ignore[valid-type]
    joints: IntProperty()  # type: ignore[valid-type]
    size: FloatVectorProperty(size=3)  # type: ignore[valid-type]
    radius: FloatProperty()  # type: ignore[valid-type]
    problems: CollectionProperty(type=FrameTwinProblem)  # type: ignore[valid-type]
    frame: EnumProperty(  # type: ignore[valid-type]
        name="Frame",
        description="One of the project's own frames, for trying things out",
        items=FRAME_ITEMS,
    )


class FrameTwinDeform(bpy.types.PropertyGroup):
    """How the print deviates from the plan."""

    kind: EnumProperty(  # type: ignore[valid-type]
        name="Kind",
        description="What pulls the print out of shape",
        items=(
            ("sag", "Gravity sag", "Finite elements of beams; one strut in four has not hardened yet"),
            ("tip-load", "Push at the top", "The top pushed sideways"),
            ("warp", "Smooth warp", "A random smooth field"),
            ("rigid", "Shift and turn", "The whole frame moved, as by a wrong calibration"),
        ),
    )
    automatic: BoolProperty(  # type: ignore[valid-type]
        name="Automatic Peak",
        default=True,
        description="Largest displacement: 7 % of the longest side of what is printed",
    )
    peak: FloatProperty(  # type: ignore[valid-type]
        name="Peak mm", default=5.0, min=0.001, soft_max=100.0, description="Largest displacement of any point, in mm"
    )
    seed: IntProperty(  # type: ignore[valid-type]
        name="Seed", min=0, description="Of all that is random: the same seed gives the same print"
    )
    how: EnumProperty(  # type: ignore[valid-type]
        name="Printed",
        description="How much of the plan has been printed when the pictures are taken",
        items=(
            ("all", "All", "The whole plan"),
            ("share", "Share", "A share of the struts, from the base up"),
            ("batch", "Up to batch", "All batches up to this one"),
            ("height", "Up to height", "Struts that end below this height above the base"),
        ),
    )
    share: FloatProperty(  # type: ignore[valid-type]
        name="Share", default=0.6, min=0.01, max=1.0, subtype="FACTOR", description="Share of the struts, 0 to 1"
    )
    batch: IntProperty(name="Batch", min=0, description="Number of the last batch, from 0")  # type: ignore[valid-type]
    height: FloatProperty(  # type: ignore[valid-type]
        name="Height mm", default=40.0, min=0.01, description="Height above the lowest joint, in mm"
    )
    missing: IntProperty(  # type: ignore[valid-type]
        name="Missing", min=0, description="How many of the printed struts broke off, drawn at random"
    )
    missing_share: FloatProperty(  # type: ignore[valid-type]
        name="Part Missing",
        default=0.5,
        min=0.01,
        max=1.0,
        subtype="FACTOR",
        description="How much of each of these struts is missing, as a share of its length",
    )


class FrameTwinCameras(bpy.types.PropertyGroup):
    """The rig of cameras."""

    kind: EnumProperty(  # type: ignore[valid-type]
        name="Rig",
        description="How the cameras stand around the frame",
        items=(
            ("ring", "Ring", "Evenly around the frame, alternately at the lower and the upper elevation"),
            ("dome", "Dome", "Spread over a dome from the lower to the upper elevation"),
        ),
    )
    count: IntProperty(  # type: ignore[valid-type]
        name="Cameras", default=8, min=2, max=200, description="Number of cameras; the paper uses 8"
    )
    distance: FloatProperty(  # type: ignore[valid-type]
        name="Distance",
        default=1.0,
        min=0.5,
        max=20.0,
        description="Multiple of the least distance from which a camera sees the whole frame; a rig that was made"
        " follows, and so does the arrow at a selected camera",
        update=distance_changed,
    )
    low: FloatProperty(  # type: ignore[valid-type]
        name="Low Angle",
        default=radians(20.0),
        min=radians(-90.0),
        max=radians(90.0),
        subtype="ANGLE",
        description="Lower elevation above the horizon",
    )
    high: FloatProperty(  # type: ignore[valid-type]
        name="High Angle",
        default=radians(45.0),
        min=radians(-90.0),
        max=radians(90.0),
        subtype="ANGLE",
        description="Upper elevation above the horizon",
    )
    lens: FloatProperty(  # type: ignore[valid-type]
        name="View Angle",
        default=radians(40.0),
        min=radians(1.0),
        max=radians(150.0),
        subtype="ANGLE",
        description="Vertical field of view of the lens",
    )
    width: IntProperty(  # type: ignore[valid-type]
        name="Width", default=1600, min=8, max=16384, description="Width of the pictures in pixels"
    )
    height: IntProperty(  # type: ignore[valid-type]
        name="Height", default=1200, min=8, max=16384, description="Height of the pictures in pixels"
    )
    opacity: FloatProperty(  # type: ignore[valid-type]
        name="Opacity",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        description="Of the pictures in the cameras",
        update=restyle_active,
    )
    overlay: EnumProperty(  # type: ignore[valid-type]
        name="Overlay", description="What lies over the views of the cameras", items=(*OVERLAYS, MASKS)
    )
    front: BoolProperty(  # type: ignore[valid-type]
        name="In Front",
        description="Draw the pictures before the curves rather than behind them",
        update=restyle_active,
    )


class FrameTwinRender(bpy.types.PropertyGroup):
    """How pictures are made."""

    style: EnumProperty(  # type: ignore[valid-type]
        name="Pictures",
        description="What the cameras take",
        items=(
            ("mask", "Masks", "White struts before black: what the fit works on; a fraction of a second each"),
            ("photo", "Photos", "Matte plastic on a blue table, and the empty table: half a minute each"),
        ),
    )
    samples: IntProperty(  # type: ignore[valid-type]
        name="Samples", default=8, min=1, max=4096, description="Paths of light a pixel, of photos"
    )
    folder: StringProperty(  # type: ignore[valid-type]
        name="Folder",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        description="Where captures and runs are written. Empty: beside the .blend file, or FrameTwin in your home",
    )


class FrameTwinBeforeJobs(bpy.types.PropertyGroup):
    """What there was before print jobs were shown, and comes back when they are removed."""

    known: BoolProperty()  # type: ignore[valid-type]
    frame_current: IntProperty()  # type: ignore[valid-type]
    frame_start: IntProperty()  # type: ignore[valid-type]
    frame_end: IntProperty()  # type: ignore[valid-type]
    plan: BoolProperty(description="Whether it was in view")  # type: ignore[valid-type]
    print_object: BoolProperty(description="Whether it was in view")  # type: ignore[valid-type]
    twin: BoolProperty(description="Whether it was in view")  # type: ignore[valid-type]


class FrameTwinPrint(bpy.types.PropertyGroup):
    """Printing batch by batch."""

    job: StringProperty(  # type: ignore[valid-type]
        name="Job",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        description="Folder of a print job, as made here or by the command frametwin print",
    )
    seed: IntProperty(  # type: ignore[valid-type]
        name="Seed", min=0, description="Of the simulated print: how soft struts are, where the nozzle misses"
    )
    mode: EnumProperty(  # type: ignore[valid-type]
        name="Simulate",
        description="How the simulated print is steered",
        items=(
            ("both", "With and without", "Side by side: adapted to the twin of each batch, and blindly as designed"),
            ("adapt", "Adapted", "After each batch, what follows is moved to meet the twin"),
            ("blind", "As designed", "Nothing is moved"),
            ("compensate", "Compensated", "Adapted, and printed against the sag that is still to come"),
        ),
    )
    batch_size: IntProperty(  # type: ignore[valid-type]
        name="Batch Size", min=0, description="Struts between two looks of the cameras, about; 0: a twentieth of all"
    )
    coupon: IntProperty(  # type: ignore[valid-type]
        name="Coupon",
        min=0,
        max=1000,
        description="Single struts laid around the plan first, whose droop tells of the material; 20 do well",
    )
    supports: IntProperty(  # type: ignore[valid-type]
        name="Supports",
        min=0,
        max=100,
        description="Columns printed along, below joints that would sag, and cut off in the end; 6 do well",
    )
    speed: FloatProperty(  # type: ignore[valid-type]
        name="Speed",
        default=5.0,
        min=0.01,
        soft_max=20.0,
        max=250.0,
        description="Of the nozzle while it lays a strut, in mm/s: at half of it struts flow half as far",
    )
    pull: FloatProperty(  # type: ignore[valid-type]
        name="Pull",
        min=0.0,
        soft_max=10.0,
        description="Of the nozzle at what stands while it draws a simulated strut from there, in weights of the strut",
    )
    first_batch: IntProperty(name="From", min=0, description="Batch to compare with")  # type: ignore[valid-type]
    second_batch: IntProperty(  # type: ignore[valid-type]
        name="To", min=0, default=1, description="Batch that is coloured by its distance from the other"
    )
    before: PointerProperty(type=FrameTwinBeforeJobs)  # type: ignore[valid-type]


class FrameTwinView(bpy.types.PropertyGroup):
    """How a twin is looked at."""

    quantity: EnumProperty(  # type: ignore[valid-type]
        name="Colour by", description="What the colours of the struts show", items=COLOURS, update=recolour_afresh
    )
    colour_map: EnumProperty(  # type: ignore[valid-type]
        name="Colour Map",
        description="Colours from the good end of the range to the bad one",
        items=COLOUR_MAPS,
        update=recolour_active,
    )
    automatic: BoolProperty(  # type: ignore[valid-type]
        name="Automatic Range",
        default=True,
        description="The range of the values; from 0 where high values are the bad ones",
        update=recolour_active,
    )
    low: FloatProperty(name="Low", description="Lower end of the colours", update=recolour_active)  # type: ignore[valid-type]
    high: FloatProperty(  # type: ignore[valid-type]
        name="High", default=1.0, description="Upper end of the colours", update=recolour_active
    )
    legend: BoolProperty(  # type: ignore[valid-type]
        name="Legend", default=True, description="Draw what the colours mean into the viewport"
    )
    histogram: BoolProperty(  # type: ignore[valid-type]
        name="Histogram", default=True, description="Draw on the legend how many struts have which value"
    )
    other: PointerProperty(  # type: ignore[valid-type]
        name="With",
        type=bpy.types.Collection,
        description="The twin that the one that is looked at is compared with",
        poll=lambda self, collection: is_twin(collection) and collection != self.id_data.frametwin.twin,
    )
    count: IntProperty(  # type: ignore[valid-type]
        name="Worst", default=10, min=1, description="How many of the worst struts are highlighted"
    )
    at: IntProperty(description="Place of the strut that was stepped to, among the worst", default=-1)  # type: ignore[valid-type]
    at_words: StringProperty(description="What there is to say of that strut")  # type: ignore[valid-type]


class FrameTwinSettings(bpy.types.PropertyGroup):
    """FrameTwin's settings of a scene."""

    plan: PointerProperty(  # type: ignore[valid-type]
        name="Plan",
        type=bpy.types.Object,
        description="The frame as it was designed",
        poll=lambda self, obj: can_be_chosen(obj),
        update=plan_chosen,
    )
    plan_before: PointerProperty(  # type: ignore[valid-type]
        type=bpy.types.Object, description="The plan, also while another one is being chosen", options={"HIDDEN"}
    )
    print_object: PointerProperty(  # type: ignore[valid-type]
        name="Print",
        type=bpy.types.Object,
        description="The real print: the plan's struts, bent. Empty: the plan as its modifiers bend it",
        poll=lambda self, obj: can_be_chosen(obj),
    )
    rig: PointerProperty(  # type: ignore[valid-type]
        name="Rig",
        type=bpy.types.Collection,
        description="The collection that holds the cameras",
    )
    twin: PointerProperty(  # type: ignore[valid-type]
        name="Twin",
        type=bpy.types.Collection,
        description="The twin that is looked at",
        poll=lambda self, collection: is_twin(collection),
        update=twin_chosen,
    )
    twin_before: PointerProperty(  # type: ignore[valid-type]
        type=bpy.types.Collection, description="The twin, also while another one is being chosen", options={"HIDDEN"}
    )
    about_plan: PointerProperty(type=FrameTwinPlan)  # type: ignore[valid-type]
    deform: PointerProperty(type=FrameTwinDeform)  # type: ignore[valid-type]
    cameras: PointerProperty(type=FrameTwinCameras)  # type: ignore[valid-type]
    render: PointerProperty(type=FrameTwinRender)  # type: ignore[valid-type]
    pictures: PointerProperty(type=FrameTwinPictures)  # type: ignore[valid-type]
    fit: PointerProperty(type=FrameTwinFit)  # type: ignore[valid-type]
    print: PointerProperty(type=FrameTwinPrint)  # type: ignore[valid-type]
    view: PointerProperty(type=FrameTwinView)  # type: ignore[valid-type]


CLASSES = (
    FrameTwinProblem,
    FrameTwinPlan,
    FrameTwinDeform,
    FrameTwinCameras,
    FrameTwinRender,
    FrameTwinPictures,
    FrameTwinFit,
    FrameTwinBeforeJobs,
    FrameTwinPrint,
    FrameTwinView,
    FrameTwinSettings,
)

in_own_context(CLASSES)
