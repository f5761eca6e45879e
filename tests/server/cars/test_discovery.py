"""Sensors that Home Assistant finds: their topics, and what their templates give of a published document."""

from __future__ import annotations

import jinja2
import pytest

from tripwatt.server.cars.discovery import discovery

DOCUMENT = {
    "seconds_since_message": 90.0,
    "soc": 0.655,
    "forecast": {
        "energy_wh": 4321.0,
        "soc_quantiles": {"0.05": 0.2111, "0.5": 0.3, "0.95": 0.3899},
        "p_arrive": 0.98765,
        "p_arrive_at_all": 0.9987,
    },
    "need": {
        "energy_quantile_wh": 5432.1,
        "soc_needed": 0.4567,
        "charge_wh": 2100.0,
        "charging_s": 5400.0,
        "departs_at": "2026-01-05T07:30:00+01:00",
        "preheat": {"starts_at": "2026-01-05T07:00:00+01:00"},
    },
    "range": {"range_m": 123_456.0},
}


def values(document: dict[str, object]) -> dict[str, object]:
    """Value of each sensor; templates run as in Home Assistant, with the document as `value_json`."""
    run = jinja2.Environment(autoescape=True)
    return {
        topic.split("/")[-2]: run.from_string(message["value_template"]).render(value_json=document)
        for topic, message in discovery("leaf", "tripwatt/leaf", "homeassistant")
    }


def test_templates_give_the_figures_in_the_units_of_the_sensors() -> None:
    assert values(DOCUMENT) == {
        "soc": "65.5",
        "energy": "4.32",
        "arrival": "30.0",
        "arrival_low": "21.1",
        "arrival_high": "39.0",
        "p_arrive": "98.8",
        "p_arrive_at_all": "99.9",
        "range": "123.0",
        "need": "5.43",
        "soc_needed": "45.7",
        "charge": "2.1",
        "silence": "1.5",
        "charging": "90.0",
        "departs_at": "2026-01-05T07:30:00+01:00",
        "preheat_at": "2026-01-05T07:00:00+01:00",
    }
    units = [message["unit_of_measurement"] for _, message in discovery("leaf", "t", "p")]
    assert units == ["%", "kWh", "%", "%", "%", "%", "%", "km", "kWh", "%", "kWh", "min", "min", None, None]


def test_what_is_unknown_has_no_figure() -> None:
    nothing = dict.fromkeys(DOCUMENT)
    assert set(values(nothing).values()) == {"None"}
    assert set(values({}).values()) == {"None"}
    zero = {**nothing, "soc": 0.0, "seconds_since_message": 0.0}
    assert {key: value for key, value in values(zero).items() if value != "None"} == {
        "soc": "0.0",
        "silence": "0.0",
    }
    on_a_trip = {
        **nothing,
        "need": {"energy_quantile_wh": 5432.1, "soc_needed": 0.4567, "charge_wh": None, "preheat": None},
    }
    assert {key: value for key, value in values(on_a_trip).items() if value != "None"} == {
        "need": "5.43",
        "soc_needed": "45.7",
    }


def test_figures_of_a_program_that_has_stopped_are_unavailable() -> None:
    messages = [message for _, message in discovery("leaf", "tripwatt", "ha")]
    assert {message["availability_topic"] for message in messages} == {"tripwatt"}
    assert {message["expire_after"] for message in messages} == {300}


@pytest.mark.parametrize(
    ("car", "node"), [("leaf", "tripwatt_leaf"), ("Mein Auto/ü", "tripwatt_Mein_Auto__")]
)
def test_topics_have_the_characters_that_home_assistant_allows(car: str, node: str) -> None:
    found = list(discovery(car, "tripwatt", "ha"))
    assert found[0][0] == f"ha/sensor/{node}/soc/config"
    assert len({message["unique_id"] for _, message in found}) == len(found) == 15
    assert {message["state_topic"] for _, message in found} == {f"tripwatt/{car}"}
    assert all(message["device"]["identifiers"] == [node] for _, message in found)
