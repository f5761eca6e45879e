"""Senders that have the battery management's charge alone, as Torque: python -m benchmarks.managed_charge [--data FOLDER].

Each TUM trip is forecast by a model of other trips and updated after 70 % of its time: from the display, from the battery management's charge with
the display at departure, and from that charge alone. Printed are how far the charge at arrival is from the one that the display gives, how far from
what the display shows at arrival, and how many 90 % intervals hold it; with the relation of both charges fitted to the other trips, with the
window of the data sheet of a like car, and with none: the last two know nothing of the set.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from tools import DATA
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from benchmarks.need import models, trips_and_car
from tripwatt.arrays import FloatArray
from tripwatt.forecasting import Forecast
from tripwatt.trips import Trip
from tripwatt.uncertainty import ChargeScale
from tripwatt.vehicles.comparing import without_data

DRIVEN = 0.7
NEAR = 0.5
"""Points within which senders of one drive shall agree."""
MEASURED = ["time_s", "speed_m_s", "voltage_v", "current_a"]
SENT = {"display": True, "the display at departure": True, "no display": False}
"""What a sender has beside the battery management's charge -> whether the display at departure is known."""
SISTER = "bmw_i3_94ah"
"""A car whose window is from the maker's data sheet, for one whose window was never compared with logs."""
SCALES = ("fitted to other trips", "window of a data sheet", "no window")
CHARGES = ("soc", "displayed_soc")


def arrivals(forecast: Forecast, trip: Trip) -> FloatArray:
    """Charge at arrival and its 90 % interval, by what was sent, shape (3, 3)."""
    samples = trip.samples[
        trip.samples["time_s"] - trip.samples["time_s"].iloc[0] <= DRIVEN * trip.duration_s
    ]
    rows = []
    for what, known in SENT.items():
        column = "displayed_soc" if what == "display" else "soc"
        departure = forecast.plan.departure
        plan = replace(forecast.plan, departure=departure if known else replace(departure, soc=None))
        now = replace(forecast, drive=replace(forecast.drive, plan=plan)).update(samples[[*MEASURED, column]])
        rows.append((now.soc_arrival, *now.arrival.interval(0.9)))
    return np.array(rows)


def rows_of(found: FloatArray, shown: FloatArray, name: str) -> Iterator[Row]:
    """The figures of one scale, from arrivals of shape (trips, 3, 3) and the charge that the display shows at arrival."""
    for k, sent in enumerate(SENT):
        beside = 100.0 * np.abs(found[:, k, 0] - found[:, 0, 0])
        error = 100.0 * (found[:, k, 0] - shown)
        inside = (found[:, k, 1] <= shown) & (shown <= found[:, k, 2])
        what = f"{name}, {sent}, {len(shown)} trips"
        if k:
            yield Row(f"{what}: within {NEAR} points of that by the display", float((beside <= NEAR).mean()))
            yield Row(f"{what}: median distance to that", float(np.median(beside)), "points")
        yield Row(f"{what}: root mean square error at arrival", float(np.sqrt((error**2).mean())), "points")
        yield Row(f"{what}: coverage of the 90 % interval", float(inside.mean()))


def rows(data: Path) -> Iterator[Row]:
    """All figures."""
    trips, car = trips_and_car("tum", data)
    trips = [t for t in trips if all(np.isfinite(t.samples[name]).any() for name in CHARGES)]
    windows = tw.load_vehicle(SISTER).battery, without_data(car, "tum").battery
    found, shown = {fitted: list[FloatArray]() for fitted in SCALES}, list[float]()
    for members, model in models("tum", trips, car):
        for trip in (trips[k] for k in members):
            forecast = model.forecast(trip)
            published = [ChargeScale.from_published(w, forecast.drive.wh_per_soc) for w in windows]
            for name, scale in zip(SCALES, (forecast.charge, *published), strict=True):
                uncertainty = replace(forecast.uncertainty, charge=scale)
                found[name].append(arrivals(replace(forecast, uncertainty=uncertainty), trip))
            shown.append(float(trip.samples["displayed_soc"].dropna().iloc[-1]))
    for name in SCALES:
        yield from rows_of(np.array(found[name]), np.array(shown), name)


def main(data: Path = DATA) -> int:
    """Print the rows; they have no bounds."""
    return report(rows(data))


if __name__ == "__main__":
    run(main)
