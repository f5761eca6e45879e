"""Many drives at once: samples a second, ten thousand half-hours, a sweep, and the car of a fold identified from its trips.

Run: ``python -m benchmarks.batch``. The identification needs TRIPWATT_DATA.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pandas as pd

import tripwatt as tw
from benchmarks.measure import Row, not_measured, report, seconds, tum_folder
from tripwatt.hybrid import identify, stage_record
from tripwatt.physics import simulate_trip
from tripwatt.physics.batch import trip_totals
from tripwatt.study.evaluation.forecast_data import ForecastData

SAMPLES = 1800
DRIVES = 500
MANY = 10_000


def drives(number: int, *, degc: float | None = 20.0, seed: int = 0) -> list[tw.Plan]:
    """Half-hours of driving at 1 Hz in air of a temperature, or without one from -10 to 35 °C."""
    rng = np.random.default_rng(seed)
    plans = []
    for k in range(number):
        speed = np.clip(15.0 + np.cumsum(rng.normal(0.0, 0.6, SAMPLES)), 0.0, 36.0)
        samples = pd.DataFrame({"time_s": np.arange(float(SAMPLES)), "speed_m_s": speed})
        ambient = float(rng.uniform(-10.0, 35.0)) if degc is None else degc
        known = tw.Departure(soc=0.8, ambient_temperature_degc=ambient)
        plans.append(tw.Plan.from_trace(f"drive {k}", samples, known))
    return plans


def speeds() -> Iterator[Row]:
    """Samples a second, with climate control and battery, beside single calls."""
    car = tw.load_vehicle("bmw_i3_60ah")
    for air, degc in (("20 °C", 20.0), ("-10 to 35 °C", None)):
        plans = drives(DRIVES, degc=degc)
        million = DRIVES * SAMPLES / 1e6
        one = million / seconds(lambda p=plans: [simulate_trip(car, plan) for plan in p])
        many = million / seconds(lambda p=plans: trip_totals((car, plan) for plan in p))
        yield Row(
            f"simulate half-hours side by side, {air}",
            many,
            "M samples/s",
            least=5.0,
            note=f"single calls {one:.3g}",
        )
    plans = drives(DRIVES)
    times = MANY // DRIVES
    taken = seconds(lambda: tw.sweep((plan for _ in range(times) for plan in plans), car), runs=3)
    yield Row(f"simulate {MANY:,} half-hours, a table", taken, "s", most=4.0)
    masses = np.linspace(1000.0, 1500.0, 1000).tolist()
    yield Row(
        f"sweep {len(masses):,} masses of a half-hour",
        seconds(lambda: tw.sweep(plans[0], car, {"mass": masses}), 3),
        "s",
    )


def identification() -> Iterator[Row]:
    """The car of a fold, as the signals of its trips show it."""
    folder = tum_folder()
    if folder is None:
        yield not_measured("identify the car of a fold")
        return
    car, trips = tw.load_vehicle("bmw_i3_60ah"), tw.read_trips(folder)
    made = seconds(lambda: identify([stage_record(trip, car) for trip in trips], car), 3)
    yield Row(f"collect the signals of {len(trips)} trips and identify the car", made, "s")
    data = ForecastData.from_trips(trips, car)
    every = np.arange(len(trips))
    folds = [np.flatnonzero(every % 13 != fold) for fold in range(13)]
    one = seconds(lambda: data.identified(folds[:1]), 3)
    yield Row("identify the car of a fold and simulate its trips", one, "s", most=0.8)
    yield Row("the same for 13 folds", seconds(lambda: data.identified(folds), 3), "s")


def rows() -> Iterator[Row]:
    """All rows, as they are measured."""
    yield from speeds()
    yield from identification()


if __name__ == "__main__":
    sys.exit(report(rows()))
