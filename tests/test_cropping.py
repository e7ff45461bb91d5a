"""The part of a picture that a fit looks at."""

from __future__ import annotations

import numpy as np
import pytest
from rod_cases import camera_at

from frametwin.fitting.cropping import COARSE, LARGE, cropped
from frametwin.geometry.wireframe import Wireframe

POINT = Wireframe.create([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], [[0, 1]], radius=0.2)


@pytest.mark.parametrize("size", [(900, 1300), (2013, 2999)])
def test_all_that_is_white_stays_in_the_picture_and_the_camera_follows(size: tuple[int, int]) -> None:
    camera = camera_at([300.0, 10.0, 20.0], size, 3000.0)
    mask = np.zeros(size, dtype=np.float32)
    white = np.array([[size[0] // 2 - 133, size[1] // 2 + 41], [size[0] // 2 + 7, size[1] // 2 - 219]])
    mask[white[:, 0], white[:, 1]] = [1.0, 0.01]
    (part,), (seen,) = cropped(POINT, [camera], [mask])
    assert seen.size < 0.5 * mask.size
    assert seen.sum() == mask.sum()
    shift = np.array([camera.cx - part.cx, camera.cy - part.cy])
    np.testing.assert_array_equal(np.argwhere(seen) + shift[::-1], white)
    assert (part.height, part.width) == seen.shape


def test_blocks_of_a_large_picture_cost_no_more_than_their_size() -> None:
    camera = camera_at([300.0, 10.0, 20.0], (2400, 3200), 3000.0)
    mask = np.zeros((2400, 3200), dtype=np.float32)
    mask[1000:1400, 1300:1900] = 1.0
    assert mask.size > LARGE
    _, (seen,) = cropped(POINT, [camera], [mask])
    assert seen.shape[0] <= 400 + 2 * 31 + 2 * COARSE  # 5 % of the longer side, and what blocks add
    assert seen.shape[1] <= 600 + 2 * 31 + 2 * COARSE
