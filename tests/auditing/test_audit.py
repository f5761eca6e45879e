"""The audit of logs: what is kept, cut, split and set aside."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.refusals import refuses

from tripwatt.auditing.findings import Cut, Finding
from tripwatt.auditing.logs import audit, driven_m, finding_of_cut, without_repeats
from tripwatt.sources import read_logs
from tripwatt.trips import Context, Log, validate_samples

CAPACITY_AH = 62.0


def drive(seed=0, duration_s=900.0, step_s=0.1, mass_kg=1500.0, start_soc=0.8):
    """A made-up log with the resolution and the noise of a car's bus."""
    rng = np.random.default_rng(seed)
    time = np.round(np.arange(0.0, duration_s, step_s), 3)
    knots = np.arange(0.0, duration_s + 25.0, 12.0)
    targets = np.where(rng.random(len(knots)) < 0.15, 0.0, rng.uniform(4.0, 28.0, len(knots)))
    targets[0] = targets[-3:] = 0.0
    smooth = np.convolve(np.interp(time, knots, targets), np.ones(30) / 30, mode="same")
    speed = np.round(np.maximum(smooth - 3.0, 0.0) * 3.6, 1) / 3.6
    power = (mass_kg * np.gradient(speed, time) + 150.0 + 0.45 * speed**2) * speed
    power = np.where(power > 0, power / 0.88, 0.75 * power) + 800.0
    current = np.round(power / 380.0 + rng.normal(0.0, 0.3, len(time)), 2)
    voltage = np.round(390.0 - 0.11 * current + rng.normal(0.0, 0.1, len(time)), 2)
    used = np.concatenate(([0.0], np.cumsum(current[1:] * step_s))) / 3600.0
    heater = np.round(1500.0 + 400.0 * np.sin(time / 40.0) + rng.normal(0.0, 60.0, len(time)), 0)
    return pd.DataFrame(
        {
            "time_s": time,
            "speed_m_s": speed,
            "elevation_m": np.round(550.0 + 12.0 * np.sin(time / 90.0)),
            "ambient_temperature_degc": np.round(2.0 * (8.0 + 2.0 * np.sin(time / 300.0))) / 2.0,
            "voltage_v": voltage,
            "current_a": current,
            "soc": np.round(start_soc - used / CAPACITY_AH, 3),
            "heating_power_w": heater,
        }
    )


def log(samples, name="Log", **context):
    return Log.from_samples(name, samples.reset_index(drop=True), Context(**context))


def others(n=6, **options):
    return [log(drive(seed, **options), f"Sound{seed}") for seed in range(1, n + 1)]


def found_in(result, name="Log"):
    return [f for f in result.findings if f.trip.startswith(name)]


def only(result, consequence, words, name="Log"):
    findings = found_in(result, name)
    assert [f.consequence for f in findings] == [consequence], findings
    assert words in findings[0].what
    return findings[0]


@given(
    seed=st.integers(0, 10_000),
    step_s=st.sampled_from([0.1, 0.5, 1.0]),
    mass_kg=st.floats(900.0, 3000.0),
    start_soc=st.floats(0.4, 0.95),
)
@settings(max_examples=12, deadline=None)
def test_sound_logs_are_left_alone(seed, step_s, mass_kg, start_soc):
    samples = drive(seed, step_s=step_s, mass_kg=mass_kg, start_soc=start_soc)
    trips = [log(samples), *others(5)]
    result = audit(trips)
    assert result.findings == ()
    assert all(kept.samples.equals(trip.samples) for kept, trip in zip(result.trips, trips, strict=True))
    assert result.trips[0].observed_energy_wh == trips[0].observed_energy_wh


@pytest.mark.parametrize("step_s", [1.0, 2.0])
def test_coarse_logs_of_a_cruise_are_left_alone(step_s):
    """Whole km/h and whole kW at an assumed voltage, as some apps log: the signals rest for long."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 3600.0, step_s)
    drift = np.convolve(rng.normal(0.0, 1.0, len(time) + 60), np.ones(60) / 60, mode="valid")[: len(time)]
    speed = np.round(np.minimum(110.0, time / 4.0) + 4.0 * drift) / 3.6
    speed[-20:] = np.round(np.linspace(speed[-20], 0.0, 20) * 3.6) / 3.6
    power = 1500.0 * speed * np.gradient(speed, time) + (200.0 + 0.4 * speed**2) * speed
    kilowatt = np.round(power / 1000.0 + 0.3 * rng.normal(size=len(time)))
    samples = pd.DataFrame(
        {"time_s": time, "speed_m_s": speed, "voltage_v": 350.0, "current_a": kilowatt / 0.35}
    )
    result = audit([log(samples.assign(elevation_m=500.0 + 5 * drift, ambient_temperature_degc=9.0 + drift))])
    assert {f.consequence for f in result.findings} <= {"noted"}
    assert len(result.trips[0]) == len(samples)


def after(samples, from_s, **values):
    """The samples with other values of some columns from a time on."""
    late = samples["time_s"] > from_s
    return samples.assign(**{name: samples[name].where(~late, value) for name, value in values.items()})


@pytest.mark.parametrize(
    ("damage", "consequence", "words"),
    [
        (lambda d: after(d, 500, current_a=20.0), "set aside", "battery current stays at 20"),
        (lambda d: after(d, 600, current_a=np.nan), "trimmed", "no values of battery current"),
        (lambda d: after(d, 800, soc=np.nan), "noted", "state of charge is missing for"),
        (lambda d: after(d, 899.85, soc=0.0), "noted", "state of charge of 0 in 1 samples"),
        (lambda d: after(d, 0, heating_power_w=1240.0).replace({"heating_power_w": {1500.0: 0.0}}), "noted", "stays at 1240 W"),
        (lambda d: d.assign(soc=100 * d.soc), "noted", "percent"),
        (lambda d: d.assign(voltage_v=d.voltage_v.where(d.index != 100, 0.0)), "noted", "battery voltage of 0 V in 1"),
        (lambda d: pd.concat([d[:101], d[100:]]), "noted", "1 samples have the time of the sample before"),
        (lambda d: d[~d.time_s.between(300, 320)], "noted", "1 gaps of up to 20.2 s"),
        (lambda d: d.drop(columns="elevation_m"), "noted", "no values of elevation"),
        (lambda d: d.assign(elevation_m=582.0), "noted", "elevation stays at 582 m"),
        (lambda d: d.assign(ambient_temperature_degc=-40.0), "noted", "may not be measured"),
    ],
)  # fmt: skip
def test_each_rule_reaches_the_audit(damage, consequence, words):
    only(audit([log(damage(drive(18)))]), consequence, words)


def test_a_freeze_in_the_middle_splits_and_energy_is_measured_anew():
    samples = drive(3, duration_s=1500)
    first = int(np.flatnonzero((samples.time_s > 600) & (samples.speed_m_s > 5))[0])
    last = first + 450
    signals = ["speed_m_s", "voltage_v", "current_a"]
    samples.loc[first:last, signals] = samples.loc[first, signals].to_numpy()
    trip = log(samples)
    result = audit([trip])
    assert only(result, "split", "every signal frozen").from_s == samples.time_s[first]
    one, two = result.trips
    assert (one.trip_id, two.trip_id) == ("Log-1", "Log-2")
    assert one.observed_energy_wh == trip.between(-1, samples.time_s[first]).observed_energy_wh
    assert two.samples.time_s.iloc[0] == samples.time_s[last + 1]
    assert two.context.follows_trip
    assert not one.context.follows_trip


def charging(samples, after_s, seconds=900.0, ampere=100.0):
    at = int(np.flatnonzero((samples.time_s > after_s) & (samples.speed_m_s == 0))[0])
    n = int(seconds * 10)
    rows = samples.loc[[at] * n].assign(
        current_a=-ampere + np.random.default_rng(0).normal(0, 0.5, n), speed_m_s=0.0
    )
    rows["soc"] = samples.soc[at] + ampere * np.arange(n) / 36000.0 / CAPACITY_AH
    rest = samples.loc[at + 1 :]
    rest = rest.assign(soc=rest.soc + ampere * n / 36000.0 / CAPACITY_AH)
    joined = pd.concat([samples.loc[:at], rows, rest]).reset_index(drop=True)
    joined["time_s"] = 0.1 * np.arange(len(joined))
    return joined


def test_charging_at_the_end_trims_and_a_short_leg_is_set_aside():
    samples = drive(6, duration_s=900, start_soc=0.5)
    result = audit([log(charging(samples, 880))])
    findings = found_in(result)
    assert findings[0].consequence == "trimmed"
    assert "charged" in findings[0].what
    assert [t.trip_id for t in result.trips] == ["Log"]
    early = audit([log(charging(samples, 40))])
    assert early.set_aside.keys() == {"Log-1"}
    assert "shorter than" in early.set_aside["Log-1"]
    assert [t.trip_id for t in early.trips] == ["Log-2"]


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"speed_m_s": lambda d: d.speed_m_s / 3.6}, "a unit is wrong"),  # m/s that were taken for km/h
        ({"speed_m_s": lambda d: d.speed_m_s * 3.6}, "km/h"),
        ({"current_a": lambda d: -d.current_a}, "wrong sign"),
        ({"current_a": lambda d: d.current_a * 1000}, "mA"),
        ({"voltage_v": lambda d: 12.0 + 0.001 * d.voltage_v}, "12 V"),
        ({"voltage_v": lambda d: d.voltage_v * 1000}, "mV"),
    ],
)
def test_wrong_units_of_measured_signals_set_aside_alone_and_in_a_fleet(damage, words):
    for fleet in ([], others()):
        result = audit([log(drive(10).assign(**damage)), *fleet])
        assert words in result.set_aside["Log"]
        assert len(result.trips) == len(fleet)


def test_only_raw_logs_with_ids_of_their_own():
    trip = log(drive(23))
    refuses("duplicate trip id", audit, [trip, trip])
    refuses("not a raw log", audit, [replace(trip, step_s=1.0)])


@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_any_log_is_audited_without_an_error_and_what_passes_is_valid(data):
    samples = drive(data.draw(st.integers(0, 5)), duration_s=200, step_s=1.0)
    rng = np.random.default_rng(data.draw(st.integers(0, 10_000)))
    for _ in range(data.draw(st.integers(1, 4))):
        column = data.draw(st.sampled_from(list(samples.columns)))
        a, b = sorted(rng.integers(0, len(samples), 2))
        value = data.draw(st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -1.0, 1e9, 20.0, 12.0]))
        samples.loc[a:b, column] = value
    result = audit([log(samples)])
    for trip in result.trips:
        validate_samples(trip.samples, trip.trip_id)
    assert result.trips or result.set_aside


def test_the_published_trips(data_dir):
    fleet = read_logs(data_dir / "tum")
    result = audit(fleet)
    assert result.set_aside.keys() == {"TripB02"}
    assert "filled gap" in result.set_aside["TripB02"]
    assert "contradicts state of charge" in result.set_aside["TripB02"]
    trimmed = {f.trip: f.from_s for f in result.findings if f.consequence == "trimmed"}
    assert trimmed == {"TripB28": pytest.approx(1203.9), "TripB34": pytest.approx(293.0)}
    assert not [f for f in result.findings if f.consequence == "split"]
    by_id = {t.trip_id: t for t in result.trips}
    assert by_id["TripB28"].array("time_s")[-1] == pytest.approx(1203.9)
    assert by_id["TripB34"].array("time_s")[-1] == pytest.approx(293.0)
    stuck = {f.trip for f in result.findings if "heating power stays" in f.what and "requested" not in f.what}
    assert stuck == {"TripA03", "TripA05", "TripA06", "TripA13", "TripA18"}
    assert [f.trip for f in result.findings if "elevation stays" in f.what] == ["TripA04"]
    reference = {t.trip_id: t for t in fleet.reference_trips()}
    for trip_id, trip in reference.items():  # what the audit keeps of a reference trip is that reference trip
        assert by_id[trip_id].observed_energy_wh == trip.observed_energy_wh


def jagged(n, speed_m_s=10.0, start_s=0.0, step_s=1.0):
    """A sound log: a metre a second, ten volts and ten amperes up and down."""
    sign = np.where(np.arange(n) % 2, 1.0, -1.0)
    return pd.DataFrame(
        {
            "time_s": start_s + step_s * np.arange(n),
            "speed_m_s": speed_m_s + 0.1 * speed_m_s * sign,
            "voltage_v": 390.0 + 10.0 * sign,
            "current_a": 20.0 + 10.0 * sign,
            "elevation_m": 500.0 + sign,
            "ambient_temperature_degc": 9.0 + 0.5 * sign,
        }
    )


def told(result):
    return [(f.trip, f.from_s, f.to_s, f.consequence, f.what) for f in result.findings]


def test_a_drive_has_a_kilometre_and_two_minutes():
    assert len(audit([log(jagged(121))]).trips) == 1
    short = audit([log(jagged(120))])
    assert told(short) == [("Log", 0.0, 119.0, "set aside", "1190 m in 119 s: shorter than 120 s")]
    assert len(audit([log(jagged(201, 5.0))]).trips) == 1
    slow = audit([log(jagged(200, 5.0))])
    assert slow.set_aside == {"Log": "995 m in 199 s: shorter than 1000 m"}
    assert str(slow) == "0 sound drives of 1 log, 1 set aside"


def gapped(first, second, gap_s=100.0, start_s=7.0):
    """Two drives of so many samples with a gap between them."""
    one = jagged(first, start_s=start_s)
    two = jagged(second, start_s=start_s + first - 1 + gap_s)
    return pd.concat([one, two])


def test_a_gap_makes_two_drives_of_which_the_second_follows():
    started = dt.datetime(2026, 5, 1, 8, 0, 0)
    result = audit([log(gapped(201, 301), started_at=started)])
    assert told(result) == [("Log", 207.0, 307.0, "split", "no samples for 100.0 s")]
    one, two = result.trips
    assert (one.trip_id, two.trip_id) == ("Log-1", "Log-2")
    assert (len(one), len(two)) == (201, 301)
    assert (one.context.follows_trip, two.context.follows_trip) == (False, True)
    assert one.context.started_at == started
    assert two.context.started_at == dt.datetime(2026, 5, 1, 8, 5, 0)
    half = 0.5 * (380.0 * 10.0 + 400.0 * 30.0)  # W between two samples
    assert one.observed_energy_wh == pytest.approx(half * 200.0 / 3600.0)
    assert two.observed_energy_wh == pytest.approx(half * 300.0 / 3600.0)


def test_a_clock_that_is_set_back_starts_the_second_drive_no_earlier():
    started = dt.datetime(2026, 5, 1, 8, 0, 0)
    back = pd.concat([jagged(201, start_s=500.0), jagged(201)])
    one, two = audit([log(back, started_at=started)]).trips
    assert one.context.started_at == two.context.started_at == started
    assert audit([log(back)]).trips[1].context.started_at is None


def test_fifty_metres_beside_a_cut_are_a_drive():
    """Of 9 and 11 m/s by turns, the trapezoid has 10 m for every second."""
    result = audit([log(gapped(5, 301))])
    assert told(result) == [
        ("Log", 11.0, 111.0, "trimmed", "no samples for 100.0 s"),
        ("Log", 7.0, 11.0, "trimmed", "40 m beside a cut are too short for a drive"),
    ]
    assert [(t.trip_id, len(t), t.context.follows_trip) for t in result.trips] == [("Log", 301, False)]
    result = audit([log(gapped(6, 301))])
    assert result.set_aside == {"Log-1": "50 m in 5 s: shorter than 1000 m, 120 s"}
    assert [(t.trip_id, t.context.follows_trip) for t in result.trips] == [("Log-2", True)]
    behind = audit([log(gapped(301, 5))])
    assert [f[3] for f in told(behind)] == ["trimmed", "trimmed"]
    assert [(t.trip_id, len(t)) for t in behind.trips] == [("Log", 301)]
    single = audit([log(gapped(1, 301))])
    assert [f[4] for f in told(single)] == ["no samples for 100.0 s"]


def test_a_car_that_does_not_move_makes_no_drive():
    parked = jagged(300).assign(speed_m_s=0.0)
    assert audit([log(parked)]).set_aside == {"Log": "the car did not move"}


def test_speeds_that_no_car_reaches_in_the_time_are_those_of_another_unit_of_time():
    """Kiloseconds read as seconds: a drive of 15 minutes lasts 0.9 s."""
    samples = drive()
    (why,) = audit([log(samples.assign(time_s=samples.time_s / 1000.0))]).set_aside.values()
    assert why.endswith("km/h in 0.9 s: the unit of time is wrong")
    twice = gapped(150, 150).assign(speed_m_s=0.0)
    result = audit([log(twice)])
    assert [f[3] for f in told(result)] == ["trimmed", "set aside"]
    assert result.set_aside == {"Log": "no part of the log with a moving car is left"}
    frozen = jagged(300).assign(speed_m_s=20.0, voltage_v=350.0, current_a=30.0)
    (why,) = audit([log(frozen)]).set_aside.values()
    assert why == "no part of the log with a moving car is left; every signal frozen for 299.0 s at 72 km/h"


def test_fewer_than_two_samples_make_no_drive():
    stamps = jagged(3).assign(time_s=[1.0, np.nan, np.nan])
    result = audit([log(stamps)])
    assert result.set_aside == {"Log": "fewer than two samples are left"}
    two = jagged(3).assign(time_s=[1.0, 400.0, np.nan])
    assert "fewer than two" not in str(audit([log(two)]).set_aside)


@pytest.mark.parametrize(
    ("cut", "starts", "expected"),
    [
        (Cut(40, 60, ""), (0, 60), (39.0, 60.0, "split")),
        (Cut(40, 60, ""), (0, 61), (39.0, 60.0, "split")),
        (Cut(40, 60, ""), (40, 60), (39.0, 60.0, "trimmed")),
        (Cut(40, 60, ""), (0, 59), (39.0, 60.0, "trimmed")),
        (Cut(0, 60, ""), (60,), (0.0, 60.0, "trimmed")),
        (Cut(40, 100, ""), (0,), (39.0, 99.0, "trimmed")),
    ],
)
def test_a_cut_with_drives_on_both_sides_splits(cut, starts, expected):
    samples = jagged(100)
    finding = finding_of_cut("t", samples, cut, [(first, samples) for first in starts])
    assert (finding.from_s, finding.to_s, finding.consequence) == expected


def test_distance_leaves_unknown_speeds_out():
    samples = pd.DataFrame({"time_s": [0.0, 1.0, 3.0, 4.0], "speed_m_s": [10.0, np.nan, 20.0, 30.0]})
    assert driven_m(samples) == 15.0 * 3.0 + 25.0 * 1.0


def noted(trip, what, to_s, consequence="noted"):
    return Finding(trip, 5.0, to_s, what, consequence)


def test_what_every_log_lacks_is_told_once():
    findings = [noted("A", "flat", 10.0), noted("A", "gap", 40.0), noted("B", "flat", 30.0)]
    shared = Finding("all logs", 0.0, 40.0, "flat", "noted")
    assert without_repeats(findings, 2) == (shared, findings[1])
    assert without_repeats(findings, 3) == tuple(findings)
    assert without_repeats(findings[:2], 1) == tuple(findings[:2])
    trimmed = [noted("A", "flat", 10.0, "trimmed"), noted("B", "flat", 10.0, "trimmed")]
    assert without_repeats(trimmed, 2) == tuple(trimmed)
    mixed = [*findings, noted("B", "flat", 30.0, "set aside")]
    assert without_repeats(mixed, 2) == (shared, findings[1], mixed[3])


def test_a_drive_set_aside_for_two_reasons_has_both():
    short = jagged(100).assign(elevation_m=np.nan)
    stuck = audit([log(short.assign(voltage_v=np.where(np.arange(100) % 10, 390.0, 5.0)))])
    assert list(stuck.set_aside) == ["Log"]
    assert len(stuck.to_frame()) == len(stuck.findings)
    assert audit([log(jagged(121)), log(jagged(300), "Two")]).n_logs == 2


def test_findings_are_in_the_order_of_the_logs():
    """A contradiction of charge is found when all logs are known, and is told with its own log."""

    def with_soc(n, name, change, gap=False):
        samples = gapped(n, 200) if gap else jagged(n)
        soc = 0.8 - change * np.linspace(0.0, 1.0, len(samples))
        return log(samples.assign(soc=soc), name)

    logs = [with_soc(400, "Odd", 0.8)]
    logs += [with_soc(400 + k, f"A{k}", 0.1) for k in range(5)]
    logs += [with_soc(400, "Gap", 0.15, gap=True)]
    result = audit(logs)
    assert [f.trip for f in result.findings] == ["Odd", "Gap"]
    assert result.set_aside.keys() == {"Odd"}
    assert [t.trip_id for t in result.trips] == ["A0", "A1", "A2", "A3", "A4", "Gap-1", "Gap-2"]
