"""Forecasts of many planned trips at once, from one Parquet file to another.

The input has one row for each link of a trip, in the order of the links: `trip` and `vehicle_id`, the fields of a link (`length_m`,
`speed_m_s` and so on), and what is known at departure, the same in all rows of a trip. The output has one row per trip, in the
order of the input. Trips are read and written in parts, so that memory does not grow with their number. A finished part is a
file whose name is a digest of everything that the part depends on: a batch that was stopped keeps its finished parts.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from tripwatt.errors import Fault, InvalidInput
from tripwatt.files import open_regular
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.mapping import write_parquet
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.storage import load_fleet
from tripwatt.modelfile import METADATA
from tripwatt.routes import route_from_links
from tripwatt.trips import LINK_COLUMNS, TEMPERATURES, Departure, Flag, raise_faults
from tripwatt.trips.columns import Column, number_faults, scalar_faults
from tripwatt.trips.messages import message

VERSION: Final = 1
"""Number to raise whenever the forecasts of the same trips by the same model change."""

QUANTILES: Final = (0.05, 0.5, 0.95)
TRIPS_PER_PART: Final = 50
"""A choice, because the forecasts of a part take long compared with sending it, and are quickly repeated after a crash."""
_PARTS_PER_ROW_GROUP: Final = 100
"""Number of finished parts in one row group of the output: a choice, because 5,000 rows compress well and need little memory."""

_HOW_TO_WRITE: Final = "pandas writes one: pandas.read_csv('links.csv').to_parquet('links.parquet')"
_ASSUMED: Final = frozenset({"usual_value_assumed", "soc_assumed"})
"""Codes of flags about a value of the departure that was not given."""

_NAME_COLUMNS: Final = ("trip", "vehicle_id", "car_model", "driver")
DEPARTURE_COLUMNS: Final = ("soc", *TEMPERATURES, "payload_mass_kg")
"""Columns of a table of planned trips with what is known at departure."""


@dataclass(frozen=True, slots=True)
class _BatchPart:
    """Some trips of a batch.

    Attributes
    ----------
    model : str
        Folder of the model.
    digest : str
        Digest of the model.
    quantiles : tuple of float
    reserve : float
    rows : bytes
        Rows of the links as an Arrow stream.
    """

    model: str
    digest: str
    quantiles: tuple[float, ...]
    reserve: float
    rows: bytes = b""

    @property
    def name(self) -> str:
        """Digest of everything that the forecasts depend on."""
        settings = json.dumps([VERSION, version("tripwatt"), self.digest, self.quantiles, self.reserve])
        return hashlib.sha256(settings.encode() + self.rows).hexdigest()[:32]


def forecast_batch(
    model: Path | str,
    source: Path | str,
    out: Path | str,
    workers: Workers,
    *,
    quantiles: Sequence[float] = QUANTILES,
    reserve: float = 0.1,
) -> int:
    """Forecast every trip of a Parquet file and write one row per trip. O(links), in memory that does not grow with the links.

    Finished parts are kept in the folder ``OUT.unfinished``. If a batch was stopped, repeating it continues from these parts.

    Parameters
    ----------
    model : path
        Folder of a model of a fleet, which every worker can reach.
    source, out : path
        Parquet files.
    workers : Workers
    quantiles : sequence of float
        Quantiles of the energy, in the columns `energy_wh_q05` and so on, and of the displayed charge at arrival, in
        `soc_arrival_q05` and so on.
    reserve : float
        Displayed charge to arrive with, for `p_arrive`.

    Returns
    -------
    int
        Number of trips.

    Raises
    ------
    InvalidInput
        If a file cannot be read, a column is missing, or a quantile or the reserve is out of range.

    Notes
    -----
    In the output, a trip that cannot be forecast has the reason in `error` and no numbers. `flags` has the codes of what was assumed
    or limits the forecast, and `reasons` the same as sentences. `assumed` names the values that were not known at departure, for
    which the usual value was taken.
    """
    _check_settings(quantiles, reserve)
    with _open_parquet(source) as file:
        _used_columns(file, source)  # what is missing is one fault before any work
        folder, unfinished = Path(model).absolute(), Path(f"{out}.unfinished")
        load_fleet(folder)  # a model that cannot be read is one fault, not one for each trip
        digest = hashlib.sha256((folder / METADATA).read_bytes()).hexdigest()
        empty_part = _BatchPart(str(folder), digest, tuple(quantiles), reserve)
        unfinished.mkdir(exist_ok=True)
        names: list[str] = []

        def unfinished_parts() -> Iterator[_BatchPart]:
            for table in _split_into_parts(_read_batches(file, source)):
                part = replace(empty_part, rows=_to_arrow_stream(table))
                names.append(part.name)
                if not (unfinished / part.name).is_file():
                    yield part

        for name, forecasts in workers.map(_forecast_part, unfinished_parts()):
            write_parquet(unfinished / name, [forecasts], forecasts.schema)
    groups = (names[k : k + _PARTS_PER_ROW_GROUP] for k in range(0, len(names), _PARTS_PER_ROW_GROUP))
    tables = (pa.concat_tables([pq.read_table(unfinished / name) for name in group]) for group in groups)
    write_parquet(Path(out), tables, output_schema(quantiles))
    shutil.rmtree(unfinished)
    return int(pq.read_metadata(out).num_rows)


def _check_settings(quantiles: Sequence[float], reserve: float) -> None:
    """Raise `InvalidInput` unless all quantiles are above 0 and below 1, and the reserve is 0 or more and below 1."""
    between_0_and_1 = Column("1", 0.0, 1.0, "")
    faults = [fault for q in quantiles for fault in number_faults("quantiles", q, between_0_and_1)]
    inside = "more than 0 and less than 1"
    faults += [Fault("value out of range", "quantiles", f"{q:g}", inside) for q in quantiles if q in (0, 1)]
    faults += scalar_faults({"reserve": reserve})
    if reserve == 1.0:
        faults.append(Fault("value out of range", "reserve", "1", "0 or more and less than 1"))
    raise_faults(faults)


def _open_parquet(source: Path | str) -> pq.ParquetFile:
    with _parquet_errors(f"{source}"):
        open_regular(Path(source)).close()
        return pq.ParquetFile(source, pre_buffer=False)  # a buffer would keep every byte that was read


@contextmanager
def _parquet_errors(where: str) -> Iterator[None]:
    """Turn errors of the Parquet reader into `InvalidInput`."""
    try:
        yield
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        got = (str(error).splitlines() or [type(error).__name__])[0][:160]
        raise InvalidInput.of(
            "unreadable Parquet file", where, got, "a Parquet file of links", _HOW_TO_WRITE
        ) from error


def _read_batches(file: pq.ParquetFile, source: Path | str) -> Iterator[pa.RecordBatch]:
    """Read the columns of the input that are used, some rows at a time."""
    with _parquet_errors(f"{source}"):
        yield from file.iter_batches(columns=_used_columns(file, source))


def _used_columns(file: pq.ParquetFile, source: Path | str) -> list[str]:
    """Return the columns of the input that are used; raise `InvalidInput` if a required column is missing."""
    names = set(file.schema_arrow.names)
    raise_faults(
        Fault("missing column", f"{source}", ", ".join(sorted(names))[:200], f"a column {name!r}")
        for name in ("trip", "vehicle_id", "length_m")
        if name not in names
    )
    return [name for name in (*_NAME_COLUMNS, *DEPARTURE_COLUMNS, *LINK_COLUMNS) if name in names]


def _to_arrow_stream(table: pa.Table) -> bytes:
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())


def output_schema(quantiles: Sequence[float]) -> pa.Schema:
    """Return the schema of the output."""
    energies, charges = ([quantile_column(q, of) for q in quantiles] for of in ("energy_wh", "soc_arrival"))
    numbers = "distance_m", "duration_s", "energy_wh", "sd_wh", *energies, "soc_arrival", *charges, "p_arrive"
    types = dict.fromkeys(("vehicle_id", "trip"), pa.string()) | dict.fromkeys(numbers, pa.float64())
    types["flags"] = pa.list_(pa.string())
    return pa.schema(types | dict.fromkeys(("assumed", "reasons", "error"), pa.string()))


def quantile_column(quantile: float, quantity: str = "energy_wh") -> str:
    """Return the name of the column of a quantile.

    Examples
    --------
    >>> quantile_column(0.05), quantile_column(0.975, "soc_arrival")
    ('energy_wh_q05', 'soc_arrival_q97_5')
    """
    percent = f"{100.0 * quantile:g}"
    integer, _, decimals = percent.partition(".")
    return f"{quantity}_q{integer.zfill(2)}" + (f"_{decimals}" if decimals else "")


def _split_into_parts(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.Table]:
    """Yield tables of `TRIPS_PER_PART` whole trips, at the end the rest, from batches in which the rows of a trip follow each other."""
    remaining: list[pa.RecordBatch] = []
    for batch in batches:
        table = pa.Table.from_batches([*remaining, batch])
        # the trips from the last cut on may go on in the next rows
        *cuts, last = _trip_starts(table)[::TRIPS_PER_PART]
        yield from (table.slice(a, b - a).combine_chunks() for a, b in pairwise([*cuts, last]))
        remaining = table.slice(last).to_batches()
    if remaining:
        yield pa.Table.from_batches(remaining).combine_chunks()


def _trip_starts(table: pa.Table) -> list[int]:
    """Return the numbers of the rows at which a trip begins."""
    keys = [table[name].to_numpy() for name in ("vehicle_id", "trip")]
    differs = np.logical_or.reduce([key[1:] != key[:-1] for key in keys])
    return [0, *(np.flatnonzero(differs) + 1).tolist()] if len(table) else []


@lru_cache(maxsize=2)
def _load_model(folder: str, digest: str) -> FleetModel:
    return load_fleet(folder)


def _forecast_part(part: _BatchPart) -> tuple[str, pa.Table]:
    """Forecast the trips of a part, and return its name and the rows of the output."""
    model = _load_model(part.model, part.digest)
    table = pa.ipc.open_stream(part.rows).read_all()
    for i, field in enumerate(table.schema):
        if pa.types.is_floating(field.type):  # NaN, as pandas writes it, is a value that is not known
            table = table.set_column(i, field, pc.if_else(pc.is_nan(table[i]), None, table[i]))
    rows, starts = table.to_pylist(), _trip_starts(table)
    forecasts = [_forecast_row(model, rows[a:b], part) for a, b in pairwise([*starts, len(rows)])]
    return part.name, pa.Table.from_pylist(forecasts, schema=output_schema(part.quantiles))


def _forecast_row(model: FleetModel, links: Sequence[Mapping[str, Any]], part: _BatchPart) -> dict[str, Any]:
    """Forecast one trip from its links; return its row of the output, or a row with the reason in `error`."""
    first = links[0]
    trip_id, vehicle = f"{first['trip']}", f"{first['vehicle_id']}"
    try:
        fields = [{n: v for n, v in link.items() if n in LINK_COLUMNS and v is not None} for link in links]
        plan = route_from_links(fields).plan(trip_id=trip_id)
        departure = Departure(**{name: first.get(name) for name in DEPARTURE_COLUMNS})
        named = {name: first.get(name) for name in ("car_model", "driver")}
        forecast = model.forecast(plan, departure, vehicle_id=vehicle, **named)
    except InvalidInput as error:
        return {"vehicle_id": vehicle, "trip": trip_id, "error": f"{error}"}
    columns = [quantile_column(q, name) for name in ("energy_wh", "soc_arrival") for q in part.quantiles]
    return {
        "vehicle_id": vehicle,
        "trip": trip_id,
        "distance_m": plan.distance_m,
        "duration_s": plan.duration_s,
        "energy_wh": forecast.energy_wh,
        "sd_wh": forecast.sd_wh,
        **dict(zip(columns, np.concatenate(forecast.along.quantiles(part.quantiles)), strict=True)),
        "soc_arrival": forecast.soc_arrival,
        "p_arrive": forecast.p_arrive(part.reserve),
        **flag_columns(forecast.flags),
    }


def flag_columns(flags: Iterable[Flag]) -> dict[str, Any]:
    """Return flags as columns: their codes in `flags`, their sentences in `reasons`, the departure fields not given in `assumed`.

    Examples
    --------
    >>> flag_columns([Flag("soc_assumed", "soc", 0.8, "1")])["assumed"]
    'soc'
    """
    unique = list(dict.fromkeys(flags))
    return {
        "flags": list(dict.fromkeys(flag.code for flag in unique)),
        "assumed": ", ".join(dict.fromkeys(flag.subject for flag in unique if flag.code in _ASSUMED)) or None,
        "reasons": "; ".join(dict.fromkeys(message(flag).replace("; ", ", ") for flag in unique)) or None,
    }
