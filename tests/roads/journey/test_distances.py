"""Need and range without a road."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from benchmarks.need import driven_by_kind, set_rows, study, trips_and_car
from tests.support.refusals import refuses
from tools import DATA

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.forecasting import ForecastModel
from tripwatt.forecasting.ranges import UNKNOWN_AIR_SD_K
from tripwatt.hybrid.factors import NAMES, FactorCorrector
from tripwatt.physics.conditions import UNKNOWN_AMBIENT_DEGC
from tripwatt.population.adapting import adaptation
from tripwatt.roads.journey.distances import NODES_M, KindForecaster, _node_values, roads_of_model
from tripwatt.roads.journey.kinds import (
    KINDS,
    PRIOR_TRIPS,
    STUDIES,
    TOWN_M,
    TYPICAL_M,
    USUAL_KM_H,
    USUAL_M,
    OwnRoads,
    road_prior,
    round_shares,
    shares_of,
    shares_over,
    usual_air,
)
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Departure, Trip
from tripwatt.uncertainty.conformal import ConformalScores

TYPICAL = 0.1 * np.outer(TYPICAL_M, np.ones(3))
COLD, MILD = Departure(ambient_temperature_degc=-5.0), Departure(ambient_temperature_degc=20.0)


def test_the_need_grows_with_distance_cold_and_certainty(model: ForecastModel) -> None:
    short, long = (tw.need(km, departure=COLD, model=model) for km in (20, 60))
    sure = tw.need(20, departure=COLD, model=model, probability=0.99)
    mild = tw.need(20, departure=MILD, model=model)
    assert mild.energy_wh < short.energy_wh < short.energy_quantile_wh < sure.energy_quantile_wh
    assert short.interval_wh[0] < short.half_wh[0] < short.energy_wh < short.half_wh[1] < short.interval_wh[1]
    assert short.energy_quantile_wh == short.interval_wh[1]
    assert short.energy_wh < long.energy_wh < 3.0 * short.energy_wh
    assert long.duration_s > short.duration_s


def test_range_and_need_are_inverse(model: ForecastModel) -> None:
    for kind, soc in (("city", 0.35), ("motorway", 0.8)):
        middle = tw.range_km(soc, kind, COLD, model=model, reserve=0.1).range_m
        known = replace(COLD, soc=soc)
        needed = tw.need(middle / 1000.0, kind, known, model=model, probability=0.5, reserve=0.1)
        assert needed.soc_needed == pytest.approx(soc, abs=1e-6)


def test_a_charge_that_warming_up_takes_carries_nowhere(model: ForecastModel) -> None:
    found = tw.range_km(0.2001, "city", COLD, model=model, reserve=0.2)
    assert (found.range_m, found.interval_m[0]) == (0.0, 0.0)


def test_an_unknown_road_is_less_certain_than_a_known_one(model: ForecastModel) -> None:
    widths = []
    for known in (True, False):
        asked = KindForecaster(model, MILD, KINDS["country"], known, road_prior())
        low, high = asked.quantiles(40_000.0, (0.05, 0.95))[0]
        widths.append(high - low)
    assert widths[0] < widths[1]


def test_between_two_lengths_the_need_is_their_line(model: ForecastModel) -> None:
    asked = KindForecaster(model, MILD, KINDS["city"], True, road_prior())
    ends = [_node_values(asked, k, (0.9,))[0][0] for k in (1, 2)]
    middle = asked.quantiles(0.5 * (NODES_M[1] + NODES_M[2]), (0.9,))[0][0]
    assert middle == pytest.approx(np.mean(ends), rel=1e-12)


@pytest.mark.parametrize(("kind", "slowest_km_h"), [("mixed", 50.0), ("country", 45.0), ("motorway", 85.0)])
def test_the_town_of_a_kind_does_not_grow_with_the_distance(
    model: ForecastModel, kind: str, slowest_km_h: float
) -> None:
    far = tw.need(180, kind, MILD, model=model)
    assert 3.6 * far.distance_m / far.duration_s > slowest_km_h
    town_m = [shares_over(shares_of(kind), d)[0] * d for d in (TOWN_M, 40_000.0, 180_000.0)]
    assert town_m == pytest.approx([shares_of(kind)[0] * TOWN_M] * 3)
    assert (
        tw.need(180, shares_of(kind), MILD, model=model).duration_s > 1.3 * far.duration_s
    )  # shares as they are given
    slow = tw.need(180, "city", MILD, model=model)
    assert 3.6 * slow.distance_m / slow.duration_s < 25.0


def test_errors_of_several_trips_are_shared(model: ForecastModel) -> None:
    one, nine = (tw.need(20, departure=MILD, model=model, trips=n) for n in (1, 9))
    assert nine.interval_wh == pytest.approx([9.0 * wh for wh in one.interval_wh])


def test_what_is_missing_narrows_the_interval_and_what_is_given_does_not(model: ForecastModel) -> None:
    """A car without trips, a road of no kind, no temperature: each is named where it counts most."""
    for car in (tw.for_car(model, "vw_id3"), model):
        vague, known = (tw.need(50, "city", departure, model=car).doubt for departure in (None, MILD))
        assert vague.weather > known.weather
        assert vague.car + vague.road + vague.weather + vague.day == pytest.approx(1.0)
    assert vague.narrows == "ambient_temperature_degc"
    assert (known.narrows, known.narrower) == (None, 0.0)
    # narrower, by as much as it says at most
    wide = tw.need(50, "city", model=model)
    narrow = tw.need(50, "city", replace(MILD, ambient_temperature_degc=10.0), model=model)
    width = [(one.interval_wh[1] - one.interval_wh[0]) / one.energy_wh for one in (wide, narrow)]
    assert 0.98 * (1.0 - wide.doubt.narrower) * width[0] < width[1] < 0.9 * width[0]
    assert tw.need(50, departure=MILD, model=model, car="vw_id3").doubt.narrows == "own trips"
    assert tw.need(50, departure=MILD, model=model).doubt.narrows == "kind"


def test_a_usual_trip_is_the_forecast_of_its_plan(model: ForecastModel) -> None:
    trip = synthetic_fleet(1).trips[0]
    forecast = model.forecast(trip, COLD)
    needed = tw.need(trip, departure=COLD, model=model)
    assert (needed.kind, needed.energy_quantile_wh) == ("trip", forecast.quantile(0.95))


@pytest.mark.parametrize("name", STUDIES)
def test_what_a_data_set_shows_of_roads_is_that_of_its_logs(name: str) -> None:
    if not (DATA / name).is_dir():
        pytest.skip(f"no trips of {name} at TRIPWATT_DATA")
    pytest.importorskip("openpyxl", reason="needs the extra tripwatt[workbooks]")
    kept, (trips, car) = STUDIES[name], trips_and_car(name, DATA)
    driven = np.sum([driven_by_kind(trip) for trip in trips], axis=0)
    assert driven == pytest.approx([*kept.length_m, *kept.time_s], abs=1.0)
    if name == "tum":  # the errors of both sets are of the same simulations, which take long
        found = study(trips, car)
        assert found.known == pytest.approx(kept.known, rel=1e-2, abs=1e-5)
        assert found.unknown == pytest.approx(kept.unknown, rel=1e-2, abs=1e-5)


def test_a_data_set_is_left_out_of_its_own_prior() -> None:
    for name in STUDIES:
        others = [study for other, study in STUDIES.items() if other != name]
        assert road_prior(without=name).known == pytest.approx(others[0].known)
        assert road_prior(without=name).speed_m_s != road_prior().speed_m_s
    assert "sedan" not in STUDIES


@pytest.mark.parametrize(
    "asked",
    [
        {"kind": "moon"},
        {"kind": (0.5, 0.2, 0.2)},
        {"probability": 0.2},
        {"probability": 1.0},
        {"trips": 0},
        {"reserve": 2.0},
    ],
)
def test_what_is_out_of_bounds_is_refused(model: ForecastModel, asked: dict[str, object]) -> None:
    with pytest.raises(InvalidInput):
        tw.need(20, model=model, **asked)  # type: ignore[arg-type]


def test_shares_are_rounded_to_quarters() -> None:
    assert round_shares(np.array([3.0, 4.0, 1.0])) == (0.5, 0.5, 0.0)
    assert sum(shares_of(round_shares(np.ones(3)))) == 1.0


def test_what_a_distance_takes_does_not_depend_on_the_charge(model: ForecastModel) -> None:
    shown = [model.forecast(synthetic_fleet(1).trips[0], replace(COLD, soc=soc)) for soc in (0.3, 0.9)]
    assert shown[0].energy_wh == pytest.approx(shown[1].energy_wh, rel=1e-9)
    road = shares_of("mixed")  # as shares: the same road at any distance
    per_charge = [tw.range_km(soc, road, COLD, model=model, reserve=0.0).range_m for soc in (0.4, 0.8)]
    assert 1.9 < per_charge[1] / per_charge[0] < 2.1


def test_a_data_set_counts_as_one_region() -> None:
    prior, lengths = road_prior(), [study.length_m[0] for study in STUDIES.values()]
    slow = [study.time_s[0] / study.length_m[0] for study in STUDIES.values()]
    weights = [1.0, *(length / (length + USUAL_M) for length in lengths)]
    expected = np.average([3.6 / USUAL_KM_H[0], *slow], weights=weights)
    assert prior.speed_m_s[0] == pytest.approx(1.0 / expected)


def test_need_and_range_hold_on_a_sample_of_trips() -> None:
    if not (DATA / "sedan").is_dir():
        pytest.skip("no trips of the sedan at TRIPWATT_DATA")
    rows = [row for row in set_rows("sedan", DATA, most=24) if "own trips" in row.name and row.least > 0.0]
    assert len(rows) == 6
    assert all(0.8 <= row.value <= 1.0 for row in rows), [row.value for row in rows]


def _drives(km: float, km_h: float, number: int) -> list[Trip]:
    """Trips at one speed, with a measured energy."""
    seconds = round(3600.0 * km / km_h)
    log = pd.DataFrame(
        {
            "time_s": np.arange(seconds + 1.0),
            "speed_m_s": np.full(seconds + 1, km_h / 3.6),
            "voltage_v": 350.0,
            "current_a": 150.0 * km_h / 360.0,
            "ambient_temperature_degc": 20.0,
        }
    )
    return [Trip.from_samples(f"{km:g} km, {k}", log) for k in range(number)]


@pytest.fixture(scope="module")
def commuter() -> ForecastModel:
    """A car whose 8 km are of the town, and whose 60 km are motorway."""
    trips = [*_drives(8.0, 30.0, 15), *_drives(60.0, 118.0, 15)]
    return adaptation(tw.load_model(), trips, tw.load_vehicle("vw_id3")).model


def test_own_trips_teach_which_roads_a_distance_has(commuter: ForecastModel) -> None:
    own = roads_of_model(commuter, road_prior())
    assert own is not None
    near, far = own.at(8_000.0), own.at(60_000.0)
    assert near.usual[0] > 0.75 > road_prior().usual[0]
    assert far.usual[2] > 0.75 > road_prior().usual[2]
    assert near.speed_m_s[0] == pytest.approx(30.0 / 3.6, rel=0.1)
    # far from any own trip the roads are those of all logs
    far_m = 2_000_000.0
    assert own.at(far_m).usual == pytest.approx(shares_over(road_prior().usual, far_m), abs=0.02)
    # equal trips leave less open than strangers' roads
    for known in (True, False):
        assert near.relative_sd(8_000.0, known) < road_prior().relative_sd(8_000.0, known)


def test_need_and_range_use_the_own_roads(commuter: ForecastModel) -> None:
    stranger = replace(commuter, roads_=None)
    near, far = ([tw.need(km, departure=MILD, model=car) for car in (commuter, stranger)] for km in (8, 60))
    assert near[0].duration_s > near[1].duration_s
    assert far[0].duration_s < far[1].duration_s
    # what the trips took
    assert far[0].energy_wh == pytest.approx(9000.0, rel=0.03)
    # even speeds take less than a town in which one stops
    assert near[0].energy_wh < near[1].energy_wh
    widths = [found.interval_wh[1] / found.interval_wh[0] for found in far]
    assert widths[0] < 0.9 * widths[1]
    assert tw.range_km(0.8, departure=MILD, model=commuter) != tw.range_km(
        0.8, departure=MILD, model=stranger
    )


def test_what_own_trips_take_more_than_typical_roads_is_learned() -> None:
    """The same distances and speeds with twice the driving energy: the need follows by the weight of the trips."""
    prior, length = road_prior(), np.array([[0.0, 10_000.0, 0.0]] * 20)
    plain = OwnRoads(prior, length, np.full(20, 1000.0), TYPICAL, np.full((20, 2), np.nan))
    double = replace(plain, driving_wh=np.full(20, 2000.0))
    assert plain.at(10_000.0).extra == pytest.approx((0.0, 0.0))
    weight = 20.0 / (PRIOR_TRIPS + 20.0)
    assert double.at(10_000.0).extra == pytest.approx((weight, weight))
    roads = double.at(10_000.0)
    left = (PRIOR_TRIPS * prior.relative_sd(10_000.0, True) ** 2 + 20.0 * (1.0 - weight) ** 2) / (
        PRIOR_TRIPS + 20.0
    )
    assert roads.relative_sd(10_000.0, True) == pytest.approx(left**0.5)


def test_own_roads_are_compared_as_they_are_corrected(commuter: ForecastModel) -> None:
    """A car that rolls harder than is simulated takes more on its own roads, as on typical ones: that is no difference of its roads."""
    plain, _ = commuter.fitted_parts("test")
    assert isinstance(plain, FactorCorrector)
    needs = []
    for loss in (0.0, 5.0):
        mean = np.zeros(len(plain.mean))
        mean[NAMES.index("rolling")] = loss
        car = replace(commuter, corrector_=replace(plain, mean=mean))
        needs += [
            tw.need(60, (0.0, 0.0, 1.0), departure=MILD, model=asked).energy_wh
            for asked in (car, replace(car, roads_=None))
        ]
    own, typical = needs[2] - needs[0], needs[3] - needs[1]
    assert own == pytest.approx(typical, rel=0.1)


def test_scores_of_held_out_trips_do_not_widen_what_a_road_leaves_open(model: ForecastModel) -> None:
    """Errors of known speeds with far tails: the interval of an open road is that of its own spread."""
    far = ConformalScores.from_errors(np.full(30, 3.0))
    wild = replace(model, uncertainty_=replace(model.fitted_parts("test")[1], scores=far))
    widths = []
    for car in (model, wild):
        found = tw.need(20, departure=MILD, model=car)
        widths.append(found.interval_wh[1] - found.interval_wh[0])
    assert widths[0] < widths[1] < 1.25 * widths[0]


def test_an_hour_of_standstill_does_not_widen_the_way_to_work() -> None:
    prior, length = road_prior(), np.array([[0.0, 10_000.0, 0.0]] * 10 + [[3_000.0, 0.0, 0.0]])
    usual = OwnRoads(prior, length[:10], np.full(10, 1000.0), TYPICAL, np.full((10, 2), np.nan))
    stood = replace(usual, length_m=length, driving_wh=np.append(usual.driving_wh, 30_000.0))
    assert (
        stood.at(10_000.0).relative_sd(10_000.0, True) < usual.at(10_000.0).relative_sd(10_000.0, True) + 0.04
    )


def test_the_air_of_a_day_is_that_of_own_trips_around_it() -> None:
    """Winters of -5 and summers of 25 degrees; without a date all of the year; without trips the usual one."""
    day = np.arange(0.0, 730.0, 10.0)
    degc = 10.0 - 15.0 * np.cos(2.0 * np.pi * day / 365.25)
    air = np.column_stack([degc, day])
    winter, summer, unknown = (usual_air(air, one) for one in (5.0 + 3 * 365.25, 180.0, np.nan))
    assert winter[0] < 1.0 < 19.0 < summer[0]
    assert unknown[0] == pytest.approx(10.0, abs=1.0)
    assert max(winter[1], summer[1]) < 9.5 < unknown[1]
    nothing = usual_air(np.full((len(day), 2), np.nan), 180.0)
    assert nothing == (UNKNOWN_AMBIENT_DEGC, UNKNOWN_AIR_SD_K)


def test_the_season_of_own_trips_takes_the_place_of_an_unknown_temperature(commuter: ForecastModel) -> None:
    """All own trips are at 20 degrees: the need is that of warm air, less certain than a known one, and says what is assumed."""
    unknown, known = tw.need(20, model=commuter), tw.need(20, departure=MILD, model=commuter)
    usual = tw.need(
        20, departure=replace(MILD, ambient_temperature_degc=UNKNOWN_AMBIENT_DEGC), model=commuter
    )
    assert unknown.energy_wh == pytest.approx(known.energy_wh, rel=0.03)
    assert unknown.energy_wh < usual.energy_wh
    assert unknown.interval_wh[1] - unknown.interval_wh[0] > known.interval_wh[1] - known.interval_wh[0]
    assert unknown.doubt.weather > known.doubt.weather + 0.01
    assert "ambient_temperature_degc" in {flag.subject for flag in unknown.flags}


def test_a_car_whose_trips_have_no_road_has_the_roads_of_all_logs(commuter: ForecastModel) -> None:
    nothing = replace(commuter, roads_=np.full((30, 9), np.nan))
    assert roads_of_model(nothing, road_prior()) is None
    found, usual = (
        tw.need(20, departure=MILD, model=car) for car in (nothing, replace(commuter, roads_=None))
    )
    assert found == usual


def test_a_holiday_of_a_commuter_is_not_driven_through_towns() -> None:
    """No own trip is as long: the town of all logs does not grow with the distance either."""
    model = adaptation(tw.load_model(), _drives(8.0, 30.0, 5), tw.load_vehicle("vw_id3")).model
    far = tw.need(180, departure=MILD, model=model)
    assert 3.6 * far.distance_m / far.duration_s > 50.0


@pytest.mark.parametrize("shares", [(math.nan, 0.5, 0.5), (0.5, math.nan, 0.5), (0.5, 0.5), (-0.5, 1.0, 0.5)])
def test_shares_that_are_none_and_parts_of_trips_are_refused(shares):
    refuses("not shares of a distance: kind", tw.need, 10, shares)
    refuses(r"not a whole number: trips: got 2\.5", tw.need, 10, trips=2.5)
