"""The forecast of a planned route: what links cost is learned on trips that were held out, and widens the interval."""

import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tripwatt as tw
from tripwatt.forecasting import ForecastModel, load_model, save_model
from tripwatt.forecasting import model as model_module
from tripwatt.forecasting.forecast import with_route_error
from tripwatt.forecasting.measured import along_the_plan, columns_measured
from tripwatt.hybrid import power_corrector, segment_trips
from tripwatt.physics import simulate_trip
from tripwatt.routes import parse_route, plan_on_links, route_from_links
from tripwatt.routes.free_flow import TravelTimeFactors
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Flag, Plan
from tripwatt.uncertainty import RouteUncertainty, linked_trips
from tripwatt.uncertainty.free_flow import FreeFlowUncertainty
from tripwatt.uncertainty.route import LENGTHS_M, MAX_TRIPS
from tripwatt.uncertainty.shrinkage import COMPONENTS, FRACTIONS, UpdateShrinkage
from tripwatt.vehicles import load_vehicle

CAR = load_vehicle("bmw_i3_60ah")


@pytest.fixture(scope="module")
def trips():
    return synthetic_fleet(14, seed=2).trips


@pytest.fixture(scope="module")
def model(trips):
    return ForecastModel(CAR, "linear").fit(trips[:12])


def without_route_uncertainty(model):
    return dataclasses.replace(model, uncertainty_=dataclasses.replace(model.uncertainty_, route=None))


@settings(deadline=None)
@given(st.lists(st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3), min_size=5, max_size=9))
def test_doubt_is_the_mean_square_and_never_falls(differences):
    rows = np.array(differences)
    uncertainty = RouteUncertainty.from_differences(np.vstack((rows, [[np.nan] * 3])))
    assert uncertainty.trips == len(rows)
    square = (rows**2).mean(axis=0)
    assert uncertainty.share(LENGTHS_M[0]) ** 2 == pytest.approx(square[0])
    assert uncertainty.share(LENGTHS_M[2]) ** 2 == pytest.approx(square.max())
    grid = np.array([uncertainty.share(length) for length in np.linspace(0.0, 9000.0, 60)])
    assert grid[0] == 0.0
    assert np.all(np.diff(grid) >= -1e-12)


def test_too_few_trips_say_nothing():
    assert RouteUncertainty.from_differences(np.full((4, 3), 0.1)) is None
    assert RouteUncertainty.from_differences(np.full((9, 3), np.nan)) is None


def test_the_cost_of_links_is_learned_on_trips_that_the_corrector_has_not_seen(trips, monkeypatch):
    looked_at = []

    class Spy:
        def __init__(self, inner):
            self.inner, self.trained = inner, set()

        def fit(self, table):
            self.trained = set(table.trip_ids)
            self.inner.fit(table)
            return self

        def clone_tuned(self):
            return Spy(self.inner.clone_tuned())

        def look(self, table):
            assert not self.trained & set(table.trip_ids)
            looked_at.extend(table.trip_ids)
            return table

        def predict(self, table):
            return self.inner.predict(self.look(table))

        def predict_with_uncertainty(self, table, hours):
            return self.inner.predict_with_uncertainty(self.look(table), hours)

        def __getattr__(self, name):
            return getattr(self.inner, name)

    monkeypatch.setattr(model_module, "power_corrector", lambda name, seed: Spy(power_corrector(name, seed)))
    table = segment_trips(trips[:9], CAR)
    found = ForecastModel(CAR, "linear").fit_segments(table, routes=linked_trips(trips[:9], CAR))
    assert found.uncertainty_.route.trips == 9
    # each trip: for its residual, on its driven trace, and on links of every length
    assert all(looked_at.count(trip.trip_id) == 2 + len(LENGTHS_M) for trip in trips[:9])


def test_measured_doubt_is_the_difference_of_the_two_forecasts(trips):
    """With a corrector that knows nothing the difference is that of the simulations."""

    class Nothing:
        def predict(self, table):
            return np.zeros(len(table.hours))

    some = trips[:3]
    off = linked_trips(some, CAR).differences(Nothing(), segment_trips(some, CAR), np.array([2, 0]))
    for row, trip in zip(off, (some[2], some[0]), strict=True):
        driven = simulate_trip(CAR, Plan.from_trip(trip))
        base = driven.simulated_energy_wh
        on_links = [simulate_trip(CAR, plan_on_links(trip, m)).simulated_energy_wh for m in LENGTHS_M]
        level = base - driven.by_cause_wh["climb"]
        np.testing.assert_allclose(row, (np.array(on_links) - base) / level, rtol=2e-3)
    assert 0.0 < np.abs(off).max() < 0.5


def test_links_widen_and_the_driven_trace_does_not(model, trips):
    trip = trips[13]
    assert model.forecast(trip).to_dict() == without_route_uncertainty(model).forecast(trip).to_dict()
    assert model.forecast(trip).given == "the driven speed trace"
    for length in (250.0, 1000.0):
        plan = plan_on_links(trip, length)
        wide, narrow = model.forecast(plan), without_route_uncertainty(model).forecast(plan)
        assert wide.given == wide.to_dict()["given"] == "a planned route"
        assert wide.energy_wh == narrow.energy_wh
        share = model.uncertainty_.route.share(plan.link_m)
        extra = share * wide.level_wh
        assert share > 0.0
        assert wide.sd_wh**2 == pytest.approx(narrow.sd_wh**2 + extra**2)
        ratio = np.sqrt(1.0 + extra**2 / narrow.sd_wh**2)
        half = np.diff(wide.interval(0.9)) / np.diff(narrow.interval(0.9))
        assert half[0] == pytest.approx(ratio)
        assert Flag("route_error_unknown", "links") in narrow.flags
        assert "route_error_unknown" not in {flag.code for flag in wide.flags}


def test_on_the_way_the_doubt_of_the_route_goes(model, trips):
    plan = plan_on_links(trips[13], 1000.0)
    before = model.forecast(plan)
    observed = trips[13].samples[["time_s", "voltage_v", "current_a"]]
    seconds = float(before.drive.table.hours.sum() * 3600.0)
    half = before.update(observed[observed["time_s"] <= 0.5 * seconds])
    assert half.given == "a planned route"
    assert half.sd_wh < before.sd_wh
    band = half.to_frame()["energy_high_wh"] - half.to_frame()["energy_low_wh"]
    assert band.iloc[-1] > band.iloc[1]


def test_what_a_route_assumed_is_flagged(model):
    track = parse_route(b'{"type": "LineString", "coordinates": [[11.5, 48.1], [11.9, 48.1]]}')
    said = model.forecast(track.plan(speed_m_s=20.0)).flags
    assert Flag("speed_assumed", "track", 20.0, "m_s") in said
    assert [flag.code for flag in said].count("unknown_climb") == 1
    assert "no_elevation" not in {flag.code for flag in said}
    far = model.forecast(route_from_links([{"length_m": 30_000.0, "speed_m_s": 25.0}]).plan())
    assert Flag("links_too_long", "links", 30_000.0, "m") in far.flags


def test_stored_models_keep_the_doubt_and_older_ones_have_none(model, trips, tmp_path: Path):
    save_model(model, tmp_path / "model")
    plan = plan_on_links(trips[12], 400.0)
    assert load_model(tmp_path / "model").forecast(plan).to_dict() == model.forecast(plan).to_dict()
    older = dataclasses.replace(
        model, uncertainty_=dataclasses.replace(model.uncertainty_, route=None, free_flow=None)
    )
    save_model(older, tmp_path / "older")
    older = load_model(tmp_path / "older")
    assert older.uncertainty_.route is None
    assert older.forecast(trips[12]).to_dict() == model.forecast(trips[12]).to_dict()


def test_parked_logs_and_large_fleets(trips, monkeypatch):
    parked = dataclasses.replace(trips[0], samples=trips[0].samples.assign(speed_m_s=0.0))
    found = linked_trips([*trips[:2], parked], CAR)
    assert [len(tables) for tables in found.tables] == [3, 3, 0]
    assert MAX_TRIPS >= 100
    monkeypatch.setattr("tripwatt.uncertainty.route.MAX_TRIPS", 2)
    assert [len(tables) for tables in linked_trips(trips[:5], CAR).tables] == [3, 0, 0, 0, 3]


def late(plan, factor, waits_s, power_w):
    """The plan's own speeds driven slower by a factor after a wait, at a constant power."""
    time = np.arange(0.0, plan.duration_s * factor + waits_s)
    speed = (
        np.interp((time - waits_s) / factor, plan.array("time_s"), plan.array("speed_m_s"), left=0.0) / factor
    )
    return pd.DataFrame({"time_s": time, "speed_m_s": speed, "observed_energy_wh": power_w * time / 3600.0})


@pytest.mark.parametrize(("factor", "waits_s"), [(1.0, 0.0), (1.3, 0.0), (0.8, 40.0), (1.0, 120.0)])
def test_a_late_car_has_the_rest_of_the_route_before_it(model, factor, waits_s):
    links = [{"length_m": 500.0, "speed_m_s": 6.0 + 8.0 * (k % 2)} for k in range(30)]
    plan = route_from_links(links).plan()
    same = np.ones(len(FRACTIONS))
    nothing = UpdateShrinkage(
        **dict.fromkeys(COMPONENTS, 0.0 * same), split_sd_factor=same, joint_sd_factor=same
    )
    before = model.forecast(plan)
    # nothing is learned of the car either
    scale = dataclasses.replace(
        before.uncertainty.scale, values=before.uncertainty.scale.values * [1, 1, 1, 0]
    )
    before = dataclasses.replace(
        before, uncertainty=dataclasses.replace(before.uncertainty, shrinkage=nothing, scale=scale)
    )
    observed = late(plan, factor, waits_s, 4000.0)
    driven = np.concatenate(([0.0], np.cumsum(observed["speed_m_s"].to_numpy()[1:])))
    observed = observed[driven <= 7500.0]  # half of the way
    after = before.update(observed)
    series = before.to_frame()
    half_s = float(np.interp(7500.0, series["distance_m"], series["time_s"]))
    assert after.measured_until_s == pytest.approx(half_s, abs=40.0)
    rest = before.energy_wh - float(np.interp(7500.0, series["distance_m"], series["energy_wh"]))
    measured = float(observed["observed_energy_wh"].iloc[-1])
    # all that was measured counts, nothing twice; what is left is the plan's rest
    left = after.energy_wh - after.measured.energy_wh.sum()
    assert after.measured.energy_wh.sum() == pytest.approx(measured, rel=0.01)
    assert left == pytest.approx(rest, rel=0.03)
    assert float((after.open_hours * 3600.0).sum()) == pytest.approx(
        plan.duration_s - after.measured_until_s, abs=25.0
    )


def test_a_wait_that_the_car_did_not_have_is_no_gap(model):
    """Planned stops of a minute; the car drives through."""
    plan = route_from_links([{"length_m": 1000.0, "travel_time_s": 140.0, "stop_s": 60.0}] * 8).plan()
    time = np.arange(0.0, 500.0)
    observed = pd.DataFrame({"time_s": time, "speed_m_s": 12.0, "observed_energy_wh": time})
    columns = columns_measured(observed)
    on_plan = along_the_plan(columns, plan)
    assert np.diff(on_plan["time_s"]).max() <= 5.0 + 1e-9
    assert (np.diff(on_plan["time_s"]) > 0).all()
    assert on_plan["observed_energy_wh"][-1] == time[-1]
    gap = columns_measured(observed[(time < 100.0) | (time > 250.0)])
    assert np.diff(along_the_plan(gap, plan)["time_s"]).max() > 100.0
    assert along_the_plan(columns, dataclasses.replace(plan, link_m=None)) is columns


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.1, 90.0), st.floats(0.0, 40.0)), min_size=2, max_size=40),
    st.floats(0.0, 300.0),
)
def test_any_drive_has_a_clock_that_goes_on(steps, start):
    plan = route_from_links(
        [{"length_m": 900.0, "speed_m_s": 9.0}, {"length_m": 80.0, "speed_m_s": 3.0}]
    ).plan()
    time = start + np.cumsum([step for step, _ in steps])
    observed = pd.DataFrame(
        {"time_s": time, "speed_m_s": [v for _, v in steps], "soc": 0.5, "observed_energy_wh": time}
    )
    found = along_the_plan(columns_measured(observed), plan)
    assert (np.diff(found["time_s"]) > 0.0).all()
    assert ((found["time_s"] >= 0.0) & (found["time_s"] <= plan.duration_s + 1e-2)).all()
    assert found["observed_energy_wh"][[0, -1]].tolist() == pytest.approx([0.0, time[-1] - time[0]])


FREE = FreeFlowUncertainty(TravelTimeFactors(np.array([10.0]), np.array([1.2])), 0.0016, 9.0, 20)


@pytest.mark.parametrize(
    ("is_free", "route", "free", "codes"),
    [
        (True, True, FREE, {"free_flow_times"}),
        (True, True, None, {"travel_time_error_unknown"}),
        (False, True, FREE, set()),
        (False, False, FREE, {"route_error_unknown"}),
    ],
)
def test_the_error_of_a_route_is_that_of_its_travel_times_where_they_are_known(is_free, route, free, codes):
    model = tw.load_model()
    plan = tw.read_route([{"length_m": 4000.0, "speed_m_s": 15.0}, {"length_m": 900.0, "speed_m_s": 20.0}])
    forecast = model.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
    forecast = replace(
        forecast, drive=replace(forecast.drive, plan=replace(forecast.plan, free_flow=is_free)), flags=()
    )
    links = model.uncertainty_.route
    found = with_route_error(forecast, links if route else None, free)
    of_route = {"free_flow_times", "travel_time_error_unknown", "route_error_unknown"}
    assert {flag.code for flag in found.flags} & of_route == codes
    share = links.share(plan.link_m) if route else 0.0
    share = FREE.share(plan.distance_m) if codes == {"free_flow_times"} else share
    assert found.route_sd_wh == pytest.approx(share * forecast.level_wh)


@pytest.mark.parametrize(("from_deg", "is_flagged"), [(None, True), (90.0, False)])
def test_a_wind_of_unknown_direction_has_its_flag(from_deg, is_flagged):
    plan = tw.read_route([{"length_m": 4000.0, "speed_m_s": 15.0}])
    plan = replace(plan, heading_deg=np.zeros(len(plan)))
    found = tw.load_model().forecast(plan, tw.Departure(wind_speed_m_s=8.0, wind_from_deg=from_deg))
    flag = Flag("wind_direction_unknown", "wind_from_deg", 8.0, "m_s")
    assert (flag in found.flags) == is_flagged
