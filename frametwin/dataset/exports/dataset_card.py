"""The card of a dataset for Hugging Face: ``README.md`` with a head that says which files are which part."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from frametwin.dataset.croissant import LICENCE
from frametwin.dataset.exports.settings import ExportSettings
from frametwin.dataset.folder import Dataset
from frametwin.dataset.tensor_kinds import KINDS

CARD_FILE = "README.md"

_OTHERS = {
    "index": ("", "int64", "", "number of the sample in its dataset"),
    "scene": ("", "int64", "", "number of the print; samples with the same one show one print to other cameras"),
    "frame": ("", "string", "", "name of the plan"),
    "content": ("", "string", "", "SHA-256 of the sample"),
    "unit": ("", "string", "", "of lengths"),
    "views": ("N", "string", "", "names of the cameras"),
    "images": ("N", "Image", "0 to 255", "pictures of the print"),
    "masks": ("N", "Image", "0 to 255", "true share of each pixel that the print covers, of 255"),
    "backgrounds": ("N", "Image", "0 to 255", "the same views before printing"),
    "depth": ("N", "Image", "mm", "32-bit TIFF, along the optical axis; infinite where nothing is"),
    "strut": ("N", "Image", "strut", "16-bit PNG, one more than the strut; 0 where nothing is"),
}
"""Shape, type, unit and meaning of the columns that are no arrays."""

_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


def card_text(dataset: Dataset, settings: ExportSettings, counts: Mapping[str, int], columns: Sequence[str]) -> str:
    """The text of ``README.md``.

    Parameters
    ----------
    dataset, settings
        What is exported, and how.
    counts
        Number of samples by part.
    columns
        Of the Parquet files.
    """
    count = sum(counts.values())
    size = next((name for limit, name in _SIZES if count < limit), "n>1M")
    head = [
        "---",
        f"license: {json.dumps(str(dataset.recipe.get('licence', LICENCE)).lower())}",
        f"pretty_name: {json.dumps(dataset.name)}",
        f"size_categories: [{json.dumps(size)}]",
        'tags: ["3d", "wireframe", "3d-printing", "multi-view", "synthetic"]',
        "configs:",
        "- config_name: default",
        "  data_files:",
        *(f"  - {{split: {part}, path: {json.dumps(f'data/{part}-*.parquet')}}}" for part in counts),
        "---",
    ]
    rows = [f"| `{name}` | {' | '.join(_column(name, settings))} |" for name in columns]
    parts = ", ".join(f"{number} for {part}" for part, number in counts.items())
    body = f"""
# {dataset.name}

{dataset.description or "Captures of wireframe prints with exact truth."}
{count} samples ({parts}), seed {dataset.seed}. A row is a sample: N views of one print, with its plan and the truth.
Made with FrameTwin.

```python
from datasets import load_dataset

samples = load_dataset("FOLDER", split="train").with_format("numpy")
```

Axes: N views, E struts, V joints, S samples along a strut. Poses have OpenCV's axes, pixel centres lie at +0.5, z is
up.

| column | shape | type | unit | what it is |
| --- | --- | --- | --- | --- |
"""
    return "\n".join(head) + "\n" + body + "\n".join(rows) + "\n"


def _column(name: str, settings: ExportSettings) -> tuple[str, str, str, str]:
    if name in _OTHERS:
        shape, kind, unit, what = _OTHERS[name]
        return (f"({shape})" if shape else "", kind, settings.units if unit == "mm" else unit, what)
    kinds = KINDS[name]
    unit = settings.units if kinds.unit == "mm" else kinds.unit
    return f"({', '.join(str(axis) for axis in kinds.shape)})", kinds.dtype, unit, kinds.what
