"""What a few own trips teach: `python -m benchmarks.few_trips [--cars 100] [--write]`.

Synthetic cars of the middle class whose values are not the published ones (`benchmarks.worlds`) forecast ten further trips
without trips of their own and with 5, 10 and 20. Prints the error, that of the same number of trips as a constant Wh/km and of a
transfer without physics, the share inside of the 90 % interval and its width over the energy. The transfer without physics is a
regression of the energy of the BMW i3 on distance, time in cold and hot air, speed and accelerations (TRIPWATT_DATA; of synthetic
trips of the i3 where that folder is missing), times a ratio of the cars: that of their masses, and with own trips what these say
besides.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from joblib import Parallel, delayed
from tools import DATA
from tools.command import run
from tools.docs import pages

import tripwatt as tw
from benchmarks.long_trips import scored
from benchmarks.worlds import LEVELS, WORLDS, Row, changed, table
from tripwatt.hybrid import EnergyRegression, build_table
from tripwatt.population import for_car
from tripwatt.sources import read_logs
from tripwatt.study.evaluation.table_models import SIX
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip
from tripwatt.vehicles import Vehicle, load_vehicle

CAR = "vw_id3"
DONOR = "bmw_i3_60ah"
RATIO_SD = 0.2
"""Prior standard deviation of the logarithm of the ratio of two cars' energies beyond that of their masses: certified consumption of cars of
one mass spreads by about this."""
TRIP_SD = 0.12
"""Of a trip about the regression, as on the i3's own trips."""
OWN = (0, 5, 10, 20)
ASKED = 10
COVERAGE = (0.86, 0.95)
WIDTHS = {0: 0.45, 10: 0.30}


def constant(own: Sequence[Trip], asked: Sequence[Trip]) -> np.ndarray:
    """Error of the energy of a kilometre of own trips, relative to each energy."""
    energy = sum(trip.observed_energy_wh or 0.0 for trip in own)
    rate = energy / sum(trip.distance_m for trip in own)
    return np.array([rate * trip.distance_m / (trip.observed_energy_wh or np.nan) - 1.0 for trip in asked])


def donor_regression() -> EnergyRegression:
    """Energy of the donor's trips on six totals of a trip."""
    folder = DATA / "tum"
    trips = read_logs(folder).reference_trips() if folder.is_dir() else synthetic_fleet().trips
    return EnergyRegression(SIX).fit(build_table(trips, {"physics": load_vehicle(DONOR)}))


def without_physics(
    regression: EnergyRegression, own: Sequence[Trip], asked: Sequence[Trip], car: Vehicle
) -> np.ndarray:
    """Error of the donor's energy times a ratio of the cars that own trips inform, relative to each energy."""
    table = build_table([*own, *asked], {"physics": car})
    last = table.last_rows
    logs = np.log(regression.predict(table)[last] / table.observed_wh[last])  # forecast over observed
    mass = np.log(car.body.test_mass_kg / load_vehicle(DONOR).body.test_mass_kg)
    precision = len(own) / TRIP_SD**2 + 1.0 / RATIO_SD**2
    ratio = (-logs[: len(own)].sum() / TRIP_SD**2 + mass / RATIO_SD**2) / precision
    return np.asarray(np.exp(logs[len(own) :] + ratio) - 1.0)


def of_car(world: str, seed: int, base: tw.ForecastModel, regression: EnergyRegression) -> list[np.ndarray]:
    """Scores of one car for each number of own trips: of the model as `scored`, of the constant, and of the transfer without physics."""
    book = tw.load_vehicle(CAR)
    rng = np.random.default_rng(seed)
    true = changed(book, WORLDS[world][1](rng))
    trips = synthetic_fleet(max(OWN) + ASKED, 30_000 + seed, vehicle=true).trips
    order = rng.permutation(len(trips))  # days have a driver and a weather of their own
    own, asked = ([trips[i] for i in part] for part in (order[ASKED:], order[:ASKED]))
    errors = []
    for k in OWN:
        model = tw.adapt(base, own[:k], book) if k else for_car(base, book)
        rate = constant(own[:k], asked) if k else np.full(ASKED, np.nan)
        other = without_physics(regression, own[:k], asked, book)
        errors.append(np.column_stack([scored(model, asked), rate, other]))
    return errors


def line(k: int, rows: np.ndarray) -> bool:
    """Print what the models make of so many own trips; whether the bars are met."""
    ours, constant_rate, other = np.abs(rows[:, [0, -2, -1]]).mean(axis=0)
    inside, width = rows[:, len(LEVELS)].mean(), rows[:, len(LEVELS) + 1].mean()
    met = (
        COVERAGE[0] <= inside <= COVERAGE[1]
        and width <= WIDTHS.get(k, np.inf)
        and not (ours > constant_rate or ours > other)
    )
    print(
        f"{k} own trips: error {ours:.1%}, constant {constant_rate:.1%}, without physics {other:.1%}, inside 90 %: "
        f"{inside:.1%}, width {width:.1%} of the energy, {len(rows)} trips; {'met' if met else 'missed'}",
        flush=True,
    )
    return bool(met)


def main(cars: int = 100, jobs: int = 2, world: str = "published", write: bool = False) -> int:
    """A line for each number of own trips; 1 when a bar is missed. `--write` renews docs/reference/synthetic.md, with all worlds."""
    base, regression = tw.load_model(), donor_regression()
    every_met, shown = True, []
    for name in WORLDS if write else (world,):
        print(f"{name}: {WORLDS[name][0]}", flush=True)
        every = Parallel(n_jobs=jobs)(delayed(of_car)(name, seed, base, regression) for seed in range(cars))
        for i, k in enumerate(OWN):
            of_k = [car[i] for car in every]
            every_met &= line(k, np.concatenate(of_k))
            shown.append(Row.of(name, f"{k} own trips" if k else "published values", of_k))
    if write:
        pages.renew("reference/synthetic.md", "few-trips", table(shown))
    return int(not write and not every_met)


if __name__ == "__main__":
    run(main)
