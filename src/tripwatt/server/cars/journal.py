"""Samples on disk, appended as they arrive: one line of JSON each, read again after a restart.

A line is written before its sample is acknowledged. A process that is killed therefore loses nothing that it acknowledged;
what a sudden loss of power takes is what the system had not written yet.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from tripwatt.errors import InvalidInput, system_errors
from tripwatt.files import write_file
from tripwatt.server.cars.telemetry import CHARGES, FIRST_TIME_S, LAST_TIME_S, Sample, is_sound

MOST_LINE_BYTES: Final = 4096
"""Longest line; a sample with all columns has less than 1 kB."""

FLAGS: Final = ("charging", "parked")
RECEIVED: Final = "received_s"
NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})


Charge = tuple[float, str, float]
"""Time, field of a departure and value."""


def line_of(sample: Sample) -> bytes:
    r"""A sample as a line, without its position.

    Examples
    --------
    >>> line_of(Sample(1.7e9, {"speed_m_s": 20.0}, parked=True))
    b'{"time_s":1700000000.0,"speed_m_s":20.0,"parked":true}\n'
    """
    more: dict[str, float] = {name: True for name in FLAGS if getattr(sample, name)}
    more |= {} if sample.received_s is None else {RECEIVED: sample.received_s}
    text = json.dumps(
        {"time_s": sample.time_s, **sample.values, **more}, separators=(",", ":"), allow_nan=False
    )
    return text.encode() + b"\n"


def sample_of(line: bytes) -> Sample | None:
    """The sample of a line; None where the line is damaged."""
    try:
        fields = json.loads(line)
        charging, parked = (bool(fields.pop(name, False)) for name in FLAGS)
        time_s, came = float(fields.pop("time_s")), fields.pop(RECEIVED, None)
        values = {name: float(value) for name, value in fields.items()}
        return Sample(time_s, values, charging, parked, received_s=None if came is None else float(came))
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError, InvalidInput):
        return None


class Journal:
    """A file of samples that only grows, until `rewrite` shortens it in one step.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    lines : int
        Samples in the file.
    after_s : float
        Samples up to this time were in the file before it was rewritten [s since 1970].
    more : mapping
        What else was known then.

    Raises
    ------
    InvalidInput
        When the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines = 0
        self._open()

    def _open(self) -> None:
        with system_errors("cannot open the journal", f"{self.path}", "a writable file"):
            self._descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
            self._size = _whole_bytes(self._descriptor)
            if self._size < os.fstat(self._descriptor).st_size:
                os.ftruncate(self._descriptor, self._size)
            first = os.pread(self._descriptor, MOST_LINE_BYTES, 0).partition(b"\n")[0]
            self.after_s, self.more = _first_line(first)

    def read(self) -> Iterator[Sample]:
        """All samples in the order of their arrival; damaged lines are left out. O(bytes)."""
        self.lines = 0
        with self.path.open("rb") as stream:
            while line := stream.readline(MOST_LINE_BYTES):
                sample = sample_of(line)
                if sample is not None:
                    self.lines += 1
                    yield sample

    @property
    def written_s(self) -> float:
        """When the file was last written [s since 1970]."""
        return self.path.stat().st_mtime

    def append(self, sample: Sample) -> None:
        """Write a sample behind the others. O(1).

        Raises
        ------
        OSError
            When it cannot be written; the file is as before.
        """
        line = line_of(sample)
        try:
            written = os.write(self._descriptor, line)
        except OSError:
            self._cut()
            raise
        if written < len(line):
            self._cut()
            raise OSError(f"{self.path}: wrote {written} of {len(line)} bytes")
        self._size += len(line)
        self.lines += 1

    def _cut(self) -> None:
        with contextlib.suppress(OSError):
            os.ftruncate(self._descriptor, self._size)

    def rewrite(self, samples: Iterable[Sample], after_s: float, more: Mapping[str, Any] = NOTHING) -> None:
        """Replace all samples by these, in one step: a process that is killed leaves the old or the new file.

        Parameters
        ----------
        samples : iterable of Sample
        after_s : float
            Time up to which samples are no longer in the file [s since 1970].
        more : mapping
            What else is known.

        Raises
        ------
        OSError
            When the file cannot be written; it is as before.
        """
        lines = [line_of(sample) for sample in samples]
        first = json.dumps({"after_s": after_s, **more}, separators=(",", ":")).encode() + b"\n"
        write_file(self.path, lambda made: made.write_bytes(b"".join([first, *lines])))
        self.close()
        self._open()
        self.lines = len(lines)

    def close(self) -> None:
        """Close the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _first_line(line: bytes) -> tuple[float, Mapping[str, Any]]:
    """The time of the first line of a rewritten file, and what else it has; minus infinity of any other line."""
    try:
        more = json.loads(line)
        after_s = float(more["after_s"])
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return -math.inf, NOTHING
    return (after_s if FIRST_TIME_S <= after_s <= LAST_TIME_S else -math.inf), more


def _whole_bytes(descriptor: int) -> int:
    """Size of a file up to its last whole line: a process may have been killed while it wrote."""
    end = os.fstat(descriptor).st_size
    start = max(0, end - MOST_LINE_BYTES)
    newline = os.pread(descriptor, end - start, start).rfind(b"\n")
    if newline < 0 and start:
        return end  # no line of ours is so long
    return start + newline + 1


def charge_of(given: Any) -> tuple[Charge | None, Charge | None]:
    """The latest charge of the first line of a journal, and the same where it is that of a standing car."""
    try:
        time_s, field, value, parked = given
        sound = is_sound(CHARGES[field], value)
        charge = (float(time_s), f"{field}", float(value)) if sound else None
    except (TypeError, ValueError, KeyError):  # an older file, or a damaged one
        return None, None
    return charge, charge if parked else None
