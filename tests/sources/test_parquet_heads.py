"""Heads of Parquet files: what they state is counted as Arrow follows it, and contradictions cost next to nothing."""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.support.bombs import cost_of
from tests.support.parquet_pages import (
    INT32,
    INT64,
    LIST,
    TEXT,
    TWO,
    Page,
    contradictions,
    parquet,
    thrift,
    varint,
)

from tripwatt.containers import MAX_CONTENT_BYTES
from tripwatt.errors import InvalidInput
from tripwatt.sources.columnar import open_table
from tripwatt.sources.parquet_heads import STRUCT, Heads, column_sizes

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")


@pytest.mark.parametrize("codec", ["none", "snappy", "zstd"])
@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_sizes_are_those_that_arrow_states(codec: str, version: str) -> None:
    rng = np.random.default_rng(0)
    columns = {
        "time_s": np.arange(5000.0),
        "words": np.array(["a", "bc", None])[rng.integers(0, 3, 5000)],
        "on": rng.random(5000) < 0.5,
        "number": rng.integers(0, 9, 5000).astype(np.int32),
    }
    buffer = io.BytesIO()
    pq.write_table(
        pa.table(columns),
        buffer,
        compression=codec,
        data_page_version=version,
        row_group_size=1700,
        data_page_size=2000,
        write_page_index=True,
    )
    values, inflated = column_sizes(buffer.getvalue())
    metadata = pq.ParquetFile(buffer).metadata
    assert values == dict.fromkeys(columns, 5000)
    for number, name in enumerate(columns):
        chunks = [metadata.row_group(k).column(number) for k in range(metadata.num_row_groups)]
        stated = sum(chunk.total_uncompressed_size for chunk in chunks)  # with the heads of its pages
        assert 0.5 * stated < inflated[name] < stated, name


def read_all(name: str, content: bytes, folder: Path) -> None:
    (folder / name).write_bytes(content)
    table = open_table(folder / name)
    for column in table.names:
        table.texts(column)


def test_pages_that_contradict_the_footer_are_refused_or_read_within_the_bounds() -> None:
    wrong, refused = [], {}
    far_kinds = ("many such pages", "run of 100000000 values", "many groups")
    for k, (name, content) in enumerate(contradictions()):
        if k % 4 and not name.startswith(("sound", *far_kinds)):
            continue
        cost = cost_of("a.parquet", content, read_all)
        refused[name] = cost.refused
        if cost.memory_bytes > MAX_CONTENT_BYTES or cost.seconds > 20.0:  # other tests run beside this one
            wrong.append(f"{name}: {cost}")
    assert wrong == []
    assert len(refused) > 30
    assert {name for name, why in refused.items() if name.startswith("sound") and why} == set()
    far = [name for name in refused if name.startswith(far_kinds)]
    assert len(far) == 8
    assert [name for name in far if not refused[name]] == []


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"\x15" + varint(1 << 33) + b"\0", "number out of range"),  # Arrow takes the lowest 32 bits
        (b"\x16" + b"\xff" * 9 + b"\x7f\0", "number out of range"),
        (b"\x16" + b"\xff" * 11 + b"\0", "number without an end"),
        (b"\x05" + varint(65538 << 1) + b"\x02\0", "number out of range"),  # Arrow takes it as field 2
        (b"\x10\0", "^0$"),  # the end, for Arrow
        (b"\x1b\1\x55\2\2\0", "^11$"),  # a map
        (b"\x19\xf5" + varint(2**40), "index out of range"),
        (b"\x15", "index out of range"),
    ],
)
def test_what_arrow_reads_in_another_way_is_refused(data: bytes, what: str) -> None:
    with pytest.raises((ValueError, LookupError), match=what):
        Heads(data).value(STRUCT)


def test_a_field_of_another_kind_does_not_take_the_place_of_one() -> None:
    """Arrow skips a field of another kind than the one that it expects, and counts the numbers of fields in 16 bits."""
    field = thrift(12, {2: (INT32, 500)})[:-1] + b"\x06\x04" + thrift(INT64, 16) + b"\0"
    assert Heads(field).value(STRUCT) == {(2, INT32): 500, (2, INT64): 16}
    around = b"\xf1" * (65535 // 15) + b"\x35" + thrift(INT32, 500) + b"\0"
    assert Heads(around).value(STRUCT)[2, INT32] == 500


def test_values_of_every_kind_are_read() -> None:
    given = {1: (1, True), 2: (2, False), 3: (INT64, -(2**63)), 4: (TEXT, b"abc"), 5: (LIST, (INT32, [1, -2])), 40: (STRUCT, {1: (INT32, 5)})}  # fmt: skip
    data = thrift(STRUCT, {k: v for k, v in given.items() if k < 40})[:-1]
    data += b"\x17" + bytes(8) + b"\x13\x07" + b"\x19\x21\1\2" + b"\x0c" + thrift(INT32, 40) + thrift(STRUCT, {1: (INT32, 5)}) + b"\0"  # fmt: skip
    assert Heads(data).value(STRUCT) == {
        (1, 1): b"",
        (2, 2): b"",
        (3, INT64): -(2**63),
        (4, TEXT): b"abc",
        (5, LIST): [1, -2],
        (6, 7): bytes(8),
        (7, 3): b"\7",
        (8, LIST): [b"\1", b"\2"],
        (40, STRUCT): {(1, INT32): 5},
    }


def test_heads_have_a_largest_number_of_values(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    place = tmp_path / "a.parquet"
    place.write_bytes(parquet(Page(TWO, 1, repeats=200), rows=200, codec=""))
    assert len(open_table(place).numbers(["time_s"])[0]) == 200
    monkeypatch.setattr(Heads, "left", 1000)
    with pytest.raises(InvalidInput, match=r"unreadable Parquet file: .*too many values in its heads"):
        open_table(place)


def test_a_column_that_ends_elsewhere_than_the_table_is_refused(tmp_path: Path) -> None:
    place = tmp_path / "a.parquet"
    place.write_bytes(parquet(Page(TWO), values=1))
    with pytest.raises(InvalidInput, match=r"unreadable Parquet file: .*1 values of 'time_s' in 2 rows"):
        open_table(place).numbers(["time_s"])
    pd.DataFrame({"a": [[1.0, 2.0], [3.0]], "b": [1.0, 2.0]}).to_parquet(place)
    assert open_table(place).numbers(["b"])[0].tolist() == [1.0, 2.0], "a list beside it has more values"


def test_too_little_memory_is_no_fault_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "a.parquet"
    place.write_bytes(parquet(Page(TWO)))
    table = open_table(place)

    class Full:
        def __getattr__(self, name: str) -> object:
            if name == "read":
                raise pa.ArrowMemoryError("malloc of size 1 failed")
            return getattr(table.file, name)

    full = type(table)(table.path, Full(), table.values, table.inflated, [])  # type: ignore[call-arg, arg-type, union-attr]
    with pytest.raises(MemoryError):
        full.numbers(["time_s"])
