"""Forecasts of many planned trips at once, Parquet in and Parquet out.

The input has one row for each link of a trip, in their order: `trip` and `vehicle_id`, the fields of a link (`length_m`,
`speed_m_s` and so on), and what is known at departure, the same in all rows of a trip. The output has one row a trip.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from tripwatt.errors import Fault, InvalidInput
from tripwatt.fleet.executors import map_bounded
from tripwatt.fleet.mapping import write_whole
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.storage import load_fleet
from tripwatt.routes import plan_from_route, route_from_links
from tripwatt.trips import LINK_COLUMNS, Departure, raise_faults
from tripwatt.trips.columns import Column, number_faults, scalar_faults

QUANTILES: Final = (0.05, 0.5, 0.95)
TRIPS_AT_ONCE: Final = 200
WRITE_IT: Final = "pandas writes one: pandas.read_csv('links.csv').to_parquet('links.parquet')"
ASSUMED: Final = frozenset({"usual_value_assumed", "soc_assumed"})
"""Codes of flags about a value of the departure that was not given."""

NAMES: Final = ("trip", "vehicle_id", "car_model", "driver")
KNOWN: Final = (
    "soc",
    "ambient_temperature_degc",
    "cabin_setpoint_degc",
    "cabin_temperature_degc",
    "battery_temperature_degc",
    "payload_mass_kg",
)


@dataclass(frozen=True, slots=True)
class BatchPart:
    """Some trips of a batch: the model's folder and the rows of their links."""

    model: str
    rows: tuple[dict[str, Any], ...]
    quantiles: tuple[float, ...]
    reserve: float


def forecast_batch(
    model: Path | str,
    source: Path | str,
    out: Path | str,
    executor: Executor,
    workers: int = 1,
    *,
    quantiles: Sequence[float] = QUANTILES,
    reserve: float = 0.0,
) -> int:
    """Forecast every trip of a Parquet file and write one row a trip. O(links).

    Parameters
    ----------
    model : path
        Folder of a model of a fleet, which every worker reaches.
    source, out : path
        Parquet files.
    executor : Executor
    workers : int
    quantiles : sequence of float
        Of the energy, in the columns `energy_wh_q05` and so on.
    reserve : float
        Displayed charge to arrive with, for `p_arrive`.

    Returns
    -------
    int
        Trips. One that cannot be forecast has the reason in `error` and no numbers. `assumed` names what was not known at
        departure, for which the usual value counts.

    Raises
    ------
    InvalidInput
        When a file cannot be read, a column is missing, or a quantile cannot be one.
    """
    inside = Column("1", 0.0, 1.0, "")
    faults = [fault for q in quantiles for fault in number_faults("quantiles", q, inside)]
    faults += [
        Fault("value out of range", "quantiles", f"{q:g}", "more than 0 and less than 1")
        for q in quantiles
        if q in (0.0, 1.0)
    ]
    faults += scalar_faults({"reserve": reserve})
    if reserve == 1.0:
        faults.append(Fault("value out of range", "reserve", "1", "0 or more and less than 1"))
    raise_faults(faults)
    try:
        file = pq.ParquetFile(source)
    except (OSError, pa.ArrowException) as error:
        got = (str(error).splitlines() or [type(error).__name__])[0][:160]
        raise InvalidInput.of(
            "unreadable Parquet file", f"{source}", got, "a Parquet file of links", WRITE_IT
        ) from error
    with file:
        names = set(file.schema_arrow.names)
        raise_faults(
            Fault("missing column", f"{source}", ", ".join(sorted(names))[:200], f"a column {name!r}")
            for name in ("trip", "vehicle_id", "length_m")
            if name not in names
        )
        columns = [n for n in (*NAMES, *KNOWN, *LINK_COLUMNS) if n in names]
        parts = [
            BatchPart(str(Path(model).absolute()), rows, tuple(quantiles), reserve)
            for rows in _parts(file, columns)
        ]
    load_fleet(model)  # a model that cannot be read is one fault, not one for each trip
    forecasts = [row for rows in map_bounded(executor, workers, forecast_part, parts) for row in rows]
    forecasts.sort(key=lambda row: (row["vehicle_id"], row["trip"]))
    write_whole(pa.Table.from_pylist(forecasts, schema=schema_of(quantiles)), Path(out))
    return len(forecasts)


def schema_of(quantiles: Sequence[float]) -> pa.Schema:
    """Columns of the output."""
    numbers = [
        "distance_m",
        "duration_s",
        "energy_wh",
        "sd_wh",
        *map(quantile_column, quantiles),
        "soc_arrival",
        "p_arrive",
    ]
    return pa.schema(
        [
            *(pa.field(name, pa.string()) for name in ("vehicle_id", "trip")),
            *(pa.field(name, pa.float64()) for name in numbers),
            pa.field("assumed", pa.string()),
            pa.field("error", pa.string()),
        ]
    )


def quantile_column(quantile: float) -> str:
    """Column of a quantile.

    Examples
    --------
    >>> quantile_column(0.05), quantile_column(0.975)
    ('energy_wh_q05', 'energy_wh_q97_5')
    """
    percent = f"{100.0 * quantile:g}"
    whole, _, rest = percent.partition(".")
    return f"energy_wh_q{whole.zfill(2)}" + (f"_{rest}" if rest else "")


def _parts(file: pq.ParquetFile, columns: list[str]) -> Iterator[tuple[dict[str, Any], ...]]:
    """Rows of whole trips, some trips at a time; the rows of a trip follow each other."""
    held: list[dict[str, Any]] = []
    trips = 0
    last: tuple[Any, Any] | None = None
    for batch in file.iter_batches(columns=columns):
        for row in batch.to_pylist():
            key = (row["vehicle_id"], row["trip"])
            if key != last:
                if trips == TRIPS_AT_ONCE:
                    yield tuple(held)
                    held, trips = [], 0
                trips += 1
                last = key
            held.append(row)
    if held:
        yield tuple(held)


@lru_cache(maxsize=2)
def _model(folder: str) -> FleetModel:
    return load_fleet(folder)


def forecast_part(part: BatchPart) -> list[dict[str, Any]]:
    """Rows of the output for some trips."""
    model = _model(part.model)
    by_trip: dict[tuple[Any, Any], list[dict[str, Any]]] = {}
    for row in part.rows:
        by_trip.setdefault((row["vehicle_id"], row["trip"]), []).append(row)
    return [_row(model, links, part) for links in by_trip.values()]


def _row(model: FleetModel, links: Sequence[Mapping[str, Any]], part: BatchPart) -> dict[str, Any]:
    first = links[0]
    name, vehicle = f"{first['trip']}", f"{first['vehicle_id']}"
    try:
        fields = [
            {n: v for n, v in link.items() if n in LINK_COLUMNS and v is not None and not math.isnan(v)}
            for link in links
        ]
        plan = plan_from_route(route_from_links(fields), trip_id=name)
        known = {n: first[n] for n in KNOWN if first.get(n) is not None and not math.isnan(first[n])}
        forecast = model.forecast(
            plan,
            Departure(**known),
            vehicle_id=vehicle,
            car_model=first.get("car_model"),
            driver=first.get("driver"),
        )
    except InvalidInput as error:
        return {"vehicle_id": vehicle, "trip": name, "error": f"{error}"}
    return {
        "vehicle_id": vehicle,
        "trip": name,
        "distance_m": plan.distance_m,
        "duration_s": plan.duration_s,
        "energy_wh": forecast.energy_wh,
        "sd_wh": forecast.sd_wh,
        **{quantile_column(q): forecast.quantile(q) for q in part.quantiles},
        "soc_arrival": forecast.soc_arrival,
        "p_arrive": forecast.p_arrive(part.reserve),
        "assumed": ", ".join(dict.fromkeys(f.subject for f in forecast.flags if f.code in ASSUMED)) or None,
        "error": None,
    }
