"""The fixed probe: what the code computes for 20 built-in trips with five cars, as numbers of six digits.

A published result rests on this code. It names the probe that it was made with (`tools/docs/make_results.py`), so that a change of a
constant is seen in the probe and a change of a name is not. Nothing here takes a tree, whose splits may turn over on noise.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np

import tripwatt as tw
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.hybrid import identify, segment_trips, stage_record
from tripwatt.hybrid.power import CLIMATE_TERMS, DRIVE_TERMS, GPCorrector, SplitCorrector
from tripwatt.physics import simulate_trip
from tripwatt.population import for_car
from tripwatt.routes import plan_on_links
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Departure, Plan, PlanWeather, Trip
from tripwatt.vehicles import Vehicle, load_vehicle

CARS: Final = (
    "bmw_i3_60ah",
    "nissan_leaf_24",
    "tesla_model_3_lr",
    "renault_zoe_ze50_r135",
    "audi_e_tron_55",
)
"""The first is fitted, the others take its model over. Heater and heat pump, magnets, external excitation and induction, two axles."""
SHORT, LONG, LONG_H = 14, 6, (0.4, 0.7)
AMBIENT_DEGC: Final = (-15.0, 38.0)
SEED: Final = 33
OWN_TRIPS: Final = 5
LINK_M: Final = 250.0
SLOPE: Final = 0.05
TOLERANCE: Final = 1e-5
"""Relative; rounding to six digits is half of it."""
FLOOR: Final = 1e-6
"""Absolute, for numbers about zero."""

ON_THE_WAY: Final = "forecast on the way"

Probe = dict[str, list[list[float]]]


@cache
def trips() -> tuple[Trip, ...]:
    """The trips of the fit: short ones, and some on motorways."""
    return (*synthetic_fleet(SHORT, SEED).trips, *synthetic_fleet(LONG, SEED, hours=LONG_H).trips)


def plans() -> list[Plan]:
    """The same drives in all weathers, up and down, in wind and rain, full and low, with much and little known."""
    drives = []
    for k, (trip, ambient) in enumerate(zip(trips(), np.linspace(*AMBIENT_DEGC, SHORT + LONG), strict=True)):
        known = Plan.from_trip(trip)
        samples = known.samples
        if "elevation_m" in samples and k % 4 < 3:
            way = np.cumsum(samples["speed_m_s"] * samples["time_s"].diff().fillna(0.0))
            slope = SLOPE * (k % 4 - 1) * np.minimum(1.0, 6000.0 / np.asarray(way)[-1])
            samples = samples.assign(elevation_m=samples["elevation_m"] + slope * way)
        plan = Plan.from_trace(known.trip_id, samples, departure(k, float(ambient)))
        weather = PlanWeather(np.full(len(plan), 4.0), 1.15, 0.5)
        drives.append(replace(plan, weather=weather) if k % 5 == 0 else plan)
    return drives


def departure(k: int, ambient_degc: float) -> Departure:
    """What is known of a drive: of the air always, as on the trips of every result, of the car on every second, of some hardly more."""
    conditions: dict[str, object] = {"soc": (0.95, 0.7, 0.4)[k % 3], "payload_mass_kg": 75.0 * (k % 4)}
    conditions["ambient_temperature_degc"] = ambient_degc
    if k % 2:
        conditions |= {
            "cabin_temperature_degc": 0.5 * ambient_degc + 12.0,
            "battery_temperature_degc": 0.7 * ambient_degc + 5.0,
            "cabin_setpoint_degc": 21.0,
        }
    rare: dict[int, dict[str, object]] = {
        3: {"climate": "off"},
        6: {"season": "winter"},
        9: {"extras": ("winter_tyres", "roof_box")},
    }
    rare |= {14: {"weather": "sunny"}, 16: {"weather": "sunny", "season": "summer"}}
    return Departure(**(conditions | rare.get(k, {})))  # type: ignore[arg-type]


def with_signals(trip: Trip, car: Vehicle) -> Trip:
    """A trip of the car's own physics with the signal that most logs lack: the torque of its motor."""
    run, drivetrain = simulate_trip(car, trip), car.drivetrain
    force = run.aero_drag_force_n + run.rolling_resistance_force_n + run.grade_force_n + run.inertia_force_n
    torque = 1.1 * force * drivetrain.wheel_radius_m / drivetrain.gear_ratio
    return replace(trip, samples=trip.samples.assign(motor_torque_nm=np.clip(torque, -80.0, 250.0)))


def of_simulation(car: Vehicle, plan: Plan) -> list[float]:
    """Energy by cause, and where the car's states end."""
    run = simulate_trip(car, plan)
    causes = run.by_cause_wh.values()
    ends = (run.soc, run.battery_temperature_degc, run.cabin_temperature_degc)
    loss_wh = float(np.sum(run.battery_loss_w[1:] * np.diff(run.time_s))) / 3600.0
    return [*causes, loss_wh, float(run.terminal_voltage_v.mean()), *(float(end[-1]) for end in ends)]


def of_forecast(forecast: Forecast) -> list[float]:
    """Energy and charge with their intervals."""
    return [
        forecast.energy_wh,
        forecast.sd_wh,
        *forecast.interval(0.5),
        *forecast.interval(0.9),
        forecast.soc_arrival,
        *forecast.arrival.interval(0.9),
    ]


def on_the_way(forecast: Forecast, trip: Trip, measured: Sequence[str]) -> list[float]:
    """`of_forecast` after a fifth and a half of a trip, by columns of its log."""
    log = trip.samples.assign(displayed_soc=trip.samples["soc"].round(2))[["time_s", *measured]]
    ends = (forecast.along.time_s[-1] * part for part in (0.2, 0.5))
    return [x for end in ends for x in of_forecast(forecast.update(log[log["time_s"] <= end]))]


def of_identification(car: Vehicle) -> list[float]:
    """Values from the signals of the trips."""
    records = [stage_record(with_signals(trip, car), car) for trip in trips()]
    values = identify(records, car).values
    return [float(x) for key in sorted(values) for x in np.atleast_1d(np.asarray(values[key]))]


def of_split() -> list[list[float]]:
    """Correction of each trip by the default corrector without its trees."""
    table = segment_trips(trips(), load_vehicle(CARS[0]))
    drive = GPCorrector(DRIVE_TERMS)
    corrector = SplitCorrector(GPCorrector(CLIMATE_TERMS, share_column="climate_w"), drive, GPCorrector())
    return [[float(x)] for x in table.totals_wh(corrector.fit(table).predict(table))]


def simulated() -> Probe:
    """The part of the physics: every car on every drive."""
    cars = {name: load_vehicle(name) for name in CARS} | {"paper's preset": load_vehicle(CARS[0], "paper")}
    return rounded({f"simulation {n}": [of_simulation(car, p) for p in plans()] for n, car in cars.items()})


def models() -> dict[str, ForecastModel]:
    """A fitted car, the others that take its model over, and one of these with own trips."""
    cars = [load_vehicle(name) for name in CARS]
    model, last = ForecastModel(cars[0], corrector="gp").fit(trips()), cars[2]
    adapted = tw.adapt(model, synthetic_fleet(OWN_TRIPS, SEED, vehicle=last).trips, last)
    return {car.name: for_car(model, car) for car in cars} | {"own trips": adapted}


def computed() -> Probe:
    """The probe of the code as it is. Some seconds."""
    roads, of_cars = plans(), models()
    parts = {"identification": [of_identification(load_vehicle(CARS[0]))]}
    parts["default corrector"] = of_split()
    model = of_cars[CARS[0]]
    for name, of_car in of_cars.items():
        parts[f"forecast {name}"] = [of_forecast(of_car.forecast(plan)) for plan in roads]
    parts["forecast on links"] = [of_forecast(model.forecast(plan_on_links(t, LINK_M))) for t in trips()]
    way = [(model.forecast(Plan.from_trip(trip)), trip) for trip in trips()]
    ways = (("voltage_v", "current_a"), ("displayed_soc",))
    parts[ON_THE_WAY] = [on_the_way(*each, measured) for each in way for measured in ways]
    flat = [Plan.from_trace(p.trip_id, p.samples.drop(columns="elevation_m"), p.departure) for p in roads]
    parts["forecast without heights"] = [of_forecast(model.forecast(plan)) for plan in flat]
    return simulated() | rounded(parts)


def rounded(parts: Mapping[str, Sequence[Sequence[float]]]) -> Probe:
    """Numbers of six digits."""
    return {name: [[float(f"{x:.6g}") for x in row] for row in rows] for name, rows in parts.items()}


def differences(one: Mapping[str, Sequence[Sequence[float]]], other: Probe) -> Iterator[str]:
    """Yield the places where two probes differ by more than noise, the largest difference of each part first."""
    for name in dict.fromkeys((*one, *other)):
        rows = [np.array([x for row in probe.get(name, ()) for x in row]) for probe in (one, other)]
        if len(rows[0]) != len(rows[1]):
            yield f"{name}: {len(rows[0])} numbers, now {len(rows[1])}"
            continue
        size = np.maximum(np.abs(rows[0]), np.abs(rows[1]))
        off = np.abs(rows[0] - rows[1]) - TOLERANCE * size
        off = np.where(np.isnan(rows[0]) & np.isnan(rows[1]), -1.0, np.nan_to_num(off, nan=np.inf))
        if np.any(off > FLOOR):
            worst = int(np.argmax(np.nan_to_num(off / (size + FLOOR), nan=-1.0)))
            yield f"{name}: {rows[0][worst]:g}, now {rows[1][worst]:g} ({int(np.sum(off > FLOOR))} of {len(off)} numbers)"


def digest(probe: Probe) -> str:
    """A name for the numbers of a probe."""
    return hashlib.sha256(json.dumps(probe, sort_keys=True).encode()).hexdigest()[:16]


if __name__ == "__main__":
    print(json.dumps(computed()))
