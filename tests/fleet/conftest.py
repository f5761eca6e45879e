"""A small synthetic fleet in a store, with its model; made once."""

import pytest


@pytest.fixture(scope="session")
def fleet(tmp_path_factory):
    pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")
    from benchmarks.many_vehicles import CAR_MODELS, FleetPlan, block_of_logs

    from tripwatt.fleet.executors import InProcess
    from tripwatt.fleet.model import Sampling, fit_fleet
    from tripwatt.store import create_store

    folder = tmp_path_factory.mktemp("fleet")
    plan = FleetPlan(48, vehicles=8, car_models=CAR_MODELS[:2], minutes=6.0)
    store = create_store(folder / "store", buckets=2)
    for model, block in plan.blocks():
        store.add(block_of_logs(plan, model, block), car_model=plan.car_models[model])
    model = fit_fleet(store, folder / "work", InProcess(), sampling=Sampling(per_vehicle=5))
    return plan, store, model, folder


@pytest.fixture(scope="module")
def sample(fleet):
    from tripwatt.fleet.executors import InProcess
    from tripwatt.fleet.mapping import SampledTrips, map_store, sample_of, tasks_of

    _, store, _, folder = fleet
    rows = store.trip_rows()
    chosen = sample_of(rows, 2, 9, seed=7)
    results = map_store(tasks_of(store, rows, folder / "life", chosen), InProcess(), 1)
    return SampledTrips.read([r.segments for r in results if r.segments])


@pytest.fixture(scope="module")
def rows(fleet):
    from tripwatt.fleet.executors import InProcess
    from tripwatt.fleet.mapping import map_store, read_rows, tasks_of

    _, store, _, folder = fleet
    return read_rows(map_store(tasks_of(store, store.trip_rows(), folder / "rows"), InProcess(), 1))
