"""Names and defaults of the integration."""

from __future__ import annotations

from datetime import timedelta
from typing import Final

DOMAIN: Final = "tripwatt"

CONF_CALENDARS: Final = "calendars"
CONF_INTERVAL: Final = "interval_s"
CONF_PLUG: Final = "plug_w"
CONF_PROBABILITY: Final = "probability"
CONF_RESERVE: Final = "reserve"
CONF_WEATHER: Final = "weather"

INTERVAL_S: Final = 30
"""Time between two questions to a service without a stream [s]; with one, between two looks at calendars and clocks."""

NEWS_S: Final = 1.0
"""News of the stream within this time are shown together [s]."""

AGAIN_S: Final = 1.0
"""A stream that ended is opened again after this time [s], and after that in the time between two questions."""

PROBABILITY: Final = 95
"""Chance with which the charge of the next trip suffices [%]; that of the figures over MQTT."""

AHEAD_EVERY_S: Final = 600
"""Need and range of a car that sent nothing new are asked for again after so long [s]."""

LOOK_AHEAD: Final = timedelta(days=7)
"""The next trip is looked for so far ahead in a calendar."""

MAX_NEEDS: Final = 10
"""Trips of a calendar whose need is worked out in one view; each is a forecast."""
