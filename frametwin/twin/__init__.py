"""Twins: what a fit found, the run folder it is kept in, and what follows from it."""

from frametwin.twin.runs import Truth, load_run, read_truth
from frametwin.twin.twin import Twin, read_twin

__all__ = ["Truth", "Twin", "load_run", "read_truth", "read_twin"]
