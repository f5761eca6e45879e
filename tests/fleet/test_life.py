"""A scheduled refit."""

import numpy as np
import pytest

from tripwatt.fleet.executors import Workers
from tripwatt.fleet.life import refit_fleet
from tripwatt.fleet.registry import Registry

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_a_refit_is_compared_and_then_takes_the_newest_weeks_in(fleet, tmp_path):
    _, store, model, folder = fleet
    registry = Registry(tmp_path / "reg")
    registry.promote(registry.add(model))
    version, comparison, promoted = refit_fleet(store, registry, folder / "refit", Workers(), weeks=1.0)
    assert (version, promoted) == ("0002", True)
    newest = store.trips(since="2023-01-14")
    assert 0 < comparison.trips <= len(newest)
    assert registry.current() == "0002"
    assert registry.load().trips == model.trips
    assert np.abs(registry.load().sums.xx - model.sums.xx).max() < 1e-10 * np.abs(model.sums.xx).max()
