"""``frametwin calibrate check``: whether cameras have been touched since their calibration."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.common import FOLDER, json_option, print_facts, print_json, quiet_option
from frametwin.cli.display import Display


@click.command("check", short_help="Tell whether a camera has been touched since.")
@click.argument("rig", type=FOLDER)
@click.argument("capture", type=FOLDER)
@click.option("--strict", is_flag=True, help="Exit with 3 unless every camera is still.")
@quiet_option
@json_option
def check_command(rig: Path, capture: Path, strict: bool, quiet: bool, as_json: bool) -> None:
    """Tell of each camera of a RIG whether it is still where it was calibrated, by the print in a CAPTURE.

    The twin of the print is the board: where the pictures of a camera agree with those of the others only if it stood
    elsewhere than the RIG's errors allow, it was touched. Nothing is written.

    \b
    Example:
      frametwin calibrate check rig capture
    """
    import dataclasses

    from frametwin.cameras.rig_file import read_rig
    from frametwin.capture.capture import read_capture
    from frametwin.fitting.camera_check import STILL, TOUCHED, check_cameras

    found, taken = read_rig(rig), read_capture(capture)
    with Display(quiet) as display:
        checks, twin = check_cameras(found, taken, display)
    if as_json:
        cameras = [dataclasses.asdict(check) for check in checks]
        print_json({"rig": rig, "cameras": cameras, "verdict": dataclasses.asdict(twin.verdict)})
    else:
        told = [
            f"{check.status}: {check.turn:.2f} degrees, {check.shift:.1f} mm, {check.sigmas:.1f} standard deviations"
            if check.sigmas
            else check.status
            for check in checks
        ]
        facts = list(zip((check.name for check in checks), told, strict=True))
        facts.append(("verdict", "; ".join([twin.verdict.status, *twin.verdict.reasons])))
        touched = [check.name for check in checks if check.status == TOUCHED]
        if touched:
            facts.append(("remedy", f"calibrate again: {', '.join(touched)}"))
        print_facts(f"rig: {rig}", facts)
    if strict and any(check.status != STILL for check in checks):
        raise SystemExit(3)
