"""The model of a fleet: fit, update, forecasts of its vehicles."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.many_vehicles import FleetPlan, many_vehicles
from tests.fleet.rows import mapped
from tests.support.refusals import refuses

from tripwatt.errors import InvalidInput
from tripwatt.fleet.executors import Workers
from tripwatt.fleet.features import segment_features
from tripwatt.fleet.mapping import SampledTrips, read_rows, sample_digests
from tripwatt.fleet.model import _MIN_TRIPS, fit_fleet, held_out_correctors, predict_rows, update_fleet
from tripwatt.hybrid import segment_trips
from tripwatt.hybrid.groups import group_posterior
from tripwatt.trips import Departure, Plan, Trip
from tripwatt.vehicles import load_vehicle

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def new_logs(plan, more):
    longer = FleetPlan(plan.trips + more, plan.vehicles, plan.car_models, plan.seed, plan.minutes)
    known = {log.trip_id for log in many_vehicles(plan)}
    return [log for log in many_vehicles(longer) if log.trip_id not in known]


def test_an_update_is_the_fit_of_all_trips(fleet, tmp_path):
    plan, store, model, _ = fleet
    import shutil

    from tripwatt.fleet.store import open_store

    shutil.copytree(store.place, tmp_path / "store")
    copy = open_store(tmp_path / "store")
    same, none = update_fleet(model, copy, tmp_path / "work", Workers())
    assert same is model
    assert len(none) == 0
    logs = new_logs(plan, 8)
    for k, car_model in enumerate(plan.car_models):
        copy.add([log for log in logs if int(log.context.car[1:]) % 2 == k], car_model=car_model)
    updated, rows = update_fleet(model, copy, tmp_path / "work", Workers())
    assert len(rows) == sum(r["drives"] for r in copy.trip_rows() if r["digest"] not in model.digests) > 5
    assert updated.trips == model.trips + len(rows)
    assert updated.digests > model.digests
    assert updated.trees is model.trees
    assert updated.uncertainty is model.uncertainty
    everything = read_rows(mapped(copy, tmp_path / "all"))
    full = group_posterior(everything.sums, model.posterior.scales)
    assert np.abs(full.mean - updated.posterior.mean).max() < 1e-10 * np.abs(full.mean).max()
    assert (
        np.abs(full.covariance - updated.posterior.covariance).max() < 1e-10 * np.abs(full.covariance).max()
    )
    trip = Trip.from_log(logs[0])
    fitted = replace(updated, posterior=full)
    energies = [m.forecast(trip, vehicle_id=trip.context.car).energy_wh for m in (updated, fitted)]
    assert energies[0] == pytest.approx(energies[1], abs=1e-6)


def test_each_vehicle_has_its_own_forecast(fleet):
    plan, _, model, _ = fleet
    trip = Trip.from_log(next(many_vehicles(plan)))
    own = model.forecast(trip, vehicle_id="V00000", driver=trip.context.driver)
    other = model.forecast(trip, vehicle_id="V00002")
    new = model.forecast(trip, vehicle_id="new", car_model=plan.car_models[0])
    assert own.energy_wh != other.energy_wh
    assert own.sd_wh < new.sd_wh
    assert own.interval(0.9)[0] < own.energy_wh < own.interval(0.9)[1]
    assert repr(model) == f"<FleetModel {model.trips} trips of 8 vehicles, 2 car models>"
    its = [i for i, group in enumerate(model.sums.groups) if group[1] == "V00000"]
    assert len(model.of_vehicle("V00000").trip_ids_) == model.sums.count[its].sum()
    assert model.of_vehicle("new", car_model="vw_id3").vehicle.name == "vw_id3"
    linear = model.of_vehicle("V00000").corrector_
    weights, covariance = model.posterior.weights(plan.car_models[0], "V00000")
    table = segment_trips([trip], load_vehicle(plan.car_models[0]))
    trees = model.trees.predict(table)
    assert linear.predict(table) == pytest.approx(segment_features(table) @ weights + trees)
    factor = linear.predict_with_uncertainty(table)[1]
    features = segment_features(table)
    assert factor @ factor.T == pytest.approx(features @ covariance @ features.T, rel=1e-8, abs=1e-6)
    refuses("unknown vehicle: vehicle_id: got 'new'", model.forecast, trip, vehicle_id="new")
    refuses("another car model", model.of_vehicle, "V00000", car_model="vw_id3")
    refuses("cannot be fitted", linear.fit, table)
    refuses("cannot be fitted", linear.clone_tuned)


def test_held_out_trips_are_out_of_the_whole_posterior(fleet, rows, sample):
    _, store, model, _ = fleet
    chosen = sample_digests(store.trip_rows(), 3, 3)
    assert len(sample) == len(chosen) == 18
    assert set(sample.digests) == chosen
    folds = np.arange(18) % 3
    found = held_out_correctors(model.sums, model.posterior.scales, sample, folds)
    kept = rows.where([d not in np.array(sample.digests)[folds == 0] for d in rows.texts("digest")])
    left = group_posterior(kept.sums, model.posterior.scales)
    car_model, vehicle, driver = sample.groups[0]
    mean, _ = left.weights(car_model, vehicle, driver)
    assert found[0].mean == pytest.approx(mean, rel=1e-7, abs=1e-9)
    sums = sample.sums(np.arange(18))
    picked = rows.where([d in chosen for d in rows.texts("digest")])
    assert sums.xx == pytest.approx(picked.sums.xx, rel=1e-9)
    assert sums.log_variance == pytest.approx(picked.sums.log_variance, rel=1e-9)
    energy, sd = predict_rows(model.posterior, rows)
    i = 5
    mean, covariance = model.posterior.weights(*rows.groups[i])
    x = rows.X[i]
    assert energy[i] == pytest.approx(rows.numbers("simulated_wh")[i] + x @ mean)
    assert sd[i] == pytest.approx(np.sqrt(x @ covariance @ x))
    refuses("no trips", SampledTrips.read, [])


def test_too_few_trips_are_an_error(fleet, tmp_path):
    _, store, *_ = fleet
    with pytest.raises(InvalidInput, match=f"at least {_MIN_TRIPS}"):
        fit_fleet(store, tmp_path, Workers(), which={"vehicle_id": "nobody"})


def test_the_core_imports_no_fleet_package():
    code = (
        "import sys, tripwatt.command, tripwatt.forecasting, tripwatt.fleet.store, tripwatt.fleet.model, tripwatt.command.fleets\n"
        "print(sorted({m.split('.')[0] for m in sys.modules} & {'dask', 'distributed', 'deltalake', 'duckdb', 'polars'}))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"


def test_a_forecast_needs_no_driver_and_knows_the_temperature_class(fleet):
    plan, _, model, _ = fleet
    own = Plan.from_trip(Trip.from_log(next(many_vehicles(plan))))
    cold = replace(model.uncertainty.scores, values=model.uncertainty.scores.values * 3.0)
    wide = replace(model, scores={"cold": cold})
    narrow, wider = (
        m.forecast(own, Departure(ambient_temperature_degc=5.0), vehicle_id="V00000")
        for m in (replace(model, scores={}), wide)
    )
    assert wider.interval(0.9)[1] - wider.energy_wh > 1.5 * (narrow.interval(0.9)[1] - narrow.energy_wh)
    mild = [
        m.forecast(own, Departure(ambient_temperature_degc=8.0), vehicle_id="V00000").interval(0.9)
        for m in (replace(model, scores={}), wide)
    ]
    assert mild[0] == mild[1]
    by_model = replace(model, scores={"cold": cold, "bmw_i3_60ah": model.uncertainty.scores})
    assert by_model.uncertainty_of("bmw_i3_60ah", 0.0).scores is model.uncertainty.scores
    assert by_model.uncertainty_of("nissan_leaf_24", 0.0).scores is cold
    assert by_model.uncertainty_of("nissan_leaf_24").scores is model.uncertainty.scores
