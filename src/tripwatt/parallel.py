"""A map over independent tasks in this process, on local cores or on a cluster (joblib); and a limit on BLAS threads."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, wraps
from typing import TYPE_CHECKING, Final, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

WATCH_S: Final = 0.5
"""Time [s] between two checks of a worker process whether its parent still runs."""

Task = TypeVar("Task")
Result = TypeVar("Result")
Given = ParamSpec("Given")


def map_unordered(
    function: Callable[[Task], Result], tasks: Sequence[Task], *, n_jobs: int = -1
) -> Iterator[tuple[int, Result]]:
    """Yield the index and the result of each task, in the order in which they finish.

    Parameters
    ----------
    function : callable
        Must be importable by name when `n_jobs` is not 1.
    tasks : sequence
    n_jobs : int
        Number of processes; 1 = this process, -1 = all cores. Inside a ``joblib.parallel_config`` with another backend
        (for example Dask) that backend runs the tasks.

    Yields
    ------
    index, result

    Examples
    --------
    >>> sorted(map_unordered(abs, [-3, 2], n_jobs=1))
    [(0, 3), (1, 2)]
    """
    if n_jobs == 1 or len(tasks) < 2:
        for index, task in enumerate(tasks):
            yield index, function(task)
        return
    from joblib import Parallel, delayed

    work = (delayed(_call_numbered)(function, index, task) for index, task in enumerate(tasks))
    results: Iterable[tuple[int, Result]] = Parallel(
        n_jobs=n_jobs, return_as="generator_unordered", batch_size=1
    )(work)
    try:
        yield from results
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "[0-9]+ tasks which were still being processed", UserWarning)
            del results  # this cancels the tasks that still run; joblib would warn of them
        raise


@cache
def _watch_parent() -> None:
    """Start a thread that ends this worker process soon after its parent has ended; only the first call has an effect."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        while parent is not None and os.getppid() == parent.pid:
            time.sleep(WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="watch-parent").start()


def one_blas_thread(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """Decorate a function so that linear algebra has one thread while it runs. Costs 0.1 ms a call, unless it has one already.

    The matrices of a forecast have some hundred rows. For these, several threads wait for each other longer than they compute: on
    two busy cores a forecast takes three times as long.

    Examples
    --------
    >>> import numpy
    >>> from threadpoolctl import threadpool_info
    >>> @one_blas_thread
    ... def threads() -> set[int]:
    ...     return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}
    >>> threads()
    {1}
    """

    @wraps(function)
    def limited(*args: Given.args, **options: Given.kwargs) -> Result:
        libraries = _blas("scipy.linalg" in sys.modules)
        if all(library.num_threads == 1 for library in libraries.lib_controllers):
            return function(*args, **options)
        with libraries.limit(limits=1):
            return function(*args, **options)

    return limited


@cache
def _blas(with_scipy: bool) -> ThreadpoolController:
    """A controller of the linear algebra libraries in this process; finding them takes tens of milliseconds, so it is cached.

    SciPy has a library of its own, so `with_scipy` separates the cache before and after its import. `scipy.linalg` is not
    imported here: the import takes longer than a forecast, which does not need it.
    """
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")


def _call_numbered(function: Callable[[Task], Result], index: int, task: Task) -> tuple[int, Result]:
    if multiprocessing.parent_process() is not None and threading.current_thread() is threading.main_thread():
        # Ctrl-C reaches every process of a terminal; the parent alone answers it and ends its workers
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _watch_parent()
    return index, function(task)
