"""Senders with a topic for each metric: values joined by time into samples.

Names and units are those of the mappings of the same senders' tables: the metrics of OVMS, and the values of TeslaMate
(https://docs.teslamate.org/docs/integrations/mqtt), whose power is in whole kilowatts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.live.telemetry import NOMINAL_VOLTAGE_V, Sample, sample_from_abrp
from tripwatt.sources.mapping import POWER, UNITS, ColumnMapping, load_mapping
from tripwatt.trips import COLUMNS

JOIN_S: Final = 1.0
"""Values that come within so long are of one sample [s], where the sender gives no time."""

TIME_WAIT_S: Final = 30.0
"""A sender that may give its time is awaited for so long [s] before the time of arrival counts."""

SLOW_HOLD_S: Final = 600.0
"""A state of charge or a temperature holds for so long [s]: senders repeat only what changes."""

FAST: Final = frozenset({"speed_m_s", "voltage_v", "current_a", POWER})
"""What holds for as long as the sender's mapping says, and what a broker kept from before says nothing about."""

MOST_TEXT_BYTES: Final = 64
MOST_MESSAGE_BYTES: Final = 65_536


@dataclass(frozen=True, slots=True)
class TopicSource:
    """What a sender's topics mean.

    Attributes
    ----------
    mapping : str
        Shipped mapping with the names of the metrics.
    time_metric : str
        Metric with the time [s since 1970], which is sent before the values of that time; empty for none.
    charging, parked : mapping of str to str
        Metric -> its value, in lower case, of a car that is charged or parked.
    """

    mapping: str
    time_metric: str = ""
    charging: Mapping[str, str] = field(default_factory=dict)
    parked: Mapping[str, str] = field(default_factory=dict)


SOURCES: Final[Mapping[str, TopicSource]] = MappingProxyType(
    {
        "ovms": TopicSource("ovms", "m.time.utc", {"v.c.charging": "yes"}, {"v.e.on": "no"}),
        "teslamate": TopicSource("teslamate", "", {"state": "charging"}, {"shift_state": "p"}),
    }
)
"""Name of a sender -> its topics. `abrp`, messages of A Better Routeplanner in one topic, needs none."""

SOURCE_NAMES: Final = (*SOURCES, "abrp")


class TopicJoiner:
    """Joins the values of one car's topics into samples.

    A sample has the values that came since the last one, and earlier ones while they hold. Its time is that of the sender
    where it sends one, else the second of the arrival.

    Parameters
    ----------
    source : str
        One of `SOURCE_NAMES`.
    root : str
        Topic below which the metrics are: `ovms/me/leaf/metric`, `teslamate/cars/1`. Of `abrp`, the topic itself.

    Raises
    ------
    InvalidInput
        For an unknown source or an empty topic, or one with a wildcard.

    Examples
    --------
    >>> joiner = TopicJoiner("teslamate", "teslamate/cars/1")
    >>> for name, value in (("speed", b"72"), ("power", b"7"), ("usable_battery_level", b"65")):
    ...     joiner.take(f"teslamate/cars/1/{name}", value, 1.7e9)
    >>> dict(joiner.take("teslamate/cars/1/speed", b"71", 1.7e9 + 1.0).values)
    {'speed_m_s': 20.0, 'displayed_soc': 0.65, 'voltage_v': 350.0, 'current_a': 20.0}
    >>> round(joiner.flush().values["speed_m_s"], 2)
    19.72
    """

    def __init__(self, source: str, root: str) -> None:
        if source not in SOURCE_NAMES:
            raise InvalidInput(Fault("unknown sender", "source", source[:60], ", ".join(SOURCE_NAMES)))
        self.root = root.rstrip("/")
        if not self.root or {"+", "#"} & set(self.root):
            raise InvalidInput(
                Fault("no topic of one car", "topic", root[:60], "a topic without '+' and '#'")
            )
        self.source = SOURCES.get(source)
        self._mapping = None if self.source is None else load_mapping(self.source.mapping)
        self._columns = {} if self._mapping is None else _columns_of(self._mapping)
        self._values: dict[str, tuple[float, float]] = {}
        self._flags: dict[str, str] = {}
        self._timed = self._fresh = False
        self._open_s = -math.inf
        self._first_s = math.inf

    @property
    def filter(self) -> str:
        """What to subscribe to."""
        return self.root if self.source is None else f"{self.root}/#"

    def take(self, topic: str, payload: bytes, received_s: float, *, retained: bool = False) -> Sample | None:
        """Take a value. O(1).

        Parameters
        ----------
        topic : str
            Of the message.
        payload : bytes
            Of the message.
        received_s : float
            Time of its arrival [s since 1970].
        retained : bool
            Whether the broker had kept it from before.

        Returns
        -------
        Sample or None
            The sample that is complete now.
        """
        if self.source is None:
            return None if retained or topic != self.root else _abrp_sample(payload)
        if not topic.startswith(f"{self.root}/") or len(payload) > MOST_TEXT_BYTES:
            return None
        metric = topic.removeprefix(f"{self.root}/").replace("/", ".")
        text = payload.decode("utf-8", "replace").strip().lower()
        if metric == self.source.time_metric:
            return None if retained else self._start_at(_number(text))
        if metric in self.source.charging or metric in self.source.parked:
            self._flags[metric] = text
            return self._note(received_s)
        column, factor, offset = self._columns.get(metric, ("", 1.0, 0.0))
        value = _number(text) * factor + offset
        if not column or (retained and column in FAST) or not _is_sound(column, value):
            return None
        done = self._note(received_s)
        self._values[column] = (value, self._open_s)
        return done

    def flush(self) -> Sample | None:
        """Give the sample that is not complete yet.

        Returns
        -------
        Sample or None
            None where nothing came since the last one.
        """
        if not self._fresh or self._open_s == -math.inf:
            return None
        self._fresh = False
        return self._sample()

    def _open(self, time_s: float) -> None:
        """Begin a sample. What came before the first one is of its time."""
        if self._open_s == -math.inf:
            self._values = {name: (value, time_s) for name, (value, _) in self._values.items()}
        self._open_s = time_s

    def _start_at(self, time_s: float) -> Sample | None:
        """Begin a sample at a time that the sender gives."""
        if not math.isfinite(time_s) or time_s == self._open_s:
            return None
        done = self.flush()
        self._open(time_s)
        self._timed = True
        return done

    def _note(self, received_s: float) -> Sample | None:
        """Note that something came; without a sender's time it may belong to the next sample."""
        assert self.source is not None
        done = None
        self._first_s = min(self._first_s, received_s)
        if not self._timed and self.source.time_metric and received_s < self._first_s + TIME_WAIT_S:
            return None
        if not self._timed and received_s >= self._open_s + JOIN_S:
            done = self.flush()
            self._open(math.floor(received_s / JOIN_S) * JOIN_S)
        self._fresh = True
        return done

    def _sample(self) -> Sample | None:
        assert self.source is not None
        assert self._mapping is not None
        hold_s = max(self._mapping.hold_s, JOIN_S)
        values = {
            name: value
            for name, (value, at_s) in self._values.items()
            if abs(self._open_s - at_s) <= (hold_s if name in FAST else SLOW_HOLD_S)
        }
        power = values.pop(POWER, None)
        if power is not None:
            values.setdefault("voltage_v", float(self._mapping.nominal_voltage_v or NOMINAL_VOLTAGE_V))
            values["current_a"] = power / values["voltage_v"]
        parked = self._has(self.source.parked)
        if parked:
            values["speed_m_s"] = 0.0
        try:
            return Sample(self._open_s, values, self._has(self.source.charging), parked)
        except InvalidInput:
            return None  # its time or its current cannot be one

    def _has(self, flags: Mapping[str, str]) -> bool:
        return any(self._flags.get(metric) == value for metric, value in flags.items())


def _columns_of(mapping: ColumnMapping) -> dict[str, tuple[str, float, float]]:
    """Metric -> our column, with factor and offset to its unit."""
    found = {}
    for ours, entry in mapping.columns.items():
        if ours != "time_s":
            factor, offset = UNITS[ours][entry.unit]
            sign = mapping.discharge_sign if ours in ("current_a", POWER) else 1.0
            found[entry.column] = (ours, sign * factor, offset)
    return found


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _is_sound(column: str, value: float) -> bool:
    if column == POWER:
        return math.isfinite(value)
    low, high = COLUMNS[column].bounds
    return low <= value <= high


def _abrp_sample(payload: bytes) -> Sample | None:
    """The sample of a message with all values; None where it is none."""
    if len(payload) > MOST_MESSAGE_BYTES:
        return None
    try:
        found: Any = json.loads(payload)
        return sample_from_abrp(found.get("tlm", found) if isinstance(found, dict) else found)
    except (ValueError, RecursionError, InvalidInput):
        return None
