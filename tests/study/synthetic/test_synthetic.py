"""The synthetic fleet: repeatable, plausible, consistent with itself, and its hidden truth can be found again."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import tripwatt.study.synthetic as synthetic
from tripwatt.auditing import audit
from tripwatt.errors import InvalidInput
from tripwatt.physics import DriveConditions, Simulation, simulate
from tripwatt.study.synthetic import (
    VEHICLE,
    synthetic_fleet,
    synthetic_world,
)
from tripwatt.study.synthetic import scenario as scenario_module
from tripwatt.study.synthetic.world import age_battery
from tripwatt.trips import COLUMNS, Trip
from tripwatt.trips.messages import message
from tripwatt.vehicles import load_vehicle


@pytest.fixture(scope="module")
def world():
    return synthetic_world(120, seed=7)


@pytest.fixture(scope="module")
def fleet(world):
    return world[0]


@pytest.fixture(scope="module")
def truth(world):
    return world[1]


def without_climate(trip: Trip) -> Simulation:
    """The physics of the car on a logged trip, no heating or cooling."""
    return simulate(
        load_vehicle(synthetic.VEHICLE),
        trip.array("time_s"),
        trip.array("speed_m_s"),
        elevation_m=trip.array("elevation_m"),
        climate_power_w=0.0,
        conditions=DriveConditions(
            ambient_temperature_degc=trip.array("ambient_temperature_degc")[0],
            initial_soc=trip.array("soc")[0],
            initial_battery_temperature_degc=trip.array("battery_temperature_degc")[0],
            payload_mass_kg=trip.context.payload_mass_kg,
        ),
    )


def test_a_seed_makes_the_same_fleet_and_a_longer_one_begins_with_it(fleet, truth):
    shorter, shorter_truth = synthetic_world(9, seed=7)
    for a, b in zip(shorter.trips, fleet.trips, strict=False):
        pd.testing.assert_frame_equal(a.samples, b.samples, check_exact=True)
        assert a.context == b.context
        assert a.observed_energy_wh == b.observed_energy_wh
    pd.testing.assert_frame_equal(shorter_truth, truth.head(9), check_exact=True)
    other = synthetic_fleet(1, seed=8).trips[0]
    assert other.observed_energy_wh != shorter.trips[0].observed_energy_wh


def test_no_two_purposes_share_their_random_numbers():
    keys = [(p, *rest) for p in range(10) for rest in ((), (0,), (0, 0), (1,), (0, 1), (1, 0))]
    first = {scenario_module.stream(seed, *key).random() for key in keys for seed in (0, 1)}
    assert len(first) == 2 * len(keys)


@pytest.mark.parametrize("module", ["roads", "world", "sensors"])
def test_what_one_trip_draws_changes_no_other_trip(monkeypatch, fleet, module):
    scenarios = list(scenario_module.draw_scenarios(12, 7))
    target = next(i for i in range(11) if scenarios[i + 1].key[1])  # another trip follows it on its day

    def elsewhere(seed, purpose, *index):
        return scenario_module.stream(seed + 1000 * (index == scenarios[target].key), purpose, *index)

    monkeypatch.setattr(f"tripwatt.study.synthetic.{module}.stream", elsewhere)
    for i, (changed, kept) in enumerate(zip(synthetic_fleet(12, seed=7).trips, fleet.trips, strict=False)):
        assert changed.samples.equals(kept.samples) == (i != target)


def test_two_seasons_several_days_trips_and_drivers(fleet, truth):
    first = fleet.trips[:32]
    assert {t.context.season for t in first} == {"summer", "winter"}
    assert all(sum(t.context.season == s for t in first) >= 8 for s in ("summer", "winter"))
    assert len({t.context.day for t in first}) >= 8
    assert truth["driver"].head(32).nunique() >= 3
    assert {t.context.route for t in fleet.trips} == {"city", "rural", "highway", "mixed"}
    assert {"sunny", "cloudy", "rainy", "dark"} <= {t.context.weather for t in fleet.trips}
    for t in fleet.trips:
        assert t.context.day.month in ((6, 7, 8) if t.context.season == "summer" else (12, 1, 2))
        assert t.context.cabin_setpoint_degc == t.array("cabin_setpoint_degc")[0]
        assert truth.loc[t.trip_id, "driver"] == t.context.driver
        assert 9 * 60 <= t.duration_s <= 55 * 60
        assert set(t.samples.columns) == set(COLUMNS) - {
            "grade",
            "motor_torque_nm",
            "climate_power_w",
            "speed_limit_m_s",
        }
        assert not t.samples.isna().any().any()
    assert fleet.name == "synthetic"
    assert fleet.reference is None
    assert "synthetic" in message(fleet.notes[0])


def test_truth_adds_up_and_sensors_report_it(fleet, truth):
    parts = ["driving", "heating", "aircon", "lamps", "driver", "trip", "noise"]
    total = truth[[f"{p}_energy_wh" for p in parts]].sum(axis=1)
    np.testing.assert_allclose(total, truth["energy_wh"], rtol=1e-9)
    observed = np.array([t.observed_energy_wh for t in fleet.trips])
    np.testing.assert_allclose(observed, truth["energy_wh"], rtol=0.003)
    assert not np.array_equal(observed, truth["energy_wh"])
    for t in fleet.trips:
        ambient = t.array("ambient_temperature_degc").mean()
        assert ambient == pytest.approx(truth.loc[t.trip_id, "ambient_temperature_degc"], abs=0.3)
        heating = np.trapezoid(t.array("heating_power_w"), t.array("time_s")) / 3600.0
        assert heating == pytest.approx(truth.loc[t.trip_id, "heating_energy_wh"], rel=0.03, abs=20.0)


def test_charge_agrees_with_current_and_energy(fleet, truth):
    battery = load_vehicle(synthetic.VEHICLE).battery
    for t in fleet.trips:
        soc, time = t.array("soc"), t.array("time_s")
        drawn_ah = np.trapezoid(t.array("current_a"), time) / 3600.0
        assert soc[0] - soc[-1] == pytest.approx(drawn_ah / age_battery(battery).capacity_ah, abs=0.002)
        assert soc.min() > 0.1
        assert soc[-1] == pytest.approx(truth.loc[t.trip_id, "end_soc"], abs=0.0006)
        shown = battery.soc_from_displayed(t.array("displayed_soc")[0])
        assert shown == pytest.approx(soc[0], abs=0.004)
    per_soc = [t.observed_energy_wh / np.ptp(t.array("soc")[[0, -1]]) for t in fleet.trips]
    assert np.std(per_soc) / np.mean(per_soc) < 0.05


def test_the_hidden_truth_can_be_found_again(fleet, truth):
    """What physics misses is explained by the hidden effects, each with about the weight that it really had."""
    missed = np.array([t.observed_energy_wh - without_climate(t).simulated_energy_wh for t in fleet.trips])
    causes = [
        "heating_energy_wh",
        "aircon_energy_wh",
        "lamps_energy_wh",
        "driver_energy_wh",
        "trip_energy_wh",
    ]
    causes += ["wind_work_wh", "rolling_work_wh"]
    x = truth[causes].to_numpy()
    weight, *_ = np.linalg.lstsq(x, missed, rcond=None)
    left = missed - x @ weight
    assert 1 - left.var() / missed.var() > 0.97
    found = dict(zip(causes, weight, strict=True))
    assert found["heating_energy_wh"] == pytest.approx(1.0, abs=0.1)
    assert found["aircon_energy_wh"] == pytest.approx(1.0, abs=0.3)
    assert found["driver_energy_wh"] == pytest.approx(1.0, abs=0.4)
    assert found["trip_energy_wh"] == pytest.approx(1.0, abs=0.3)
    # work at the wheel costs more than itself at the terminals, or less where it only spares the brakes
    assert 0.7 < found["wind_work_wh"] < 1.5
    assert 0.7 < found["rolling_work_wh"] < 1.5
    # and no single cause would do
    assert all(np.corrcoef(x[:, i], missed)[0, 1] ** 2 < 0.97 for i in range(len(causes)))


def test_finer_steps_tell_the_same_trip():
    coarse, fine = (synthetic_world(3, seed=2, step_s=step_s)[1] for step_s in (1.0, 0.1))
    shares = ["driver_share", "trip_share", "rolling_share", "headwind_m_s"]
    np.testing.assert_allclose(fine[shares], coarse[shares], rtol=0.05, atol=0.01)
    steady = ["driving_energy_wh", "heating_energy_wh", "aircon_energy_wh"]
    np.testing.assert_allclose(fine[steady], coarse[steady], rtol=0.03, atol=5.0)
    trip = synthetic_fleet(1, seed=2, step_s=0.1).trips[0]
    np.testing.assert_allclose(np.diff(trip.array("time_s")), 0.1)


def test_hidden_forces_have_the_right_sign():
    """A headwind costs and a tailwind spares what the same speed costs in still air."""
    from tripwatt.study.synthetic.roads import drive_route
    from tripwatt.study.synthetic.world import hidden_forces

    car = load_vehicle(synthetic.VEHICLE)
    scenario = next(p for p in scenario_module.draw_scenarios(8, 7) if p.route == "mixed")
    drive = drive_route(scenario, 7, 1.0)
    still = np.full(len(drive.grade), 15.0)
    level = replace(drive, heading_rad=np.zeros_like(still))
    found = {}
    for name, wind, angle in (("head", 6.0, 0.0), ("none", 0.0, 0.0), ("tail", 6.0, np.pi)):
        day = replace(scenario.day, wind_m_s=wind, wind_from_rad=angle)
        force, mean, *_ = hidden_forces(
            replace(scenario, day=day), level, still, car, np.random.default_rng(0)
        )
        found[name] = float(force @ drive.profile.speed_m_s)
        assert np.sign(round(mean, 9)) == {"head": 1, "none": 0, "tail": -1}[name]
    assert found["tail"] < 0 < found["none"] < found["head"]
    # still air: only the larger body, as a share of the physics' own air drag
    alone = simulate(
        car,
        drive.profile.time_s,
        drive.profile.speed_m_s,
        elevation_m=drive.elevation_m,
        conditions=DriveConditions(ambient_temperature_degc=15.0),
    )
    air_w = alone.aero_drag_force_n @ drive.profile.speed_m_s
    assert found["none"] / air_w == pytest.approx(0.04, abs=0.004)


def test_the_audit_keeps_every_trip_whole(fleet):
    fleet = replace(fleet, logs=fleet.logs[:32])
    kept = audit(fleet)
    assert [str(f) for f in kept.findings] == []
    assert [t.trip_id for t in kept.trips] == [t.trip_id for t in fleet.trips]
    assert [t.observed_energy_wh for t in kept.trips] == [t.observed_energy_wh for t in fleet.trips]


def test_arguments_are_checked():
    with pytest.raises(InvalidInput) as caught:
        synthetic_fleet(0, seed=-1, step_s=0.0, hours=(2.0, 1.0))
    assert [f.where for f in caught.value.faults] == ["n_trips", "seed", "step_s", "hours"]


def test_long_drives_take_the_hours_that_were_asked():
    fleet = synthetic_fleet(3, seed=2, hours=(1.0, 1.2))
    for trip in fleet.trips:
        assert 3600.0 * 0.8 < trip.duration_s < 3600.0 * 1.5
        assert trip.distance_m > 55_000.0
        assert trip.array("soc")[0] == pytest.approx(0.9, abs=0.01)
        assert trip.context.follows_trip is False


def test_another_car_stands_on_its_own_physics():
    usual, other = (
        synthetic_fleet(2, seed=4, vehicle=load_vehicle(n)) for n in (VEHICLE, "tesla_model_3_lr")
    )
    assert usual.trips[0].observed_energy_wh == synthetic_fleet(2, seed=4).trips[0].observed_energy_wh
    for a, b in zip(usual.trips, other.trips, strict=True):
        np.testing.assert_array_equal(a.array("speed_m_s"), b.array("speed_m_s"))  # the same drives
        assert 0.8 < b.observed_energy_wh / a.observed_energy_wh < 1.6
        # a battery of four times the energy
        fall = [float(np.ptp(t.array("soc"))) for t in (a, b)]
        assert fall[0] > 2.0 * fall[1]
