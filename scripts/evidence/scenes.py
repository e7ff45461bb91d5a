"""The frames that are measured, how they are simulated, and what a process has used; all benchmarks share it.

Conditions: 8 views of 1600x1200, a sag of 7 % of the extent with one strut in four not hardened, strut radius 6 % of
the median strut length. The paper does not say how far its own frames sag.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.simulation.simulate import Simulation

ROOT = Path(__file__).resolve().parent.parent.parent
SHARED = ROOT.parent / "shared" / "frames"
OWN = ("bridge", "half_bowl", "lattice_tower")
RADIUS_SHARE = 0.06


def frame_files() -> dict[str, Path]:
    """Every frame by name: the project's own, and those beside it if they are there."""
    found = {name: ROOT / "datasets" / "frames" / f"{name}.json" for name in OWN}
    for path in sorted(SHARED.glob("rl3dp/Node*_wireframe.txt")):
        found[path.name.removeprefix("Node").removesuffix("_wireframe.txt")] = path
    found.update(
        {path.name.split("_S1")[0].removesuffix(".json"): path for path in SHARED.glob("assembly_instances/*")}
    )
    return found


def whole_frame(path: Path) -> Wireframe:
    """A frame all printed, with struts of the radius that all benchmarks have."""
    frame = read_frame(path)
    radius = RADIUS_SHARE * float(np.median(frame.chord_lengths))
    return frame.replace(radius=np.full(frame.strut_count, radius), printed=np.ones(frame.strut_count, dtype=bool))


def uppermost(frame: Wireframe, count: int) -> Wireframe:
    """The largest connected piece of so many uppermost struts of a frame, held where it is cut off."""
    height = frame.vertices[frame.edges][:, :, 2].mean(axis=1)
    kept = np.zeros(frame.strut_count, dtype=bool)
    kept[np.argsort(-height, kind="stable")[:count]] = True
    ends = frame.edges[kept]
    links = coo_matrix((np.ones(count), ends.T), shape=(frame.vertex_count, frame.vertex_count))
    piece = connected_components(links, directed=False)[1][frame.edges[:, 0]]
    kept &= piece == np.bincount(piece[kept]).argmax()
    part, joints = frame.subset(kept)
    return part.replace(grounded=part.grounded | np.isin(joints, frame.edges[~kept]))


def masks_of(capture: Simulation) -> list[np.ndarray]:
    """(H, W) float32 pictures, 0..1, of a simulated capture."""
    return [image.astype(np.float32) / np.float32(255) for image in capture.images]


def cube_with_one_bent_strut(side: float = 100.0, bow: float = 12.0) -> tuple[Wireframe, Wireframe]:
    """Plan and truth of a cube of 12 struts, of which one upper strut bows outwards by so many mm."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=np.float64) * side
    edges = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b) in (1, 2, 4)])
    plan = Wireframe.create(corners, edges, radius=0.02 * side, grounded=corners[:, 2] == 0.0, name="cube")
    bent = int(np.flatnonzero((edges == (4, 5)).all(axis=1))[0])
    curves = np.array(plan.control_points)
    curves[bent, 1:3] += np.array([0.0, -4.0 / 3.0 * bow, 0.0])  # inner control points move 4/3 of the middle
    assert np.isclose(np.abs(bezier.evaluate(curves[bent : bent + 1], np.array([0.5]))[0, 0, 1]), bow)
    return plan, plan.replace(control_points=curves)


def peak_megabytes() -> float:
    """Largest resident size of this process so far, in MB; NaN where the system does not tell."""
    try:
        import resource
    except ImportError:
        return float("nan")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)
