"""Roads whose heights are hidden: python -m benchmarks.unknown_climb [--only regions|logs|routes] [--write].

Regions: the scale of the net climb over 10 km in logs with heights, from which `tripwatt.routes.terrain` takes its own (that of the sedan's
logs is shown and not used: their licence does not allow it).
Logs: a model of the car is fitted on nine tenths of its trips, heights included, and forecasts the others with their heights hidden. The
distribution of climbs leaves out the data set that is scored.
Routes: seeded roads in the mountains and in flat country; the energy is drawn from the forecast that knows the heights.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.stats import binomtest
from tools import DATA
from tools.command import run
from tools.docs import pages

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.arrays import FloatArray
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.physics.road_load import grade_from_elevation
from tripwatt.routes.terrain import GROWTH, REFERENCE_M, REGION_SCALE_M, net_climbs
from tripwatt.sources.tum import REFERENCE_TRIPS
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.vehicles import Vehicle

LEVEL = 0.9
COVERS = (0.85, 0.97)
FOLDS = 10
ROUTES = 200
WIDER = {"flat": 1.1, "unknown": 1.6}
"""Largest median width over that with known heights ("flat"), and over that of flat country ("unknown")."""
PIECES_M = (1000.0, 2000.0, 4000.0, 8000.0, 16_000.0)
LARGE = 40

_MAPPINGS = {
    "sedan": """[columns]
time_s = { column = "time [s]", unit = "s" }
speed_m_s = { column = "speed [km/h]", unit = "km/h" }
voltage_v = { column = "pack voltage [V]", unit = "V" }
current_a = { column = "pack current [A]", unit = "A" }
elevation_m = { column = "altitude [m]", unit = "m" }
ambient_temperature_degc = { column = "outside temperature [degC]", unit = "degC" }
[current]
positive = "charge"
""",
    "twizy": """[columns]
time_s = { column = "Time", unit = "timestamp", format = "%H:%M:%S" }
speed_m_s = { column = "Speed", unit = "km/h" }
soc = { column = "Soc", unit = "%" }
elevation_m = { column = "ALT", unit = "m" }
ambient_temperature_degc = { column = "Temperature", unit = "degC" }
[battery]
usable_capacity_kwh = 6.1
""",
}


def trips_of(name: str, data: Path, folder: Path) -> tuple[list[Trip], Vehicle]:
    """Trips of a data set with heights and measured energy, and the car that drove them."""
    if name == "tum":
        trips = [t for t in tw.read_trips(data / "tum") if t.trip_id in REFERENCE_TRIPS]
        return trips, tw.load_vehicle("bmw_i3_60ah")
    mapping = folder / f"{name}.toml"
    mapping.write_text(_MAPPINGS[name], encoding="utf-8")
    source = data / "sedan" / "road" if name == "sedan" else data / "twizy"
    trips = [t for t in tw.read_trips(source, "table", mapping) if t.observed_energy_wh is not None]
    if name == "sedan":
        return trips, tw.load_vehicle("tesla_model_3_lr")
    car = tw.describe_car(mass_kg=474.0, usable_battery_kwh=6.1, motor_power_kw=13.0, body="small")
    return trips, car


def heights(trip: Trip) -> FloatArray:
    """Height every 100 m of road [m], jumps of the sensor smoothed."""
    time, speed = trip.array("time_s"), trip.array("speed_m_s")
    step = np.diff(time, prepend=time[:1]) * speed
    grade = grade_from_elevation(time, speed, trip.array("elevation_m"))
    way = np.cumsum(step)
    return np.interp(np.arange(0.0, way[-1], 100.0), way, np.cumsum(grade * step))


def region_scale(trips: Sequence[Trip]) -> float:
    """Scale of the net climb over 10 km [m]: root of the mean square over pieces of several lengths, each brought to 10 km."""
    squares = []
    for length in PIECES_M:
        n = int(length / 100.0)
        nets = [h[n:] - h[:-n] for trip in trips if len(h := heights(trip)) > n]
        if nets:
            squares.append(np.mean(np.concatenate(nets) ** 2) * (REFERENCE_M / length) ** (2.0 * GROWTH))
    return float(np.sqrt(np.mean(squares)))


def without_heights(trip: Trip, terrain: str) -> Plan:
    """What is known of a trip before departure, but for the heights of its road."""
    plan = Plan.from_trip(trip)
    samples = plan.samples.drop(columns=["elevation_m", "grade"], errors="ignore")
    return replace(plan, samples=samples).with_departure(Departure(terrain=terrain))


def hidden_forecasts(
    name: str, trips: Sequence[Trip], car: Vehicle, corrector: str, folds: int = FOLDS
) -> dict[str, list[Forecast]]:
    """Forecasts of each trip by models without it: with heights ("known"), and without them by terrain."""
    fold = np.random.default_rng(0).permutation(len(trips)) % folds
    by_terrain: dict[str, list[Forecast]] = {"known": [None] * len(trips)}  # type: ignore[list-item]
    for terrain in WIDER:
        by_terrain[terrain] = [None] * len(trips)  # type: ignore[list-item]
    for k in range(folds):
        model = ForecastModel(car, corrector).fit([t for t, f in zip(trips, fold, strict=True) if f != k])
        for i in np.flatnonzero(fold == k):
            by_terrain["known"][i] = model.forecast(trips[i])
            for terrain in WIDER:
                forecast = model.forecast(without_heights(trips[i], terrain))
                assert forecast.climbing is not None
                net = net_climbs(terrain, without=name)
                by_terrain[terrain][i] = replace(forecast, climbing=replace(forecast.climbing, net=net))
    return by_terrain


def coverage_rows(text: str, inside: Sequence[bool], bound: bool = True) -> Iterator[Row]:
    """Coverage of the 90 % interval; of few trips the Clopper-Pearson interval has to contain the level."""
    n, hits = len(inside), int(sum(inside))
    if n >= LARGE:
        yield Row(f"{text}: 90 % interval covers, of {n}", hits / n, "", *(COVERS if bound else ()))
        return
    low, high = binomtest(hits, n).proportion_ci(0.95, "exact")
    most, least = (LEVEL, LEVEL) if bound else (np.inf, -np.inf)
    yield Row(f"{text}: covers {hits} of {n}; lower end of Clopper-Pearson's interval", low, most=most)
    yield Row(f"{text}: upper end of it", high, least=least)


def width(forecast: Forecast) -> float:
    """Of the 90 % interval of the energy [Wh]."""
    low, high = forecast.interval(LEVEL)
    return high - low


def log_rows(data: Path, folder: Path, corrector: str = "split") -> Iterator[Row]:
    """Coverage and width of logs with hidden heights."""
    for name in ("tum", "sedan", "twizy"):
        trips, car = trips_of(name, data, folder)
        by_terrain = hidden_forecasts(name, trips, car, corrector)
        observed = [float(t.observed_energy_wh or np.nan) for t in trips]
        for what, forecasts in by_terrain.items():
            inside = [
                f.interval(LEVEL)[0] <= o <= f.interval(LEVEL)[1]
                for f, o in zip(forecasts, observed, strict=True)
            ]
            yield from coverage_rows(f"{name}, {what}", inside, bound=what == "unknown")
        for what, base in (("flat", "known"), ("unknown", "flat")):
            ratio = np.median(
                [width(a) / width(b) for a, b in zip(by_terrain[what], by_terrain[base], strict=True)]
            )
            yield Row(f"{name}: median width {what} over {base}", float(ratio), most=WIDER[what])


def mountain_road(rng: np.random.Generator) -> FloatArray:
    """Heights of a mountain road every 100 m [m]: stretches along valleys, climbs and descents, between 300 and 2,400 m."""
    n, height = int(10.0 ** rng.uniform(1.7, 2.8)), [float(rng.uniform(400.0, 1200.0))]
    while len(height) < n:
        kind = rng.choice(["valley", "climb", "descent"], p=[0.5, 0.25, 0.25])
        steep = float(rng.normal(0.0, 0.006) if kind == "valley" else rng.uniform(0.03, 0.1))
        for _ in range(int(rng.integers(10, 80))):
            rise = 100.0 * (float(rng.normal(0.0, 0.015)) + (-steep if kind == "descent" else steep))
            height.append(float(np.clip(height[-1] + rise, 300.0, 2400.0)))
    return np.array(height[: n + 1])


def flat_road(rng: np.random.Generator) -> FloatArray:
    """Heights of a road in a plain every 100 m [m]."""
    return 200.0 + np.cumsum(rng.normal(0.0, 0.3, int(10.0 ** rng.uniform(1.7, 2.8))))


def route_rows(routes: int = ROUTES, model: ForecastModel | None = None) -> Iterator[Row]:
    """Coverage on seeded routes, by terrain."""
    model = model or tw.load_model()
    roads: dict[str, Callable[[np.random.Generator], FloatArray]] = {
        "mountains": mountain_road,
        "flat": flat_road,
    }
    for terrain, road in roads.items():
        rng = np.random.default_rng(20)
        inside = []
        for _ in range(routes):
            height, speed = road(rng).tolist(), rng.uniform(8.0, 28.0)
            bare = [{"length_m": 100.0, "speed_m_s": speed} for _ in height[1:]]
            ends = itertools.pairwise(height)
            links = [
                link | {"start_elevation_m": low, "end_elevation_m": high}
                for link, (low, high) in zip(bare, ends, strict=True)
            ]
            departure = Departure(
                soc=0.9, ambient_temperature_degc=float(rng.uniform(-5.0, 28.0)), terrain=terrain
            )
            known = model.forecast(tw.read_route(links), departure)
            energy = known.quantile(float(rng.uniform(0.001, 0.999)))
            low, high = model.forecast(tw.read_route(bare), departure).interval(LEVEL)
            inside.append(low <= energy <= high)
        yield from coverage_rows(f"routes, {terrain}", inside)


def region_rows(data: Path, folder: Path) -> Iterator[Row]:
    """Scales of the regions with logs, beside those that the package took from the same logs: its bounds find a stale value."""
    for name in ("tum", "twizy", "sedan"):
        scale = region_scale(trips_of(name, data, folder)[0])
        own = REGION_SCALE_M.get(name)
        bounds = () if own is None else (own - 0.05, own + 0.05, f"the package has {own:g} from these logs")
        yield Row(f"{name}: scale of the net climb over 10 km [m]", scale, "", *bounds)


def bounds(only: str | None = None) -> Iterator[Row]:
    """All rows, or those of one part."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        parts: dict[str, Callable[[], Iterator[Row]]] = {
            "regions": lambda: region_rows(DATA, folder),
            "logs": lambda: log_rows(DATA, folder),
            "routes": route_rows,
        }
        for name, part in parts.items():
            if only in (None, name):
                yield from part()


def shown(rows: Sequence[Row]) -> str:
    """The table as Markdown, and each missed bound in words.

    Examples
    --------
    >>> print(shown([Row("sedan: 90 % interval covers, of 104", 1.0, most=0.97)]).splitlines()[-1])
    Too wide: sedan: 90 % interval covers, of 104 (1, where ≤ 0.97 is the bound).
    """
    said = []
    for row in rows:
        if row.met is False:
            # of a coverage and of a width alike, more than the bound is an interval that is too wide
            fault = "Too wide" if row.value > row.most else "Too narrow"
            fault = "Stale" if row.note else fault
            said.append(f"{fault}: {row.name} ({row.value:.3g}, where {row.bounds} is the bound).")
    head = "| What | Figure | Bound | Met |\n|:--|--:|--:|:--|"
    return "\n".join([head, *(row.cells for row in rows), "", " ".join(said) or "Every bound is met."])


def main(only: Literal["regions", "logs", "routes"] | None = None, write: bool = False) -> int:
    """Print the rows; 1 when a bound is missed. `--write` renews the table of docs/explanation/uncertainty.md."""
    rows = list(bounds(only))
    missed = report(rows)
    if write:
        pages.renew("explanation/uncertainty.md", "climb", shown(rows))
    return int(missed and not write)


if __name__ == "__main__":
    run(main)
