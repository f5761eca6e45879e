"""What the travel times of an empty road add to the uncertainty of a route."""

import json

import numpy as np
import pytest

import tripwatt as tw
from tripwatt.forecasting import ForecastModel
from tripwatt.forecasting.forecast import with_route_error
from tripwatt.routes.free_flow import TravelTimeFactors
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.uncertainty.free_flow import FreeFlowTrips, FreeFlowUncertainty
from tripwatt.vehicles import load_vehicle

NAN = float("nan")


def test_the_variance_has_a_part_of_the_trip_and_a_part_of_the_distance():
    factors = TravelTimeFactors(np.array([10.0]), np.array([1.2]))
    found = FreeFlowUncertainty(factors, 0.0016, 9.0, 20)
    assert found.share(1e4) == pytest.approx(0.05)
    assert found.share(1e9) == pytest.approx(0.04, rel=1e-4)
    too_few = np.array([0.1, 0.1, 0.1, 0.1, NAN])
    assert FreeFlowUncertainty.from_differences(factors, too_few, np.full(5, 1e4)) is None
    never_below_0 = FreeFlowUncertainty.from_differences(
        factors, np.array([0.01, 0.01, 0.1, 0.1, 0.1]), np.array([1e3, 1e3, 1e5, 1e5, 1e5])
    )
    assert never_below_0.local_variance_m == 0.0
    assert never_below_0.scale_variance == pytest.approx((2 * 0.0001 + 3 * 0.01) / 5)


@pytest.fixture(scope="module")
def fitted():
    fleet = synthetic_fleet(10)
    return ForecastModel(load_vehicle("bmw_i3_60ah"), "linear").fit(fleet.trips), fleet.trips


def test_the_held_out_trip_has_no_part_in_its_own_factors(fitted):
    model, trips = fitted
    found = FreeFlowTrips.from_trips(trips, model.vehicle)
    slower = list(found.links)
    route, seconds = slower[0]
    slower[0] = (route, 2.0 * seconds)
    changed = FreeFlowTrips(found.trips, found.vehicle, tuple(slower))
    own, others = np.array([0]), np.arange(1, 10)
    from tripwatt.hybrid import segment_trips

    table = segment_trips(trips, model.vehicle)
    corrector = model.corrector_
    assert changed.differences(corrector, table, own) == pytest.approx(
        found.differences(corrector, table, own)
    )
    assert changed.differences(corrector, table, others[:2]) != pytest.approx(
        found.differences(corrector, table, others[:2]), rel=1e-6
    )
    uncut = FreeFlowTrips(found.trips, found.vehicle, (None, *found.links[1:]))
    alone, among = (uncut.differences(corrector, table, np.array(k)) for k in ([1], [0, 1]))
    assert among == pytest.approx([NAN, *alone], nan_ok=True)
    assert np.isnan(
        FreeFlowTrips(found.trips, found.vehicle, (None,) * 10).differences(corrector, table, own)
    ).all()


def test_a_fitted_model_knows_the_error_of_free_flow_times_and_keeps_it(fitted, tmp_path):
    model, trips = fitted
    free = model.uncertainty_.free_flow
    assert free.trips == 10
    assert 0.005 < free.share(20_000.0) < 0.5
    assert (free.factors.factor > 1.0).any()
    tw.save_model(model, tmp_path / "m", provenance={}, evaluation={})
    again = tw.load_model(tmp_path / "m").uncertainty_.free_flow
    assert (again.scale_variance, again.local_variance_m, again.trips) == (
        free.scale_variance,
        free.local_variance_m,
        10,
    )
    assert again.factors.factor.tolist() == free.factors.factor.tolist()
    assert json.loads((tmp_path / "m" / "model.json").read_text())["uncertainty_"]["free_flow"]["trips"] == 10
    assert len(trips) == 10


def test_a_free_flow_plan_has_its_own_uncertainty_and_its_own_words(fitted):
    model, trips = fitted
    free = FreeFlowTrips.from_trips(trips, model.vehicle)
    plan = free.plan(0, free.factors())
    found = model.forecast(plan)
    assert found.given == "a planned route, free flow"
    share = model.uncertainty_.free_flow.share(plan.distance_m)
    assert found.route_sd_wh == pytest.approx(share * found.level_wh)
    assert "free_flow_times" in {flag.code for flag in found.flags}
    old = with_route_error(found, model.uncertainty_.route, None)
    assert old.route_sd_wh == pytest.approx(model.uncertainty_.route.share(plan.link_m) * found.level_wh)
    assert found.level_wh == pytest.approx(found.energy_wh - found.by_cause_wh["climb"])
    assert "travel_time_error_unknown" in {flag.code for flag in old.flags}
