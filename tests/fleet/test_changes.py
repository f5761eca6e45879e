"""Changes of vehicles that are planted in a fleet: which are listed, with which cause and month, and what is no change."""

import datetime as dt

import numpy as np
import pandas as pd
import pytest
from tests.fleet.rows import year_of_rows

from tripwatt.fleet.changes import BATTERY, LEAST_CHANGE, changes, common_of_month
from tripwatt.fleet.features import START
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
    sums = rows.sums
    return changes(group_posterior(sums, fit_scales(sums, START)), rows)


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
    assert listed["change"].abs().min() >= LEAST_CHANGE


def test_fleets_without_changes_list_one_at_most():
    """Nothing, batteries that lose capacity with the years, and winter tyres on every vehicle."""
    listed = [changes_of(year_of_rows(SEED + 1, **what)) for what in ({}, {"ageing": 0.04}, {"winter": 0.15})]
    assert sum(map(len, listed)) <= 1


def test_a_fall_is_a_change_too():
    (row,) = changes_of(year_of_rows(SEED + 2, changes=[(5, "road load", 160, -0.08)])).to_dict("records")
    assert (row["vehicle_id"], row["cause"]) == ("v05", "road load")
    assert row["change"] == pytest.approx(-0.08, abs=0.03)


def test_few_trips_and_trips_without_a_time_have_no_change():
    rows = year_of_rows(SEED, vehicles=6, trips=15, changes=[(2, "road load", 180, 0.5)])
    assert len(changes_of(rows)) == 0
    frame = year_of_rows(SEED, changes=PLANTED).table.to_pandas().assign(started_at=None)
    from tripwatt.fleet.statistics import ROWS, TripRows, pa

    timeless = TripRows.join([pa.Table.from_pandas(frame, schema=ROWS, preserve_index=False)])
    assert len(changes_of(timeless)) == 0


def test_what_sisters_share_in_a_month_is_a_median_of_medians():
    model, vehicle = np.repeat(["a", "b"], [10, 4]), np.array([f"v{k}" for k in range(14)])
    day = np.full(14, np.datetime64("2025-11-03"))
    relative = np.r_[np.full(9, 0.1), 5.0, np.full(4, 0.3)]
    common = common_of_month(model, vehicle, day, relative)
    assert common == pytest.approx(np.r_[np.full(10, 0.1), np.zeros(4)])
    assert pd.notna(common).all()
