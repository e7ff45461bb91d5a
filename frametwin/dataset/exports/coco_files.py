"""COCO: pictures, and for each part one file of annotations, ``annotations/train.json``, as pycocotools reads it.

Every strut that is seen in a picture is an annotation: the pixels that show it as a mask (``segmentation``, compressed
run lengths), and its curve as a polyline of nine ``keypoints`` at even parameters, with COCO's own flags of visibility:
2 in plain view, 1 hidden by another strut, 0 (and no place) where it is not there or outside of the picture. The print
as a whole is an annotation too, of a category of its own. Keypoints follow COCO: pixel centres lie at whole numbers.

Reference: T.-Y. Lin et al., Microsoft COCO: Common Objects in Context, ECCV 2014, and its data format.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from frametwin.dataset.camera_errors import with_true_cameras
from frametwin.dataset.croissant import LICENCE
from frametwin.dataset.exports.learning_samples import LearningSample, learning_samples
from frametwin.dataset.exports.libraries import needed
from frametwin.dataset.exports.pictures import put_image
from frametwin.dataset.exports.settings import UNITS, ExportSettings
from frametwin.dataset.folder import Dataset
from frametwin.dataset.strut_map import strut_map
from frametwin.progress import Progress, ProgressCallback, report

KEYPOINTS = 9
STRUT, PRINT = 1, 2
"""Numbers of the categories."""

HIDDEN, VISIBLE = 1, 2


def check_coco() -> None:
    """Refuse where run lengths cannot be encoded."""
    needed("pycocotools.mask", "pycocotools", "the format coco")


def write_coco(
    dataset: Dataset, stage: Path, settings: ExportSettings, progress: ProgressCallback | None = None
) -> dict[str, Any]:
    """Write a dataset as ``images/000000/...`` and ``annotations/PART.json`` into a folder that exists.

    Returns
    -------
    dict
        Numbers of samples by part.
    """
    (stage / "annotations").mkdir()
    (stage / "images").mkdir()
    files: dict[str, _Annotations] = {}
    counts: dict[str, int] = {}
    try:
        for sample in learning_samples(dataset, settings, progress):
            if sample.part not in files:
                files[sample.part] = _Annotations(stage / "annotations" / f"{sample.part}.json", dataset, settings)
            for view in sample.capture.views:
                put_image(view.image, stage / "images" / sample.name, settings.link)
            done = Progress("exporting samples", sum(counts.values()), len(dataset.samples))
            for n in range(len(sample.images)):
                report(progress, done)  # a picture of many struts takes a second
                files[sample.part].add(sample, n)
            counts[sample.part] = counts.get(sample.part, 0) + 1
    finally:
        for file in files.values():
            file.close()
    return {"parts": counts}


class _Annotations:
    """Writes one file piece by piece: annotations of many pictures are larger than memory."""

    def __init__(self, path: Path, dataset: Dataset, settings: ExportSettings) -> None:
        self._images: list[dict[str, Any]] = []
        self._count = 0
        self._file: TextIO = path.open("w", encoding="utf-8", newline="\n")
        licence = str(dataset.recipe.get("licence", LICENCE))
        head = {
            "info": {
                "description": f"{dataset.name}: {dataset.description}",
                "version": "1.0",
                "unit": settings.units,
            },
            "licenses": [{"id": 1, "name": licence, "url": f"https://spdx.org/licenses/{licence}.html"}],
            "categories": _categories(),
        }
        self._file.write(json.dumps(head)[:-1] + ', "annotations": [')

    def add(self, sample: LearningSample, n: int) -> None:
        """Write what is seen in a view of a sample."""
        image = len(self._images) + 1
        self._images.append(_image(sample, n, image))
        for annotation in _annotations(sample, n):
            self._file.write(",\n" if self._count else "\n")
            self._count += 1
            self._file.write(json.dumps({"id": self._count, "image_id": image, **annotation}, allow_nan=False))

    def close(self) -> None:
        """Write the list of pictures behind, and end the file."""
        self._file.write('\n],\n"images": ' + json.dumps(self._images, allow_nan=False) + "}\n")
        self._file.close()


def _categories() -> list[dict[str, Any]]:
    names = [f"{k}/{KEYPOINTS - 1}" for k in range(KEYPOINTS)]
    skeleton = [[k, k + 1] for k in range(1, KEYPOINTS)]
    return [
        {"id": STRUT, "name": "strut", "supercategory": "wireframe", "keypoints": names, "skeleton": skeleton},
        {"id": PRINT, "name": "print", "supercategory": "wireframe"},
    ]


def _image(sample: LearningSample, n: int, number: int) -> dict[str, Any]:
    """A picture, with its camera."""
    camera = sample.capture.views[n].camera
    return {
        "id": number,
        "file_name": f"{sample.name}/{sample.images[n].name}",
        "width": camera.width,
        "height": camera.height,
        "license": 1,
        "sample": sample.facts["index"],
        "scene": sample.facts["scene"],
        "view": camera.name,
        "camera_model": camera.model,
        "K": camera.K.tolist(),
        "distortion": camera.distortion.tolist(),
        "camera_to_world": sample.arrays["camera_to_world"][n].astype(float).tolist(),
    }


def _annotations(sample: LearningSample, n: int) -> Iterator[dict[str, Any]]:
    """The print, and every strut of which a pixel is seen, in one view."""
    covered = sample.share[n] >= 0.5
    runs = run_lengths(np.where(covered, 0, -1))
    if 0 in runs:
        yield {"category_id": PRINT, **_segmentation(runs[0], covered.shape)}
    keypoints = _keypoints(sample, n)
    for strut, counts in run_lengths(np.where(covered, _labels(sample, n), -1)).items():
        flags = keypoints[strut, :, 2]
        yield {
            "category_id": STRUT,
            "strut": strut,
            **_segmentation(counts, covered.shape),
            "keypoints": [int(v) if float(v).is_integer() else v for v in keypoints[strut].ravel().tolist()],
            "num_keypoints": int((flags > 0).sum()),
        }


def _labels(sample: LearningSample, n: int) -> np.ndarray:
    """(H, W) strut of every pixel: from the passes, or painted."""
    if sample.passes:
        return sample.passes["strut"][n]
    arrays, mm = sample.arrays, 1.0 / UNITS[sample.facts["unit"]]  # of the arrays; cameras are in mm
    camera = with_true_cameras(sample.capture).views[n].camera
    return strut_map(mm * arrays["points"], mm * arrays["point_radius"], arrays["point_present"], camera)


def _keypoints(sample: LearningSample, n: int) -> np.ndarray:
    """(E, KEYPOINTS, 3) x, y with whole numbers at pixel centres, and flag."""
    arrays, camera = sample.arrays, sample.capture.views[n].camera
    steps = arrays["pixels"].shape[2] - 1
    chosen = np.rint(np.linspace(0.0, steps, KEYPOINTS)).astype(int)
    pixels, visible = arrays["pixels"][n][:, chosen], arrays["visible"][n][:, chosen]
    ahead, there = arrays["pixel_depth"][n][:, chosen] > 0.0, arrays["point_present"][:, chosen]
    with np.errstate(invalid="ignore"):
        inside = ahead & ((pixels >= 0.0) & (pixels < [camera.width, camera.height])).all(axis=2)
    flag = np.where(visible, VISIBLE, np.where(inside & there, HIDDEN, 0))
    place = np.where(flag[..., None] > 0, np.round(pixels.astype(float) - 0.5, 2), 0.0)
    return np.concatenate([place, flag[..., None]], axis=2)


def run_lengths(labels: np.ndarray) -> dict[int, list[int]]:
    """Run lengths of every label from 0 up in (H, W) labels, column by column: outside, inside, outside and so on."""
    flat = labels.ravel(order="F")
    starts = np.concatenate([[0], np.flatnonzero(flat[1:] != flat[:-1]) + 1])
    ends = np.concatenate([starts[1:], [flat.size]])
    values = flat[starts]
    order = np.argsort(values, kind="stable")
    order = order[values[order] >= 0]
    found, first = np.unique(values[order], return_index=True)
    runs = {}
    for value, begin, end in zip(found.tolist(), first, np.append(first, len(order))[1:], strict=True):
        own = order[begin:end]
        borders = np.stack([starts[own], ends[own]], axis=1).ravel()
        runs[value] = np.diff(borders, prepend=0, append=flat.size).tolist()
    return runs


def _segmentation(counts: list[int], shape: tuple[int, ...]) -> dict[str, Any]:
    """Mask, area and box of run lengths."""
    mask = needed("pycocotools.mask", "pycocotools", "the format coco")
    encoded = mask.frPyObjects({"size": list(shape), "counts": counts}, *shape)
    return {
        "segmentation": {"size": list(shape), "counts": encoded["counts"].decode("ascii")},
        "area": int(sum(counts[1::2])),
        "bbox": [float(side) for side in mask.toBbox(encoded)],
        "iscrowd": 0,
    }
