"""Rules on quantities that physics ties together, each threshold from both sides."""

import numpy as np
import pandas as pd
import pytest

from tripwatt.auditing import consistency
from tripwatt.auditing.consistency import (
    Balance,
    blank_soc_faults,
    charge_balance,
    energy_error_findings,
    missing_soc,
    offset_findings,
    soc_findings,
    soc_resolution,
    stopped_soc,
    stray_soc,
    unit_findings,
)
from tripwatt.trips import Log, Recorded


def test_a_balance_fits_within_a_tenth_and_a_hundredth():
    """25 Ah of 50 Ah are 0.5; a tenth of the larger change and 0.01 are allowed."""

    def fits(soc_change, resolution=0.0, std=0.0, sign=1.0):
        return Balance(sign * 25.0, sign * soc_change, resolution).fits(50.0, std)

    assert [fits(x) for x in (0.439, 0.441, 0.566, 0.568)] == [False, True, True, False]
    assert [fits(x, sign=-1.0) for x in (0.439, 0.441, 0.566, 0.568)] == [False, True, True, False]
    assert [fits(x, resolution=0.02) for x in (0.399, 0.401)] == [False, True]  # two steps more
    assert [fits(x, std=0.03) for x in (0.349, 0.351)] == [False, True]  # five standard deviations
    assert not Balance(-25.0, 0.5, 0.0).fits(50.0, 0.0)


def test_the_capacity_is_charge_per_change():
    assert Balance(25.0, 0.5, 0.0).capacity_ah == 50.0
    assert np.isnan(Balance(25.0, 0.0, 0.0).capacity_ah)


NO = np.nan


def test_charge_is_counted_where_the_state_of_charge_is_known():
    hours = np.array([1.0, 2.0, 4.0, 5.0, 6.0, 7.0])
    samples = pd.DataFrame(
        {
            "time_s": 3600.0 * hours,
            "soc": [NO, 0.9, NO, 0.8, 0.7, NO],
            "current_a": [99.0, 10.0, NO, 50.0, 40.0, 99.0],
        }
    )
    balance = charge_balance(samples)
    assert balance is not None
    assert balance.charge_ah == pytest.approx(30.0 * 3.0 + 45.0 * 1.0)
    assert balance.soc_change == pytest.approx(0.2)
    assert balance.resolution == 0.0
    assert charge_balance(samples.assign(current_a=[99.0, 10.0, NO, NO, NO, 99.0])) is None
    two = charge_balance(samples.assign(current_a=[99.0, 10.0, NO, NO, 20.0, 99.0]))
    assert two is not None
    assert two.charge_ah == pytest.approx(15.0 * 4.0)
    assert charge_balance(samples.assign(soc=NO)) is None
    assert charge_balance(samples.drop(columns="current_a")) is None


def test_the_resolution_is_the_median_step_between_rests():
    assert soc_resolution(np.array([0.5, 0.5, 0.4, 0.4, 0.45, 0.2, 0.2, 0.19, 0.19])) == pytest.approx(0.1)
    assert soc_resolution(np.array([0.5, 0.5, 0.5, 0.5])) == 0.0
    assert soc_resolution(np.array([0.5, 0.4, 0.3])) == 0.0


def leg(name, charge_ah, soc_change, *, step=0.0):
    """An hour of constant current; with a step the state of charge rests once before and after it."""
    time = np.array([0.0, 900.0, 1800.0, 2700.0, 3600.0])
    soc = 0.5 - soc_change * np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    if step:
        soc = 0.5 - np.array([0.0, 0.0, step, step, soc_change])
    return Recorded(name, pd.DataFrame({"time_s": time, "soc": soc, "current_a": charge_ah}))


def judged(odd, fleet, sound=None):
    legs = [odd, *fleet]
    return soc_findings(legs, sound or [False] + [True] * len(fleet)).get(odd.trip_id, [])


def alike(n, charge_ah=12.0, soc_change=0.2, **options):
    return [leg(f"A{k}", charge_ah, soc_change, **options) for k in range(n)]


def test_a_drive_is_compared_with_five_others():
    odd = leg("Odd", 12.0, 0.1)
    assert judged(odd, alike(4)) == []
    (finding,) = judged(odd, alike(5))
    assert (finding.from_s, finding.to_s, finding.consequence) == (0.0, 3600.0, "set aside")
    assert finding.what == (
        "energy contradicts state of charge: 12.00 Ah for a change of the state of charge of 10.0 %; "
        "the battery of the other drives, 60.0 Ah, gives 20.0 %"
    )
    assert judged(odd, alike(5), [False] * 2 + [True] * 4) == []


def test_drives_with_a_change_below_three_percent_have_no_capacity():
    odd = leg("Odd", 12.0, 0.1)
    assert judged(odd, alike(5, 1.74, 0.029)) == []
    assert len(judged(odd, alike(5, 1.8, 0.0301))) == 1


def test_a_battery_has_10_to_1500_ampere_hours():
    def words(charge_ah, soc_change=0.125):
        return [(f.consequence, f.what) for f in judged(leg("Odd", charge_ah, soc_change), [])]

    assert words(1.25) == []
    ((consequence, what),) = words(1.0)
    assert consequence == "set aside"
    assert what == (
        "1.00 Ah for a change of the state of charge of 12.5 % corresponds to a battery of 8 Ah: "
        "check unit and sign of the current"
    )
    assert words(187.5) == []
    assert len(words(188.0)) == 1
    assert len(words(-7.5)) == 1
    assert len(words(7.5, -0.125)) == 1
    assert len(words(0.5, 0.0625)) == 1
    assert words(0.45, 0.058) == []  # less than six percent says little of a capacity


def test_two_other_drives_make_another_car():
    def others_of(n):
        return [leg(f"B{k}", 12.0, 0.1) for k in range(n)]

    odd = leg("Odd", 12.0, 0.1)
    assert [f.consequence for f in judged(odd, [*alike(7), *others_of(1)])] == ["set aside"]
    (finding,) = judged(odd, [*alike(7), *others_of(2)])
    assert finding.consequence == "noted"
    assert finding.what.endswith("; 2 other drives agree with this one, so this may be another car")
    itself = judged(odd, [*alike(7), *others_of(1)], [True] * 9)
    assert [f.consequence for f in itself] == ["set aside"]


SCATTERED = (0.18, 0.19, 0.195, 0.2, 0.21, 0.23, 0.26)
"""Errors of -0.02, -0.01, -0.005, 0, 0.01, 0.03 and 0.06; with a low one their median is -0.0025, and the median distance
from it (0.0125 + 0.0175) / 2 = 0.015. Five times 1.4826 times that are 0.1112."""


@pytest.mark.parametrize(("error", "found"), [(-0.110, 0), (-0.113, 1)])
def test_a_car_that_scatters_is_allowed_five_standard_deviations(error, found):
    fleet = [leg(f"A{k}", 12.0, change) for k, change in enumerate(SCATTERED)]
    assert len(judged(leg("Odd", 12.0, 0.2 + error), fleet)) == found


def test_a_drive_too_short_for_a_step_has_the_usual_resolution():
    """Two steps of 0.02, a hundredth and a tenth of 0.2 are 0.07."""
    fleet = [
        *alike(2, step=0.02),
        leg("C", 12.0, 0.2, step=0.04),
        *(leg(f"S{k}", 12.0, 0.2) for k in range(5)),
    ]
    assert judged(leg("Odd", 12.0, 0.132), fleet) == []
    assert len(judged(leg("Odd", 12.0, 0.128), fleet)) == 1
    coarse = leg("Odd", 12.0, 0.092, step=0.04)
    assert judged(coarse, fleet) == []


def test_a_drive_without_a_balance_has_no_finding():
    odd = leg("Odd", 12.0, 0.1)
    bare = Recorded("Bare", odd.samples.drop(columns="soc"))
    found = soc_findings([bare, odd, *alike(5)], [True] * 7)
    assert list(found) == ["Odd"]


def standing(moves, change=0.01, still=10, current_a=36.0):
    """0.01 for every 60 s of 36 A: a battery of 60 Ah; then the state of charge stands."""
    n = moves + still + 1
    soc = 0.8 - change * np.minimum(np.arange(n), moves)
    return Recorded(
        "T", pd.DataFrame({"time_s": 50.0 + 60.0 * np.arange(n), "soc": soc, "current_a": current_a})
    )


def test_a_state_of_charge_that_fits_until_it_stands_has_a_stopped_sensor():
    finding = stopped_soc(standing(10), 60.0, 0.0)
    assert finding is not None
    assert (finding.from_s, finding.to_s, finding.consequence) == (650.0, 1250.0, "noted")
    assert (
        finding.what
        == "state of charge stays at 0.700 while the battery delivers current: the sensor stopped"
    )
    assert stopped_soc(standing(10), 30.0, 0.0) is None
    assert stopped_soc(standing(10), 30.0, 1.0) is not None
    assert stopped_soc(standing(0), 60.0, 0.0) is None
    assert stopped_soc(standing(3, 0.0101), 60.0, 0.0) is not None
    assert stopped_soc(standing(3, 0.0099), 60.0, 0.0) is None


def test_a_stopped_sensor_is_told_in_place_of_a_contradiction():
    odd = standing(10, still=60)
    (finding,) = judged(odd, alike(6))
    assert "the sensor stopped" in finding.what


def stray(soc, step_s=1.0):
    soc = np.array(soc, dtype=float)
    return np.flatnonzero(stray_soc(step_s * np.arange(len(soc)), soc)).tolist()


def test_zeros_beside_a_charge_are_a_sensor_that_is_off():
    assert stray([0.5, 0.5, 0.0, 0.0, 0.5]) == [2, 3]
    assert stray([0.0, 0.5, 0.5]) == [0]
    assert stray([0.5, 0.0, 0.0, 0.0, 0.0]) == [1, 2, 3, 4]
    assert stray([0.04, 0.0, 0.0]) == [1, 2]
    assert stray([0.03, 0.02, 0.01, 0.0]) == []
    assert stray([0.5, 0.03, 0.0], step_s=600.0) == []


def test_a_jump_is_more_than_three_percent_and_faster_than_ten_capacities_an_hour():
    """0.25 in 90 s."""
    level = [0.6] * 5
    assert stray([*level, 0.35], step_s=89.0) == [5]
    assert stray([*level, 0.35], step_s=91.0) == []
    assert stray([*level, 0.571]) == []
    assert stray([*level, 0.569]) == [5]
    assert stray([0.9, *level]) == [0]
    assert stray([*level, NO, 0.9, NO, *level]) == [6]


def test_the_longest_piece_between_jumps_is_sound():
    assert stray([0.5] * 4 + [0.7] * 6) == [0, 1, 2, 3]
    assert stray([0.5] * 6 + [0.7] * 3 + [0.51] * 4) == [6, 7, 8]
    assert stray([0.5] * 6 + [0.7] * 3 + [0.54] * 4) == [6, 7, 8, 9, 10, 11, 12]
    steep = [0.50, 0.48, 0.46, 0.44, 0.42, 0.40]  # its median is 0.45
    assert stray([*steep, 0.478], step_s=2.0) == []
    assert stray([*steep, 0.482], step_s=2.0) == [6]


def test_a_state_of_charge_is_missing_after_ten_seconds():
    def missing(before, after):
        soc = np.array([NO] * before + [0.5] * 20 + [NO] * after)
        found = missing_soc(30.0 + np.arange(len(soc)), soc, "t")
        return [(f.from_s, f.to_s, f.what) for f in found]

    assert missing(10, 10) == []
    assert missing(11, 0) == [(30.0, 41.0, "state of charge is missing for 11.0 s at the start")]
    assert missing(0, 11) == [(49.0, 60.0, "state of charge is missing for 11.0 s at the end")]


def test_faults_of_a_state_of_charge_are_blank():
    soc = np.array([0.5] * 20 + [0.9, 0.8] + [0.5] * 20)
    samples = pd.DataFrame({"time_s": 5.0 + np.arange(42.0), "displayed_soc": soc})
    mended, (finding,) = blank_soc_faults(samples, "t")
    assert np.flatnonzero(mended["displayed_soc"].isna()).tolist() == [20, 21]
    assert (finding.from_s, finding.to_s, finding.consequence) == (25.0, 26.0, "noted")
    assert finding.what == "displayed state of charge of 0.8 in 2 samples is a jump: these values are removed"
    gone = samples.assign(displayed_soc=np.where(np.arange(42) < 15, NO, 0.5))
    assert blank_soc_faults(gone, "t")[1] == []
    (told,) = blank_soc_faults(gone.rename(columns={"displayed_soc": "soc"}), "t")[1]
    assert told.what == "state of charge is missing for 15.0 s at the start"


def units(monkeypatch, mass_kg, correlation):
    monkeypatch.setattr(consistency, "apparent_mass", lambda *_: (mass_kg, correlation))
    samples = pd.DataFrame({"time_s": [0.0, 9.0], "speed_m_s": 1.0, "voltage_v": 1.0, "current_a": 1.0})
    return [(f.consequence, f.what) for f in unit_findings(Recorded("t", samples))]


def test_a_current_that_charges_while_the_car_accelerates_has_the_wrong_sign(monkeypatch):
    assert units(monkeypatch, 1500.0, -0.3) == []
    ((consequence, what),) = units(monkeypatch, 1500.0, -0.31)
    assert consequence == "set aside"
    assert "wrong sign" in what


def test_a_car_weighs_450_to_8000_kilograms(monkeypatch):
    assert units(monkeypatch, 450.0, 0.9) == []
    assert units(monkeypatch, 8000.0, 0.9) == []
    assert units(monkeypatch, 449.0, 0.49) == []
    ((consequence, light),) = units(monkeypatch, 449.0, 0.5)
    assert consequence == "set aside"
    assert "449 kg: a unit is wrong, for example speed in km/h read as m/s" in light
    ((consequence, heavy),) = units(monkeypatch, 8001.0, 0.9)
    assert consequence == "set aside"
    assert "for example speed in m/s read as km/h" in heavy


def test_power_is_voltage_times_current(monkeypatch):
    seen = []
    monkeypatch.setattr(consistency, "apparent_mass", lambda *given: seen.append(given))
    samples = pd.DataFrame(
        {"time_s": [0.0, 9.0], "speed_m_s": 1.0, "voltage_v": 400.0, "current_a": [20.0, -5.0]}
    )
    assert unit_findings(Recorded("t", samples)) == []
    assert seen[0][2].tolist() == [8000.0, -2000.0]


@pytest.mark.parametrize(
    ("error_wh", "consequence"),
    [(250.0, None), (251.0, "noted"), (499.0, "noted"), (500.0, "set aside"), (NO, "set aside")],
)
def test_an_energy_is_inaccurate_from_a_quarter_and_useless_from_half(error_wh, consequence):
    samples = pd.DataFrame({"time_s": [0.0, 9.0], "speed_m_s": 1.0})
    trip = Recorded("t", samples, observed_energy_wh=1000.0, observed_energy_std_wh=error_wh)
    found = list(energy_error_findings(trip))
    assert [f.consequence for f in found] == ([consequence] if consequence else [])
    words = {"noted": "Wh: inaccurate", "set aside": "Wh: too inaccurate to use"}
    assert all(f.what.endswith(words[f.consequence]) for f in found)


def test_an_energy_without_an_error_is_measured():
    samples = pd.DataFrame({"time_s": [0.0, 9.0], "speed_m_s": 1.0})
    assert list(energy_error_findings(Recorded("t", samples, observed_energy_wh=1000.0))) == []
    assert list(energy_error_findings(Recorded("t", samples, observed_energy_std_wh=100.0))) == []


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
        max_w = 3500.0 * 9.81 * drop_m / 3600.0 / (1000.0 / 3600.0)
        assert told(drive(-0.99 * max_w, fall_m=fall_m)) == []
        (what,) = told(drive(-1.01 * max_w, fall_m=fall_m))
        assert "the battery gains" in what
        assert f"falls by at most {drop_m:.0f} m" in what


def test_no_car_takes_three_kilowatt_hours_a_kilometre() -> None:
    max_w = 3000.0 * 20.0 / (1000.0 / 3600.0)
    assert told(drive(0.99 * max_w, fall_m=0.0)) == []
    assert told(drive(1.01 * max_w, fall_m=0.0)) == [
        "3030 Wh/km: the current has an offset or the wrong unit"
    ]
    assert told(drive(1.01 * max_w, fall_m=0.0, seconds=249)) == [], "shorter than 5 km"


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
