"""Containers that are small on disk and endless inside: ten kinds of bombs, drawn by a seed, and what refusing one costs."""

from __future__ import annotations

import io
import multiprocessing
import os
import resource
import struct
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
import openpyxl.styles
import openpyxl.utils.datetime  # noqa: F401 - once, not for each bomb

from tripwatt.errors import InvalidInput
from tripwatt.sources.archives import unpack

LONGEST_S: Final = 1.0
MAX_BYTES: Final = 64_000_000
"""What refusing a bomb may cost: time, and memory beside that of the process."""

MAIN: Final = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE: Final = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE: Final = "http://schemas.openxmlformats.org/package/2006"
HEAD: Final = (
    '<row><c t="inlineStr"><is><t>time_s</t></is></c><c t="inlineStr"><is><t>speed_m_s</t></is></c></row>'
)

Draw = np.random.Generator
Bomb = Callable[[Draw], tuple[str, bytes]]
Reading = Callable[[str, bytes, Path], object]


def zipped(files: Mapping[str, bytes | str], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A ZIP archive of these files."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", method) as made:
        for name, content in files.items():
            made.writestr(name, content)
    return packed.getvalue()


def book(
    rows: str = HEAD, *, strings: str = "", styles: str = "", before: str = "", sheets: int = 1
) -> bytes:
    """An .xlsx workbook whose parts are given as XML."""
    names = range(1, sheets + 1)
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    parts = {f"xl/worksheets/sheet{k}.xml": "worksheet" for k in names}
    parts |= {
        "xl/workbook.xml": "sheet.main",
        "xl/sharedStrings.xml": "sharedStrings",
        "xl/styles.xml": "styles",
    }
    types = "".join(f'<Override PartName="/{n}" ContentType="{kind}.{t}+xml"/>' for n, t in parts.items())
    links = "".join(
        f'<Relationship Id="r{k}" Type="{OFFICE}/worksheet" Target="worksheets/sheet{k}.xml"/>' for k in names
    )
    links += "".join(
        f'<Relationship Id="{n}" Type="{OFFICE}/{n}" Target="{n}.xml"/>' for n in ("sharedStrings", "styles")
    )
    listed = "".join(f'<sheet name="s{k}" sheetId="{k}" r:id="r{k}"/>' for k in names)
    return zipped(
        {
            "[Content_Types].xml": f'<Types xmlns="{PACKAGE}/content-types">{types}</Types>',
            "_rels/.rels": f'<Relationships xmlns="{PACKAGE}/relationships"><Relationship Id="r" '
            f'Type="{OFFICE}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
            "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>{listed}</sheets></workbook>',
            "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{PACKAGE}/relationships">{links}</Relationships>',
            "xl/sharedStrings.xml": f'<sst xmlns="{MAIN}">{strings}</sst>',
            "xl/styles.xml": f'<styleSheet xmlns="{MAIN}">{styles}</styleSheet>',
            **{
                f"xl/worksheets/sheet{k}.xml": f'{before}<worksheet xmlns="{MAIN}"><sheetData>{rows}</sheetData></worksheet>'
                for k in names
            },
        }
    )


def noise(draw: Draw, count: int) -> str:
    """Digits that compress to about half, so that no ratio gives a bomb away."""
    return draw.bytes(count // 2).hex()


def long_string_in_many_cells(draw: Draw) -> tuple[str, bytes]:
    """A shared string of 20,000 to 100,000 characters in 20,000 to 60,000 cells: gigabytes of CSV."""
    text, cells = "x" * int(draw.integers(20_000, 100_000)), int(draw.integers(20_000, 60_000))
    return "a.xlsx", book(
        HEAD + '<row><c t="s"><v>0</v></c></row>' * cells, strings=f"<si><t>{text}</t></si>"
    )


def many_strings(draw: Draw) -> tuple[str, bytes]:
    """Millions of empty shared strings."""
    return "a.xlsx", book(strings="<si/>" * int(draw.integers(2_000_000, 20_000_000)))


def one_endless_row(draw: Draw) -> tuple[str, bytes]:
    """A row of millions of cells, or of elements that are none."""
    cell = ("<c/>", "<a/>", "<c><v>1</v></c>")[int(draw.integers(3))]
    return "a.xlsx", book(HEAD + "<row>" + cell * int(draw.integers(2_000_000, 8_000_000)) + "</row>")


def wide_rows(draw: Draw) -> tuple[str, bytes]:
    """Rows with one cell, in the last of thousands of columns that the header names."""
    head = "".join('<c t="inlineStr"><is><t>a</t></is></c>' for _ in range(int(draw.integers(3_000, 9_000))))
    row = '<row><c r="XFD{}"><v>1</v></c></row>'
    count = int(draw.integers(20_000, 60_000))
    return "a.xlsx", book(f"<row>{head}</row>" + "".join(row.format(k) for k in range(2, count)))


def many_styles(draw: Draw) -> tuple[str, bytes]:
    """Millions of formats of cells."""
    return "a.xlsx", book(styles=f"<cellXfs>{'<xf/>' * int(draw.integers(1_500_000, 9_000_000))}</cellXfs>")


def entities(draw: Draw) -> tuple[str, bytes]:
    """Entities of XML that name each other, or a long one many times."""
    if draw.random() < 0.5:
        names = [f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, int(draw.integers(7, 12)))]
        inside = f'<!ENTITY e0 "lol">{"".join(names)}'
        use = f"&e{len(names)};"
    else:
        inside = f'<!ENTITY e0 "{"x" * int(draw.integers(20_000, 60_000))}">'
        use = "&e0;" * int(draw.integers(5_000, 20_000))
    cell = f'<row><c t="inlineStr"><is><t>{use}</t></is></c></row>'
    return "a.xlsx", book(HEAD + cell, before=f"<!DOCTYPE a [{inside}]>")


def large_member(draw: Draw) -> tuple[str, bytes]:
    """A table of hundreds of megabytes, by any method, or one whose entry is silent about its size."""
    content = bytes(int(draw.integers(80_000_000, 300_000_000)))
    kind = int(draw.integers(4))
    if kind < 3:
        method = (zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)[kind]
        return "a.zip", zipped({"a.csv": content}, method)
    honest = zipped({"a.csv": content})
    return "a.zip", honest.replace(struct.pack("<L", len(content)), struct.pack("<L", 1000))


def overlapping_members(draw: Draw) -> tuple[str, bytes]:
    """Thousands of entries of one content; or a hundred thousand entries of nothing."""
    if draw.random() < 0.3:
        return "a.zip", zipped(dict.fromkeys(map(str, range(int(draw.integers(30_000, 60_000)))), b""))
    content = zlib.compressobj(9, zlib.DEFLATED, -15)
    plain = bytes(int(draw.integers(500_000, 2_000_000)))
    packed = content.compress(plain) + content.flush()
    local = struct.pack(
        "<4s5H3L2H", b"PK\3\4", 20, 0, 8, 0, 0x21, zlib.crc32(plain), len(packed), len(plain), 5, 0
    )
    directory = b"".join(
        struct.pack(
            "<4s6H3L5H2L", b"PK\1\2", 20, 20, 0, 8, 0, 0x21, zlib.crc32(plain), len(packed), len(plain),
            5, 0, 0, 0, 0, 0, 0,
        ) + b"a.csv"
        for _ in range(int(draw.integers(600, 1_900)))
    )  # fmt: skip
    count, body = directory.count(b"PK\1\2"), local + b"a.csv" + packed
    return "a.zip", body + directory + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, count, count, len(directory), len(body), 0)  # fmt: skip


def workbooks_in_an_archive(draw: Draw) -> tuple[str, bytes]:
    """Workbooks of which each is within the bounds, but not all together."""
    text = noise(draw, 30_000)
    rows = '<row><c t="s"><v>0</v></c><c><v>1</v></c></row>' * int(draw.integers(3_000, 6_000))
    inside = book(HEAD + rows, strings=f"<si><t>{text}</t></si>")
    return "a.zip", zipped({f"{k}.xlsx": inside for k in range(int(draw.integers(10, 40)))})


def parquet_dictionary(draw: Draw) -> tuple[str, bytes]:
    """A long text or bytes in every row, stored once; or a value in every one of millions of rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows, kind = int(draw.integers(300_000, 499_000)), int(draw.integers(4))
    of_type = (pa.string(), pa.binary(), pa.large_string(), pa.float64())[kind]
    if kind == 3:
        column = pa.array(np.zeros(int(draw.integers(3_000_000, 6_000_000))))
    else:
        values = pa.array(["x" * int(draw.integers(2_000, 100_000))]).cast(of_type)
        column = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, dtype=np.int32)), values)
    buffer = io.BytesIO()
    pq.write_table(pa.table({"time_s": column}), buffer, compression="zstd")
    if kind in (1, 2):  # without the schema of Arrow, readers see the plain type
        buffer = io.BytesIO()
        pq.write_table(pa.table({"time_s": column}), buffer, compression="zstd", store_schema=False)
    return "a.parquet", buffer.getvalue()


BOMBS: Final[Mapping[str, Bomb]] = MappingProxyType(
    {
        bomb.__name__: bomb
        for bomb in (
            long_string_in_many_cells,
            many_strings,
            one_endless_row,
            wide_rows,
            many_styles,
            entities,
            large_member,
            overlapping_members,
            workbooks_in_an_archive,
            parquet_dictionary,
        )
    }
)
"""Kinds of bombs by name."""


@dataclass(frozen=True)
class Cost:
    """What became of a bomb: what it was refused as, empty where it was not; seconds; bytes of memory."""

    refused: str
    seconds: float
    memory_bytes: int


def cost_of(name: str, content: bytes, read: Reading | None = None) -> Cost:
    """What reading a file costs, unpacking it where nothing else is given, in a process of its own that has 3 GB."""
    ours, theirs = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(
        target=_measure, args=(name, content, theirs, read or _unpack)
    )
    child.start()
    theirs.close()
    try:
        return ours.recv() if ours.poll(100) else Cost("", 100.0, 0)
    except EOFError:
        return Cost("", 0.0, 3_000_000_000)
    finally:
        child.kill()
        child.join()


def _unpack(name: str, content: bytes, folder: Path) -> None:
    unpack(name, folder, content=content)


def _measure(name: str, content: bytes, out: Connection, read: Reading) -> None:
    most = _memory("VmSize") + 3_000_000_000  # the process that is forked may be large itself
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    Path("/proc/self/clear_refs").write_text("5")  # the peak counts from here
    before, refused = _memory("VmRSS"), ""
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        try:
            read(name, content, Path(folder))
        except InvalidInput as error:
            refused = str(error)
        except MemoryError:
            pass
        seconds = time.perf_counter() - started
    out.send(Cost(refused, seconds, _memory("VmHWM") - before))
    out.close()
    os._exit(0)


def _memory(name: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(name))


def too_dear(kind: str, number: int, seed: int = 0) -> list[str]:
    """Which of some bombs of a kind are not refused within `LONGEST_S` and `MAX_BYTES`."""
    wrong = []
    for k in range(number):
        draw = np.random.default_rng([seed, sorted(BOMBS).index(kind), k])
        found = cost_of(*BOMBS[kind](draw))
        if not found.refused or found.seconds > LONGEST_S or found.memory_bytes > MAX_BYTES:
            wrong.append(
                f"{kind} {k}: {found.refused or 'not refused'}, {found.seconds:.2f} s, {found.memory_bytes / 1e6:.0f} MB"
            )
    return wrong
