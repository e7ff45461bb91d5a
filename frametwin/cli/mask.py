"""``frametwin mask``: what is taken for print in the pictures of a capture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from frametwin.cli.common import FOLDER, json_option, print_facts, print_json, quiet_option
from frametwin.cli.display import Display
from frametwin.errors import InputError

if TYPE_CHECKING:
    from frametwin.imaging.photo_masks import ViewMask

SUFFIXES = (".html", ".png")


@click.command("mask", short_help="Show what is taken for print in a capture's pictures.")
@click.argument("capture", type=FOLDER)
@click.option(
    "--out", type=FOLDER, required=True, metavar="PAGE", help="The page to write, .html or .png; it is replaced."
)
@click.option(
    "--mask",
    "method",
    type=click.Choice(("auto", "paper")),
    default="auto",
    show_default=True,
    help="What becomes of photos, as for a fit.",
)
@click.option(
    "--ignore",
    type=FOLDER,
    metavar="FOLDER",
    help="Pictures named as the views' own, white where nothing is to be looked at, such as the robot's arm.",
)
@click.option("--run", type=FOLDER, metavar="RUN", help="Look about the twin of this run, as a fit does in the end.")
@quiet_option
@json_option
def command(
    capture: Path,
    out: Path,
    method: Literal["auto", "paper"],
    ignore: Path | None,
    run: Path | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Show the masks of a CAPTURE over its pictures, on one page.

    Each view is named with the method, how much of the plan was found, its noise and exposure, and, if it cannot be
    used, why.

    \b
    Examples:
      frametwin mask CAPTURE --out seen.html
      frametwin mask CAPTURE --run RUN --out seen.png
    """
    if out.suffix.lower() not in SUFFIXES:
        raise InputError.at("--out", str(out), "is no page", f"give a file that ends in {' or '.join(SUFFIXES)}")
    from frametwin.capture.capture import read_capture
    from frametwin.capture.image_files import encode_png
    from frametwin.files import write_bytes
    from frametwin.fitting.camera_corrections import as_found
    from frametwin.imaging.mask_page import figures_of, page, seen_views, sheet
    from frametwin.imaging.view_masks import read_view_masks, settled_view_masks
    from frametwin.twin.runs import load_run

    taken = read_capture(capture)
    with Display(quiet) as display:
        masks = read_view_masks(taken, method, ignore=ignore, require=False, progress=display)
        if run is not None:
            twin, _ = load_run(run)
            cameras = as_found([view.camera.without_distortion() for view in taken.views], twin.cameras)
            masks = settled_view_masks(taken, masks, twin.as_wireframe(taken.frame), cameras, twin.curves)
        views = seen_views(taken, masks)
    title = f"What is seen of {taken.frame.name}"
    data = page(title, views).encode() if out.suffix.lower() == ".html" else encode_png(sheet(views))
    write_bytes(out, data)
    names = [view.image.path.name for view in taken.views]
    if as_json:
        print_json({"out": out, "views": [_figures(name, mask) for name, mask in zip(names, masks, strict=True)]})
    else:
        print_facts(f"page: {out}", [(name, figures_of(mask)) for name, mask in zip(names, masks, strict=True)])


def _figures(name: str, mask: ViewMask) -> dict[str, Any]:
    import numpy as np

    return {
        "image": name,
        "method": mask.method,
        "used": mask.used,
        "reason": mask.reason or None,
        "found": mask.found if np.isfinite(mask.found) else None,
        "noise": None if mask.photo is None else mask.photo.noise,
        "blur": mask.blur or None,
        "gain": None if mask.photo is None else mask.photo.gain.tolist(),
    }
