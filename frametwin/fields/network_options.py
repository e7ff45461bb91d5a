"""What is left to choose about the network, by name; without torch, since settings are read where it is not loaded.

References
----------
Z. Yang et al., "Deformable 3D Gaussians", CVPR 2024, and its published `DeformNetwork`, whose width after the skip
connection the paper's network shares: its encoder has no pi, and its hidden layers start as torch's do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

ENCODINGS: Mapping[str, float] = {"without_pi": 1.0, "with_pi": math.pi}
"""Positional encodings, and the angular frequency of the first octave of each: sin(2^k x) as in the code of
Deformable-3D-Gaussians, sin(2^k pi x) as in the paper's text."""

INITIAL_WEIGHTS: tuple[str, ...] = ("torch", "he")
"""First weights of the hidden layers: torch's default for a linear layer, or with the variance 2 / inputs (He et al.,
2015). The last layer is zero either way, so that the first twin is the plan."""
