"""What hypothesis draws for tests of properties: curves, frames, cameras and values of JSON.

The examples are the same in every run, whichever tests run before: a failure in CI is the failure at home.
"""

from __future__ import annotations

import numpy as np
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from hypothesis.internal.conjecture import providers

from frametwin.cameras import Camera, look_at
from frametwin.geometry.wireframe import Wireframe

settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=50,
    phases=(Phase.explicit, Phase.generate, Phase.shrink),
)
settings.load_profile("repeatable")
# Hypothesis also draws numbers that it finds in the code of modules loaded so far; other tests load other modules.
providers._get_local_constants = providers.Constants

SIDE = 1000.0
"""Largest coordinate in mm."""


def numbers(low: float = -SIDE, high: float = SIDE) -> st.SearchStrategy[float]:
    """Finite numbers, often round ones and the ends of the range."""
    return st.floats(low, high, allow_nan=False, allow_subnormal=False)


def parameters() -> st.SearchStrategy[float]:
    """Parameters along a curve, its ends included."""
    return numbers(0.0, 1.0)


def curves(least: int = 1, most: int = 6) -> st.SearchStrategy[np.ndarray]:
    """Control points (n + 1, 3) of one curve in mm, its degree n from ``least`` to ``most``; they may coincide."""
    return st.integers(least, most).flatmap(lambda n: arrays.arrays(np.float64, (n + 1, 3), elements=numbers()))


ODD_NAMES = ("Brücke 1", "tail \\", "two\u2028v 1 2", "two\x85l 1 2", "# 桥", "a/b: c")
"""Names that a line of text would not survive if it were cut where they seem to end."""


def names() -> st.SearchStrategy[str]:
    """Names that frames may have: any text that is not blank and holds no control character."""
    letters = st.characters(min_codepoint=32, exclude_categories=("Cs",))
    texts = st.text(letters, min_size=1, max_size=12).filter(lambda text: bool(text.strip()))
    return st.sampled_from(ODD_NAMES) | texts


@st.composite
def frames(draw: st.DrawFn, straight: bool = False) -> Wireframe:
    """Frames of 2 to 7 distinct vertices, some of which no strut may use."""
    count = draw(st.integers(2, 7))
    places = st.tuples(*[st.integers(-8, 8)] * 3)
    grid = np.array(draw(st.lists(places, min_size=count, max_size=count, unique=True)), dtype=np.float64)
    # On a grid of 20 mm, each off by less than half of it: no two coincide, and no coordinate is a round number.
    vertices = 20.0 * grid + draw(arrays.arrays(np.float64, (count, 3), elements=numbers(-9.0, 9.0)))
    pairs = [(i, j) for i in range(count) for j in range(count) if i < j]
    chosen = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=8, unique=True))
    edges = [pair[::-1] if draw(st.booleans()) else pair for pair in chosen]
    e = len(edges)
    frame = Wireframe.create(
        vertices,
        edges,
        radius=draw(arrays.arrays(np.float64, e, elements=numbers(0.01, 10.0))),
        printed=draw(arrays.arrays(np.bool_, e)),
        grounded=draw(arrays.arrays(np.bool_, count)),
        batch=draw(arrays.arrays(np.int64, e, elements=st.integers(-5, 2**40))),
        name=draw(names()),
    )
    if straight:
        return frame
    bent = frame.control_points.copy()
    bent[:, 1:3] += draw(arrays.arrays(np.float64, (e, 2, 3), elements=numbers(-30.0, 30.0)))
    return frame.replace(control_points=bent)


@st.composite
def cameras(draw: st.DrawFn, distorted: bool = True) -> Camera:
    """Cameras of any turn within a metre or so, lenses as they are sold, and rays up to 60 degrees off the axis."""
    width, height = draw(st.integers(16, 6000)), draw(st.integers(16, 6000))
    side = max(width, height)
    centre = draw(arrays.arrays(np.float64, 3, elements=numbers()))
    target = draw(arrays.arrays(np.float64, 3, elements=numbers()).filter(lambda x: np.linalg.norm(x - centre) > 1.0))
    up = draw(st.sampled_from([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, -2.0, 0.5)]))
    lens = [draw(numbers(-limit, limit)) for limit in (0.02, 0.005, 0.002, 0.002, 0.001)]
    return Camera(
        name=f"view {draw(st.integers(0, 99))}.png",
        width=width,
        height=height,
        fl_x=side * draw(numbers(0.7, 4.0)),
        fl_y=side * draw(numbers(0.7, 4.0)),
        cx=width * draw(numbers(0.3, 0.7)),
        cy=height * draw(numbers(0.3, 0.7)),
        camera_to_world=look_at(centre, target, up),
        distortion=np.array(lens if distorted else [0.0] * 5),
    )


def rigid_motions() -> st.SearchStrategy[np.ndarray]:
    """Rigid motions (4, 4) in mm, of any turn."""
    rows = arrays.arrays(np.float64, (2, 3), elements=numbers())
    apart = rows.filter(lambda ends: np.linalg.norm(ends[1] - ends[0]) > 1.0)
    return apart.map(lambda ends: look_at(ends[0], ends[1], (1.0, -2.0, 0.5)))


def json_scalars() -> st.SearchStrategy[object]:
    """What JSON knows beside lists and objects."""
    finite = st.floats(allow_nan=False, allow_infinity=False)
    return st.none() | st.booleans() | st.integers() | finite | st.text(max_size=6)


def json_values() -> st.SearchStrategy[object]:
    """Whatever a file of JSON may hold."""
    return st.recursive(
        json_scalars(),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
        max_leaves=8,
    )
