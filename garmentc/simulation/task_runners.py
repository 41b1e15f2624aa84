"""Running jobs on several processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from multiprocessing.connection import wait
from typing import Any, TypeVar

from garmentc.errors import GarmentcError

J = TypeVar("J")
R = TypeVar("R")

_BREAKDOWNS = 3
"""So many pools in a row may break down without finishing a job."""


CONNECT_SECONDS = 10.0
"""How long a Dask scheduler has to answer."""


def _begin_worker() -> None:
    """Ctrl-C is the parent's to handle; a worker whose parent is gone, even killed, leaves at once."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def leave_with_parent() -> None:
        if parent is not None:
            wait([parent.sentinel])
            os._exit(1)

    threading.Thread(target=leave_with_parent, daemon=True).start()


def on_processes(jobs: Sequence[J], run: Callable[[J], R], workers: int) -> Iterator[R]:
    """The results of `run(job)` as they come. Jobs lost to a killed worker are run again in new processes.

    Raises GarmentcError where workers die again and again, and whatever `run` raises.
    """
    left = dict(enumerate(jobs))
    breakdowns = 0
    others = set(multiprocessing.active_children())
    try:
        while left:
            context = multiprocessing.get_context("spawn")
            with ProcessPoolExecutor(min(workers, len(left)), context, _begin_worker) as pool:
                futures: dict[Future[R], int] = {pool.submit(run, job): number for number, job in left.items()}
                try:
                    for future in as_completed(futures):
                        result = future.result()
                        del left[futures[future]]
                        breakdowns = 0
                        yield result
                except BrokenProcessPool:
                    breakdowns += 1
                except BaseException:
                    pool.shutdown(wait=False, cancel_futures=True)
                    _terminate(others)
                    raise
            if breakdowns == _BREAKDOWNS:
                raise GarmentcError(
                    f"worker processes died {_BREAKDOWNS} times in a row, perhaps for want of memory; use fewer workers"
                )
    finally:
        _terminate(others)


def _terminate(others: set[multiprocessing.process.BaseProcess]) -> None:
    for process in set(multiprocessing.active_children()) - others:
        process.terminate()


def on_dask(jobs: Sequence[J], run: Callable[[J], R], scheduler: str) -> Iterator[R]:
    """The results of `run(job)` from the workers of the Dask scheduler at `scheduler`, as they come.

    Dask itself runs the jobs of a lost worker on another one.
    Raises GarmentcError where `distributed` is missing, no scheduler answers, or jobs keep killing workers.
    """
    try:
        distributed: Any = import_module("distributed")  # untyped, and often not installed
    except ImportError:
        said = "running on a cluster needs Dask; install it with: pip install 'garmentc[distributed]'"
        raise GarmentcError(said) from None
    try:
        client = distributed.Client(scheduler, timeout=CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        said = f"no Dask scheduler answers at '{scheduler}' ({error}); start one, or check the address"
        raise GarmentcError(said) from None
    with client:
        futures = [client.submit(run, job, pure=False) for job in jobs]
        try:
            for future in distributed.as_completed(futures):
                yield future.result()
        except distributed.KilledWorker as error:
            raise GarmentcError(f"an outfit killed several workers, perhaps for want of memory ({error})") from None
