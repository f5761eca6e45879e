"""What it costs to know a trip only as links: simulated energy on link-made profiles against the true traces.

Run: ``python -m benchmarks.links [--json FILE] [--write]``. Needs TRIPWATT_DATA. The 58 TUM reference trips at 1 Hz, the car's
default physics; links of 250 m and 1 km with their mean speed (standstill included), elevation at the ends, stops not
given. Three drivers: constant speed on every link; the link style's defaults, which know no TUM trip; a style
calibrated within five folds on the simulated energy of the other trips.

``python -m benchmarks.links --defaults`` shows where the defaults come from: the electric cars of the Vehicle Energy
Dataset whose speed is logged without gaps of more than four seconds, and EPA's three schedules.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from tools import DATA
from tools.command import run
from tools.docs import pages
from typer import Option

from benchmarks.link_style import calibrate_style, road_work
from benchmarks.measure import seconds
from tripwatt.physics import simulate_trip
from tripwatt.routes import (
    LinkRoute,
    LinkStyle,
    link_profile,
    links_of_trip,
)
from tripwatt.sources import read_logs
from tripwatt.trips import Plan, Trip, resample
from tripwatt.vehicles import load_vehicle

LENGTHS_M = (250.0, 1000.0)
FOLDS = 5
EVALUATIONS = 60
MAX_GAP_S = 4.0
Driver = Callable[[LinkRoute, Trip], Plan]
Energy = Callable[[Trip | Plan], float]


def constant(route: LinkRoute, trip: Trip) -> Plan:
    """Each link at its mean speed, changed from one second to the next."""
    ends = np.cumsum(route.travel_time_s)
    at = np.arange(np.ceil(ends[-1]) + 1.0)
    link = np.minimum(np.searchsorted(ends, at, side="right"), len(route) - 1)
    position = np.interp(
        at, np.concatenate(([0.0], ends)), np.concatenate(([0.0], np.cumsum(route.length_m)))
    )
    samples = pd.DataFrame({"time_s": at, "speed_m_s": route.speed_m_s[link]})
    height = route.elevation_at(position)
    if height is not None:
        samples["elevation_m"] = height
    return Plan.from_trace(trip.trip_id, pd.DataFrame(samples), trip.departure)


def true_speed(route: LinkRoute, trip: Trip) -> Plan:
    """The true trace, with the elevation known at the ends of the links only."""
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    position = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))))
    samples = pd.DataFrame({"time_s": time, "speed_m_s": speed})
    height = route.elevation_at(position)
    if height is not None:
        samples["elevation_m"] = height
    return Plan.from_trace(trip.trip_id, pd.DataFrame(samples), trip.departure)


def styled(style: LinkStyle | None = None, seed: int | None = None) -> Driver:
    def drive(route: LinkRoute, trip: Trip) -> Plan:
        rng = None if seed is None else np.random.default_rng(seed)
        return route.plan(style=style, rng=rng).with_departure(trip.departure)

    return drive


def differences(trips: Sequence[Trip], length_m: float, driver: Driver, energy: Energy) -> np.ndarray:
    """(energy on the link-made profile - energy on the true trace) / the latter, of each trip."""
    return np.array([energy(driver(links_of_trip(t, length_m), t)) / energy(t) - 1.0 for t in trips])


def summary(off: np.ndarray) -> dict[str, float]:
    return {
        "bias": float(off.mean()),
        "mean_absolute": float(np.abs(off).mean()),
        "median_absolute": float(np.median(np.abs(off))),
        "largest": float(np.abs(off).max()),
    }


def kept_times(trips: Sequence[Trip], length_m: float) -> dict[str, float]:
    """How well travel times are reproduced, link by link."""
    off, share = [], []
    for trip in trips:
        route = links_of_trip(trip, length_m)
        profile = link_profile(route.length_m, route.travel_time_s, step_s=0.1)
        moves = np.concatenate(([True], np.diff(profile.position_m) > 0))
        border = np.concatenate(([0.0], np.cumsum(route.length_m)))
        passed = np.interp(border, profile.position_m[moves], profile.time_s[moves])
        passed[-1] = profile.time_s[-1]
        passed[0] = 0.0
        late = np.abs(np.diff(passed) - route.travel_time_s)
        off.append(late)
        share.append(late / route.travel_time_s)
    late, relative = np.concatenate(off), np.concatenate(share)
    return {
        "links": len(late),
        "within_1_s_or_2_percent": float(np.mean((late <= 1.0) | (relative <= 0.02))),
        "q99_s": float(np.quantile(late, 0.99)),
        "largest_s": float(late.max()),
    }


def in_folds(trips: Sequence[Trip], energy: Energy) -> dict[float, np.ndarray]:
    """Differences of each trip under a style that was calibrated on the trips of the other folds."""
    off = {length: np.zeros(len(trips)) for length in LENGTHS_M}
    for fold in range(FOLDS):
        held = np.arange(len(trips)) % FOLDS == fold
        style = calibrate_style(
            [t for t, h in zip(trips, held, strict=True) if not h],
            energy=energy,
            max_evaluations=EVALUATIONS,
        )
        for length in LENGTHS_M:
            off[length][held] = differences(
                [t for t, h in zip(trips, held, strict=True) if h], length, styled(style), energy
            )
    return off


def corrected(trips: Sequence[Trip], made: Sequence[Trip | Plan], energy: Energy) -> np.ndarray:
    """Relative errors against the *measured* energy, leaving out one trip at a time, of the simplest correction.

    Four coefficients (simulated energy, hours, hours times kelvins below and above 20 °C outside) by least squares on
    relative errors. Everything but the profile is known at departure.
    """
    observed = np.array([t.observed_energy_wh for t in trips], dtype=float)
    hours = np.array([t.duration_s for t in trips]) / 3600.0
    ambient = np.array([t.array("ambient_temperature_degc")[0] for t in trips])
    columns = np.column_stack(
        (
            [energy(t) for t in made],
            hours,
            hours * np.maximum(0.0, 20.0 - ambient),
            hours * np.maximum(0.0, ambient - 20.0),
        )
    )
    rows = columns / observed[:, None]
    errors = []
    for k in range(len(trips)):
        others = np.arange(len(trips)) != k
        coefficients = np.linalg.lstsq(rows[others], np.ones(len(trips) - 1), rcond=None)[0]
        errors.append(float(rows[k] @ coefficients) - 1.0)
    return np.array(errors)


def milliseconds(number: int, repeats: int = 30) -> float:
    """Median time for a route of links of 250 m, from links to trip."""
    rng = np.random.default_rng(1)
    unknown = np.full(number, np.nan)
    length = np.full(number, 250.0)
    route = LinkRoute(length, length / rng.uniform(4.0, 30.0, number), unknown, unknown)
    return 1e3 * seconds(lambda: route.plan(), repeats, warm_up=False)


def measure() -> dict[str, Any]:
    car = load_vehicle("bmw_i3_60ah")
    trips = [resample(t) for t in read_logs(DATA / "tum").reference_trips()]

    def energy(trip: Trip | Plan) -> float:
        return simulate_trip(car, trip).simulated_energy_wh

    calibrated = in_folds(trips, energy)
    drivers: dict[str, Driver] = {
        "true trace, elevation of the links": true_speed,
        "constant speed": constant,
        "default style": styled(),
        "default style, drawn": styled(seed=1),
    }
    result: dict[str, Any] = {"trips": len(trips), "milliseconds_100_links": milliseconds(100)}
    result["true trace"] = {"corrected": summary(corrected(trips, trips, energy))}
    for length in LENGTHS_M:
        rows = {name: summary(differences(trips, length, driver, energy)) for name, driver in drivers.items()}
        rows["calibrated in folds"] = summary(calibrated[length])
        made = [styled()(links_of_trip(t, length), t) for t in trips]
        result[f"{length:g} m"] = {
            "energy": rows,
            "times": kept_times(trips, length),
            "corrected": summary(corrected(trips, made, energy)),
        }
    return result


def well_logged(trip: Trip) -> bool:
    """Long enough for links of 1 km, and without gaps in which the car may have stopped and gone on."""
    long = trip.distance_m > 2500.0 and trip.duration_s > 240.0
    return long and float(np.diff(trip.array("time_s")).max()) <= MAX_GAP_S


def table(result: dict[str, Any]) -> str:
    """The figures as Markdown."""
    lines = ["| links | driver | bias | mean absolute | median | largest |", "|---|---|---:|---:|---:|---:|"]
    for length in LENGTHS_M:
        for name, row in result[f"{length:g} m"]["energy"].items():
            figures = " | ".join(f"{row[k]:.1%}" for k in ("mean_absolute", "median_absolute", "largest"))
            lines.append(f"| {length:g} m | {name} | {row['bias']:+.1%} | {figures} |")
    lines += [
        "",
        "| known of the speed | bias | mean absolute error against the measured energy |",
        "|---|---:|---:|",
    ]
    for name in ("true trace", *(f"{length:g} m" for length in LENGTHS_M)):
        row = result[name]["corrected"]
        lines.append(f"| {name} | {row['bias']:+.1%} | {row['mean_absolute']:.1%} |")
    lines.append("")
    for length in LENGTHS_M:
        times = result[f"{length:g} m"]["times"]
        lines.append(
            f"- Of {times['links']} links of {length:g} m {times['within_1_s_or_2_percent']:.1%} take their travel time "
            f"to 1 s or 2 %; the largest difference is {times['largest_s']:.1f} s."
        )
    lines.append(
        f"- A hundred links become a trip in {result['milliseconds_100_links']:.1f} ms (median, one core)."
    )
    return "\n".join(lines)


def default_style() -> None:
    """Calibrate on data that has nothing to do with the TUM trips and show what is found."""
    trips = [resample(trip) for trip in read_logs(DATA / "ved", "ved").trips if well_logged(trip)]
    logged = len(trips)
    for path in sorted((DATA / "cycles").glob("*.csv")):
        schedule = pd.read_csv(path)[["cycSecs", "cycMps"]].astype(float)
        schedule.columns = pd.Index(["time_s", "speed_m_s"])
        trips.append(Trip.from_samples(path.stem, schedule))
    print(f"{logged} logged trips, {len(trips) - logged} schedules")
    start = LinkStyle(comfort=0.3, street_speed_m_s=10.0, length_exponent=0.3)
    style = calibrate_style(trips, style=start, max_trips=len(trips))
    print(
        f"comfort {style.comfort:.2g}, street_speed_m_s {style.street_speed_m_s:.2g}, "
        f"length_exponent {style.length_exponent:.2g}"
    )
    for length in LENGTHS_M:
        print(f"{length:g} m: {summary(differences(trips, length, styled(style), road_work))}")


def main(
    json_to: Annotated[Path | None, Option("--json")] = None, write: bool = False, defaults: bool = False
) -> None:
    """Print the figures. `--write` renews docs/reference/routes.md, `--defaults` derives the default style."""
    if defaults:
        default_style()
        return
    result = measure()
    print(table(result))
    if json_to is not None:
        json_to.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if write:
        pages.renew("reference/routes.md", "links", table(result))


if __name__ == "__main__":
    run(main)
