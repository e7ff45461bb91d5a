"""The frame's beams solved by PyNiteFEA, an independent finite element package: what ours is held against."""

from __future__ import annotations

import numpy as np
from Pynite import FEModel3D

from frametwin.mechanics.stiffness import FrameBeams


def solve_with_pynite(beams: FrameBeams, joint_loads: np.ndarray | None = None) -> np.ndarray | None:
    """Displacements and rotations (V, 6) of the joints in mm and rad; grounded joints are clamped.

    Parameters
    ----------
    beams
        The struts as beams; inner nodes of curved struts become nodes of the model.
    joint_loads
        (V, 6) forces in N and moments in N mm on the joints, besides the struts' weight.

    Returns
    -------
    (V, 6), or ``None`` if PyNite changed the structure: it welds a beam to every node that happens to lie on
    it, while in a wireframe only the edges say what is connected.
    """
    frame = beams.frame
    model = FEModel3D()
    used = frame.printed_vertices()
    for v in np.flatnonzero(used):
        model.add_node(f"v{v}", *map(float, frame.vertices[v]))
        if frame.grounded[v]:
            model.def_support(f"v{v}", *[True] * 6)
    _add_beams(model, beams)
    for v, load in enumerate(np.zeros((0, 6)) if joint_loads is None else joint_loads):
        for direction, value in zip(("FX", "FY", "FZ", "MX", "MY", "MZ"), load, strict=True):
            if value != 0.0:
                model.add_node_load(f"v{v}", direction, float(value))
    model.analyze_linear(check_stability=False, check_statics=False, sparse=True)
    if any(len(member.sub_members) > 1 for member in model.members.values()):
        return None
    result = np.zeros((frame.vertex_count, 6))
    for v in np.flatnonzero(used):
        node = model.nodes[f"v{v}"]
        values = (node.DX, node.DY, node.DZ, node.RX, node.RY, node.RZ)
        result[v] = [value["Combo 1"] for value in values]
    return result


def _add_beams(model: FEModel3D, beams: FrameBeams) -> None:
    """Add every strut's beams and its weight.

    With the moduli of the one material at 1 MPa, a section's area and moments are the stiffnesses themselves.
    """
    frame, sections = beams.frame, beams.sections
    model.add_material("unit", 1.0, 1.0, 0.0, 0.0)
    for group in beams.groups:
        for points, k in zip(group.chains.points, group.struts, strict=True):
            bending = float(sections.bending[k])
            section = model.add_section(
                f"s{k}", float(sections.axial[k]), bending, bending, float(sections.twisting[k])
            )
            inner = [model.add_node(f"s{k}n{i}", *map(float, p)) for i, p in enumerate(points[1:-1])]
            names = [f"v{frame.edges[k, 0]}", *inner, f"v{frame.edges[k, 1]}"]
            for i, (a, b) in enumerate(zip(names[:-1], names[1:], strict=True)):
                member = model.add_member(f"s{k}b{i}", a, b, "unit", section)
                if beams.weight[k] > 0.0:
                    model.add_member_dist_load(member, "FZ", -float(beams.weight[k]), -float(beams.weight[k]))
