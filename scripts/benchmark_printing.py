"""Simulated prints without adaptation, with the paper's, with ours, and with compensation too: which are finished.

    python scripts/benchmark_printing.py                              four frames, ten seeds, four ways: hours
    python scripts/benchmark_printing.py --frames bridge --seeds 3    seeds 0, 1 and 2 alone
    python scripts/benchmark_printing.py --results FILE               go on with a file of results, or only show it

Every frame is printed with the default settings of `PrintSettings`, struts of 6 % of the
median strut length in radius, and a look of 8 cameras of 600x800 after every twentieth of the struts, 4 to 12 of them.
The order is planned once for each frame. The twins see only pictures. Lost struts are laid again wherever there are
twins, as is usual for simulations; the paper's way takes the print to stand still between two twins.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # for the modules beside this one

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job.plan_job import PlanOptions
from frametwin.printing.records.sequence_file import write_sequence
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.simulation.simulate import SimulationOptions, simulate_print
from frametwin.printing.simulation.simulated_pictures import SimulatedRig
from frametwin.scratch import scratch_folder
from scripts.evidence.scenes import frame_files, whole_frame

FRAMES = ("bridge", "half_bowl", "klein_bottle", "Femur")
WAYS: dict[str, dict[str, Any]] = {
    "plain": {"adapt": False},
    "paper": {"anticipate": False, "compensate": False, "reprint": True},
    "adapted": {"compensate": False, "reprint": True},
    "compensated": {"reprint": True, "compensate": True},
}
"""What each way changes in `PlanOptions`."""
COLUMNS = (
    "frame",
    "struts",
    "batches",
    "collapsed without",
    "completed with the paper's",
    "completed with",
    "completed compensated",
    "largest displacement with / compensated, mm",
    "mean deviation with / compensated, mm",
    "twin of a batch, s",
    "printing of a batch, s",
)


def design_of(name: str) -> Wireframe:
    """The frame with struts of the radius that all benchmarks have, in no order."""
    frame = whole_frame(frame_files()[name])
    return frame.replace(batch=np.zeros(frame.strut_count, dtype=np.int64))


def run(frame: Wireframe, order: Path, way: str, seed: int, folder: Path) -> dict:
    """Print a frame once."""
    plan = PlanOptions(**WAYS[way], allow_contact=True, formats=("json",))
    options = SimulationOptions(plan=plan, rig=SimulatedRig(size=(600, 800)), seed=seed)
    return simulate_print(folder, frame, options, order=order).as_dict()


def rows(results: list[dict]) -> list[str]:
    """The table, a line for each frame."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + " --- |" * len(COLUMNS)]
    frames: dict[str, dict[str, list[dict]]] = defaultdict(lambda: defaultdict(list))
    for result in results:
        frames[result["name"]][result["way"]].append(result)
    for name, ways in frames.items():
        some = next(iter(ways.values()))[0]
        twins = [second for way in ("adapted", "compensated") for one in ways[way] for second in one["twin_seconds"]]
        robot = [second for one in ways["adapted"] for second in one["printing_seconds"]]
        cells = (
            name,
            str(some["struts"]),
            str(some["batches"]),
            _count(ways["plain"], lambda one: one["collapsed_at_batch"] is not None),
            _count(ways["paper"], lambda one: one["completed"]),
            _count(ways["adapted"], lambda one: one["completed"]),
            _count(ways["compensated"], lambda one: one["completed"]),
            " / ".join(_mean(ways[way], lambda one: one["e_max"][-1], 1) for way in ("adapted", "compensated")),
            " / ".join(_mean(ways[way], lambda one: one["mean_deviation"], 2) for way in ("adapted", "compensated")),
            f"{np.mean(twins):.2f}" if twins else "",
            f"{np.mean(robot):.0f}" if robot else "",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _count(results: list[dict], holds: Callable[[dict], bool]) -> str:
    return f"{sum(bool(holds(one)) for one in results)} of {len(results)}"


def _mean(results: list[dict], value: Callable[[dict], float], digits: int) -> str:
    """The mean over the prints that were finished."""
    values = [value(one) for one in results if one["completed"]]
    return f"{np.mean(values):.{digits}f}" if values else "none"


def main() -> None:
    """Run what is not yet in the file of results, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", nargs="*", default=list(FRAMES), choices=list(frame_files()), metavar="NAME")
    parser.add_argument("--ways", nargs="+", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--seeds", type=int, default=10, help="how many, from 0")
    parser.add_argument("--results", type=Path, help="a file of one JSON object a line, added to and gone on with")
    given = parser.parse_args()
    results = []
    if given.results and given.results.exists():
        results = [json.loads(line) for line in given.results.read_text().splitlines()]
    done = {(one["name"], one["way"], one["seed"]) for one in results}
    with scratch_folder() as scratch:
        for name in given.frames:
            frame, order = design_of(name), scratch / f"{name}.json"
            for seed in range(given.seeds):
                for way in given.ways:
                    if (name, way, seed) in done:
                        continue
                    if not order.exists():
                        settings = OrderSettings(allow_contact=True)
                        write_sequence(order, plan_sequence(frame, settings))
                    result = run(frame, order, way, seed, scratch / f"{name}-{way}-{seed}")
                    results.append({"name": name, "way": way, "seed": seed, **result})
                    if given.results:
                        with given.results.open("a") as file:
                            file.write(json.dumps(results[-1]) + "\n")
    print("\n".join(rows(results)))


if __name__ == "__main__":
    main()
