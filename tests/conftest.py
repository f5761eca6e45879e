"""Where tests find the real data; everything that needs it skips with a reason where it is missing."""

import gc
import os
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
import typer.main
import typer.testing
from hypothesis import settings
from tests.support import ROOT
from tests.support.once import made_once, shared_folder

from tripwatt.forecasting import storage
from tripwatt.modelfile import read_model
from tripwatt.sources import tum, ved

gc.disable()  # until the end of the collection: what is imported stays, and would be looked through again and again

settings.register_profile("gate", derandomize=True, deadline=None)  # no test asserts a time
settings.register_profile("search", deadline=None)
settings.load_profile(os.environ.get("TRIPWATT_HYPOTHESIS", "gate"))
"""The gate draws the same examples in every run; TRIPWATT_HYPOTHESIS=search draws new ones."""


LONGEST = (
    "tests/integrations/test_home_assistant.py",
    "tests/project/test_site.py",
    "tests/server/page/test_journey.py",
    "gamm/tests/test_components.py",
    "tests/server/page/test_page.py",
    "tests/project/test_gallery.py",
    "tests/server/page/test_cars.py",
    "tests/hostile/test_bounds.py",
    "tests/server/http/test_process.py",
    "tests/roads/journey/test_choice.py",
    "tests/server/page/test_live_drive.py",
    "gamm/tests/test_gram.py",
    "tests/server/http/test_learning.py",
    "tests/server/page/test_frontend.py",
    "tests/server/http/test_car_endpoints.py",
    "tests/project/test_types.py",
    "tests/server/http/test_clients.py",
    "tests/server/http/test_live.py",
)
"""Modules that take half a minute or more. They begin first, so that no worker is left alone with one of them at the end."""


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(100_000, 20)  # a site is a million nodes that stay, and a forecast leaves few cycles
    gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mix the modules, where several processes test: those that wait for a browser or a service run beside those that compute."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        order = {ROOT / name: place for place, name in enumerate(LONGEST)}
        mixed = {item.path: crc32(item.path.relative_to(ROOT).as_posix().encode()) for item in items}
        items.sort(key=lambda item: (order.get(item.path, len(order)), mixed[item.path]))


@pytest.fixture(scope="session", autouse=True)
def built_once() -> Iterator[None]:
    """The tree of commands, for which Typer takes a tenth of a second at each call, is built once in a process."""
    with pytest.MonkeyPatch.context() as patch:
        build = cache(typer.main.get_command)
        patch.setattr(typer.main, "get_command", build)
        patch.setattr(typer.testing, "_get_command", build)
        yield


@pytest.fixture(scope="session", autouse=True)
def read_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Public sets and the model of the package are read once, and again by tests that import their readers."""
    folder = Path(os.environ.get("TRIPWATT_DATA", ROOT / "../shared/data")).resolve()

    def read(name: str, real: Callable[..., Any], source: Path, *, strict: bool = False) -> Any:
        if strict or source.resolve() != folder / name:
            return real(source, strict=strict)
        return made_once(tmp_path_factory, name, lambda: real(source))

    with pytest.MonkeyPatch.context() as patch:
        for name, real in (("tum", tum.read_tum), ("ved", ved.read_ved)):
            patch.setattr(f"tripwatt.sources.{name}.read_{name}", partial(read, name, real))
        own = {place: read_model(place) for place in [storage.model_folder()]}
        patch.setattr(storage, "read_model", lambda place: own.get(place) or read_model(place))
        yield


def _shared(variable: str, default: str) -> Path:
    folder = Path(os.environ.get(variable, ROOT / default))
    if not folder.is_dir():
        pytest.skip(f"no data at {folder}: set {variable} to the folder that holds it")
    return folder


@pytest.fixture(scope="session")
def data_dir() -> Path:
    return _shared("TRIPWATT_DATA", "../shared/data")


@pytest.fixture(scope="session")
def reference_dir() -> Path:
    return _shared("TRIPWATT_REFERENCE", "../shared/reference")


@pytest.fixture(scope="session")
def web(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The front end's sources with their packages of Node, installed once for all processes that test."""
    from tests.support.front_end import with_packages  # needs the extra service

    with shared_folder(tmp_path_factory, "front-end") as folder:
        return with_packages(folder)


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A small synthetic fleet in a store, with its model: plan, store, model and folder."""
    pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")
    from benchmarks.many_vehicles import CAR_MODELS, FleetPlan, block_of_logs

    from tripwatt.fleet.executors import Workers
    from tripwatt.fleet.model import Sampling, fit_fleet
    from tripwatt.fleet.store import create_store

    folder = tmp_path_factory.mktemp("fleet")
    plan = FleetPlan(48, vehicles=8, car_models=CAR_MODELS[:2], minutes=6.0)
    store = create_store(folder / "store", buckets=2)
    for model, block in plan.blocks():
        store.add(block_of_logs(plan, model, block), car_model=plan.car_models[model])
    model = fit_fleet(store, folder / "work", Workers(), sampling=Sampling(per_vehicle=5))
    return plan, store, model, folder
