"""Outlines, differences and masks of a capture's pictures, over the views of the rig's cameras.

They are kept in the file, each with the capture and the run that it was made of.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import bpy

from frametwin.blender.views.backgrounds import show_image
from frametwin.blender.views.cameras import cameras_in

KEY = "frametwin_comparison"
KINDS = ("outline", "difference")
MASK = "mask"
"""Of a capture alone: the run is empty."""


def load_comparisons(folder: Path, capture: str, run: str, kinds: Sequence[str] = KINDS) -> int:
    """Take pictures into the file: ``KIND/NAME.png`` or ``.jpg`` in a folder, not needed any more then; how many.

    Those of the same kinds that were there before are removed.
    """
    for image in [image for image, found in _known() if found["kind"] in kinds]:
        bpy.data.images.remove(image)
    count = 0
    for kind in kinds:
        for path in sorted([*(folder / kind).glob("*.png"), *(folder / kind).glob("*.jpg")]):
            image = bpy.data.images.load(str(path))
            image.name = f"{path.stem} {kind}"
            image.pack()
            image.filepath = ""
            image[KEY] = {"kind": kind, "name": path.stem, "capture": capture, "run": run}
            count += 1
    return count


def has_comparisons(capture: str, run: str) -> bool:
    """Whether the pictures of this capture and run are in the file."""
    return any(found["capture"] == capture and found["run"] == run for _, found in _known())


def show_comparisons(collection: bpy.types.Collection, kind: str) -> int:
    """Show pictures of one of `KINDS`, or `MASK`, over what the rig's cameras of the same names see; how many fit."""
    images = {str(found["name"]): image for image, found in _known() if found["kind"] == kind}
    shown = 0
    for obj in cameras_in(collection.all_objects):
        names = (obj.name, str(obj.get("frametwin", {}).get("name", "")))
        image = next((images[name] for name in names if name in images), None)
        if image is not None:
            show_image(obj, image, opacity=1.0, front=True)
            shown += 1
    return shown


def _known() -> Iterator[tuple[bpy.types.Image, bpy.types.bpy_struct]]:
    for image in bpy.data.images:
        if KEY in image:
            yield image, image[KEY]
