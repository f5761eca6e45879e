"""Threads of BLAS while a forecast is made."""

from collections.abc import Iterator

import pytest
import scipy.linalg  # noqa: F401 -- its library is limited too
from threadpoolctl import threadpool_info, threadpool_limits

from tripwatt.forecasting import ForecastModel
from tripwatt.parallel import one_blas_thread
from tripwatt.study.evaluation import Execution, evaluate
from tripwatt.study.evaluation.tasks import Task
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.vehicles import load_vehicle


def blas_threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    with threadpool_limits(limits=2, user_api="blas"):
        if blas_threads() != {2}:
            pytest.skip("BLAS has no threads of its own here")
        yield


def test_one_thread_inside_and_what_was_set_outside() -> None:
    @one_blas_thread
    def nested(depth: int) -> list[set[int]]:
        """Threads before, in and after a call in a call."""
        before = blas_threads()
        return [before, *(nested(depth - 1) if depth else []), blas_threads()]

    assert nested(1) == [{1}] * 4
    assert nested.__name__ == "nested"
    assert blas_threads() == {2}


def test_an_error_restores_the_threads() -> None:
    @one_blas_thread
    def fail() -> None:
        raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert blas_threads() == {2}


def test_a_forecast_and_its_update_calculate_with_one(monkeypatch: pytest.MonkeyPatch) -> None:
    from tripwatt.forecasting import forecast as forecasts
    from tripwatt.forecasting import model as models

    seen = []

    def watched(name: str, module: object) -> None:
        original = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *a, **k: (seen.append((name, blas_threads())), original(*a, **k))[1]
        )

    watched("segment_table", models)
    watched("held_out_residual", models)
    watched("updated_power", forecasts)
    trips = synthetic_fleet(8).trips
    found = ForecastModel(load_vehicle("bmw_i3_60ah"), "linear").fit(trips).forecast(trips[0])
    samples = trips[0].samples[["time_s", "voltage_v", "current_a"]].iloc[:400]
    found.update_since_departure(samples)
    assert {name for name, _ in seen} == {"segment_table", "held_out_residual", "updated_power"}
    assert all(threads == {1} for _, threads in seen)
    assert blas_threads() == {2}


def test_a_fold_of_an_evaluation_calculates_with_one(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    original = Task.run
    monkeypatch.setattr(Task, "run", lambda self: (seen.append(blas_threads()), original(self))[1])
    evaluate(synthetic_fleet(3), models=["constant"], execution=Execution(n_jobs=1))
    assert seen
    assert all(threads == {1} for threads in seen)
    assert blas_threads() == {2}
