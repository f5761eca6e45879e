"""Savings against worlds that can differ from what is stated, and against logs with and without heating."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import advised, heating
from tools import CATALOGUE, DATA

import tripwatt as tw
from tripwatt.forecasting.difference import MIN_SHARE, OTHER_SPEEDS
from tripwatt.physics import DriveConditions, simulate
from tripwatt.trips import Departure

needs_cycles = pytest.mark.skipif(not (DATA / "cycles").is_dir(), reason="set TRIPWATT_DATA")
needs_ved = pytest.mark.skipif(not (DATA / "ved").is_dir(), reason="set TRIPWATT_DATA")
needs_lists = pytest.mark.skipif(not (CATALOGUE / "epa_ev.csv").is_file(), reason="set TRIPWATT_CATALOGUE")


def test_other_speeds_on_a_planned_road_have_an_error_of_its_links(model: tw.ForecastModel) -> None:
    fast, slow = (
        tw.read_route([{"length_m": 30_000.0, "speed_m_s": v}]).with_departure(Departure(soc=0.8))
        for v in (33.0, 28.0)
    )
    planned = model.forecast(fast).difference(model.forecast(slow))
    driven = model.forecast(replace(fast, link_m=None)).difference(model.forecast(replace(slow, link_m=None)))
    assert planned.energy_wh == pytest.approx(driven.energy_wh, rel=0.01)
    route = model.fitted_parts("links")[1].route
    assert route is not None
    assert fast.link_m is not None
    links_wh = OTHER_SPEEDS * route.share(fast.link_m) * model.forecast(fast).energy_wh
    # besides, a share of what is saved
    assert planned.sd_wh == pytest.approx(np.hypot(driven.sd_wh, links_wh), rel=0.05)
    assert planned.sd_wh > 1.15 * driven.sd_wh
    warm, cold = (model.forecast(fast, Departure(soc=0.8, ambient_temperature_degc=t)) for t in (15.0, 5.0))
    bare = [model.forecast(replace(f.plan, link_m=None)) for f in (warm, cold)]
    apart = cold.difference(warm)
    share_wh = route.share(fast.link_m) * apart.energy_wh
    assert apart.sd_wh == pytest.approx(np.hypot(bare[1].difference(bare[0]).sd_wh, share_wh), rel=0.02)


def test_without_climate_control_no_unknown_cabin_costs_heat(model: tw.ForecastModel) -> None:
    plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])
    known = Departure(soc=0.8, ambient_temperature_degc=5.0, battery_temperature_degc=5.0)
    auto, off = (model.forecast(plan, replace(known, climate=mode)) for mode in ("auto", "off"))
    assert off.state_sd_wh == 0.0
    assert auto.state_sd_wh > 50.0
    # what is unknown of the cabin is unknown of the saving
    told = replace(known, cabin_setpoint_degc=22.0, cabin_temperature_degc=5.0)
    surer = [model.forecast(plan, replace(told, climate=mode)) for mode in ("auto", "off")]
    assert off.difference(auto).sd_wh > surer[1].difference(surer[0]).sd_wh


def test_the_weather_is_as_unknown_of_a_heating_that_is_switched_off_as_of_the_trip(
    model: tw.ForecastModel,
) -> None:
    plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 20.0}])
    known = Departure(
        soc=0.8, ambient_temperature_degc=8.0, battery_temperature_degc=8.0,
        cabin_setpoint_degc=22.0, cabin_temperature_degc=8.0,
    )  # fmt: skip
    sure = [model.forecast(plan, replace(known, climate=mode)) for mode in ("auto", "off")]
    unsure = [replace(forecast, state_sd_wh=500.0) for forecast in sure]
    before, after = (pair[1].difference(pair[0]).sd_wh for pair in (sure, unsure))
    assert after == pytest.approx(np.hypot(before, 500.0), rel=1e-3)
    heavy = model.forecast(plan, replace(known, payload_mass_kg=100.0))
    apart = [
        replace(f, state_sd_wh=500.0).difference(g).sd_wh for f, g in ((heavy, unsure[0]), (heavy, sure[0]))
    ]
    assert apart[0] < 0.1 * apart[1]


@needs_cycles
def test_shapes_err_about_as_a_car_on_a_dynamometer() -> None:
    car, lab = (
        tw.load_vehicle("bmw_i3_60ah"),
        DriveConditions(on_dynamometer=True, climate="off", initial_warmth=1.0),
    )
    slow, fast = (np.full(600, v) for v in (10.0, 30.0))
    runs = [simulate(car, np.arange(600.0), speed, conditions=lab) for speed in (slow, fast)]
    shapes = [advised.shape_energies(r, v, 20.0) / v[0] for r, v in zip(runs, (slow, fast), strict=True)]
    causes = [np.array([*r.by_cause_wh.values()]) / v[0] for r, v in zip(runs, (slow, fast), strict=True)]
    drawn = advised.shape_sd() * np.random.default_rng(0).standard_normal((4000, len(advised.SHAPES)))
    spread = np.sqrt(np.mean(np.square(drawn @ (shapes[1] - shapes[0]))))
    # between two constant speeds about as much as between the schedules from which it comes
    assert 0.7 * MIN_SHARE < spread / np.linalg.norm(causes[1] - causes[0]) < 1.4 * MIN_SHARE


@needs_cycles
@needs_lists
def test_savings_hold_in_worlds_as_stated_and_not_always(model: tw.ForecastModel) -> None:
    made = advised.drives(12, model, "known road", jobs=1, first=0)
    held = {
        name: np.mean([low <= true <= high for drive in some for _, _, low, high, true in drive.saved])
        for name, some in made.items()
    }
    assert held["siblings"] >= 0.9
    assert 0.75 <= held["shapes"] < 1.0
    # one draw of a car and a day in all worlds, so that the same drives arrive but for the shapes
    came = {name: [drive.stays[1] for drive in some] for name, some in made.items()}
    assert np.mean(np.array(came["factors"]) == np.array(came["shapes"])) >= 0.8
    rows = {row.name: row for row in advised.rows_of("factors", made["factors"])}
    assert any("arrived as advised for 95%" in name for name in rows)
    stated = [drive.follows[0] for drive in made["factors"] if drive.follows]
    assert min(stated) >= 0.95


@needs_ved
def test_heating_off_saves_about_what_is_stated() -> None:
    rows = {
        row.name.split(": ")[1]: row.value
        for row in heating.heating_rows(DATA, ("ved",), most=36)
        if "in the trip" in row.name
    }
    assert rows["in the 90 % interval"] >= 0.8
    assert abs(rows["bias, stated less measured"]) < 0.3 * abs(rows["measured, mean"])
    assert rows["mean absolute error"] < 0.6 * abs(rows["measured, mean"])
    assert rows["mean width of the 90 % interval"] < 3.0 * abs(rows["measured, mean"])


def test_a_bootstrap_over_pairs_knows_that_a_trip_has_several() -> None:
    values = np.repeat([0.0, 10.0, 20.0], 4)
    one_by_one = heating.two_way_interval(values, [range(12)])
    by_trip = heating.two_way_interval(values, [np.repeat([0, 1, 2], 4).tolist()])
    assert by_trip[0] < one_by_one[0] < 10.0 < one_by_one[1] < by_trip[1]
