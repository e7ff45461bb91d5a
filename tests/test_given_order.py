"""Orders that come with a frame: kept as they are, and refused where they cannot be printed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_frames import tower

from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence_file import read_sequence, write_sequence
from frametwin.printing.sequencing.check import check_sequence
from frametwin.printing.sequencing.given_order import GivenOrder, order_of_frame, read_given_order
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence


def chain() -> Wireframe:
    return Wireframe.create([[0, 0, 0], [0, 0, 10], [7, 0, 17], [17, 0, 17]], [[0, 1], [1, 2], [2, 3]], radius=0.5)


def write(path: Path, data: object) -> Path:
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def test_batches_of_a_frame_are_kept(shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "assembly_instances" / "topopt-310_S1_03-14-2019_w_layer.json")
    given = order_of_frame(frame)
    assert given is not None
    sequence = plan_sequence(frame, given=given)
    np.testing.assert_array_equal(sequence.batch, frame.batch[sequence.struts])
    assert check_sequence(frame, sequence) == []


def test_a_frame_of_one_batch_gives_no_order() -> None:
    assert order_of_frame(tower()) is None


def test_batches_that_hang_in_the_air_are_refused() -> None:
    with pytest.raises(InputError, match="in the air"):
        plan_sequence(chain(), given=GivenOrder(batch=np.array([2, 1, 0])))


def test_pychoreo_plan_is_kept(shared_frames: Path) -> None:
    """Its tool was slimmer: one strut of nineteen is in the way of ours."""
    frame = read_frame(shared_frames / "assembly_instances" / "simple_frame.json")
    path = shared_frames / "sequences" / "pychoreo_simple_frame_solution_regression-z.json"
    given = read_given_order(path, frame)
    with pytest.raises(InputError, match=r"strut \d+ cannot be laid without touching strut \d+"):
        plan_sequence(frame, given=given)
    sequence = plan_sequence(frame, OrderSettings(allow_contact=True), given)
    pairs = json.loads(path.read_text())["plan"]
    assert np.stack([sequence.start, sequence.end_in(frame)], axis=1).tolist() == pairs
    found = check_sequence(frame, sequence)
    assert [fault.kind for fault in found] == ["collision"]


def test_walk_of_rl3dp_is_kept(shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    given = read_given_order(shared_frames / "sequences" / "rl3dp_results_Femur_wireframe.txt", frame)
    sequence = plan_sequence(frame, given=given)
    ends = np.stack([sequence.start, sequence.end_in(frame)], axis=1)
    assert ends[:4].tolist() == [[58, 57], [57, 210], [210, 250], [250, 130]]
    assert len(sequence) == 772
    assert check_sequence(frame, sequence) == []


def test_own_sequences_are_kept_and_read_back(tmp_path: Path) -> None:
    frame = tower()
    sequence = plan_sequence(frame, OrderSettings(batch_size=5))
    write_sequence(tmp_path / "sequence.json", sequence)
    back = read_sequence(tmp_path / "sequence.json")
    again = plan_sequence(frame, given=read_given_order(tmp_path / "sequence.json", frame))
    for field in ("struts", "start", "axis", "batch"):
        np.testing.assert_array_equal(getattr(back, field), getattr(sequence, field))
        if field != "axis":
            np.testing.assert_array_equal(getattr(again, field), getattr(sequence, field))
    assert check_sequence(frame, again) == []


def test_a_strut_begun_in_the_air_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "plan.json", {"plan": [[0, 1], [2, 3], [1, 2]]})
    given = read_given_order(path, chain())
    with pytest.raises(InputError, match="strut 2 has its start in the air"):
        plan_sequence(chain(), given=given)
    sequence = plan_sequence(chain(), OrderSettings(allow_contact=True), given)
    assert sequence.struts.tolist() == [0, 2, 1]
    assert [(f.kind, f.strut) for f in check_sequence(chain(), sequence)] == [("in the air", 2)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ({"plan": [[0, 1], [1, 2]]}, "strut 2 of 3 never come"),
        ({"plan": [[0, 1], [1, 2], [2, 3], [1, 2]]}, "strut 1 is laid twice"),
        ({"plan": [[0, 1], [1, 3], [2, 3]]}, r"\(1, 3\) is no strut"),
        ({"plan": [[0, 1, 2]]}, "plan"),
        ({"algorithm": "regression"}, "holds no order"),
        ("Path: [0, 1, 9]", "names vertex 9 of 4"),
        ("Path: [0, one]", "no list of vertex indices"),
        ("0 1\n1 2\n", "Path: is missing"),
        ({"format": "frametwin-sequence", "version": 1, "struts": [0]}, "start: is missing"),
        ({"format": "frametwin-sequence", "version": 2}, "version"),
    ],
)
def test_damaged_orders_are_refused(tmp_path: Path, text: object, words: str) -> None:
    path = write(tmp_path / ("order.txt" if isinstance(text, str) else "order.json"), text)
    with pytest.raises(InputError, match=words) as caught:
        read_given_order(path, chain())
    assert str(path) in str(caught.value)
