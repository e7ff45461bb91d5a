"""How exactly cameras are found from the rendered boards of a dataset, and the twin that is made with them.

    frametwin dataset generate datasets/calibration.toml --out out/calibration
    python scripts/measure_calibration.py out/calibration [--work out/measured]

Every sample goes the way that a lab goes, by the commands of ``frametwin``: lenses, poses, the block that tells the
world, a capture of the raw pictures, a fit. What comes out is compared with the true cameras and the true curves.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from frametwin.cameras import Camera
from frametwin.cameras.lens_models import project, rays
from frametwin.cameras.rig_file import RigCamera, read_rig
from frametwin.capture.capture import read_capture
from frametwin.dataset.calibration_shots import FOLDER, TRUTH_FILE
from frametwin.dataset.camera_errors import with_true_cameras
from frametwin.dataset.folder import read_dataset
from frametwin.errors import FrameTwinError
from frametwin.files import read_json, write_json
from frametwin.scratch import scratch_folder
from scripts.command import exit_code, leave, say


def measure_sample(folder: Path, work: Path, fit: bool = True) -> dict[str, float]:
    """Errors of the calibrated cameras of one sample, and of the twin.

    Parameters
    ----------
    folder
        The sample.
    work
        Gets the rig, the capture and the run.
    fit
        Whether a twin is made too.

    Returns
    -------
    dict
        ``centre_mm`` and ``direction_deg``, the mean and the largest over the cameras; the distance of the cameras from
        the print; the parts of the errors, see `parts_of`; ``twin_mm`` the mean error of the twin.

    Raises
    ------
    FrameTwinError
        If a command fails, with its last words.
    """
    truth, boards, rig = read_json(folder / TRUTH_FILE), folder / FOLDER, work / "rig"
    work.mkdir(parents=True, exist_ok=True)
    at = ",".join(str(value) for value in truth["at"])
    run("calibrate", "intrinsics", boards / "lenses", "--board", truth["board"], "--out", rig)
    run("calibrate", "extrinsics", rig, boards / "moments")
    run("calibrate", "place", rig, boards / "block", "--object", truth["block"], "--at", at)
    capture = with_true_cameras(read_capture(folder))
    cameras = {view.camera.name: view.camera for view in capture.views}
    found = {camera.name: camera for camera in read_rig(rig).cameras}
    errors = np.array([pose_errors(found[name].camera_to_world, camera) for name, camera in cameras.items()])
    pairs = [(found[name], camera) for name, camera in cameras.items()]
    middle = capture.frame.bounds.mean(axis=0)
    distance = np.mean([np.linalg.norm(camera.centre - middle) for camera in cameras.values()])
    result = {
        "cameras": float(len(cameras)),
        "distance_mm": float(distance),
        "centre_mm": float(errors[:, 0].mean()),
        "centre_largest_mm": float(errors[:, 0].max()),
        "direction_deg": float(errors[:, 1].mean()),
        "direction_largest_deg": float(errors[:, 1].max()),
        **parts_of(pairs, capture.frame.vertices),
    }
    if fit:
        taken = work / "capture"
        background = ["--background", folder / "background"] if (folder / "background").is_dir() else []
        run("capture", rig, folder / "images", "--frame", folder / "frame.json", "--out", taken, *background)
        run("fit", taken, "--out", work / "run")
        told = json.loads(run("evaluate", work / "run", folder, "--json", quiet=False))
        result["twin_mm"] = float(told["curves"]["mean"])
    return result


def pose_errors(found: np.ndarray | None, camera: Camera) -> tuple[float, float]:
    """Distance of the centres in mm and angle between the orientations in degrees."""
    if found is None:
        raise FrameTwinError(f"camera {camera.name} has no place in the rig")
    turn = found[:3, :3].T @ camera.camera_to_world[:3, :3]
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    angle = np.degrees(np.arctan2(np.linalg.norm(axis), np.trace(turn) - 1.0))
    return float(np.linalg.norm(found[:3, 3] - camera.centre)), float(angle)


def parts_of(pairs: Sequence[tuple[RigCamera, Camera]], points: np.ndarray) -> dict[str, float]:
    """Where errors come from, and what is left of them where it matters.

    Parameters
    ----------
    pairs
        Every camera as it was found, and as it is.
    points : (N, 3) array, mm
        Of the print.

    Returns
    -------
    dict
        ``shared_deg``, the turn that all cameras have in common: that of the world. ``lens_turn_deg``, the mean turn
        that makes up for the principal point and the like, which the pose then has with the other sign.
        ``lens_px``, what a turn does not make up for, root mean square over the picture. ``print_px``, how far from
        their places the points of the print are seen.
    """
    turns, lens_turns, lens_px, print_px = [], [], [], []
    for found, true in pairs:
        assert found.camera_to_world is not None
        lens = np.array([true.fl_x, true.fl_y, true.cx, true.cy, *true.distortion])
        turns.append(found.camera_to_world[:3, :3] @ true.camera_to_world[:3, :3].T)
        x, y = ((np.arange(24) + 0.5) * side / 24 for side in (true.width, true.height))
        pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        wanted, there = rays(true.model, lens, pixels), rays(found.model, found.lens, pixels)
        turn, _ = Rotation.align_vectors(wanted, there)
        lens_turns.append(np.degrees(turn.magnitude()))
        lens_px.append(((turn.apply(there) - wanted) ** 2).sum(axis=1).mean() * true.fl_x**2)
        seen = [
            project(model, values, (points - pose[:3, 3]) @ pose[:3, :3])[0]
            for model, values, pose in (
                (true.model, lens, true.camera_to_world),
                (found.model, found.lens, found.camera_to_world),
            )
        ]
        print_px.append(((seen[1] - seen[0]) ** 2).sum(axis=1).mean())
    return {
        "shared_deg": float(np.degrees(Rotation.from_matrix(turns).mean().magnitude())),
        "lens_turn_deg": float(np.mean(lens_turns)),
        "lens_px": float(np.sqrt(np.mean(lens_px))),
        "print_px": float(np.sqrt(np.mean(print_px))),
    }


def run(*words: object, quiet: bool = True) -> str:
    """What a command of ``frametwin`` prints.

    Raises
    ------
    FrameTwinError
        If it fails.
    """
    command = [sys.executable, "-m", "frametwin", *map(str, words), *(["--quiet"] if quiet else [])]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode:
        raise FrameTwinError(f"{' '.join(map(str, words[:2]))}: {done.stderr.strip()[-500:]}")
    return done.stdout


def table(rows: Sequence[dict[str, float]]) -> list[str]:
    """Lines of a Markdown table."""
    names = list(rows[0])
    lines = ["| sample | " + " | ".join(names) + " |", "| --- |" + " --- |" * len(names)]
    return lines + [f"| {i} | " + " | ".join(f"{row[name]:.3g}" for name in names) + " |" for i, row in enumerate(rows)]


def main(options: argparse.Namespace) -> int:
    """Measure every sample of a dataset."""
    rows = []
    with scratch_folder() as scratch:
        for entry in read_dataset(options.dataset).samples:
            work = scratch / entry.folder.name if options.work is None else options.work / entry.folder.name
            say(f"sample {entry.index}")
            rows.append(measure_sample(entry.folder, work, not options.no_fit))
    print("\n".join(table(rows)))
    if options.json is not None:
        write_json(options.json, {"samples": rows})
    return 0


def parser() -> argparse.ArgumentParser:
    """The options."""
    result = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    result.add_argument("dataset", type=Path)
    result.add_argument("--work", type=Path, help="keep rigs, captures and runs here; not there yet")
    result.add_argument("--no-fit", action="store_true", help="measure the cameras alone")
    result.add_argument("--json", type=Path, help="write the figures here too")
    return result


if __name__ == "__main__":
    leave(exit_code(lambda: main(parser().parse_args())))
