"""Folders of datasets and samples: ``dataset.json``, ``sample.json``, and whether all files are as noted there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from frametwin.checked_json import Fields
from frametwin.dataset.hashes import REMEDY, FileHash, hash_file, sample_content
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, file_hash, read_json, write_json

DATASET_FORMAT, SAMPLE_FORMAT = "frametwin-dataset", "frametwin-sample"
VERSION = 1
DATASET_FILE, SAMPLE_FILE = "dataset.json", "sample.json"
SAMPLES, RUNS = "samples", "runs"
_ANEW = "generate the dataset again"


@dataclass(frozen=True)
class Sample:
    """What ``sample.json`` says.

    Attributes
    ----------
    folder : of the sample, a capture.
    index : number of the sample in its dataset.
    specification : what it was asked to be.
    content : hash of the whole sample; see `frametwin.dataset.hashes.sample_content`.
    files : every file but ``sample.json`` itself, by name with forward slashes.
    made_with : programs and versions; not hashed.
    """

    folder: Path
    index: int
    specification: Mapping[str, Any]
    content: str
    files: Mapping[str, FileHash]
    made_with: Mapping[str, Any]


@dataclass(frozen=True)
class SampleEntry:
    """A sample as it is listed in ``dataset.json``; ``folder`` lies below the dataset's."""

    index: int
    folder: Path
    content: str


@dataclass(frozen=True)
class FailedSample:
    """A sample that could not be made, and why."""

    index: int
    reason: str


@dataclass(frozen=True)
class Dataset:
    """What ``dataset.json`` says.

    Attributes
    ----------
    folder : of the dataset.
    name, description : for people.
    recipe : from which it was made, as JSON.
    seed, count : of the dataset: samples 0 to count - 1 belong to it.
    samples, failed : what became of them, by rising index.
    """

    folder: Path
    name: str
    description: str
    recipe: Mapping[str, Any]
    seed: int
    count: int
    samples: tuple[SampleEntry, ...]
    failed: tuple[FailedSample, ...]

    @property
    def absent(self) -> list[int]:
        """Indices that are neither there nor noted as failed, such as those of other shards."""
        known = {entry.index for entry in self.samples} | {entry.index for entry in self.failed}
        return [index for index in range(self.count) if index not in known]

    def run_folder(self, index: int) -> Path:
        """Where the fit of a sample is written."""
        return self.folder / RUNS / sample_name(index)


def sample_name(index: int) -> str:
    """The name of a sample's folder, and of its run's."""
    return f"{index:06d}"


def sample_folder(out: PathLike, index: int) -> Path:
    """The folder of a sample below that of its dataset."""
    return Path(out) / SAMPLES / sample_name(index)


def read_dataset(folder: PathLike) -> Dataset:
    """Read ``dataset.json`` (the samples themselves are not opened).

    Raises
    ------
    InputError
        If there is none, it is damaged, or it is of another format or version.
    """
    root = Path(folder)
    path = root / DATASET_FILE
    if not path.is_file():
        remedy = "give the folder that 'frametwin dataset generate' has written"
        raise InputError.at(root, "folder", f"is no dataset (there is no {DATASET_FILE})", remedy)
    data = read_json(path)
    check_format(data, path, DATASET_FORMAT, VERSION)
    fields = Fields(data, path, _ANEW)
    samples = [_entry(root, item) for item in fields.objects("samples")]
    failed = [FailedSample(item.whole("index"), item.text("reason")) for item in fields.objects("failed")]
    _check_distinct([entry.index for entry in samples] + [entry.index for entry in failed], path)
    return Dataset(
        folder=root,
        name=fields.text("name"),
        description=fields.text("description"),
        recipe=fields.object("recipe"),
        seed=fields.whole("seed"),
        count=fields.whole("count"),
        samples=tuple(sorted(samples, key=lambda entry: entry.index)),
        failed=tuple(sorted(failed, key=lambda entry: entry.index)),
    )


def write_dataset_json(
    out: PathLike,
    *,
    name: str,
    description: str,
    recipe: Mapping[str, Any],
    seed: int,
    count: int,
    failed: Mapping[int, str] | None = None,
) -> Path:
    """Write ``dataset.json``, whole or not at all: the samples that lie below ``out`` now, by rising index.

    Parameters
    ----------
    out
        The folder of the dataset, which exists.
    name, description, recipe, seed, count
        See `Dataset`.
    failed
        Reasons by index; those of samples that are there after all are left out.

    Returns
    -------
    The file.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    path = Path(out) / DATASET_FILE
    entries = [
        {"index": sample.index, "folder": f"{SAMPLES}/{sample_name(sample.index)}", "content": sample.content}
        for sample in _samples_below(Path(out))
    ]
    there = {entry["index"] for entry in entries}
    reasons = [(index, reason) for index, reason in sorted((failed or {}).items()) if index not in there]
    write_json(
        path,
        {
            "format": DATASET_FORMAT,
            "version": VERSION,
            "name": name,
            "description": description,
            "recipe": dict(recipe),
            "seed": seed,
            "count": count,
            "samples": entries,
            "failed": [{"index": index, "reason": reason} for index, reason in reasons],
        },
    )
    return path


def _samples_below(out: Path) -> list[Sample]:
    """Every finished sample below a dataset's folder, by rising index; damaged ones are left out."""
    found = []
    for index in sample_indices(out):
        try:
            sample = read_sample(sample_folder(out, index))
        except InputError:
            continue
        if sample.index == index:
            found.append(sample)
    return found


def sample_indices(out: PathLike) -> list[int]:
    """Rising indices of the folders in ``samples/`` that are named like samples."""
    folder = Path(out) / SAMPLES
    names = [path.name for path in folder.iterdir() if path.is_dir()] if folder.is_dir() else []
    return sorted(int(name) for name in names if name.isascii() and name.isdigit() and sample_name(int(name)) == name)


def read_sample(folder: PathLike) -> Sample:
    """Read ``sample.json`` of a sample's folder (the files that it lists are not opened).

    Raises
    ------
    InputError
        If there is none, it is damaged, or it is of another format or version.
    """
    root = Path(folder)
    path = root / SAMPLE_FILE
    data = read_json(path)
    check_format(data, path, SAMPLE_FORMAT, VERSION)
    fields = Fields(data, path, _ANEW)
    files = fields.object("files")
    return Sample(
        folder=root,
        index=fields.whole("index"),
        specification=fields.object("specification"),
        content=fields.digest("content"),
        files={_file_name(name, path): _file_hash(entry, path, name) for name, entry in files.items()},
        made_with=fields.object("made_with"),
    )


def write_sample_json(
    folder: PathLike, index: int, specification: Mapping[str, Any], made_with: Mapping[str, Any]
) -> str:
    """Hash everything in the folder of a sample and note it in its ``sample.json``, which is written last.

    Returns
    -------
    The hash of the sample's content.

    Raises
    ------
    InputError
        If a file cannot be read, decoded or written.
    """
    root = Path(folder)
    files = hash_sample(root)
    content = sample_content(files, specification)
    write_json(
        root / SAMPLE_FILE,
        {
            "format": SAMPLE_FORMAT,
            "version": VERSION,
            "index": index,
            "content": content,
            "specification": dict(specification),
            "files": {name: asdict(entry) for name, entry in files.items()},
            "made_with": dict(made_with),
        },
    )
    return content


def files_below(folder: PathLike) -> list[str]:
    """Names of all files of a sample but ``sample.json``, sorted, with forward slashes."""
    root = Path(folder)
    found = (path.relative_to(root).as_posix() for path in root.rglob("*") if not path.is_dir() or path.is_symlink())
    return sorted(name for name in found if name != SAMPLE_FILE)


def hash_sample(folder: PathLike) -> dict[str, FileHash]:
    """Size and hashes of every file of a sample but ``sample.json``, by name.

    Raises
    ------
    InputError
        If a file cannot be read or decoded.
    """
    return {name: hash_file(Path(folder) / name) for name in files_below(folder)}


def check_sample(folder: PathLike) -> list[str]:
    """Whether a sample is as its ``sample.json`` says, by sizes and hashes of bytes alone: nothing is decoded.

    Returns
    -------
    What is wrong, in words; nothing if all is well.
    """
    root = Path(folder)
    try:
        sample = read_sample(root)
    except InputError as error:
        return [str(error)]
    there = set(files_below(root))
    problems = [f"{name} is missing" for name in sorted(sample.files.keys() - there)]
    problems += [f"{name} is there, but not listed in {SAMPLE_FILE}" for name in sorted(there - sample.files.keys())]
    for name in sorted(sample.files.keys() & there):
        problems += _bytes_problems(root, name, sample.files[name])
    if sample_content(sample.files, sample.specification) != sample.content:
        problems.append(f"{SAMPLE_FILE}: the hash of the sample is not that of its files and specification")
    return problems


def _bytes_problems(root: Path, name: str, noted: FileHash) -> list[str]:
    try:
        size = (root / name).stat().st_size
        if size != noted.bytes:
            return [f"{name} has {size} bytes where {SAMPLE_FILE} says {noted.bytes}"]
        if file_hash(root / name, REMEDY) != noted.sha256:
            return [f"{name} has changed since the sample was made (another SHA-256)"]
    except (OSError, InputError) as error:
        return [f"{name} cannot be read ({error})"]
    return []


def _check_distinct(indices: Sequence[int], path: Path) -> None:
    if len(set(indices)) < len(indices):
        double = next(index for index in indices if indices.count(index) > 1)
        raise InputError.at(path, "samples", f"hold index {double} twice", _ANEW)


def _entry(root: Path, item: Fields) -> SampleEntry:
    index, name = item.whole("index"), item.text("folder")
    parts = PurePosixPath(name).parts
    if len(parts) != 2 or parts[0] != SAMPLES or ".." in parts or "\\" in name or ":" in name:
        remedy = f"write {SAMPLES}/{sample_name(index)}"
        raise InputError.at(item.source, f"{item.prefix}folder", f"is {name!r}", remedy)
    return SampleEntry(index, root / name, item.digest("content"))


def _file_name(name: str, path: Path) -> str:
    pure = PurePosixPath(name)
    if pure.is_absolute() or ".." in pure.parts or "\\" in name or ":" in name or pure.as_posix() != name:
        raise InputError.at(path, "files", f"{name!r} is not a file of the sample", REMEDY)
    return name


def _file_hash(entry: Any, path: Path, name: str) -> FileHash:
    if not isinstance(entry, dict):
        raise InputError.at(path, f"files[{name!r}]", "is not an object", REMEDY)
    fields = Fields(entry, path, _ANEW, f"files[{name!r}].")
    return FileHash(bytes=fields.whole("bytes"), sha256=fields.digest("sha256"), content=fields.digest("content"))
