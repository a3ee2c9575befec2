# SPDX-License-Identifier: Apache-2.0
"""Executors run blocks in threads of this process, processes of this machine, or workers of a Dask cluster."""

from __future__ import annotations

import multiprocessing
from typing import Any

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, among, closest
from lgvi_warp.common.real_numbers import whole_remedy
from lgvi_warp.engine.executors.base import Executor

NAMES = ("threads", "processes", "dask")
# Those that start processes of their own.
STARTING = ("processes", "dask")
# Threads, processes or workers: of the largest clusters.
MOST_THREADS = 100_000


def check_threads(faults: Faults, threads: Any) -> None:
    """Add a fault unless a number of threads is None (all cores) or a whole number from 1 to MOST_THREADS."""
    if threads is None:
        return
    remedy = "give 1 or more, or leave it out for all cores"
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        faults.add("threads", threads, "is not a whole number above 0", whole_remedy(threads, remedy))
    elif threads > MOST_THREADS:
        faults.add("threads", threads, f"is more than {MOST_THREADS:,}", remedy)


def executor_of(choice: Any, threads: int | None = None, scheduler: str | None = None) -> Executor:
    """Make the executor of a name; an executor object is returned itself.

    threads: number of threads, processes or workers; None (default): all cores, or fewer threads for a short run.
    """
    faults = Faults()
    check_threads(faults, threads)
    if not isinstance(choice, Executor) and not among(choice, NAMES):
        faults.add(
            "executor", choice, "is not known", f"{closest(str(choice), NAMES)}; or give an object with run(...)"
        )
    if scheduler is not None and not among(choice, ("dask",)):
        faults.add("scheduler", scheduler, "is for the executor dask alone", 'give executor="dask", or leave it out')
    if among(choice, STARTING) and scheduler is None and multiprocessing.current_process().daemon:
        problem = "starts processes, which a worker of multiprocessing or Celery may not"
        faults.add("executor", choice, problem, 'use executor="threads" in it, or run outside of it')
    faults.raise_if_any()
    if isinstance(choice, Executor):
        return choice
    count = threads or machine.thread_count()
    if choice == "processes":
        from lgvi_warp.engine.executors.processes import Processes

        return Processes(count)
    if choice == "dask":
        from lgvi_warp.engine.executors.dask import Dask

        cluster = Dask(scheduler, count)
        cluster.check()
        return cluster
    from lgvi_warp.engine.executors.threads import Threads

    return Threads(threads)
