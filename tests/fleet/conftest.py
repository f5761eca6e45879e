"""Rows and a sample of the small synthetic fleet."""

import pytest
from tests.fleet.rows import mapped


@pytest.fixture(scope="session")
def sample(fleet):
    from tripwatt.fleet.mapping import SampledTrips, sample_digests

    _, store, _, folder = fleet
    chosen = sample_digests(store.trip_rows(), 3, 3)
    return SampledTrips.read(mapped(store, folder / "sample", chosen))


@pytest.fixture(scope="session")
def rows(fleet):
    from tripwatt.fleet.mapping import read_rows

    _, store, _, folder = fleet
    return read_rows(mapped(store, folder / "rows"))


@pytest.fixture(scope="session")
def saved(fleet, tmp_path_factory):
    """The folder of the model of the small synthetic fleet."""
    from tripwatt.fleet.storage import save_fleet

    folder = tmp_path_factory.mktemp("saved") / "model"
    save_fleet(fleet[2], folder)
    return folder
