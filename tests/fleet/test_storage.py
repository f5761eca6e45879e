"""A stored model of a fleet."""

import json
from pathlib import Path

import pytest
from benchmarks.many_vehicles import CAR_MODELS, FleetPlan, many_vehicles

from tripwatt.errors import InvalidInput
from tripwatt.fleet.storage import load_fleet, save_fleet
from tripwatt.trips import Trip

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")


def test_a_stored_model_forecasts_alike(fleet, tmp_path):
    plan, _, model, _ = fleet
    save_fleet(model, tmp_path / "m")
    again = load_fleet(tmp_path / "m")
    trip = Trip.from_log(next(many_vehicles(plan)))
    ours, theirs = (m.forecast(trip, vehicle_id="V00000") for m in (model, again))
    assert ours.energy_wh == theirs.energy_wh
    assert ours.interval(0.9) == theirs.interval(0.9)
    assert ours.soc_interval(0.9) == theirs.soc_interval(0.9)
    assert again.digests == model.digests
    assert again.vehicles() == model.vehicles()
    observed = trip.samples.iloc[:200]
    assert ours.update(observed).energy_wh == theirs.update(observed).energy_wh
    (tmp_path / "m" / "fleet.npz").write_bytes(b"x")
    with pytest.raises(InvalidInput, match=r"fleet\.npz"):
        load_fleet(tmp_path / "m")
    import tripwatt as tw

    tw.save_model(tw.load_model(), tmp_path / "one")
    with pytest.raises(InvalidInput, match="no model of a fleet"):
        load_fleet(tmp_path / "one")


def test_a_fleet_of_0_2_0_forecasts_as_it_did_and_is_written_anew(tmp_path):
    """Fitted on 16 trips of 4 vehicles."""
    old = Path(__file__).parents[1] / "fixtures" / "model_0_2_0"
    model = load_fleet(old / "fleet")
    save_fleet(model, tmp_path / "m")
    trip = Trip.from_log(
        next(many_vehicles(FleetPlan(16, vehicles=4, car_models=CAR_MODELS[:2], minutes=6.0)))
    )
    then = json.loads(
        (old / "fleet.json")
        .read_text()
        .replace('"hvac"', '"climate"')
        .replace("learned_correction", "correction")
    )
    for found in (model, load_fleet(tmp_path / "m")):
        now = found.forecast(trip, vehicle_id="V00000").to_dict()
        for name in (
            "energy_wh",
            "soc_arrival",
            "wh_per_display",
            "quantiles_wh",
            "soc_quantiles",
            "by_cause_wh",
        ):
            assert now[name] == pytest.approx(then[name], rel=1e-9), name
    assert load_fleet(tmp_path / "m").digests == model.digests
