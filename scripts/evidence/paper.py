"""What the paper reports, typed here once (tables I and II, and the captions of the printed models)."""

from __future__ import annotations

ERRORS = {
    "Pavilion": (0.1438, 2.412),
    "Lounge": (0.2512, 2.498),
    "Femur": (0.1147, 1.816),
    "Coral": (0.2086, 2.436),
}
"""Mean and largest error of its method in mm, table I."""

RIVAL_ERRORS = {
    "curve-driven": {
        "Pavilion": (5.540, 26.72),
        "Lounge": (5.932, 36.44),
        "Femur": (6.438, 33.18),
        "Coral": (5.302, 41.54),
    },
    "deformation-driven": {
        "Pavilion": (1.922, 17.88),
        "Lounge": (1.964, 20.80),
        "Femur": (4.110, 18.46),
        "Coral": (1.893, 11.58),
    },
}
"""Mean and largest error in mm of the two methods that it compares with, table I."""

SECONDS = {"Femur": 60.99, "Pavilion": 110.36, "Coral": 359.52, "Lounge": 1030.78}
"""On an RTX 4090, table II."""

MEGABYTES = {"Femur": 6189.72, "Pavilion": 7785.31, "Coral": 12656.85, "Lounge": 20153.46}
"""Of the GPU's memory, table II."""

PARTIAL_SECONDS = {"bunny_head": (71.40, 74.68), "bridge": (71.51, 72.61), "half_bowl": (70.36, 73.11)}
"""Least and most that a twin of its partial prints took, of 3000x4000 pictures, table II."""

E_MAX = {
    "bunny head": (6.52, 8.16, 10.2, 13.9, 15.1, 17.1, 17.9, 18.3),
    "bridge": (8.49, 11.3, 13.3, 14.5),
}
"""Largest displacement in mm after each batch of its real prints with adaptation."""
