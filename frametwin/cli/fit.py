"""``frametwin fit``: a digital twin from a capture."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from frametwin.cli.common import (
    FOLDER,
    check_output_folder,
    json_option,
    overwrite_option,
    print_facts,
    print_json,
    quiet_option,
)
from frametwin.cli.display import Display
from frametwin.cli.memory import keep_freed_memory
from frametwin.errors import InputError
from frametwin.twin.verdict import WRONG
from frametwin.wording import shortened

if TYPE_CHECKING:
    pass

CAMERAS = ("auto", "exact")
HOLDS = ("auto", "feet", "cameras")
"""As `frametwin.fitting.fast_settings`."""

PRESETS = ("fast", "paper", "paper-letter", "paper-lattice", "curve-driven", "deformation-driven")
"""As `frametwin.fitting.api.PRESETS`, which takes seconds to import."""

MASKS = ("auto", "paper")
"""As `frametwin.imaging.view_masks.METHODS`."""


@click.command("fit", short_help="Find the digital twin of a capture.")
@click.argument("capture", type=FOLDER)
@click.option("--out", type=FOLDER, required=True, metavar="RUN", help="The run folder to write.")
@click.option(
    "--preset",
    type=click.Choice(PRESETS),
    default="fast",
    show_default=True,
    help="fast: seconds, and the most accurate; paper: the published method, minutes to hours;"
    " paper-letter: the same by the letter of its text;"
    " paper-lattice: paper with a lattice in place of the network; curve-driven and deformation-driven:"
    " what the paper compares with, by their published settings.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Of what the preset draws at random; fast draws nothing.",
)
@click.option(
    "--set",
    "assignments",
    multiple=True,
    metavar="NAME=VALUE",
    help="Change a setting of the preset; can be given several times. An unknown name lists them all.",
)
@click.option(
    "--warm-start",
    type=FOLDER,
    metavar="RUN",
    help="Start from the field of an earlier run of the same frame, such as that of the last batch.",
)
@click.option(
    "--cameras",
    type=click.Choice(CAMERAS),
    default="auto",
    show_default=True,
    help="Whether cameras may be a little elsewhere than the capture says: auto lets them move within the errors of a"
    " usual calibration where the pictures ask for it, exact believes them to the last digit. Preset fast only.",
)
@click.option(
    "--anchor",
    type=click.Choice((*HOLDS, "plate")),
    default="auto",
    show_default=True,
    help="What holds the world when cameras move: the feet on the plate, the cameras, whichever is more probable, or"
    " the markers on the plate, which always tell of the cameras where the capture has them.",
)
@click.option("--strict", is_flag=True, help="Exit with 3 if the verdict on the twin is wrong.")
@click.option(
    "--mask",
    type=click.Choice(MASKS),
    default="auto",
    show_default=True,
    help="What becomes of photos: auto keeps the shaded side of struts; paper is the rule of the paper.",
)
@click.option(
    "--ignore",
    type=FOLDER,
    metavar="FOLDER",
    help="Pictures named as the views' own, white where nothing is to be looked at, such as the robot's arm.",
)
@overwrite_option("RUN")
@quiet_option
@json_option
def command(**options: Any) -> None:
    """Find where every strut of the CAPTURE's frame is.

    RUN is a folder with the twin (twin.json: curves of all struts in mm, those still to be printed moved to
    meet the printed ones; thickness, opacity, completeness and confidence of each), the deformation field
    (field.safetensors) and the plan (frame.json). Struts that are missing or broken off are named, and so
    are those that the views do not determine.

    The pictures are masks (white print, black ground), or photos, better with the same views before printing in
    CAPTURE/background. What is taken for print in photos is shown by "frametwin mask".

    \b
    Examples:
      frametwin fit out/bridge --out out/bridge_run
      frametwin fit out/batch2 --out out/run2 --warm-start out/run1
      frametwin fit out/bridge --out out/paper --preset paper --set iterations=50 --set image_scale=0.25
    """
    _fit(FitOptions(**options))


@dataclasses.dataclass(frozen=True)
class FitOptions:
    """The command line of a fit; see its help."""

    capture: Path
    out: Path
    preset: str
    seed: int
    assignments: tuple[str, ...]
    warm_start: Path | None
    cameras: str
    anchor: str
    strict: bool
    mask: Literal["auto", "paper"]
    ignore: Path | None
    overwrite: bool
    quiet: bool
    as_json: bool


def _fit(options: FitOptions) -> None:
    check_output_folder(options.out, options.overwrite, "twin.json")
    keep_freed_memory()
    from frametwin.capture.capture import read_capture
    from frametwin.fitting.api import fit_capture, settings_of, write_run
    from frametwin.twin.runs import fit_summary

    preset, seed = options.preset, options.seed
    changes = parse_changes(options.assignments, settings_of(preset, seed))
    changes |= camera_changes(options)
    settings_of(preset, seed, changes)  # refuses what is wrong before the capture is read
    capture = read_capture(options.capture)
    if options.anchor == "plate" and capture.plate is None:
        remedy = "make it with a rig that was placed by a plate, or write plate.json; see docs/cameras.md"
        raise InputError.at(options.capture, "plate", "the capture tells of no markers on the plate", remedy)
    with Display(options.quiet) as display:
        result = fit_capture(
            capture,
            preset,
            seed=seed,
            changes=changes,
            warm_start=options.warm_start,
            mask=options.mask,
            ignore=options.ignore,
            callback=display,
        )
        write_run(options.out, result, capture, overwrite=options.overwrite)
    data = fit_summary(result.twin, capture.frame)
    if options.as_json:
        print_json({"out": options.out, "preset": preset, "views": len(capture.views), **data})
    else:
        print_facts(f"run: {options.out}", summary_facts(data, len(capture.views)))
    if options.strict and data["verdict"]["status"] == WRONG:
        raise SystemExit(3)


def camera_changes(options: FitOptions) -> dict[str, Any]:
    """Settings of the fast fit for the options of the command.

    Raises
    ------
    InputError
        If another preset is asked for what only the fast one does.
    """
    hold = "cameras" if options.anchor == "plate" else options.anchor  # the markers are in what is known of them
    wanted = {name: value for name, value in (("cameras", options.cameras), ("hold", hold)) if value != "auto"}
    if wanted and options.preset != "fast":
        problem = f"the preset {options.preset} takes the cameras as they are"
        raise InputError.at("--cameras", "preset", problem, "use the preset fast, or leave --cameras and --anchor out")
    return wanted


def summary_facts(data: dict[str, Any], views: int) -> list[tuple[str, str]]:
    """The same for people."""
    there = [f"{item['strut']} ({item['completeness']:.0%} there)" for item in data["missing"]]
    facts = [
        ("frame", f"{data['frame']}, {data['printed']} of {data['struts']} struts printed, {views} views"),
        ("missing struts", shortened(there)),
        ("uncertain struts", shortened([item["strut"] for item in data["uncertain"]])),
        ("verdict", "; ".join([data["verdict"]["status"], *data["verdict"]["reasons"]])),
        ("time", f"{data['seconds']:.1f} s"),
    ]
    if data["sigma"] is not None:
        facts.insert(3, ("typical strut", f"within {2.0 * data['sigma']:.3f} mm (two standard deviations)"))
    if data["loss"] is not None:
        facts.append(("loss", f"{data['loss']:.4g}"))
    return facts


def parse_changes(assignments: Sequence[str], settings: Any) -> dict[str, Any]:
    """Read ``name=value`` pairs into values of the same kinds as those of ``settings``, a dataclass.

    Raises
    ------
    InputError
        If a name is unknown or given twice, or a value is of another kind.
    """
    known = {
        field.name: getattr(settings, field.name)
        for field in dataclasses.fields(settings)
        if field.name not in ("preset", "seed") and _can_be_typed(getattr(settings, field.name))
    }
    changes: dict[str, Any] = {}
    for assignment in assignments:
        name, sign, text = (part.strip() for part in assignment.partition("="))
        if name not in known or not sign or name in changes:
            problem = "is given twice" if name in changes else "is not a setting" if sign else "is not NAME=VALUE"
            raise InputError.at("--set", assignment, problem, f"use one of {_described(known)}, each once")
        changes[name] = _value(name, text, known[name])
    return changes


def _can_be_typed(value: Any) -> bool:
    parts = value if isinstance(value, tuple) else (value,)
    return all(isinstance(part, bool | int | float | str) for part in parts)


def _described(known: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={_typed(value)}" for name, value in known.items())


def _typed(value: Any) -> str:
    if isinstance(value, tuple):
        return ",".join(_typed(part) for part in value)
    return value if isinstance(value, str) else json.dumps(value)


def _value(name: str, text: str, example: Any) -> Any:
    """Parse a value of the kind of ``example``: whole numbers for lists and counts, true or false ..."""
    if isinstance(example, tuple):
        parts = text.strip("[]() ").replace(",", " ").split()
        return tuple(_value(name, part, example[0]) for part in parts)
    if isinstance(example, str):
        return text
    try:
        value = json.loads(text)
    except ValueError:
        value = None
    fits = isinstance(value, bool) == isinstance(example, bool) and isinstance(value, bool | int | float)
    if not fits or (isinstance(example, int) and not isinstance(value, int)):
        remedy = f"give a value such as {name}={_typed(example)}"
        raise InputError.at("--set", name, f"{text!r} is of another kind", remedy)
    return float(value) if isinstance(example, float) else value
