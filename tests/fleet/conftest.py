"""Rows and a sample of the small synthetic fleet."""

import pytest


@pytest.fixture(scope="module")
def sample(fleet):
    from tripwatt.fleet.executors import InProcess
    from tripwatt.fleet.mapping import SampledTrips, file_tasks, map_store, sample_digests

    _, store, _, folder = fleet
    rows = store.trip_rows()
    chosen = sample_digests(rows, 2, 9, seed=7)
    results = map_store(file_tasks(store, rows, folder / "life", chosen), InProcess(), 1)
    return SampledTrips.read([r.segments for r in results if r.segments])


@pytest.fixture(scope="module")
def rows(fleet):
    from tripwatt.fleet.executors import InProcess
    from tripwatt.fleet.mapping import file_tasks, map_store, read_rows

    _, store, _, folder = fleet
    return read_rows(map_store(file_tasks(store, store.trip_rows(), folder / "rows"), InProcess(), 1))
