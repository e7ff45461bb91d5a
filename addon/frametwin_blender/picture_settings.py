"""What the add-on remembers of a lab's own rig and photographs."""

# No postponed annotations here: Blender reads them as properties.
import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty

FOLDER = {"subtype": "DIR_PATH", "options": {"PATH_SUPPORTS_BLEND_RELATIVE"}}


class FrameTwinPictures(bpy.types.PropertyGroup):
    """Photographs of a calibrated rig."""

    rig: StringProperty(  # type: ignore[valid-type]
        name="Rig", description="Folder of the calibrated cameras (rig.json), as frametwin calibrate makes it", **FOLDER
    )
    place: FloatVectorProperty(  # type: ignore[valid-type]
        name="Plan at",
        size=3,
        precision=2,
        subtype="XYZ",
        description="Where the plan's origin stands in the robot's base: x, y and z in mm",
    )
    turn: FloatProperty(  # type: ignore[valid-type]
        name="Turn", subtype="ANGLE", description="Turn of the plan about the vertical in the robot's base"
    )
    folder: StringProperty(  # type: ignore[valid-type]
        name="Pictures",
        description="Folder with a picture of each camera, named after it, or a folder of each camera with pictures",
        **FOLDER,
    )
    before: StringProperty(  # type: ignore[valid-type]
        name="Before", description="Folder with the same views before printing. Empty: there are none", **FOLDER
    )
    moment: StringProperty(  # type: ignore[valid-type]
        name="Moment",
        description="Which pictures, by their name without ending, where each camera has a folder with several",
    )
    how: EnumProperty(  # type: ignore[valid-type]
        name="Printed",
        description="How much of the plan has been printed in the pictures",
        items=(
            ("plan", "As in the plan", "What the plan's file calls printed; of a plan that does not say, all of it"),
            ("all", "All", "The whole plan"),
            ("batch", "Up to batch", "All batches up to this one"),
            ("height", "Up to height", "Struts that end below this height above the base"),
        ),
    )
    batch: IntProperty(name="Batch", min=0, description="Number of the last batch, from 0")  # type: ignore[valid-type]
    height: FloatProperty(  # type: ignore[valid-type]
        name="Height mm", default=40.0, min=0.01, description="Height above the lowest joint, in mm"
    )
