"""Accuracy, time and memory of the fit, on frames with a known truth, beside the paper's figures.

    python scripts/benchmark.py                          fast on every frame that is found
    python scripts/benchmark.py --paper Femur            the paper preset too, on the frames named (minutes each)
    python scripts/benchmark.py --frames bridge Femur --seeds 0 1 2
    python scripts/benchmark.py --frames Femur --pictures library mask photo    who takes them (photos: minutes)
    python scripts/benchmark.py --render                 views per minute in Blender instead (benchmark_render.py)

Conditions: 8 views of 1200x1600, sag of 7 % of the extent with one strut in four not hardened, strut radius 6 % of the
median strut length. Every fit runs in a process of its own, after a fit of a small frame has loaded the compiled
kernels, so that seconds are those of the fit and memory is the whole process's. Absolute seconds depend on the machine
and on what else it does; ratios of one run are what to compare.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for the modules beside this one

from scripts.evidence import paper
from scripts.evidence.scenes import frame_files, masks_of, peak_megabytes, whole_frame
from scripts.evidence.tables import pair

if TYPE_CHECKING:
    from frametwin.cameras import Camera
    from frametwin.simulation.simulate import Simulation

COLUMNS = (
    "frame",
    "struts",
    "preset",
    "seconds",
    "curves mean / max",
    "joints mean",
    "equal parameter mean / max",
    "peak MB",
    "paper: seconds, mean / max",
)


def measure(path: Path, preset: str, seed: int, views: int, pictures: str = "library") -> dict:
    """One fit of one frame, in this process."""
    from frametwin.evaluation.evaluate import evaluate
    from frametwin.fitting.api import fit_views
    from frametwin.geometry.parametric import named_frame
    from frametwin.simulation.simulate import SimulationSettings, simulate

    small = simulate(named_frame("bridge"), SimulationSettings(views=2, size=(120, 160)))
    changes = {} if preset == "fast" else {"iterations": 1}
    fit_views(small.frame, small.cameras, masks_of(small), preset, changes=changes)

    frame = whole_frame(path)
    capture = simulate(frame, SimulationSettings(views=views, seed=seed))
    masks = masks_of(capture) if pictures == "library" else _masks_by_blender(capture, pictures)
    began = perf_counter()
    twin = fit_views(capture.frame, capture.cameras, masks, preset, seed=seed).twin
    seconds = perf_counter() - began
    return {
        "struts": frame.strut_count,
        "seconds": seconds,
        "before": evaluate(frame.control_points, frame.vertices, capture.truth).summary(),
        "after": evaluate(twin.curves, twin.vertices, capture.truth).summary(),
        "megabytes": peak_megabytes(),
        "timing": dict(twin.timing),
    }


def _masks_by_blender(capture: Simulation, style: str) -> list[np.ndarray]:
    """Masks as Blender renders them, or found in photos that it renders."""
    from frametwin.blender.rendering.client import render_in_child
    from frametwin.capture.image_files import decode_png
    from frametwin.capture.scene import Scene
    from frametwin.imaging.masks import binarise_photo
    from frametwin.scratch import scratch_folder

    scene = Scene.whole(capture.truth, capture.cameras, style)
    with scratch_folder() as folder:
        render_in_child(scene, folder)

        def picture(kind: str, camera: Camera) -> np.ndarray:
            return decode_png((folder / kind / f"{camera.name}.png").read_bytes())

        if style == "mask":
            return [picture("images", camera).astype(np.float32) / np.float32(255) for camera in capture.cameras]
        return [binarise_photo(picture("images", c), picture("background", c)) for c in capture.cameras]


def run(name: str, path: Path, preset: str, seed: int, views: int, pictures: str = "library") -> dict:
    """The same in a fresh process."""
    command = [sys.executable, __file__, "--one", str(path), preset, str(seed), str(views), pictures]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{name} {preset}: {done.stderr.strip().splitlines()[-1:] or 'failed'}")
    conditions = {"frame": name, "preset": preset, "seed": seed, "views": views, "pictures": pictures}
    return {**conditions, **json.loads(done.stdout)}


def row(result: dict) -> str:
    """One line of the table."""
    after = result["after"]
    name = result["frame"]
    reported = "" if name not in paper.ERRORS else f"{paper.SECONDS[name]:.0f} s, {pair(paper.ERRORS[name])}"
    cells = (
        result["frame"],
        str(result["struts"]),
        result["preset"] + ("" if result["pictures"] == "library" else f", {result['pictures']} by Blender"),
        f"{result['seconds']:.1f}",
        pair((after["curves"]["mean"], after["curves"]["max"])),
        f"{after['joints']['mean']:.3f}",
        pair((after["equal_parameter"]["mean"], after["equal_parameter"]["max"])),
        f"{result['megabytes']:.0f}",
        reported,
    )
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Run the benchmark and print its table."""
    frames = frame_files()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", nargs="+", default=list(frames), choices=list(frames), metavar="NAME")
    parser.add_argument("--paper", nargs="*", default=[], choices=list(frames), metavar="NAME")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--views", type=int, default=8)
    parser.add_argument("--json", type=Path, help="write all figures to this file too")
    parser.add_argument("--render", action="store_true", help="views per minute that Blender renders, masks and photos")
    parser.add_argument("--pictures", nargs="+", default=["library"], choices=["library", "mask", "photo"])
    parser.add_argument("--one", nargs=5, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.render:
        from benchmark_render import render_benchmark

        print("\n".join(render_benchmark(views=given.views)))
        return
    if given.one:
        path, preset, seed, views, pictures = given.one
        print(json.dumps(measure(Path(path), preset, int(seed), int(views), pictures)))
        return
    print("| " + " | ".join(COLUMNS) + " |\n|" + " --- |" * len(COLUMNS), flush=True)
    results = []
    for name in given.frames:
        for seed in given.seeds:
            presets = ("fast", "paper") if name in given.paper else ("fast",)
            for preset, pictures in product(presets, given.pictures):
                results.append(run(name, frames[name], preset, seed, given.views, pictures))
                print(row(results[-1]), flush=True)
    fast = [r["after"]["curves"]["mean"] for r in results if r["preset"] == "fast"]
    print(f"\nfast: curve mean over {len(fast)} fits {np.mean(fast):.4f} mm, largest {np.max(fast):.4f} mm")
    if given.json:
        given.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
