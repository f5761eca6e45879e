"""One process that computes: jobs come on standard input, answers go to standard output, one at a time.

It is started by `crew` and ends when its input ends, so that it never outlives the service.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import orjson

from tripwatt.errors import InvalidInput
from tripwatt.service.bodies import NotJson
from tripwatt.service.frames import packed, read_frame
from tripwatt.service.jobs import Work
from tripwatt.service.problems import Problem, invalid
from tripwatt.service.serving import json_log
from tripwatt.service.settings import Limits


def answer(work: Work, job: dict[str, Any], body: bytes) -> tuple[int, bytes]:
    """Status and document of a job. Only what nobody thought of is a 500.

    Examples
    --------
    >>> answer(Work({}, Limits()), {"kind": "forecast"}, b"{")[0]
    400
    """
    try:
        return 200, orjson.dumps(work.done(job, body))
    except NotJson as error:
        problem = Problem("not-json", str(error))
    except InvalidInput as error:
        problem = invalid(error.faults)
    except Exception as error:  # who asks gets no traceback, the log does
        json_log(event="bug", kind=job["kind"], traceback="".join(traceback.format_exception(error)))
        problem = Problem("internal")
    return problem.status, orjson.dumps(problem.document())


def main() -> None:
    """Answer jobs until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the service ends its workers when it is done
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no answer
    first = read_frame(sys.stdin.buffer)
    if first is None:
        return
    models = {name: Path(folder) for name, folder in first[0]["models"].items()}
    work = Work.from_folders(models, Limits(**first[0]["limits"]))
    work.warm_up()
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)  # a job leaves hardly a cycle behind
    _send(out, packed({"ready": True}, b""))
    while (frame := read_frame(sys.stdin.buffer)) is not None:
        started = time.perf_counter()
        status, document = answer(work, *frame)
        _send(out, packed({"status": status, "seconds": time.perf_counter() - started}, document))


def _send(out: Any, data: bytes) -> None:
    view = memoryview(data)
    while len(view):
        view = view[out.write(view) :]


if __name__ == "__main__":
    main()
