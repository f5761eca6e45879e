"""What a worker process does: it loads its models once, and then runs one job after the other."""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import os
import pickle
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import orjson

from tripwatt.errors import Fault, InvalidInput, excerpt, raise_faults
from tripwatt.roads.journey import AtlasSettings, open_atlas
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.log import log_json
from tripwatt.server.http.problems import Problem, problem_of
from tripwatt.server.http.settings import Limits

if sys.platform == "linux":
    import resource

ENVIRONMENT: Final[Mapping[str, str]] = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # the others reserve a gigabyte at their start
    "GLIBC_TUNABLES": "glibc.malloc.hugetlb=1",  # arrays on few large pages: fewer of their addresses are looked up
}
"""Variables that a worker needs before it loads its libraries."""

PREPARED: Final[list[Jobs]] = []
"""The jobs of this process, once it is prepared."""


def answer_calls(calls: socket.socket, number: int, workers: int, *needed: Any) -> None:
    """Prepare this process, and run the calls that arrive, one after the other, until the service closes the socket.

    On Linux the workers share out the processor cores: a busy system wakes a process on the core of the one that sent it
    something, so that all workers would wait for one core.

    Parameters
    ----------
    calls : socket
        Pickled functions with their arguments arrive; results are sent, each after a line with its length.
    number, workers : int
        Number of this worker, from 0, and of all workers.
    *needed : object
        Arguments of `prepare`.
    """
    if sys.platform == "linux":
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[number::workers] or os.sched_getaffinity(0))
    prepare(*needed)
    with contextlib.suppress(OSError, EOFError), calls.makefile("rwb") as stream:
        while True:
            work, args = pickle.load(stream)
            result = pickle.dumps(work(*args))
            stream.write(b"%d\n" % len(result) + result)
            stream.flush()


def prepare(models: Mapping[str, Path], limits: Limits, atlas: AtlasSettings, cars: Path | None) -> None:
    """Load models, map and cars, and bound the memory of this process.

    Parameters
    ----------
    models : mapping of str to Path
    limits : Limits
    atlas : AtlasSettings
    cars : Path or None
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the service ends its workers
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threading.Thread(target=_end_with_service, daemon=True).start()
    jobs = Jobs.from_folders(models, limits, open_atlas(atlas) if atlas.map else None, cars, log_json)
    jobs.warm_up()
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)  # jobs create few reference cycles
    _bound_memory(limits.memory_bytes)
    PREPARED.append(jobs)


def _end_with_service() -> None:
    """End this process when the service that started it ends, even if the service is killed."""
    if (service := multiprocessing.parent_process()) is not None:
        service.join()
        os._exit(1)


def run_in_worker(job: dict[str, Any], body: bytes) -> tuple[int, bytes, float]:
    """Run a job with the models of this process; return HTTP status, document and computing time [s]."""
    started = time.perf_counter()
    return *run_job(PREPARED[0], job, body), time.perf_counter() - started


def run_job(jobs: Jobs, job: dict[str, Any], body: bytes) -> tuple[int, bytes]:
    """Run a job; an unexpected exception is logged and becomes a problem document with status 500.

    Parameters
    ----------
    jobs : Jobs
    job : dict
        `kind` and the parameters of the job, see `Jobs.run`.
    body : bytes

    Returns
    -------
    tuple of int and bytes
        HTTP status, and the document as JSON, or the bytes of a tile.

    Examples
    --------
    >>> run_job(Jobs({}, Limits()), {"kind": "forecast"}, b"{")[0]
    400
    """
    try:
        document = jobs.run(**job, body=body)
        if isinstance(document, bytes):
            return 200, document
        return 200, orjson.dumps(chosen_fields(document, job.get("fields")))
    except (InvalidInput, Problem) as error:
        problem = problem_of(error)
    except MemoryError:
        log_json(event="out of memory", kind=job["kind"])
        limit = f"it takes more than {jobs.limits.memory_bytes} bytes of memory"
        problem = Problem("too-large" if body else "internal", limit)
    except Exception as error:  # the log gets the traceback, the client does not
        log_json(event="bug", kind=job["kind"], traceback="".join(traceback.format_exception(error)))
        problem = Problem("internal")
    return problem.status, orjson.dumps(problem.document())


def _bound_memory(more_bytes: int) -> None:
    """Bound the memory of this process: more than `more_bytes` beyond its present size raises `MemoryError`. Linux only."""
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[5])
        hard_limit = resource.getrlimit(resource.RLIMIT_DATA)[1]
        with contextlib.suppress(ValueError):  # the system allows less
            most_bytes = pages * resource.getpagesize() + more_bytes
            resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, hard_limit))


def chosen_fields(document: Any, fields: str | None) -> Any:
    """Return the named fields of a document; all fields if `fields` is None.

    Raises
    ------
    InvalidInput
        For a name that the document does not have.

    Examples
    --------
    >>> chosen_fields({"energy_wh": 1.0, "series": []}, "energy_wh")
    {'energy_wh': 1.0}
    """
    if fields is None:
        return document
    names = fields.split(",")
    allowed, unknown = ", ".join(document), [name for name in names if name not in document]
    raise_faults(Fault("unknown field", "query.fields", excerpt(name), allowed) for name in unknown)
    return {name: document[name] for name in names}
