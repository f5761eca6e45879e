"""The page on charge planning: its requests, its answer and the fields that its configurations read."""

from __future__ import annotations

import datetime as dt
import json
import math
import re
import shlex
import shutil
import subprocess
from typing import Any
from urllib.parse import parse_qs

import jinja2
import pytest
import yaml
from tests.server.http.test_live import Served, jobs, message, served
from tests.support import ROOT

__all__ = ["jobs", "served"]

PAGE = ROOT / "docs" / "howto" / "charge-planning.md"


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)


def answered(served: Served) -> dict[str, Any]:
    """The answer to the requests of the page, of the car of the tests."""
    put, get = (shlex.split(line) for line in blocks("sh")[0].splitlines())
    served.send(message(0.0, speed=0, soc=30.0))
    served.put(json.loads(put[put.index("--json") + 1]))
    path, _, query = get[-1].replace("my-leaf", "leaf").removeprefix("localhost:8000").partition("?")
    found = served(path, params={name: values[0] for name, values in parse_qs(query).items()})
    assert found.status_code == 200, found.text
    return {**found.json(), "car": "my-leaf"}


def test_the_answer_of_the_page_is_that_of_the_service(served: Served) -> None:
    (shown,) = map(json.loads, blocks("json"))
    found = answered(served)
    assert {"code", "message"} <= set(found.pop("flags")[0])  # the page names them below
    assert list(shown) == list(found)
    assert_rounded(shown, found)


def assert_rounded(shown: Any, found: Any) -> None:
    """Check that each number shown is the number found, rounded to its digits."""
    if isinstance(shown, dict):
        assert shown.keys() == found.keys()
        shown, found = [*shown.values()], [found[name] for name in shown]
    if isinstance(shown, list):
        for pair in zip(shown, found, strict=True):
            assert_rounded(*pair)
    else:
        digits = len(f"{shown}".partition(".")[2])
        assert shown == (round(found, digits) if isinstance(shown, float) else found)


def configurations() -> list[dict[str, Any]]:
    """The YAML of the page; a secret is its name."""
    loader = type("Loader", (yaml.SafeLoader,), {})
    loader.add_constructor("!secret", lambda load, node: node.value)
    return [yaml.load(text, loader) for text in blocks("yaml")]


def filled(template: str, **known: Any) -> str:
    """A template as Home Assistant fills it: its functions that the page calls, in UTC."""
    today = dt.datetime(2026, 1, 4, tzinfo=dt.UTC)
    made = jinja2.Environment(undefined=jinja2.StrictUndefined)
    made.globals |= {
        "now": lambda: today.replace(hour=20),
        "timedelta": dt.timedelta,
        "today_at": lambda clock: dt.datetime.combine(today, dt.time.fromisoformat(clock), dt.UTC),
        "is_number": lambda text: text.replace(".", "", 1).isdigit(),
        "states": lambda name: known["sensors"][name][0],
        "state_attr": lambda name, of: known["sensors"][name][1][of],
    }
    made.filters |= {
        "as_timestamp": lambda at: (dt.datetime.fromisoformat(at) if isinstance(at, str) else at).timestamp(),
        "timestamp_custom": lambda at, form, local: dt.datetime.fromtimestamp(at, dt.UTC).strftime(form),
    }
    return made.from_string(template).render(**known)


def test_the_sensors_and_automations_of_the_page_take_the_answer(served: Served) -> None:
    found = answered(served)
    rest, automations, _, evcc, emhass = configurations()
    (source,) = rest["rest"]
    assert "ambient_temperature_degc=-3.5&departs_at=2026-01-05T07:00:00Z" in filled(
        source["resource_template"], sensors={"weather.home": ("cloudy", {"temperature": -3.5})}
    )
    sensors: dict[str, tuple[str, dict[str, Any]]] = {}
    for sensor in source["sensor"]:
        value = filled(sensor["value_template"], value_json=found)
        attributes = {name: found[name] for name in sensor.get("json_attributes", ())}
        sensors["sensor." + sensor["name"].lower().replace(" ", "_")] = value, attributes
    assert sensors["sensor.charge_to_leave_with"][0] == f"{math.ceil(100 * found['target_soc'])}.0"
    assert sensors["sensor.start_of_preheating"][0] == found["preheat"]["starts_at"]
    nothing = filled(source["sensor"][2]["value_template"], value_json=found | {"preheat": None})
    assert nothing == "None"
    _, preheat = automations["automation"]
    (ready,), (heat,) = preheat["conditions"], preheat["actions"]
    assert preheat["triggers"][0]["at"] in sensors
    assert filled(ready["value_template"], sensors=sensors) == "True"
    assert float(filled(heat["data"]["temperature"], sensors=sensors)) == found["preheat"]["cabin_degc"]
    ((plan,),) = [one["actions"] for one in evcc["automation"]]
    asked = {name: filled(value, sensors=sensors) for name, value in plan["data"].items()}
    url = filled(evcc["rest_command"]["evcc_plan"]["url"], **asked)
    assert url.endswith(f"/plan/soc/{math.ceil(100 * found['target_soc'])}/2026-01-05T07:30:00Z")
    calls = dict(re.findall(r'`(\w+): "(\{\{.*?\}\})"`', PAGE.read_text("utf-8")))
    given = {name: float(filled(value, sensors=sensors)) for name, value in calls.items()}
    assert given == {"charging_s": found["charging_s"], "preheat_wh": found["preheat"]["wall_wh"]}
    payload = json.loads(filled(emhass["rest_command"]["emhass_day"]["payload"], **given))
    assert [len(value) for value in payload.values() if isinstance(value, list)] == [2, 2, 2, 2]
    hours = payload["operating_hours_of_each_deferrable_load"]
    assert 0.0 <= hours[0] - found["charging_s"] / 3600.0 < 0.5
    assert hours[0] % 0.5 == 0.0  # whole steps
    watts = payload["nominal_power_of_deferrable_loads"]
    assert watts[1] * hours[1] == pytest.approx(found["preheat"]["wall_wh"], abs=0.5)


EVCC_PLUGIN = {
    "source",
    "uri",
    "method",
    "headers",
    "body",
    "jq",
    "scale",
    "insecure",
    "auth",
    "timeout",
    "cache",
}
"""What evcc's plugin `http` takes, by its published source; its program is on no index that tests reach."""


@pytest.mark.skipif(shutil.which("jq") is None, reason="needs jq")
def test_the_vehicle_of_evcc_reads_the_charge(served: Served) -> None:
    (vehicle,) = configurations()[2]["vehicles"]
    answered(served)
    plugin = vehicle["soc"]
    assert set(vehicle) == {"name", "type", "title", "capacity", "soc"}
    assert set(plugin) <= EVCC_PLUGIN
    assert (vehicle["type"], plugin["source"]) == ("custom", "http")
    path = plugin["uri"].removeprefix("http://192.0.2.10:8000").replace("my-leaf", "leaf")
    found = served(path).text
    made = subprocess.run(["jq", plugin["jq"]], input=found, capture_output=True, text=True, check=True)
    assert float(made.stdout) == pytest.approx(30.0)


@pytest.mark.skipif(shutil.which("jq") is None, reason="needs jq")
def test_the_filter_of_the_shell_makes_the_address_of_evcc(served: Served) -> None:
    found = answered(served)
    (line,) = re.findall(r"jq -r '(.*)'", blocks("sh")[1])
    made = subprocess.run(
        ["jq", "-r", line], input=json.dumps(found), capture_output=True, text=True, check=True
    )
    percent = math.ceil(100 * found["target_soc"])
    assert made.stdout == f"localhost:7070/api/vehicles/leaf/plan/soc/{percent}/2026-01-05T07:30:00+00:00\n"


def test_every_request_of_the_page_asks_what_the_service_takes(served: Served) -> None:
    asked = re.findall(r"/v1/need\?(car[^\s'\"`{]+)", PAGE.read_text("utf-8"))
    assert len(asked) == 4
    answered(served)
    for query in asked:
        given = re.sub(r"&\w+=$", "", query.replace("my-leaf", "leaf"))
        parameters = {name: values[0] for name, values in parse_qs(given).items()}
        assert set(parameters) <= {"car", "probability", "reserve", "plug_w", "departs_at", "distance_km"}
        assert served("/v1/need", params=parameters).status_code == 200


def test_a_distance_of_a_car_with_a_plan_has_its_own_departure(served: Served) -> None:
    """The time of departure of a plan belongs to the plan alone, that of a query to its answer."""
    answered(served)
    leaves = "2030-01-12T07:30:00+00:00"
    found = served("/v1/need", params={"car": "leaf", "distance_km": 40, "departs_at": leaves}).json()
    assert found["departs_at"] == leaves
    assert found["preheat"] is None or found["preheat"]["starts_at"] < leaves
