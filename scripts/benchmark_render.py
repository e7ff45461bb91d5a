"""Views per minute that Blender renders here, and what FrameTwin adds to the renderer's own time.

    python scripts/benchmark_render.py                   Femur where it is found, else the lattice tower
    python scripts/benchmark_render.py --frame FILE --views 4

Conditions: pictures of 1200x1600, strut radius 6 % of the median strut length, settings as they come. Each kind of
picture is rendered twice: the first time compiles shaders and loads kernels and does not count.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from frametwin.blender.rendering.render_job import RenderReport
    from frametwin.capture.scene import Scene

ROOT = Path(__file__).resolve().parent.parent
FEMUR = ROOT.parent / "shared" / "frames" / "rl3dp" / "NodeFemur_wireframe.txt"
TOWER = ROOT / "datasets" / "frames" / "lattice_tower.json"
RADIUS_SHARE = 0.06
SIZE = (1200, 1600)
WARM_SIZE = (24, 32)


def render_benchmark(path: Path | None = None, views: int = 8, photo_views: int = 1) -> list[str]:
    """Lines of a Markdown table: views per minute for every kind of picture.

    Parameters
    ----------
    path
        The frame; Femur or the lattice tower by default.
    views, photo_views
        How many views of the masks and passes, and of the photos, are rendered and counted.
    """
    from frametwin.blender.rendering import engines
    from frametwin.cameras.rigs import ring_rig
    from frametwin.capture.scene import Scene
    from frametwin.formats import read_frame
    from frametwin.wording import size_text

    path = path or (FEMUR if FEMUR.is_file() else TOWER)
    frame = read_frame(path)
    radius = RADIUS_SHARE * float(np.median(frame.chord_lengths))
    frame = frame.replace(radius=np.full(frame.strut_count, radius), printed=np.ones(frame.strut_count, dtype=bool))
    kinds: list[tuple[str, int, dict[str, Any]]] = (
        [("mask, Workbench", views, {"engine": "workbench"})] if engines.workbench_works() else []
    )
    kinds += [
        ("mask, Cycles", views, {"engine": "cycles"}),
        ("mask and passes", views, {"passes": True}),
        ("photo and background", photo_views, {"style": "photo"}),
    ]
    if engines.workbench_works():
        kinds.insert(0, ("mask, Workbench", views, {"engine": "workbench"}))
    lines = [
        f"{path.stem}, {frame.strut_count} struts, {size_text(*SIZE)}",
        "",
        "| pictures | views a minute | seconds a view in Blender's renderer | beside it | share |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, count, settings in kinds:
        measure(Scene.whole(frame, ring_rig(frame, 1, size=WARM_SIZE), **settings))
        report = measure(Scene.whole(frame, ring_rig(frame, count, size=SIZE), **settings))
        inside, beside = report.rendering_seconds / count, report.other_seconds / count
        share = 100.0 * beside / inside
        lines.append(f"| {name} | {60.0 / (inside + beside):.0f} | {inside:.3f} | {beside:.3f} | {share:.1f} % |")
        print(lines[-1], file=sys.stderr, flush=True)
    return lines


def measure(scene: Scene) -> RenderReport:
    """Render into a folder that is thrown away; the report."""
    from frametwin.blender.rendering.render import render_scene
    from frametwin.scratch import scratch_folder

    with scratch_folder() as folder:
        return render_scene(scene, folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frame", type=Path, help="any frame file that frametwin reads")
    parser.add_argument("--views", type=int, default=8, help="views of masks and passes")
    parser.add_argument("--photo-views", type=int, default=1, help="views of photos, half a minute each")
    arguments = parser.parse_args()
    print("\n".join(render_benchmark(arguments.frame, arguments.views, arguments.photo_views)))


if __name__ == "__main__":
    main()
