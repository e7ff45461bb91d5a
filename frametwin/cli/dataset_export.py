"""``frametwin dataset export``: a dataset for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from frametwin.cli.common import (
    FOLDER,
    Positive,
    check_output_folder,
    json_option,
    overwrite_option,
    print_facts,
    print_json,
    quiet_option,
)
from frametwin.cli.display import Display

FORMATS = ("nerfstudio", "colmap", "obj", "npz", "webdataset", "huggingface", "coco", "croissant")
MARK = "export.json"
"""As in `frametwin.dataset.export`, which takes seconds to import."""


class Shares(click.ParamType):
    """Shares of training and testing, written 0.8,0.2."""

    name = "shares"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(float(number) for number in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is no list of shares, such as 0.8,0.2 or 0.8,0.1,0.1", param, ctx)


@click.command("export", short_help="Write a dataset for reconstruction, drawing, numpy or machine learning.")
@click.argument("folder", type=FOLDER, metavar="DIR")
@click.option("--format", "kind", type=click.Choice(FORMATS), required=True, help="See below.")
@click.option("--out", type=FOLDER, metavar="OUT", help="The folder to write; not for croissant.")
@click.option(
    "--unit", type=click.Choice(["mm", "m"]), help="Of lengths.  [default: m for nerfstudio, mm for the others]"
)
@click.option("--link", is_flag=True, help="Hard-link pictures in place of copying them, where that is possible.")
@click.option(
    "--split",
    type=Shares(),
    metavar="SHARES",
    help="Of the prints: for training and testing, as 0.8,0.2, or training, validation and testing, as 0.8,0.1,0.1;"
    " for webdataset, huggingface and coco.  [default: all for training]",
)
@click.option("--split-seed", type=click.IntRange(0), default=0, show_default=True, help="Which print goes where.")
@click.option(
    "--shard-mb",
    type=Positive(),
    default=500.0,
    show_default=True,
    help="Size in MB after which another file begins; for webdataset and huggingface.",
)
@overwrite_option("OUT")
@quiet_option
@json_option
def export_command(
    folder: Path,
    kind: str,
    out: Path | None,
    unit: str | None,
    link: bool,
    split: tuple[float, ...] | None,
    split_seed: int,
    shard_mb: float,
    overwrite: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Write the dataset in DIR in another format.

    A folder OUT with one folder for each sample:

    \b
    nerfstudio  transforms.json, images/ and plan.ply (the plan as the point cloud to begin with)
    colmap      images/ and a text model in sparse/0/, whose 3D points are the plan's
    obj         plan.obj, truth.obj and, where it has been fitted, twin.obj: struts as lines
    npz         sample.npz: pictures, cameras, plan and truth as plain numpy arrays

    A folder OUT with files for learning, whose parts never share a print:

    \b
    webdataset   train-000000.tar and so on: pictures, masks, arrays and passes of every sample
    huggingface  data/train-*.parquet with pictures, and README.md: for datasets.load_dataset
    coco         images/ and annotations/train.json: masks of struts, and curves as keypoints, for pycocotools

    Without OUT:

    \b
    croissant   croissant.json beside DIR/dataset.json: a card of the dataset, for search engines and loaders

    \b
    Examples:
      frametwin dataset export out/demo --format nerfstudio --out out/demo_nerfstudio
      frametwin dataset export out/demo --format colmap --out out/demo_colmap --unit m --link
      frametwin dataset export out/demo --format webdataset --out out/demo_shards --split 0.8,0.2
      frametwin dataset export out/demo --format croissant
    """
    if kind == "croissant":
        if out is not None or unit is not None or link or split is not None:
            raise click.UsageError(
                "the format croissant takes no --out, --unit, --link and --split: its card lies in DIR"
            )
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

    settings = ExportSettings(kind, unit, link, split, split_seed, shard_mb)
    with Display(quiet) as display:
        count = export_dataset(folder, out, settings, overwrite=overwrite, progress=display)
    if as_json:
        print_json({"dataset": folder, "format": kind, "out": out, "unit": settings.units, "samples": count})
        return
    print_facts(f"export: {out}", [("format", kind), ("samples", str(count)), ("unit of lengths", settings.units)])
