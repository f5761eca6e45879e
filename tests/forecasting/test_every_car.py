"""Laws of a forecast that hold for every car of the library, with the packaged model."""

import dataclasses

import pytest
from tests.support.cars import some_cars

import tripwatt as tw
from tripwatt.trips import Departure

LINKS = [
    {"length_m": 600.0, "speed_m_s": 8.0, "stop_s": 20.0},
    {"length_m": 9000.0, "speed_m_s": 25.0, "grade": 0.01},
    {"length_m": 3000.0, "speed_m_s": 14.0, "grade": -0.02},
]
KNOWN = Departure(
    soc=0.4,
    ambient_temperature_degc=8.0,
    battery_temperature_degc=8.0,
    cabin_temperature_degc=10.0,
    cabin_setpoint_degc=21.0,
)


@pytest.fixture(scope="module", params=some_cars())
def forecast(request):
    return tw.forecast(tw.read_route(LINKS), car=request.param, departure=KNOWN)


def test_probability_to_arrive_is_that_of_the_quantiles(forecast):
    for level in (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95):
        reserve = forecast.arrival.quantile(1.0 - level)
        assert forecast.p_arrive(reserve) == pytest.approx(level, abs=1e-9)
    # what the trip takes at a quantile is less uncertain than the charge that it leaves
    left = 0.4 - forecast.quantile(0.9) / forecast.charge.wh_per_display
    assert 0.5 < forecast.p_arrive(left) < 0.9
    assert forecast.p_arrive(forecast.soc_arrival) == pytest.approx(0.5, abs=1e-9)


def test_series_starts_at_the_departure_and_ends_at_the_totals(forecast):
    series = forecast.to_frame()
    first, last = series.iloc[0], series.iloc[-1]
    low, high = forecast.interval(0.9)
    assert (
        first[["time_s", "distance_m", "energy_wh", "energy_low_wh", "energy_high_wh"]].tolist() == [0.0] * 5
    )
    assert first["displayed_soc"] == pytest.approx(0.4, abs=1e-6)
    assert last["energy_wh"] == pytest.approx(forecast.energy_wh, rel=1e-12)
    assert (last["energy_low_wh"], last["energy_high_wh"]) == pytest.approx((low, high), rel=1e-9)
    assert last["displayed_soc"] == pytest.approx(forecast.soc_arrival, rel=1e-9)
    assert last["displayed_soc_low"] < last["displayed_soc"] < last["displayed_soc_high"]
    assert last["time_s"] == pytest.approx(forecast.plan.duration_s, abs=1.0)
    assert last["distance_m"] == pytest.approx(12_600.0, rel=0.01)
    assert sum(forecast.by_cause_wh.values()) == pytest.approx(forecast.energy_wh, rel=1e-9)


def test_quantiles_and_levels_agree(forecast):
    for level in (0.5, 0.8, 0.9, 0.95):
        low, high = forecast.interval(level)
        assert forecast.quantile(0.5 - level / 2) == pytest.approx(low, rel=1e-12)
        assert forecast.quantile(0.5 + level / 2) == pytest.approx(high, rel=1e-12)
        assert forecast.probability_below(high) == pytest.approx(0.5 + level / 2, abs=1e-9)
    assert forecast.to_dict()["quantiles_wh"]["0.5"] == pytest.approx(forecast.energy_wh, rel=1e-12)


ASSUMED_DEGC = {
    "ambient_temperature_degc": 10.0,
    "battery_temperature_degc": KNOWN.ambient_temperature_degc,
    "cabin_temperature_degc": KNOWN.ambient_temperature_degc,
    "cabin_setpoint_degc": 22.0,
}


@pytest.mark.parametrize(
    ("unknown", "flag"),
    [
        ("soc", ("soc_assumed", "soc")),
        ("ambient_temperature_degc", ("usual_value_assumed", "ambient_temperature_degc")),
        ("battery_temperature_degc", ("usual_value_assumed", "battery_temperature_degc")),
        ("cabin_temperature_degc", ("usual_value_assumed", "cabin_temperature_degc")),
        ("cabin_setpoint_degc", ("usual_value_assumed", "cabin_setpoint_degc")),
    ],
)
def test_each_thing_that_is_unknown_has_its_flag(unknown, flag):
    whole = {(f.code, f.subject) for f in tw.forecast(tw.read_route(LINKS), departure=KNOWN).flags}
    part = dataclasses.replace(KNOWN, **{unknown: None})
    forecast = tw.forecast(tw.read_route(LINKS), departure=part)
    found = {(f.code, f.subject) for f in forecast.flags}
    assert flag in found - whole
    assert {f.value for f in forecast.flags if f.code == "usual_value_assumed"} <= {ASSUMED_DEGC.get(unknown)}
    assert ("unknown_climb", "unknown") not in found
    flat = [{name: value for name, value in link.items() if name != "grade"} for link in LINKS]
    assert ("unknown_climb", "unknown") in {
        (f.code, f.subject) for f in tw.forecast(tw.read_route(flat), departure=KNOWN).flags
    }
