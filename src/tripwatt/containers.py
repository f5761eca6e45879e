"""What is packed, read within bounds: ZIP archives, workbooks and models, however they are nested."""

from __future__ import annotations

import io
import zipfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from tripwatt.errors import InvalidInput

MOST_CONTENT_BYTES: Final = 1 << 28
"""Largest content of a container, and largest tables that are made of it."""

INSIDE: Final = "bytes when inflated"
TABLES: Final = "bytes of tables"
CELLS: Final = "cells"
ELEMENTS: Final = "elements of XML"
LIMITS: Final[Mapping[str, int]] = MappingProxyType(
    {INSIDE: MOST_CONTENT_BYTES, TABLES: MOST_CONTENT_BYTES, CELLS: 5_000_000, ELEMENTS: 20_000_000}
)
"""Most of what comes out of one file."""

MOST_ENTRIES: Final = 20_000
"""Most files of an archive; what an archive says of one takes half a kilobyte of memory."""

MOST_RATIO: Final = 200
"""Most bytes that a byte of an archive may become; tables of measurements become 5 to 60."""

ANY_RATIO_BYTES: Final = 1 << 22
"""Content that may be of any ratio."""

METHODS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Methods of compression that are read; the others take memory by what their heads claim."""


@dataclass
class Budget:
    """What may still come out of a file: one for all that is nested in it.

    Attributes
    ----------
    where : str
        The file, for the fault.
    limits : mapping of str to int
        Most of each kind.
    used : Counter
        What came out so far, by kind.

    Examples
    --------
    >>> Budget("a.xlsx", {CELLS: 10}).take(CELLS, 11)
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: archive too large: a.xlsx: got 11 cells; allowed: at most 10 cells
    """

    where: str
    limits: Mapping[str, int] = field(default_factory=lambda: LIMITS)
    used: Counter[str] = field(default_factory=Counter)

    def take(self, kind: str, count: int) -> None:
        """Count what comes out, before it is kept.

        Raises
        ------
        InvalidInput
            When it is more than the limit of its kind.
        """
        self.used[kind] += count
        if self.used[kind] > self.limits[kind]:
            got, allowed = f"{self.used[kind]} {kind}", f"at most {self.limits[kind]} {kind}"
            raise InvalidInput.of("archive too large", self.where, got, allowed)


def open_archive(data: bytes, budget: Budget, most_ratio: int = MOST_RATIO) -> zipfile.ZipFile:
    """A ZIP archive (also .npz and .xlsx) whose content is within a budget, before anything is inflated.

    A member never gives more bytes than its entry declares, so that the sum of the entries is a bound.

    Parameters
    ----------
    data : bytes
    budget : Budget
        Its `INSIDE` is taken from.
    most_ratio : int
        Most bytes of content for each byte, above `ANY_RATIO_BYTES`.

    Raises
    ------
    zipfile.BadZipFile
        When it is no archive.
    InvalidInput
        When it has too many files, its content is too large, or a file is compressed by another method than deflate.
    """
    if (entries := data.count(zipfile.stringCentralDir)) > MOST_ENTRIES:  # type: ignore[attr-defined]
        raise InvalidInput.of("too many files", budget.where, f"{entries}", f"at most {MOST_ENTRIES}")
    opened = zipfile.ZipFile(io.BytesIO(data))
    if not budget.used:  # the outermost: what is nested in it is within its bounds
        most = max(ANY_RATIO_BYTES, most_ratio * len(data))
        budget.limits = {kind: min(limit, most) for kind, limit in budget.limits.items()}
    budget.take(INSIDE, sum(entry.file_size for entry in opened.infolist()))
    if any(entry.compress_type not in METHODS for entry in opened.infolist()):
        fix = "compress it again, with the usual method"
        raise InvalidInput.of("unreadable archive", budget.where, "an unusual compression", "deflate", fix)
    return opened
