"""Executors for the work on a store: in this process, on the cores of this machine, or on a cluster."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from itertools import islice
from multiprocessing.context import BaseContext
from typing import Any, Final, TypeVar

from tripwatt.errors import InvalidInput, require_extras

Task = TypeVar("Task")
Result = TypeVar("Result")

_TASKS_PER_WORKER: Final = 4
"""Tasks per worker that are submitted at once: a choice, because it keeps workers busy and bounds the memory."""

CLUSTER_WAIT_S: Final = 30.0
"""Time [s] within which a cluster has to answer: a choice, because workers of a cluster may take some seconds to start."""


@dataclass(frozen=True)
class Workers:
    """An executor and the number of its workers; by default one thread of this process.

    Examples
    --------
    >>> sorted(Workers().map(abs, [-3, 2]))
    [2, 3]
    """

    executor: futures.Executor = field(default_factory=partial(futures.ThreadPoolExecutor, 1))
    number: int = 1

    def map(self, function: Callable[[Task], Result], tasks: Iterable[Task]) -> Iterator[Result]:
        """Map a function over tasks, and yield results as they finish; at most `_TASKS_PER_WORKER` tasks per worker are submitted at once."""
        waiting: set[futures.Future[Result]] = set()
        remaining = iter(tasks)
        try:
            while True:
                for task in islice(remaining, _TASKS_PER_WORKER * self.number - len(waiting)):
                    waiting.add(self.executor.submit(function, task))
                if not waiting:
                    return
                finished, waiting = futures.wait(waiting, return_when=futures.FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
        finally:
            for future in waiting:
                future.cancel()


@contextmanager
def executor_for(n_jobs: int = 1, cluster: str | None = None) -> Iterator[Workers]:
    """Yield an executor and the number of its workers.

    Parameters
    ----------
    n_jobs : int
        Number of processes on this machine; with 1, tasks run in this process.
    cluster : str, optional
        Address of the scheduler of a Dask cluster, such as tcp://10.0.0.5:8786.

    Raises
    ------
    InvalidInput
        If there is no such cluster, or the package `distributed` is missing.

    Examples
    --------
    >>> with executor_for(1) as workers:
    ...     workers.number, list(workers.map(abs, [-2]))
    (1, [2])
    """
    if cluster is not None:
        with _dask_executor(cluster) as workers:
            yield workers
    elif n_jobs < 1:
        raise InvalidInput.of("value out of range", "n_jobs", f"{n_jobs}", "at least 1")
    else:
        here = Workers().executor
        with here if n_jobs == 1 else futures.ProcessPoolExecutor(n_jobs, _process_context()) as pool:
            yield Workers(pool, n_jobs)


def _process_context() -> BaseContext:
    """Return the start method of processes: forks of a server that has imported the modules, or spawn where that is missing."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    from multiprocessing import forkserver

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tripwatt.fleet.batch"])
    forkserver.ensure_running()  # the server imports its modules while this process goes on
    return context


@contextmanager
def _dask_executor(cluster: str) -> Iterator[Workers]:
    """Yield an executor on a Dask cluster and the number of its threads, once it has a worker."""
    require_extras({"fleet": "--cluster"})
    distributed: Any = import_module("distributed")
    try:
        client = distributed.Client(cluster, timeout=CLUSTER_WAIT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        got = str(error)[:160] or type(error).__name__
        raise InvalidInput.of("no cluster", cluster, got, "the address of a Dask scheduler") from error
    try:
        client.wait_for_workers(1, timeout=CLUSTER_WAIT_S)
        number = max(sum(client.nthreads().values()), 1)
        # tasks can be repeated on another worker, since they are pure functions of immutable files
        yield Workers(client.get_executor(pure=False, retries=3), number)
    except TimeoutError as error:
        raise InvalidInput.of("cluster has no workers", cluster, "", "at least one worker") from error
    finally:
        client.close()
