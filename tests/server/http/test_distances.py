"""`GET /v1/need` and `GET /v1/range`: the numbers of Python, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest
from tests.support.service_process import Service

import tripwatt as tw
from tripwatt.roads.journey import need, range_km

COLD = tw.Departure(ambient_temperature_degc=-5.0)


def asked(service: Service, path: str, **query: Any) -> Any:
    return service.client.get(path, params={"ambient_temperature_degc": -5.0, **query})


def test_need_has_the_numbers_of_python(service: Service) -> None:
    found = asked(service, "/v1/need", distance_km=50, kind="motorway", trips=3, vehicle="vw_id3").json()
    expected = need(50, "motorway", COLD, trips=3, vehicle="vw_id3").to_dict()
    assert {name: found[name] for name in expected} == expected
    assert found["target_soc"] == min(found["soc_needed"], 1.0)
    assert found["preheat"]["before_s"] > 0.0


def test_range_has_the_numbers_of_python(service: Service) -> None:
    found = asked(service, "/v1/range", soc=0.35, reserve=0.1).json()
    assert found == range_km(0.35, departure=COLD, reserve=0.1).to_dict()


@pytest.mark.parametrize(
    "query",
    [
        {"distance_km": 50, "trip": "x", "car": "y"},
        {"trip": "x"},
        {},
        {"distance_km": 50, "car": "x", "vehicle": "vw_id3"},
        {"distance_km": -1},
        {"distance_km": 50, "kind": "moon"},
        {"distance_km": 50, "quantile": 1},
        {"distance_km": 50, "colour": "red"},
    ],
)
def test_what_cannot_be_asked_is_refused(service: Service, query: dict[str, Any]) -> None:
    found = asked(service, "/v1/need", **query)
    assert found.status_code == 422
    assert found.json()["faults"]
