"""A fit with its provenance."""

import dataclasses
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tripwatt.forecasting import ForecastModel, fitting, load_metadata, save_model
from tripwatt.forecasting.fitting import data_digest, fit_car, fit_with_provenance, held_out_figures
from tripwatt.forecasting.inner import INNER_FOLDS
from tripwatt.forecasting.ranges import NEVER_KNOWN, training_ranges
from tripwatt.hybrid import segment_trips
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import TripSet
from tripwatt.trips.messages import message
from tripwatt.vehicles import load_vehicle


@pytest.fixture(scope="module")
def fleet() -> TripSet:
    return synthetic_fleet(12, seed=5)


@pytest.fixture(scope="module")
def car():
    return load_vehicle("bmw_i3_60ah", overrides={"mass": 1300.0})


@pytest.fixture(scope="module")
def table(fleet, car):
    return segment_trips(fleet.trips[:8], car)


def test_a_model_says_where_it_comes_from(fleet, car, tmp_path: Path) -> None:
    model, provenance, figures = fit_with_provenance(fleet, car, corrector="linear")
    save_model(model, tmp_path / "model", provenance=provenance, evaluation=figures)
    about = load_metadata(tmp_path / "model")
    assert about["provenance"]["trips_used"] == list(model.trip_ids_)
    assert about["provenance"]["data"]["sha256"] == data_digest(fleet.trips)
    assert about["provenance"]["seed"] == 0
    _, values = fit_car(fleet.trips, car, "linear")
    assert values is not None
    assert about["provenance"]["data"]["notes"] == [*map(message, fleet.notes), str(values)]
    ambient = next(e for e in about["contract"]["inputs"] if e["name"] == "ambient_temperature_degc")
    assert ambient["unit"] == "°C"
    first = [t.array("ambient_temperature_degc")[0] for t in fleet.trips]
    assert ambient["training"] == [min(first), max(first)]
    rows = figures["by_trip"]
    errors = [abs(r["predicted_wh"] / r["observed_wh"] - 1.0) for r in rows]
    assert figures["mape"] == pytest.approx(np.mean(errors))
    by_id = {t.trip_id: t.observed_energy_wh for t in fleet.trips}
    assert all(r["observed_wh"] == pytest.approx(by_id[r["trip"]], rel=0.02) for r in rows)
    # each row was forecast without its trip: the model that has seen it errs less
    table = segment_trips(fleet.trips, model.vehicle)
    assert model.corrector_ is not None
    fitted = table.totals_wh(table.simulated_w + model.corrector_.predict(table))
    seen = np.mean(np.abs(fitted / table.totals_wh(table.observed_power_w) - 1.0))
    assert seen < figures["mape"]


def test_digest_knows_every_value_but_no_order(fleet) -> None:
    trips = fleet.trips[:3]
    assert data_digest(trips) == data_digest(trips[::-1])
    samples = trips[0].samples.copy()
    samples.loc[5, "speed_m_s"] += 1e-12
    other = dataclasses.replace(trips[0], samples=samples)
    assert data_digest([other, *trips[1:]]) != data_digest(trips)


def test_progress_counts_the_inner_folds_and_the_fit(fleet, car) -> None:
    counted: list[tuple[int, int]] = []
    trips = fleet.trips[:8]
    ForecastModel(car, corrector="linear").fit(trips, progress=lambda *done: counted.append(done))
    of = 1 + min(INNER_FOLDS, len(trips))
    assert counted == [(k, of) for k in range(1, of + 1)]


def test_a_car_is_identified_by_its_trips_where_it_is_asked_for(fleet, car) -> None:
    (identified, values), (bare, none) = (
        fit_car(fleet.trips[:8], car, "linear", identified=on) for on in (True, False)
    )
    assert values is not None
    assert identified.vehicle == values.applied(car)
    assert none is None
    assert bare.vehicle is car


def test_packages_of_extras_that_are_not_installed_are_left_out(monkeypatch):
    def version(name):
        if name in {"scikit-learn", "lightgbm"}:
            raise PackageNotFoundError(name)
        return "1.0"

    monkeypatch.setattr("importlib.metadata.version", version)
    assert set(fitting.versions()["packages"]) == {"tripwatt", "numpy", "scipy", "pandas"}


def test_a_model_knows_the_ranges_of_its_covariates_and_what_they_are_worth(fleet, car, table) -> None:
    given = pd.DataFrame({"traffic": np.arange(8.0), "driver": "ben"})
    known = dataclasses.replace(table, covariates=given)
    ranges = training_ranges(known, ["traffic", "driver"])
    assert (ranges["traffic"].low, ranges["traffic"].high) == (0.0, 7.0)
    assert ranges["driver"] == NEVER_KNOWN
    model = ForecastModel(car, corrector="linear", covariates=("traffic",)).fit_segments(known)
    plain = ForecastModel(car, corrector="linear").fit_segments(table)
    assert plain.covariate_errors_ == {}
    assert model.to_dict()["covariates"] == {"traffic": model.covariate_errors_}
    errors = model.covariate_errors_
    for how, fitted in (("without", plain), ("with", model)):
        assert errors[how] == pytest.approx(held_out_figures(fitted.held_out_)["mape"])
    assert errors["with"] != pytest.approx(errors["without"], rel=1e-6)
    for how, error in errors.items():
        assert f"error {how} traffic" in model._repr_html_()
        assert f"{100.0 * error:.1f} %" in model._repr_html_()
    assert "seen in training" in plain._repr_html_()
    assert "seen in training" not in ForecastModel(car)._repr_html_()
    one = fleet.trips[0]
    busy = [dataclasses.replace(one, samples=one.samples.assign(traffic=x)) for x in (1.0, 2.0)]
    assert len({data_digest([trip]) for trip in (*busy, one)}) == 3
