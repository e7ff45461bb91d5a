"""``frametwin track``: a twin that follows pictures as they come."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
from frametwin.errors import InputError
from frametwin.wording import enumerated

if TYPE_CHECKING:
    from frametwin.cameras import Camera
    from frametwin.tracking.events import Event
    from frametwin.tracking.moments import Stream


@click.command("track", short_help="Follow a print by pictures as they come, and tell what happens to it.")
@click.argument("source", type=FOLDER, metavar="JOB|RUN")
@click.argument("stream", type=FOLDER, required=False)
@click.option("--out", type=FOLDER, required=True, metavar="RUN", help="Where the latest twin is kept, as a run.")
@click.option("--camera", "devices", metavar="0,1,...", help="In place of STREAM: cameras or films, by OpenCV.")
@click.option(
    "--cameras",
    type=FOLDER,
    metavar="FOLDER",
    help="Where their transforms.json is.  [default: STREAM, or the job's last pictures]",
)
@click.option(
    "--background",
    type=FOLDER,
    metavar="PICTURES",
    help="The views before printing, named after the cameras.  [default: STREAM/background]",
)
@click.option(
    "--threshold",
    type=click.FloatRange(0.0, min_open=True),
    default=1.0,
    show_default=True,
    help="By how many mm a joint must have moved to be told of.",
)
@click.option("--every", is_flag=True, help="Take every moment, and not the newest.")
@click.option(
    "--rate", type=click.FloatRange(0.01, 1000.0), metavar="HZ", help="Moments a second.  [default: the files' times]"
)
@click.option("--idle", type=click.FloatRange(0.1), metavar="SECONDS", help="End when nothing has come for so long.")
@overwrite_option("the run")
@quiet_option
@json_option
def command(**options: Any) -> None:
    """Follow the print of a RUN, or the batch of a JOB that is being printed, by the pictures of STREAM.

    STREAM is a folder into which pictures drop, named after their cameras and moments: 0007/left.png, left/0007.png,
    left-0007.png or 0007-left.png. They are masks, or photographs with the views before printing in background/.

    Every event is a line on standard output and a line of JSON in RUN/events.jsonl: joints that have moved by more than
    the threshold, struts that have fallen, come back or been laid, views that disagree with the others, and when the
    arm has come into view or left it, so that the batch can be answered. The latest twin is kept in RUN, whose files
    are whole at any moment. Ctrl-C ends it.

    \b
    Examples:
      frametwin track out/run shots --out out/live
      frametwin track out/job --camera 0,1,2,3 --cameras rig --out out/live
      frametwin track out/job recorded --every --rate 5 --idle 2 --out out/live
    """
    _track(TrackOptions(**options))


@dataclass(frozen=True)
class TrackOptions:
    """The command line of following a print; see its help."""

    source: Path
    stream: Path | None
    out: Path
    devices: str | None
    cameras: Path | None
    background: Path | None
    threshold: float
    every: bool
    rate: float | None
    idle: float | None
    overwrite: bool
    quiet: bool
    as_json: bool


def _track(options: TrackOptions) -> None:
    check_output_folder(options.out, options.overwrite, "twin.json")
    from frametwin.tracking.session import Session
    from frametwin.tracking.settings import TrackSettings
    from frametwin.tracking.sources import backgrounds_for, cameras_for, read_followed

    followed = read_followed(options.source)
    known = cameras_for(followed, options.cameras, options.stream)
    before = backgrounds_for(known, options.background, options.stream)

    def say(event: Event) -> None:
        if not options.as_json:
            click.echo(f"{event.time:.2f} {event.kind}: {event}")

    with Display(quiet=True) as display:
        session = Session(
            followed,
            known,
            _stream(options, known),
            options.out,
            settings=TrackSettings(threshold=options.threshold),
            backgrounds=before,
            say=say,
            progress=display,
            idle=options.idle,
        )
        if not options.quiet:
            click.echo(f"Following {len(known)} views; the first pictures take a while on a new machine.", err=True)
        summary = session.run()
    if options.as_json:
        print_json({"run": options.out, **vars(summary)})
    elif not options.quiet:
        told = enumerated(f"{count} {kind}" for kind, count in summary.events.items())
        facts = [("events", told), ("passed over", str(summary.passed_over))]
        facts.append(("a moment", f"{1e3 * summary.seconds:.0f} ms"))
        twin = f"twin in {options.out}" if summary.moments else "so no twin was written"
        print_facts(f"{summary.moments} moments followed, {twin}", facts)


def _stream(options: TrackOptions, cameras: tuple[Camera, ...]) -> Stream:
    if (options.stream is None) == (options.devices is None):
        problem = "are missing" if options.stream is None else "are given twice"
        raise InputError.at("STREAM", "pictures", problem, "give either a folder STREAM or --camera")
    if options.stream is not None:
        from frametwin.tracking.folder_stream import FolderStream

        return FolderStream(options.stream, [camera.name for camera in cameras], options.every, options.rate)
    from frametwin.tracking.camera_stream import CameraStream

    sources = [source.strip() for source in str(options.devices).split(",") if source.strip()]
    if len(sources) != len(cameras):
        problem = f"names {len(sources)} where {len(cameras)} are calibrated"
        raise InputError.at("--camera", "devices", problem, "give one for each camera, in the order of transforms.json")
    return CameraStream(sources, options.rate)
