"""A worker process: it reads jobs from standard input and writes their results to standard output, one at a time.

`pool` starts it. It ends when its input ends, so that it never outlives the service.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import orjson

from tripwatt.errors import InvalidInput, RemoteError
from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.contract import chosen
from tripwatt.server.http.frames import encode_frame, read_frame
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.journeys import JourneyJobs
from tripwatt.server.http.problems import Problem, invalid_input
from tripwatt.server.http.serving import log_json
from tripwatt.server.http.settings import Limits

if sys.platform == "linux":
    import resource


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
        document = jobs.run(job, body)
        if isinstance(document, bytes):
            return 200, document
        return 200, orjson.dumps(chosen(document, job.get("fields")))
    except RemoteError as error:
        problem = Problem("remote", faults=error.faults)
    except InvalidInput as error:
        problem = invalid_input(error.faults)
    except Problem as error:
        problem = error
    except MemoryError:
        log_json(event="out of memory", kind=job["kind"])
        most = f"it takes more than {jobs.limits.memory_bytes} bytes of memory"
        problem = Problem("too-large" if body else "internal", most)
    except Exception as error:  # the log gets the traceback, the client does not
        log_json(event="bug", kind=job["kind"], traceback="".join(traceback.format_exception(error)))
        problem = Problem("internal")
    return problem.status, orjson.dumps(problem.document())


def bound_memory(more_bytes: int) -> None:
    """Bound the memory of this process: more than so many bytes beyond what it has is a `MemoryError`. Linux only."""
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[5])
        most = resource.getrlimit(resource.RLIMIT_DATA)[1]
        with contextlib.suppress(ValueError):  # the system allows less
            resource.setrlimit(resource.RLIMIT_DATA, (pages * resource.getpagesize() + more_bytes, most))


def main() -> None:
    """Run jobs until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the service stops its workers
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    output = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # prints of libraries go to the log
    first = read_frame(sys.stdin.buffer)
    if first is None:
        return
    models = {name: Path(folder) for name, folder in first[0]["models"].items()}
    journeys = JourneyJobs.from_settings(first[0]["atlas"])
    folder = first[0].get("cars")
    cars = CarJobs(None if folder is None else Path(folder), journeys.heights)
    jobs = Jobs.from_folders(models, Limits(**first[0]["limits"]), journeys, cars, log_json)
    jobs.warm_up()
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)  # jobs create few reference cycles
    bound_memory(jobs.limits.memory_bytes)
    _write(output, encode_frame({"ready": True}, b""))
    while (frame := read_frame(sys.stdin.buffer)) is not None:
        started = time.perf_counter()
        status, document = run_job(jobs, *frame)
        _write(output, encode_frame({"status": status, "seconds": time.perf_counter() - started}, document))


def _write(output: Any, data: bytes) -> None:
    remaining = memoryview(data)
    while len(remaining):
        remaining = remaining[output.write(remaining) :]


if __name__ == "__main__":
    main()
