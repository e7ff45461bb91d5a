"""The verdict on twins whose masks were found in photographs."""

from __future__ import annotations

import numpy as np
import pytest

from frametwin.fitting.judgement import judged_on_photographs
from frametwin.twin.verdict import Verdict


@pytest.mark.parametrize(("share", "status"), [(0.03, "good"), (0.1, "doubtful")])
def test_a_twin_of_loose_masks_is_doubtful(share: float, status: str) -> None:
    radius = np.full(5, 1.5)
    judged = judged_on_photographs(Verdict("good", ("a view was left out",)), share * radius, radius)
    assert judged.status == status and "a view was left out" in judged.reasons


def test_a_graver_verdict_stays() -> None:
    wrong = Verdict("wrong", ("nothing agrees",))
    assert judged_on_photographs(wrong, np.ones(2), np.ones(2)) is wrong
