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
