"""Answering capture folders as they appear."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from frametwin.capture.views import has_cameras, model_pictures
from frametwin.errors import Held, InputError
from frametwin.files import PathLike, file_hash, read_json
from frametwin.printing.job.answer import AnswerOptions
from frametwin.printing.job.job import JobBusy, JobUnwritable, PrintJob
from frametwin.printing.job.raw_pictures import NOTE, RawPictures
from frametwin.printing.job.whole_endings import ends_whole
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.scratch import scratch_folder
from frametwin.wording import name_order

POLL = 0.1
"""Seconds between two looks. A folder counts as complete when nothing in it has changed for `AGAIN` seconds and all its
files end as whole ones do, or for `SETTLE` seconds."""

AGAIN = 0.2
"""Seconds for which nothing may change in a folder of whole files: others, such as a background, may still come."""

SETTLE = 0.5
"""The same for files whose end does not tell."""

Signature = tuple[tuple[str, int, int], ...]


@dataclass(eq=False)
class Watch:
    """A look-out for captures of a job: every new folder of a folder, in the order of the names.

    Attributes
    ----------
    job
        The job.
    captures
        The folder in which capture folders appear.
    options
        Of every answer.
    say
        Told in words what is waited for, whenever that changes, and what was answered or refused.
    progress
        See `ProgressCallback`; called at every look, and able to stop the watch.
    poll
        Seconds between looks.
    again, settle
        Seconds for which nothing may change in a folder of whole files, and in one with files whose end does not tell.
    answered
        Told of each batch that was answered, by its report.
    raw
        Where folders hold raw pictures of a rig and are no captures yet.
    """

    job: PrintJob
    captures: Path
    options: AnswerOptions = field(default_factory=AnswerOptions)
    say: Callable[[str], None] = lambda sentence: None
    progress: ProgressCallback | None = None
    poll: float = POLL
    again: float = AGAIN
    settle: float = SETTLE
    answered: Callable[[dict[str, Any]], None] = lambda report: None
    raw: RawPictures | None = None

    def __post_init__(self) -> None:
        self._done: set[str] = set()  # folders that were answered, in this run or an earlier one
        self._refused: dict[str, tuple[int, Signature]] = {}  # for which batch, and as they were then
        self._seen: dict[str, tuple[Signature, float]] = {}  # and since when they are like that
        self._prepared: Signature = ()  # of the folder whose pictures were read before their turn
        self._said = ""

    def run(self) -> list[dict[str, Any]]:
        """Answer until the job is finished.

        A folder that cannot be used, or for which the job is held, is told of and passed over until something in it
        changes or its turn comes with another batch; nothing is printed on meanwhile.

        Returns
        -------
        Reports of the batches that were answered.

        Raises
        ------
        InputError
            If the folder of captures does not exist, or is itself a capture.
        Cancelled
            If ``progress`` returns ``False``.
        """
        check_captures_folder(self.captures)
        self.job.recover()
        reports = []
        self.job.prepare()
        while (batch := self.job.current) is not None:
            total = self.job.sequence.batch_count
            report(self.progress, Progress("waiting for pictures", batch, total))
            found, why, soon = self._next_capture(batch)
            if found is None:
                place = f"in {self.captures}" if not why else f"({why})"
                self._tell(f"Waiting for the pictures of batch {batch} of {total} {place}.")
                self._wait_for(soon)
                continue
            answer = self._answer(found, batch)
            if answer is not None:
                reports.append(answer)
                self.answered(answer)
                self.job.prepare()
        self._tell("The print is finished: all batches have been answered.")
        return reports

    def _wait_for(self, folder: Path | None) -> None:
        """Wait for the next look; meanwhile read the pictures of a folder that is whole, and may be taken then."""
        until = time.monotonic() + (self.poll if folder is None else min(self.poll, self.again))
        if folder is not None and self.raw is None and self._prepared != self._seen[folder.name][0]:
            self._prepared = self._seen[folder.name][0]
            self.job.prepare(folder)
        time.sleep(max(0.0, until - time.monotonic()))

    def _answer(self, folder: Path, batch: int) -> dict[str, Any] | None:
        signature, _ = self._seen[folder.name]
        try:
            answer = self._answer_with(folder, batch)
        except (JobBusy, JobUnwritable) as error:  # it is not for the pictures, which are tried again
            self._tell(str(error))
            time.sleep(self.poll)
            return None
        except (InputError, Held) as error:
            self._refused[folder.name] = (batch, signature)
            self._tell(f"{error} Not printing on.")
            return None
        self._done.add(folder.name)
        self._tell(f"{folder.name} answers batch {answer['batch']}.")
        return answer

    def _answer_with(self, folder: Path, batch: int) -> dict[str, Any]:
        if self.raw is None:
            return self.job.answer(folder, self.options, self.progress)
        with scratch_folder() as scratch:
            capture = scratch / folder.name
            self.raw.write_capture(folder, self.job.expectation(batch).frame, capture)
            notes = {**self.options.notes, NOTE: self.raw.note(folder)}
            return self.job.answer(capture, replace(self.options, notes=notes), self.progress)

    def _next_capture(self, batch: int) -> tuple[Path | None, str, Path | None]:
        """The first folder that is complete and new, or why the first new one is not, and what may be soon."""
        why, soon = "", None
        folders = (path for path in self.captures.iterdir() if path.is_dir())
        for folder in sorted(folders, key=lambda path: name_order(path.name)):
            name = folder.name
            if name.startswith(".") or name in self._done:
                continue
            missing, signature = _look(folder, self.raw)
            settled, whole = self._settled(folder, signature)
            if missing:
                why = why or f"{name} still lacks {missing}"
            elif self._refused.get(name) == (batch, signature):
                continue
            elif not settled:
                why, soon = why or f"{name} is still growing", soon or (folder if whole else None)
            elif self._answered_before(folder):
                self._done.add(name)
            else:
                return folder, "", None
        return None, why, soon

    def _settled(self, folder: Path, signature: Signature) -> tuple[bool, bool]:
        """Whether a folder as it is now has stopped growing, and whether all its files end as whole ones do."""
        now = time.monotonic()
        before, since = self._seen.get(folder.name, ((), now))
        if before != signature:
            self._seen[folder.name] = (signature, now)
        whole = _all_whole(folder, signature)
        return before == signature and now - since >= (min(self.again, self.settle) if whole else self.settle), whole

    def _answered_before(self, folder: Path) -> bool:
        """Whether an earlier run has answered these very pictures."""
        try:
            wanted = _pictures(folder) if self.raw is None else self.raw.pictures(folder)
            digests = {file_hash(path) for path in wanted}
        except (InputError, OSError):
            return False
        return any(digests == self._answered_with(batch) for batch in range(self.job.answered))

    def _answered_with(self, batch: int) -> set[str]:
        """Hashes of the pictures that a batch was answered with, raw ones where they were."""
        note = self.job.batch_folder(batch) / NOTE
        told = read_json(note) if self.raw is not None and note.is_file() else self.job.report(batch)
        return set(told["pictures"].values())

    def _tell(self, sentence: str) -> None:
        if sentence != self._said:
            self._said = sentence
            self.say(sentence)


def check_captures_folder(path: PathLike) -> None:
    """Refuse a folder in which no captures can appear.

    Raises
    ------
    InputError
        If it does not exist, or is a capture itself.
    """
    folder = Path(path)
    if not folder.is_dir():
        raise InputError.at(folder, "folder", "does not exist", "make the folder into which captures are put")
    if has_cameras(folder):
        raise InputError.at(folder, "folder", "is itself a capture", "give the folder above it")


def _look(folder: Path, raw: RawPictures | None = None) -> tuple[str, Signature]:
    """What a folder still lacks, empty for nothing, and the names, sizes and times of its files."""
    try:
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        stats = [(path.relative_to(folder).as_posix(), path.stat()) for path in files]
        signature = tuple((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats)
        if raw is not None:
            return raw.lacking(folder), signature
        if not has_cameras(folder):
            return "transforms.json", signature
        wanted = _pictures(folder)
        if (folder / "background").is_dir():
            wanted += [folder / "background" / _below_images(path.relative_to(folder)) for path in wanted]
        lacking = [path for path in wanted if not path.is_file() or path.stat().st_size == 0]
    except OSError:  # files come and go
        return "files that stay", ()
    except InputError:
        own = (folder / "transforms.json").is_file()
        return f"a whole {'transforms.json' if own else 'COLMAP model'}", signature
    return (lacking[0].relative_to(folder).as_posix() if lacking else ""), signature


def _all_whole(folder: Path, signature: Signature) -> bool:
    try:
        return all(ends_whole(folder / name) for name, _, _ in signature)
    except OSError:  # files come and go
        return False


def _pictures(folder: Path) -> list[Path]:
    """The pictures that the cameras' file names.

    Raises
    ------
    InputError
        If the file is not whole.
    """
    if not (folder / "transforms.json").is_file():
        return model_pictures(folder)
    frames = read_json(folder / "transforms.json").get("frames")
    names = [frame.get("file_path") for frame in frames if isinstance(frame, dict)] if isinstance(frames, list) else []
    return [folder / name for name in names if isinstance(name, str) and "\0" not in name]


def _below_images(path: Path) -> Path:
    """The name of a picture below the folder of pictures."""
    return Path(*(path.parts[1:] or path.parts))
