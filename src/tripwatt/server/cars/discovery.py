"""What Home Assistant finds by itself: a sensor for each figure that is published of a car.

Home Assistant reads one retained message of each sensor below a prefix of topics, usually `homeassistant` (MQTT discovery).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

ONLINE: Final = "online"
OFFLINE: Final = "offline"
"""Messages that show whether cars are published at present."""

EXPIRES_S: Final = 300
"""A figure that is not published again within this time is unavailable [s]: several times the interval for a silent car."""


SCALES: Final = {"%": (100, 1), "kWh": (0.001, 2), "km": (0.001, 0), "min": (1.0 / 60.0, 1)}
"""Unit of a sensor -> factor of the document's figure to this unit, and number of decimals."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """One figure of the published document, at a `path` of names; unknown if the figure or a part around it is null."""

    key: str
    title: str
    path: str
    unit: str | None
    kind: str | None = None

    @property
    def template(self) -> str:
        """The template of Home Assistant for the figure."""
        value = "value_json"
        for name in self.path.split("/"):
            value = f"({value} or {{}})['{name}']"
        figure = "(v * {}) | round({})".format(*SCALES[self.unit]) if self.unit else "v"
        return f"{{% set v = {value} | default(none) %}}{{{{ none if v is none else {figure} }}}}"


SENSORS: Final = (
    Sensor("soc", "Charge", "soc", "%", "battery"),
    Sensor("energy", "Energy of the trip", "forecast/energy_wh", "kWh", "energy_storage"),
    Sensor("arrival", "Charge at arrival", "forecast/soc_quantiles/0.5", "%"),
    Sensor("arrival_low", "Charge at arrival, 5 %", "forecast/soc_quantiles/0.05", "%"),
    Sensor("arrival_high", "Charge at arrival, 95 %", "forecast/soc_quantiles/0.95", "%"),
    Sensor("p_arrive", "Chance to arrive with the reserve", "forecast/p_arrive", "%"),
    Sensor("p_arrive_at_all", "Chance to arrive at all", "forecast/p_arrive_at_all", "%"),
    Sensor("range", "Range", "range/range_m", "km", "distance"),
    Sensor("need", "Energy of the next trip", "need/energy_quantile_wh", "kWh", "energy_storage"),
    Sensor("soc_needed", "Charge to leave with", "need/soc_needed", "%"),
    Sensor("charge", "Energy to charge", "need/charge_wh", "kWh", "energy_storage"),
    Sensor("silence", "Time since the last message", "seconds_since_message", "min", "duration"),
    Sensor("charging", "Time to charge", "need/charging_s", "min", "duration"),
    Sensor("departs_at", "Next departure", "need/departs_at", None, "timestamp"),
    Sensor("preheat_at", "Start of preheating", "need/preheat/starts_at", None, "timestamp"),
)


def discovery(car: str, topic: str, prefix: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the retained messages by which Home Assistant finds a car.

    Parameters
    ----------
    car : str
        Name of the car.
    topic : str
        Topic below which cars are published; the topic itself has `online` or `offline`.
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
            "value_template": sensor.template,
            "unit_of_measurement": sensor.unit,
            "device_class": sensor.kind,
            "state_class": sensor.unit and "measurement",
            "device": device,
        }
        yield f"{prefix}/sensor/{node}/{sensor.key}/config", message
