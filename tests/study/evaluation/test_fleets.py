"""The evaluation of a fleet holds out what it scores."""

import numpy as np
import pandas as pd
import pytest
from tests.fleet.rows import made_rows

from tripwatt.errors import InvalidInput
from tripwatt.hybrid.groups import group_posterior
from tripwatt.study.evaluation.fleets import FleetEvaluation, evaluate_rows

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_evaluation_holds_out_what_it_scores():
    rows = made_rows()
    found = evaluate_rows(rows)
    table = found.table("car_model")
    assert set(table["protocol"]) == {"later trips", "new vehicles", "new car models"}
    assert table.loc[table["protocol"] == "new vehicles", "trips"].sum() == 168
    later = table[table["protocol"] == "later trips"]
    assert later["trips"].sum() == pytest.approx(0.2 * 168, abs=12)
    assert later["error"].max() < table.loc[table["protocol"] == "new vehicles", "error"].min()
    own = found.own.set_index("own_trips")
    assert own.index.tolist() == [0, 1, 3]
    assert own.loc[0, "pooled"] == pytest.approx(own.loc[0, "fleet_only"])
    assert (own["pooled"] <= own[["own_only", "fleet_only"]].min(axis=1) * 1.02).all()
    assert own.loc[3, "pooled"] < own.loc[0, "pooled"]
    # by hand: the forecast of a vehicle without its trips
    sums = rows.sums
    from tripwatt.fleet.features import START
    from tripwatt.hybrid.groups import fit_scales

    scales = fit_scales(sums, START)
    again = evaluate_rows(rows, scales)
    its = rows.texts("vehicle_id") == "v05"
    vehicles = sorted(set(rows.texts("vehicle_id").tolist()))
    fold = np.random.default_rng(0).permutation(12) % 10
    together = [v for v, f in zip(vehicles, fold, strict=True) if f == fold[5]]
    left = group_posterior(rows.where([v not in together for v in rows.texts("vehicle_id")]).sums, scales)
    expected = rows.numbers("simulated_wh")[its] + rows.X[its] @ left.weights("m2", "v05")[0]
    frame = again.trips[(again.trips["protocol"] == "new vehicles") & (again.trips["vehicle_id"] == "v05")]
    assert frame["predicted_wh"].to_numpy() == pytest.approx(expected, rel=1e-9)
    inside = (frame["observed_wh"] >= frame["low_wh"]) & (frame["observed_wh"] <= frame["high_wh"])
    counted = again.table("vehicle_id")
    row = counted[(counted["vehicle_id"] == "v05") & (counted["protocol"] == "new vehicles")].iloc[0]
    assert row["inside"] == pytest.approx(inside.mean())
    error = np.abs(frame["predicted_wh"] - frame["observed_wh"]) / frame["observed_wh"]
    assert row["error"] == pytest.approx(error.mean())
    assert set(again.table("temperature")["temperature"]) == {
        "below 0 °C",
        "0 to 10 °C",
        "10 to 20 °C",
        "above 20 °C",
    }
    assert set(again.table("length")["length"]) == {"below 10 km", "10 to 25 km", "above 25 km"}
    one = rows.where(rows.texts("vehicle_id") == "v00")
    with pytest.raises(InvalidInput, match="too few vehicles"):
        evaluate_rows(one)


def test_intervals_cover_their_share_of_new_vehicles():
    found = evaluate_rows(made_rows(40, 8, seed=2)).trips
    inside = (found["observed_wh"] >= found["low_wh"]) & (found["observed_wh"] <= found["high_wh"])
    share = inside[found["protocol"] == "new vehicles"].mean()
    assert share == pytest.approx(0.9, abs=0.04)


def test_classes_have_a_lower_bound_inside_and_an_upper_outside():
    trips = pd.DataFrame({"distance_m": [0.0, 9999.9, 10e3, 25e3, np.nan], "protocol": "later trips"})
    trips = trips.assign(observed_wh=1.0, predicted_wh=1.0, low_wh=1.0, high_wh=1.0)
    table = FleetEvaluation(trips, pd.DataFrame()).table("length")
    counts = dict(zip(table["length"], table["trips"], strict=True))
    assert counts == {"below 10 km": 2, "10 to 25 km": 1, "above 25 km": 1, "unknown": 1}
