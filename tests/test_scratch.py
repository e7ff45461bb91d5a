"""Scratch folders: gone when they are left, swept when their owners were killed, and never before."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from frametwin.scratch import hold_scratch, remove_scratch, scratch_environment, scratch_folder

OWNER = """
import sys
from frametwin.scratch import hold_scratch, make_scratch
folder = make_scratch() if len(sys.argv) == 1 else sys.argv[1]
assert hold_scratch(folder) or len(sys.argv) == 1
print(folder, flush=True)
sys.stdin.read()
"""


class Owner:
    """Another process that has a scratch folder, its own or one that is there, until it is killed."""

    def __init__(self, temporary: Path, folder: Path | None = None) -> None:
        command = [sys.executable, "-c", OWNER, *([] if folder is None else [str(folder)])]
        environment = {**os.environ, **scratch_environment(temporary)}
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True
        )
        assert self.process.stdout is not None
        self.folder = Path(self.process.stdout.readline().strip())

    def kill(self) -> None:
        self.process.send_signal(getattr(signal, "SIGKILL", signal.SIGTERM))
        self.process.communicate()


@pytest.fixture
def owners(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Owner]]:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    started: list[Owner] = []
    yield started
    for owner in started:
        owner.kill()


def test_a_folder_is_empty_and_gone_in_the_end(owners: list[Owner], tmp_path: Path) -> None:
    with scratch_folder() as folder, scratch_folder() as other:
        assert folder.parent == tmp_path and folder != other
        assert [path for path in folder.iterdir() if not path.name.startswith(".")] == []
        (folder / "deep").mkdir()
        (folder / "deep" / "file").write_text("x")
    with pytest.raises(KeyError), scratch_folder():
        raise KeyError("of the block")
    assert list(tmp_path.iterdir()) == []


def test_the_folder_of_a_killed_process_is_swept_by_the_next(owners: list[Owner], tmp_path: Path) -> None:
    killed, alive = Owner(tmp_path), Owner(tmp_path)
    owners += [killed, alive]
    (killed.folder / "picture.png").write_bytes(b"x" * 1000)
    with scratch_folder() as mine:
        assert sorted(tmp_path.iterdir()) == sorted([killed.folder, alive.folder, mine])
    killed.kill()
    assert killed.folder.is_dir()  # nobody had the time to tidy up
    with scratch_folder() as mine:
        assert sorted(tmp_path.iterdir()) == sorted([alive.folder, mine])
        third = Owner(tmp_path)  # another process leaves ours alone as well
        owners.append(third)
        assert mine.is_dir() and alive.folder.is_dir()
    alive.kill()
    third.kill()
    with scratch_folder():
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_folder_of_two_processes_stays_as_long_as_one_of_them(owners: list[Owner], tmp_path: Path) -> None:
    first = Owner(tmp_path)
    second = Owner(tmp_path, first.folder)
    owners += [first, second]
    first.kill()
    with scratch_folder():
        assert second.folder == first.folder and first.folder.is_dir()
    second.kill()
    with scratch_folder():
        assert not first.folder.exists()


def test_what_is_not_ours_is_left_alone(owners: list[Owner], tmp_path: Path) -> None:
    kept = [tmp_path / "frametwin-unmarked", tmp_path / "another", tmp_path / "frametwin-linked"]
    kept[0].mkdir()
    kept[1].mkdir()
    (kept[1] / ".owner-gone").touch()
    if os.name == "nt":  # where links need a privilege
        kept[2].mkdir()
    else:
        kept[2].symlink_to(kept[1], target_is_directory=True)
    (tmp_path / "frametwin-file").touch()
    with scratch_folder():
        assert all(path.is_dir() for path in kept) and (tmp_path / "frametwin-file").is_file()
    assert (kept[1] / ".owner-gone").is_file()
    remove_scratch(kept[1])
    remove_scratch(None)
    assert kept[1].is_dir()
    assert hold_scratch(tmp_path / "frametwin-nowhere") is False and not (tmp_path / "frametwin-nowhere").exists()
