"""The figures: convergence, histograms, and largest displacement by batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scripts.evidence import paper
from scripts.evidence.records import BINS, Record, best

Axes = Any
"""matplotlib's."""


def convergence(axes: Axes, records: Sequence[Record]) -> None:
    """Normalised loss of the paper's method on its frames."""
    for name, record in best(records, "table1").items():
        if name.endswith("-paper"):
            _loss(axes, record, name.removesuffix("-paper"))


def powers(axes: Axes, records: Sequence[Record]) -> None:
    """Normalised loss by the power of the bending term's weight."""
    found = best(records, "power")
    for name in sorted(found, key=float):
        _loss(axes, found[name], "p without end" if name == "inf" else f"p = {name}")


def views(axes: Axes, records: Sequence[Record]) -> None:
    """Errors of struts by number of views, by the paper's method."""
    found = {name: one for name, one in best(records, "views").items() if name.endswith("-paper")}
    names = sorted(found, key=lambda name: int(name.partition("-")[0]))
    _histogram(axes, [(f"{name.partition('-')[0]} views", found[name]) for name in names])


def power_errors(axes: Axes, records: Sequence[Record]) -> None:
    """Errors of struts by the power of the bending term's weight."""
    found = best(records, "power")
    labels = [("p without end" if name == "inf" else f"p = {name}", found[name]) for name in sorted(found, key=float)]
    _histogram(axes, labels)


def displacement(axes: Axes, records: Sequence[Record]) -> None:
    """Largest displacement by batch, with adaptation and without; a cross where a print collapsed."""
    colours: dict[str, Any] = {}
    for name, record in best(records, "prints").items():
        frame, _, way = name.partition("-")
        result, adapted = record["result"], way == "adapted"
        values, label = result["e_max"], f"{frame}, {'with' if adapted else 'without'}"
        shares = [100.0 * batch / result["batches"] for batch in range(1, len(values) + 1)]
        style, colour = "-" if adapted else ":", colours.get(frame)
        (line,) = axes.plot(shares, values, style, marker="o", markersize=4, label=label, color=colour)
        colours[frame] = line.get_color()
        if result["collapsed_at_batch"] is not None:
            axes.plot(shares[-1], values[-1], "X", markersize=12, color=colours[frame])
    for frame, known in paper.E_MAX.items():
        shares = [100.0 * batch / len(known) for batch in range(1, len(known) + 1)]
        axes.plot(shares, known, "--", marker="s", markersize=4, alpha=0.6, label=f"{frame}, the paper's, with")
    axes.set_xlabel("batches printed, %")
    axes.set_ylabel("largest displacement, mm")


FIGURES: dict[str, dict[str, tuple[str, Callable[[Axes, Sequence[Record]], None]]]] = {
    "table1": {"convergence": ("Loss over its first value, by iteration", convergence)},
    "views": {"views": ("Struts by their mean error and the number of views", views)},
    "power": {
        "power": ("Loss over its first value, by iteration and power p", powers),
        "power-errors": ("Struts by their mean error and power p", power_errors),
    },
    "prints": {"prints": ("Largest displacement by share of the print; crosses are collapses", displacement)},
}
"""By experiment and file: what it shows, and what draws it."""


def draw(folder: Path, experiment: str, records: Sequence[Record]) -> list[tuple[str, str]]:
    """Draw the figures of an experiment; the name of each file, and what it shows."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    made = []
    for name, (title, drawing) in FIGURES.get(experiment, {}).items():
        figure = Figure(figsize=(7.0, 3.6), layout="constrained")
        axes = figure.add_subplot()
        drawing(axes, records)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
        folder.mkdir(parents=True, exist_ok=True)
        FigureCanvasAgg(figure).print_png(folder / f"{name}.png", metadata={"Software": None})
        made.append((f"{name}.png", title))
    return made


def _loss(axes: Axes, record: Record, label: str) -> None:
    loss = record["result"]["loss"]
    axes.plot(range(1, len(loss) + 1), [value / loss[0] for value in loss], label=label)
    axes.set_xlabel("iteration")
    axes.set_ylabel("loss / first loss")
    axes.set_ylim(bottom=0.0)


def _histogram(axes: Axes, found: Sequence[tuple[str, Record]]) -> None:
    width = 0.8 / max(len(found), 1)
    for i, (label, record) in enumerate(found):
        counts = record["result"]["histogram"]
        shares = [100.0 * count / sum(counts) for count in counts]
        axes.bar([k + (i - 0.5 * (len(found) - 1)) * width for k in range(len(counts))], shares, width, label=label)
    names = [f"{low:g} to {high:g}" for low, high in zip(BINS, BINS[1:], strict=False)] + [f"over {BINS[-1]:g}"]
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right", fontsize=8)
    axes.set_xlabel("mean error of a strut, mm")
    axes.set_ylabel("struts, %")
