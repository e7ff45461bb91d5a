"""The page that is kept beside a print job, up to date after each batch."""

from __future__ import annotations

from pathlib import Path

from frametwin.errors import Cancelled, FrameTwinError
from frametwin.progress import ProgressCallback
from frametwin.report.report import write_report

PAGE = "report.html"


def write_job_page(job: Path, progress: ProgressCallback | None = None) -> str:
    """Write the page of a job into its folder.

    A page that cannot be written takes nothing back: the batch has been answered.

    Returns
    -------
    Why it could not be written; empty if it was.

    Raises
    ------
    Cancelled
        If ``progress`` says so.
    """
    try:
        write_report(job, job / PAGE, progress=progress)
    except Cancelled:
        raise
    except (FrameTwinError, OSError) as error:
        return f"The page was not written: {' '.join(str(error).split())}"
    return ""
