"""Forecasts of a trip as they were made while it was driven: at its departure, and then every few minutes.

They are kept beside the samples of the car, and beside the table of the trip when it has ended.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from tripwatt.errors import InvalidInput
from tripwatt.files import read_text_file, write_text

EVERY_S: Final = 120.0
"""Time between two forecasts of a trip that are kept [s]."""

MOST_FORECASTS: Final = 400
"""Most forecasts of a trip: 13 h, longer than the longest trip."""

MOST_BYTES: Final = 1 << 18


@dataclass(frozen=True, slots=True)
class MadeForecast:
    """A forecast of the whole trip, made on the way.

    Attributes
    ----------
    at_s : float
        Time since the start of the trip [s]; 0 for the forecast at departure.
    distance_m : float
        Driven by then.
    energy_wh, low_wh, high_wh : float
        Energy of the whole trip, and the ends of its 90 % interval.
    """

    at_s: float
    distance_m: float
    energy_wh: float
    low_wh: float
    high_wh: float


class OnTheWay:
    """The forecasts of the trip that a car is on, in a file.

    Parameters
    ----------
    path : Path
        The file; one that is damaged counts as none.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._start_s, self._made = read_forecasts(path)

    def of(self, start_s: float) -> tuple[MadeForecast, ...]:
        """The forecasts of the trip that started at a time [s since 1970]."""
        return self._made if self._start_s == start_s else ()

    def move(self, start_s: float, moved_s: float) -> None:
        """Take another start of the trip that started at a time: the clock of its sender was set."""
        if self.of(start_s):
            write_forecasts(self.path, moved_s, self._made)
            self._start_s = moved_s

    def is_due(self, start_s: float, at_s: float) -> bool:
        """Whether a forecast that is made so long after the start is kept."""
        made = self.of(start_s)
        return not made or (at_s - made[-1].at_s >= EVERY_S and len(made) < MOST_FORECASTS)

    def add(self, start_s: float, forecast: MadeForecast) -> bool:
        """Keep a forecast, if it is due.

        Returns
        -------
        bool
            Whether it was kept.

        Raises
        ------
        OSError
            When it cannot be written.
        """
        if not self.is_due(start_s, forecast.at_s) or not all(map(math.isfinite, asdict(forecast).values())):
            return False
        made = (*self.of(start_s), forecast)
        write_forecasts(self.path, start_s, made)
        self._start_s, self._made = start_s, made
        return True


def write_forecasts(path: Path, start_s: float, made: tuple[MadeForecast, ...]) -> None:
    """Write the forecasts of a trip in one step.

    Raises
    ------
    OSError
        When they cannot be written; the file is as before.
    """
    write_text(
        path, json.dumps({"start_s": start_s, "forecasts": [asdict(forecast) for forecast in made]}) + "\n"
    )


def read_forecasts(path: Path) -> tuple[float | None, tuple[MadeForecast, ...]]:
    """Departure of the trip of a file, and its forecasts; none where there is no such file or it is damaged."""
    if not path.is_file():
        return None, ()
    try:
        document: Mapping[str, Any] = json.loads(read_text_file(path, MOST_BYTES))
        rows = [[float(row[name]) for name in MadeForecast.__slots__] for row in document["forecasts"]]
        if not all(map(math.isfinite, itertools.chain(*rows))):
            return None, ()
        return float(document["start_s"]), tuple(MadeForecast(*row) for row in rows)
    except (InvalidInput, ValueError, KeyError, TypeError, AttributeError):
        return None, ()
