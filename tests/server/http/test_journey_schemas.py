"""Bounds of every field of a journey, at the bound and beyond it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from tripwatt.errors import InvalidInput
from tripwatt.server.http.car_schemas import ColumnChoice, NewCarRequest
from tripwatt.server.http.journey_schemas import (
    NeedQuery,
    PlaceRequest,
    PlanRequest,
    RangeQuery,
    ReachRequest,
)
from tripwatt.server.http.live_schemas import TelemetryRequest
from tripwatt.server.http.schemas import check_request

PLACE = {"latitude_deg": 47.0, "longitude_deg": 9.0}
PLAN: dict[str, Any] = {"stops": [PLACE, "Ostheim"]}
REACH: dict[str, Any] = {"start": PLACE}


def is_valid(model: type[BaseModel], document: dict[str, Any]) -> bool:
    try:
        check_request(document, model)
    except InvalidInput:
        return False
    return True


@pytest.mark.parametrize(
    ("model", "others", "name", "low", "high"),
    [
        (PlaceRequest, PLACE, "latitude_deg", -90.0, 90.0),
        (PlaceRequest, PLACE, "longitude_deg", -180.0, 180.0),
        (ReachRequest, REACH, "wind_speed_m_s", 0.0, 60.0),
        (ReachRequest, REACH, "wind_from_deg", 0.0, 360.0),
        (ReachRequest, REACH, "rain_mm_h", 0.0, 200.0),
        (ReachRequest, REACH, "pressure_pa", 30_000.0, 110_000.0),
        (ReachRequest, REACH, "soc", 0.0, 1.0),
        (ReachRequest, REACH, "ambient_temperature_degc", -60.0, 57.0),
        (ReachRequest, REACH, "cabin_setpoint_degc", 0.0, 50.0),
        (ReachRequest, REACH, "cabin_temperature_degc", -60.0, 100.0),
        (ReachRequest, REACH, "battery_temperature_degc", -60.0, 100.0),
        (ReachRequest, REACH, "payload_mass_kg", 0.0, 60_000.0),
        (ReachRequest, REACH, "reserve", 0.0, 1.0),
        (PlanRequest, PLAN, "reserve", 0.0, 1.0),
    ],
)
def test_a_number_has_its_bounds(
    model: type[BaseModel], others: dict[str, Any], name: str, low: float, high: float
) -> None:
    assert is_valid(model, others | {name: low})
    assert is_valid(model, others | {name: high})
    assert not is_valid(model, others | {name: float(np.nextafter(low, -np.inf))})
    assert not is_valid(model, others | {name: float(np.nextafter(high, np.inf))})
    assert not is_valid(model, others | {name: str(low)})
    assert not is_valid(model, others | {name: float("nan")})


def test_a_journey_has_two_to_twenty_stops() -> None:
    assert [is_valid(PlanRequest, {"stops": ["a"] * k}) for k in (1, 2, 20, 21)] == [False, True, True, False]


def test_at_most_three_other_roads() -> None:
    found = [is_valid(PlanRequest, PLAN | {"alternatives": k}) for k in (-1, 0, 3, 4)]
    assert found == [False, True, True, False]


def test_a_stop_has_1_to_200_characters() -> None:
    found = [is_valid(ReachRequest, {"start": "x" * k}) for k in (0, 1, 200, 201)]
    assert found == [False, True, True, False]


def test_a_name_of_a_place_has_at_most_200_characters() -> None:
    assert [is_valid(PlaceRequest, PLACE | {"name": "x" * k}) for k in (0, 200, 201)] == [True, True, False]


@pytest.mark.parametrize("name", ["model", "vehicle"])
def test_a_model_and_a_car_have_at_most_100_characters(name: str) -> None:
    assert [is_valid(ReachRequest, REACH | {name: "x" * k}) for k in (100, 101)] == [True, False]


@pytest.mark.parametrize(
    ("model", "others", "name", "least", "most"),
    [
        (RangeQuery, {}, "model", 0, 100),
        (RangeQuery, {}, "vehicle", 1, 100),
        (RangeQuery, {}, "car", 0, 100),
        (RangeQuery, {}, "vehicle_figures", 0, 1000),
        (NeedQuery, {}, "trip", 0, 200),
        (TelemetryRequest, {"tlm": {}}, "token", 0, 200),
        (NewCarRequest, {"name": "a"}, "name", 1, 100),
        (NewCarRequest, {"name": "a"}, "vehicle", 0, 200),
        (ColumnChoice, {"column": "a"}, "column", 0, 500),
        (ColumnChoice, {"column": "a"}, "unit", 0, 20),
    ],
)
def test_a_text_has_a_length(
    model: type[BaseModel], others: dict[str, Any], name: str, least: int, most: int
) -> None:
    found = [is_valid(model, others | {name: "x" * k}) for k in (least, most, most + 1)]
    assert found == [True, True, False]
    assert is_valid(model, others | {name: ""}) == (least == 0)


@pytest.mark.parametrize(
    ("name", "taken", "refused"),
    [
        ("distance_km", [0.5, 2000.0], [0.49, 2000.1]),
        ("quantile", [0.5, 0.9999], [0.4999, 1.0]),
        ("trips", [1, 100], [0, 101]),
        ("probability", [0.5, 0.99], [0.4999, 0.9901]),
        ("plug_w", [0.0, 400_000.0], [-0.1, 400_000.1]),
        ("reserve", [0.0, 1.0], [-0.01, 1.01]),
    ],
)
def test_a_number_of_a_need_has_its_bounds(name: str, taken: list[float], refused: list[float]) -> None:
    assert [is_valid(NeedQuery, {name: value}) for value in (*taken, *refused)] == [True, True, False, False]


def test_the_defaults_of_a_need() -> None:
    usual = check_request({}, NeedQuery)
    assert (usual.quantile, usual.trips, usual.probability, usual.plug_w) == (0.95, 1, 0.9, 7400.0)
    assert (usual.kind, usual.reserve, usual.distance_km) == ("mixed", None, None)


def test_at_most_as_many_extras_as_there_are() -> None:
    found = [is_valid(ReachRequest, REACH | {"extras": ["trailer"] * k}) for k in (5, 6)]
    assert found == [True, False]


def test_a_departure_is_a_text_with_a_time_zone() -> None:
    found = check_request(PLAN | {"departs_at": "2026-02-01T07:30:00+01:00"}, PlanRequest)
    assert found.departs_at is not None
    assert found.departs_at.isoformat() == "2026-02-01T07:30:00+01:00"
    for other in ("2026-02-01T07:30:00", "2026-02-01", 1769927400, "1769927400", "07:30"):
        assert not is_valid(PlanRequest, PLAN | {"departs_at": other}), other


def test_the_defaults_of_a_journey() -> None:
    plan = check_request(PLAN, PlanRequest).model_dump(exclude_none=True)
    assert plan == {
        "stops": [PLACE | {"name": ""}, "Ostheim"],
        "reserve": 0.1,
        "alternatives": 0,
        "round_trip": False,
        "answers": True,
        "charge": True,
        "stop_overhead_s": 300.0,
        "preheat_battery": False,
    }
    assert check_request(REACH, ReachRequest).reserve == 0.0


@pytest.mark.parametrize(
    ("model", "others"),
    [(PlaceRequest, PLACE), (PlanRequest, PLAN), (ReachRequest, REACH)],
)
def test_unknown_fields_are_faults(model: type[BaseModel], others: dict[str, Any]) -> None:
    assert is_valid(model, others)
    assert not is_valid(model, others | {"colour": 1})
