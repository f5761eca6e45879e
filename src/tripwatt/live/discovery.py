"""What Home Assistant finds by itself: a sensor for each figure that is published of a car.

Home Assistant reads one retained message of each sensor below a prefix of topics, usually `homeassistant` (MQTT discovery).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

ONLINE: Final = "online"
OFFLINE: Final = "offline"
"""Messages on the topic that shows whether somebody publishes."""

EXPIRES_S: Final = 300
"""A figure that is not published again for so long is unavailable [s]: several times what a silent car is published again after."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """One figure of the published document.

    `value` is a Jinja expression of `value_json`; it is unknown where `condition`, another one, does not hold.
    """

    key: str
    title: str
    value: str
    unit: str
    kind: str | None = None
    condition: str = "value_json.forecast"


def _percent(of: str) -> str:
    return f"(value_json.{of} * 100) | round(1)"


def _thousands(of: str, digits: int) -> str:
    return f"(value_json.{of} / 1000) | round({digits})"


SENSORS: Final = (
    Sensor("soc", "Charge", _percent("soc"), "%", "battery", "value_json.soc is not none"),
    Sensor("energy", "Energy of the trip", _thousands("forecast.energy_wh", 2), "kWh", "energy"),
    Sensor("arrival", "Charge at arrival", _percent("forecast.soc_quantiles['0.5']"), "%", "battery"),
    Sensor(
        "arrival_low", "Charge at arrival, 5 %", _percent("forecast.soc_quantiles['0.05']"), "%", "battery"
    ),
    Sensor(
        "arrival_high", "Charge at arrival, 95 %", _percent("forecast.soc_quantiles['0.95']"), "%", "battery"
    ),
    Sensor("p_arrive", "Chance to arrive with the reserve", _percent("forecast.p_arrive"), "%"),
    Sensor("p_arrive_at_all", "Chance to arrive at all", _percent("forecast.p_arrive_at_all"), "%"),
    Sensor("range", "Range", _thousands("range.range_m", 0), "km", "distance", "value_json.range"),
    Sensor(
        "need",
        "Energy of the next trip",
        _thousands("need.energy_quantile_wh", 2),
        "kWh",
        "energy",
        "value_json.need",
    ),
    Sensor(
        "soc_needed", "Charge to leave with", _percent("need.soc_needed"), "%", "battery", "value_json.need"
    ),
    Sensor(
        "charge",
        "Energy to charge",
        _thousands("need.charge_wh", 2),
        "kWh",
        "energy",
        "value_json.need and value_json.need.charge_wh is not none",
    ),
    Sensor(
        "silence",
        "Time since the last message",
        "(value_json.seconds_since_message / 60) | round(1)",
        "min",
        "duration",
        "value_json.seconds_since_message is not none",
    ),
)


def discovery(car: str, topic: str, prefix: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The retained messages by which Home Assistant finds a car.

    Parameters
    ----------
    car : str
        Name of the car.
    topic : str
        Cars are published below it, and on it whether somebody publishes.
    prefix : str
        Usually `homeassistant`.

    Yields
    ------
    str, dict
        Topic and message of each sensor.

    Examples
    --------
    >>> topic, message = next(discovery("my-leaf", "tripwatt", "homeassistant"))
    >>> topic, message["state_topic"], message["unit_of_measurement"]
    ('homeassistant/sensor/tripwatt_my-leaf/soc/config', 'tripwatt/my-leaf', '%')
    """
    node = "tripwatt_" + "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in car)
    device = {"identifiers": [node], "name": car, "model": "tripwatt"}
    for sensor in SENSORS:
        message = {
            "name": sensor.title,
            "unique_id": f"{node}_{sensor.key}",
            "state_topic": f"{topic}/{car}",
            "availability_topic": topic,
            "expire_after": EXPIRES_S,
            "value_template": f"{{{{ ({sensor.value}) if {sensor.condition} else none }}}}",
            "unit_of_measurement": sensor.unit,
            "device": device,
        }
        if sensor.kind is not None:
            message["device_class"] = sensor.kind
        yield f"{prefix}/sensor/{node}/{sensor.key}/config", message
