"""Sizes of the columns of a Parquet file from its headers ("heads"): Arrow reads them without a bound and gives no access to all.

A header that Arrow might read in another way is refused, so that the sizes found here are those of what Arrow reads.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

MAX_VALUES: Final = 3_000_000
"""Largest number of values in all heads of a file: a file of 1 GiB with fifty columns has half as many."""

I16, I32, I64, BINARY, LIST, STRUCT = 4, 5, 6, 8, 9, 12
BITS: Final = {I16: 16, I32: 32, I64: 64}
SIZES: Final = {1: 0, 2: 0, 3: 1, 7: 8}
"""Kind -> number of bytes in Thrift's compact protocol: of the two bools, whose value is their kind, of a byte and of a double."""


class Heads(io.BytesIO):
    """Reader of consecutive values in Thrift's compact protocol.

    Examples
    --------
    >>> Heads(bytes([0x15, 6, 0])).value(STRUCT)
    {(1, 5): 3}
    """

    left = MAX_VALUES

    def value(self, kind: int) -> Any:
        """Read the next value, which is of a given kind.

        A struct is returned as a mapping of (id, kind) to value: the kind is in the key because Arrow skips a field of another kind.

        Raises
        ------
        ValueError, LookupError, ArithmeticError
            When the bytes are not such a value, or there are more than `MAX_VALUES` values.
        """
        self.left -= 1
        if self.left < 0:
            raise ValueError("too many values in its heads")
        if kind == STRUCT:
            return dict(self._fields())
        if kind == LIST:
            head = self.read(1)[0]
            count = head >> 4 if head < 0xF0 else self._whole()
            return [self.value(max(head & 15, 3)) for _ in range(count)]  # a bool is a byte there
        if kind not in BITS:
            return self.read(self._whole() if kind == BINARY else SIZES[kind])
        number = (zigzag := self._whole()) >> 1 ^ -(zigzag & 1)
        if number >> BITS[kind] - 1 not in (0, -1):
            raise ValueError(f"a number out of range: {number}")
        return number

    def _fields(self) -> Iterator[tuple[tuple[int, int], Any]]:
        number = 0
        while head := self.read(1)[0]:
            number = (number + (head >> 4) if head >> 4 else self.value(I16)) & 0xFFFF
            yield (number, head & 15), self.value(head & 15)

    def _whole(self) -> int:
        number = 0
        for shift in range(0, 64, 7):
            byte = self.read(1)[0]
            number |= (byte & 127) << shift
            if byte < 128:
                return number
        raise ValueError("a number without an end")


def column_sizes(content: bytes) -> tuple[Counter[str], Counter[str]]:
    """Number of values of each column as the footer states it, and bytes of its inflated pages as their heads state them.

    No page can be inflated to more bytes than its head states.

    Parameters
    ----------
    content : bytes
        Content of a Parquet file.

    Raises
    ------
    ValueError, LookupError, TypeError, ArithmeticError, RecursionError
        When the heads are damaged or contradict each other.
    """
    heads, values, inflated = Heads(content), Counter[str](), Counter[str]()
    heads.seek(len(content) - 8 - int.from_bytes(content[-8:-4], "little"))
    for group in heads.value(STRUCT)[4, LIST]:
        for about in (column[3, STRUCT] for column in group[1, LIST]):
            name = b".".join(about[3, LIST]).decode()
            values[name] += about[5, I64]
            starts = about[9, I64], about.get((11, I64), 0)
            end = heads.seek(min(start for start in starts if start > 0)) + about[7, I64]
            while heads.tell() < end:
                page = heads.value(STRUCT)
                inflated[name] += max(page[2, I32], 0)
                heads.seek(max(page[3, I32], 0), io.SEEK_CUR)
    return values, inflated
