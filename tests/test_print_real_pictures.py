"""Print jobs with what a lab has: photographs of grey filament, cameras that err, a view that shows nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from print_cases import LEAN, SIZE, LeaningPrint, cameras_of, print_batch, small_job, take_with
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.cameras import Camera
from frametwin.cameras.rig_file import Rig, RigCamera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import read_capture, write_capture
from frametwin.capture.image_files import write_png
from frametwin.errors import Cancelled, Held
from frametwin.evaluation.evaluate import evaluate
from frametwin.fields.base import enlarged_box
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.batch_fit import fit_batch
from frametwin.printing.job.guards import doubts_of_verdict
from frametwin.printing.job.raw_pictures import RawPictures
from frametwin.printing.job.watch import Watch
from frametwin.progress import Progress
from frametwin.raster.silhouette import silhouettes
from frametwin.twin.twin import Twin
from frametwin.twin.verdict import Verdict

GREY, BLUE = np.array([95.0, 95.0, 92.0]), np.array([30.0, 55.0, 120.0])


def photographs(standing: Wireframe | None, cameras: tuple[Camera, ...], seed: int) -> list[np.ndarray]:
    """Grey struts before a blue table that is lit from one side, with noise."""
    rng = np.random.default_rng(seed)
    result = []
    for camera in cameras:
        share = np.zeros((camera.height, camera.width, 1))
        if standing is not None:
            share = silhouettes(standing, [camera], supersampling=3)[0][..., None] / 255.0
        light = np.linspace(0.7, 1.2, camera.width)[None, :, None]
        picture = light * (share * GREY + (1.0 - share) * BLUE) + rng.normal(0.0, 1.5, (*share.shape[:2], 3))
        result.append(np.clip(picture, 0, 255).round().astype(np.uint8))
    return result


def off(camera: Camera, degrees: float, rng: np.random.Generator) -> Camera:
    pose = np.array(camera.camera_to_world)
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(np.deg2rad(degrees) * rng.normal(size=3) / 3**0.5).as_matrix()
    pose[:3, 3] += 0.3 * rng.normal(size=3)
    return replace(camera, camera_to_world=pose)


def test_a_job_reads_photographs_of_grey_filament_and_leaves_out_a_black_one(tmp_path: Path) -> None:
    design = named_frame("bridge")
    job = small_job(tmp_path / "job", design, batch_size=40)
    standing = print_batch(job, real := LeaningPrint(design, 1.5 * LEAN))
    cameras = ring_rig(enlarged_box(design.bounds, 0.2), 8, size=SIZE)
    pictures, grounds = photographs(standing, cameras, 1), photographs(None, cameras, 2)
    pictures[3] = np.zeros_like(pictures[3])
    write_capture(tmp_path / "capture", standing, cameras, pictures, backgrounds=grounds)
    (tmp_path / "capture" / "frame.json").unlink()
    report = job.answer(tmp_path / "capture")
    assert list(report["twin"]["left_out"]) == [cameras[3].name]
    assert "black" in report["twin"]["left_out"][cameras[3].name]
    adapted = job.adapted(0)
    assert np.array_equal(adapted.printed, standing.printed)
    errors = evaluate(adapted.control_points, adapted.vertices, real.standing())
    assert errors.curves.mean < 0.25  # a pixel is nearly 1 mm


def test_cameras_that_err_as_a_good_calibration_does_are_found_along_with_the_print() -> None:
    design = named_frame("bridge")
    standing = LeaningPrint(design, 1.5 * LEAN).lay(np.arange(design.strut_count), design)
    rng = np.random.default_rng(8)
    told = tuple(replace(camera.resized(1600, 1200)) for camera in cameras_of(design))
    real = [off(camera, 0.1, rng) for camera in told]
    masks = [(picture > 0).astype(np.float32) for picture in silhouettes(standing, real)]
    error = {}
    for freedom in ("exact", "auto"):
        twin = fit_batch(design, told, masks, freedom=freedom).twin
        error[freedom] = evaluate(twin.control_points, twin.vertices, standing).curves.mean
    assert error["auto"] < 0.5 * error["exact"] and error["auto"] < 0.1


def test_a_camera_that_was_moved_stops_the_job(tmp_path: Path) -> None:
    design = named_frame("bridge")
    job = small_job(tmp_path / "job", design, batch_size=40)
    standing = print_batch(job, LeaningPrint(design, LEAN))
    told = cameras_of(design)
    pose = np.array(told[1].camera_to_world)
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(np.deg2rad([0.0, 2.5, 0.0])).as_matrix()
    real = (told[0], replace(told[1], camera_to_world=pose), *told[2:])
    with pytest.raises(Held) as held:
        job.answer(take_with(tmp_path / "capture", standing, real, told))
    assert any(doubt.kind in ("camera-moved", "poor-fit") for doubt in held.value.doubts)
    assert job.current == 0


def test_a_twin_that_is_called_wrong_is_a_reason_to_stop() -> None:
    frame = named_frame("bridge")
    count = frame.strut_count
    values = {
        "control_points": frame.control_points,
        "vertices": frame.vertices,
        "thickness": np.ones((count, 4)),
        "opacity": np.ones((count, 4)),
        "completeness": np.ones(count),
        "confidence": np.ones(count),
    }
    assert doubts_of_verdict(Twin(**values, verdict=Verdict("doubtful", ("something",)))) == []
    (doubt,) = doubts_of_verdict(Twin(**values, verdict=Verdict("wrong", ("nothing agrees",))))
    assert doubt.kind == "wrong-twin" and "nothing agrees" in doubt.problem


# --- raw pictures of a rig


def rig_of(cameras: tuple[Camera, ...]) -> Rig:
    known = np.diag(np.square([0.2, 0.2, 0.2, 0.2, *5 * [1e-4], *3 * [1e-4], *3 * [0.05]]))
    return Rig(tuple(RigCamera.of(camera, known) for camera in cameras), world="robot")


def save_pictures(folder: Path, standing: Wireframe, cameras: tuple[Camera, ...]) -> None:
    folder.mkdir(parents=True)
    for camera, picture in zip(cameras, silhouettes(standing, cameras), strict=True):
        write_png(folder / f"{camera.name}.png", picture)


def test_raw_pictures_of_a_rig_are_answered_as_they_appear(tmp_path: Path) -> None:
    """The robot's base is elsewhere than the plan's; a folder waits until each camera's picture is there."""
    design = tower()
    job = small_job(tmp_path / "job", design, formats=("json",))
    cameras = cameras_of(design)
    base = np.eye(4)
    base[:3, 3] = [400.0, -50.0, 20.0]
    raw = RawPictures(rig_of(cameras).moved(base), base)
    real, shots, said = LeaningPrint(design), tmp_path / "shots", list[str]()
    shots.mkdir()
    late = tmp_path / "late.png"

    def hand(progress: Progress) -> bool:
        batch = job.current
        folder = shots / f"{batch:03d}"
        if progress.stage != "waiting for pictures" or batch is None:
            return True
        if not folder.exists():
            save_pictures(folder, print_batch(job, real), cameras)
            if batch == 0:
                (folder / f"{cameras[2].name}.png").rename(late)
        elif late.exists() and any("lacks" in sentence for sentence in said):
            late.rename(folder / f"{cameras[2].name}.png")
        return len(said) < 100

    reports = Watch(job, shots, say=said.append, progress=hand, poll=0.0, again=0.0, raw=raw).run()
    assert [report["batch"] for report in reports] == list(range(job.file.batches)) and job.current is None
    assert any(f"000 still lacks a picture of {cameras[2].name}" in sentence for sentence in said)
    adapted = job.adapted(job.file.batches - 1)
    assert evaluate(adapted.control_points, adapted.vertices, real.standing()).curves.mean < 0.3
    taken = read_capture(job.batch_folder(0) / "capture", frame=job.design)
    assert all(view.camera.deviations is not None for view in taken.views)


def test_raw_pictures_that_were_answered_are_not_taken_again(tmp_path: Path) -> None:
    design = tower()
    job = small_job(tmp_path / "job", design, formats=("json",))
    cameras = cameras_of(design)
    raw, shots, said = RawPictures(rig_of(cameras)), tmp_path / "shots", list[str]()
    save_pictures(shots / "000", print_batch(job, LeaningPrint(design)), cameras)

    def until(words: str) -> None:
        """Watch until something is said, as long as three looks."""
        said.clear()
        looks = iter(range(3))
        with pytest.raises(Cancelled):
            Watch(
                job,
                shots,
                say=said.append,
                progress=lambda progress: progress.stage != "waiting for pictures" or next(looks, None) is not None,
                poll=0.0,
                again=0.0,
                raw=raw,
            ).run()
        assert any(words in sentence for sentence in said), said

    until("000 answers batch 0.")
    until("Waiting for the pictures of batch 1")
    assert job.current == 1
