"""Random journeys whose answers are checked for contradictions: `python -m benchmarks.absurd [--number N] [--seed N]`.

Cars of the library drive between random places of a made country, with random charges, temperatures and reserves. `contradictions` reads
only the JSON document of a journey, as a client of the service does. `promises` hides the heights of roads in made mountains, of which the
map has some places, and lets those depart to whom the verdict promises arrival; whether they arrive follows from the forecast that knows the heights.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, Final

import numpy as np
from tests.roads.journey.made import MadeRouter
from tests.support.height_field import KM_DEG, height_field
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.population.cars import for_car
from tripwatt.roads.journey import Atlas, JourneyOptions, Place, RoadForecaster, journey_with
from tripwatt.roads.maps.heights import KnownHeights
from tripwatt.roads.maps.stations import Station
from tripwatt.vehicles import vehicle_names

NUMBER: Final = 2000
SOUTH_WEST, NORTH_EAST = (46.0, 7.0), (49.5, 12.0)
POWERS_KW: Final = (3.7, 11.0, 22.0, 50.0, 50.0, 150.0, 300.0)
MIN_STOP_S: Final = 300.0
SURE: Final = 0.95
ROUNDING: Final = 1e-6
CARS: Final = (
    "renault_zoe_ze50_r135",
    "vw_id3",
    "hyundai_kona_64",
    "nissan_leaf_40",
    "dacia_spring",
    "tesla_model_y_2022_lr_awd",
)
SIZE_KM: Final = 25.0
MOUNTAINS_M: Final = 300.0
HIGHEST_M: Final = 8500.0
"""Size of the country of hidden heights, the median of the scale of its heights over 10 km, and the highest of all."""


def country(rng: np.random.Generator, stations: int = 250) -> Atlas:
    """Return an atlas of straight roads with stations at random places."""
    places = rng.uniform(SOUTH_WEST, NORTH_EAST, (stations, 2))
    return Atlas(
        MadeRouter(),
        stations=tuple(
            Station(float(lat), float(lon), f"S{k}", 1000.0 * power, direct_current=power >= 50.0)
            for k, ((lat, lon), power) in enumerate(zip(places, rng.choice(POWERS_KW, stations), strict=True))
        ),
    )


def journeys(number: int, seed: int) -> Iterator[dict[str, Any]]:
    """Yield the documents of random journeys."""
    rng = np.random.default_rng(seed)
    atlas = country(rng)
    names, model_of = vehicle_names(), cache(partial(for_car, None))
    for _ in range(number):
        south_north, west_east = rng.uniform(SOUTH_WEST, NORTH_EAST, (2, 2)).T.tolist()
        start, end = (Place(*where) for where in zip(south_north, west_east, "AB", strict=True))
        departure = tw.Departure(
            soc=round(float(rng.uniform(0.03, 1.0)), 2),
            ambient_temperature_degc=round(float(rng.normal(9.0, 10.0)), 1),
        )
        reserve, is_return = float(rng.choice([0.0, 0.05, 0.1, 0.1, 0.2])), rng.random() < 0.3
        pause_s = round(float(rng.uniform(0.0, 36_000.0))) * is_return
        options = JourneyOptions(reserve=reserve, round_trip=is_return, pause_s=pause_s)
        forecaster = RoadForecaster(model_of(str(rng.choice(names))), departure)
        stops = (start, end, *((start,) * is_return))
        yield journey_with(forecaster, stops, atlas, options).to_dict()


def contradictions(journey: dict[str, Any]) -> Iterator[str]:
    """Yield what contradicts itself in the document of a journey."""
    verdict, charging, reserve = journey["verdict"], journey["charging"], journey["reserve"]
    start = journey["roads"][0]["forecast"]["series"]["displayed_soc"][0]
    plans = [plan for plan in (charging, *journey["charging_alternatives"]) if plan]
    for plan in plans:
        for stop in plan["stops"]:
            if stop["charging_s"] < MIN_STOP_S - ROUNDING:
                yield "a stop below 5 minutes"
            if stop["soc_leave"] <= stop["soc_arrival"]:
                yield "a stop that loses charge"
            if stop["position_m"] < 1000.0 and start >= reserve:
                yield "a stop at the start"
        stopped_s = [max(at["charging_s"] + at["overhead_s"] - at["pause_s"], 0.0) for at in plan["stops"]]
        if abs(plan["charging_s"] - sum(stopped_s)) > 1.0:
            yield "a time at stations that is not that of the stops"
        if (
            not plan["soc_interval"][0] - ROUNDING
            <= plan["soc_arrival"]
            <= plan["soc_interval"][1] + ROUNDING
        ):
            yield "a charge outside its interval"
        if plan["p_reserve"] > plan["p_arrive"] + ROUNDING:
            yield "the reserve is more certain than the arrival"
        if abs(plan["course"]["time_s"][-1] - plan["duration_s"]) > 60.0:
            yield "a course that ends at another time"
        levels = [plan["course"]["displayed_soc"][0], *(stop["soc_leave"] for stop in plan["stops"])]
        if any(level > 1.0 for level in levels[1:]):
            yield "a charge above full"
    if verdict["arrives"] != (verdict["p_reserve"] >= SURE):
        yield "arrives without the chance"
    if verdict["charges"] != len(charging["stops"] if charging else ()):
        yield "stops of verdict and plan differ"
    allowed = (
        ("go" if not charging else "charge_first" if charging["stops"][0]["position_m"] < 2000.0 else "stop",)
        if verdict["arrives"]
        else ("charge_before", "slower", "none")
    )
    if verdict["advice"] not in allowed:
        yield "advice against the verdict"
    if abs(verdict["duration_s"] - verdict["driving_s"] - verdict["charging_s"]) > 1.0:
        yield "times do not add up"
    lows = [
        verdict["soc_interval"][0],
        *(stop["soc_interval"][0] for stop in (charging["stops"] if charging else ())),
    ]
    if min(lows) > reserve and verdict["p_reserve"] < 0.8 and not verdict.get("reason"):
        yield "every interval keeps the reserve, the chance says otherwise"
    if start < reserve and not verdict["arrives"] and verdict.get("reason") != "leaves_below_reserve":
        yield "the departure below the reserve is not named"
    with_stops = journey["soc_needed_with_stops"]
    if with_stops is not None and (verdict["arrives"] or with_stops <= start - ROUNDING):
        yield "a plan that needs more charge and has it"
    if start >= journey["soc_needed"] and start >= reserve and not verdict["arrives"]:
        yield "the charge is enough and the journey does not arrive"


def rows(number: int, seed: int) -> Iterator[Row]:
    """Count each contradiction over random journeys."""
    counts: Counter[str] = Counter()
    planned = 0
    for journey in journeys(number, seed):
        counts.update(set(contradictions(journey)))
        planned += journey["charging"] is not None
    yield Row("journeys", float(number))
    yield Row("of these with stops to charge", float(planned))
    for what, count in counts.most_common():
        yield Row(what, float(count), most=0)
    yield Row("contradictions", float(sum(counts.values())), most=0)


class HiddenHeights(Atlas):
    """Roads on straight lines without heights, in a country of which the map has the heights of some places."""

    known: KnownHeights

    def heights_around(self, places: Sequence[Place]) -> KnownHeights:
        """Return the heights of the places of the country."""
        return self.known


def promises(number: int, seed: int) -> Iterator[Row]:
    """Compare stated chances with those of the same roads of known heights, in mountains and hills of all scales."""
    rng = np.random.default_rng([seed, 1])
    models = {name: for_car(None, name) for name in CARS}
    scores = []
    for _ in range(number):
        count = int(rng.integers(15, 80))
        places, ends = rng.uniform(0.0, SIZE_KM, (count, 2)), rng.uniform(0.0, SIZE_KM, (2, 2))
        points = ends[0] + np.linspace(0.0, 1.0, 41)[:, None] * (ends[1] - ends[0])
        scale_m = MOUNTAINS_M * np.exp(rng.normal(0.0, 0.6))
        height_m = np.minimum(height_field(rng, scale_m, np.vstack((places, points))), HIGHEST_M)
        atlas = HiddenHeights(MadeRouter())
        latitude, longitude = 47.0 + KM_DEG * places[:, 0], KM_DEG * places[:, 1] / np.cos(np.radians(47.0))
        object.__setattr__(atlas, "known", KnownHeights(latitude, longitude, height_m[:count]))
        start, end = (
            Place(47.0 + KM_DEG * north, KM_DEG * east / np.cos(np.radians(47.0)), name)
            for (north, east), name in zip(ends.tolist(), "AB", strict=True)
        )
        departure = tw.Departure(
            soc=round(float(rng.uniform(0.12, 0.5)), 2), ambient_temperature_degc=float(rng.normal(9.0, 8.0))
        )
        forecaster = RoadForecaster(models[str(rng.choice(CARS))], departure)
        verdict = journey_with(forecaster, (start, end), atlas, JourneyOptions(answers=False)).verdict
        road = atlas.router.roads((start, end))[0]
        at_m = np.linspace(0.0, road.distance_m, 41)
        links = replace(road.links, elevation_position_m=at_m, elevation_m=height_m[count:], flags=())
        truth = forecaster.forecast(road.with_links(links))
        green = verdict.arrives and not verdict.reason
        scores.append((green, verdict.p_reserve, truth.p_arrive(0.1), truth.p_arrive(0.0)))
    green, stated, kept, arrived = np.array(scores, dtype=float).T
    yield Row("roads of hidden heights", float(number))
    yield Row("of these promised", float(green.sum()))
    yield Row("arrival of those that are promised", float(arrived[green > 0.0].mean()), least=0.95)
    yield Row("reserve of those that are promised", float(kept[green > 0.0].mean()), least=0.95)
    yield Row("stated chance minus true one, all", float(np.mean(stated - kept)), "", -0.02, 0.02)


def bars(number: int = 200, seed: int = 0) -> Iterator[Row]:
    """Rows of journeys and of promises."""
    yield from promises(number // 2, seed)
    yield from rows(number, seed)


def main(number: int = NUMBER, seed: int = 0) -> int:
    """Print the rows; 1 where one is missed."""
    return report(bars(number, seed))


if __name__ == "__main__":
    run(main)
