"""Rules on the surroundings, each threshold from both sides."""

import numpy as np
import pandas as pd
import pytest
from tests.auditing.findings import NO, told

import tripwatt as tw
from tripwatt.auditing.road import ambient_findings, coarse_findings, mend_heights


def road(height, speed=20.0, step_s=1.0):
    n = len(height)
    columns = {"time_s": 100.0 + step_s * np.arange(n), "speed_m_s": speed, "elevation_m": height}
    return told(mend_heights(pd.DataFrame(columns), "t")[1])


def test_no_road_keeps_its_height_for_two_kilometres():
    assert road([582.0] * 101) == []
    words = "elevation stays at 582 m over 2.0 km: the road is treated as flat"
    assert road([582.0] * 102) == [(100.0, 201.0, "noted", words)]
    assert road([582.0] * 101 + [583.0]) == []
    assert [f[:2] for f in road([582.0, 582.0], step_s=101.0)] == [(100.0, 201.0)]
    assert road([582.0, NO], step_s=101.0) == []
    assert road([NO, NO]) == []


def test_no_road_climbs_more_than_four_tenths_beside_ten_metres_of_noise():
    """On 20 m a road of 40 % rises by 8 m."""
    level = [500.0] * 5
    assert road([*level, 518.0, 518.0]) == []
    words = "elevation jumps 1 times, by up to 18.5 m"
    assert road([*level, 518.5, 518.5]) == [(104.0, 105.0, "noted", words)]
    words = "elevation jumps 2 times, by up to 19.0 m"
    assert road([*level, 518.5, 518.5, 499.5])[0] == (104.0, 107.0, "noted", words)
    faster = np.array([10.0, 30.0, 10.0])  # 40 m in 2 s rise by 16 m
    assert road([500.0, 525.5, 525.5], faster, step_s=2.0) == []
    assert len(road([500.0, 526.5, 526.5], faster, step_s=2.0)) == 1
    parked = np.array([0.0, 0.0, NO, 0.0])
    assert [f[:2] for f in road([500.0, 500.0, 505.0, 510.5], parked)] == [(101.0, 103.0)]


def test_heights_that_no_road_can_have_are_replaced_and_told():
    height = 500.0 + 0.5 * np.arange(120.0)
    logged = np.where(np.arange(120) < 6, 0.0, height)
    logged[60:70] = 6000.0
    samples = pd.DataFrame({"time_s": np.arange(120.0), "speed_m_s": 20.0, "elevation_m": logged})
    mended, findings = mend_heights(samples, "t")
    assert mended["elevation_m"].to_numpy() == pytest.approx(np.where(np.arange(120) < 6, 503.0, height))
    words = "elevation of 0 in 16 samples is a jump: these values are removed"
    assert told(findings)[-1] == (0.0, 69.0, "noted", words)
    assert "jumps 3 times, by up to 5500" not in told(findings)[0][3]
    assert samples["elevation_m"][0] == 0.0
    again, findings = mend_heights(mended, "t")
    assert again is mended
    assert findings == []


def ambient(values, step_s=1.0):
    n = len(values)
    columns = {"time_s": 100.0 + step_s * np.arange(n), "ambient_temperature_degc": values}
    return told(ambient_findings(pd.DataFrame(columns), "t"))


def test_air_that_stays_the_same_for_an_hour_is_not_measured():
    assert ambient([9.0] * 2, 3600.0) == []
    words = "outside temperature stays at 9 °C: it may not be measured"
    assert ambient([9.0] * 2, 3601.0) == [(100.0, 3701.0, "noted", words)]
    assert ambient([9.0, 9.5], 3601.0) == []
    assert ambient([NO, NO], 3601.0) == []
    assert len(ambient([9.0, NO, 9.0], 2000.0)) == 1


@pytest.mark.parametrize("value", [-40.0, 85.0, 127.0, 127.5, 215.0])
def test_the_ends_of_the_usual_codings_are_not_measured(value):
    assert len(ambient([value] * 3)) == 1
    assert ambient([value + 0.25] * 3) == []


def coarse(speed, time):
    return told(coarse_findings(pd.DataFrame({"time_s": time, "speed_m_s": speed}), "t"))


def test_a_speed_that_is_new_every_five_seconds_is_coarse():
    time = np.arange(0.0, 1200.0)
    speed = 12.0 + 8.0 * np.sin(time / 20.0)
    words = "speed is a new value every {} s: accelerations between are unknown, "
    words += "the simulated energy may be off by several percent"
    assert coarse(speed, time) == []
    assert coarse(speed[4 * (np.arange(1200) // 4)], time) == []
    assert coarse(speed[5 * (np.arange(1200) // 5)], time) == [(0.0, 1199.0, "noted", words.format("5.0"))]
    assert coarse(speed[::4], time[::4]) == []
    assert coarse(speed[::5], time[::5]) == [(0.0, 1195.0, "noted", words.format("5.0"))]
    assert coarse(speed[::30], time[::30]) == [(0.0, 1170.0, "noted", words.format("30.0"))]


def test_a_speed_every_half_minute_is_no_drive():
    time = np.arange(0.0, 4000.0)
    speed = 12.0 + 8.0 * np.sin(time / 20.0)
    words = "speed is a new value every 31.0 s: the drive cannot be simulated"
    assert coarse(speed[::31], time[::31]) == [(0.0, 3999.0, "set aside", words)]
    assert coarse(speed[31 * (np.arange(4000) // 31)], time) == [(0.0, 3999.0, "set aside", words)]


def test_a_car_that_stands_may_be_logged_seldom():
    time = np.append(np.arange(0.0, 100.0), 100.0 + 60.0 * np.arange(1, 200))
    speed = np.where(time < 100.0, 10.0 + np.sin(time), 0.0)
    assert coarse(speed, time) == []
    assert coarse([0.0, 0.0], [0.0, 60.0]) == []
    assert coarse([NO], [0.0]) == []


def test_no_log_of_the_public_sets_is_coarse(data_dir):
    for name in ("tum", "ved"):
        logs = tw.read_logs(data_dir / name, name).logs
        assert [f for log in logs for f in coarse_findings(log.samples, log.trip_id)] == []
