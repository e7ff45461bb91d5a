"""Make a dataset inside of a Blender, whose Python needs nothing but its own numpy.

    blender --background --python scripts/generate_dataset.py -- datasets/demo.toml --out out/demo
    python scripts/generate_dataset.py -- datasets/demo.toml --out out/demo          (with Blender's module bpy)

The samples are those that ``frametwin dataset generate`` makes. What needs the project's libraries (the sag, the exact
truth, hashes) runs in a worker process of the project's own environment: name its Python by --python or by the
environment variable FRAMETWIN_PYTHON, as .venv/bin/python after the set-up of the README.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # Blender's Python knows nothing of this project

from frametwin.errors import Cancelled, FrameTwinError, InputError
from frametwin.progress import ProgressLines
from frametwin.worker.client import WorkerClient, find_python
from scripts.command import arguments, exit_code, leave, say


def make(options: argparse.Namespace) -> int:
    """Make the samples that are missing; 0 if all are there, 1 if some failed."""
    return make_all(options) if options.samples is None else make_samples(options)


def parser() -> argparse.ArgumentParser:
    """The options, which follow ``--`` on Blender's command line."""
    result = argparse.ArgumentParser(prog="generate_dataset.py", description=__doc__.split("\n\n")[0])
    result.add_argument("recipe", type=Path)
    result.add_argument("--out", type=Path, required=True, help="the dataset's folder")
    result.add_argument("--count", type=int, help="number of samples [the recipe's]")
    result.add_argument("--seed", type=int, help="of all that is drawn [the recipe's]")
    result.add_argument("--shard", default="1/1", help="i/n: only every n-th sample, from the i-th on")
    result.add_argument("--per-process", type=int, default=25, help="samples after which a fresh Blender takes over")
    result.add_argument("--python", help="the Python of the project's environment [FRAMETWIN_PYTHON]")
    result.add_argument("--samples", help=argparse.SUPPRESS)  # of one Blender: 3,4,5
    return result


def make_all(options: argparse.Namespace) -> int:
    """Let one Blender after the other make some samples each."""
    if options.per_process < 1:
        raise InputError.at("settings", "--per-process", f"is {options.per_process}", "give a whole number from 1 up")
    began = perf_counter()
    failed: dict[int, str] = {}
    with worker_of(options) as worker:
        plan = worker.call("dataset-plan", request_of(options), ProgressLines(say))
        wanted = [int(index) for index in plan["wanted"]]
        for index, reason in plan["damaged"].items():
            say(f"Sample {index} will be made again: {reason}")
        say(f"{plan['kept']} samples are there, {len(wanted)} are wanted")
        left = list(wanted)
        while left:
            chunk, left = left[: options.per_process], left[options.per_process :]
            left = run_blender(options, worker, chunk, failed) + left
        worker.call("dataset-close", {"failed": {str(index): reason for index, reason in failed.items()}})
    say(f"{len(wanted) - len(failed)} samples made in {perf_counter() - began:.1f} s")
    for index, reason in sorted(failed.items()):
        say(f"Sample {index} failed: {reason}")
    return int(bool(failed))


def run_blender(
    options: argparse.Namespace, worker: WorkerClient, chunk: list[int], failed: dict[int, str]
) -> list[int]:
    """Start a Blender for some samples; returns those that it did not come to, since it crashed before."""
    words = [str(options.recipe), "--out", str(options.out), "--samples", ",".join(map(str, chunk))]
    for name in ("count", "seed", "python"):
        if getattr(options, name) is not None:
            words += [f"--{name}", str(getattr(options, name))]
    code = -1
    try:
        code = run_child([*command_of_blender(), "--", *words])
    finally:
        if code != 0:
            worker.call("dataset-tidy", {"indices": chunk})
    if code == 130:
        raise Cancelled("interrupted")
    if code == 0:
        return []
    still = set(worker.call("dataset-plan", {**request_of(options), "again": True})["wanted"])
    told = worker.call("dataset-failures", {})["failed"]
    missing = [index for index in chunk if index in still]
    failed.update({index: told[str(index)] for index in missing if str(index) in told})
    untold = [index for index in missing if str(index) not in told]
    if untold:  # the first of them is what it crashed at
        failed[untold[0]] = f"Blender ended with code {code}; its last words are above"
    return untold[1:]


def run_child(command: Sequence[str]) -> int:
    """Run a program that ends when its standard input does, whatever becomes of this one; its exit code."""
    child = subprocess.Popen(command, stdin=subprocess.PIPE)
    try:
        return child.wait()
    finally:
        if child.poll() is None:
            child.terminate()
            child.wait()


def end_with_parent() -> None:
    """End this process once its standard input ends, which is when the process that started it has gone."""

    def watch() -> None:
        while os.read(0, 4096):
            pass
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def end_in_order(number: int, frame: object) -> None:
    """A signal that asks to end is what Ctrl-C is."""
    raise KeyboardInterrupt


def command_of_blender() -> list[str]:
    """How to start this script once more, in a fresh Blender of the same kind."""
    import bpy

    script = str(Path(__file__).resolve())
    if not bpy.app.binary_path or bpy.app.module:
        return [sys.executable, script]
    blender = [bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1"]
    return [*blender, "--python", script]


def make_samples(options: argparse.Namespace) -> int:
    """Make the samples named by ``--samples`` in this very Blender."""
    from frametwin.blender.rendering.render import render_file

    end_with_parent()
    indices = [int(index) for index in options.samples.split(",")]
    failed: dict[str, str] = {}
    with worker_of(options) as worker:
        worker.call("dataset-open", request_of(options))
        for i, index in enumerate(indices):
            show = ProgressLines(say, f"sample {index} ({i + 1} of {len(indices)}): ")
            try:
                ready = worker.call("dataset-prepare", {"index": index, **shapes_of(worker, index)}, show)
                if ready["busy"]:
                    say(ready["busy"])
                    continue
                made_with = {}
                if ready["scene"]:
                    rendered = render_file(ready["scene"], Path(ready["folder"]), show)
                    notes = {"blender": rendered.blender, "engine": rendered.engine, "remarks": rendered.remarks}
                    made_with = {name: value for name, value in notes.items() if value}
                worker.call("dataset-finish", {"index": index, "made_with": made_with})
            except (Cancelled, KeyboardInterrupt):
                raise
            except FrameTwinError as error:
                failed[str(index)] = str(error)
                worker.call("dataset-give-up", {"index": index})
        worker.call("dataset-close", {"failed": failed})
    return int(bool(failed))


def shapes_of(worker: WorkerClient, index: int) -> dict:
    """Plan and bent frame of a sample that comes from a .blend file; nothing for the others."""
    source = worker.call("dataset-source", {"index": index})
    if source["file"] is None:
        return {}
    from frametwin.blender.frames.plans import read_blend
    from frametwin.formats import frame_json

    plan, deformed = read_blend(Path(source["file"]), source["object"], source["timeline_frame"])
    return {"plan": frame_json.to_dict(plan), "deformed": frame_json.to_dict(deformed)}


def request_of(options: argparse.Namespace) -> dict:
    """What the worker has to know of the run."""
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", options.shard)
    if found is None:
        raise InputError.at("settings", "--shard", f"is {options.shard!r}", "give i/n with i from 1 to n, as 2/3")
    return {
        "recipe": str(options.recipe.absolute()),
        "out": str(options.out.absolute()),
        "seed": options.seed,
        "count": options.count,
        "shard": [int(found[1]), int(found[2])],
    }


def worker_of(options: argparse.Namespace) -> WorkerClient:
    """The worker process, to be used as a context manager."""
    return WorkerClient(find_python(options.python))


if __name__ == "__main__":
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), end_in_order)
    leave(exit_code(lambda: make(parser().parse_args(arguments()))))
