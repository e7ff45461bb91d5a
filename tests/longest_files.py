"""Test files that take longest, for processes that share them."""

from __future__ import annotations

LONGEST = (
    "test_fast_fit.py",
    "test_blender_boards.py",
    "test_dataset_generate.py",
    "test_plate.py",
    "test_calibration_chain.py",
    "test_addon_failures.py",
    "test_addon_tab.py",
    "test_photo_verdict.py",
    "test_addon_first_use.py",
    "test_generate_script.py",
    "test_addon_print.py",
    "test_rivals.py",
    "test_print_loop.py",
    "test_cli_print.py",
    "test_splat_fit.py",
    "test_print_job.py",
    "test_given_order.py",
    "test_evidence.py",
    "test_bent_struts.py",
)
"""From about half a minute up to minutes: they are begun with, so that in the end no process is left alone with one."""


def place_of(name: str) -> int:
    """When the tests of a file have their turn: the lower, the earlier."""
    return LONGEST.index(name) if name in LONGEST else len(LONGEST)
