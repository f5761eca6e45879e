"""Bounds on the content of packed files: ZIP archives, workbooks and models, also when nested."""

from __future__ import annotations

import io
import zipfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from tripwatt.errors import InvalidInput

MAX_CONTENT_BYTES: Final = 1 << 28
"""Largest content [bytes] of a container, and largest total size of the tables that are made of it."""

INSIDE: Final = "bytes when inflated"
TABLES: Final = "bytes of tables"
CELLS: Final = "cells"
ELEMENTS: Final = "elements of XML"
LIMITS: Final[Mapping[str, int]] = MappingProxyType(
    {INSIDE: MAX_CONTENT_BYTES, TABLES: MAX_CONTENT_BYTES, CELLS: 5_000_000, ELEMENTS: 20_000_000}
)
"""Limit of each kind of content that one file may give."""

MAX_ENTRIES: Final = 20_000
"""Largest number of files in an archive; the entry of one file takes half a kilobyte of memory."""

MAX_RATIO: Final = 200
"""Largest ratio of inflated to packed bytes of an archive; tables of measurements have 5 to 60."""

ANY_RATIO_BYTES: Final = 1 << 22
"""Content [bytes] up to which any ratio is accepted."""

METHODS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Methods of compression that are read; the others allocate as much memory as their headers claim."""


@dataclass
class Budget:
    """Limits on the content of a file, and what was read so far; all archives nested in a file share one budget.

    Attributes
    ----------
    where : str
        The file, for the fault.
    limits : mapping of str to int
        Limit of each kind of content.
    used : Counter
        What was read so far, by kind.

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
        """Add to the count of a kind of content, before the content is kept.

        Raises
        ------
        InvalidInput
            When the count exceeds the limit of its kind.
        """
        self.used[kind] += count
        if self.used[kind] > self.limits[kind]:
            got, allowed = f"{self.used[kind]} {kind}", f"at most {self.limits[kind]} {kind}"
            raise InvalidInput.of("archive too large", self.where, got, allowed)


def open_archive(data: bytes, budget: Budget, max_ratio: int = MAX_RATIO) -> zipfile.ZipFile:
    """Open a ZIP archive (also .npz and .xlsx) after a check of its entries: nothing is inflated yet.

    A file in an archive never gives more bytes than its entry declares, so that the sum over the entries is a bound.

    Parameters
    ----------
    data : bytes
        Content of the archive.
    budget : Budget
        The size of the content is taken from its limit `INSIDE`.
    max_ratio : int
        Largest ratio of inflated to packed bytes, if the content is larger than `ANY_RATIO_BYTES`.

    Raises
    ------
    zipfile.BadZipFile
        When the data are not an archive.
    InvalidInput
        When the archive has too many files, its content is too large, or the compression of a file is neither deflate nor none.
    """
    if (entries := data.count(zipfile.stringCentralDir)) > MAX_ENTRIES:  # type: ignore[attr-defined]
        raise InvalidInput.of("too many files", budget.where, f"{entries}", f"at most {MAX_ENTRIES}")
    opened = zipfile.ZipFile(io.BytesIO(data))
    if not budget.used:  # the outermost archive: its bounds hold for all that is nested in it
        most = max(ANY_RATIO_BYTES, max_ratio * len(data))
        budget.limits = {kind: min(limit, most) for kind, limit in budget.limits.items()}
    budget.take(INSIDE, sum(entry.file_size for entry in opened.infolist()))
    if any(entry.compress_type not in METHODS for entry in opened.infolist()):
        fix = "compress it again, with the usual method"
        raise InvalidInput.of("unreadable archive", budget.where, "an unusual compression", "deflate", fix)
    return opened
