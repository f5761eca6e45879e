"""`POST /v1/advice`: the numbers of Python, and what is refused."""

from __future__ import annotations

import json

import pytest
from tests.support.service_process import Service

import tripwatt as tw

LINKS = [{"length_m": 80_000.0, "speed_m_s": 33.0, "grade": 0.0}]


def test_advice_has_the_numbers_of_python(service: Service) -> None:
    request = {
        "links": LINKS,
        "soc": 0.5,
        "ambient_temperature_degc": -5.0,
        "vehicle": "vw_id3",
        "chance": 0.9,
    }
    found = service.client.post("/v1/advice", json=request)
    assert found.status_code == 200, found.text
    known = tw.Departure(soc=0.5, ambient_temperature_degc=-5.0)
    same = tw.advise(tw.read_route(LINKS), known, "vw_id3", chance=0.9)
    assert found.json() == json.loads(json.dumps(same.to_dict()))


@pytest.mark.parametrize("wrong", [{"chance": 0.2}, {"chance": None}, {"reserve": 3.0}, {"links": None}])
def test_what_cannot_be_asked_is_refused(service: Service, wrong: dict[str, object]) -> None:
    found = service.client.post("/v1/advice", json={"links": LINKS, "soc": 0.5, **wrong})
    assert found.status_code == 422
    assert found.json()["faults"]


def test_a_difference_has_the_numbers_of_python(service: Service) -> None:
    one, other = ({"links": LINKS, "soc": 0.5, "ambient_temperature_degc": degc} for degc in (-5.0, 5.0))
    found = service.client.post("/v1/forecast/difference", json={"one": one, "other": other})
    assert found.status_code == 200, found.text
    cold, mild = (
        tw.forecast(tw.read_route(LINKS), tw.Departure(soc=0.5, ambient_temperature_degc=degc))
        for degc in (-5.0, 5.0)
    )
    assert found.json() == json.loads(json.dumps(cold.difference(mild).to_dict()))
    refused = service.client.post(
        "/v1/forecast/difference", json={"one": one, "other": {**other, "vehicle": "vw_id3"}}
    )
    assert refused.status_code == 422
    assert "common part" in refused.text
