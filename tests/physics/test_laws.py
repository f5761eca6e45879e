"""What must hold for every car on every trace."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tripwatt.arrays import distance_driven
from tripwatt.physics import DriveConditions, simulate, simulate_trip
from tripwatt.physics.chain import CAUSES
from tripwatt.physics.road_load import rolling_factor
from tripwatt.trips import STEEPEST_GRADE, Context, Departure, Plan, Trip
from tripwatt.trips.elevation import heights_of_a_road
from tripwatt.units import GRAVITY_M_S2, WH_PER_J
from tripwatt.vehicles import Vehicle, load_vehicle

EXAMPLES = settings(max_examples=40, deadline=None)


@st.composite
def traces(draw: st.DrawFn, *, closed: bool = False, hilly: bool = True) -> dict[str, np.ndarray]:
    """Times, speeds and grades of a drive, from gentle to impossible; closed ones start and end at rest."""
    n = draw(st.integers(3, 120))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    time = np.cumsum(rng.choice([0.1, 1.0, 1.0, 1.0, 7.5, 40.0], size=n))
    speed = np.clip(np.cumsum(rng.normal(0.0, draw(st.sampled_from([0.3, 1.5, 8.0])), n)) + 8.0, 0.0, 45.0)
    if closed:
        speed[0] = speed[-1] = 0.0
    grade = rng.normal(0.0, 0.04, n) if hilly else np.zeros(n)
    return {"time_s": time, "speed_m_s": speed, "grade": grade}


def net_energy_wh(time_s: np.ndarray, power_w: np.ndarray) -> float:
    return float(np.sum(power_w * np.diff(time_s, prepend=time_s[0])) * WH_PER_J)


@EXAMPLES
@given(traces(), st.floats(-25.0, 42.0), st.floats(0.0, 1.0), st.sampled_from(["default", "paper"]))
def test_parts_sum_to_the_battery_energy(trace, ambient, soc, preset) -> None:
    run = simulate(
        load_vehicle("bmw_i3_60ah", preset),
        **trace,
        conditions=DriveConditions(ambient_temperature_degc=ambient, initial_soc=soc),
    )
    parts = run.by_cause_wh
    assert set(parts) == set(CAUSES)
    throughput = sum(net_energy_wh(run.time_s, np.abs(power)) for power in run.power_by_cause_w.values())
    assert abs(sum(parts.values()) - run.simulated_energy_wh) <= 1e-12 * throughput
    for name in (
        "battery_power_w",
        "battery_current_a",
        "terminal_voltage_v",
        "soc",
        "battery_temperature_degc",
    ):
        assert np.isfinite(getattr(run, name)).all()


@EXAMPLES
@given(traces())
def test_terminals_and_open_circuit_agree(trace) -> None:
    run = simulate(load_vehicle("bmw_i3_60ah"), **trace)
    assert run.terminal_voltage_v * run.battery_current_a == pytest.approx(
        run.battery_power_w, abs=1e-6, rel=1e-9
    )
    assert (run.battery_loss_w >= -1e-6).all()


@EXAMPLES
@given(trace=traces(closed=True, hilly=False))
def test_loss_free_loop_nets_zero(trace, loss_free: Vehicle) -> None:
    run = simulate(loss_free, **trace, conditions=DriveConditions(initial_soc=0.5))
    gross = net_energy_wh(run.time_s, np.abs(run.wheel_power_w))
    if not run.flags:
        assert abs(run.simulated_energy_wh) <= 1e-9 * max(gross, 1.0)


def test_loss_free_loop_over_a_hill_nets_zero(loss_free: Vehicle) -> None:
    up = np.concatenate((np.full(100, 0.05), np.full(100, -0.05)))
    speed = np.full(201, 15.0)
    time = np.arange(201.0)
    elevation = np.concatenate(([0.0], np.cumsum(15.0 * up)))
    run = simulate(loss_free, time, speed, elevation_m=elevation)
    gross = net_energy_wh(time, np.abs(run.wheel_power_w))
    assert gross > 100.0
    assert abs(run.simulated_energy_wh) < 0.005 * gross


@EXAMPLES
@given(trace=traces(closed=True), ambient=st.floats(-20.0, 40.0))
def test_kinetic_energy_telescopes(trace, ambient) -> None:
    run = simulate(
        load_vehicle("bmw_i3_60ah"), **trace, conditions=DriveConditions(ambient_temperature_degc=ambient)
    )
    gross = net_energy_wh(run.time_s, np.abs(run.power_by_cause_w["acceleration"]))
    assert abs(run.by_cause_wh["acceleration"]) <= 1e-12 * max(gross, 1.0)


@given(st.floats(0.0, 5_000.0), st.floats(10.0, 9_000.0))
@EXAMPLES
def test_parked_car_uses_only_auxiliaries(climate, duration) -> None:
    car = load_vehicle("bmw_i3_60ah")
    run = simulate(
        car,
        [0.0, 0.3 * duration, duration],
        np.zeros(3),
        climate_power_w=climate,
        conditions=DriveConditions(initial_soc=1.0),
    )
    expected = (car.auxiliaries.base_load_w + climate) * duration * WH_PER_J
    assert run.simulated_energy_wh == pytest.approx(expected, rel=1e-12)


@EXAMPLES
@given(trace=traces(closed=True, hilly=False), more=st.floats(0.1, 800.0))
def test_more_mass_or_drag_never_takes_less_at_the_wheel(trace, more) -> None:
    car = load_vehicle("bmw_i3_60ah")
    draggy = load_vehicle(
        "bmw_i3_60ah",
        overrides={
            "road_load.coastdown_c_n_s2_m2": float(car.road_load.coastdown_c_n_s2_m2 or 0.0)
            * (1.0 + more / 800.0)
        },
    )
    base, heavy, wide = (
        net_energy_wh(trace["time_s"], run.wheel_power_w)
        for run in (
            simulate(car, **trace, conditions=DriveConditions(climate="off")),
            simulate(car, **trace, conditions=DriveConditions(climate="off", payload_mass_kg=more)),
            simulate(draggy, **trace, conditions=DriveConditions(climate="off")),
        )
    )
    assert heavy >= base
    assert wide >= base
    if trace["speed_m_s"].any():
        assert min(heavy, wide) > base


@EXAMPLES
@given(trace=traces(), fraction=st.floats(0.0, 1.0), soc=st.floats(0.0, 1.0), ambient=st.floats(-30.0, 40.0))
def test_regeneration_stays_within_its_bounds(trace, fraction, soc, ambient) -> None:
    car = load_vehicle("bmw_i3_60ah", overrides={"regeneration.fraction": fraction})
    run = simulate(
        car, **trace, conditions=DriveConditions(initial_soc=soc, ambient_temperature_degc=ambient)
    )
    braking = np.maximum(-run.wheel_power_w, 0.0)
    assert (run.regen_power_w >= 0.0).all()
    assert (run.friction_brake_power_w >= -1e-9).all()
    assert (run.regen_power_w <= fraction * braking * (1.0 + 1e-12)).all()
    assert (run.regen_power_w <= car.regeneration.max_power_w).all()
    if soc > car.regeneration.zero_soc + 0.05:
        assert run.regen_power_w[:2].max() == 0.0
    if fraction == 0.0:
        assert (np.diff(run.soc) <= 0.0).all()


@EXAMPLES
@given(trace=traces(hilly=False), low=st.floats(0.0, 1.0), high=st.floats(0.0, 1.0))
def test_more_regeneration_never_costs_energy(trace, low, high) -> None:
    low, high = sorted((low, high))
    less, more = (
        simulate(
            load_vehicle("bmw_i3_60ah", overrides={"regeneration.fraction": f}),
            **trace,
            conditions=DriveConditions(initial_soc=0.5),
        )
        for f in (low, high)
    )
    assert more.simulated_energy_wh <= less.simulated_energy_wh + 1e-9


DESCENDING = st.sampled_from(["bmw_i3_60ah", "vw_id3", "nissan_leaf_24", "tesla_model_3_lr"])


@EXAMPLES
@given(
    name=DESCENDING,
    displayed=st.sampled_from([1.0, 0.95, 0.8]),
    slope=st.floats(0.02, 0.12),
    speed=st.floats(6.0, 25.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_descent_raises_the_charge_above_full(name, displayed, slope, speed, seed) -> None:
    """1,000 m down: what is recovered is in the battery, or was refused and is heat of the friction brakes."""
    car = load_vehicle(name)
    window = car.battery
    rng = np.random.default_rng(seed)
    n = max(int(1000.0 / (slope * speed)), 10)
    grade = -slope * rng.uniform(0.5, 1.5, n)
    trace = {"time_s": np.arange(float(n)), "speed_m_s": speed + rng.normal(0.0, 0.5, n).cumsum().clip(-4, 4)}
    start = DriveConditions(initial_soc=window.soc_from_displayed(displayed))
    run = simulate(car, **trace, grade=grade, conditions=start)
    assert run.soc.max() <= window.displayed_full_soc + 1e-9
    assert window.displayed_from_soc(run.soc[-1]) <= 1.0 + 1e-9
    assert (run.friction_brake_power_w >= 0.0).all()
    causes = sum(run.by_cause_wh.values())
    assert causes == pytest.approx(run.simulated_energy_wh, abs=1e-6)
    # charge and energy tell one story: what left the terminals and the cells left the charge
    charge = np.diff(run.soc, prepend=start.initial_soc) * window.capacity_ah * 3600.0
    step = np.diff(run.time_s, prepend=run.time_s[0])
    assert -charge == pytest.approx(run.battery_current_a * step, abs=1e-6)
    empty = simulate(car, **trace, grade=grade, conditions=DriveConditions(initial_soc=0.3))
    lost = run.simulated_energy_wh - empty.simulated_energy_wh
    assert lost > -1.0
    assert run.by_cause_wh["friction_brakes"] >= empty.by_cause_wh["friction_brakes"] - 1.0
    flagged = {flag.code: flag.value for flag in run.flags}
    assert flagged.get("battery_full", 0.0) == pytest.approx(max(lost, 0.0), abs=60.0)


@EXAMPLES
@given(trace=traces())
def test_state_of_charge_falls_when_the_battery_gives(trace) -> None:
    run = simulate(load_vehicle("bmw_i3_60ah"), **trace)
    change = np.diff(run.soc)
    gives = run.battery_power_w[1:] > 0.0
    assert (change[gives & (run.soc[:-1] > 0.0)] < 0.0).all()
    assert (change[~gives] >= 0.0).all()


def test_impossible_trace_carries_flags_and_finite_numbers(i3: Vehicle) -> None:
    speed = np.array([0.0, 12.0, 50.0, 50.0, 0.0, 89.0])
    run = simulate(
        i3, np.arange(6.0), speed, grade=np.full(6, 0.6), conditions=DriveConditions(initial_soc=0.02)
    )
    text = " ".join(flag.code for flag in run.flags)
    for name in ("motor_torque_limit", "motor_power_limit", "motor_speed_limit", "battery_empty"):
        assert name in text
    assert np.isfinite(run.energy_wh).all()
    assert run.by_cause_wh["shortfall"] < 0.0
    assert not simulate(i3, np.arange(5.0), [0.0, 1.0, 2.0, 2.0, 1.0]).flags


def test_very_long_drive_empties_the_battery_without_an_error(i3: Vehicle) -> None:
    time = np.arange(0.0, 40_000.0, 2.0)
    run = simulate(i3, time, np.full(len(time), 33.0))
    assert any(flag.code == "battery_empty" for flag in run.flags)
    assert run.soc.min() >= 0.0
    assert np.isfinite(run.to_frame().drop(columns=["cabin_temperature_degc"]).to_numpy()).all()


@EXAMPLES
@given(trace=traces(hilly=False), pieces=st.integers(2, 10))
def test_finer_samples_of_the_same_drive_give_the_same_energy(trace, pieces) -> None:
    car = load_vehicle("bmw_i3_60ah", "paper", {"road_load.coastdown_b_n_s_m": 0.0})
    time, speed = trace["time_s"], trace["speed_m_s"]
    fine_time = np.interp(np.arange((len(time) - 1) * pieces + 1) / pieces, np.arange(len(time)), time)
    fine_speed = np.interp(fine_time, time, speed)
    coarse = simulate(car, time, speed).by_cause_wh
    fine = simulate(car, fine_time, fine_speed).by_cause_wh
    for cause in ("acceleration", "base_load", "rolling"):
        assert fine[cause] == pytest.approx(coarse[cause], rel=1e-9, abs=1e-9)


def test_inputs_are_left_alone(i3: Vehicle) -> None:
    time, speed, elevation = np.arange(60.0), np.linspace(0.0, 20.0, 60), np.linspace(0.0, 10.0, 60)
    before = [a.copy() for a in (time, speed, elevation)]
    simulate(i3, time, speed, elevation_m=elevation)
    for a, b in zip((time, speed, elevation), before, strict=True):
        assert (a == b).all()


def departure_trip(rng: np.random.Generator) -> Trip:
    n = 600
    log = {
        "time_s": np.arange(n) * 1.0,
        "speed_m_s": np.clip(10.0 + np.cumsum(rng.normal(0.0, 0.5, n)), 0.0, 30.0),
        "elevation_m": 500.0 + np.round(np.cumsum(rng.normal(0.0, 0.2, n))),
        "ambient_temperature_degc": np.full(n, 4.0),
        "cabin_temperature_degc": np.full(n, 12.0),
        "cabin_setpoint_degc": np.full(n, 21.0),
        "battery_temperature_degc": np.full(n, 9.0),
        "voltage_v": np.full(n, 370.0),
        "current_a": np.full(n, 20.0),
        "soc": np.linspace(0.7, 0.68, n),
        "displayed_soc": np.linspace(0.75, 0.73, n),
        "motor_torque_nm": np.zeros(n),
        "heating_power_w": np.full(n, 2000.0),
        "requested_heating_power_w": np.full(n, 2000.0),
        "aircon_power_w": np.zeros(n),
    }
    return Trip.from_samples("t", pd.DataFrame(log), Context(payload_mass_kg=80.0, weather="dark"))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_nothing_measured_after_departure_enters(seed) -> None:
    rng = np.random.default_rng(seed)
    trip = departure_trip(np.random.default_rng(1))
    scrambled = trip.samples.copy()
    for name in scrambled.columns.difference(["time_s", "speed_m_s", "elevation_m"]):
        values = scrambled[name].to_numpy().copy()
        values[1:] = rng.uniform(0.0, 1.0, len(values) - 1) * values[1:]
        values[rng.random(len(values)) < 0.1] = np.nan
        values[0] = trip.samples[name].iloc[0]
        scrambled[name] = values
    car = load_vehicle("bmw_i3_60ah")
    one = simulate_trip(car, trip).to_frame()
    other = simulate_trip(car, Trip("t", scrambled, trip.context)).to_frame()
    pd.testing.assert_frame_equal(one, other, check_exact=True)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("ambient_temperature_degc", -10.0),
        ("cabin_temperature_degc", 25.0),
        ("cabin_setpoint_degc", 26.0),
        ("battery_temperature_degc", -15.0),
        ("soc", 0.92),
    ],
)
def test_what_is_known_at_departure_does_enter(i3: Vehicle, column: str, value: float) -> None:
    trip = departure_trip(np.random.default_rng(1))
    changed = trip.samples.copy()
    changed.loc[0, column] = value
    one, other = (simulate_trip(i3, Trip("t", samples, trip.context)) for samples in (trip.samples, changed))
    assert one.terminal_voltage_v.mean() != other.terminal_voltage_v.mean()


@st.composite
def height_logs(draw: st.DrawFn) -> dict[str, np.ndarray]:
    """Logs of a height with everything that sensors do to it: steps, jumps, spikes, gaps, drift at standstill, noise."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    time = draw(st.sampled_from([0.1, 1.0, 5.0, 30.0])) * np.arange(draw(st.integers(2, 400)))
    n = len(time)
    speed = np.abs(rng.normal(draw(st.sampled_from([3.0, 12.0, 35.0])), 4.0, n))
    if draw(st.booleans()):
        stop = rng.integers(0, n)
        speed[stop : stop + rng.integers(1, n + 1)] = 0.0
    height = 400.0 + draw(st.sampled_from([0.0, 10.0, 200.0])) * np.sin(time / 200.0)
    for _ in range(draw(st.integers(0, 4))):
        height[rng.integers(0, n) :] += rng.uniform(-60.0, 60.0)
    if draw(st.booleans()):
        height[rng.integers(0, n)] += rng.choice([-44.0, 44.0])
    height += np.cumsum(draw(st.sampled_from([0.0, 0.3])) * rng.normal(size=n)) * (speed == 0.0)
    height += draw(st.sampled_from([0.0, 1.0])) * rng.normal(size=n)
    resolution = draw(st.sampled_from([0.01, 1.0, 30.0]))
    height = resolution * np.round(height / resolution)
    height[rng.random(n) < draw(st.sampled_from([0.0, 0.3, 0.95]))] = np.nan
    return {"time_s": time, "speed_m_s": speed, "elevation_m": height}


@settings(max_examples=80, deadline=None)
@given(height_logs())
def test_a_log_climbs_from_its_first_to_its_last_height(log) -> None:
    """Mass times gravity times the difference, but at most what the steepest street climbs on a road of this length.

    What no road can have is left out before: it does not count as first or last.
    """
    car = load_vehicle("bmw_i3_60ah")
    run = simulate(car, **log)
    way = distance_driven(log["time_s"], log["speed_m_s"])
    known = heights_of_a_road(log["time_s"], way, log["elevation_m"])
    known = known[np.isfinite(known)]
    most = STEEPEST_GRADE * np.trapezoid(log["speed_m_s"], log["time_s"])
    rise = np.clip(known[-1] - known[0], -most, most) if len(known) else 0.0
    expected = car.body.test_mass_kg * GRAVITY_M_S2 * rise * WH_PER_J
    assert run.by_cause_wh["climb"] == pytest.approx(expected, rel=1e-6, abs=1e-4)
    assert np.abs(np.sin(np.arctan(run.grade))).max() <= STEEPEST_GRADE * (1.0 + 1e-9)


@EXAMPLES
@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 5.0]))
def test_noise_of_a_height_climbs_little(seed, step_s) -> None:
    """Steps of 1 m and errors of 1 m on a level road: less than 2 m up for each km."""
    rng = np.random.default_rng(seed)
    time = step_s * np.arange(600.0)
    speed = np.full(600, 15.0)
    run = simulate(
        load_vehicle("bmw_i3_60ah"), time, speed, elevation_m=np.round(400.0 + rng.normal(0.0, 1.0, 600))
    )
    up = 15.0 * step_s * np.sin(np.arctan(run.grade[1:]))
    assert np.maximum(up, 0.0).sum() < 2.0 * 15.0 * time[-1] / 1000.0


def test_heights_in_steps_climb_as_the_road_does() -> None:
    """300 m on 10 km, logged in steps of 10 and 60 m."""
    car = load_vehicle("bmw_i3_60ah")
    time, speed = np.arange(667.0), np.full(667, 15.0)
    road = 300.0 * time / time[-1]
    smooth = simulate(car, time, speed, elevation_m=road)
    for size in (10.0, 60.0):
        stepped = simulate(car, time, speed, elevation_m=size * np.round(road / size))
        assert stepped.by_cause_wh["climb"] == pytest.approx(smooth.by_cause_wh["climb"], rel=1e-9)
        assert stepped.simulated_energy_wh == pytest.approx(smooth.simulated_energy_wh, rel=0.03)


def test_a_steeper_street_costs_at_least_its_height() -> None:
    """1.9 km up at 20, 30 and 37 %, as heights and as grades."""
    car = load_vehicle("bmw_i3_60ah")
    time = np.arange(0.0, 381.0)
    speed = np.full(381, 5.0)
    energy = []
    for grade in (0.0, 0.2, 0.3, 0.37):
        run = simulate(car, time, speed, elevation_m=grade * 5.0 * time)
        same = simulate(car, time, speed, grade=np.full(381, np.tan(np.arcsin(grade))))
        # thinner air at the mean height is the difference
        assert run.simulated_energy_wh == pytest.approx(same.simulated_energy_wh, rel=2e-3)
        energy.append(run.simulated_energy_wh)
    potential = car.body.test_mass_kg * GRAVITY_M_S2 * 1900.0 * np.array([0.0, 0.2, 0.3, 0.37]) * WH_PER_J
    assert (np.diff(energy) >= np.diff(potential)).all()
    assert (np.diff(energy) <= 1.6 * np.diff(potential)).all()


def test_trips_of_a_twizy_keep_their_climb(data_dir) -> None:
    """Heights in steps and jumps of up to 44 m: every trip ends where its log ends, also the five that rise by 45 m or more."""
    folder = data_dir / "twizy"
    if not folder.is_dir():
        pytest.skip(f"no trips at {folder}")
    car = load_vehicle("bmw_i3_60ah")
    rises = []
    for path in sorted(folder.glob("*.csv")):
        log = pd.read_csv(path)  # one row a second
        height, speed = log["ALT"].to_numpy(), log["Speed"].to_numpy() / 3.6
        run = simulate(car, np.arange(float(len(log))), speed, elevation_m=height)
        unit = car.body.test_mass_kg * GRAVITY_M_S2 * WH_PER_J
        assert run.by_cause_wh["climb"] / unit == pytest.approx(height[-1] - height[0], abs=0.01)
        rises.append(height[-1] - height[0])
    assert sum(45.0 <= rise <= 76.5 for rise in rises) >= 5


def city(seconds: int = 600) -> Plan:
    """A drive of some minutes in a city and out of it."""
    time = np.arange(seconds + 1.0)
    speed = np.clip(10.0 + 8.0 * np.sin(time / 60.0) + 6.0 * np.sin(time / 23.0), 0.0, 30.0)
    return Plan.from_samples(pd.DataFrame({"time_s": time, "speed_m_s": speed}))


def energy_wh(car: Vehicle, plan: Plan, departure: Departure) -> float:
    return simulate_trip(car, dataclasses.replace(plan, departure=departure)).simulated_energy_wh


CITY = city()


CARS = ("bmw_i3_60ah", "nissan_leaf_40", "vw_id3", "tesla_model_3_lr")
"""With resistive heating and with a heat pump, with a sensor's lower end and without."""


@EXAMPLES
@given(
    st.sampled_from(CARS),
    st.floats(-20.0, 14.0),
    st.floats(18.0, 26.0),
    st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2),
)
def test_a_warmer_cabin_never_takes_more_in_the_cold(name, ambient, setpoint, shares) -> None:
    car = load_vehicle(name)
    low, high = (ambient - 5.0 + share * (setpoint + 5.0 - ambient) for share in sorted(shares))
    colder, warmer = (
        energy_wh(
            car,
            CITY,
            Departure(
                soc=0.7,
                ambient_temperature_degc=ambient,
                cabin_setpoint_degc=setpoint,
                cabin_temperature_degc=cabin,
            ),
        )
        for cabin in (low, high)
    )
    assert warmer <= colder + 0.5  # watt-hours; the control works in steps of 10 s


def largest_jump(energy: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Change of the energy that is left where it is steepest when the step shrinks to nothing [Wh], and where."""
    at = np.linspace(low, high, 61)
    found = [energy(float(x)) for x in at]
    changes = np.abs(np.diff(found))
    i = int(np.argmax(np.abs(changes - np.median(changes))))
    left, right, before, after = float(at[i]), float(at[i + 1]), found[i], found[i + 1]
    for _ in range(14):
        middle = 0.5 * (left + right)
        value = energy(middle)
        if abs(value - before) > abs(after - value):
            right, after = middle, value
        else:
            left, before = middle, value
    return abs(after - before), left


SCANNED = {
    "ambient_temperature_degc": (-30.0, 50.0),
    "cabin_setpoint_degc": (14.0, 30.0),
    "cabin_temperature_degc": (-20.0, 60.0),
    "battery_temperature_degc": (-30.0, 50.0),
    "payload_mass_kg": (0.0, 500.0),
    "soc": (0.05, 1.0),
}


@pytest.mark.parametrize("name", CARS)
@pytest.mark.parametrize("ambient", [-5.0, 9.0, 24.0])
def test_no_field_of_a_departure_makes_the_energy_jump(name: str, ambient: float) -> None:
    car, known = load_vehicle(name), {"soc": 0.6, "ambient_temperature_degc": ambient}
    for field, bounds in SCANNED.items():
        for cabin in ({}, {"cabin_temperature_degc": 19.0}):
            jump, at = largest_jump(
                lambda x, field=field, cabin=cabin: energy_wh(
                    car, CITY, Departure(**{**known, **cabin, field: x})
                ),
                *bounds,
            )
            assert jump < 0.5, f"{field} at {at:.3f}: {jump:.1f} Wh"


def test_a_sensor_at_its_end_hides_the_cabin_of_a_log_alone() -> None:
    """The i3's sensor shows 10 °C in any colder cabin; 10 °C that a person gives are 10 °C."""
    car = load_vehicle("bmw_i3_60ah")
    planned = Departure(soc=0.7, ambient_temperature_degc=-5.0, cabin_temperature_degc=10.0)
    cold = dataclasses.replace(planned, cabin_temperature_degc=-5.0)
    logged = dataclasses.replace(planned, cabin_logged=True)
    assert energy_wh(car, CITY, logged) == energy_wh(car, CITY, cold)
    assert energy_wh(car, CITY, planned) < energy_wh(car, CITY, cold) - 50.0
    samples = pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 1.0], "cabin_temperature_degc": 10.0})
    assert Trip.from_samples("log", samples).departure.cabin_logged
    given = Plan.from_samples(samples, departure=Departure(cabin_temperature_degc=10.0)).departure
    assert given.cabin_logged is None


def identified_like(car: Vehicle) -> Vehicle:
    """A car whose trips show a rise in the cold of twice the published one."""
    assert car.tyres is not None
    return dataclasses.replace(car, tyres=dataclasses.replace(car.tyres, temperature_coefficient_per_k=0.02))


@pytest.mark.parametrize("name", CARS)
def test_heat_does_not_make_a_car_thrifty(name: str) -> None:
    """With the air conditioner on, 40 °C take no less than 25 °C up to 90 km/h, and about as much at 130 in air of one density."""
    car = identified_like(load_vehicle(name))
    time = np.arange(1801.0)
    for speed, max_gain in ((8.0, 0.0), (14.0, 0.0), (20.0, 0.0), (25.0, 0.0), (36.0, 0.02)):
        density = 1.15 if max_gain else None
        mild, hot = (
            simulate(
                car,
                time,
                np.full_like(time, speed),
                conditions=DriveConditions(
                    ambient_temperature_degc=ambient, initial_warmth=1.0, air_density_kg_m3=density
                ),
            ).simulated_energy_wh
            for ambient in (25.0, 40.0)
        )
        assert hot >= (1.0 - max_gain) * mild, speed


@EXAMPLES
@given(
    st.sampled_from(CARS),
    st.floats(0.0, 0.03),
    st.floats(-40.0, 57.0),
    st.floats(-40.0, 57.0),
    st.floats(0.0, 1.0),
)
def test_rolling_falls_with_the_air_and_stays_in_bounds(name, slope, one, other, warmth) -> None:
    tyres = load_vehicle(name).tyres
    assert tyres is not None
    tyres = dataclasses.replace(tyres, temperature_coefficient_per_k=slope)
    cold, hot = sorted((one, other))
    speed, step = np.full(50, 20.0), np.full(50, 10.0)
    factors = [rolling_factor(speed, step, degc, tyres, warmth) for degc in (cold, hot)]
    assert (factors[0] >= factors[1]).all()
    for factor in factors:
        assert (factor >= 0.5).all()
        assert (factor <= (1.0 + 60.0 * 0.03) * (1.0 + tyres.cold_excess)).all()
    assert tyres.weather_factor(tyres.reference_temperature_degc) == 1.0
    # a slope that is steeper than the published one acts in the cold alone
    assert tyres.weather_factor(40.0) >= 1.0 - 0.0086 * 20.0 - 1e-12
