"""Changes of vehicles that are planted in a fleet: which are listed, with which cause and month, and what is no change."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm
from scipy.stats import t as student
from tests.fleet.rows import table_rows, year_of_rows

from tripwatt.fleet.changes import (
    BATTERY,
    MIN_CHANGE,
    MIN_TRIPS,
    USUAL_CHANGE,
    ChangeScan,
    VehicleSeries,
    _trip_weights,
    changes,
    common_monthly_deviation,
    need_notes,
    trip_variance,
    vehicle_series,
    without_trips_before_changes,
)
from tripwatt.fleet.changes import series_changes as one_by_one
from tripwatt.fleet.features import START, WARM_DEGC
from tripwatt.fleet.model import predict_rows
from tripwatt.hybrid.groups import fit_scales, group_posterior

SEED = 4711
"""Not looked at while the method was chosen."""

PLANTED = [
    (2, "road load", 110, 0.06),
    (7, "climate", 196, 0.06),
    (11, "base load", 140, 0.06),
    (18, "battery", 228, 0.06),
]


def changes_of(rows):
    return changes(rows)


@pytest.fixture(scope="module")
def listed():
    return changes_of(year_of_rows(SEED, changes=PLANTED))


def test_planted_changes_are_listed_with_their_causes(listed):
    right = {f"v{n:02d}": BATTERY if cause == "battery" else cause for n, cause, *_ in PLANTED}
    assert dict(zip(listed["vehicle_id"], listed["cause"], strict=True)) == right
    assert len(listed) == len(PLANTED)
    assert listed["probability"].min() > 0.9


def test_the_beginning_is_close_and_in_its_interval(listed):
    table = listed.set_index("vehicle_id")[["from_day", "since", "to_day"]].map(dt.date.fromisoformat)
    true = {f"v{n:02d}": dt.date(2025, 1, 1) + dt.timedelta(days=day) for n, _, day, _ in PLANTED}
    late = np.array([(table.loc[name, "since"] - day).days for name, day in true.items()])
    assert np.median(np.abs(late)) <= 10
    outside = [not row["from_day"] <= true[name] <= row["to_day"] for name, row in table.iterrows()]
    assert sum(outside) <= 1
    assert (listed["from_day"] <= listed["since"]).all()
    assert (listed["since"] <= listed["to_day"]).all()
    assert (listed["before"] + listed["after"] == 140).all()


def test_the_size_of_a_change_is_within_its_error(listed):
    share = listed.set_index("vehicle_id")
    for number, _, _, true in PLANTED:
        row = share.loc[f"v{number:02d}"]
        assert abs(row["change"] - true) < 4.0 * row["sd"]
        assert row["z"] == pytest.approx(row["change"] / row["sd"])
    assert listed["change"].abs().is_monotonic_decreasing
    assert listed["change"].abs().min() >= MIN_CHANGE


def test_fleets_without_changes_list_one_at_most():
    """Nothing, batteries that lose capacity with the years, and winter tyres on every vehicle."""
    listed = [changes_of(year_of_rows(SEED + 1, **what)) for what in ({}, {"ageing": 0.04}, {"winter": 0.15})]
    assert sum(map(len, listed)) <= 1


@pytest.mark.parametrize("of", ["v03", "v99"])
@pytest.mark.parametrize(("column", "factor"), [("observed_wh", 10.0), ("displayed_end", 0.1)])
def test_odd_trips_of_a_vehicle_change_no_other(of, column, factor):
    """Twenty trips of an old or a new vehicle with an energy or a display that cannot be."""
    frame = year_of_rows(SEED + 2).table.to_pandas()
    odd = frame[frame["vehicle_id"] == "v03"].sample(20, random_state=1).assign(vehicle_id=of)
    odd["digest"], odd[column] = "odd " + odd["digest"], odd[column] * factor
    listed = changes_of(table_rows(pd.concat([frame, odd], ignore_index=True)))
    assert set(listed["vehicle_id"]) <= {of}


def test_a_fall_is_a_change_too():
    (row,) = changes_of(year_of_rows(SEED + 2, changes=[(5, "road load", 160, -0.08)])).to_dict("records")
    assert (row["vehicle_id"], row["cause"]) == ("v05", "road load")
    assert row["change"] == pytest.approx(-0.08, abs=0.03)


def test_few_trips_and_trips_without_a_time_have_no_change():
    rows = year_of_rows(SEED, vehicles=6, trips=15, changes=[(2, "road load", 180, 0.5)])
    assert len(changes_of(rows)) == 0
    frame = year_of_rows(SEED, changes=PLANTED).table.to_pandas().assign(started_at=None)
    assert len(changes_of(table_rows(frame))) == 0


def test_what_sisters_share_in_a_month_is_a_median_of_medians():
    model, vehicle = np.repeat(["a", "b"], [10, 4]), np.array([f"v{k}" for k in range(14)])
    day = np.full(14, np.datetime64("2025-11-03"))
    relative = np.r_[np.full(9, 0.1), 5.0, np.full(4, 0.3)]
    common = common_monthly_deviation(model, vehicle, day, relative)
    assert common == pytest.approx(np.r_[np.full(10, 0.1), np.zeros(4)])
    assert pd.notna(common).all()


def drives(n=40, seed=3):
    """A series of one vehicle without a change: two terms, a cause for each and one for both."""
    rng = np.random.default_rng(seed)
    X = rng.uniform(0.5, 1.5, (n, 2)) * [100.0, 40.0]
    variance = rng.uniform(20.0, 60.0, n)
    y = X @ [0.05, -0.08] + np.sqrt(variance) * rng.normal(size=n)
    day = np.datetime64("2025-01-20") + np.sort(rng.integers(0, 90, n))
    causes = {"a": np.array([1.0, 0.0]), "both": np.array([0.4, 1.0])}
    return VehicleSeries("v1", "m", day, y, variance, X, np.array([0.01, 0.04]), causes, 9000.0)


def test_every_change_is_that_of_least_squares_beside_the_deviations():
    series, n = drives(), 40
    w = 1.0 / series.variance
    free = np.arange(n) != 20
    scan = ChangeScan._weighted(series, series.X, series.prior, free, w)
    assert (scan.first_trip, scan.names) == (MIN_TRIPS, ("a", "both"))
    assert scan.share.shape == (2, n - 2 * MIN_TRIPS + 1)
    for c, weights in enumerate(series.causes.values()):
        rise = series.X @ weights
        unit = rise.sum() / series.total
        for place in range(scan.share.shape[1]):
            k = MIN_TRIPS + place
            if k == 20:
                assert (scan.share[c, place], scan.sd[c, place]) == (0.0, np.inf)
                continue
            A = np.column_stack([series.X, rise * (np.arange(n) >= k)])
            covariance = np.linalg.inv((A.T * w) @ A + np.diag([*(1.0 / series.prior), 0.0]))
            share = unit * (covariance @ (A.T @ (w * series.y)))[2]
            sd = unit * np.sqrt(covariance[2, 2])
            assert (scan.share[c, place], scan.sd[c, place]) == pytest.approx((share, sd), rel=1e-6)
            factor = norm.logpdf(share, 0.0, np.hypot(sd, USUAL_CHANGE)) - norm.logpdf(share, 0.0, sd)
            assert scan.evidence[c, place] == pytest.approx(factor, abs=1e-6)


def test_the_weight_of_a_trip_falls_beyond_two_deviations():
    """By hand for trips without terms, whose level is a median; the terms count half a trip each."""
    n, sd = 21, 5.0
    y = np.linspace(-10.0, 10.0, n)
    y[-1] = 100.0
    series = VehicleSeries("v", "m", None, y, np.full(n, sd**2), np.zeros((n, 2)), np.ones(2), {}, 1.0)
    level = 1.4826 * np.median(np.abs(y)) / sd * np.sqrt(21.0 / 20.0)
    w = _trip_weights(series, series.X, series.prior)
    usual = 1.0 / (level * sd) ** 2
    assert w[:-1] == pytest.approx(np.full(n - 1, usual), rel=1e-6)
    assert w[-1] == pytest.approx(usual * 2.0 * level * sd / 100.0, rel=1e-6)


def test_the_beginning_is_the_likeliest_day_of_the_likeliest_month():
    """By loops over days: one between two trips has the evidence of the later one, shared by all days between them."""
    evidence = np.array([[0.0, 1.0, 3.0, 2.5, 0.0], [1.0, 0.0, 0.5, 0.0, 0.0]])
    scan = ChangeScan(("a", "b"), 2, np.zeros((2, 5)), np.ones((2, 5)), evidence)
    day = np.datetime64("2025-01-01") + np.array([0, 9, 21, 29, 35, 37, 58, 60])
    odds = {}
    for place in range(5):
        first, last = day[place + 1] + 1, day[place + 2]
        for one in np.arange(first, last + 1):
            odds[one] = np.exp(evidence[0, place]) / (last - first + 1).astype(float)
    months = {}
    for one, value in odds.items():
        months[str(one)[:7]] = months.get(str(one)[:7], 0.0) + value
    likeliest = max(months, key=months.get)
    since = max((one for one in odds if str(one)[:7] == likeliest), key=odds.get)
    so_far = np.cumsum(list(odds.values())) / sum(odds.values())
    ends = [next(one for one, upto in zip(odds, so_far, strict=True) if upto >= p) for p in (0.025, 0.975)]
    probability = np.exp(evidence[0]).sum() / np.exp(evidence).sum()
    found, *days = scan.certainty("a", day)
    assert found == pytest.approx(probability, rel=1e-12)
    assert days == [since, *ends]


def stepped(*steps, n=120):
    """A series whose level rises by shares at trips; two trips a day."""
    at = np.arange(n)
    y = sum((share * 100.0 * (at >= k) for k, share in steps), np.zeros(n)) + np.where(at % 4 < 2, 0.3, -0.3)
    day = np.datetime64("2025-01-01") + at // 2
    X = np.full((n, 1), 100.0)
    return VehicleSeries("v", "m", day, y, np.full(n, 1.0), X, np.array([0.01]), {"a": np.ones(1)}, 100.0 * n)


def test_the_variance_of_trips_is_fitted_by_what_it_grows_with():
    rng = np.random.default_rng(SEED)
    usual, road, base = rng.uniform(1.0, 4.0, (3, 5000))
    true = 0.02 * usual + 0.3 * road**2
    residual = rng.standard_normal(5000) * np.sqrt(true)
    residual[::50] *= 30.0  # odd trips do not count
    assert trip_variance(residual, usual, [road, base]) == pytest.approx(true, rel=0.1)
    assert (trip_variance(np.zeros(9), usual[:9], [road[:9]]) > 0.0).all()


def test_changes_are_listed_one_beside_the_other_and_three_at_most():
    rows = list(one_by_one(stepped((20, 0.3), (50, -0.2), (80, 0.25), (100, 0.1)), 1e-6))
    assert sorted((row["before"], row["after"]) for row in rows) == [(20, 100), (50, 70), (80, 40)]
    by_place = {row["before"]: row for row in rows}
    assert by_place[20]["since"] == "2025-01-11"
    assert by_place[50]["change"] == pytest.approx(-0.2, abs=0.02)
    assert all(row["z"] == pytest.approx(row["change"] / row["sd"]) for row in rows)


def test_small_changes_and_those_of_chance_are_not_listed():
    assert len(list(one_by_one(stepped((60, 0.021)), 1e-6))) == 1
    assert list(one_by_one(stepped((60, 0.019)), 1e-6)) == []
    (row,) = one_by_one(stepped((60, -0.05)), 1e-6)
    p = 2.0 * student.sf(abs(row["z"]), 116)
    assert list(one_by_one(stepped((60, -0.05)), 0.9 * p)) == []
    assert len(list(one_by_one(stepped((60, -0.05)), 1.1 * p))) == 1


def test_a_change_has_eight_trips_on_both_sides():
    assert [row["before"] for row in one_by_one(stepped((8, 0.3), n=16), 1e-6)] == [8]
    assert list(one_by_one(stepped((8, 0.3), n=15), 1e-6)) == []
    (row,) = one_by_one(stepped((4, 0.3), n=60), 1e-6)
    assert row["before"] >= 8


def test_the_display_of_a_vehicle_is_a_series_of_its_own():
    """Terms of its charge by loops: level, cold, years and the middle of the charge, as shares of what its energy takes."""
    rows = year_of_rows(SEED, vehicles=3, trips=30)
    series = list(vehicle_series(rows))
    assert [one.vehicle_id for one in series] == ["v00", "v01", "v02"] * 2
    frame = rows.table.to_pandas()
    frame["day"] = pd.to_datetime(frame["started_at"]).dt.normalize()
    begins = frame["day"].min()
    frame["taken"] = frame["displayed_start"] - frame["displayed_end"]
    frame = frame[frame["taken"] > 0.0].assign(ratio=frame["observed_wh"] / frame["taken"])
    usual_wh = frame.groupby("car_model")["ratio"].median()
    for one in series[3:]:
        own = frame[frame["vehicle_id"] == one.vehicle_id].sort_values("started_at", kind="stable")
        share = own["observed_wh"] / usual_wh[one.car_model]
        cold = (WARM_DEGC - own["ambient_temperature_degc"]).clip(lower=0.0) / WARM_DEGC
        years = (own["day"] - begins).dt.days / 365.0
        middle = (own["displayed_start"] + own["displayed_end"]) / 2.0 - 0.5
        terms = np.column_stack([np.ones(len(own)), cold, years, middle])
        assert pytest.approx(terms * share.to_numpy()[:, None]) == one.X
        assert one.variance == pytest.approx((0.001**2 + (0.01 * share) ** 2).to_numpy())
        assert one.causes[BATTERY].tolist() == [1.0, 0.0, 0.0, 0.0]
        assert (one.day == own["day"].to_numpy().astype("datetime64[D]")).all()


@pytest.fixture(scope="module")
def jumped(fleet):
    """A model that has seen a year in which the road load of one vehicle and the battery of another rise by 18 % in July."""
    rows = year_of_rows(SEED, changes=[(2, "road load", 190, 0.18), (7, "battery", 190, 0.18)])
    sums, digests = rows.sums, frozenset(rows.texts("digest").tolist())
    model = replace(
        fleet[2], sums=sums, posterior=group_posterior(sums, fit_scales(sums, START)), digests=digests
    )
    return model, rows, changes(rows)


def after(rows, vehicle, day="2025-07-10"):
    """Trips of a vehicle from a day on."""
    return rows.where((rows.texts("vehicle_id") == vehicle) & (rows.texts("started_at") >= day))


def test_what_a_changed_vehicle_takes_is_that_of_its_trips_since_then(jumped):
    model, rows, changed = jumped
    since = without_trips_before_changes(model, rows, changed)
    trips = after(rows, "v02")
    observed = trips.numbers("observed_wh").sum()
    average, own = (predict_rows(m.posterior, trips)[0].sum() / observed for m in (model, since))
    assert average < 0.95
    assert own == pytest.approx(1.0, abs=0.01)
    doubt, sure = (predict_rows(m.posterior, trips)[1].mean() for m in (since, model))
    assert doubt > sure
    for same in ("v03", "v07"):
        others = after(rows, same)
        assert predict_rows(since.posterior, others)[0] == pytest.approx(
            predict_rows(model.posterior, others)[0], rel=5e-3
        )
    assert since.trips == model.trips - round(changed.set_index("vehicle_id").loc["v02", "before"])


def test_trips_that_the_model_has_not_seen_are_not_taken_out_of_it(jumped):
    model, rows, changed = jumped
    early = {
        d for d, day in zip(rows.texts("digest"), rows.texts("started_at"), strict=True) if day < "2025-02"
    }
    before = replace(model, digests=model.digests - early)
    taken = without_trips_before_changes(before, rows, changed).trips
    its = rows.where(rows.texts("vehicle_id") == "v02")
    assert taken == without_trips_before_changes(model, rows, changed).trips + sum(
        d in early for d in its.texts("digest")
    )
    assert without_trips_before_changes(model, rows, changed[:0]) is model


def test_a_change_in_words(jumped):
    of = need_notes(jumped[2])
    road, battery = of["v02"], of["v07"]
    assert road.startswith("the need is that of its trips after its change of +1")
    assert " % (road load, since 2025-07-" in road
    assert battery.startswith("the need does not contain its change of +1")
    assert f" % ({BATTERY}, since 2025-0" in battery
