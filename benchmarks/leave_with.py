"""The charge to leave with: python -m benchmarks.leave_with [--cars N].

Every car of the library is asked on five roads, from plans with several charges, for the charge to leave with. The trip is then
forecast again from that charge: its probability to arrive with the reserve has to be the one that was asked for, unless
any charge gives more, or a full battery does not suffice. A hundred seeded questions also go over HTTP. Printed are the largest deviation, the largest difference between the
plans of one trip, and how often each exception was answered.
"""

from __future__ import annotations

import itertools
import random
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.support.service_process import Service, serving
from tools.command import run

import tripwatt as tw
from benchmarks.measure import Row, report
from tripwatt.forecasting import Forecast, ForecastModel
from tripwatt.forecasting.leaving import soc_needed
from tripwatt.population import for_car
from tripwatt.trips import Departure, Plan
from tripwatt.vehicles import vehicle_names

ROADS: Final = {
    "town": ((700.0, 8.0, 300.0, 300.0),) * 12,
    "country": ((60_000.0, 20.0, 300.0, 340.0),),
    "motorway": ((180_000.0, 33.0, 200.0, 450.0),),
    "pass": ((14_000.0, 14.0, 600.0, 1500.0), (14_000.0, 14.0, 1500.0, 600.0)),
    "descent": ((14_000.0, 14.0, 1600.0, 700.0),),
}
"""Name of a road -> length [m], speed [m/s] and elevation [m] at both ends of its links."""
LINK: Final = ("length_m", "speed_m_s", "start_elevation_m", "end_elevation_m")
CHARGES: Final = (None, 0.05, 0.2, 0.5, 1.0)
PROBABILITIES: Final = (0.5, 0.9, 0.95)
RESERVE: Final = 0.1
KNOWN: Final = Departure(ambient_temperature_degc=5.0, cabin_setpoint_degc=21.0)

WORST: Final = 0.01
OVER_HTTP: Final = 100


@dataclass(frozen=True, slots=True)
class Answer:
    """One question and its answer: `chance` is that of the forecast that leaves with `soc`, or with a full battery."""

    car: str
    road: str
    charge: float | None
    probability: float
    soc: float
    chance: float
    message: str = ""

    @property
    def exception(self) -> str:
        """Empty, or why the chance is not the one asked for: `any charge` or `not even full`."""
        if self.soc <= 0.0 and self.chance >= self.probability:
            return "any charge"
        return "not even full" if self.soc > 1.0 and self.chance <= self.probability else ""

    @property
    def off(self) -> float:
        """Difference of the chance from the one asked for; 0 with an exception."""
        return 0.0 if self.exception else abs(self.chance - self.probability)


def links_of(road: str) -> list[dict[str, float]]:
    """The links of a road of `ROADS`, as a request has them."""
    return [dict(zip(LINK, values, strict=True)) for values in ROADS[road]]


def plan_of(road: str) -> Plan:
    """The plan of a road of `ROADS`."""
    return tw.read_route(links_of(road)).with_departure(KNOWN)


def question(model: ForecastModel, plan: Plan, charge: float | None) -> Forecast:
    """The forecast of a plan that has this charge."""
    return model.forecast(plan, Departure(soc=charge))


def answers(cars: Sequence[str]) -> Iterator[Answer]:
    """Every question of these cars."""
    base = tw.load_model()
    plans = {road: plan_of(road) for road in ROADS}
    for car in cars:
        model = for_car(base, car)
        for (road, plan), charge in itertools.product(plans.items(), CHARGES):
            asked = question(model, plan, charge)
            for probability in PROBABILITIES:
                soc = soc_needed(asked, RESERVE, probability)
                leaving = question(model, plan, min(max(soc, 0.0), 1.0))
                yield Answer(car, road, charge, probability, soc, leaving.p_arrive(RESERVE))


def over_http(service: Service, count: int) -> Iterator[Answer]:
    """So many seeded questions to a running service."""
    known = {name: value for name, value in KNOWN.to_dict().items() if value is not None}
    every = list(itertools.product(sorted(vehicle_names()), ROADS, CHARGES, PROBABILITIES))
    for car, road, charge, probability in random.Random(9).sample(every, count):
        trip = {**known, "links": links_of(road), "car": car, "reserve": RESERVE}
        asked = service.forecast({**trip, "soc": charge, "probability": probability}).raise_for_status()
        leave_with = asked.json()["leave_with"]
        soc, message = leave_with["soc_needed"], leave_with["message"]
        leaving = service.forecast({**trip, "soc": min(soc, 1.0)}).raise_for_status()
        chance = leaving.json()["p_arrive_by_soc"][f"{RESERVE:g}"]
        yield Answer(car, road, charge, probability, soc, chance, message)


def spread(answered: Sequence[Answer]) -> float:
    """Largest difference of the charge to leave with between plans of one trip that have other charges."""
    by_trip: dict[tuple[str, str, float], list[float]] = {}
    for one in answered:
        by_trip.setdefault((one.car, one.road, one.probability), []).append(one.soc)
    return max(max(values) - min(values) for values in by_trip.values())


def rows(cars: Sequence[str] | None = None) -> Iterator[Row]:
    """The rows of the benchmark, over the whole library unless cars are given."""
    answered = list(answers(vehicle_names() if cars is None else cars))
    with tempfile.TemporaryDirectory() as scratch, serving(Path(scratch), "--workers", "1") as service:
        asked = list(over_http(service, OVER_HTTP))
    text = "charge to leave with"
    yield Row(f"{text}: questions answered", len(answered))
    for why in ("any charge", "not even full"):
        yield Row(f"of them: {why}", sum(one.exception == why for one in answered))
    chance = "largest difference of the chance to arrive from the one asked for"
    yield Row(f"{text}: {chance}", max(one.off for one in answered), most=WORST)
    yield Row(
        f"{text}: answers off by more without a reason", sum(one.off > WORST for one in answered), most=0
    )
    yield Row(f"{text}: largest difference between plans with other charges", spread(answered), most=0.001)
    yield Row(
        f"{text} over HTTP, {OVER_HTTP} seeded questions: {chance}", max(one.off for one in asked), most=WORST
    )


def main(cars: int = 0) -> int:
    """Print the rows of all cars, or of a seeded sample of so many; 1 when a bound is missed."""
    names = sorted(vehicle_names())
    return report(rows(random.Random(1).sample(names, cars) if cars else names))


if __name__ == "__main__":
    run(main)
