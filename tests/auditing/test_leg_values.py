"""How logs become drives: what is cut, how the pieces are named, and which are long enough."""

import datetime as dt

import numpy as np
import pandas as pd
import pytest

from tripwatt.auditing import _cut_finding, _distance, _told_once, audit
from tripwatt.auditing.findings import Cut, Finding
from tripwatt.trips import Context, Log


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


def log(samples, name="Log", **context):
    return Log.from_samples(name, samples.reset_index(drop=True), Context(**context))


def told(result):
    return [(f.trip, f.from_s, f.to_s, f.consequence, f.what) for f in result.findings]


def test_a_drive_has_a_kilometre_and_two_minutes():
    assert len(audit([log(jagged(121))]).trips) == 1
    short = audit([log(jagged(120))])
    assert told(short) == [("Log", 0.0, 119.0, "set aside", "1190 m in 119 s: shorter than 1000 m or 120 s")]
    assert len(audit([log(jagged(201, 5.0))]).trips) == 1
    slow = audit([log(jagged(200, 5.0))])
    assert slow.set_aside == {"Log": "995 m in 199 s: shorter than 1000 m or 120 s"}
    assert str(slow) == "0 drives out of 1 logs are used, 1 are not"


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
    assert result.set_aside == {"Log-1": "50 m in 5 s: shorter than 1000 m or 120 s"}
    assert [(t.trip_id, t.context.follows_trip) for t in result.trips] == [("Log-2", True)]
    behind = audit([log(gapped(301, 5))])
    assert [f[3] for f in told(behind)] == ["trimmed", "trimmed"]
    assert [(t.trip_id, len(t)) for t in behind.trips] == [("Log", 301)]
    single = audit([log(gapped(1, 301))])
    assert [f[4] for f in told(single)] == ["no samples for 100.0 s"]


def test_a_car_that_does_not_move_makes_no_drive():
    parked = jagged(300).assign(speed_m_s=0.0)
    assert audit([log(parked)]).set_aside == {"Log": "the car did not move"}
    twice = gapped(150, 150).assign(speed_m_s=0.0)
    result = audit([log(twice)])
    assert [f[3] for f in told(result)] == ["trimmed", "set aside"]
    assert result.set_aside == {"Log": "no part of the log with a moving car is left"}


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
    finding = _cut_finding("t", samples, cut, [(first, samples) for first in starts])
    assert (finding.from_s, finding.to_s, finding.consequence) == expected


def test_distance_leaves_unknown_speeds_out():
    samples = pd.DataFrame({"time_s": [0.0, 1.0, 3.0, 4.0], "speed_m_s": [10.0, np.nan, 20.0, 30.0]})
    assert _distance(samples) == 15.0 * 3.0 + 25.0 * 1.0


def noted(trip, what, to_s, consequence="noted"):
    return Finding(trip, 5.0, to_s, what, consequence)


def test_what_every_log_lacks_is_told_once():
    findings = [noted("A", "flat", 10.0), noted("A", "gap", 40.0), noted("B", "flat", 30.0)]
    shared = Finding("all logs", 0.0, 40.0, "flat", "noted")
    assert _told_once(findings, 2) == (shared, findings[1])
    assert _told_once(findings, 3) == tuple(findings)
    assert _told_once(findings[:2], 1) == tuple(findings[:2])
    trimmed = [noted("A", "flat", 10.0, "trimmed"), noted("B", "flat", 10.0, "trimmed")]
    assert _told_once(trimmed, 2) == tuple(trimmed)
    mixed = [*findings, noted("B", "flat", 30.0, "set aside")]
    assert _told_once(mixed, 2) == (shared, findings[1], mixed[3])


def test_a_drive_set_aside_for_two_reasons_has_both():
    short = jagged(100).assign(elevation_m=np.nan)
    stuck = audit([log(short.assign(voltage_v=np.where(np.arange(100) % 10, 390.0, 5.0)))])
    assert list(stuck.set_aside) == ["Log"]
    assert len(stuck.frame()) == len(stuck.findings)
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
