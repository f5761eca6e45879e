"""Cars that nobody has seen, each from all others: python -m benchmarks.cars [--only NAME] [--draws 100] [--write].

The BMW i3 of the TUM, the Leafs 10 and 541 of the VED, a sedan and a Renault Twizy; of the scored car nothing takes part. With the sedan also its runs on a
dynamometer without a trip on the road. `--write` renews docs/results/cars.json.
"""

from __future__ import annotations

import io
import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image
from tools import DATA, DOCS
from tools.command import run
from tools.docs import pages
from tools.docs.tables import markdown

from benchmarks.measure import Row, report
from benchmarks.unknown_climb import trips_of
from tripwatt.arrays import FloatArray, Relaxation
from tripwatt.auditing import audit
from tripwatt.certification import describe_car
from tripwatt.forecasting import load_model
from tripwatt.hybrid import SegmentTable, segment_table
from tripwatt.hybrid.factors import NAMES, TripEvidence
from tripwatt.hybrid.parameters import on_road
from tripwatt.physics import simulate_trip
from tripwatt.population import Adaptation, population
from tripwatt.sources import read_logs
from tripwatt.study.evaluation.cars import CarTrips, evaluate_cars
from tripwatt.study.report.cars import cars_panels, curves_table, factors_table, means_table, time_table
from tripwatt.study.report.html import png_bytes
from tripwatt.study.report.tables import Column, make_table
from tripwatt.trips import Departure, Plan, Trip, TripSet
from tripwatt.vehicles import Vehicle, load_vehicle
from tripwatt.vehicles.comparing import without_data
from tripwatt.vehicles.parts import RoadLoad

MIN_M = 2000.0
QUARTERED = 40
LAB_AMBIENT_DEGC = 23.0
LAB_MASS_KG = 1919.0
LAB_SOAK_S = 600.0
"""Standstill between two runs of one day, as between the phases of a certification; the source does not state it."""
NOT_SHOWN = ("rolling", "air", "transients")
"""Factors of the road: a dynamometer is set to a load, and its driver follows a smooth schedule."""
LAB_LOAD = {"coastdown_a_n": 179.4, "coastdown_b_n_s_m": 0.28 * 3.6, "coastdown_c_n_s2_m2": 0.0235 * 3.6**2}


def cars(data: Path = DATA) -> list[CarTrips]:
    """Every vehicle of the shared data."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name in ("tum", "sedan", "twizy"):
            trips, car = trips_of(name, data, Path(folder))
            car = describe_car(body="quadricycle") if name == "twizy" else car
            lab = sedan_runs(data / "sedan" / "lab") if name == "sedan" else None
            found.append(CarTrips(name, name, car, tuple(trips), lab))
    ved, leaf = read_logs(data / "ved", "ved"), load_vehicle("nissan_leaf_24")
    for name in ("10", "541"):
        logs = [log for log in ved.logs if log.context.car == name and log.distance_m > MIN_M]
        sound = [t for t in audit(TripSet("ved", tuple(logs))).trips if t.observed_energy_wh is not None]
        found.append(CarTrips(f"ved-{name}", "ved", leaf, tuple(sound)))
    return found


def sedan_runs(folder: Path) -> Any:
    """The runs of the sedan on a dynamometer as evidence of a car: its road load and mass are those that were set."""

    def evidence(vehicle: Vehicle) -> TripEvidence:
        lab = on_dynamometer(vehicle)
        tables = lab_tables(folder, lab)
        shown = TripEvidence.from_table(SegmentTable.join(tables), lab)
        hidden = np.array([name in NOT_SHOWN for name in NAMES])
        return replace(shown, factors_wh=np.where(hidden, 0.0, shown.factors_wh))

    return evidence


def on_dynamometer(vehicle: Vehicle) -> Vehicle:
    """The car with the load and the mass that were set, without what it draws on a road alone."""
    load = RoadLoad("coastdown", coastdown_mass_kg=LAB_MASS_KG, coastdown_air_density_kg_m3=1.2, **LAB_LOAD)
    body = replace(vehicle.body, curb_mass_kg=LAB_MASS_KG - vehicle.body.driver_mass_kg)
    return replace(
        vehicle, body=body, road_load=load, auxiliaries=replace(vehicle.auxiliaries, moving_load_w=0.0)
    )


def lab_errors(whole: SegmentTable) -> dict[str, FloatArray]:
    """Simulated over measured energy of each run, less one, by kind of run."""
    observed, simulated = (whole.totals_wh(w) for w in (whole.observed_power_w, whole.simulated_w))
    steady = np.array(["_CS_" in name or "_SPEED_" in name for name in whole.trip_ids])
    error = simulated / observed - 1.0
    return {"constant speeds": error[steady], "cycles": error[~steady]}


def stage_rows(folder: Path) -> Iterator[Row]:
    """Each stage of the sedan on the dynamometer, with published values: nothing is fitted."""
    car = on_dynamometer(load_vehicle("tesla_model_3_lr"))
    whole = SegmentTable.join(lab_tables(folder, car))
    for what, error in lab_errors(whole).items():
        yield Row(
            f"sedan on the dynamometer, {what}: mean error of {error.size} runs",
            float(np.abs(error).mean()),
            note=f"bias {error.mean():+.3f}",
        )
    stands = whole.features["speed_m_s"].to_numpy() < 0.01
    yield Row(
        "sedan standing: measured power",
        float(whole.observed_power_w[stands].mean()),
        "W",
        note=f"published base load {car.auxiliaries.base_load_w:g} W",
    )
    # segments in which both say that the battery is charged
    charged = (whole.observed_power_w < 0.0) & (whole.simulated_w < 0.0)
    gained = [float(w[charged] @ whole.hours[charged]) for w in (whole.simulated_w, whole.observed_power_w)]
    yield Row(
        "sedan, recovered energy: simulated over measured, half-minutes that charge", gained[0] / gained[1]
    )


def quarter_rows(every: Sequence[CarTrips]) -> Iterator[Row]:
    """Simulated over measured energy of each set, and of its quarters by mean speed over that of the set; published values of the car as on the road."""
    for car in every:
        if len(car.trips) < QUARTERED:
            continue
        vehicle = on_road(without_data(car.vehicle, car.dataset))
        energy = np.array(
            [(simulate_trip(vehicle, t).simulated_energy_wh, t.observed_energy_wh) for t in car.trips]
        )
        speed = np.array([t.distance_m / t.array("time_s")[-1] for t in car.trips])
        whole = float(np.divide(*energy.sum(axis=0)))
        yield Row(f"{car.name}: simulated over measured", whole)
        for k, part in enumerate(np.array_split(np.argsort(speed), 4), start=1):
            ratio = float(np.divide(*energy[part].sum(axis=0))) / whole - 1.0
            note = f"{3.6 * speed[part].min():.0f} to {3.6 * speed[part].max():.0f} km/h"
            yield Row(f"{car.name}: quarter {k} by speed", ratio, least=-0.06, most=0.06, note=note)


def lab_tables(folder: Path, car: Vehicle) -> list[SegmentTable]:
    """Segments of each run, with the tyres as the runs of the day before it leave them: cold in the first."""
    tables, day, warmth = [], "", 0.0
    for file in sorted(folder.glob("*.csv")):
        of_day = file.stem.partition("_")[0]
        warmth = 0.0 if of_day != day else warmth
        table, warmth = lab_table(file, car, warmth)
        tables.append(table)
        day = of_day
    return tables


def lab_table(file: Path, car: Vehicle, warmth: float = 0.0) -> tuple[SegmentTable, float]:
    """Segments of one run, energy of the pack with the low-voltage branch; and the warmth of the tyres after a soak."""
    log = pd.read_csv(file)
    column = {name.split(" [")[0].strip().lower(): name for name in log.columns}
    time_s, volts = log[column["time"]].to_numpy(float), log[column["battery voltage"]].to_numpy(float)
    current = -(log[column["battery current"]] + log[column["low-voltage branch current"]]).to_numpy(float)
    samples = pd.DataFrame(
        {
            "time_s": time_s - time_s[0],
            "speed_m_s": np.maximum(log[column["speed"]].to_numpy(float) / 3.6, 0.0),
            "voltage_v": volts,
            "current_a": current,
            "ambient_temperature_degc": LAB_AMBIENT_DEGC,
            "elevation_m": 0.0,
        }
    )
    trip = Trip.from_samples(file.stem, samples)
    plan = Plan.from_trip(trip).with_departure(Departure(climate="off", warmth=warmth))
    assert car.tyres is not None
    settled = np.sqrt(np.minimum(trip.array("speed_m_s") / car.tyres.warm_up_speed_m_s, 1.0))
    step = np.diff(trip.array("time_s"), prepend=0.0, append=trip.array("time_s")[-1] + LAB_SOAK_S)
    after = Relaxation(step / car.tyres.warm_up_time_s).solve(warmth, np.append(settled, 0.0))
    return segment_table(plan, simulate_trip(car, plan), trip), float(after[-1])


def publish(results: dict[str, Any]) -> None:
    """The results, the figure, and the generated parts of docs/explanation/cars.md."""
    text = json.dumps(results, indent=1, ensure_ascii=False) + "\n"
    (DOCS / "results" / "cars.json").write_text(text, encoding="utf-8")
    shown = cars_panels(results)[0].figure
    assert shown is not None
    with Image.open(io.BytesIO(png_bytes(shown))) as image:  # 64 colours are enough, and a third of the size
        image.convert("RGB").quantize(64).save(DOCS / "images" / "cars-curves.png", optimize=True)
    page = "explanation/cars.md"
    pages.renew(page, "factors", markdown(factors_table(results)))
    tables = (curves_table(results), time_table(results), means_table(results))
    pages.renew(page, "cars", "\n\n".join(map(markdown, tables)))
    stages = [*stage_rows(DATA / "sedan" / "lab"), *quarter_rows(cars())]
    columns = [Column(name.capitalize(), attrgetter(name)) for name in ("name", "figure", "note")]
    table = make_table("The sedan on the dynamometer, and sets by speed: published values", stages, *columns)
    pages.renew(page, "dynamometer", markdown(table))


BOUNDS = {
    ("twizy", 0): 0.18, ("twizy", 1): 0.097, ("twizy", 5): 0.075,
    ("sedan", 0): 0.075, ("sedan", 5): 0.060, ("sedan", 10): 0.050, ("sedan", 20): 0.044,
    ("tum", 10): 0.063, ("tum", 20): 0.056,
}  # fmt: skip


def rows_of(car: dict[str, Any]) -> Iterator[Row]:
    """The bars of one car."""
    name = car["car"]
    curve = {row["k"]: row for row in car["curves"]["population"]}
    for k, row in curve.items():
        yield Row(
            f"{name}, {k} own trips: error",
            row["error"],
            most=BOUNDS.get((name, k), np.inf),
            note=f"bias {row['bias']:+.3f}",
        )
    if 1 in curve:
        yield Row(
            f"{name}: error with 1 own trip less that with none",
            curve[1]["error"] - curve[0]["error"],
            most=0.01,
        )
    factor = {row["k"]: row for row in car["curves"]["one factor"]}
    if 5 in curve:
        yield Row(
            f"{name}, 5 own trips: error less that of one factor",
            curve[5]["error"] - factor[5]["error"],
            most=0.005,
        )
    own = car.get("own_model")
    if own is not None:
        last = max(curve)
        yield Row(
            f"{name}, {last} own trips: error less that of its own model",
            curve[last]["error"] - own["error"],
            most=0.01,
            note=f"own {own['error']:.3f}",
        )
        yield Row(
            f"{name}, 20 own trips: error less that of its own model",
            curve[20]["error"] - own["error"],
            most=0.01,
        )
    most = {("sedan", 0): 0.042, ("ved-10", 0): 0.120, ("ved-10", 20): 0.110}
    for score in car["in_time"]:
        text = f"{name}, in order of time from trip {score['from']}"
        yield Row(f"{text}: error", score["error"], most=most.get((name, score["from"]), np.inf))
        if score["from"] == 5 and score["trips"] >= 40:
            yield Row(f"{text}: 90 % interval covers", score["coverage"], least=0.84, most=0.96)
        elif score["from"] == 5:
            low, high = score["coverage_ci95"]
            yield Row(f"{text}: 90 % interval covers; lower end of Clopper-Pearson's interval", low, most=0.9)
            yield Row(f"{text}: upper end", high, least=0.9)
        if score["from"] == 20:
            yield Row(f"{text}: width over needed", score["width_over_needed"], most=1.35)
    yield Row(
        f"{name}: mean error without trips over its standard deviation",
        car["mean_error_over_sd"],
        least=-2.5,
        most=2.5,
    )
    if "lab_to_road" in car:
        yield Row(
            f"{name}: error on the road from its dynamometer runs alone",
            car["lab_to_road"]["error"],
            most=0.055,
        )


def speed_rows(every: Sequence[CarTrips]) -> Iterator[Row]:
    """Seconds for learning 100 trips and the next one."""
    car = next(car for car in every if car.name == "sedan")
    known = Adaptation.before_trips(load_model(), car.vehicle, population())
    began = time.perf_counter()
    known = known.with_trips(car.trips[:100])
    assert known.model
    yield Row("learning 100 trips", time.perf_counter() - began, "s", most=5.0)
    took = []
    for trip in car.trips[100:104]:
        began = time.perf_counter()
        known = known.with_trips([trip])
        assert known.model
        took.append(time.perf_counter() - began)
    yield Row("learning the next one", min(took), "s", most=0.05)


def bounds(only: str | None = None, draws: int = 100, write: bool = False) -> Iterator[Row]:
    """All rows, or those of one car."""
    every = cars()
    done = (
        evaluate_cars(every, draws=draws, progress=lambda k, n: print(f"{k} of {n}", flush=True))
        if only is None
        else None
    )
    if done is None:
        others = [car for car in every if car.name != only]
        scored = [car for car in every if car.name == only]
        done = evaluate_cars([*scored, *others], draws=draws)
    if write:
        publish(done.results)
    for car in done.results["cars"]:
        if only in (None, car["car"]):
            yield from rows_of(car)
    yield from stage_rows(DATA / "sedan" / "lab")
    yield from quarter_rows(every)
    yield from speed_rows(every)


def main(only: str | None = None, draws: int = 100, write: bool = False) -> int:
    """Print the rows; 1 when a bound is missed."""
    return int(report(bounds(only, draws, write)) and not write)


if __name__ == "__main__":
    run(main)
