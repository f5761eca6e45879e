"""What Home Assistant finds by itself: a sensor for each figure of the forecast that `tripwatt live` publishes.

Home Assistant reads one retained message of each sensor below a prefix of topics, usually `homeassistant` (MQTT discovery).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

SILENCE: Final = "(value_json.seconds_since_message or 0) / 60"


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
    return f"(value_json.forecast.{of} * 100) | round(1)"


SENSORS: Final = (
    Sensor(
        "energy", "Energy of the trip", "(value_json.forecast.energy_wh / 1000) | round(2)", "kWh", "energy"
    ),
    Sensor("arrival", "Charge at arrival", _percent("soc_quantiles['0.5']"), "%", "battery"),
    Sensor("arrival_low", "Charge at arrival, 5 %", _percent("soc_quantiles['0.05']"), "%", "battery"),
    Sensor("arrival_high", "Charge at arrival, 95 %", _percent("soc_quantiles['0.95']"), "%", "battery"),
    Sensor("p_arrive", "Chance to arrive with the reserve", _percent("p_arrive"), "%"),
    Sensor("p_arrive_at_all", "Chance to arrive at all", _percent("p_arrive_at_all"), "%"),
    Sensor("silence", "Time since the last message", SILENCE, "min", "duration", "true"),
)


def discovery(car: str, topic: str, prefix: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The retained messages by which Home Assistant finds a car.

    Parameters
    ----------
    car : str
        Name of the car.
    topic : str
        Where its forecasts are published.
    prefix : str
        Usually `homeassistant`.

    Yields
    ------
    str, dict
        Topic and message of each sensor.

    Examples
    --------
    >>> topic, message = next(discovery("my-leaf", "tripwatt/my-leaf", "homeassistant"))
    >>> topic, message["unit_of_measurement"]
    ('homeassistant/sensor/tripwatt_my-leaf/energy/config', 'kWh')
    """
    node = "tripwatt_" + "".join(c if c.isascii() and (c.isalnum() or c in "_-") else "_" for c in car)
    device = {"identifiers": [node], "name": car, "model": "tripwatt"}
    for sensor in SENSORS:
        message = {
            "name": sensor.title,
            "unique_id": f"{node}_{sensor.key}",
            "state_topic": topic,
            "value_template": f"{{{{ ({sensor.value}) if {sensor.condition} else none }}}}",
            "unit_of_measurement": sensor.unit,
            "device": device,
        }
        if sensor.kind is not None:
            message["device_class"] = sensor.kind
        yield f"{prefix}/sensor/{node}/{sensor.key}/config", message
