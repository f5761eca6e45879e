"""Currents with an offset: an energy that no road and no load explain sets the drive aside."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.auditing import audit
from tripwatt.auditing.consistency import offset_findings
from tripwatt.synthetic import synthetic_fleet
from tripwatt.trips import Log


@pytest.fixture(scope="module")
def sound() -> Log:
    trip = synthetic_fleet(3).trips[0]
    return Log.from_samples(trip.trip_id, trip.samples)


def with_offset(log: Log, amperes: float) -> Log:
    return Log.from_samples(log.trip_id, log.samples.assign(current_a=log.samples["current_a"] + amperes))


def test_a_sound_drive_is_kept(sound: Log) -> None:
    assert len(audit([sound]).trips) == 1


@pytest.mark.parametrize("amperes", [100.0, -100.0])
def test_an_offset_of_the_current_sets_the_drive_aside(sound: Log, amperes: float) -> None:
    result = audit([with_offset(sound, amperes)])
    assert result.trips == ()
    assert any(finding.consequence == "set aside" for finding in result.findings)


def drive(power_w: float, *, fall_m: float | None, seconds: int = 1000, speed: float = 20.0) -> Log:
    """20 km at a constant power, without a stop."""
    time = np.arange(float(seconds + 1))
    samples = {"time_s": time, "speed_m_s": speed, "voltage_v": 400.0, "current_a": power_w / 400.0}
    if fall_m is not None:
        samples["elevation_m"] = 1000.0 - fall_m * time / seconds
    return Log.from_samples("a", pd.DataFrame(samples))


def told(log: Log) -> list[str]:
    return [finding.what for finding in offset_findings(log)]


def test_a_battery_gains_what_the_road_falls_at_most() -> None:
    """3,500 kg times 9.81 m/s² times the fall with a margin of 30 m, in Wh."""
    for fall_m, drop_m in ((300.0, 330.0), (-300.0, 30.0), (None, 0.1 * 20_000.0)):
        most_w = 3500.0 * 9.81 * drop_m / 3600.0 / (1000.0 / 3600.0)
        assert told(drive(-0.99 * most_w, fall_m=fall_m)) == []
        (what,) = told(drive(-1.01 * most_w, fall_m=fall_m))
        assert "the battery gains" in what
        assert f"falls by at most {drop_m:.0f} m" in what


def test_no_car_takes_three_kilowatt_hours_a_kilometre() -> None:
    most_w = 3000.0 * 20.0 / (1000.0 / 3600.0)
    assert told(drive(0.99 * most_w, fall_m=0.0)) == []
    assert told(drive(1.01 * most_w, fall_m=0.0)) == [
        "3030 Wh/km: the current has an offset or the wrong unit"
    ]
    assert told(drive(1.01 * most_w, fall_m=0.0, seconds=249)) == [], "shorter than 5 km"


def test_no_car_takes_25_kw_while_it_stands() -> None:
    log = drive(26_000.0, fall_m=0.0)
    for standing, found in (
        (9, []),
        (10, ["the battery gives 26 kW while the car stands: the current has an offset"]),
    ):
        speed = np.full(1001, 20.0)
        speed[:standing] = 0.0
        assert told(Log.from_samples("a", log.samples.assign(speed_m_s=speed))) == found
    light = drive(24_000.0, fall_m=0.0).samples.assign(speed_m_s=np.repeat([0.0, 20.0], [100, 901]))
    assert told(Log.from_samples("a", light)) == []
