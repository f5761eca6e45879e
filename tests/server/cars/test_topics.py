"""Topics of single metrics become samples: units, signs, times, holding and flags by value."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support import ROOT

from tripwatt.errors import InvalidInput, or_none
from tripwatt.server.cars.telemetry import Sample, format_of
from tripwatt.server.cars.topics import SLOW_HOLD_S, TIME_WAIT_S, TopicJoiner

T0 = 1_700_000_000.0
OVMS, TESLA = "ovms/me/leaf/metric", "teslamate/cars/1"


def ovms(joiner: TopicJoiner, metric: str, value: object, at_s: float = T0, **more: bool) -> Sample | None:
    return joiner.take(f"{OVMS}/{metric.replace('.', '/')}", f"{value}".encode(), at_s, **more)


def tesla(joiner: TopicJoiner, metric: str, value: object, at_s: float = T0, **more: bool) -> Sample | None:
    return joiner.take(f"{TESLA}/{metric}", f"{value}".encode(), at_s, **more)


def test_the_metrics_of_ovms_are_joined_by_the_time_of_the_car() -> None:
    joiner = TopicJoiner("ovms", OVMS + "/")
    sent = {
        "m.time.utc": int(T0),
        "v.p.speed": 90,
        "v.b.voltage": 360.5,
        "v.b.current": -12,
        "v.b.soc": 55.5,
        "v.p.altitude": 500,
        "v.e.temp": -3,
        "v.e.cabintemp": 20,
        "v.b.temp": 8,
        "v.p.odometer": 12345,
        "v.e.on": "yes",
    }
    assert [ovms(joiner, name, value, T0 + 77.0) for name, value in sent.items()] == [None] * len(sent)
    found = ovms(joiner, "m.time.utc", int(T0) + 1, T0 + 78.0)
    assert found == Sample(
        T0,
        {
            "speed_m_s": 25.0,
            "voltage_v": 360.5,
            "current_a": -12.0,
            "displayed_soc": 0.555,
            "elevation_m": 500.0,
            "ambient_temperature_degc": -3.0,
            "cabin_temperature_degc": 20.0,
            "battery_temperature_degc": 8.0,
        },
    )
    assert ovms(joiner, "m.time.utc", int(T0) + 2) is None, "nothing came in this second"


def test_the_values_of_teslamate_are_joined_by_the_second_of_their_arrival() -> None:
    joiner = TopicJoiner("teslamate", TESLA)
    assert tesla(joiner, "speed", 108, T0 + 0.1) is None
    assert tesla(joiner, "power", -7, T0 + 0.9) is None
    assert tesla(joiner, "battery_level", 60, T0 + 0.95) is None
    found = tesla(joiner, "speed", 104, T0 + 1.0)
    assert found is not None
    assert (found.time_s, found.values["speed_m_s"], found.values["soc"]) == (T0, 30.0, 0.6)
    assert found.values["voltage_v"] * found.values["current_a"] == pytest.approx(-7000.0, rel=1e-12)
    last = joiner.flush()
    assert last is not None
    assert (last.time_s, last.values["current_a"]) == (T0 + 1.0, -20.0)
    assert joiner.flush() is None


def test_a_value_holds_while_only_others_change() -> None:
    joiner = TopicJoiner("teslamate", TESLA)
    for name, value in (("speed", 36), ("power", 7), ("outside_temp", 4.5)):
        tesla(joiner, name, value)

    def columns(at_s: float) -> set[str]:
        tesla(joiner, "elevation", 500, at_s)
        found = joiner.flush()
        assert found is not None
        return set(found.values)

    slow = {"elevation_m", "ambient_temperature_degc"}
    fast = {"speed_m_s", "voltage_v", "current_a"}
    assert columns(T0 + 30.0) == slow | fast
    assert columns(T0 + 31.0) == slow
    assert columns(T0 + SLOW_HOLD_S) == slow
    assert columns(T0 + SLOW_HOLD_S + 1.0) == {"elevation_m"}


def test_what_the_broker_kept_is_no_speed_and_no_power() -> None:
    joiner = TopicJoiner("teslamate", TESLA)
    for name, value in (("speed", 36), ("power", 7), ("battery_level", 50), ("shift_state", "D")):
        tesla(joiner, name, value, retained=True)
    found = joiner.flush()
    assert found is not None
    assert dict(found.values) == {"soc": 0.5}
    timed = TopicJoiner("ovms", OVMS)
    ovms(timed, "m.time.utc", T0 - 1e6, retained=True)
    ovms(timed, "v.b.soc", 50, retained=True)
    ovms(timed, "m.time.utc", T0)
    ovms(timed, "v.p.speed", 36)
    found = timed.flush()
    assert found == Sample(T0, {"displayed_soc": 0.5, "speed_m_s": 10.0})


def test_a_sender_without_its_time_is_awaited_and_then_joined_by_arrival() -> None:
    joiner = TopicJoiner("ovms", OVMS)
    assert ovms(joiner, "v.p.speed", 36, T0) is None
    assert joiner.flush() is None
    assert ovms(joiner, "v.p.speed", 36, T0 + TIME_WAIT_S - 0.5) is None
    assert joiner.flush() is None
    ovms(joiner, "v.p.speed", 72, T0 + TIME_WAIT_S)
    assert joiner.flush() == Sample(T0 + TIME_WAIT_S, {"speed_m_s": 20.0})


def test_flags_are_those_of_the_sender() -> None:
    joiner = TopicJoiner("teslamate", TESLA)
    tesla(joiner, "speed", 3.6)
    tesla(joiner, "shift_state", "P")
    found = joiner.flush()
    assert found == Sample(T0, {"speed_m_s": 0.0}, parked=True)
    tesla(joiner, "shift_state", "D", T0 + 1.0)
    tesla(joiner, "state", "charging", T0 + 1.0)
    found = joiner.flush()
    assert found is not None
    assert (found.parked, found.charging, found.values["speed_m_s"]) == (False, True, 1.0)
    other = TopicJoiner("ovms", OVMS)
    ovms(other, "m.time.utc", T0)
    ovms(other, "v.c.charging", "yes")
    ovms(other, "v.e.on", "no")
    found = other.flush()
    assert found == Sample(T0, {"speed_m_s": 0.0}, charging=True, parked=True)


@pytest.mark.parametrize(
    "payload", [b"nan", b"inf", b"fast", b"-1", b"999", b"1" * 65, b"1" * 10**6, b"\xff"]
)
def test_a_payload_that_is_no_value_is_left_out_with_the_fault_of_a_whole_message(payload: bytes) -> None:
    joiner = TopicJoiner("teslamate", TESLA)
    tesla(joiner, "battery_level", 50)
    assert joiner.take(f"{TESLA}/speed", payload, T0) is None
    assert joiner.take("teslamate/cars/2/speed", b"-1", T0) is None
    assert joiner.take(f"{TESLA}/odometer", b"-1", T0) is None
    found = joiner.flush()
    assert found is not None
    assert (found.time_s, found.values) == (T0, {"soc": 0.5})
    text = payload.decode("utf-8", "replace")[:64]
    whole = format_of("teslamate").sample({"battery_level": 50, "speed": text}, T0)
    assert found.faults == whole.faults
    assert [fault.where for fault in found.faults] == ["speed"]
    tesla(joiner, "battery_level", 50, T0 + 1.0)
    assert joiner.flush() == Sample(T0 + 1.0, {"soc": 0.5}), "a fault is told once"


@pytest.mark.parametrize("payload", [b"", b"unknown", b"Unavailable", b"None", b"null"])
def test_a_text_for_a_missing_value_is_no_fault(payload: bytes) -> None:
    joiner = TopicJoiner("teslamate", TESLA)
    assert joiner.take(f"{TESLA}/speed", payload, T0) is None
    assert joiner.flush() is None
    message = {"battery_level": 50, "speed": payload.decode()}
    assert format_of("teslamate").sample(message, T0) == Sample(T0, {"soc": 0.5})


def test_a_time_that_cannot_be_one_is_refused_and_the_next_one_counts() -> None:
    joiner = TopicJoiner("ovms", OVMS)
    ovms(joiner, "m.time.utc", 1000.0 * T0)
    ovms(joiner, "v.p.speed", 36)
    with pytest.raises(InvalidInput, match="milliseconds"):
        ovms(joiner, "m.time.utc", T0)
    with pytest.raises(InvalidInput, match=r"m\.time\.utc"):
        ovms(joiner, "m.time.utc", "now")
    ovms(joiner, "v.p.speed", 72)
    assert joiner.flush() == Sample(T0, {"speed_m_s": 20.0})


def test_a_value_that_cannot_be_one_gives_a_sample_that_is_counted_as_faulty() -> None:
    joiner = TopicJoiner("teslamate", TESLA)
    tesla(joiner, "power", 1e9)
    found = joiner.flush()
    assert found is not None
    assert (dict(found.values), [fault.where for fault in found.faults]) == ({}, ["power"])


def test_messages_of_abrp_come_in_one_topic() -> None:
    joiner = TopicJoiner("abrp", "car/tlm")
    message = {"utc": T0, "speed": 36}
    for content in (message, {"tlm": message}):
        assert joiner.take("car/tlm", json.dumps(content).encode(), 0.0) == Sample(T0, {"speed_m_s": 10.0})
    assert joiner.take("car/tlm", json.dumps(message).encode(), 0.0, retained=True) is None
    assert joiner.take("car/tlm", b"", T0) is None, "as a kept message is erased"
    for payload, what in (
        *((text, "not JSON") for text in (b"{", b"\xff", b"[" * 65_537, b"[" * 60_000)),
        *((text, "not an object") for text in (b"[]", b"7")),
        *((text, "no known field") for text in (b"{}", b'{"token": "secret"}')),
        (json.dumps({"utc": 1000.0 * T0}).encode(), "milliseconds"),
    ):
        with pytest.raises(InvalidInput, match=what) as refused:
            joiner.take("car/tlm", payload, T0)
        assert "secret" not in f"{refused.value}"
        assert len(f"{refused.value}") < 400
    assert joiner.take("car/other", json.dumps(message).encode(), 0.0) is None
    assert joiner.flush() is None


def test_locations_of_owntracks_have_speed_and_height_and_no_charge_of_the_phone() -> None:
    joiner = TopicJoiner("owntracks", "owntracks/me/phone")

    def take(**fields: object) -> Sample | None:
        return joiner.take("owntracks/me/phone", json.dumps(fields).encode(), T0 + 5.0)

    sent = {"tst": T0, "vel": 72, "alt": 450, "lat": 48.1, "lon": 11.6, "batt": 85, "acc": 12, "cog": 270}
    expected = Sample(T0, {"speed_m_s": 20.0, "elevation_m": 450.0})
    assert take(_type="location", **sent) == expected
    assert take(_type="location", **sent, t="u", conn="m", topic="owntracks/me/phone") == expected
    for kind in ("lwt", "transition", "waypoint", "cmd", "card", "status"):
        assert take(_type=kind, **sent) is None
    assert joiner.take("owntracks/me/phone/event", json.dumps(sent).encode(), T0) is None
    assert joiner.flush() is None


PAGE = ROOT / "docs" / "howto" / "live.md"


def test_statestream_of_home_assistant_is_read_by_the_mapping_of_the_documentation(tmp_path: Path) -> None:
    (example,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    file = tmp_path / "car.toml"
    file.write_text(example)
    joiner = TopicJoiner(f"{file}", "statestream/sensor")
    given = {"ev_speed": 72, "ev_soc": 65, "kitchen": 21}
    for name, value in given.items():
        assert joiner.take(f"statestream/sensor/{name}/state", f"{value}".encode(), T0 + 0.2) is None
        assert joiner.take(f"statestream/sensor/{name}/unit_of_measurement", b'"km/h"', T0 + 0.2) is None
    assert joiner.take("statestream/sensor/ev_speed/state", b"unavailable", T0 + 0.3) is None
    found = joiner.flush()
    assert found is not None
    assert found == Sample(T0, {"speed_m_s": 20.0, "displayed_soc": 0.65})


@pytest.mark.parametrize(
    ("source", "root"), [("bmw", "x"), ("ovms", ""), ("ovms", "/"), ("ovms", "a/+/b"), ("ovms", "#")]
)
def test_a_source_is_known_and_a_topic_is_of_one_car(source: str, root: str) -> None:
    with pytest.raises(InvalidInput, match="unknown sender" if source == "bmw" else "no topic of one car"):
        TopicJoiner(source, root)


def test_any_mapping_names_what_a_sender_has(tmp_path: Path) -> None:
    content = {"Speed (OBD)(km/h)": "36", "Battery Voltage(V)": 350, "State of Charge(%)": 60, "x": 1}
    found = TopicJoiner("torque", "car").take("car", json.dumps(content).encode(), T0 + 0.5)
    assert found == Sample(T0 + 0.5, {"speed_m_s": 10.0, "voltage_v": 350.0, "soc": 0.6}), "by arrival"
    file = tmp_path / "mine.toml"
    file.write_text(
        '[columns]\ntime_s = { column = "t", unit = "epoch_ms" }\nspeed_m_s = { column = "v", unit = "mph" }\n'
    )
    joiner = TopicJoiner(f"{file}", "car")
    assert joiner.take("car", json.dumps({"t": T0 * 1000.0, "v": 0}).encode(), 0.0) == Sample(
        T0, {"speed_m_s": 0.0}
    )
    assert joiner.take("car/t", f"{T0 * 1000.0:.0f}".encode(), 0.0) is None
    assert joiner.take("car/v", b"0", 0.0) is None
    assert joiner.flush() == Sample(T0, {"speed_m_s": 0.0})


def test_our_own_columns_are_a_sender() -> None:
    joiner = TopicJoiner("plain", "car")
    content = {"speed_m_s": 20.0, "battery_power_w": 7400.0, "displayed_soc": 0.6, "charging": False}
    found = joiner.take("car", json.dumps(content).encode(), T0)
    expected = {"speed_m_s": 20.0, "displayed_soc": 0.6, "voltage_v": 370.0, "current_a": 20.0}
    assert found == Sample(T0, expected)
    assert joiner.take("car", json.dumps({"time_s": T0 + 7.0, "parked": True}).encode(), T0) == Sample(
        T0 + 7.0, {"speed_m_s": 0.0}, parked=True
    )
    assert joiner.take("car/time_s", f"{T0 + 8.0}".encode(), T0) is None
    assert joiner.take("car/soc", b"0.5", T0) is None
    assert joiner.flush() == Sample(T0 + 8.0, {"soc": 0.5})


METRICS = ["m.time.utc", "v.p.speed", "v.b.current", "v.b.voltage", "v.c.charging", "v.e.on", "x"]


@given(st.lists(st.tuples(st.sampled_from(METRICS), st.binary(max_size=6), st.floats(0, 100), st.booleans())))
def test_any_values_give_samples_none_or_faults(sent: list[tuple[str, bytes, float, bool]]) -> None:
    joiner = TopicJoiner("ovms", OVMS)
    for metric, payload, later_s, retained in sent:
        topic = f"{OVMS}/{metric.replace('.', '/')}"
        found = or_none(joiner.take, topic, payload, T0 + later_s, retained=retained)
        assert found is None or math.isfinite(found.time_s)
