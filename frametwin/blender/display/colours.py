"""Struts coloured by a quantity: splines have no colours, so values are binned into materials that all twins share."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.statistics import StrutValues
from frametwin.blender.frames.curves import strut_numbers
from frametwin.blender.rendering.versions import node_tree
from frametwin.blender.scene.placement import label
from frametwin.errors import InputError

BINS = 32
MISSING, UNKNOWN = BINS, BINS + 1
KEY = "frametwin_colour"


@dataclass(frozen=True, eq=False)
class Legend:
    """What the colours mean: quantity, unit, range, and (BINS, 3) scene-linear colours from low to high.

    ``automatic`` says whether the range is that of the values.
    """

    quantity: str
    unit: str
    low: float
    high: float
    colours: np.ndarray
    automatic: bool = False


def colour_map() -> np.ndarray:
    """(BINS + 2, 3) scene-linear: even steps from blue to yellow in Oklab (B. Ottosson, 2020), red, grey."""
    t = np.linspace(0.0, 1.0, BINS)
    hue = np.radians(280.0 - 175.0 * t)
    lab = np.stack([0.45 + 0.45 * t, 0.1 * np.cos(hue), 0.1 * np.sin(hue)], axis=1)
    to_lms = np.array(
        [[1, 0.3963377774, 0.2158037573], [1, -0.1055613458, -0.0638541728], [1, -0.0894841775, -1.291485548]]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.707614701],
        ]
    )
    colours = np.clip((lab @ to_lms.T) ** 3 @ to_rgb.T, 0.0, 1.0)
    return np.concatenate([colours, [[0.9, 0.02, 0.05], [0.2, 0.2, 0.2]]])


def colour_twin(
    obj: bpy.types.Object,
    values: StrutValues,
    low: float | None = None,
    high: float | None = None,
    missing: Any = (),
    strut: np.ndarray | None = None,
) -> Legend:
    """Colour the struts of a frame's curve object; what is in ``missing`` gets a colour of its own, NaN another.

    Parameters
    ----------
    obj
        The curve object.
    values
        The quantity, of the E struts of the frame.
    low, high
        Of the range; 0 and the highest value by default.
    missing
        Indices of the struts that are missing.
    strut
        (E,) which strut each spline is, where that is known; by default it is found out.

    Raises
    ------
    InputError
        If the range is empty or the object cannot be read.
    """
    known = values.values[np.isfinite(values.values)]
    start = 0.0 if low is None else float(low)
    top = float(known.max(initial=start)) if high is None else float(high)
    if high is None and top <= start:
        top = start + 1.0
    if not top > start:
        raise InputError.at(label(obj), "range", f"{start:g} to {top:g} is empty", "give a high above the low")
    share = np.nan_to_num((values.values - start) / (top - start))
    index = np.clip((share * BINS).astype(np.int64), 0, BINS - 1)
    index[~np.isfinite(values.values)] = UNKNOWN
    index[np.asarray(missing, dtype=np.int64)] = MISSING
    strut = strut_numbers(obj) if strut is None else strut
    if len(strut) != len(obj.data.splines) or strut.max(initial=-1) >= len(index):
        raise InputError.at(label(obj), "splines", "are not those of this twin", "import the twin again")
    materials, slots = run_steps(materials_steps()), obj.data.materials
    if list(slots) != materials:
        slots.clear()
        for material in materials:
            slots.append(material)
    chosen = np.where(strut < 0, UNKNOWN, index[strut]).astype(np.int32)
    obj.data.splines.foreach_set("material_index", chosen)
    obj.data.update_tag()
    automatic = low is None and high is None
    return Legend(values.quantity, values.unit, start, top, colour_map()[:BINS], automatic)


def materials_steps() -> Generator[None, None, list[bpy.types.Material]]:
    """The materials of all colours, in their order; those that are not there yet are made, one a step."""
    there = {m[KEY]: m for m in bpy.data.materials if m.library is None and KEY in m}
    for i, colour in enumerate(colour_map().tolist()):
        if i not in there:
            material = there[i] = bpy.data.materials.new(f"FrameTwin colour {i:02d}")
            material[KEY] = i
            material.diffuse_color = (*colour, 1.0)
            tree = node_tree(material)
            shader, output = (tree.nodes.new(k) for k in ("ShaderNodeEmission", "ShaderNodeOutputMaterial"))
            shader.inputs["Color"].default_value = (*colour, 1.0)
            tree.links.new(shader.outputs[0], output.inputs["Surface"])
            yield
    return [there[i] for i in range(BINS + 2)]


def paint(obj: bpy.types.Object, name: str, colour: tuple[float, float, float]) -> None:
    """Give a curve object one plain material, shared by all that were painted under this name."""
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    material.diffuse_color = (*colour, 1.0)
    obj.data.materials.clear()
    obj.data.materials.append(material)


def remove_unused_colours() -> None:
    """Remove the materials of colours that no object uses."""
    bpy.data.batch_remove([m for m in bpy.data.materials if KEY in m and m.users == 0])
