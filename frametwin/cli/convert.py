"""``frametwin convert``: a frame from one format into another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from frametwin.cli.common import (
    FOLDER,
    Positive,
    json_option,
    load_frame,
    overwrite_option,
    print_json,
)
from frametwin.errors import InputError

if TYPE_CHECKING:
    from frametwin.geometry.wireframe import Wireframe
    from frametwin.twin.twin import Twin


@click.command("convert", short_help="Write a frame in another format.")
@click.argument("source", metavar="IN")
@click.argument("target", metavar="OUT", type=FOLDER)
@click.option("--scale", type=Positive(), help="Multiply all lengths by this, such as 1000 for a file in metres.")
@click.option("--radius", type=Positive(), help="Radius of all struts in mm, after scaling.")
@overwrite_option("OUT")
@json_option
def command(
    source: str, target: Path, scale: float | None, radius: float | None, overwrite: bool, as_json: bool
) -> None:
    """Write the frame IN as OUT: a frame.json (any name ending in .json), or an OBJ with lines (.obj).

    IN is a frame.json, an assembly or conmech JSON, a COMPAS Graph or Network, one of a pair of Node*.txt and
    Edge*.txt, an OBJ, the lines of a DXF drawing or a Rhino model (.3dm; these two need pip install
    'frametwin[formats]'), the edges of any mesh (STL, PLY, OFF, GLB ...), a capture (its plan), a run (the
    twin's curves), or one of bridge, half_bowl and lattice_tower. Files that state a unit are converted to mm,
    the others are taken to be in mm. Struts without a radius get 6 % of the median strut length.

    \b
    Examples:
      frametwin convert NodeFemur_wireframe.txt femur.json
      frametwin convert model_in_metres.obj model.json --scale 1000 --radius 1.5
      frametwin convert out/first/run twin.obj
    """
    from frametwin.formats import write_frame
    from frametwin.formats.units import scaled

    if target.exists() and not overwrite:
        raise InputError.at(target, "OUT", "exists already", "choose another name, or give --overwrite")
    frame, twin = _read(source)
    curves = None if twin is None else twin.curves
    if scale is not None:
        frame = scaled(frame, scale)
        curves = None if curves is None else scale * curves
    if radius is not None:
        frame = frame.replace(radius=[radius] * frame.strut_count)
    write_frame(target, frame, curves)
    if as_json:
        counts = {"struts": frame.strut_count, "joints": frame.vertex_count, "extent": frame.extent}
        print_json({"out": target, **counts})
    else:
        click.echo(f"{target}: {frame.strut_count} struts, {frame.vertex_count} joints, {frame.extent:.4g} mm long")
        if twin is not None and twin.bent and target.suffix.lower() == ".json":
            click.echo(f"{len(twin.bent)} struts are bent as no cubic can be: the cubics nearest to them were written")


def _read(source: str) -> tuple[Wireframe, Twin | None]:
    from frametwin.twin.runs import is_run, load_run

    if is_run(Path(source)):
        twin, plan = load_run(Path(source))
        return twin.as_wireframe(plan), twin
    return load_frame(source), None
