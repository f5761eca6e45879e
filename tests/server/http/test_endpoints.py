"""The responses of the service have the numbers and the names of Python and of the command line."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import orjson
import pandas as pd
import pytest
from benchmarks.leave_with import OVER_HTTP, RESERVE, WORST, over_http
from tests.support.command import answered
from tests.support.service_fuzz import seeds
from tests.support.service_process import Service
from tools.quality.same_numbers import compared

import tripwatt as tw
from tripwatt.roads.journey import need, range_km
from tripwatt.trips.messages import leave_in_words

LINKS = [
    {"length_m": 800.0, "speed_m_s": 8.5, "grade": 0.01},
    {"length_m": 12000.0, "travel_time_s": 480.0, "grade": 0.0},
]


def command_line(*arguments: object) -> dict[str, Any]:
    """What `tripwatt forecast --json` prints."""
    return dict(json.loads(answered("forecast", *arguments, "--json").out))


def test_a_forecast_equals_that_of_the_command_line(
    service: Service, drive: dict[str, Any], tmp_path: Path
) -> None:
    pd.DataFrame(drive["samples"]).to_csv(tmp_path / "trip.csv", index=False)
    options = ("--soc", 0.8, "--ambient", -5, "--setpoint", 21, "--payload", 80, "--reserve", 0.3)
    assert service.forecast({**drive, "probability": 0.95}).json() == command_line(
        tmp_path / "trip.csv", *options
    )


def test_python_gives_the_numbers_of_the_service(service: Service) -> None:
    departure = tw.Departure(soc=0.6, ambient_temperature_degc=3.0)
    for vehicle in (None, "vw_id3"):
        own = tw.forecast(tw.read_route(LINKS), car=vehicle, departure=departure).to_dict(0.2)
        asked = {"links": LINKS, "soc": 0.6, "ambient_temperature_degc": 3.0, "reserve": 0.2}
        answer = service.forecast(asked | ({"car": vehicle} if vehicle else {})).json()
        names = (
            "energy_wh",
            "quantiles_wh",
            "soc_arrival",
            "soc_quantiles",
            "p_arrive_by_soc",
            "series",
            "by_cause_wh",
        )
        for name in names:
            found = compared(own[name], answer[name])
            assert (found.wrong, found.new) == ([], []), name
        assert answer["flags"] == own["flags"]


def test_an_update_uses_the_measurements(service: Service, drive: dict[str, Any], tmp_path: Path) -> None:
    time = drive["samples"]["time_s"][:150]
    observed = {"time_s": time, "voltage_v": [360.0] * 150, "current_a": [60.0] * 150}
    before = service.forecast(drive).json()
    after = service.client.post("/v1/forecast/update", json=drive | {"observed": observed}).json()
    assert after["measured_until_s"] == time[-1]
    assert after["energy_wh"] > before["energy_wh"] + 400.0  # 21.6 kW for 149 s are 894 Wh
    pd.DataFrame(drive["samples"]).to_csv(tmp_path / "trip.csv", index=False)
    pd.DataFrame(observed).to_csv(tmp_path / "seen.csv", index=False)
    options = ("--soc", 0.8, "--ambient", -5, "--setpoint", 21, "--payload", 80, "--reserve", 0.3)
    assert after == command_line(tmp_path / "trip.csv", *options, "--observed", tmp_path / "seen.csv")


def test_a_batch_returns_its_lines_in_order(service: Service, drive: dict[str, Any]) -> None:
    lines = [orjson.dumps(drive | {"trip": f"t{k}", "payload_mass_kg": 50.0 * k}) for k in range(5)]
    body = b"\n".join([*lines[:3], b"nonsense", b'{"links": 3}', *lines[3:]])
    headers = {"Content-Type": "application/x-ndjson"}
    answer = service.client.post("/v1/forecast/batch", content=body, headers=headers)
    found = [orjson.loads(line) for line in answer.content.splitlines()]
    assert [line.get("status", line.get("trip")) for line in found] == [
        *("t0", "t1", "t2"),
        *(400, 422),
        *("t3", "t4"),
    ]
    assert found[0] == service.forecast(orjson.loads(lines[0])).json()
    energies = [line["energy_wh"] for line in found if "energy_wh" in line]
    assert energies == sorted(energies)


@pytest.mark.parametrize("kind", ["application/gpx+xml", "text/csv", "application/json"])
def test_an_upload_returns_fields_of_a_request(service: Service, kind: str) -> None:
    uploads = [(path, body) for path, body in seeds()[kind] if path.startswith("/v1/routes")]
    assert uploads
    for path, body in uploads:
        answer = service.client.post(path, content=body, headers={"Content-Type": kind})
        assert answer.status_code == 200, answer.text
        found = answer.json()
        planned = {key: found[key] for key in ("links", "elevation") if found[key] is not None}
        forecast = service.forecast(planned or {"samples": found["samples"]}).json()
        assert forecast["series"]["distance_m"][-1] == pytest.approx(found["distance_m"], rel=0.02, abs=5.0)
        assert forecast["given"] == ("a planned route" if planned else "the driven speed trace")


def test_the_elevation_of_an_upload_is_used_in_its_forecast(service: Service) -> None:
    """Hills between the ends of the links cost energy."""
    points = [[11.5 + k / 500.0, 48.1, 500.0 + 30.0 * math.sin(k / 3.0)] for k in range(40)]
    line = {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": points},
        "properties": {"speed_m_s": 20.0},
    }
    headers = {"Content-Type": "application/geo+json"}
    found = service.client.post("/v1/routes", content=orjson.dumps(line), headers=headers).json()
    with_heights = service.forecast({"links": found["links"], "elevation": found["elevation"]}).json()
    flat = service.forecast({"links": found["links"]}).json()
    level = {"position_m": [0.0, found["elevation"]["position_m"][-1]], "elevation_m": [500.0, 500.0]}
    without_hills = service.forecast({"links": found["links"], "elevation": level}).json()
    assert with_heights["energy_wh"] > without_hills["energy_wh"] + 5.0
    assert any(flag["code"] == "unknown_climb" for flag in flat["flags"])
    assert not any(flag["code"] == "unknown_climb" for flag in with_heights["flags"])
    assert with_heights["climb"] is None
    assert flat["climb"]["terrain"] == "unknown"
    asked = service.forecast({"links": found["links"], "terrain": "flat"}).json()
    assert asked["climb"]["terrain"] == "flat"
    widths = [f["quantiles_wh"]["0.95"] - f["quantiles_wh"]["0.05"] for f in (asked, flat)]
    assert widths[0] < widths[1]
    assert (
        service.client.post("/v1/forecast", json={"links": found["links"], "terrain": "alps"}).status_code
        == 422
    )


def test_models_and_vehicles_have_names_for_requests(service: Service, drive: dict[str, Any]) -> None:
    models = service.client.get("/v1/models").json()["models"]
    cars = {car["name"]: car for car in service.client.get("/v1/vehicles").json()["vehicles"]}
    own = models[0]["model"]["car"]
    assert models[0]["name"] in cars[own]["models"]
    named = drive | {"model": models[0]["name"], "car": own}
    assert service.forecast(named).json() == service.forecast(drive).json()


FIGURES = {"mass_kg": 1830.0, "consumption_kwh_per_100km": 15.5, "body": "hatchback"}


def test_a_car_of_a_few_figures_is_described_and_forecast(service: Service, drive: dict[str, Any]) -> None:
    found = service.client.post("/v1/vehicles", json=FIGURES).json()
    assert found["wltp_kwh_per_100km"] == pytest.approx(15.5, rel=0.01)
    assert found["wltp_low_kwh_per_100km"] < 15.5 < found["wltp_high_kwh_per_100km"]
    assert (found["test_mass_kg"], found["anchor"]) == (1905.0, "certification")
    described = service.forecast(drive | {"car": FIGURES})
    assert described.status_code == 200
    assert described.json()["flags"][0]["code"] == "no_trips_of_car"
    boxed = service.forecast(drive | {"car": FIGURES, "extras": ["roof_box"]}).json()
    assert boxed["energy_wh"] > described.json()["energy_wh"]
    light = service.forecast(drive | {"car": {"mass_kg": 1}})
    assert (light.status_code, light.json()["faults"][0]["pointer"]) == (422, "/car/mass_kg")
    wrong = service.client.post("/v1/vehicles", json={"mass_kg": 1900.0, "consumption_kwh_per_100km": 59.0})
    assert wrong.status_code == 422
    assert "at most" in wrong.json()["faults"][0]["allowed"]
    assert service.client.post("/v1/vehicles", json={"wheels": 4}).status_code == 422


def test_examples_can_be_forecast_and_replayed(service: Service) -> None:
    for brief in service.client.get("/v1/examples").json()["examples"]:
        found = service.client.get(f"/v1/examples/{brief['trip']}").json()
        assert {k: found[k] for k in brief} == brief
        assert service.forecast(found["request"]).status_code == 200
        request = found["request"] | {"observed": found["observed"]}
        at_the_end = service.client.post("/v1/forecast/update", json=request).json()
        # the first second counts in full
        assert at_the_end["energy_wh"] == pytest.approx(brief["observed_energy_wh"], abs=5.0)


def test_who_leaves_with_the_charge_arrives_with_the_probability_asked_for(service: Service) -> None:
    found = list(over_http(service, OVER_HTTP))
    assert [one for one in found if one.off > WORST] == []
    for one in found:
        assert one.message == leave_in_words(one.soc, RESERVE, one.probability)
        assert one.message.startswith("A full battery is not enough") == (one.exception == "not even full")
    assert 0.5 * OVER_HTTP < sum(not one.exception for one in found) < OVER_HTTP


MOTORWAY = [{"length_m": 80_000.0, "speed_m_s": 33.0, "grade": 0.0}]


def test_advice_has_the_numbers_of_python(service: Service) -> None:
    request = {
        "links": MOTORWAY,
        "soc": 0.5,
        "ambient_temperature_degc": -5.0,
        "car": "vw_id3",
        "probability": 0.9,
    }
    found = service.client.post("/v1/advice", json=request)
    assert found.status_code == 200, found.text
    known = tw.Departure(soc=0.5, ambient_temperature_degc=-5.0)
    same = tw.advise(tw.read_route(MOTORWAY), known, "vw_id3", probability=0.9)
    assert found.json() == json.loads(json.dumps(same.to_dict()))


@pytest.mark.parametrize(
    "wrong", [{"probability": 0.2}, {"probability": None}, {"reserve": 3.0}, {"links": None}]
)
def test_what_cannot_be_asked_is_refused(service: Service, wrong: dict[str, object]) -> None:
    found = service.client.post("/v1/advice", json={"links": MOTORWAY, "soc": 0.5, **wrong})
    assert found.status_code == 422
    assert found.json()["faults"]


def test_a_difference_has_the_numbers_of_python(service: Service) -> None:
    one, other = ({"links": MOTORWAY, "soc": 0.5, "ambient_temperature_degc": degc} for degc in (-5.0, 5.0))
    found = service.client.post("/v1/forecast/difference", json={"one": one, "other": other})
    assert found.status_code == 200, found.text
    cold, mild = (
        tw.forecast(tw.read_route(MOTORWAY), tw.Departure(soc=0.5, ambient_temperature_degc=degc))
        for degc in (-5.0, 5.0)
    )
    assert found.json() == json.loads(json.dumps(cold.difference(mild).to_dict()))
    refused = service.client.post(
        "/v1/forecast/difference", json={"one": one, "other": {**other, "car": "vw_id3"}}
    )
    assert refused.status_code == 422
    assert "common part" in refused.text


COLD = tw.Departure(ambient_temperature_degc=-5.0)


def asked(service: Service, path: str, **query: Any) -> Any:
    return service.client.get(path, params={"ambient_temperature_degc": -5.0, **query})


def test_need_has_the_numbers_of_python(service: Service) -> None:
    found = asked(service, "/v1/need", distance_km=50, kind="motorway", trips=3, car="vw_id3").json()
    expected = need(50, "motorway", COLD, trips=3, car="vw_id3").to_dict()
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
        {"distance_km": 50, "car": "{"},
        {"distance_km": -1},
        {"distance_km": 50, "kind": "moon"},
        {"distance_km": 50, "probability": 1},
        {"distance_km": 50, "colour": "red"},
    ],
)
def test_what_cannot_be_needed_is_refused(service: Service, query: dict[str, Any]) -> None:
    found = asked(service, "/v1/need", **query)
    assert found.status_code == 422
    assert found.json()["faults"]
