"""``frametwin demo``: simulate, fit and evaluate in one go, with a picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin import __version__
from frametwin.cli.common import (
    FOLDER,
    json_option,
    load_frame,
    overwrite_option,
    print_facts,
    print_json,
    print_table,
    quiet_option,
    size_option,
)
from frametwin.cli.display import Display
from frametwin.cli.evaluate import describe_detection, error_rows
from frametwin.cli.fit import PRESETS, summary_facts
from frametwin.errors import InputError

if TYPE_CHECKING:
    from frametwin.capture.capture import Capture
    from frametwin.evaluation.evaluate import Errors
    from frametwin.fitting.api import FitResult
    from frametwin.geometry.wireframe import Wireframe
    from frametwin.simulation.simulate import Simulation, SimulationSettings
    from frametwin.twin.findings import Detection

MARK = "demo.json"
CONTENT = frozenset({MARK, "capture", "run", "views.png"})


@click.command("demo", short_help="Simulate, fit and evaluate a frame, and draw the views.")
@click.option(
    "--frame",
    default="bridge",
    show_default=True,
    metavar="FRAME",
    help="bridge (76 struts), half_bowl (156, curved), lattice_tower (804), or a frame file.",
)
@click.option(
    "--out",
    type=FOLDER,
    default="out/first",
    show_default=True,
    help="The folder to write. An earlier demo in it is replaced.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all that is random.")
@click.option("--views", type=click.IntRange(2, 100), default=8, show_default=True, help="Number of cameras.")
@size_option
@click.option(
    "--missing", type=click.IntRange(0), default=0, show_default=True, help="Number of struts that broke off."
)
@click.option("--preset", type=click.Choice(PRESETS), default="fast", show_default=True, help="See fit --help.")
@click.option(
    "--renderer",
    type=click.Choice(["auto", "blender", "library"]),
    default="auto",
    show_default=True,
    help="Who takes the pictures: Blender where its module is installed, or the library's own exact silhouettes.",
)
@overwrite_option("the folder, whatever is in it,")
@quiet_option
@json_option
def command(**options: Any) -> None:
    """Let a frame sag, render it from all sides, find it in the pictures again, and compare with the truth.

    The table shows how far the plan was from the truth, and how far the twin is: between the curves, at the
    joints, and at equal parameter (see frametwin evaluate --help), in mm.

    \b
    The folder then holds
      capture/    the pictures, the plan and the truth, as from frametwin simulate
      run/        the twin and its field, as from frametwin fit
      views.png   all views with plan, truth and twin drawn over each other
      demo.json   the table of errors

    \b
    Examples:
      frametwin demo
      frametwin demo --frame lattice_tower --missing 3 --out out/tower
    """
    _demo(DemoOptions(**options))


@dataclass(frozen=True)
class DemoOptions:
    """The command line of a demo; see its help."""

    frame: str
    out: Path
    seed: int
    views: int
    size: tuple[int, int]
    missing: int
    preset: str
    renderer: str
    overwrite: bool
    quiet: bool
    as_json: bool


def _demo(options: DemoOptions) -> None:
    out = options.out
    replace = options.overwrite or is_own_demo(out)
    if out.is_dir() and any(out.iterdir()) and not replace:
        remedy = "choose another folder, or give --overwrite to replace all that is in it"
        raise InputError.at(out, "--out", "holds something else than an earlier demo", remedy)
    plan = load_frame(options.frame)
    from frametwin.files import staged_directory
    from frametwin.simulation.simulate import SimulationSettings

    settings = SimulationSettings(views=options.views, size=options.size, seed=options.seed, missing=options.missing)
    blender = takes_blender(options.renderer)
    with Display(options.quiet) as display, staged_directory(out, overwrite=replace) as stage:
        done = run_demo(plan, settings, options.preset, stage, display, blender)
    if options.as_json:
        print_json({"out": out, **done.as_dict()})
    else:
        _tell(out, done)


def takes_blender(renderer: str) -> bool:
    """Whether Blender takes the pictures; an error in words where it shall and cannot."""
    from frametwin.blender.rendering.client import blender_is_here

    if renderer == "blender" and not blender_is_here():
        remedy = "install it by 'python3 scripts/run.py setup', or take another renderer"
        raise InputError.at("--renderer", renderer, "Blender's module bpy is not installed", remedy)
    return renderer == "blender" or (renderer == "auto" and blender_is_here())


def _tell(out: Path, done: Done) -> None:
    print_facts(f"demo: {out}", done.facts())
    columns = ("", *(f"{who} {figure}" for who in ("plan", "twin") for figure in ("mean", "p95", "max")))
    print_table("Distance from the truth in mm", columns, error_rows(done.before, done.after))
    if done.detection is not None:
        click.echo(describe_detection(done.detection))
    click.echo(f"Look at {out / 'views.png'}: plan, truth and twin over what the cameras saw.")
    click.echo(f"The capture is {out / 'capture'}, the twin {out / 'run' / 'twin.json'}.")


def is_own_demo(path: Path) -> bool:
    """Whether a folder holds an earlier demo and nothing else, so that it may be replaced."""
    return (path / MARK).is_file() and {item.name for item in path.iterdir()} <= CONTENT


@dataclass(frozen=True, eq=False)
class Done:
    """What a demo found."""

    simulation: Simulation
    result: FitResult
    before: Errors
    after: Errors
    detection: Detection | None
    renderer: str

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        from frametwin.twin.runs import fit_summary

        found = {} if self.detection is None else {"missing_struts": self.detection.as_dict()}
        return {
            **fit_summary(self.result.twin, self.simulation.frame),
            "unit": "mm",
            "renderer": self.renderer,
            "largest_displacement": self.simulation.peak,
            "plan": self.before.summary(),
            "twin": self.after.summary(),
            **found,
        }

    def facts(self) -> list[tuple[str, str]]:
        """For people."""
        from frametwin.twin.runs import fit_summary

        data = fit_summary(self.result.twin, self.simulation.frame)
        sag = ("largest displacement", f"{self.simulation.peak:.4g} mm")
        return [*summary_facts(data, len(self.simulation.cameras)), ("pictures by", self.renderer), sag]


def run_demo(
    plan: Wireframe, settings: SimulationSettings, preset: str, folder: Path, display: Display, blender: bool = False
) -> Done:
    """Simulate, take pictures (with ``blender``: by Blender), fit, evaluate and draw into ``folder``."""
    from frametwin.capture.capture import read_capture
    from frametwin.evaluation.evaluate import evaluate
    from frametwin.files import write_json
    from frametwin.fitting.api import fit_capture, write_run
    from frametwin.simulation.simulate import simulate, write_simulation
    from frametwin.twin.findings import Detection, missing_struts

    simulation = simulate(plan, settings, display)
    renderer = "the library's own silhouettes"
    if blender:
        simulation, renderer = _rendered(simulation, display)
    write_simulation(folder / "capture", simulation)
    capture = read_capture(folder / "capture")
    result = fit_capture(capture, preset, seed=settings.seed, callback=display)
    write_run(folder / "run", result, capture)
    frame, truth, present = simulation.frame, simulation.truth, simulation.present
    before = evaluate(frame.control_points, frame.vertices, truth, present)
    after = evaluate(result.twin.curves, result.twin.vertices, truth, present)
    detection = None
    if settings.missing:
        detection = Detection.of(missing_struts(result.twin, frame.printed), present, frame.printed)
    done = Done(simulation, result, before, after, detection, renderer)
    _draw(folder / "views.png", capture, done, display)
    notes = {"format": "frametwin-demo", "version": 1, "frametwin": __version__, "preset": preset}
    write_json(folder / MARK, {**notes, **done.as_dict()})
    return done


def _rendered(simulation: Simulation, display: Display) -> tuple[Simulation, str]:
    """The simulation with masks by Blender, and Blender's name."""
    from dataclasses import replace

    import numpy as np

    from frametwin.blender.rendering.client import render_in_child
    from frametwin.capture.image_files import decode_png
    from frametwin.capture.scene import Scene
    from frametwin.scratch import scratch_folder

    thickness = np.repeat(simulation.truth.radius[:, None], 2, axis=1)
    scene = Scene(simulation.truth, simulation.present, thickness, simulation.cameras)
    with scratch_folder() as folder:
        rendered = render_in_child(scene, folder, display)
        images = [decode_png((folder / "images" / f"{c.name}.png").read_bytes()) for c in simulation.cameras]
    name = f"Blender {rendered['blender']} ({rendered['engine']})"
    return replace(simulation, images=images), name


def _draw(path: Path, capture: Capture, done: Done, display: Display) -> None:
    from frametwin.capture.image_files import write_png
    from frametwin.imaging.contact_sheet import contact_sheet, find_close_ups
    from frametwin.imaging.overlay import layers_of
    from frametwin.progress import Progress, report

    report(display, Progress("drawing views", 0, 1))
    frame, truth, twin = done.simulation.frame, done.simulation.truth, done.result.twin
    printed = frame.printed
    cameras = [view.camera for view in capture.views]
    before, after = done.before.curves, done.after.curves
    sheet = contact_sheet(
        cameras,
        done.simulation.images,
        layers_of(frame.control_points[printed], truth.control_points[printed], twin.control_points[printed]),
        title=f"{frame.name}: {int(printed.sum())} struts, {len(cameras)} views",
        subtitle=f"Distance between the curves of twin and truth: {after.mean:.3f} mm on average, {after.max:.2f} mm"
        f" at most. The plan was {before.mean:.1f} mm away on average and {before.max:.1f} mm at most.",
        close_ups=find_close_ups(
            cameras, frame.vertices, truth.vertices, twin.vertices, joints=frame.printed_vertices()
        ),
    )
    write_png(path, sheet)
    report(display, Progress("drawing views", 1, 1))
