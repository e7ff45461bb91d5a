"""Try the add-on in a real Blender window on a virtual screen, with real keys and clicks, in a minute or two.

    python scripts/window_test.py --extension dist/frametwin-VERSION.zip --out out/window

Blender is the one of --blender, of the variable FRAMETWIN_BLENDER, or on the PATH. Xvfb and xdotool are needed too;
where one of them is missing, the reason is told and nothing is tried. Standard library only: any Python runs it.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STEPS = Path(__file__).resolve().with_name("window_steps.py")
SIZE = "1280x800"
PATIENCE = 300
"""Seconds after which Blender is ended."""


def missing(blender: str | None) -> str:
    """What is missing for the test, in words; empty for nothing."""
    if blender is None:
        return "there is no Blender: name one by --blender or FRAMETWIN_BLENDER, or put it on the PATH"
    lacking = [tool for tool in ("Xvfb", "xdotool") if shutil.which(tool) is None]
    return f"{' and '.join(lacking)} must be installed" if lacking else ""


def find_blender(given: str | None) -> str | None:
    """The Blender to try: the one that is named, or one on the PATH."""
    return shutil.which(given or os.environ.get("FRAMETWIN_BLENDER") or "blender")


@contextmanager
def virtual_screen() -> Iterator[str]:
    """An X server without a screen; the name of its display."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{SIZE}x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as told:
            number = told.readline().strip()
        if not number:
            raise SystemExit("Xvfb did not start")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait(10)


def prepare(blender: str, extension: Path, environment: dict[str, str]) -> None:
    """Install the extension into a profile of its own, and switch off what would stand in the way of clicks."""
    install = ["--command", "extension", "install-file", "-r", "user_default", "--enable", str(extension)]
    settings = (
        "import bpy; view = bpy.context.preferences.view; view.show_splash = False;"
        "view.filebrowser_display_type = 'SCREEN'; bpy.context.preferences.use_preferences_save = False;"
        "bpy.ops.wm.save_userpref()"
    )
    for words in (install, ["--background", "--python-exit-code", "4", "--python-expr", settings]):
        done = subprocess.run(
            [blender, "--offline-mode", *words], env=environment, capture_output=True, text=True, check=False
        )
        if done.returncode or "Traceback" in done.stdout + done.stderr:
            raise SystemExit(f"Blender could not be prepared:\n{done.stdout}{done.stderr}")


def run(blender: str, extension: Path, out: Path) -> list[dict[str, str]]:
    """Go through all steps; what each of them found."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="frametwin-window-") as scratch:
        environment = {**os.environ, "BLENDER_USER_RESOURCES": f"{scratch}/profile", "LIBGL_ALWAYS_SOFTWARE": "1"}
        environment["HOME"] = scratch
        (Path(scratch) / "profile").mkdir()
        prepare(blender, extension, environment)
        width, height = SIZE.split("x")
        with virtual_screen() as display:
            command = [blender, "--offline-mode", "--gpu-backend", "opengl"]
            command += ["--window-geometry", "0", "0", width, height, "--python", str(STEPS), "--", str(out), scratch]
            with (out / "blender.log").open("w", encoding="utf-8") as log:
                shown = {**environment, "DISPLAY": display}
                try:
                    subprocess.run(
                        command, env=shown, stdout=log, stderr=subprocess.STDOUT, check=False, timeout=PATIENCE
                    )
                except subprocess.TimeoutExpired:
                    log.write("ended, since it took too long\n")
        file = Path(scratch, "found.json")
        found = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else []
    log_text = (out / "blender.log").read_text(encoding="utf-8", errors="replace")
    if not found or found[-1]["step"] != "end" or "Traceback" in log_text:
        found.append({"step": "to the end without an error", "problem": log_text[-3000:]})
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description="Try the add-on in a real Blender window.")
    parser.add_argument("--extension", type=Path, required=True, help="the zip, from scripts/build_extension.py --bare")
    parser.add_argument("--blender", help="the executable [FRAMETWIN_BLENDER, or the one on the PATH]")
    parser.add_argument("--out", type=Path, default=Path("out/window"), help="folder for pictures and Blender's log")
    options = parser.parse_args()
    blender = find_blender(options.blender)
    reason = missing(blender)
    if blender is None or reason:
        print(f"Window test left out: {reason}")
        return 0
    found = run(blender, options.extension.resolve(), options.out.resolve())
    for each in found:
        print(f"{'ok  ' if not each['problem'] else 'FAIL'} {each['step']}{each['problem'] and ': ' + each['problem']}")
    return 1 if any(each["problem"] for each in found) else 0


if __name__ == "__main__":
    sys.exit(main())
