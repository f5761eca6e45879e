"""Random journeys whose answers are checked for contradictions: `python -m benchmarks.absurd [--number N] [--seed N]`.

Cars of the library drive between random places of a made country, with random charges, temperatures and reserves. `contradictions` reads
only the JSON document of a journey, as a client of the service does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from tests.roads.journey.made import MadeRouter
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.population.cars import for_car
from tripwatt.roads.journey import Atlas, JourneyOptions, Place, RoadForecaster, journey_with
from tripwatt.roads.maps import Station
from tripwatt.vehicles import vehicle_names

NUMBER: Final = 2000
SOUTH_WEST, NORTH_EAST = (46.0, 7.0), (49.5, 12.0)
POWERS_KW: Final = (3.7, 11.0, 22.0, 50.0, 50.0, 150.0, 300.0)
MIN_STOP_S: Final = 300.0
SURE: Final = 0.95
ROUNDING: Final = 1e-6


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
    models = {name: for_car(None, name) for name in vehicle_names()}
    for _ in range(number):
        south_north, west_east = rng.uniform(SOUTH_WEST, NORTH_EAST, (2, 2)).T.tolist()
        start, end = (Place(*where) for where in zip(south_north, west_east, "AB", strict=True))
        departure = tw.Departure(
            soc=round(float(rng.uniform(0.03, 1.0)), 2),
            ambient_temperature_degc=round(float(rng.normal(9.0, 10.0)), 1),
        )
        options = JourneyOptions(reserve=float(rng.choice([0.0, 0.05, 0.1, 0.1, 0.2])))
        forecaster = RoadForecaster(models[str(rng.choice(list(models)))], departure)
        yield journey_with(forecaster, (start, end), atlas, options).to_dict()


def contradictions(journey: dict[str, Any]) -> Iterator[str]:
    """Yield what contradicts itself in the document of a journey."""
    verdict, charging, reserve = journey["verdict"], journey["charging"], journey["reserve"]
    plans = [plan for plan in (charging, *journey["charging_alternatives"]) if plan]
    for plan in plans:
        for stop in plan["stops"]:
            if stop["charging_s"] < MIN_STOP_S - ROUNDING:
                yield "a stop below 5 minutes"
            if stop["soc_leave"] <= stop["soc_arrival"]:
                yield "a stop that loses charge"
            if stop["position_m"] < 1000.0:
                yield "a stop at the start"
        if (
            not plan["soc_interval"][0] - ROUNDING
            <= plan["soc_arrival"]
            <= plan["soc_interval"][1] + ROUNDING
        ):
            yield "a charge outside its interval"
        if plan["p_reserve"] > plan["p_arrive"] + ROUNDING:
            yield "the reserve is more certain than the arrival"
        levels = [plan["course"]["displayed_soc"][0], *(stop["soc_leave"] for stop in plan["stops"])]
        if any(level > 1.0 for level in levels[1:]):
            yield "a charge above full"
    if verdict["arrives"] != (verdict["p_reserve"] >= SURE):
        yield "arrives without the chance"
    if verdict["charges"] != len(charging["stops"] if charging else ()):
        yield "stops of verdict and plan differ"
    allowed = (
        ("go" if verdict["charges"] == 0 else "stop",)
        if verdict["arrives"]
        else ("charge_before", "slower", "none")
    )
    if verdict["advice"] not in allowed:
        yield "advice against the verdict"
    if abs(verdict["duration_s"] - verdict["driving_s"] - verdict["charging_s"]) > 1.0:
        yield "times do not add up"
    start = journey["roads"][0]["forecast"]["series"]["displayed_soc"][0]
    lows = [
        verdict["soc_interval"][0],
        *(stop["soc_interval"][0] for stop in (charging["stops"] if charging else ())),
    ]
    if min(lows) > reserve and verdict["p_reserve"] < 0.8 and not verdict.get("reason"):
        yield "every interval keeps the reserve, the chance says otherwise"
    if start < reserve and not verdict["arrives"] and verdict.get("reason") != "leaves_below_reserve":
        yield "the departure below the reserve is not named"
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


def main(number: int = NUMBER, seed: int = 0) -> int:
    """Print the rows; 1 where one is missed."""
    return report(rows(number, seed))


if __name__ == "__main__":
    run(main)
