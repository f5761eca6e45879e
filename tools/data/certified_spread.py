"""How far cars of the library are from certified consumption, as spreads of a population: `python -m tools.data.certified_spread`.

Two figures. *Consumption*: published WLTP consumption of cars whose anchors rest on the EPA's city and highway rows alone; *everything* is what the other factors leave of it. *Tilt*: how the error
without an anchor differs between city and highway; as one factor on the assumed spreads of all causes, since two rows of a car do not tell them
apart. No log takes part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from benchmarks.anchors import level_of, unanchored
from benchmarks.six_numbers import BOTH, listed

from tools.command import run
from tools.data.anchoring import certified_figures
from tripwatt.arrays import FloatArray
from tripwatt.certification.consumption import CertifiedFigure, relative_error, schedule, wltp_test_mass
from tripwatt.hybrid.factors import EVERYTHING, FACTORS, NAMES, factor_power
from tripwatt.hybrid.segments import segment_table
from tripwatt.physics import simulate_trip
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_names
from tripwatt.vehicles.anchors import REPEAT_SD, anchors

KWH_PER_100_KM = 10.0
ONE_MODEL_SD = 0.08
"""Of the consumption of four vehicles of one model on the road."""


@dataclass(frozen=True, slots=True)
class Spread:
    """A spread between car models, and the number of models that it rests on."""

    value: float
    models: int


def without_anchor() -> list[tuple[Vehicle, float]]:
    """Cars with a published WLTP consumption that no value of theirs rests on, and the relative error of the simulation."""
    cars = []
    for name, description in BOTH.items():
        car = load_vehicle(name)
        mass_kg = wltp_test_mass(car.body.curb_mass_kg + car.body.driver_mass_kg)
        figure = CertifiedFigure("wltc", listed(description)[1] * KWH_PER_100_KM, True, mass_kg, "")
        if not any(figure.cycle == "wltc" for figure in certified_figures(name, car)):
            cars.append((car, relative_error(car, figure)))
    return cars


def consumption() -> Spread:
    """Standard deviation of simulated over published WLTP consumption, without the scatter of a test."""
    errors = [error for _, error in without_anchor()]
    return Spread(max(float(np.var(errors, ddof=1)) - REPEAT_SD**2, 0.0) ** 0.5, len(errors))


def left_for_everything(total_sd: float, level: str) -> float:
    """What the other factors leave of a spread of the WLTP consumption, between "models" or "vehicles"."""
    factor_sds = np.array([getattr(factor, level) / factor.sd for factor in FACTORS])
    factor_sds[NAMES.index(EVERYTHING)] = 0.0
    causes = [schedule_factors(car, "wltc") * factor_sds for car, _ in without_anchor()]
    return float(np.sqrt(max(total_sd**2 - float(np.mean(np.sum(np.square(causes), axis=1))), 0.0)))


def schedule_factors(car: Vehicle, cycle: str) -> FloatArray:
    """Energy by one usual standard deviation of each factor over that of a schedule, shape (factors,)."""
    time, speed = schedule(cycle)
    samples = pd.DataFrame(
        {"time_s": time, "speed_m_s": speed, "ambient_temperature_degc": 23.0, "elevation_m": 0.0}
    )
    plan = Plan.from_trip(Trip.from_samples(cycle, samples)).with_departure(
        Departure(climate="off", warmth=1.0)
    )
    table = segment_table(plan, simulate_trip(car, plan))
    energy = factor_power(table, car.body.test_mass_kg).T @ table.hours
    return np.asarray(energy / float(table.simulated_w @ table.hours))


def tilt() -> Spread:
    """What the assumed spreads of the causes are multiplied with, so that city and highway differ as much as they do."""
    contrasts, expected = [], []
    for name in vehicle_names():
        if name not in anchors() or level_of(name) != "road_load":
            continue
        car = unanchored(name)
        by_cycle = {
            cycle: [
                relative_error(car, f)
                for f in certified_figures(name, car)
                if f.cycle == cycle and not f.outlier
            ]
            for cycle in ("udds", "hwfet")
        }
        if not all(by_cycle.values()):
            continue
        contrasts.append(np.mean(by_cycle["udds"]) - np.mean(by_cycle["hwfet"]))
        causes = schedule_factors(car, "udds") - schedule_factors(car, "hwfet")
        causes[NAMES.index(EVERYTHING)] = 0.0
        expected.append(float(causes @ causes))
    square = max(float(np.var(contrasts, ddof=1)) - 2.0 * REPEAT_SD**2, 0.0)
    return Spread(float(np.sqrt(square / np.mean(expected))), len(contrasts))


def main() -> None:
    """Print all of them."""
    tilted, models = tilt(), consumption()
    print(f"consumption between car models: {models.value:.3f} of {models.models} models")
    print(f"tilt over the assumed spreads: {tilted.value:.3f} of {tilted.models} models")
    for level, total_sd in (("models", models.value), ("vehicles", ONE_MODEL_SD)):
        print(f"everything between {level}: {left_for_everything(total_sd, level):.3f} of {total_sd:.3f}")


if __name__ == "__main__":
    run(main)
