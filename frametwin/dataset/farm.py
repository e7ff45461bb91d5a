"""Independent tasks on several processes or machines: Dask, and a plain loop where one process does."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar

from frametwin.errors import FrameTwinError, InputError
from frametwin.progress import Progress, ProgressCallback

Item = TypeVar("Item")
Result = TypeVar("Result")

PATIENCE = "30s"
"""How long a scheduler may take to answer."""


def run_tasks(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int = 1,
    scheduler: str | None = None,
    cleanup: Callable[[], None] | None = None,
) -> Iterator[tuple[Item, Result | Exception]]:
    """Call a function on every item, each by itself.

    Parameters
    ----------
    function
        One that can be imported by name: workers on other machines have the project installed as well.
    items
        Its arguments.
    workers
        Processes on this machine; with 1 the function is called right here.
    scheduler
        Address of a Dask scheduler that exists, such as ``tcp://10.0.0.1:8786``; then ``workers`` does not count.
    cleanup
        Called on every Dask worker in the end.

    Yields
    ------
    Item and result, or the exception that the function raised, in the order in which they are done. Whoever stops
    iterating stops the workers.

    Raises
    ------
    InputError
        If the scheduler does not answer.
    """
    if scheduler is None and (workers <= 1 or len(items) <= 1):
        for item in items:
            yield item, _tried(function, item)
        return
    from distributed import as_completed

    with _client(min(workers, len(items)), scheduler) as client:
        futures = {client.submit(function, item, pure=False): item for item in items}
        try:
            for future in as_completed(list(futures), loop=client.loop):
                item = futures.pop(future)
                error = future.exception()
                yield item, future.result() if error is None else _plain(error)
                future.release()
        finally:
            if futures:
                client.cancel(list(futures), force=True)
            if cleanup is not None and scheduler is not None:  # workers of our own end anyway
                client.run(cleanup, on_error="ignore")


class SampleSteps:
    """Shows the steps of single samples, where they are made one after the other.

    Attributes
    ----------
    done
        How many samples are; whoever runs them keeps count.
    """

    def __init__(self, progress: ProgressCallback | None, total: int) -> None:
        self.progress, self.total, self.done = progress, total, 0

    def __call__(self, step: Progress) -> bool | None:
        if self.progress is None:
            return None
        return self.progress(replace(step, stage=f"sample {self.done + 1} of {self.total}: {step.stage}"))


def _tried(function: Callable[[Item], Result], item: Item) -> Result | Exception:
    try:
        return function(item)
    except FrameTwinError as error:
        return error


def _plain(error: BaseException) -> Exception:
    """What a worker died of, in words; errors of the function come through as they are."""
    if isinstance(error, FrameTwinError):
        return error
    if type(error).__name__ == "KilledWorker":
        return FrameTwinError("the process that worked on it died again and again")
    if isinstance(error, CancelledError):
        return FrameTwinError("the scheduler gave it up")
    return FrameTwinError(f"{type(error).__name__}: {error}")


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Any]:
    import dask
    from distributed import Client, LocalCluster

    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # reasons are told with the samples
    settings = {"distributed.worker.daemon": False, "distributed.comm.timeouts.connect": PATIENCE}
    with dask.config.set(settings):
        if scheduler is None:
            with _deaf_to_interrupts():
                cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                    memory_limit=None,
                    silence_logs=logging.CRITICAL,
                )
            with cluster, Client(cluster, set_as_default=False) as client:
                yield client
            return
        try:
            client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            remedy = "start one with 'dask scheduler', or correct the address, as tcp://10.0.0.1:8786"
            raise InputError.at("--scheduler", scheduler, "no Dask scheduler answers there", remedy) from error
        with client:
            yield client


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Let processes that are started meanwhile ignore Ctrl-C, which a terminal sends to them too: we end them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
