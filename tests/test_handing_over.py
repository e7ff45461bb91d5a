"""A run that is handed over by the worker's protocol is the one that was written."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from small_frames import tower

from frametwin.errors import InputError
from frametwin.formats import write_frame
from frametwin.twin.handing_over import handed_over, taken_over
from frametwin.twin.runs import Truth, load_run
from frametwin.twin.twin import Twin, write_twin
from frametwin.twin.verdict import Verdict
from frametwin.worker.protocol import decode, encode


def measured_twin(seed: int = 3) -> Twin:
    frame, rng = tower(), np.random.default_rng(seed)
    count = frame.strut_count
    bent = frame.control_points.copy()
    bent[:, 1:3] += rng.normal(scale=0.3, size=(count, 2, 3))
    opacity = rng.uniform(size=(count, 5))
    return Twin(
        control_points=bent,
        vertices=frame.vertices,
        thickness=rng.uniform(1.0, 2.0, size=(count, 5)),
        opacity=opacity,
        completeness=opacity.mean(axis=1),
        confidence=rng.uniform(size=count),
        sigma_across=rng.uniform(size=count),
        attached=np.ones((count, 2), dtype=bool),
        gap=np.zeros((count, 2)),
        views=({"name": "cam_0", "used": True, "unexplained": 0.1},),
        verdict=Verdict.of([], ["cam_3 was touched"]),
        loss=(0.5, 0.1),
        timing={"total": 1.5},
        provenance={"preset": "fast", "seed": 0},
    )


def test_what_is_handed_over_is_what_the_files_hold(tmp_path: Path) -> None:
    twin, plan = measured_twin(), tower().replace(printed=np.arange(tower().strut_count) % 5 > 0)
    present = np.tile([0.0, 0.75], (plan.strut_count, 1))
    line = encode({"event": "result", "result": handed_over(twin, plan, Truth(plan, present))})
    found, frame, truth = taken_over(decode(line)["result"])
    write_twin(tmp_path, twin)
    write_frame(tmp_path / "frame.json", plan)
    read, read_plan = load_run(tmp_path)
    for item in dataclasses.fields(Twin):
        np.testing.assert_array_equal(getattr(found, item.name), getattr(read, item.name), err_msg=item.name)
    for name in ("vertices", "edges", "control_points", "radius", "printed", "grounded", "batch"):
        np.testing.assert_array_equal(getattr(frame, name), getattr(read_plan, name), err_msg=name)
    assert truth is not None
    np.testing.assert_array_equal(truth.present, present)
    np.testing.assert_array_equal(truth.frame.printed, plan.printed)


def test_a_twin_of_another_frame_is_refused() -> None:
    run = handed_over(measured_twin(), tower())
    run["plan"]["edges"] = run["plan"]["edges"][:-1]
    with pytest.raises(InputError, match="struts"):
        taken_over(run)
