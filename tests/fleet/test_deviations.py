"""Vehicles and drivers that take more than others, and trips that take more than their forecasts."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from tests.fleet.rows import made_rows, table_rows

from tripwatt.fleet.deviations import PARTS, deviations, drift, worst_month
from tripwatt.fleet.features import FEATURES, SCALES, START
from tripwatt.fleet.statistics import KEYS, ROWS, TripRows
from tripwatt.hybrid.groups import fit_scales, group_posterior

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_vehicles_and_drivers_stand_beside_others():
    rows = made_rows(9, 40)
    frame = rows.table.to_pandas()
    thirsty = frame["vehicle_id"] == "v04"
    frame.loc[thirsty, "observed_wh"] += 0.1 * frame.loc[thirsty, "simulated_wh"]
    frame["driver"] = [f"{vehicle}/{'AB'[k % 2]}" for k, vehicle in enumerate(frame["vehicle_id"])]
    frame.loc[frame["driver"] == "v02/B", "observed_wh"] *= 1.08
    rows = table_rows(frame)
    sums = rows.sums
    posterior = group_posterior(sums, fit_scales(sums, START))
    vehicles, drivers = deviations(posterior, rows), deviations(posterior, rows, drivers=True)
    for table, first, trips in ((vehicles, "v04", 40), (drivers, "v02", 20)):
        assert table.loc[0, "vehicle_id"] == first
        assert table["share"].is_monotonic_decreasing
        assert table["trips"].eq(trips).all()
        assert (table["sd"] > 0.0).all()
        assert table[list(PARTS)].sum(axis=1).to_numpy() == pytest.approx(table["share"].to_numpy())
    assert drivers.loc[0, "driver"] == "v02/B"
    assert 0.01 < drivers.loc[0, "driving"] < 0.08
    assert "driver" not in vehicles


def test_drift_names_the_vehicles_that_take_more(rows, fleet):
    *_, model, _ = fleet
    calm = drift(model.posterior, rows)
    assert calm["trips"] == len(rows)
    assert calm["coverage"] > 0.8
    frame = rows.table.to_pandas()
    its = frame["vehicle_id"] == "V00003"
    frame.loc[its, "observed_wh"] *= 1.3
    changed = table_rows(frame)
    found = drift(model.posterior, changed)
    assert list(found["vehicles"]) == ["V00003"]
    assert found["vehicles"]["V00003"]["trips"] == its.sum()
    assert found["vehicles"]["V00003"]["bias"] == pytest.approx(0.3, abs=0.06)
    assert found["vehicles"]["V00003"]["z"] > 3.0
    assert found["coverage"] < calm["coverage"]
    assert found["bias"] - calm["bias"] == pytest.approx(0.3 * its.mean(), rel=0.2)


@pytest.mark.parametrize(
    ("planted", "first"),
    [("climate", "+20 by heating and cooling"), ("air", "+20 by roads, speed and load"), (None, "+20 by vehicles, drivers or unknown")],
)  # fmt: skip
def test_the_worst_month_is_explained_by_what_it_took_more(planted, first):
    months = np.repeat(["2024-01", "2024-02", "2024-03"], [12, 12, 4])
    more = np.where(months == "2024-01", 200.0, np.where(months == "2024-03", 900.0, 0.0))
    names = [field.name for field in ROWS]
    table = {name: np.zeros(28) for name in names} | dict.fromkeys(KEYS, [""] * 28)
    simulated = 1500.0 + more * (planted is not None)
    table |= {"started_at": [f"{month}-05T08:00:00" for month in months], "distance_m": np.full(28, 10e3)}
    table |= {"simulated_wh": simulated, "observed_wh": 1500.0 + more}
    if planted:
        table[f"x_{planted}"] = more * SCALES[FEATURES.index(planted)]
    rows = TripRows(pa.table({name: table[name] for name in names}, schema=ROWS))
    usual = SimpleNamespace(weights=lambda model: (np.zeros(len(FEATURES)), None))
    said = worst_month(usual, rows)["Worst month"]
    assert said.startswith(f"2024-01 took 170 Wh/km, +20 beside the other months: {first}, ")
    assert said.count("+0") == 2
    assert worst_month(usual, rows.where(months != "2024-01")) == {}
