"""Unpacking an upload in a process of its own: its memory, its time and its mistakes end with it."""

from __future__ import annotations

import asyncio
import os
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import orjson

from tripwatt.containers import INSIDE, LIMITS, TABLES
from tripwatt.errors import Fault, InvalidInput
from tripwatt.service.frames import encode_frame, read_frame
from tripwatt.service.problems import Problem
from tripwatt.service.settings import TOKEN_VARIABLE
from tripwatt.sources.archives import unpack

MOST_MEMORY_BYTES: Final = 600_000_000
NICENESS: Final = 10
"""Requests of others go first."""


async def unpack_apart(
    name: str, folder: Path, content: bytes, most_bytes: int, timeout_s: float
) -> list[Path]:
    """Unpack a file as `unpack`, in a process that is ended after a time.

    Parameters
    ----------
    name : str
        Of the file.
    folder : Path
    content : bytes
    most_bytes : int
        Most bytes of the tables together.
    timeout_s : float

    Raises
    ------
    InvalidInput
        As `unpack`, and when it takes more than `MOST_MEMORY_BYTES`.
    OSError
        When the tables cannot be written.
    Problem
        `timeout`.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "tripwatt.service.unpacking",
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env={k: v for k, v in os.environ.items() if k != TOKEN_VARIABLE} | {"OPENBLAS_NUM_THREADS": "1"},
        start_new_session=True,
    )
    limits = {**LIMITS, **{kind: min(most_bytes, LIMITS[kind]) for kind in (INSIDE, TABLES)}}
    try:
        async with asyncio.timeout(timeout_s):
            job = {"name": name, "folder": str(folder), "limits": limits}
            answer, _ = await process.communicate(encode_frame(job, content))
    except TimeoutError:
        raise Problem("timeout", f"unpacking {name} takes longer than {timeout_s:g} s") from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
        for left in folder.glob(f".{process.pid}-*"):
            shutil.rmtree(left, ignore_errors=True)
    if process.returncode:
        raise InvalidInput.of("archive too large", name, "", f"at most {MOST_MEMORY_BYTES} bytes of memory")
    document = orjson.loads(answer)
    if "refused" in document:
        raise OSError(0, document["refused"])
    if "faults" in document:
        raise InvalidInput(Fault(**fault) for fault in document["faults"])
    return [folder / made for made in document["made"]]


def main() -> None:
    """Unpack one file that comes by standard input."""
    if sys.platform != "win32":
        import resource

        os.nice(NICENESS)
        resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY_BYTES, MOST_MEMORY_BYTES))
    frame = read_frame(sys.stdin.buffer)
    assert frame is not None
    job, content = frame
    document: Mapping[str, object]
    try:
        made = unpack(job["name"], Path(job["folder"]), content=content, limits=job["limits"])
        document = {"made": [place.name for place in made]}
    except InvalidInput as error:
        document = {"faults": [{**fault.texts, "count": fault.count} for fault in error.faults]}
    except OSError as error:
        document = {"refused": error.strerror}
    sys.stdout.buffer.write(orjson.dumps(document))


if __name__ == "__main__":
    main()
