"""What the last messages of a car on the road show, for a job about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tripwatt.trips import Departure, Flag
from tripwatt.vehicles import Vehicle


def with_seen(
    known: Departure, seen: Mapping[str, Any] | None, vehicle: Vehicle
) -> tuple[Departure, tuple[Flag, ...]]:
    """Fill temperature and charge that a departure leaves out from the car's last messages; return the departure and flags.

    A temperature that was filled in gets a flag, and so does a car without a description. A charge gets none, because the answer
    shows it. A charge of the battery management counts as given.
    """
    seen = seen or {}
    given = known if known.bms_soc is None else replace(known, soc=known.bms_soc)
    air = "ambient_temperature_degc"
    used = {n: seen[n] for n in ("soc", air) if seen.get(n) is not None and getattr(given, n) is None}
    flags = [Flag("of_last_message", air, used[air], "degc")] if air in used else []
    flags += [undescribed(seen["undescribed"], vehicle)] if seen.get("undescribed") else []
    return known.merge(Departure(**used)), tuple(flags)


def undescribed(car: str, assumed: Vehicle) -> Flag:
    """Return the flag of a car on the road without a description."""
    return Flag("no_description", assumed.title, car)
