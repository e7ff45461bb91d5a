"""A card of a dataset for machines: ``croissant.json``, JSON-LD of the Croissant vocabulary, version 1.0.

Reference: Croissant Format Specification, version 1.0, MLCommons, 2024.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from frametwin.dataset.folder import DATASET_FILE, SAMPLES, Dataset, read_dataset
from frametwin.files import PathLike, write_json

FILE_NAME = "croissant.json"

LICENCE = "CC0-1.0"
"""Where the recipe names none."""

# How names are read: the vocabulary that the specification asks for.
CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}

_SETS = (
    ("images", "image/png", "images/*.png", "Pictures of every view: masks (white print on black) or photos."),
    ("backgrounds", "image/png", "background/*.png", "The same views before printing, for photos."),
    ("plans", "application/json", "frame.json", "The plan of every sample: vertices, struts, radius, in mm, z up."),
    ("truths", "application/json", "truth.json", "Where the struts really are, as cubic Bezier curves in mm."),
    ("cameras", "application/json", "transforms.json", "Cameras as nerfstudio writes them, in mm, OpenGL axes."),
    ("curves", "application/x-npz", "curves.npz", "Samples along the true struts, projected into every view."),
    ("passes", "image/x-exr", "passes/*.exr", "Depth in mm, normal and strut index of every view."),
)
"""Name, type, pattern below a sample, and description of the files that samples hold."""


def write_croissant(folder: PathLike) -> Path:
    """Write ``croissant.json`` beside the ``dataset.json`` of a dataset; anew whenever that has changed.

    Returns
    -------
    The file.

    Raises
    ------
    InputError
        If there is no dataset, or the file cannot be written.
    """
    dataset = read_dataset(folder)
    path = dataset.folder / FILE_NAME
    write_json(path, card(dataset))
    return path


def card(dataset: Dataset) -> dict[str, Any]:
    """The content of ``croissant.json``."""
    listing = (dataset.folder / DATASET_FILE).read_bytes()
    licence = dataset.recipe.get("licence", LICENCE)
    there = [entry for entry in _SETS if _occurs(dataset, entry[2])]
    description = dataset.description or "Captures of wireframe prints with exact truth."
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": dataset.name,
        "description": f"{description} {len(dataset.samples)} samples, seed {dataset.seed}. Lengths are in mm.",
        "license": f"https://spdx.org/licenses/{licence}.html",
        "url": "./",
        "version": "1.0.0",
        "keywords": ["3D printing", "wireframe", "digital twin", "multi-view", "synthetic"],
        "distribution": [
            {
                "@type": "cr:FileObject",
                "@id": DATASET_FILE,
                "name": DATASET_FILE,
                "description": "The recipe, and every sample with the hash of its content.",
                "contentUrl": DATASET_FILE,
                "contentSize": f"{len(listing)} B",
                "encodingFormat": "application/json",
                "sha256": hashlib.sha256(listing).hexdigest(),
            },
            *(
                {
                    "@type": "cr:FileSet",
                    "@id": name,
                    "name": name,
                    "description": text,
                    "encodingFormat": kind,
                    "includes": f"{SAMPLES}/*/{pattern}",
                }
                for name, kind, pattern, text in there
            ),
        ],
        "recordSet": [_samples()],
    }


def _occurs(dataset: Dataset, pattern: str) -> bool:
    return any(next(entry.folder.glob(pattern), None) is not None for entry in dataset.samples)


def _samples() -> dict[str, Any]:
    """The records: one a sample."""
    fields = (
        ("index", "sc:Integer", "Number of the sample; with the seed, all that it depends on."),
        ("folder", "sc:Text", "Its folder, a capture, relative to the dataset."),
        ("content", "sc:Text", "SHA-256 of what is in it, hexadecimal."),
    )
    return {
        "@type": "cr:RecordSet",
        "@id": "samples",
        "name": "samples",
        "description": "Every sample of the dataset.",
        "key": {"@id": "samples/index"},
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"samples/{name}",
                "name": name,
                "description": text,
                "dataType": kind,
                "source": {
                    "fileObject": {"@id": DATASET_FILE},
                    "extract": {"jsonPath": f"$.samples[*].{name}"},
                },
            }
            for name, kind, text in fields
        ],
    }
