"""``frametwin evaluate``: how far a twin is from the truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin.cli.common import FOLDER, json_option, print_json, print_table
from frametwin.wording import shortened

if TYPE_CHECKING:
    from frametwin.evaluation.evaluate import Errors
    from frametwin.twin.findings import Detection
    from frametwin.twin.twin import Twin

ROWS = (("curves", "curves, both ways"), ("joints", "joints"), ("equal_parameter", "equal parameter"))


@click.command("evaluate", short_help="Measure the errors of a twin against the truth.")
@click.argument("run", type=FOLDER)
@click.argument("truth", type=FOLDER)
@click.option(
    "--worst", type=click.IntRange(0), default=5, show_default=True, help="How many of the worst struts to list."
)
@json_option
def command(run: Path, truth: Path, worst: int, as_json: bool) -> None:
    """Compare the twin in RUN with the TRUTH: a capture with a truth.json, or a frame file.

    \b
    Three errors are given in mm, each as mean, 95th percentile and maximum:
      curves           distance between the two sets of curves, from points of each to the nearest
                       point of the other (what a print looks like)
      joints           distance between each joint of the twin and of the truth
      equal parameter  distance between points at the same parameter of the same strut (what
                       waypoints see); sliding along a strut counts here and not in the first

    Only what is printed counts, and of struts that are missing in the truth only what exists. Where the
    capture says which struts are missing (defects.json), the struts that the twin takes to be missing are
    compared with them. --json gives the errors of every strut and joint as well.

    \b
    Examples:
      frametwin evaluate out/bridge_run out/bridge
      frametwin evaluate out/run scanned.json --json
    """
    from frametwin.evaluation.evaluate import evaluate
    from frametwin.twin.findings import Detection, missing_struts
    from frametwin.twin.runs import load_run, read_truth

    twin, frame = load_run(run)
    real = read_truth(truth, frame)
    errors = evaluate(twin.curves, twin.vertices, real.frame, real.present)
    detection = None
    if real.present is not None:
        detection = Detection.of(missing_struts(twin, frame.printed), real.present, frame.printed)
    if as_json:
        found = {} if detection is None else {"missing": detection.as_dict()}
        print_json({"run": run, "truth": truth, **errors.as_dict(), **found})
        return
    print_table(f"Errors of {run} in mm", ("", "mean", "p95", "max"), error_rows(errors))
    if worst:
        names = ("strut", "curves mean", "max", "equal parameter max", "completeness", "confidence")
        print_table("Worst struts, in mm", names, _worst_rows(errors, twin, worst))
    if detection is not None:
        click.echo(describe_detection(detection))


def error_rows(*judged: Errors) -> list[list[str]]:
    """Rows of a table of errors: mean, p95 and maximum for each of ``judged``, side by side."""
    return [
        [title]
        + [f"{getattr(getattr(errors, name), figure):.3f}" for errors in judged for figure in ("mean", "p95", "max")]
        for name, title in ROWS
    ]


def describe_detection(detection: Detection) -> str:
    """What was found of the missing struts, in one line."""
    count = len(detection.found) + len(detection.overlooked)
    text = f"Missing struts: {len(detection.found)} of {count} found"
    if len(detection.overlooked):
        text += f" (overlooked {shortened(detection.overlooked.tolist())})"
    suspected = shortened(detection.false.tolist())
    return f"{text}, {len(detection.false)} suspected in error" + (f" ({suspected})." if len(detection.false) else ".")


def _worst_rows(errors: Errors, twin: Twin, count: int) -> Sequence[Sequence[str]]:
    import numpy as np

    order: Any = np.argsort(-np.nan_to_num(errors.strut_max, nan=-1.0), kind="stable")
    return [
        [
            str(i),
            f"{errors.strut_mean[i]:.3f}",
            f"{errors.strut_max[i]:.3f}",
            f"{errors.strut_equal_max[i]:.3f}",
            f"{twin.completeness[i]:.2f}",
            f"{twin.confidence[i]:.2f}",
        ]
        for i in order[:count].tolist()
        if not np.isnan(errors.strut_max[i])
    ]
