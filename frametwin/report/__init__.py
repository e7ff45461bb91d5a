"""Reports to look at: a run, a print job or a dataset on one HTML page that needs nothing but a browser."""

from frametwin.report.report import Report, write_report

__all__ = ["Report", "write_report"]
