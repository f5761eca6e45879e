"""Plan to drive: every answer that describes a road is accepted by every operation that takes one."""

from __future__ import annotations

from typing import Any

import orjson
import pytest
from tests.roads.journey.made import MADE, A, B

from tripwatt.errors import InvalidInput
from tripwatt.server.cars.plan import LivePlan
from tripwatt.server.http.example_requests import DRIVEN_REQUEST, PLANNED_REQUEST, UPLOADS
from tripwatt.server.http.fleets import PlannedTripRequest
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.schemas import RoadRequest, check_request
from tripwatt.server.http.settings import Limits
from tripwatt.trips import Plan

LEAVES = "2026-01-05T07:30:00Z"


@pytest.fixture(scope="module")
def jobs() -> Jobs:
    return Jobs.from_folders({}, Limits(), MADE)


@pytest.fixture(scope="module")
def journey(jobs: Jobs) -> dict[str, Any]:
    stops = [{"latitude_deg": place.latitude_deg, "longitude_deg": place.longitude_deg} for place in (A, B)]
    body = orjson.dumps({"stops": stops, "soc": 0.9, "ambient_temperature_degc": 5.0, "alternatives": 1})
    found: Any = jobs.run("plan", body)
    return orjson.loads(orjson.dumps(found))


@pytest.fixture(scope="module")
def answers(jobs: Jobs, journey: dict[str, Any]) -> dict[str, Any]:
    """Everything that describes a road: answers of the service, and what others write, by name."""
    written = {kind: one["example"] for kind, one in UPLOADS.items() if "example" in one}
    read = {}
    for kind, example in written.items():
        body = example.encode() if isinstance(example, str) else orjson.dumps(example)
        read[f"/v1/routes of {kind}"] = orjson.loads(orjson.dumps(jobs.run("route", body, speed_m_s=14.0)))
    roads = {f"road {number}": road for number, road in enumerate(journey["roads"])}
    requests = {"a planned request": dict(PLANNED_REQUEST), "a driven request": dict(DRIVEN_REQUEST)}
    return {**written, **read, **roads, **requests, "/v1/journeys": journey}


def requests_with(road: Any) -> dict[str, dict[str, Any]]:
    """A request of each operation that takes a road, by job."""
    request = {"route": road, "speed_m_s": 14.0, "soc": 0.8, "ambient_temperature_degc": 5.0}
    observed = {"time_s": [0.0, 10.0], "displayed_soc": [0.8, 0.8]}
    return {
        "forecast": request,
        "update": {**request, "observed": observed},
        "advice": request,
        "difference": {"one": request, "other": {**request, "soc": 0.7}},
        "live_plan": request,
    }


def takers() -> set[str]:
    """Names of the requests that take a road, among all of the service."""
    found, seen = set(), [RoadRequest]
    while seen:
        kind = seen.pop()
        found.add(kind.__name__)
        seen += kind.__subclasses__()
    return found


def test_the_table_has_every_request_that_takes_a_road() -> None:
    known = {"ForecastRequest", "UpdateRequest", "AdviceRequest", "LivePlanRequest", "PlannedTripRequest"}
    assert takers() == {"RoadRequest", *known}


def test_every_answer_with_a_road_is_taken_by_every_operation(jobs: Jobs, answers: dict[str, Any]) -> None:
    assert len(answers) >= 16
    for name, road in answers.items():
        for kind, request in requests_with(road).items():
            try:
                jobs.run(kind, orjson.dumps(request))
            except InvalidInput as error:
                raise AssertionError(f"{kind} refuses {name}") from error
        request = {"car": "van 12", "departs_at": LEAVES, "route": road, "speed_m_s": 14.0}
        trip = check_request(request, PlannedTripRequest, jobs).planned(0, jobs.limits)
        plan = LivePlan(jobs.with_road({"route": road, "speed_m_s": 14.0})).road
        assert isinstance(trip.road, Plan)
        assert trip.road.distance_m == pytest.approx(plan.distance_m, rel=1e-6), name


def test_a_road_of_a_journey_posted_back_has_the_forecast_of_the_journey(
    jobs: Jobs, journey: dict[str, Any]
) -> None:
    """The interval differs a little, because the factors of free flow are known to the journey alone."""
    for road in journey["roads"]:
        body = orjson.dumps({"route": road, "soc": 0.9, "ambient_temperature_degc": 5.0})
        back: Any = jobs.run("forecast", body)
        assert back["energy_wh"] == pytest.approx(road["forecast"]["energy_wh"], rel=1e-3)
        widths = [f["quantiles_wh"]["0.95"] - f["quantiles_wh"]["0.05"] for f in (back, road["forecast"])]
        assert widths[0] == pytest.approx(widths[1], rel=0.15)


@pytest.mark.parametrize(
    ("request_", "where"),
    [
        ({"route": {"links": [{"length_m": 5.0}]}}, "link 1"),
        ({"route": "no road at all"}, "route"),
        ({"route": 5}, "route"),
        ({"route": PLANNED_REQUEST, "links": PLANNED_REQUEST["links"]}, "route"),
        ({"route": PLANNED_REQUEST, "speed_m_s": "fast"}, "speed_m_s"),
        ({"route": {"roads": [{"samples": {"time_s": [0, 1]}}]}}, "samples"),
    ],
)
def test_a_route_that_is_none_is_named(jobs: Jobs, request_: dict[str, Any], where: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        jobs.run("forecast", orjson.dumps(request_))
    assert any(fault.where.startswith(where) for fault in caught.value.faults), caught.value
