"""The test in a real Blender window is left out with a reason where something is missing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from scripts import window_test

SCRIPT = Path(window_test.__file__)


def test_without_blender_the_reason_is_told(tmp_path: Path) -> None:
    command = [sys.executable, str(SCRIPT), "--extension", str(tmp_path / "a.zip"), "--blender", str(tmp_path / "none")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0 and done.stdout.startswith("Window test left out: there is no Blender")


@pytest.mark.parametrize(("present", "words"), [((), "Xvfb and xdotool must"), (("Xvfb",), "xdotool must"), (None, "")])
def test_what_else_is_missing(monkeypatch: pytest.MonkeyPatch, present: tuple[str, ...] | None, words: str) -> None:
    found = ("Xvfb", "xdotool") if present is None else present
    monkeypatch.setattr(window_test.shutil, "which", lambda name: name if name in found else None)
    assert window_test.missing("blender").startswith(words) and bool(window_test.missing("blender")) == bool(words)
