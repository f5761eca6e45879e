"""Advice for every car on twelve journeys, checked by its document: `python -m benchmarks.advice`.

No action saves less than 0.2 kWh or 2 % of the trip, none is impossible in the weather, with the car or before now, and a set of actions that is said
to be enough is enough when the trip is forecast with it.
"""

from __future__ import annotations

import datetime as dt
import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final

from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.population.cars import for_car
from tripwatt.vehicles import load_vehicle, vehicle_names

NOW: Final = dt.datetime(2026, 1, 15, 7, 30, tzinfo=dt.UTC)
SPEEDS_M_S: Final = ((12.0, 40), (25.0, 40), (36.0, 40))
"""Speed and number of kilometres of a road in town, in the country and on a motorway."""
WEATHER: Final = (
    (-12.0, ("roof_box",), 300.0),
    (4.0, ("winter_tyres",), None),
    (18.0, (), None),
    (36.0, (), 20.0),
)
"""Outside temperature [°C], extras and load [kg]."""
MIN_SAVED_WH, MIN_SAVED_SHARE = 200.0, 0.02
LIMITS: Final = {"summer_tyres": (7.0, 60.0), "climate_off": (8.0, 30.0), "seats": (-60.0, 18.0)}
"""Code of an action -> temperatures [°C] between which it is possible."""
NEEDS: Final = {"no_roof_box": "roof_box", "summer_tyres": "winter_tyres"}
KNOWN: Final = {"slower", "calmer", "setpoint", "seats", "climate_off", *NEEDS, "less_luggage"}
"""Actions of somebody who leaves now with good tyres."""


def journeys() -> Iterator[tuple[tw.Plan, tw.Departure]]:
    """Yield twelve roads, each with a departure of its own."""
    for ((speed, km), (degc, extras, load)), soc in zip(
        itertools.product(SPEEDS_M_S, WEATHER), itertools.cycle((0.25, 0.4, 0.6, 0.9)), strict=False
    ):
        road = [{"length_m": 1000.0, "speed_m_s": speed, "grade": 0.0}] * km
        yield (
            tw.read_route(road),
            tw.Departure(soc, degc, extras=extras, payload_mass_kg=load, departs_at=NOW),
        )


def wrong(advice: dict[str, Any], energy_wh: float, departure: tw.Departure) -> Iterator[str]:
    """Yield what is wrong with the document of an advice."""
    least_wh = max(MIN_SAVED_WH, MIN_SAVED_SHARE * energy_wh)
    degc = departure.ambient_temperature_degc or 0.0
    for advised in advice["singly"]:
        if -advised["difference"]["energy_wh"] < least_wh:
            yield f"{advised['actions'][0]['code']} saves too little"
    for action in itertools.chain.from_iterable(a["actions"] for a in (*advice["singly"], *advice["least"])):
        code = action["code"]
        low, high = LIMITS.get(code, (-60.0, 60.0))
        if code not in KNOWN:
            yield f"{code} is no action of one who leaves now"
        elif not low <= degc <= high:
            yield f"{code} at {degc:g} °C"
        elif code in NEEDS and NEEDS[code] not in (departure.extras or ()):
            yield f"{code} without {NEEDS[code]}"
        elif code == "less_luggage" and action["value"] > (departure.payload_mass_kg or 0.0):
            yield "more luggage left than there is"
    yield from ("a set that is not enough" for a in advice["least"] if a["p_arrive"] < advice["probability"])


def rows(names: Sequence[str] = ()) -> Iterator[Row]:
    """Rows of all cars, or of those that are named."""
    counts, asked, actions = Counter[str](), 0, 0
    for name in names or vehicle_names():
        model, car = for_car(None, name), load_vehicle(name)
        for road, departure in journeys():
            advice = tw.advise(road, departure, model=model, now=NOW)
            document = advice.to_dict()
            faults = [*wrong(document, advice.forecast.energy_wh, departure)]
            for advised in advice.least:
                plan = advice.forecast.plan
                for action in advised.actions:
                    plan = action.apply_to(plan)
                if model.forecast(plan).p_arrive(advice.reserve) < advice.probability - 1e-9:
                    faults.append("a set that is not enough when it is forecast")
            if car.climate is None:
                faults += [
                    "climate without climate control"
                    for a in document["singly"]
                    if a["actions"][0]["code"] in ("setpoint", "seats")
                ]
            asked, actions = asked + 1, actions + len(advice.singly)
            counts.update(f"{name}: {fault}" for fault in faults)
    yield Row("journeys", float(asked))
    yield Row("actions", float(actions))
    yield Row("wrong actions", float(counts.total()), most=0, note="; ".join(counts)[:500])


def main() -> int:
    """Print the rows; 1 where one is missed."""
    return report(rows())


if __name__ == "__main__":
    run(main)
