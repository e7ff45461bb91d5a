"""The sections of the page: a sentence or two, and a table of results beside the paper's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from scripts.evidence import paper
from scripts.evidence.cases import PAPER_FRAMES
from scripts.evidence.records import Record, best


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def pair(values: tuple[float, float] | None) -> str:
    """Mean and largest error, as everywhere in the documentation."""
    return "" if values is None else f"{values[0]:.3f} / {values[1]:.2f}"


def errors(record: Record | None, group: str = "curves") -> str:
    """Mean and largest error of a result; a star where its settings were reduced."""
    if record is None:
        return ""
    after = record["result"]["after"][group]
    return pair((after["mean"], after["max"])) + ("*" if reduced(record) else "")


def reduced(record: Record) -> bool:
    """Whether settings were reduced: of `fast` none ever are."""
    return bool(record["conditions"]["quick"] and record["conditions"]["changes"])


def table1(records: Sequence[Record]) -> str:
    """Table I: errors; table II: seconds and memory."""
    found = best(records, "table1")
    rows, costs = [], []
    for frame in PAPER_FRAMES:
        ours = {preset: found.get(f"{frame}-{preset}") for preset in ("paper", "fast")}
        some = ours["fast"] or ours["paper"]
        if some is None:
            continue
        struts = str(some["result"]["struts"])
        joints = [errors(ours[preset], "joints") for preset in ours]
        rows.append([frame, struts, errors(ours["paper"]), errors(ours["fast"]), pair(paper.ERRORS[frame]), *joints])
        costs.append([frame, struts, *_costs(ours["paper"]), *_costs(ours["fast"])])
        costs[-1] += [f"{paper.SECONDS[frame]:.0f}", f"{paper.MEGABYTES[frame]:.0f}"]
    columns = ["frame", "struts", "`paper`", "`fast`", "the paper", "joints, `paper`", "joints, `fast`"]
    mine = [f"`{preset}`, {what}" for preset in ("paper", "fast") for what in ("s", "processor s", "MB")]
    sizes = ["frame", "struts", *mine, "the paper, s", "MB of its GPU"]
    return (
        "## Accuracy (table I)\n\nDistance between the curves of twin and truth in mm, mean / largest, and between"
        " their joints.\n\n" + table(columns, rows) + "\n## Time and memory (table II)\n\nSeconds of the fit;"
        " processor seconds and largest memory of its whole process, which also simulates the pictures. Where the"
        " machine did other work besides, seconds are longer than on a quiet one, processor seconds hardly. The paper's"
        " on an RTX 4090.\n\n" + table(sizes, costs)
    )


def rivals(records: Sequence[Record]) -> str:
    """Table I: the methods that the paper compares with."""
    found, ours = best(records, "rivals"), best(records, "table1")
    rows = []
    for frame in PAPER_FRAMES:
        curve, deformation = (found.get(f"{frame}-{preset}") for preset in paper.RIVAL_ERRORS)
        if curve is None and deformation is None:
            continue
        reported = [pair(errors_by_frame[frame]) for errors_by_frame in paper.RIVAL_ERRORS.values()]
        rows.append([frame, errors(ours.get(f"{frame}-paper")), errors(curve), reported[0]])
        rows[-1] += [errors(deformation), _kernels(deformation), reported[1]]
    columns = ["frame", "`paper`", "`curve-driven`", "the paper's", "`deformation-driven`, cubics", "its kernels",
               "the paper's"]  # fmt: skip
    return (
        "## The methods that the paper compares with (table I)\n\nErrors of curves in mm, mean / largest.\n"
        "`curve-driven` is Curve-Gaussian (Gao et al., ICCV 2025) and `deformation-driven` SC-GS (Huang et al., CVPR"
        " 2024), both by the figures of their papers and published codes, written anew, and from the same struts at the"
        " start. SC-GS knows no curves: the cubics are those nearest to the kernels of each strut, and of its kernels"
        " (those of an opacity above 0.05) the distances to the true curves are given. What changes the number of"
        " curves or kernels is left out; the paper says so of the one and nothing of the other.\n\n"
        + table(columns, rows)
    )


def _kernels(record: Record | None) -> str:
    if record is None:
        return ""
    found = record["result"]["kernels"]
    return pair((found["mean"], found["max"])) + ("*" if reduced(record) else "")


def partial(records: Sequence[Record]) -> str:
    """Table II: partial prints."""
    found = best(records, "partial")
    rows = []
    for frame, share in sorted({tuple(name.split("-")[:2]) for name in found}, key=lambda key: (key[0], float(key[1]))):
        ours = {preset: found.get(f"{frame}-{share}-{preset}") for preset in ("paper", "fast")}
        result = next(record for record in ours.values() if record is not None)["result"]
        reported = " to ".join(f"{seconds:.0f}" for seconds in paper.PARTIAL_SECONDS[frame])
        rows.append([frame, f"{result['printed']} of {result['struts']}"])
        for record in ours.values():
            rows[-1] += [errors(record), *_costs(record)[:2]]
        rows[-1].append(reported)
    mine = [f"`{preset}`, {what}" for preset in ("paper", "fast") for what in ("mm", "s", "processor s")]
    return (
        "## Partial prints (table II)\n\nPictures of 4000x3000, as the paper's cameras take them; its frames of these"
        " names are others, of about as many struts: the bunny head is cut off a whole bunny"
        " (`bunny_full_tri_dense`) and held there; like the paper's it has 154 struts.\n\n"
        + table(["frame", "printed", *mine, "the paper, s"], rows)
    )


_COSTS = {"seconds": 1, "processor_seconds": 0, "megabytes": 0}
"""What a fit has used, and with how many digits that is told."""


def _costs(record: Record | None) -> list[str]:
    if record is None:
        return ["", "", ""]
    star, result = "*" if reduced(record) else "", record["result"]
    return [f"{result[key]:.{digits}f}{star}" for key, digits in _COSTS.items()]


def views(records: Sequence[Record]) -> str:
    """Errors by number of views."""
    found = best(records, "views")
    counts = sorted({int(name.partition("-")[0]) for name in found})
    rows = [[str(n), *(errors(found.get(f"{n}-{preset}")) for preset in ("paper", "fast"))] for n in counts]
    return (
        "## Number of views\n\nThe paper finds larger errors below eight views and little to gain beyond; it gives"
        f" pictures without figures. Here {_frames(found)}, mm.\n\n" + table(["views", "`paper`", "`fast`"], rows)
    )


def power(records: Sequence[Record]) -> str:
    """Errors by the power of the distance in the bending term's weight."""
    found = best(records, "power")
    rows = [[_power(name), errors(found[name]), f"{_fall(found[name]):.3f}"] for name in sorted(found, key=float)]
    return (
        "## Weight of the bending term by distance\n\nThe weight is the distance to the print to the power p. The paper"
        " finds that larger powers help, little beyond 2. Here " + _frames(found) + ", preset `paper`; without end"
        " means that the term is gone, as distances are below one unit, half the longest side.\n\n"
        + table(["p", "curves mean / largest, mm", "last loss / first"], rows)
    )


def bending(records: Sequence[Record]) -> str:
    """What the bending term does to struts that are not printed."""
    found = best(records, "bending")
    rows = []
    for name in sorted(found, key=float):
        rough = found[name]["result"]["unprinted"]
        label = "none" if float(name) == 0.0 else name.replace("e-0", "e-")
        cells = [f"{100.0 * rough['stretch']:.2f} %", f"{rough['laplacian']:.0f}"]
        rows.append([label, errors(found[name]), *cells])
    columns = ["weight", "printed struts, mean / largest, mm", "uneven stretch of the others", "their Laplacian, 1/m"]
    return (
        "## Bending term\n\nThe paper sees gaps between what is printed and what is to come without the term, or with a"
        f" small weight; it takes 1e-7. Here {_frames(found)}, half printed, preset `paper`: the errors of what is"
        " printed, and how unevenly the field moves the rest (root mean square of the change of length of sixteenths of"
        " the struts, and of the field's Laplacian there).\n\n" + table(columns, rows)
    )


def opacity(records: Sequence[Record]) -> str:
    """Missing struts, with opacity learnt and not."""
    found = best(records, "opacity")
    labels = {"learnt": "`paper`, opacity learnt", "fixed": "`paper`, opacity fixed", "fast": "`fast`"}
    rows = []
    for name, label in labels.items():
        if name in found:
            missing = found[name]["result"]["missing"]
            shares = [f"{100.0 * missing[key]:.0f} %" for key in ("there", "shown", "shown_of_others")]
            rows.append([label, errors(found[name]), *shares])
    columns = ["fit", "struts that are there, mm", "broken struts: there", "shown", "whole struts: shown"]
    return (
        f"## Missing struts\n\nHalves of 20 struts are missing. Here {_frames(found)}; kernels of an opacity below 0.5"
        " are left out, as in the paper.\n\n" + table(columns, rows)
    )


def cube(records: Sequence[Record]) -> str:
    """Views that no fit has seen."""
    found = best(records, "cube")
    rows = []
    for name, record in found.items():
        shares = [f"{100.0 * record['result']['unlike'][views]:.2f} %" for views in ("input", "new")]
        rows.append([f"`{name}`", errors(record), *shares])
    columns = ["fit", "curves mean / largest, mm", "other pixels, the fit's views", "new views"]
    return (
        "## A cube with one bent strut\n\nPixels of the silhouettes that differ, as a share of all that are white in"
        " either; of `deformation-driven` (SC-GS) of its kernels, of which the paper shows that they look right in the"
        " views of the fit and worse in others.\n\n" + table(columns, rows)
    )


def prints(records: Sequence[Record]) -> str:
    """Largest displacement by batch."""
    found = best(records, "prints")
    rows = []
    for name, record in found.items():
        frame, _, way = name.partition("-")
        result = record["result"]
        collapsed = result["collapsed_at_batch"]
        end = "not finished" if collapsed is None else f"collapsed in batch {collapsed}"
        end = "finished" if result["completed"] else end
        rows.append([frame, "with" if way == "adapted" else "without", end, _batches(result["e_max"])])
    for frame, values in paper.E_MAX.items():
        rows.append([f"{frame}, the paper's print", "with", "finished", _batches(values)])
    return (
        "## Adaptation\n\nLargest displacement E_max in mm of what stands, after each batch of a simulated print; the"
        " paper's are real prints of its own frames, which sag otherwise.\n\n"
        + table(["frame", "adaptation", "end", "E_max by batch"], rows)
    )


def _batches(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.1f}" for value in values)


def _power(name: str) -> str:
    return "without end" if name == "inf" else name


def _fall(record: Record) -> float:
    loss = record["result"]["loss"]
    return loss[-1] / loss[0]


def _frames(found: dict[str, Record]) -> str:
    return ", ".join(sorted({record["conditions"]["frame"] for record in found.values()}))


SECTIONS: dict[str, Any] = {
    "table1": table1,
    "rivals": rivals,
    "partial": partial,
    "views": views,
    "power": power,
    "bending": bending,
    "opacity": opacity,
    "cube": cube,
    "prints": prints,
}
"""By experiment, in the order of the page."""
