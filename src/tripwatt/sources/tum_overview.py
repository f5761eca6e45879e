"""Context of the TUM trips from `Overview.xlsx`: season, weather, departure, set-point, payload, notes.

Only what is not in the logs is taken from the sheet. Its states of charge, distances and durations are partly wrong and
are never read.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from tripwatt.arrays import number_in
from tripwatt.containers import INSIDE, LIMITS, Budget
from tripwatt.errors import InvalidInput
from tripwatt.files import read_file
from tripwatt.sources.delimited import column_key
from tripwatt.sources.workbooks import read_workbook
from tripwatt.trips import Context, Flag

_MAX_SHEET_BYTES: Final = 1 << 26
"""Largest workbook [bytes], also when inflated; that of the data set has 25 kB."""
_MAX_ROWS, _MAX_COLUMNS = 10_000, 200


def read_overview(path: Path, trip_ids: Sequence[str]) -> tuple[dict[str, Context], list[Flag]]:
    """Read the context of each trip from the sheet; return contexts by trip id, and notes on the sheet.

    If the sheet or a trip in it is missing, there is a note, and season and weather are unknown.

    Raises
    ------
    InvalidInput
        When the sheet exists but cannot be read or has no column of trip ids.
    """
    if not path.exists():
        return {}, [Flag("sheet_missing", path.name)]
    rows: dict[str, Mapping[str, object]] = {}
    for row in _sheet_rows(path):
        match = re.fullmatch(r"trip([ab]\d{2,3})", _text(row.get("trip")), re.IGNORECASE)
        if match is not None:
            rows.setdefault(f"Trip{match[1].upper()}", row)
    contexts = {trip_id: _context(trip_id, rows[trip_id]) for trip_id in trip_ids if trip_id in rows}
    notes = []
    absent = [trip_id for trip_id in trip_ids if trip_id not in rows]
    if absent:
        notes.append(Flag("sheet_row_missing", ", ".join(absent), path.name))
    departures: dict[dt.datetime, str] = {}
    for trip_id, context in contexts.items():
        departure = context.started_at
        if departure is not None and departures.setdefault(departure, trip_id) != trip_id:
            notes.append(Flag("same_departure", f"{departures[departure]} and {trip_id}", path.name))
    return contexts, notes


def _sheet_rows(path: Path) -> list[Mapping[str, object]]:
    """Rows of the first sheet with a column `Trip`: cells by the `column_key` of their header without its unit."""
    fix = "fetch it again, or remove it to read the trips without season and weather"

    def rows_of(rows: Iterator[list[object]]) -> list[list[object]]:
        return [row[:_MAX_COLUMNS] for row in itertools.islice(rows, _MAX_ROWS)]

    data = read_file(path, _MAX_SHEET_BYTES)
    tables = read_workbook(data, rows_of, Budget(f"{path}", {**LIMITS, INSIDE: _MAX_SHEET_BYTES}), fix)
    for _, table in tables:
        for number, cells in enumerate(table[:10]):
            names = [re.sub(r"\s*\[.*", "", column_key(_text(cell))) for cell in cells]
            if "trip" in names:
                rows = (zip(names, row, strict=False) for row in table[number + 1 :])
                return [{name: cell for name, cell in row if name} for row in rows]
    got, allowed = "no header with a column 'Trip'", "one row per trip under the heading 'Trip'"
    raise InvalidInput.of("missing column", f"{path}", got, allowed, fix)


def _context(trip_id: str, row: Mapping[str, object]) -> Context:
    """The context of a trip; a cell that cannot be read counts as unknown."""
    remarks = "; ".join(t for t in (_text(row.get("fan")), _text(row.get("note"))) if t)
    masses = re.findall(r"\+\s*(\d+(?:[.,]\d+)?)\s*kg", remarks, re.IGNORECASE)
    setpoint = number_in(_text(row.get("target cabin temperature")).replace(",", "."))
    return Context(
        season={"A": "summer", "B": "winter"}[trip_id[4]],  # the two measurement campaigns
        weather=_text(row.get("weather")).lower() or None,
        started_at=_departure(row.get("date")),
        route=_text(row.get("route/area")) or None,
        # 10 to 40 °C is what a car's climate control offers, with a margin
        cabin_setpoint_degc=setpoint if 10.0 <= setpoint <= 40.0 else None,
        payload_mass_kg=sum((float(mass.replace(",", ".")) for mass in masses), start=0.0),
        follows_trip="directly after previous trip" in remarks.lower(),
        remarks=remarks,
    )


def _departure(cell: object) -> dt.datetime | None:
    if isinstance(cell, dt.datetime):
        return cell.replace(tzinfo=None)
    # 2019-06-25_13-21-14 and 2019_12_08_09-38-26 both occur
    with contextlib.suppress(ValueError):
        return dt.datetime.strptime(re.sub(r"[^0-9]+", "-", _text(cell)), "%Y-%m-%d-%H-%M-%S")
    return None


def _text(cell: object) -> str:
    return "" if cell is None else " ".join(str(cell).split())
