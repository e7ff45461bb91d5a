"""``frametwin dataset export``: a dataset for other programs."""

from __future__ import annotations

from pathlib import Path

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

FORMATS = ("nerfstudio", "colmap", "obj", "npz", "croissant")
MARK = "export.json"
"""As in `frametwin.dataset.export`, which takes seconds to import."""


@click.command("export", short_help="Write a dataset for nerfstudio, COLMAP, OBJ readers or numpy.")
@click.argument("folder", type=FOLDER, metavar="DIR")
@click.option("--format", "kind", type=click.Choice(FORMATS), required=True, help="See below.")
@click.option("--out", type=FOLDER, metavar="OUT", help="The folder to write; not for croissant.")
@click.option(
    "--unit", type=click.Choice(["mm", "m"]), help="Of lengths.  [default: m for nerfstudio, mm for the others]"
)
@click.option("--link", is_flag=True, help="Hard-link pictures in place of copying them, where that is possible.")
@overwrite_option("OUT")
@quiet_option
@json_option
def export_command(
    folder: Path,
    kind: str,
    out: Path | None,
    unit: str | None,
    link: bool,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Write the dataset in DIR in another format: a folder OUT with one folder for each sample.

    \b
    nerfstudio  transforms.json, images/ and plan.ply (the plan as the point cloud to begin with)
    colmap      images/ and a text model in sparse/0/, whose 3D points are the plan's
    obj         plan.obj, truth.obj and, where it has been fitted, twin.obj: struts as lines
    npz         sample.npz: pictures, cameras, plan and truth as plain numpy arrays
    croissant   croissant.json beside DIR/dataset.json: a card of the dataset, for search engines and loaders

    \b
    Examples:
      frametwin dataset export out/demo --format nerfstudio --out out/demo_nerfstudio
      frametwin dataset export out/demo --format colmap --out out/demo_colmap --unit m --link
      frametwin dataset export out/demo --format croissant
    """
    if kind == "croissant":
        if out is not None or unit is not None or link:
            raise click.UsageError("the format croissant takes no --out, --unit and --link: its card lies in DIR")
        from frametwin.dataset.croissant import write_croissant

        path = write_croissant(folder)
        if as_json:
            print_json({"dataset": folder, "format": kind, "card": path})
        else:
            print_facts(f"card: {path}", [("format", "Croissant 1.0")])
        return
    if out is None:
        raise click.UsageError(f"the format {kind} needs --out, the folder to write")
    check_output_folder(out, overwrite, MARK)
    from frametwin.dataset.export import ExportSettings, export_dataset

    settings = ExportSettings(kind, unit, link)
    with Display(quiet) as display:
        count = export_dataset(folder, out, settings, overwrite=overwrite, progress=display)
    if as_json:
        print_json({"dataset": folder, "format": kind, "out": out, "unit": settings.units, "samples": count})
        return
    print_facts(f"export: {out}", [("format", kind), ("samples", str(count)), ("unit of lengths", settings.units)])
