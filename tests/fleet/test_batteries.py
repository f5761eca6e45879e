"""Usable energy of batteries over time, with planted losses: when a route or a warranty ends."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from scipy.special import ndtr
from tests.fleet.rows import table_rows, year_of_rows

from tripwatt.fleet import Warranty
from tripwatt.fleet.batteries import Fade, battery_table, fades, route_ends
from tripwatt.fleet.changes import BATTERY
from tripwatt.fleet.statistics import TripRows
from tripwatt.physics.battery import usable_energy_wh
from tripwatt.vehicles import load_vehicle

NONE = pd.DataFrame(columns=["vehicle_id", "cause", "since"])
LOSS = 0.05
"""Planted loss of capacity a year, from the first of January 2025 on."""


def planted(seed, **more):
    """Rows, fades, and the energy of the full display of each vehicle at the beginning."""
    rows = year_of_rows(seed, ageing=LOSS, **more)
    years = (rows.chronological[1] - np.datetime64("2025-01-01")) / np.timedelta64(365, "D")
    taken = (rows.numbers("displayed_start") - rows.numbers("displayed_end")) * (1.0 - LOSS * years)
    sums = (
        pd.DataFrame({"wh": rows.numbers("observed_wh"), "taken": taken})
        .groupby(rows.texts("vehicle_id"))
        .sum()
    )
    return rows, fades(rows, NONE), sums["wh"] / sums["taken"]


@pytest.fixture(scope="module", params=(411, 412))
def fleet_of_a_year(request):
    return planted(request.param)


def months(text):
    return 12.0 * int(text[:4]) + int(text[5:]) - 1.0


def test_planted_losses_and_their_months_lie_in_the_intervals(fleet_of_a_year):
    _, known, full_wh = fleet_of_a_year
    inside, off = [], []
    for vehicle, fade in known.items():
        capacity, sd = fade.capacity(fade.now)
        truth = full_wh[vehicle] * (1.0 - LOSS * fade.now) / fade.usual_wh
        off.append((capacity - truth) / sd)
        assert capacity == pytest.approx(truth, abs=0.02), "the bar: 2 points"
        level = 0.8 * full_wh[vehicle] / fade.usual_wh
        falls = fade.falls_below(level)
        month = 12.0 * 2025 + 12.0 * 0.2 / LOSS
        inside.append(months(falls["earliest"]) - 1.0 <= month <= months(falls["latest"]) + 1.0)
        assert months(falls["month"]) == pytest.approx(month, abs=12.0)
    assert np.mean(inside) >= 0.85
    assert np.mean(np.abs(off) <= 1.96) >= 0.8


def test_a_route_ends_in_the_month_in_which_the_battery_is_too_small(fleet_of_a_year):
    _, known, full_wh = fleet_of_a_year
    vehicle, fade = next(iter(known.items()))
    taken_wh = 0.9 * 0.85 * full_wh[vehicle]  # 85 % of the first full display without the reserve of 10 %
    need = 0.1 + taken_wh / fade.usual_wh
    needs = [
        (vehicle, "long", need),
        (vehicle, "short", 0.3),
        (vehicle, "far", 1.3),
    ]
    table = route_ends(known, needs, 0.1).set_index("trip")
    assert set(table.index) == {"long", "short", "far"}
    long = table.loc["long"]
    assert months(long["month"]) == pytest.approx(12.0 * 2025 + 12.0 * 0.15 / LOSS, abs=8.0)
    assert long["earliest"] <= long["month"] <= long["latest"]
    assert table["month"].isna().tolist() == [False, False, True], "the first to end is first"
    assert table.loc["far", "month"] == fade.month(fade.now), "what is not possible now ends now"
    unknown = route_ends(known, [(vehicle, "r", np.nan)], 0.1)
    assert unknown[["soc_needed", "month", "latest"]].isna().all(axis=None)
    assert long["soc_needed"] == pytest.approx(0.1 + taken_wh / (full_wh[vehicle] * (1.0 - LOSS)), abs=0.02)


def test_more_is_needed_earlier_and_an_unknown_loss_is_not_a_promise():
    fade = Fade(np.datetime64("2025-01-01"), 1.0, np.array([0.0, 0.03]), np.diag([1e-4, 1e-5]))
    ends = [fade.falls_below(level)["month"] or "9999" for level in (0.7, 0.8, 0.9, 1.2)]
    assert ends == sorted(ends, reverse=True)
    assert ends[-1] == "2026-01"
    vague = Fade(fade.begins, 1.0, np.array([0.0, 0.0]), np.diag([1e-4, 1e-2]))
    falls = vague.falls_below(0.8)
    assert falls["month"] is None
    assert falls["earliest"] is not None
    steady = Fade(fade.begins, 1.0, np.array([0.0, 0.0]), np.diag([1e-6, 1e-8]))
    assert set(steady.falls_below(0.8).values()) == {None}


def test_trips_before_a_change_of_the_battery_do_not_count():
    changed = pd.DataFrame([("v07", BATTERY, "2025-07-10")], columns=NONE.columns)
    rows, stepped, full_wh = planted(413, changes=[(7, "battery", 190, 0.18)])
    both, since = stepped["v07"], fades(rows, changed)["v07"]
    after = rows.where((rows.texts("vehicle_id") == "v07") & (rows.texts("started_at") >= "2025-11"))
    taken = after.numbers("displayed_start") - after.numbers("displayed_end")
    truth = after.numbers("observed_wh").sum() / taken.sum()
    found, sd = since.capacity(since.now)
    assert found * since.usual_wh == pytest.approx(truth, rel=0.02)
    assert both.taken[1] > 0.2 > 0.1 > since.taken[1], "a step is not a loss a year"
    assert set(fades(rows.where(rows.numbers("displayed_start") > 2.0), NONE)) == set()
    assert sd > 0.0
    assert len(full_wh) == 24


@pytest.mark.parametrize("trips", [1, 2])
def test_the_first_trips_of_a_new_car_model_leave_the_others(fleet_of_a_year, trips):
    """They define the usual capacity of their car model, so that their own is the usual one."""
    rows, known, _ = fleet_of_a_year
    frame = rows.table.to_pandas()
    new = frame[frame["vehicle_id"] == "v00"].iloc[:trips].assign(car_model="m9", vehicle_id="v99")
    more = fades(table_rows(pd.concat([frame, new], ignore_index=True)), NONE)
    assert more["v99"].capacity(0.0)[0] == pytest.approx(1.0, abs=0.03)
    assert more["v99"].capacity(0.0)[1] > known["v00"].capacity(0.0)[1]
    for vehicle, fade in known.items():
        assert more[vehicle].capacity(0.5)[0] == pytest.approx(fade.capacity(0.5)[0], abs=1e-3)


def test_a_warranty_ends_by_age_or_distance(fleet_of_a_year):
    rows, *_ = fleet_of_a_year
    frame = rows.table.to_pandas().replace({"car_model": {"m0": "nissan_leaf_40"}})
    named = TripRows.join([pa.Table.from_pandas(frame, schema=rows.table.schema, preserve_index=False)])
    known = fades(named, NONE)
    new_wh = usable_energy_wh(load_vehicle("nissan_leaf_40").battery)
    new_at = {"v00": "2022-05-01", "v04": "2023-03-01"}
    table = battery_table(known, named, Warranty(0.9, 3.0, 1e6), new_at).set_index("vehicle_id")
    assert table["warranty_until"][["v00", "v04"]].tolist() == ["2025-05", "2026-03"], "not 1095 days"
    eight = battery_table(known, named, Warranty(0.7, 8.0, 1e6), new_at).set_index("vehicle_id")
    assert eight["warranty_until"][["v00", "v04"]].tolist() == ["2030-05", "2031-03"]
    assert table.loc["v02", "warranty_until"] == "2028-01"
    row, fade = table.loc["v02"], known["v02"]
    assert row["share"] == pytest.approx(row["usable_wh"] / new_wh)
    assert row["usable_wh"] == pytest.approx(fade.usual_wh * fade.capacity(fade.now)[0])
    assert row["below"] == pytest.approx(
        ndtr(
            (0.9 * new_wh / fade.usual_wh - fade.capacity(3.0)[0])
            / np.hypot(fade.capacity(3.0)[1], 0.027 * new_wh / fade.usual_wh)
        ),
        abs=0.02,
    )
    assert table["share"].isna().sum() == 12, "a car model without figures"
    assert table["month"][table["share"].isna()].isna().all()
    km = pd.Series(named.numbers("distance_m") / 1e3).groupby(named.texts("vehicle_id")).sum()["v02"]
    soon = battery_table(known, named, Warranty(0.9, 30.0, 2.0 * km), {}).set_index("vehicle_id")
    assert soon.loc["v02", "warranty_until"] in ("2026-12", "2027-01")
    stricter = battery_table(known, named, Warranty(0.95, 3.0, 1e6), {}).set_index("vehicle_id")
    assert stricter.loc["v02", "below"] > row["below"]
