"""FrameTwin: where every strut of a printed wireframe really is, from a few pictures and the plan."""

from __future__ import annotations

__version__ = "0.1.0"
