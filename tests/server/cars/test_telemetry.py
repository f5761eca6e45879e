"""A message of a car becomes a sample: every unit and sign by value, and what cannot be one is left out with its fault."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripwatt.errors import InvalidInput
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp
from tripwatt.trips import COLUMNS

UTC = 1_700_000_000


def test_every_field_has_the_unit_of_the_schema() -> None:
    found = sample_from_abrp(
        {
            "utc": UTC,
            "speed": 90,
            "power": -20,
            "voltage": 400,
            "current": 999,
            "soc": 64.5,
            "elevation": 520,
            "ext_temp": -3.5,
            "cabin_temp": 21,
            "hvac_setpoint": 22,
            "batt_temp": 12,
            "hvac_power": 1.5,
            "lat": 48.1374,
            "lon": 11.5755,
            "is_charging": 0,
            "is_parked": 0,
            "car_model": "bmw:i3:14:60:other",
        }
    )
    assert found.time_s == UTC
    assert dict(found.values) == {
        "speed_m_s": pytest.approx(25.0, rel=1e-15),
        "voltage_v": 400.0,
        "current_a": -50.0,
        "displayed_soc": pytest.approx(0.645, rel=1e-15),
        "elevation_m": 520.0,
        "ambient_temperature_degc": -3.5,
        "cabin_temperature_degc": 21.0,
        "cabin_setpoint_degc": 22.0,
        "battery_temperature_degc": 12.0,
        "climate_power_w": 1500.0,
    }
    assert (found.charging, found.parked, found.faults) == (False, False, ())


def test_the_power_counts_before_the_current_and_needs_no_voltage() -> None:
    alone = sample_from_abrp({"utc": UTC, "speed": 0, "power": 7.4}).values
    no_current = sample_from_abrp({"utc": UTC, "power": 900, "voltage": 100}).values
    assert dict(no_current) == {"voltage_v": 100.0}, "9,000 A are no current of a car"
    assert alone["voltage_v"] * alone["current_a"] == pytest.approx(7400.0, rel=1e-12)
    assert alone["voltage_v"] == 370.0
    pair = sample_from_abrp({"utc": UTC, "speed": 0, "voltage": 350, "current": 10}).values
    assert (pair["voltage_v"], pair["current_a"]) == (350.0, 10.0)


@pytest.mark.parametrize("value", [True, 1, 1.0, "1", "true"])
def test_a_flag_may_be_a_number_a_text_or_true(value: Any) -> None:
    assert sample_from_abrp({"utc": UTC, "is_charging": value}).charging
    assert sample_from_abrp({"utc": UTC, "is_dcfc": value}).charging
    assert sample_from_abrp({"utc": UTC, "is_parked": value}).parked


@pytest.mark.parametrize("value", [False, 0, "0", None, 2, "no", [], {}])
def test_other_values_are_no_flag(value: Any) -> None:
    found = sample_from_abrp({"utc": UTC, "is_charging": value, "is_parked": value})
    assert (found.charging, found.parked, dict(found.values)) == (False, False, {})


def test_a_parked_car_stands_unless_it_sends_a_speed() -> None:
    assert sample_from_abrp({"utc": UTC, "is_parked": 1}).values == {"speed_m_s": 0.0}
    assert sample_from_abrp({"utc": UTC, "is_parked": 1, "speed": 3.6}).values == {"speed_m_s": 1.0}


def test_a_value_that_cannot_be_one_is_left_out_with_its_fault() -> None:
    found = sample_from_abrp({"utc": UTC, "speed": 36, "soc": 655.35, "batt_temp": "warm", "power": math.inf})
    assert dict(found.values) == {"speed_m_s": 10.0}
    assert {(f.where, f.got, f.allowed) for f in found.faults} == {
        ("soc", "655.35", "0 to 100"),
        ("batt_temp", "'warm'", "-60 to 100"),
        ("power", "inf", "-2000 to 2000"),
    }


@pytest.mark.parametrize(
    ("message", "what"),
    [
        ({}, "no known field"),
        ({"token": "x"}, "no known field"),
        ({"speed": 36}, "missing field"),
        ({"utc": None}, "missing field"),
        ({"utc": "now"}, "value out of range"),
        ({"utc": UTC * 1000}, "time out of range"),
        ({"utc": 0}, "time out of range"),
        ({"utc": math.nan}, "value out of range"),
        ([], "not an object"),
        (None, "not an object"),
    ],
)
def test_a_message_needs_a_time(message: Any, what: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        sample_from_abrp(message)
    assert caught.value.faults[0].what == what


def test_milliseconds_are_named() -> None:
    with pytest.raises(InvalidInput, match="looks like milliseconds"):
        sample_from_abrp({"utc": UTC * 1000})


def test_a_sample_has_columns_of_the_schema_within_their_bounds() -> None:
    with pytest.raises(InvalidInput) as caught:
        Sample(UTC, {"speed": 3.0, "soc": 1.5, "voltage_v": math.nan})
    assert [fault.where for fault in caught.value.faults] == ["speed", "soc", "voltage_v"]


ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
)
FIELDS = st.sampled_from(
    [
        "speed",
        "power",
        "voltage",
        "current",
        "soc",
        "elevation",
        "ext_temp",
        "hvac_power",
        "lat",
        "lon",
        "is_parked",
    ]
)


@given(st.dictionaries(FIELDS, ANY, max_size=8))
def test_any_message_gives_a_sample_whose_values_are_within_bounds(message: dict[str, Any]) -> None:
    found = sample_from_abrp({**message, "utc": UTC})
    assert all(
        COLUMNS[name].minimum <= value <= COLUMNS[name].maximum for name, value in found.values.items()
    )
    json.dumps(dict(found.values), allow_nan=False)
