"""Values of a car are found in the signals of its stages, and stay published where the signals are silent."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.worlds import changed

from tripwatt.hybrid import (
    Identified,
    StageRecord,
    identify,
    identify_each,
    power_corrector,
    resimulated,
    segment_trips,
    stage_record,
)
from tripwatt.hybrid.identification import (
    COLD_DEGC,
    DRAG_WIDTH,
    MIN_TRIPS,
    ROLLING_WIDTH,
)
from tripwatt.physics import simulate_trip
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Plan, Trip
from tripwatt.vehicles import load_vehicle

BOOK = load_vehicle("bmw_i3_60ah")
ONE_PEDAL = replace(
    BOOK,
    regeneration=replace(BOOK.regeneration, fraction=1.0),
    road_load=replace(BOOK.road_load, coastdown_a_n=185.0, coastdown_b_n_s_m=2.36, coastdown_c_n_s2_m2=0.35),
)
"""Another road load, and a driver who leaves the brake pedal alone: what friction brakes take is in no signal."""
WITHOUT_LINEAR = replace(BOOK, road_load=replace(BOOK.road_load, coastdown_b_n_s_m=0.0))
FLEET = synthetic_fleet(24, seed=5).trips


def identify_trips(trips, vehicle) -> Identified:
    """The values of a car by the signals of its trips."""
    return identify([stage_record(trip, vehicle) for trip in trips], vehicle)


def as_logged(trip: Trip, truth) -> Trip:
    """The log of a drive with another car: torque at the shaft, heater and compressor, voltage, current and charge."""
    run = simulate_trip(truth, trip)
    speed, drivetrain = trip.array("speed_m_s"), truth.drivetrain
    mean = np.concatenate((speed[:1], 0.5 * (speed[1:] + speed[:-1])))
    braked = np.maximum(-run.wheel_power_w, 0.0) - run.friction_brake_power_w
    eta = drivetrain.gearbox_efficiency
    shaft = np.maximum(run.wheel_power_w, 0.0) / eta - braked * eta
    turning = mean * drivetrain.gear_ratio / drivetrain.wheel_radius_m
    torque = np.where(turning > 0.0, shaft / np.maximum(turning, 1e-9), 0.0)
    samples = trip.samples.assign(
        motor_torque_nm=_at_samples(torque),
        heating_power_w=run.climate_power_w - run.fan_power_w,
        aircon_power_w=0.0,
        voltage_v=run.terminal_voltage_v,
        current_a=run.battery_current_a,
        soc=run.soc,
    )
    return replace(trip, samples=samples)


def _at_samples(means: np.ndarray) -> np.ndarray:
    """Values at samples whose means over intervals are about these."""
    return np.concatenate((0.5 * (means[:-1] + means[1:]), means[-1:]))


def force_n(car, speed_m_s: float) -> float:
    constant, linear = car.road_load.rolling_coefficients
    rolling = car.body.test_mass_kg * 9.80665 * (constant + linear * speed_m_s)
    return float(rolling + 0.6 * car.road_load.drag_area_m2 * speed_m_s**2)


def test_road_load_is_found_from_torque():
    found = identify_trips([as_logged(trip, ONE_PEDAL) for trip in FLEET], BOOK).applied(BOOK)
    for speed in (8.0, 12.0, 24.0):
        assert force_n(found, speed) == pytest.approx(force_n(ONE_PEDAL, speed), rel=0.03)
    assert force_n(BOOK, 8.0) < 0.85 * force_n(ONE_PEDAL, 8.0)
    assert "identified on 24 trips; published 139.718" in found.entries["road_load.coastdown_a_n"].source


def test_a_car_with_coefficients_keeps_its_form():
    book = load_vehicle("peugeot_e_208")
    one_pedal = replace(book, regeneration=replace(book.regeneration, fraction=1.0))
    truth = changed(one_pedal, {"rolling": 0.3, "air": 0.15})
    found = identify_trips([as_logged(trip, truth) for trip in FLEET], book).applied(book)
    assert found.road_load.method == book.road_load.method
    assert force_n(found, 18.0) == pytest.approx(force_n(truth, 18.0), rel=0.04)


def test_the_rise_in_the_cold_needs_cold_trips():
    tyres = BOOK.tyres
    truth = replace(ONE_PEDAL, tyres=replace(tyres, temperature_coefficient_per_k=0.02))
    trips = [as_logged(trip, truth) for trip in synthetic_fleet(60, seed=5).trips]
    records = [stage_record(trip, BOOK) for trip in trips]
    warm = [r for r in records if r.ambient_temperature_degc > 8.0]
    assert len(warm) < len(records) - MIN_TRIPS
    key = "tyres.temperature_coefficient_per_k"
    assert identify(records, BOOK).values[key] == pytest.approx(0.02, abs=0.003)
    assert key not in identify(warm, BOOK).values
    cold = [r for r in records if r.ambient_temperature_degc < COLD_DEGC]
    assert len(cold) >= MIN_TRIPS
    assert BOOK.tyres.temperature_coefficient_per_k < identify(cold, BOOK).values[key] < 0.025


def test_interior_heat_capacity_is_found_from_the_heater():
    interior = 0.3 * BOOK.climate.interior_heat_capacity_j_k
    truth = replace(BOOK, climate=replace(BOOK.climate, interior_heat_capacity_j_k=interior))
    found = identify_trips([as_logged(trip, truth) for trip in FLEET], BOOK)
    assert found.values["climate.interior_heat_capacity_j_k"] == pytest.approx(interior, rel=0.2)


def test_the_fade_of_recovery_is_found_from_torque():
    rules = replace(ONE_PEDAL.regeneration, zero_speed_m_s=0.0, full_speed_m_s=1.0)
    truth = replace(ONE_PEDAL, regeneration=rules)
    found = (
        identify_trips([as_logged(trip, truth) for trip in FLEET], ONE_PEDAL).applied(ONE_PEDAL).regeneration
    )
    assert found.full_speed_m_s < 2.0 < BOOK.regeneration.full_speed_m_s
    assert found.zero_speed_m_s < 0.3 < BOOK.regeneration.zero_speed_m_s
    same = identify_trips([as_logged(trip, ONE_PEDAL) for trip in FLEET], ONE_PEDAL).applied(ONE_PEDAL)
    assert same.regeneration.full_speed_m_s == pytest.approx(2.5, abs=0.6)


def from_braking(rows: list[np.ndarray]) -> Identified:
    """Values from braking power alone."""
    nothing = np.empty((0, 4)), np.empty((0, 2))
    return identify(
        [StageRecord(10.0, nothing[0], braking, np.nan, None, nothing[1]) for braking in rows], BOOK
    )


def test_the_published_fade_counts_as_five_trips():
    """At 1 m/s and a full share from 2 m/s on, published 0.5 to 2.5 m/s; 10 J in every bin of a trip."""
    speed = (np.arange(20) + 0.5) * 0.25
    own, book = np.clip(speed - 1.0, 0.0, 1.0), np.clip((speed - 0.5) / 2.0, 0.0, 1.0)
    trips = [np.column_stack((np.full(20, 10.0), 10.0 * own))] * 5
    identified = from_braking(trips)
    found = identified.values
    fade = np.clip(
        (speed - found["regeneration.zero_speed_m_s"])
        / (found["regeneration.full_speed_m_s"] - found["regeneration.zero_speed_m_s"]),
        0.0,
        1.0,
    )
    assert set(identified.trips.values()) == {5}
    assert np.abs(fade - 0.5 * (own + book)).max() < 0.06
    many = from_braking(trips * 200).values
    assert dict(many) == pytest.approx(
        {"regeneration.zero_speed_m_s": 1.0, "regeneration.full_speed_m_s": 2.0}, abs=0.05
    )
    assert from_braking(trips[:2]).values == {}


def test_speeds_without_braking_keep_the_published_fade():
    speed = (np.arange(20) + 0.5) * 0.25
    possible = np.where(speed > 2.0, 10.0, 0.0)
    found = from_braking([np.column_stack((possible, possible))] * 500).values
    zero, full = found["regeneration.zero_speed_m_s"], found["regeneration.full_speed_m_s"]
    assert np.clip((1.0 - zero) / (full - zero), 0.0, 1.0) == pytest.approx(0.25, abs=0.1)
    assert full < 2.3


@pytest.mark.parametrize("share", [0.3, 1.3])
def test_a_torque_of_another_car_leaves_the_fade(share):
    trips = [np.column_stack((np.full(20, 10.0), np.full(20, 10.0 * share)))] * 5
    assert from_braking(trips).values == {}


def test_braking_power_is_summed_by_low_speed():
    """4 m/s to a standstill at 1 m/s2: half of the way above 2 m/s, three quarters of the work."""
    time = np.arange(60.0)
    speed = np.clip(44.0 - time, 0.0, 4.0)
    samples = FLEET[0].samples.iloc[[0] * 60].reset_index(drop=True)
    samples = samples.assign(time_s=time, speed_m_s=speed, elevation_m=500.0, motor_torque_nm=0.0)
    rows = stage_record(replace(FLEET[0], samples=samples), ONE_PEDAL).braking
    eta, mass = BOOK.drivetrain.gearbox_efficiency, BOOK.body.test_mass_kg
    inertia = 0.5 * mass * BOOK.body.rotating_mass_factor * 4.0**2
    drag = 8.0 * force_n(ONE_PEDAL, 2.0)
    assert rows[:, 0].sum() == pytest.approx(eta * (inertia - drag), rel=0.05)
    assert np.flatnonzero(rows[:, 0]).tolist() == [
        2,
        6,
        10,
        14,
    ]  # means over seconds: 0.5, 1.5, 2.5 and 3.5 m/s
    assert (rows[:, 1] == 0.0).all()
    uphill = samples.assign(elevation_m=500.0 + np.cumsum(speed) * 0.15)
    assert not stage_record(replace(FLEET[0], samples=uphill), ONE_PEDAL).braking.any()  # the hill brakes


def cooled(trip: Trip, truth) -> Trip:
    """A log whose climate control is the compressor's alone."""
    logged = as_logged(trip, truth)
    power = logged.samples["heating_power_w"]
    return replace(logged, samples=logged.samples.assign(aircon_power_w=power, heating_power_w=0.0))


def test_what_the_compressor_takes_is_found_in_warm_air():
    air = dict.fromkeys(("ambient_temperature_degc", "cabin_temperature_degc"), 26.0)
    hot = [replace(trip, samples=trip.samples.assign(**air)) for trip in FLEET]
    assert {trip.departure.ambient_temperature_degc for trip in hot} == {26.0}
    truth = replace(BOOK, climate=replace(BOOK.climate, cooler_cop=1.4))
    values = identify_trips([cooled(trip, truth) for trip in hot], BOOK).values
    assert BOOK.climate.cooler_cop == 2.2
    assert values["climate.cooler_cop"] == pytest.approx(1.4, abs=0.2)
    running = [
        np.quantile(p[p > 50.0], 0.25) for p in (cooled(t, truth).array("aircon_power_w") for t in hot)
    ]
    own, book = len(running) / np.var(running, ddof=1), 1.0 / 300.0**2
    least = own * np.median(running) / (own + book)
    assert values["climate.compressor_idle_w"] == pytest.approx(least, rel=1e-6)
    logs = [cooled(trip, truth) for trip in hot]
    pumped = [t.samples.assign(aircon_power_w=2000.0, ambient_temperature_degc=0.0) for t in logs]
    both = identify_trips([*logs, *(replace(t, samples=s) for t, s in zip(logs, pumped, strict=True))], BOOK)
    assert both.values["climate.compressor_idle_w"] == pytest.approx(least, rel=1e-6)  # in the cold it heats
    tenfold = [
        replace(t, samples=t.samples.assign(aircon_power_w=10.0 * t.array("aircon_power_w"))) for t in logs
    ]
    wrong = identify_trips(tenfold, BOOK).values
    assert wrong["climate.cooler_cop"] == BOOK.climate.cooler_cop
    assert wrong["climate.compressor_idle_w"] == BOOK.climate.compressor_idle_w
    entry = identify_trips([cooled(trip, truth) for trip in hot], BOOK).applied(BOOK).entries
    assert entry["climate.compressor_idle_w"].unit == "W"
    assert entry["climate.compressor_idle_w"].source == "identified on 24 trips; published 0: no source"
    cold = identify_trips([as_logged(trip, BOOK) for trip in FLEET], BOOK).values
    assert "climate.cooler_cop" not in cold


def test_choices_of_trips_that_are_looked_at_together_show_what_each_shows_alone():
    records = [stage_record(as_logged(trip, ONE_PEDAL), BOOK) for trip in FLEET[:10]]
    choices = [records, records[:2], records[2:], [], records[::2]]
    together = identify_each(choices, BOOK)
    assert [dict(each.values) for each in together] == [dict(identify(own, BOOK).values) for own in choices]
    assert [len(each.values) > 0 for each in together] == [True, False, True, False, True]
    assert "climate.interior_heat_capacity_j_k" in together[0].values


def test_base_load_is_that_of_the_standing_car_with_climate_off():
    trips = []
    for number, trip in enumerate(FLEET):
        time = np.arange(200.0)
        samples = trip.samples.iloc[[0] * 200].reset_index(drop=True)
        power = np.where(time < 100.0, 430.0 + number % 3, 3000.0)
        samples = samples.assign(
            time_s=time,
            speed_m_s=np.where(time < 100.0, 0.0, 10.0),
            voltage_v=400.0,
            current_a=power / 400.0,
            heating_power_w=0.0,
            aircon_power_w=0.0,
        )
        trips.append(replace(trip, samples=samples))
    records = [stage_record(trip, BOOK) for trip in trips]
    assert records[1].standing_w == pytest.approx(431.0)
    # 24 trips with the least scatter of 30 W beside a prior of 300 +- 120 W
    own, book = 24 / 30.0**2, 1 / 120.0**2
    value = (own * 431.0 + book * 300.0) / (own + book)
    assert identify(records, BOOK).values["auxiliaries.base_load_w"] == pytest.approx(value)


def test_open_circuit_voltage_is_found_at_rest():
    shift = 0.1
    curve = tuple(v + shift for v in BOOK.battery.ocv_v)
    truth = replace(BOOK, battery=replace(BOOK.battery, ocv_v=curve))
    trips = []
    for number, trip in enumerate(FLEET):
        soc = 0.5 + 0.015 * number
        voltage = 96 * float(np.interp(soc, truth.battery.ocv_soc, truth.battery.ocv_v))
        samples = trip.samples.iloc[[0] * 40].reset_index(drop=True)
        samples = samples.assign(
            time_s=np.arange(40.0), speed_m_s=0.0, voltage_v=voltage, current_a=0.0, soc=soc
        )
        trips.append(replace(trip, samples=samples))
    found = identify_trips(trips, BOOK).applied(BOOK)
    seen = np.array([0.55, 0.7, 0.8])
    assert np.interp(seen, found.battery.ocv_soc, found.battery.ocv_v) == pytest.approx(
        np.interp(seen, truth.battery.ocv_soc, truth.battery.ocv_v), abs=0.01
    )
    assert (np.diff(found.battery.ocv_v) >= 0.0).all()


def test_trips_without_signals_change_nothing():
    silent = [replace(t, samples=t.samples[["time_s", "speed_m_s", "elevation_m"]]) for t in FLEET]
    found = identify_trips(silent, BOOK)
    assert not found.values
    assert found.applied(BOOK) is BOOK
    few = identify_trips([as_logged(trip, BOOK) for trip in FLEET[: MIN_TRIPS - 1]], BOOK)
    assert not few.values


def test_trips_simulated_again_are_those_of_the_other_car():
    other = changed(BOOK, {"rolling": 0.3})
    plans = [Plan.from_trip(trip) for trip in FLEET]
    (again,), fresh = resimulated(segment_trips(FLEET, BOOK), plans, [other]), segment_trips(FLEET, other)
    np.testing.assert_array_equal(again.simulated_w, fresh.simulated_w)
    np.testing.assert_array_equal(again.observed_power_w, fresh.observed_power_w)
    assert again.features.equals(fresh.features)


def test_an_energy_from_the_charge_is_spread_evenly_again():
    known = []
    for trip in FLEET[:4]:
        energy = np.linspace(0.0, trip.observed_energy_wh, len(trip))
        samples = trip.samples.drop(columns=["voltage_v", "current_a"]).assign(observed_energy_wh=energy)
        by_charge = {"observed_energy_std_wh": 50.0, "observed_energy_common_std": 1e-3}
        known.append(replace(trip, samples=samples, **by_charge))
    other = changed(BOOK, {"rolling": 0.3})
    plans = [Plan.from_trip(trip) for trip in known]
    table, fresh = segment_trips(known, BOOK), segment_trips(known, other)
    assert not table.energy_errors.along.any()
    fitted = power_corrector("linear").fit(table)  # totals alone tell nothing of the shape
    assert fitted.shape.tolist() == [0.0] * len(fitted.model.weights_)
    (again,) = resimulated(table, plans, [other])
    assert again.observed_power_w == pytest.approx(fresh.observed_power_w)


def test_dead_and_misnamed_signals_leave_the_published_values():
    logged = [as_logged(trip, BOOK) for trip in FLEET]
    dead = [replace(t, samples=t.samples.assign(motor_torque_nm=0.0)) for t in logged]
    double = [replace(t, samples=t.samples.assign(voltage_v=2.0 * t.array("voltage_v"))) for t in logged]
    for trips, section in ((dead, "road_load"), (double, "battery")):
        keys = identify_trips(trips, BOOK).values
        assert not any(key.startswith((section, "regeneration")) for key in keys if trips is dead)
        assert not any(key.startswith(section) for key in keys)
    assert any(key.startswith("road_load") for key in identify_trips(logged, ONE_PEDAL).values)


def still(trip: Trip, seconds: int = 40, **signals) -> Trip:
    """A car that does not move, with signals of a value or of one a second."""
    samples = trip.samples.iloc[[0] * seconds].reset_index(drop=True)
    return replace(trip, samples=samples.assign(time_s=np.arange(float(seconds)), speed_m_s=0.0, **signals))


def test_a_stretch_says_of_the_cold_what_it_says_of_the_road_times_kelvins():
    trip = as_logged(FLEET[0], ONE_PEDAL)
    record = stage_record(trip, WITHOUT_LINEAR)
    colder = BOOK.tyres.reference_temperature_degc - record.ambient_temperature_degc
    assert record.road[:, 1] == pytest.approx(colder * record.road[:, 0])
    assert colder != 0.0


def test_hard_braking_takes_a_stretch_out():
    trip = as_logged(FLEET[0], ONE_PEDAL)
    rows = stage_record(trip, BOOK).road
    torque, speed = trip.array("motor_torque_nm").copy(), trip.array("speed_m_s")
    fast = int(np.argmax(speed))
    torque[fast] = torque[fast + 1] = -200.0
    braked = replace(trip, samples=trip.samples.assign(motor_torque_nm=torque))
    assert len(stage_record(braked, BOOK).road) == len(rows) - 1


def road_of(work_n: float, error_n: np.ndarray, ambient_degc: float) -> StageRecord:
    """Stretches of 400 m at 10 and 25 m/s with a force, an error of each, and kelvins below 20 °C."""
    speed = np.tile([10.0, 25.0], len(error_n) // 2)
    colder = max(20.0 - ambient_degc, 0.0)
    work = work_n * (1.0 + 0.1 * colder) + 0.6 * 0.6 * speed**2 + error_n
    columns = (np.ones_like(speed), np.full_like(speed, colder), 0.6 * speed**2, work)
    nothing = np.empty((0, 2))
    return StageRecord(ambient_degc, np.column_stack(columns) * 20.0, nothing, np.nan, None, nothing)


def test_errors_that_stretches_of_a_trip_have_in_common_count_less():
    """The same errors of +- 2 kN, of mean 0: one of each trip, or both signs at each speed of every trip."""
    size = 2000.0
    common = [road_of(150.0, np.full(40, sign * size), 20.0) for sign in (1.0, -1.0) * 6]
    apart = [road_of(150.0, size * np.tile([1.0, 1.0, -1.0, -1.0], 10), 20.0) for _ in range(12)]
    sure, unsure = (identify(records, BOOK).applied(BOOK) for records in (apart, common))
    truth = replace(
        BOOK,
        road_load=replace(
            BOOK.road_load,
            coastdown_a_n=150.0 * 1443.33 / BOOK.body.test_mass_kg,
            coastdown_b_n_s_m=0.0,
            coastdown_c_n_s2_m2=0.5 * 1.167 * 0.6,
        ),
    )
    true = force_n(truth, 10.0)
    assert abs(force_n(sure, 10.0) - true) < abs(force_n(unsure, 10.0) - true)


def test_the_rise_in_the_cold_is_bounded():
    records = [road_of(150.0, np.zeros(4000), degc) for degc in (0.0, 1.0, 2.0, 20.0, 21.0, 22.0)]
    assert identify(records, BOOK).values["tyres.temperature_coefficient_per_k"] == 0.03


def test_a_standing_car_counts_with_climate_control_off_alone():
    time = np.arange(60.0)
    heated = still(
        FLEET[0],
        60,
        voltage_v=400.0,
        current_a=np.where(time < 40.0, 5.0, 1.0),
        heating_power_w=np.where(time < 40.0, 1600.0, 0.0),
        aircon_power_w=0.0,
    )
    assert stage_record(heated, BOOK).standing_w == pytest.approx(400.0)


def test_a_standing_car_that_gains_charge_shows_no_base_load():
    off = {"voltage_v": 400.0, "heating_power_w": 0.0, "aircon_power_w": 0.0}
    records = [stage_record(still(trip, current_a=-0.05, **off), BOOK) for trip in FLEET]
    assert records[0].standing_w == pytest.approx(-20.0)
    assert "auxiliaries.base_load_w" not in identify(records, BOOK).values


def test_a_small_current_drops_the_voltage_and_a_large_one_is_no_rest():
    battery = BOOK.battery
    resistance = 96 * float(np.interp(0.6, battery.resistance_soc, battery.resistance_ohm))
    open_v = 96 * float(np.interp(0.6, battery.ocv_soc, battery.ocv_v))
    rest = stage_record(
        still(FLEET[0], voltage_v=open_v - 2.0 * resistance, current_a=2.0, soc=0.6), BOOK
    ).rest
    assert rest == pytest.approx(np.array([[0.6, 0.0]]), abs=1e-9)
    assert not len(stage_record(still(FLEET[0], voltage_v=open_v, current_a=20.0, soc=0.6), BOOK).rest)


def test_the_open_circuit_voltage_never_falls_with_the_charge():
    flat = tuple(3.3 + 0.001 * i for i in range(len(BOOK.battery.ocv_soc)))
    car = replace(BOOK, battery=replace(BOOK.battery, ocv_v=flat))
    trips = [
        still(trip, voltage_v=96 * (3.35 - 0.1 * soc), current_a=0.0, soc=soc)
        for trip, soc in zip(FLEET, np.linspace(0.2, 0.9, len(FLEET)), strict=True)
    ]
    curve = identify_trips(trips, car).values["battery.ocv_v"]
    assert (np.diff(curve) >= 0.0).all()


def at_speed(speed_m_s: float, force_n: float, trips: int = 12) -> list[StageRecord]:
    """Trips at one speed in air of 20 °C: the force is known, its split into rolling and drag is not."""
    error = np.tile([20.0, -20.0], 20)
    columns = (np.ones(40), np.zeros(40), np.full(40, 0.6 * speed_m_s**2), force_n + error)
    nothing = np.empty((0, 2))
    return [
        StageRecord(20.0, np.column_stack(columns) * 20.0, nothing, np.nan, None, nothing)
        for _ in range(trips)
    ]


@pytest.mark.parametrize("share", [0.85, 1.0, 1.15])
@pytest.mark.parametrize("speed", [8.0, 15.0, 30.0])
def test_one_speed_shows_a_force_and_leaves_each_value_plausible(speed, share):
    """The force of the trips is met; each value stays within two of its own widths, the less sure one moves more."""
    rolling_n, area_m2 = (
        BOOK.body.test_mass_kg * 9.80665 * BOOK.road_load.rolling_coefficients[0],
        BOOK.road_load.drag_area_m2,
    )
    force = share * (rolling_n + 0.6 * area_m2 * speed**2)
    found = identify(at_speed(speed, force), BOOK).applied(BOOK)
    rolling = found.road_load.rolling_coefficients[0] * BOOK.body.test_mass_kg * 9.80665
    area = found.road_load.drag_area_m2
    assert rolling + 0.6 * area * speed**2 == pytest.approx(force, rel=0.02)
    assert abs(rolling / rolling_n - 1.0) < 2.0 * ROLLING_WIDTH
    assert abs(area / area_m2 - 1.0) < 2.0 * DRAG_WIDTH


def test_warm_trips_show_no_rise_in_the_cold():
    warm, cold = (
        stage_record(
            replace(
                as_logged(FLEET[0], BOOK),
                samples=as_logged(FLEET[0], BOOK).samples.assign(
                    ambient_temperature_degc=degc, cabin_temperature_degc=degc
                ),
            ),
            WITHOUT_LINEAR,
        )
        for degc in (35.0, 5.0)
    )
    assert not warm.road[:, 1].any()
    assert cold.road[:, 1] == pytest.approx(15.0 * cold.road[:, 0])
    # the published fall is in the work of 1 N of rolling resistance at 20 °C
    assert warm.road[:, 0] == pytest.approx((1.0 - 0.0086 * 15.0) * cold.road[:, 0])
