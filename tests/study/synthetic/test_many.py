"""The synthetic fleet of many vehicles: its truth, its independence of how it is made, and what it logs."""

import datetime as dt

import pytest
from benchmarks.many_vehicles import (
    CAR_MODELS,
    FleetPlan,
    block_of_logs,
    many_vehicles,
)

from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.trips import observed_energy

PLAN = FleetPlan(150, vehicles=12, car_models=CAR_MODELS[:2], minutes=10.0)


def test_a_longer_fleet_begins_with_the_shorter_one_and_any_block_can_be_made_alone():
    longer = FleetPlan(200, vehicles=12, car_models=CAR_MODELS[:2], minutes=10.0)
    short = {log.trip_id: log for log in many_vehicles(PLAN)}
    long = {log.trip_id: log for log in many_vehicles(longer)}
    assert len(short) == 150
    assert len(long) == 200
    assert set(short) <= set(long)
    assert all(short[name].samples.equals(long[name].samples) for name in short)
    alone = block_of_logs(PLAN, 1, 1)
    assert [log.trip_id for log in alone] == [log.trip_id for log in list(many_vehicles(PLAN))[-len(alone) :]]
    assert alone[0].samples.equals(short[alone[0].trip_id].samples)
    other = next(many_vehicles(FleetPlan(1, vehicles=12, car_models=CAR_MODELS[:2], minutes=10.0, seed=1)))
    assert not other.samples.equals(short["V00000-00000"].samples)


def test_logs_are_sound_and_their_energy_is_that_of_voltage_and_current():
    logs = list(many_vehicles(FleetPlan(24, vehicles=8)))
    found = audit(logs)
    assert len(found.trips) == 24
    assert not [f for f in found.findings if f.consequence != "noted"]
    for log in logs:
        assert log.observed_energy_wh == pytest.approx(observed_energy(log.samples), rel=1e-12)
        assert 16 * 60 <= log.duration_s <= 24 * 60
        assert log.array("speed_m_s").max() < 45.0
        assert log.context.driver.startswith(log.context.car)
        assert log.context.started_at >= dt.datetime(2023, 1, 1)


def test_every_fault_of_a_plan_is_named():
    with pytest.raises(InvalidInput) as error:
        FleetPlan(0, vehicles=0, minutes=4.0, days_between=0.01)
    assert [f.where for f in error.value.faults] == ["trips", "vehicles", "minutes", "days_between"]
    for models in ((), CAR_MODELS):
        with pytest.raises(InvalidInput, match="wrong number of car models"):
            FleetPlan(1, vehicles=7, car_models=models)
    FleetPlan(1, vehicles=8)
