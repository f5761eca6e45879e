"""What single signals and several together show, each threshold from both sides."""

import numpy as np
import pandas as pd
import pytest
from tests.auditing.findings import NO, told

import tripwatt as tw
from tripwatt.auditing.findings import MEASURED, Cut
from tripwatt.auditing.signals import (
    ambient_findings,
    are_lines,
    blank_fahrenheit,
    blank_impossible,
    blank_infinite,
    blank_stuck_heater,
    charging_cuts,
    coarse_findings,
    drop_blank_speed,
    filled_gaps,
    freeze_cuts,
    frozen_sensor_findings,
    guessed_unit,
    mend_heights,
    missing_columns,
    resting_steps,
    sensor_stop_cuts,
    short_pulses,
    speed_spikes,
    stuck_level,
    usual_rest_s,
)


def lively(n=300, step_s=1.0, speed_m_s=10.0, start_s=0.0):
    """Voltage and current change with every sample; the speed is held."""
    number = np.arange(n)
    return pd.DataFrame(
        {
            "time_s": start_s + step_s * number,
            "speed_m_s": np.full(n, speed_m_s),
            "voltage_v": 390.0 - 0.01 * number,
            "current_a": 20.0 + 0.01 * number,
        }
    )


def frozen(first, last, **options):
    """All signals rest from one sample to another."""
    samples = lively(**options)
    samples.loc[first:last, list(MEASURED)] = samples.loc[first, list(MEASURED)].to_numpy()
    return samples


def cuts(samples):
    return list(freeze_cuts(samples))


def test_resting_allows_the_rounding_of_means():
    """A billionth of one more than the value itself: 1e-9 beside 0, 1.001e-6 beside 1000."""
    steps = [[0.0, 0.0], [1e-9, 0.0], [1.5e-9, 0.0], [1000.0 + 9e-7, 1000.0], [1000.0 + 1.1e-6, 1000.0]]
    assert [bool(resting_steps(np.array(step))[0]) for step in steps] == [True, True, False, True, False]
    assert resting_steps(np.array([1.0, np.nan, 1.0])).tolist() == [False, False]


def test_a_freeze_on_the_move_lasts_ten_seconds_and_ten_steps():
    def frozen_cut(steps, step_s):
        return cuts(frozen(100, 100 + steps, step_s=step_s))

    assert frozen_cut(19, 0.5) == []  # 9.5 s
    assert frozen_cut(20, 0.5) == [Cut(101, 121, "every signal frozen for 10.0 s at 36 km/h")]
    assert frozen_cut(9, 2.0) == []  # nine steps are no coincidence of many
    assert frozen_cut(10, 2.0) == [Cut(101, 111, "every signal frozen for 20.0 s at 36 km/h")]


def test_a_car_moves_above_a_metre_a_second():
    assert cuts(frozen(100, 180, speed_m_s=1.0)) == []
    assert cuts(frozen(100, 110, speed_m_s=1.25)) == [
        Cut(101, 111, "every signal frozen for 10.0 s at 4 km/h")
    ]


def test_a_freeze_at_standstill_counts_at_the_ends_of_a_log_alone():
    words = "every signal frozen for 60.0 s at standstill"
    assert cuts(frozen(0, 59, speed_m_s=0.0)) == []
    assert cuts(frozen(0, 60, speed_m_s=0.0)) == [Cut(0, 61, words)]
    assert cuts(frozen(240, 299, speed_m_s=0.0)) == []
    assert cuts(frozen(239, 299, speed_m_s=0.0)) == [Cut(240, 300, words)]
    assert cuts(frozen(1, 200, speed_m_s=0.0)) == []
    assert cuts(frozen(100, 298, speed_m_s=0.0)) == []


def test_a_moving_freeze_at_the_start_takes_its_first_sample_too():
    words = "every signal frozen for 10.0 s at 36 km/h"
    assert cuts(frozen(0, 10)) == [Cut(0, 11, words)]
    assert cuts(frozen(1, 11)) == [Cut(2, 12, words)]


def test_a_log_without_samples_has_no_freeze():
    assert cuts(lively(0)) == []
    assert cuts(lively(1)) == []


def blocks(lengths, speed_m_s):
    """Samples, once a second, that rest for blocks of so many samples each."""
    current = np.repeat(np.arange(len(lengths), dtype=float), lengths)
    n = len(current)
    speed = np.full(n, speed_m_s) if np.isscalar(speed_m_s) else np.repeat(speed_m_s, lengths)
    return pd.DataFrame(
        {
            "time_s": 50.0 + np.arange(n),
            "speed_m_s": speed,
            "voltage_v": np.full(n, 390.0),
            "current_a": current,
        }
    )


def usual_rest(samples):
    current = samples["current_a"].to_numpy()
    steady = np.diff(current) == 0.0
    return usual_rest_s(samples["time_s"].to_numpy(), samples["speed_m_s"].to_numpy(), steady)


def test_the_usual_rest_is_the_99th_percentile_of_the_moving_car():
    """Of 101 rests, one of 9 s, one of 5 s, the others of 3 s and 0 s: the last but one counts."""
    lengths = np.array([1, 10, 6, *[4] * 50, *[1] * 49, 1])
    assert usual_rest(blocks(lengths, 10.0)) == 5.0
    parked = np.where(lengths == 10, 1.0, 10.0)  # the rest of 9 s at a metre a second is none of a moving car
    percentile = 3.0 + (5.0 - 3.0) * (0.99 * 99 - 98)
    assert usual_rest(blocks(lengths, parked)) == pytest.approx(percentile)
    crawling = np.where(lengths == 10, 1.25, 10.0)
    assert usual_rest(blocks(lengths, crawling)) == 5.0


def test_the_usual_rest_needs_ten_changes_and_a_moving_car():
    assert usual_rest(blocks([5] * 10, 10.0)) == 0.0
    assert usual_rest(blocks([5] * 11, 10.0)) == 4.0
    assert usual_rest(blocks([5] * 30, 1.0)) == 0.0


def test_a_freeze_is_five_usual_rests():
    """Blocks of four samples rest for 3 s."""

    def resting(seconds):
        return cuts(blocks([4] * 150 + [seconds + 1] + [4] * 50, 10.0))

    assert resting(14) == []
    assert resting(15) == [Cut(601, 616, "every signal frozen for 15.0 s at 36 km/h")]


def sensor(name, first, last, changes_m_s=3.1, at=None, **options):
    """One frozen signal, while the speed has one other value."""
    samples = lively(**{"n": 1001, "start_s": 500.0, **options})
    samples.loc[first:last, name] = samples.loc[first, name]
    samples.loc[last if at is None else at, "speed_m_s"] += changes_m_s
    return told(frozen_sensor_findings(samples, "t"))


def test_a_frozen_sensor_lasts_a_minute_and_ten_steps():
    words = "battery voltage stays at 389 for 60.0 s while the speed changes"
    assert sensor("voltage_v", 100, 159) == []
    assert sensor("voltage_v", 100, 160) == [(600.0, 660.0, "noted", words)]
    assert sensor("voltage_v", 100, 109, step_s=10.0) == []
    assert [f[:2] for f in sensor("voltage_v", 100, 110, step_s=10.0)] == [(1500.0, 1600.0)]


def test_a_sensor_is_frozen_when_the_speed_changes_by_three_metres_a_second():
    assert sensor("voltage_v", 100, 160, changes_m_s=3.0) == []
    assert len(sensor("voltage_v", 100, 160, changes_m_s=3.1)) == 1
    assert len(sensor("voltage_v", 100, 160, at=100)) == 1
    assert sensor("voltage_v", 100, 160, at=161) == []
    assert sensor("voltage_v", 100, 160, at=99) == []


def test_a_current_frozen_for_more_than_a_tenth_of_the_drive_sets_aside():
    """The drive lasts 1000 s."""
    assert [f[2] for f in sensor("current_a", 100, 200)] == ["noted"]
    assert [f[2] for f in sensor("current_a", 100, 201)] == ["set aside"]
    assert [f[2] for f in sensor("voltage_v", 100, 900)] == ["noted"]


def standing(count, step_s=1.0, speed_m_s=0.0, power_w=20_400.0, first=100):
    samples = lively(step_s=step_s)
    samples.loc[first : first + count - 1, "speed_m_s"] = speed_m_s
    samples.loc[first : first + count - 1, "voltage_v"] = 400.0
    samples.loc[first : first + count - 1, "current_a"] = power_w / 400.0
    return told(frozen_sensor_findings(samples, "t"))


def test_twenty_kilowatts_at_standstill_are_a_frozen_speed():
    words = "the battery delivers 20.4 kW for 10.0 s at standstill: the speed is frozen"
    assert standing(20, 0.5) == []
    assert standing(21, 0.5) == [(50.0, 60.0, "set aside", words)]
    assert standing(9, 2.0) == []
    assert [f[:2] for f in standing(10, 2.0)] == [(200.0, 218.0)]
    assert standing(40, power_w=20_000.0) == []
    assert standing(40, speed_m_s=0.3) == []
    assert len(standing(40, speed_m_s=0.29)) == 1


def jagged(n, low, high):
    return np.where(np.arange(n) % 2, low, high)


def gap(first, last, step_s=1.0, n=200, voltage=(380.0, 384.0), start_s=7.0, uneven=False):
    """Three straight lines from one sample to another, amid jagged signals."""
    number = np.arange(n)
    steps = np.where(number % 3, 1.0, 2.0) * step_s if uneven else np.full(n, step_s)
    time = start_s + np.concatenate(([0.0], np.cumsum(steps[1:])))
    share = (time[first : last + 1] - time[first]) / (time[last] - time[first])
    speed, volts, current = jagged(n, 5.0, 15.0), jagged(n, 380.0, 390.0), jagged(n, -20.0, 60.0)
    speed[first : last + 1] = 6.0 + 8.0 * share
    volts[first : last + 1] = voltage[0] + (voltage[1] - voltage[0]) * share
    current[first : last + 1] = 50.0 - 60.0 * share
    return pd.DataFrame({"time_s": time, "speed_m_s": speed, "voltage_v": volts, "current_a": current})


def gaps(samples):
    return told(filled_gaps(samples, "t"))


def test_a_filled_gap_lasts_ten_seconds_and_ten_triples_of_samples():
    words = "speed, voltage and current are straight lines for 10.0 s: a filled gap"
    assert gaps(gap(50, 69, 0.5)) == []
    assert gaps(gap(50, 70, 0.5)) == [(32.0, 42.0, "set aside", words)]
    assert gaps(gap(50, 60)) == []
    assert [f[:2] for f in gaps(gap(50, 61))] == [(57.0, 68.0)]


def test_lines_are_straight_along_uneven_stamps_too():
    samples = gap(51, 81, uneven=True)
    assert [f[:2] for f in gaps(samples)] == [(samples.time_s[51], samples.time_s[81])]


def test_a_resting_signal_is_a_line_beside_two_that_change():
    samples = gap(50, 80).assign(voltage_v=385.0)
    assert len(gaps(samples)) == 1
    assert gaps(samples.assign(current_a=20.0)) == []


def test_the_shortest_log_with_a_filled_gap_has_twelve_samples():
    assert len(gaps(gap(0, 11, n=12))) == 1
    assert gaps(lively(1)) == []
    assert gaps(gap(50, 80).drop(columns="voltage_v")) == []


@pytest.mark.parametrize(("kink_v", "found"), [(0.045, 1), (0.055, 0)])
def test_a_line_keeps_to_a_two_thousandth_of_the_signal_s_range(kink_v, found):
    """Of 201 values the third from below is 0 and the third from above 100: the range is 100, the tolerance 0.05."""
    samples = gap(50, 68, n=201, voltage=(63.0, 78.0))
    outside = (samples.index < 50) | (samples.index > 68)
    samples.loc[outside, "voltage_v"] = jagged(201, 60.0, 62.0)[outside]
    samples.loc[[2, 20, 10], "voltage_v"] = [-1e4, -5e3, 0.0]
    samples.loc[[6, 16, 26], "voltage_v"] = [100.0, 5e3, 1e4]
    samples["voltage_v"] += 300.0
    samples.loc[59, "voltage_v"] += kink_v  # either half is too short by itself
    assert len(gaps(samples)) == found


def line(n, *values):
    """Lines of as many samples as are left between the edges, edges continued."""
    return [np.interp(np.arange(n), [0, n - 1], ends) for ends in values]


TOLERANCES = [0.01, 0.01, 0.01]


def test_a_tenth_of_a_filled_gap_at_either_end_does_not_count():
    def with_error(n, place):
        signals = line(n, (5.0, 15.0), (380.0, 390.0), (10.0, 20.0))
        signals[1][place] += 1.0
        return are_lines(np.arange(float(n)), signals, TOLERANCES)

    assert [with_error(30, k) for k in (0, 2, 3, 15, 26, 27, 29)] == [
        True,
        True,
        False,
        False,
        False,
        True,
        True,
    ]
    assert [with_error(29, k) for k in (1, 2, 26, 27)] == [True, False, False, True]
    assert [with_error(32, k) for k in (2, 3, 28, 29)] == [True, False, False, True]
    assert [with_error(9, k) for k in (0, 1, 7, 8)] == [True, False, False, True]


def test_two_signals_change_by_more_than_three_tolerances():
    """Eleven samples, of which nine count: a tenth of the change lies at either end."""

    def changes(speed, voltage, current):
        signals = line(
            11, (10.0, 10.0 + 1.25 * speed), (380.0, 380.0 - 1.25 * voltage), (7.0, 7.0 + 1.25 * current)
        )
        return are_lines(np.arange(11.0), signals, [0.5, 0.5, 0.5])

    assert not changes(1.5, 8.0, 0.0)
    assert changes(1.6, 8.0, 0.0)
    assert not changes(8.0, 1.4, 1.4)
    assert changes(8.0, 1.6, 0.0)
    assert changes(8.0, 8.0, 8.0)


def test_a_line_keeps_to_its_chord_within_two_tolerances():
    """Stamps 3 to 13 s; of the nine samples between the edges the chord has eighths."""

    def off(voltage_v):
        signals = line(11, (9.0, 19.0), (379.0, 389.0), (20.0, 10.0))
        signals[1][4] += voltage_v
        return are_lines(3.0 + np.arange(11.0), signals, [0.25, 0.25, 0.25])

    assert off(0.5)
    assert off(-0.5)
    assert not off(0.75)
    assert not off(-0.75)
    uneven = np.array([0.0, 1.0, 2.0, 4.0, 8.0, 9.0, 10.0, 12.0, 13.0, 14.0, 16.0])
    assert are_lines(uneven, [10.0 + uneven, 380.0 - uneven, 5.0 + uneven], [0.25, 0.25, 0.25])
    assert not are_lines(uneven, line(11, (10.0, 26.0), (380.0, 364.0), (5.0, 21.0)), [0.25, 0.25, 0.25])


def test_a_filled_gap_begins_or_ends_on_the_move():
    """Samples 1 and 9 are the first and the last that count."""

    def between(first, last):
        step = (last - first) / 8.0
        signals = [first + step * (np.arange(11.0) - 1.0), *line(11, (-380.0, -390.0), (-10.0, -20.0))]
        return are_lines(np.arange(11.0), signals, TOLERANCES)

    assert between(1.125, 0.0)
    assert between(0.0, 1.125)
    assert not between(1.0, 0.0)
    assert not between(0.0, 1.0)


def stop(first, count, name="current_a", **more):
    samples = lively(100, start_s=40.0)
    samples.loc[first : first + count - 1, name] = np.nan
    return list(sensor_stop_cuts(samples.assign(**more)))


def test_a_sensor_stops_when_more_than_ten_seconds_are_missing():
    words = "no values of battery current for 11.0 s"
    assert stop(30, 9) == []  # 10 s between its neighbours
    assert stop(30, 10) == [Cut(30, 40, words)]
    assert stop(0, 10) == []
    assert stop(0, 11) == [Cut(0, 11, words)]
    assert stop(90, 10) == []
    assert stop(89, 11) == [Cut(89, 100, words)]


def test_the_missing_signals_are_named_and_absent_ones_are_not():
    both = list(sensor_stop_cuts(lively(100).assign(current_a=np.nan)))
    assert both == []
    samples = lively(100)
    samples.loc[20:50, "speed_m_s"] = np.nan
    samples.loc[30:60, "voltage_v"] = np.nan
    assert list(sensor_stop_cuts(samples)) == [Cut(20, 61, "no values of speed, battery voltage for 42.0 s")]


def charged(first, count, fed, current_a=-25.0, speed_m_s=0.0, n=300):
    samples = lively(n)
    samples.loc[first : first + count - 1, "speed_m_s"] = speed_m_s
    samples.loc[first : first + fed - 1, "current_a"] = current_a
    return list(charging_cuts(samples))


def test_a_charger_feeds_a_standing_car_for_more_than_a_minute():
    words = "charged with 25.0 A for 61.0 s at standstill"
    assert charged(100, 150, 60) == []
    assert charged(100, 150, 61) == [Cut(101, 249, words)]
    assert charged(0, 150, 61) == [Cut(0, 149, words)]
    assert charged(150, 150, 61) == [Cut(151, 300, words)]
    assert charged(239, 61, 61) == []  # the last sample lasts no time
    assert charged(100, 150, 61, speed_m_s=0.3) == []
    assert charged(100, 150, 61, speed_m_s=0.29) == [Cut(101, 249, words)]


def test_a_charger_gives_more_than_an_ampere():
    assert charged(100, 150, 90, -1.0) == []
    assert charged(100, 150, 90, -1.5) == [Cut(101, 249, "charged with 1.5 A for 90.0 s at standstill")]


def test_a_charge_between_two_samples_cuts_between_them():
    samples = lively(100).assign(speed_m_s=np.where(np.arange(100) == 50, 0.0, 10.0))
    samples.loc[50, "current_a"] = -30.0
    samples.loc[51:, "time_s"] += 99.0
    assert list(charging_cuts(samples)) == [Cut(51, 51, "charged with 30.0 A for 100.0 s at standstill")]


def heater(values, span_s=599.0, requested=None):
    """What a heater is stuck at, of samples that are evenly spread over a time."""
    samples = pd.DataFrame(
        {
            "time_s": 100.0 + np.linspace(0.0, span_s, len(values)),
            "heating_power_w": np.array(values, dtype=float),
        }
    )
    if requested is not None:
        samples["requested_heating_power_w"] = requested
    return stuck_level(samples, samples["heating_power_w"].to_numpy(), [])


def test_a_heater_is_stuck_at_nine_tenths_of_ten_samples_from_50_watts():
    """Under a request that is more than half of its power away."""
    away = {"requested": 9000.0}
    assert heater([50.0] * 9 + [60.0], **away) == (50.0, 0.9)
    assert heater([49.0] * 9 + [60.0], **away) is None
    assert heater([50.0] * 9 + [60.0, 60.0], **away) is None
    assert heater([50.0] * 9, **away) is None
    assert heater([50.0] * 9 + [np.nan], **away) is None
    assert heater([50.0] * 9 + [np.nan, 60.0], **away) == (50.0, 0.9)


def test_a_heater_that_holds_what_was_requested_works():
    """Half of 1000 W is the most it may be away."""
    held = [1000.0] * 10
    assert heater(held, requested=1000.0) is None
    assert heater(held, requested=500.0) is None
    assert heater(held, requested=499.0) == (1000.0, 1.0)
    assert heater(held, requested=1500.0) is None
    assert heater(held, requested=1501.0) == (1000.0, 1.0)
    assert heater(held, requested=[1501.0] * 6 + [1000.0] * 3 + [np.nan]) == (1000.0, 1.0)


def test_a_heater_below_its_highest_power_is_stuck_after_ten_minutes():
    below = [1000.0] * 19 + [1200.0]
    assert heater(below, 599.0) is None
    assert heater(below, 600.0) == (1000.0, 0.95)
    assert heater([1000.0] * 20, 6000.0) is None
    assert heater([1000.0] * 19 + [800.0], 6000.0) is None


def test_pulses_stand_three_kilowatts_above_their_neighbours():
    def pulses(*values, step_s=1.0):
        return short_pulses(step_s * np.arange(len(values)), np.array(values, dtype=float))

    assert pulses(100, 3100, 100) == []
    assert pulses(100, 3101, 100) == [(1, 2)]
    assert pulses(100, 3101, 850) == [(1, 2)]  # a quarter of the pulse may stay
    assert pulses(100, 3101, 851) == []
    assert pulses(0, 1501, 3100, 0) == [(1, 3)]  # half of it in one step
    assert pulses(0, 1500, 3100, 0) == []
    assert pulses(0, 1600, 4700, 0) == [(1, 3)]
    assert pulses(0, 4000, 0, 4000, 0, 4000, 0) == [(1, 2), (3, 4), (5, 6)]


def test_pulses_fall_within_three_seconds():
    time, pulse = np.arange(6.0), np.full(6, 5000.0)
    pulse[[0, 4, 5]] = 0.0
    assert short_pulses(time, pulse) == [(1, 4)]
    pulse[4] = 5000.0
    assert short_pulses(time, pulse) == []


def heated(*pulses, name="heating_power_w"):
    samples = lively(100, start_s=20.0)
    values = 1000.0 + np.arange(100.0)
    values[list(pulses)] += 4000.0
    return samples.assign(**{name: values})


@pytest.mark.parametrize("name", ["heating_power_w", "requested_heating_power_w"])
def test_three_pulses_are_codes(name):
    two = heated(10, 30, name=name)
    kept, found = blank_stuck_heater(two, "t")
    assert kept.equals(two)
    assert found == []
    mended, (finding,) = blank_stuck_heater(heated(10, 30, 50, name=name), "t")
    assert np.flatnonzero(mended[name].isna()).tolist() == [10, 30, 50]
    assert (finding.from_s, finding.to_s, finding.consequence) == (30.0, 70.0, "noted")
    assert "by more than 3000 W 3 times" in finding.what


def test_only_the_heating_power_can_be_stuck():
    request = lively(800).assign(requested_heating_power_w=np.where(np.arange(800) == 5, 1300.0, 1200.0))
    assert blank_stuck_heater(request, "t")[1] == []
    power = request.rename(columns={"requested_heating_power_w": "heating_power_w"})
    mended, (finding,) = blank_stuck_heater(power, "t")
    assert finding.what == "heating power stays at 1200 W in 100 % of the samples: all its values are removed"
    assert (finding.from_s, finding.to_s) == (0.0, 799.0)
    assert mended["heating_power_w"].isna().all()


def samples_of(n=200, start_s=10.0, **columns):
    return pd.DataFrame(
        {
            "time_s": start_s + np.arange(n),
            "speed_m_s": 10.0,
            "voltage_v": 380.0,
            "current_a": 20.0,
            **columns,
        }
    )


def test_missing_columns_set_aside_without_a_measured_energy():
    full = samples_of(elevation_m=5.0, ambient_temperature_degc=9.0)
    assert list(missing_columns(full, "t")) == []
    no_current = full.drop(columns="current_a")
    assert [f.consequence for f in missing_columns(no_current, "t")] == ["set aside"]
    counted = no_current.assign(observed_energy_wh=1.0)
    assert [f.consequence for f in missing_columns(counted, "t")] == ["noted"]
    assert list(missing_columns(full.assign(observed_energy_wh=1.0), "t")) == []
    assert [f.consequence for f in missing_columns(counted.assign(speed_m_s=NO), "t")] == ["set aside"]
    by_grade = full.drop(columns="elevation_m").assign(grade=0.0)
    assert list(missing_columns(by_grade, "t")) == []
    assert [f.what[:22] for f in missing_columns(by_grade.drop(columns="grade"), "t")] == [
        "no values of elevation"
    ]
    (cold,) = missing_columns(full.drop(columns="ambient_temperature_degc"), "t")
    assert cold.what.startswith("no values of outside temperature")


def test_infinite_values_are_blank():
    samples = samples_of(4, voltage_v=[380.0, np.inf, -np.inf, 381.0], remark=[np.inf] * 4)
    mended, (finding,) = blank_infinite(samples, "t")
    assert mended["voltage_v"].isna().tolist() == [False, True, True, False]
    assert finding.what == "battery voltage is infinite in 2 samples: these values are removed"
    assert blank_infinite(samples_of(4), "t")[1] == []


def changed(name, values, n=200, **columns):
    samples = samples_of(n, **columns)
    samples.loc[50 : 49 + len(values), name] = values
    return blank_impossible(samples, "t")


def test_an_impossible_hundredth_is_stray_and_more_is_another_thing():
    """Two of 200 samples are a hundredth."""
    mended, findings = changed("voltage_v", [10.0, 20.0])
    assert told(findings) == [
        (60.0, 61.0, "noted", "battery voltage of 10 to 20 V in 2 samples is impossible")
    ]
    assert np.flatnonzero(mended["voltage_v"].isna()).tolist() == [50, 51]
    mended, findings = changed("voltage_v", [10.0] * 3)
    assert told(findings) == [(60.0, 62.0, "set aside", "battery voltage of 10 V in 3 samples is impossible")]
    assert int(mended["voltage_v"].isna().sum()) == 3


def test_many_impossible_values_of_another_column_are_noted():
    _, findings = changed("elevation_m", [9001.0] * 30, elevation_m=5.0)
    assert [f.consequence for f in findings] == ["noted"]
    mended, findings = changed("soc", [50.0] * 30, soc=0.5)
    assert findings[0].what.endswith(": the unit appears to be percent; convert it to a fraction")
    assert mended["soc"].isna().all()  # the other values have the wrong unit too


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("voltage_v", 30.0, 1200.0),
        ("heating_power_w", -500.0, 12_000.0),
        ("requested_heating_power_w", -500.0, 12_000.0),
        ("aircon_power_w", -500.0, 30_000.0),
    ],
)
def test_values_at_the_bounds_are_possible(name, low, high):
    """A heater of more than 12 kW is none; an air conditioner has the bounds of its column."""
    usual = {name: 300.0}
    for value, bad in ((low, 0), (low - 1.0, 1), (high, 0), (high + 1.0, 1)):
        assert len(changed(name, [value], **usual)[1]) == bad


def test_slow_negative_speeds_are_reversing():
    mended, findings = changed("speed_m_s", [0.0, -5.0, -10.0], speed_m_s=3.0)
    assert told(findings) == [(61.0, 62.0, "noted", "2 samples of negative speed are treated as reversing")]
    assert mended["speed_m_s"][49:54].tolist() == [3.0, 0.0, 5.0, 10.0, 3.0]
    mended, findings = changed("speed_m_s", [-10.5], speed_m_s=3.0)
    assert [f.what for f in findings] == ["speed of -10.5 m/s in 1 samples is impossible"]
    assert np.isnan(mended["speed_m_s"][50])


def spiky(values, step_s=1.0):
    speed = np.array(values, dtype=float)
    return np.flatnonzero(speed_spikes(step_s * np.arange(len(speed)), speed)).tolist()


def test_a_spike_is_eight_metres_a_second_from_both_neighbours_within_two_seconds():
    assert spiky([10.0, 18.0, 10.0]) == []
    assert spiky([10.0, 18.5, 10.0]) == [1]
    assert spiky([10.0, 18.5, 11.0]) == []
    assert spiky([10.0, 18.5, 9.0]) == [1]
    assert spiky([20.0, 11.0, 20.0]) == [1]
    assert spiky([0.0, 9.0, 18.5, 9.0]) == [2]
    assert spiky([0.0, 20.0, 40.0]) == []
    assert spiky([10.0, 30.0, 10.0], 1.25) == []
    assert spiky([10.0, 30.0]) == []
    assert spiky([10.0, 10.0, 10.0, 30.0, 10.0, 10.0, 1.0]) == [3]


@pytest.mark.parametrize(
    ("name", "inside", "outside", "unit"),
    [
        ("cabin_temperature_degc", (213.0, 343.0), (212.0, 344.0), "K"),
        ("ambient_temperature_degc", (58.0, 134.6), (57.0, 135.0), "°F"),
        ("soc", (1.5, 100.0), (1.0, 101.0), "percent"),
        ("displayed_soc", (1.5, 100.0), (1.0, 101.0), "percent"),
        ("voltage_v", (9.0, 16.0), (8.0, 17.0), "12 V"),
        ("voltage_v", (30_000.0, 1_200_000.0), (29_999.0, 1_200_001.0), "mV"),
        ("current_a", (3001.0, -3001.0), (3000.0, -3000.0), "mA"),
        ("speed_m_s", (91.0, 300.0), (90.0, 10.0), "km/h"),
    ],
)
def test_a_unit_is_guessed_from_the_middle_or_the_largest_value(name, inside, outside, unit):
    """Temperatures of -60 to 70 °C in K; up to 57 °C, the highest on record, in °F; a car's 12 V grid has 9 to 16 V."""
    assert all(unit in guessed_unit(name, np.array([value, NO])) for value in inside)
    assert all(guessed_unit(name, np.array([value, NO])) == "" for value in outside)


def test_a_guess_needs_the_column_and_the_value():
    assert guessed_unit("elevation_m", np.array([300.0])) == ""
    assert guessed_unit("cabin_temperature_degc", np.array([100.0])) == ""
    assert guessed_unit("voltage_v", np.array([1.0, 12.0, 900.0])) != ""


def test_air_is_never_hotter_than_57_degrees_in_the_mean():
    samples = samples_of(4, ambient_temperature_degc=[50.0, 64.0, NO, 57.0])
    assert blank_fahrenheit(samples, "t")[1] == []
    mended, (finding,) = blank_fahrenheit(
        samples.assign(ambient_temperature_degc=[51.0, 64.0, NO, 57.0]), "t"
    )
    assert mended["ambient_temperature_degc"].isna().all()
    assert finding.what.startswith("mean outside temperature of 57.3 °C is impossible")
    assert blank_fahrenheit(samples.drop(columns="ambient_temperature_degc"), "t")[1] == []


def test_samples_without_a_speed_are_left_out():
    samples = samples_of(4, speed_m_s=[1.0, NO, 3.0, NO])
    assert drop_blank_speed(samples)["time_s"].tolist() == [10.0, 12.0]
    assert drop_blank_speed(samples_of(4))["time_s"].tolist() == [10.0, 11.0, 12.0, 13.0]


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
