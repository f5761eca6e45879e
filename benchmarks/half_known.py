"""Trips whose energy is only half known: python -m benchmarks.half_known [--data FOLDER] [--splits N].

The TUM trips are written as two poor loggers would have them: one with the state of charge in whole percent and no power, one with the
power in whole kilowatts every 5 s. A model is fitted on 40 trips of each and forecasts the other 18, in six seeded splits. Printed are the error and the
coverage of the 90 % interval against the energy that was measured in full, and the standard deviation of the measured energies in
units of the one that the trips carry.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from tools import DATA
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.arrays import FloatArray
from tripwatt.sources.tum import REFERENCE_TRIPS
from tripwatt.study.evaluation.metrics import absolute_percentage_error
from tripwatt.trips import Trip

VEHICLE = "bmw_i3_60ah"
FITTED = 40
SPLITS = 6
GROSS_KWH = 21.6
"""Of the maker's data sheet: a driver knows no better one."""
PERIOD_S = {"soc": 1.0, "power": 5.0}
ERROR = 0.075
COVERAGE = 0.85

_COLUMNS = {
    "time_s": "s",
    "speed_m_s": "m/s",
    "elevation_m": "m",
    "ambient_temperature_degc": "degC",
    "cabin_temperature_degc": "degC",
    "battery_temperature_degc": "degC",
}
_MEASURED = {
    "soc": (
        'soc = { column = "soc", unit = "%" }',
        f'usable_capacity_kwh = {GROSS_KWH}\nvehicle = "{VEHICLE}"',
    ),
    "power": ('battery_power_w = { column = "power", unit = "kW" }', "nominal_voltage_v = 360"),
}


def logged(trip: Trip, what: str) -> pd.DataFrame:
    """The table of a poor logger of "soc" or "power": samples now and then, rounded."""
    time = trip.array("time_s")
    at = np.arange(time[0], time[-1], PERIOD_S[what])
    rows = np.searchsorted(time, at)
    table = {name: trip.array(name)[rows] for name in _COLUMNS if name in trip}
    if what == "soc":
        table["soc"] = np.round(100.0 * trip.array("soc")[rows])
    else:
        table["power"] = np.round((trip.array("voltage_v") * trip.array("current_a"))[rows] / 1000.0)
    return pd.DataFrame(table)


def half_known(trips: Sequence[Trip], what: str) -> list[Trip]:
    """The trips of a poor logger, through the reader of tables and the audit."""
    columns = [f'{name} = {{ column = "{name}", unit = "{unit}" }}' for name, unit in _COLUMNS.items()]
    column, battery = _MEASURED[what]
    with tempfile.TemporaryDirectory() as place:
        for trip in trips:
            logged(trip, what).to_csv(Path(place) / f"{trip.trip_id}.csv", index=False)
        mapping = Path(place) / "logger.toml"
        mapping.write_text(
            "\n".join(["[columns]", *columns, column, "[battery]", battery, ""]), encoding="utf-8"
        )
        return list(tw.read_trips(Path(place), "table", mapping))


def forecast_split(
    true: Mapping[str, float],
    logged_trips: Mapping[str, Trip],
    seed: int,
    fitted: int = FITTED,
    corrector: str = "split",
) -> FloatArray:
    """Energy, forecast and 90 % interval of the trips that were not fitted on [Wh], shape (trips, 4)."""
    order = np.random.default_rng(seed).permutation(sorted(true))
    known, asked = (
        [logged_trips[name] for name in part if name in logged_trips]
        for part in (order[:fitted], order[fitted:])
    )
    model = tw.ForecastModel(tw.load_vehicle(VEHICLE), corrector, seed).fit(known)
    forecasts = [model.forecast(trip) for trip in asked]
    rows = [(true[t.trip_id], f.energy_wh, *f.interval(0.9)) for t, f in zip(asked, forecasts, strict=True)]
    return np.array(rows)


def rows_of(trips: Sequence[Trip], what: str, splits: int) -> Iterator[Row]:
    """All rows of one logger."""
    true = {trip.trip_id: float(trip.observed_energy_wh or np.nan) for trip in trips}
    half = {trip.trip_id: trip for trip in half_known(trips, what)}
    rows = np.concatenate([forecast_split(true, half, seed) for seed in range(splits)])
    energy, forecast, low, high = rows.T
    name = f"{what}, {FITTED} trips fitted, {len(rows)} forecasts of {splits} splits"
    yield Row(f"{name}: mean error", float(absolute_percentage_error(energy, forecast).mean()), most=ERROR)
    inside = (low <= energy) & (energy <= high)
    yield Row(f"{name}: coverage of the 90 % interval", float(inside.mean()), least=COVERAGE)
    width = float((high - low).sum() / energy.sum())
    yield Row(f"{name}: width of the 90 % interval over the energy", width)
    error = np.array([(t.observed_energy_wh or np.nan) - true[name] for name, t in half.items()])
    carried = np.array([t.observed_energy_std_wh or np.nan for t in half.values()])
    yield Row(f"{name}: median standard error [Wh]", float(np.nanmedian(carried)))
    yield Row(f"{name}: errors in units of it", float(np.sqrt(np.nanmean((error / carried) ** 2))))


def rows(splits: int = SPLITS) -> Iterator[Row]:
    """All rows."""
    trips = [
        t for t in tw.read_trips(DATA / "tum", "tum") if t.trip_id in REFERENCE_TRIPS and t.observed_energy_wh
    ]
    for what in PERIOD_S:
        yield from rows_of(trips, what, splits)


def main(splits: int = SPLITS) -> int:
    """Print the rows of so many random splits; 1 when a bound is missed."""
    return report(rows(splits))


if __name__ == "__main__":
    run(main)
