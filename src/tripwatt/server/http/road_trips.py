"""Trips that cars finished on the road are learned while the service runs, those of one car at a time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tripwatt.server.cars import has_news, is_car
from tripwatt.server.cars.folder import TRIPS
from tripwatt.server.cars.own_car import LIVE

CHECK_S: Final = 5.0
"""Time between two looks for finished trips."""

FIRST_DELAY_S: Final = 30.0
MOST_DELAY_S: Final = 3600.0
"""Delay before a car that could not learn is tried again: doubled each time, up to the longest."""


@dataclass(eq=False)
class RoadTrips:
    """Looks for finished trips in the folder of cars.

    Attributes
    ----------
    folder : Path
    learn : callable
        Lets the car of a name learn; returns whether it did.
    seen : dict
        When the trips of a car last changed [ns], by its name, as they were learned.
    later : dict
        When a car that could not learn is tried again, by the monotonic clock [s], and the delay until then.
    """

    folder: Path
    learn: Callable[[str], Awaitable[bool]]
    seen: dict[str, int] = field(default_factory=dict)
    later: dict[str, tuple[float, float]] = field(default_factory=dict)

    async def watch(self) -> None:
        """Let cars learn what they finished, until this is cancelled."""
        while True:
            await self.look(time.monotonic())
            await asyncio.sleep(CHECK_S)

    async def look(self, now_s: float) -> None:
        """Let each car learn that has finished trips which it was not given."""
        for name, stamp in (await asyncio.to_thread(self._changed)).items():
            later_s, delay_s = self.later.get(name, (0.0, 0.5 * FIRST_DELAY_S))
            if now_s < later_s:
                continue
            if not await asyncio.to_thread(has_news, self.folder / name) or await self.learn(name):
                self.seen[name] = stamp
                self.later.pop(name, None)
                continue
            delay_s = min(2.0 * delay_s, MOST_DELAY_S)
            self.later[name] = now_s + delay_s, delay_s

    def _changed(self) -> dict[str, int]:
        """Cars whose trips changed since they were learned, and when. O(cars)."""
        changed = {}
        for place in sorted(self.folder.iterdir()) if self.folder.is_dir() else []:
            try:
                stamp = (place / LIVE / TRIPS).stat().st_mtime_ns
            except OSError:
                continue
            if self.seen.get(place.name) != stamp and is_car(place):
                changed[place.name] = stamp
        return changed
