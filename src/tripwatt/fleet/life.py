"""Scheduled refits of a fleet's model: a new model is used only if it is not worse than the one in use."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from pathlib import Path

from tripwatt.errors import InvalidInput
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.mapping import SampledTrips, file_tasks, map_store
from tripwatt.fleet.model import fit_fleet, update_fleet
from tripwatt.fleet.registry import Comparison, Registry, compare
from tripwatt.fleet.store import TripStore


def refit_fleet(
    store: TripStore,
    registry: Registry,
    work: Path | str,
    workers: Workers,
    *,
    weeks: float = 4.0,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[str, Comparison, bool]:
    """Fit on all but the newest weeks, compare with the version in use on these weeks, and promote the new model if it is not worse.

    Parameters
    ----------
    store : TripStore
    registry : Registry
        A registry that has a version in use.
    work, workers, progress
        As in `fit_fleet`.
    weeks : float
        Number of newest weeks, counted back from the newest departure of the store.

    Returns
    -------
    version : str
        Version of the new model. If promoted, it was also updated with the newest weeks.
    comparison : Comparison
    promoted : bool

    Raises
    ------
    InvalidInput
        If the store has no times of departure, or no trip with measured energy in the newest weeks.
    """
    last_departure = store.about()["last"]
    if last_departure is None:
        raise InvalidInput.of("times of departure are missing", store.place, "", "trips with a departure")
    cut = (dt.datetime.fromisoformat(last_departure) - dt.timedelta(weeks=weeks)).isoformat()
    champion = registry.load()
    challenger = fit_fleet(store, work, workers, which={"until": cut}, progress=progress)
    newest = store.trip_rows(since=cut)
    digests = frozenset(row["digest"] for row in newest)
    results = map_store(file_tasks(store, newest, work, digests), workers)
    sample = SampledTrips.read(results)
    comparison = compare(champion, challenger, sample)
    if comparison.worse:
        version = registry.add(challenger, f"refit until {cut}, worse than the version in use")
        return version, comparison, False
    updated, _ = update_fleet(challenger, store, work, workers)
    version = registry.add(updated, f"refit until {cut}, then updated")
    registry.promote(version, comparison)
    return version, comparison, True
