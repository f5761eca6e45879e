"""Parquet files whose pages and footer contradict each other, written by hand: no library writes them."""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import pyarrow as pa

INT32: Final = 5
INT64: Final = 6
TEXT: Final = 8
LIST: Final = 9
STRUCT: Final = 12
"""Kinds of values in Thrift's compact protocol; a bool is its own kind, 1 or 2."""

CODECS: Final = {"": 0, "snappy": 1, "gzip": 2, "brotli": 4, "zstd": 6, "lz4_raw": 7}
PLAIN, RLE, DELTA, DELTA_BYTES, DICTIONARY = 0, 3, 5, 7, 8
DOUBLE, BYTES = 5, 6
DATA_PAGE, DICTIONARY_PAGE, DATA_PAGE_V2 = 0, 2, 3


def varint(number: int) -> bytes:
    """A whole number of 0 or more, seven bits a byte."""
    parts = []
    while number > 127:
        parts.append(number & 127 | 128)
        number >>= 7
    return bytes([*parts, number])


def thrift(kind: int, value: Any) -> bytes:
    """A value in Thrift's compact protocol: a struct is a mapping of id to kind and value, a list a kind and values."""
    if kind in (INT32, INT64):
        return varint((value << 1) ^ (value >> 63))
    if kind == TEXT:
        return varint(len(value)) + value
    if kind == LIST:
        of, values = value
        return bytes([0xF0 | of]) + varint(len(values)) + b"".join(thrift(of, v) for v in values)
    written, last = [], 0
    for number, (of, inner) in sorted(value.items()):
        written += [bytes([(number - last) << 4 | of]), thrift(of, inner) if of > 2 else b""]
        last = number
    return b"".join((*written, b"\0"))


def compressed(content: bytes, codec: str) -> bytes:
    """Bytes as a codec of Parquet packs them."""
    if codec == "gzip":
        packer = zlib.compressobj(9, zlib.DEFLATED, 31)
        return packer.compress(content) + packer.flush()
    return content if not codec else pa.Codec(codec).compress(content, asbytes=True)


@dataclass
class Page:
    """A page: its content before compression, and what its head claims where that is not the truth."""

    content: bytes
    values: int = 2
    kind: int = DATA_PAGE
    encoding: int = PLAIN
    inflated: int | None = None
    packed: int | None = None
    repeats: int = 1

    def written(self, codec: str) -> bytes:
        data = compressed(self.content, codec)
        about: dict[int, tuple[int, Any]] = {1: (INT32, self.values)}
        if self.kind == DATA_PAGE:
            about |= {2: (INT32, self.encoding), 3: (INT32, RLE), 4: (INT32, RLE)}
        elif self.kind == DICTIONARY_PAGE:
            about |= {2: (INT32, self.encoding)}
        else:
            about |= {
                2: (INT32, 0),
                3: (INT32, self.values),
                4: (INT32, self.encoding),
                5: (INT32, 0),
                6: (INT32, 0),
            }
        head = {
            1: (INT32, self.kind),
            2: (INT32, len(self.content) if self.inflated is None else self.inflated),
            3: (INT32, len(data) if self.packed is None else self.packed),
            {DATA_PAGE: 5, DICTIONARY_PAGE: 7, DATA_PAGE_V2: 8}[self.kind]: (STRUCT, about),
        }
        return (thrift(STRUCT, head) + data) * self.repeats


def parquet(
    *pages: Page,
    codec: str = "zstd",
    of: int = DOUBLE,
    rows: int = 2,
    group_rows: int | None = None,
    values: int | None = None,
    inflated: int | None = None,
    length: int | None = None,
    start: int = 4,
    dictionary_start: int | None = None,
    groups: int = 1,
) -> bytes:
    """A file of one column `time_s`; what the footer claims is the truth where it is not given."""
    body = b"PAR1" + b"".join(page.written(codec) for page in pages)
    first_data = start + (len(pages[0].written(codec)) if pages[0].kind == DICTIONARY_PAGE else 0)
    true = sum(len(page.content) * page.repeats for page in pages)
    column = {
        1: (INT32, of),
        2: (LIST, (INT32, [PLAIN, RLE, DICTIONARY])),
        3: (LIST, (TEXT, [b"time_s"])),
        4: (INT32, CODECS[codec]),
        5: (INT64, (rows if values is None else values)),
        6: (INT64, true if inflated is None else inflated),
        7: (INT64, len(body) - 4 if length is None else length),
        9: (INT64, first_data),
    }
    if pages[0].kind == DICTIONARY_PAGE or dictionary_start is not None:
        column[11] = (INT64, start if dictionary_start is None else dictionary_start)
    chunk = {2: (INT64, 4), 3: (STRUCT, column)}
    group = {
        1: (LIST, (STRUCT, [chunk])),
        2: (INT64, true if inflated is None else inflated),
        3: (INT64, rows if group_rows is None else group_rows),
    }
    leaf: dict[int, tuple[int, Any]] = {1: (INT32, of), 3: (INT32, 0), 4: (TEXT, b"time_s")}
    if of == BYTES:
        leaf[6] = (INT32, 0)  # UTF-8
    schema = [{4: (TEXT, b"schema"), 5: (INT32, 1)}, leaf]
    footer = thrift(
        STRUCT,
        {1: (INT32, 1), 2: (LIST, (STRUCT, schema)), 3: (INT64, rows), 4: (LIST, (STRUCT, [group] * groups))},
    )
    return body + footer + struct.pack("<L", len(footer)) + b"PAR1"


HUGE: Final = 100_000_000
TWO: Final = struct.pack("<2d", 0.0, 1.0)
MAX_INT32: Final = 2**31 - 1


def one_value(count: int) -> bytes:
    """Indices into a dictionary, all of them 0: one run, of a bit each."""
    return b"\1" + varint(count << 1) + b"\0"


def dictionary(content: bytes = TWO[:8], **claimed: Any) -> Page:
    return Page(content, 1, DICTIONARY_PAGE, **claimed)


def growing(count: int) -> bytes:
    """Texts of which each is the one before and a letter (DELTA_BYTE_ARRAY): their sum grows with the square of their number."""

    def deltas(first: int, step: int) -> bytes:
        zigzag = lambda n: varint(n << 1)  # noqa: E731
        blocks = -(-(count - 1) // 128)
        return varint(128) + varint(4) + varint(count) + zigzag(first) + (zigzag(step) + bytes(4)) * blocks

    return deltas(0, 1) + deltas(1, 0) + b"x" * count


def contradictions() -> Iterator[tuple[str, bytes]]:
    """Files with their names."""
    for codec in CODECS:
        yield f"sound, {codec}", parquet(Page(TWO), codec=codec)
        if codec:
            large = Page(TWO + bytes(HUGE))
            yield f"page inflates to far more than stated, {codec}", parquet(large, codec=codec, inflated=16)
            many = Page(TWO[:8] + bytes(20_000_000), 1, repeats=40)
            yield f"many such pages, {codec}", parquet(many, codec=codec, inflated=16, rows=40)
        for claim in (0, 3, MAX_INT32, -1):
            yield (
                f"page of {claim} bytes when inflated, {codec}",
                parquet(Page(TWO, inflated=claim), codec=codec),
            )
        for claim in (0, 3, MAX_INT32, -1):
            yield f"page of {claim} bytes, {codec}", parquet(Page(TWO, packed=claim), codec=codec)
    for kind, claim in itertools.product((DATA_PAGE, DATA_PAGE_V2), (0, 1, 3, MAX_INT32, -1)):
        yield f"page {kind} of {claim} values", parquet(Page(TWO, claim, kind))
    for claim in (0, 1, 3, 10**8, 2**31, 2**40, 2**62, -1):
        yield f"column of {claim} values", parquet(Page(TWO), values=claim)
        yield f"group of {claim} rows", parquet(Page(TWO), group_rows=claim)
        both = {"values": claim, "group_rows": claim}
        yield f"column and group of {claim} rows", parquet(Page(TWO), **both)
        count = min(max(claim, 0), MAX_INT32)
        run = Page(one_value(count), count, encoding=DICTIONARY)
        yield f"run of {claim} values", parquet(dictionary(), run, **both)
        yield f"run of {claim} values that the column alone states", parquet(dictionary(), run, values=claim)
        yield f"run of {claim} nowhere stated values", parquet(dictionary(), run)
    for claim in (0, 2, MAX_INT32, -1):
        one = Page(one_value(2), encoding=DICTIONARY)
        yield f"dictionary of {claim} bytes", parquet(dictionary(inflated=claim), one)
    yield (
        "dictionary of 100 MB",
        parquet(dictionary(bytes(HUGE)), Page(one_value(2), encoding=DICTIONARY), inflated=16),
    )
    yield (
        "index beyond the dictionary",
        parquet(dictionary(), Page(b"\1" + varint(4) + b"\1", encoding=DICTIONARY)),
    )
    yield "two dictionaries", parquet(dictionary(), dictionary(), Page(one_value(2), encoding=DICTIONARY))
    yield "data without a dictionary", parquet(Page(one_value(2), encoding=DICTIONARY))
    for claim in (0, 3, 50, 2**31, 2**62, -5):
        yield f"dictionary at {claim}", parquet(Page(TWO), dictionary_start=claim)
        yield f"column begins at {claim}", parquet(Page(TWO), start=claim)
        yield f"column of {claim} bytes", parquet(Page(TWO), length=claim)
    yield "column of many empty pages", parquet(Page(b"", 0, repeats=400_000), codec="")
    yield "many groups of one column", parquet(Page(TWO + bytes(20_000_000)), inflated=16, groups=1000)
    for count in (1000, 50_000, 400_000):
        page = Page(growing(count), count, encoding=DELTA_BYTES)
        yield f"{count} texts that grow", parquet(page, of=BYTES, rows=count)
    long = struct.pack("<L", MAX_INT32) + b"x"
    yield "text of 2 GB", parquet(Page(long, 1), of=BYTES, rows=1)
