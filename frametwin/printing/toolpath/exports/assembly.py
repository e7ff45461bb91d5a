"""A frame with its order in the JSON of assembly_instances, for pychoreo and conmech; `read_frame` reads it back."""

from __future__ import annotations

from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, write_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence


def write_assembly(path: PathLike, frame: Wireframe, sequence: PrintSequence | None = None) -> None:
    """Write nodes, elements with ``layer_id``, and the section's area; curved struts become straight.

    Parameters
    ----------
    path
        The file.
    frame
        A design or a plan.
    sequence
        Whose batches are the layers; default the batches of ``frame``. Its direction is written too.

    Raises
    ------
    InputError
        If the sequence leaves struts of the frame out, or the file cannot be written.
    """
    batch = frame.batch.copy()
    edges = frame.edges.copy()
    if sequence is not None:
        end = sequence.end_in(frame)
        if len(sequence) != frame.strut_count:
            problem = f"holds {len(sequence)} of {frame.strut_count} struts"
            raise InputError.at(frame.name, "sequence", problem, "give a sequence of all struts")
        batch[sequence.struts] = sequence.batch
        edges[sequence.struts] = np.stack([sequence.start, end], axis=1)
    nodes = [
        {"point": {"X": x, "Y": y, "Z": z}, "node_id": i, "is_grounded": int(foot)}
        for i, ((x, y, z), foot) in enumerate(zip(frame.vertices.tolist(), frame.grounded.tolist(), strict=True))
    ]
    elements = [
        {"end_node_ids": pair, "element_id": i, "layer_id": layer}
        for i, (pair, layer) in enumerate(zip(edges.tolist(), batch.tolist(), strict=True))
    ]
    data: dict[str, Any] = {
        "model_name": frame.name, "unit": "millimeter", "dimension": 3,
        "node_num": len(nodes), "element_num": len(elements), "node_list": nodes, "element_list": elements,
    }  # fmt: skip
    if (frame.radius == frame.radius[0]).all():
        area = float(np.pi * frame.radius[0] ** 2)
        data["material_properties"] = {"cross_sec_area": area, "cross_sec_area_unit": "millimeter^2"}
    write_json(path, data)
