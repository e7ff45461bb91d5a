"""Read by Python when it starts, if this folder is on its path: gives a worker jobs that misbehave."""

from __future__ import annotations

import os

import frametwin
from frametwin.worker import job_table as jobs
from frametwin.worker import protocol

frametwin.__version__ = os.environ.get("TEST_VERSION", frametwin.__version__)
protocol.PROTOCOL = int(os.environ.get("TEST_PROTOCOL", protocol.PROTOCOL))
for name in ("count", "shout", "crash", "stubborn", "write", "echo", "nan", "hold", "lacking"):
    jobs.JOBS[name] = f"extra_jobs:{name}"
print(os.environ.get("TEST_NOISE", ""), end="")
