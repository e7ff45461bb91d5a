"""Strict JSON, and files and folders that are written whole or not at all."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.files import (
    check_format,
    file_hash,
    read_bytes,
    read_json,
    staged_directory,
    synced_together,
    write_bytes,
    write_json,
    write_text,
)
from frametwin.progress import Progress, report

BROKEN = {
    "empty": ("", "file"),
    "cut": ('{"a": [1, 2, ', "cut short"),
    "cut in a text": ('{"a": "bc', "cut short"),
    "not JSON": ("a: 1", "not JSON"),
    "trailing comma": ('{"a": 1,}', "line 1"),
    "two objects": ('{"a": 1} {"b": 2}', "line 1"),
    "a list": ("[1, 2]", "object"),
    "NaN": ('{"a": NaN}', "NaN"),
    "Infinity": ('{"a": [1, -Infinity]}', "Infinity"),
    "beyond a double": ('{"a": 1e999}', "1e999"),
    "beyond a double, negative": ('{"a": [-1.5E+400]}', "-1.5E+400"),
    "key twice": ('{"a": 1, "b": 2, "a": 3}', "a: occurs twice"),
    "endless digits": ('{"a": ' + "9" * 10_000 + "}", "file"),
    "too deep": ('{"a": ' + "[" * 200_000, "file"),
}


@pytest.mark.parametrize(("text", "fragment"), BROKEN.values(), ids=BROKEN.keys())
def test_broken_json_is_refused(tmp_path: Path, text: str, fragment: str) -> None:
    path = tmp_path / "data.json"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_json(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and fragment in message and "\n" not in message


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_json(tmp_path / "missing.json")
    with pytest.raises(InputError, match="cannot be read"):
        read_json(tmp_path)
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="not a text"):
        read_json(tmp_path / "binary.json")


def test_the_hash_of_a_file_is_the_standards(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"abc")  # FIPS 180-2, appendix B.1
    assert file_hash(tmp_path / "a") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    for path, words in ((tmp_path, "cannot be read .*; find it again"), (tmp_path / "missing", "does not exist; ")):
        with pytest.raises(InputError, match=words) as caught:
            read_bytes(path, remedy="find it again")
        assert str(caught.value).startswith(f"{path}: file: ")


def test_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(b'\xef\xbb\xbf{"a": 1}')
    assert read_json(tmp_path / "a.json") == {"a": 1}


def test_floats_come_back_bit_by_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(200, 3)) * 10.0 ** np.arange(-100, 100)[:, None]
    data = {"values": values, "deep": values.reshape(50, 4, 3), "one": np.float64(0.1), "n": np.int64(3)}
    write_json(tmp_path / "a.json", {**data, "empty": [], "none": {}, "mask": np.array([True, False])})
    back = read_json(tmp_path / "a.json")
    assert np.array_equal(back["values"], values)
    assert np.array_equal(back["deep"], values.reshape(50, 4, 3))
    assert back["one"] == 0.1 and back["n"] == 3
    assert back["empty"] == [] and back["none"] == {} and back["mask"] == [True, False]


def test_json_is_readable_by_people(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"rows": [[1, 2], [3, 4]], "name": "Brücke", "nested": {"a": [1]}})
    lines = (tmp_path / "a.json").read_text(encoding="utf-8").splitlines()
    assert "    [1, 2]," in lines and '  "name": "Brücke",' in lines
    assert json.loads("\n".join(lines))["nested"] == {"a": [1]}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), np.array([1.0, np.nan])])
def test_nan_is_never_written(tmp_path: Path, value: object) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    with pytest.raises(ValueError):
        write_json(path, {"value": value})
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.bin"
    write_bytes(path, b"old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(InputError, match="No space left on device"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.bin"]


def test_writing_where_there_is_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / "none" / "a.txt", "text")


def test_staged_folder_appears_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "run"
    with staged_directory(target) as staged:
        (staged / "a").write_text("1")
        assert not target.exists()
    assert (target / "a").read_text() == "1"
    assert os.listdir(target.parent) == ["run"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_staged_folder_vanishes_on_failure(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), staged_directory(tmp_path / "deep" / "run") as staged:
        (staged / "a").write_text("1")
        raise error
    assert os.listdir(tmp_path) == []


def full_disk(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_errors_name_the_folder_that_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full_disk)
        with pytest.raises(InputError) as caught, staged_directory(run) as staged:
            write_json(staged / "twin.json", {})
    full = "cannot be written (No space left on device); free some space, or choose a folder on another disk."
    assert str(caught.value) == f"{run / 'twin.json'}: file: {full}"
    with pytest.raises(InputError) as caught, staged_directory(run):
        full_disk()  # as a stream does, which knows no names
    assert str(caught.value) == f"{run}: folder: {full}"
    with pytest.raises(InputError) as caught, staged_directory(run) as staged:
        (staged / "images" / "a.png").write_bytes(b"")
    assert str(caught.value).startswith(f"{run / 'images' / 'a.png'}: file: cannot be written (")
    with pytest.raises(FileNotFoundError) as other, staged_directory(run):
        (tmp_path / "elsewhere").read_text()  # nothing that was to be written
    assert str(tmp_path / "elsewhere") in str(other.value)
    assert os.listdir(tmp_path) == []


def test_staged_folder_in_place_of_another(tmp_path: Path) -> None:
    target = tmp_path / "run"
    target.mkdir()
    with staged_directory(target) as staged:  # an empty folder is no loss
        (staged / "a").write_text("1")
    with pytest.raises(InputError, match="not empty"), staged_directory(target):
        pytest.fail("nothing is to be done")
    with pytest.raises(RuntimeError), staged_directory(target, overwrite=True):
        raise RuntimeError
    assert os.listdir(target) == ["a"]
    with staged_directory(target, overwrite=True) as staged:
        (staged / "b").write_text("2")
    assert os.listdir(target) == ["b"] and os.listdir(tmp_path) == ["run"]


def test_staged_folder_never_replaces_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a" / "b").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "a" / "b")
    for path in (tmp_path / "a", tmp_path, Path("..")):
        with pytest.raises(InputError, match="working folder"), staged_directory(path, overwrite=True):
            pytest.fail("nothing is to be done")
    with staged_directory("c") as staged:  # a relative name
        (staged / "file").write_text("1")
    assert os.listdir(tmp_path / "a" / "b") == ["c"]


def test_staged_folder_refuses_a_file(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("a file")
    with (
        pytest.raises(InputError, match="name of a file"),
        staged_directory(tmp_path / "run", overwrite=True),
    ):
        pytest.fail("nothing is to be done")
    with pytest.raises(InputError, match="cannot be made"), staged_directory(tmp_path / "run" / "below"):
        pytest.fail("nothing is to be done")
    assert (tmp_path / "run").read_text() == "a file"


@pytest.mark.parametrize(
    ("data", "fragment"),
    [
        ({"version": 1}, "format: is missing"),
        ({"format": "a"}, "version: is missing"),
        ({"format": "b", "version": 1}, "format: is 'b'"),
        ({"format": "a", "version": 2}, "version: 2 is not known"),
        ({"format": "a", "version": True}, "version: True"),
        ({"format": "a", "version": "1"}, "version: '1'"),
    ],
)
def test_format_and_version(data: dict, fragment: str) -> None:
    check_format({"format": "a", "version": 1}, "x.json", "a")
    with pytest.raises(InputError, match=fragment):
        check_format(data, "x.json", "a")


def test_messages_are_one_line() -> None:
    error = InputError.at("a\nb", "field", "is\n  bad", "change it")
    assert str(error) == "a b: field: is bad; change it."


def test_progress_can_stop_the_work() -> None:
    from frametwin.errors import Cancelled

    step = Progress("fitting", 3, 10, loss=0.5)
    report(None, step)
    report(lambda progress: None, step)
    report(lambda progress: True, step)
    with pytest.raises(Cancelled, match="fitting at step 3 of 10"):
        report(lambda progress: False, step)


def test_files_written_together_are_put_on_disk_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is synced once, after the last was written; where the block raises, none is."""
    told: list[str] = []
    real = os.fsync

    def fsync(file: int) -> None:
        told.append(os.readlink(f"/proc/self/fd/{file}") if Path("/proc/self/fd").is_dir() else "a file")
        real(file)

    monkeypatch.setattr(os, "fsync", fsync)
    with synced_together():
        for name in ("a", "b", "a"):
            write_text(tmp_path / name, name)
        write_text(tmp_path / "gone", "")
        (tmp_path / "gone").unlink()
        assert told == []
    assert len(told) == 2 and (tmp_path / "a").read_text() == "a"
    with pytest.raises(ZeroDivisionError), synced_together():
        write_text(tmp_path / "c", "c")
        raise ZeroDivisionError
    assert len(told) == 2
    write_text(tmp_path / "d", "d")
    assert len(told) == 3
    assert not list(tmp_path.glob(".*.part"))


def test_hashes_do_not_make_numbers_suspect(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"hash": "ab5e123456", "list": [1.5e-3, "9E999"]}')
    assert read_json(path) == {"hash": "ab5e123456", "list": [1.5e-3, "9E999"]}
    for text in ('{"a": 1e999}', '{"a":-2.5E+400}', '{"a": [0,1E400]}', '{"a":[\\n1e309]}'.replace("\\n", "\n")):
        path.write_text(text)
        with pytest.raises(InputError, match="too large"):
            read_json(path)
