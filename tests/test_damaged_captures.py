"""Every kind of damage to a capture is refused in one sentence that names file, field and remedy."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_views import KINDS

from frametwin.capture.capture import read_capture
from frametwin.errors import InputError
from frametwin.imaging.masks import read_masks


def contents(folder: Path) -> dict[str, str]:
    """Hash of every file, target of every link."""
    return {
        str(path.relative_to(folder)): os.readlink(path)
        if path.is_symlink()
        else hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_symlink() or path.is_file()
    }


def test_the_undamaged_capture_is_fine(small_capture: Path) -> None:
    masks = read_masks(read_capture(small_capture))
    assert len(masks) == 3 and len(KINDS) >= 30


ODD_VALUES = (
    None,
    True,
    -1,
    0,
    1e300,
    10**25,
    2.5,
    "",
    "text",
    [],
    [[]],
    {},
    [1, "a"],
    {"a": [1]},
    "../x",
    "\ud800",
)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("seed", range(60))
def test_any_other_damage_is_refused_or_harmless(small_capture: Path, seed: int) -> None:
    """Odd values in odd places and damaged bytes: never an exception of another kind."""
    rng = np.random.default_rng(seed)
    files = [path for path in sorted(small_capture.rglob("*")) if path.is_file()]
    path = files[seed % len(files)]
    for _ in range(5):
        original = path.read_bytes()
        if path.suffix == ".json" and rng.random() < 0.7:
            data = json.loads(original)
            place: Any = data
            while True:
                keys = list(place) if isinstance(place, dict) else list(range(len(place)))
                key = keys[rng.integers(len(keys))]
                deeper = isinstance(place[key], list | dict) and len(place[key]) > 0
                if not deeper or rng.random() < 0.2:
                    break
                place = place[key]
            place[key] = ODD_VALUES[rng.integers(len(ODD_VALUES))]
            path.write_text(json.dumps(data))
        else:
            damaged = bytearray(original)
            start = int(rng.integers(len(damaged)))
            damaged[start : start + int(rng.integers(1, 4))] = rng.bytes(int(rng.integers(0, 4)))
            path.write_bytes(damaged)
        try:
            read_masks(read_capture(small_capture))
        except InputError as error:
            assert "\n" not in str(error) and str(small_capture) in str(error)
        path.write_bytes(original)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", KINDS)
def test_damage_is_refused_in_one_sentence(small_capture: Path, capfd: pytest.CaptureFixture[str], name: str) -> None:
    damage, file, field = KINDS[name]
    damage(small_capture)
    before = contents(small_capture.parent)
    with pytest.raises(InputError) as caught:
        read_masks(read_capture(small_capture))
    message = str(caught.value)
    assert file in message and field in message, message
    assert str(small_capture) in message, message
    assert message.endswith(".") and "; " in message and "\n" not in message, message
    assert contents(small_capture.parent) == before
    assert capfd.readouterr() == ("", "")  # nothing but the sentence
