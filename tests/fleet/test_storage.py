"""A stored model of a fleet."""

import pytest
from benchmarks.many_vehicles import many_vehicles
from tests.support.refusals import refuses

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
    assert ours.arrival.interval(0.9) == theirs.arrival.interval(0.9)
    assert again.digests == model.digests
    assert again.vehicles() == model.vehicles()
    observed = trip.samples.iloc[:200]
    assert ours.update(observed).energy_wh == theirs.update(observed).energy_wh
    (tmp_path / "m" / "fleet.npz").write_bytes(b"x")
    refuses(r"fleet\.npz", load_fleet, tmp_path / "m")
    import tripwatt as tw

    tw.save_model(tw.load_model(), tmp_path / "one")
    refuses("no model of a fleet", load_fleet, tmp_path / "one")
