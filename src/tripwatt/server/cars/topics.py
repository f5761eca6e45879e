"""Join the values of senders with one topic per metric into samples, by time."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.server.cars.telemetry import Sample, format_of, in_message, is_set, with_places
from tripwatt.sources.mapping import POWER

JOIN_S: Final = 1.0
"""Values that arrive within this time form one sample if the sender sends no time [s]. A choice: the simulation has steps of one second."""

TIME_WAIT_S: Final = 30.0
"""How long to wait for the time of a sender that may send one [s]; after that, the time of arrival is used. A choice."""

SLOW_HOLD_S: Final = 600.0
"""How long a state of charge or a temperature is held [s], because senders repeat only what changes. A choice."""

FAST: Final = frozenset({"", "speed_m_s", "voltage_v", "current_a", POWER})
"""Columns that are held as long as in the sender's mapping, and the time; their values that the broker kept from before are ignored."""

MAX_TEXT_BYTES: Final = 64
MAX_MESSAGE_BYTES: Final = 65_536
"""Largest value and largest whole message [bytes]; choices."""


class TopicJoiner:
    """Joins the values of one car's topics into samples. A message on the topic of the car itself is a whole sample as JSON.

    A sample has the values that arrived since the last sample, and earlier values that are still held. Its time is that of the
    sender if it sends one, else the second of the arrival.

    Parameters
    ----------
    source : str
        Name of a sender, as in `format_of`.
    root : str
        Topic above the metrics, such as `ovms/me/leaf/metric` or `teslamate/cars/1`; or the topic of whole messages.

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
        self.root = root.rstrip("/")
        if not self.root or {"+", "#"} & set(self.root):
            raise InvalidInput.of("no topic of one car", "topic", root[:60], "a topic without '+' and '#'")
        self.format = format_of(source)
        self._hold_s = max(self.format.mapping.hold_s, JOIN_S)
        self._values: dict[str, tuple[float, float]] = {}
        self._flags: dict[str, str] = {}
        self._faults: list[Fault] = []
        self._has_time = self._has_news = False
        self._begins_s = -math.inf
        self._first_arrival_s = math.inf

    def take(self, topic: str, payload: bytes, received_s: float, *, retained: bool = False) -> Sample | None:
        """Take a message: a value, or a whole sample. O(1).

        Parameters
        ----------
        topic : str
            Topic of the message.
        payload : bytes
            Payload of the message.
        received_s : float
            Time of its arrival [s since 1970].
        retained : bool
            Whether the broker had kept it from before.

        Returns
        -------
        Sample or None
            The sample that is complete now; None if there is none. Its faults are of values that are left out.

        Raises
        ------
        InvalidInput
            For a message that cannot be a sample, such as one with a time in milliseconds.
        """
        if topic == self.root:
            return None if retained or not payload else self._sample_of_json(payload, received_s)
        metric = topic.removeprefix(f"{self.root}/").replace("/", ".")
        text = payload[:MAX_TEXT_BYTES].decode("utf-8", "replace").strip().lower()
        if metric in self.format.charging or metric in self.format.parked:
            self._flags[metric] = text
            return self._note_arrival(received_s)
        column, faults = self.format.columns.get(metric), list[Fault]()
        if column is None or (retained and column[0] in FAST):
            return None
        value = self.format.number({metric: text}, metric, faults)
        if metric == self.format.time_field:
            raise_faults(faults)
            self._has_time = self._has_time or value is not None
            return None if value is None or value == self._begins_s else self._begin(value)
        sample = self._note_arrival(received_s) if faults or value is not None else None
        self._faults += faults
        if value is not None:
            self._values[column[0]] = value, self._begins_s
        return sample

    def flush(self) -> Sample | None:
        """Return the sample of the values so far, without waiting for more.

        Returns
        -------
        Sample or None
            None if nothing arrived since the last sample.

        Raises
        ------
        InvalidInput
            If the time of the sender cannot be one.
        """
        if not self._has_news or self._begins_s == -math.inf:
            return None
        self._has_news, faults, self._faults = False, self._faults, []
        values = {
            name: value
            for name, (value, at_s) in self._values.items()
            if abs(self._begins_s - at_s) <= (self._hold_s if name in FAST else SLOW_HOLD_S)
        }
        parked = is_set(self.format.parked, self._flags)
        if parked:
            values["speed_m_s"] = 0.0
        values, charging = self.format.with_current(values), is_set(self.format.charging, self._flags)
        return Sample(self._begins_s, values, charging, parked, tuple(faults))

    def _begin(self, time_s: float) -> Sample | None:
        """Begin a sample at `time_s`; return the one before it. Values that came before the first sample get its time."""
        try:
            return self.flush()
        finally:
            if self._begins_s == -math.inf:
                self._values = {name: (value, time_s) for name, (value, _) in self._values.items()}
            self._begins_s = time_s

    def _note_arrival(self, received_s: float) -> Sample | None:
        """Note that a value came; if the sender sends no time, it may begin the next sample. Return the sample before it."""
        sample = None
        self._first_arrival_s = min(self._first_arrival_s, received_s)
        if not self._has_time and self.format.time_field and received_s < self._first_arrival_s + TIME_WAIT_S:
            return None
        if not self._has_time and received_s >= self._begins_s + JOIN_S:
            sample = self._begin(math.floor(received_s / JOIN_S) * JOIN_S)
        self._has_news = True
        return sample

    def _sample_of_json(self, payload: bytes, received_s: float) -> Sample | None:
        """Return the sample of a message with all values as JSON; None for one that the format ignores."""
        try:
            document: Any = json.loads(payload[:MAX_MESSAGE_BYTES])
        except (ValueError, RecursionError) as error:
            allowed = f"JSON of at most {MAX_MESSAGE_BYTES} bytes"
            raise InvalidInput.of("not JSON", "tlm", f"{error}"[:60], allowed) from error
        fields = document.get("tlm", document) if isinstance(document, Mapping) else document
        if self.format.kinds and isinstance(fields, Mapping) and not is_set(self.format.kinds, fields):
            return None
        return with_places(partial(self.format.sample, fields, received_s), partial(in_message, document))
