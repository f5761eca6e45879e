"""Exported curves: the units and limits of each service, and physics that they must agree with."""

import numpy as np
import pytest
from tests.support.refusals import refuses

from tripwatt.export import EXPORTS, consumption_curve, export_curve, render_query
from tripwatt.physics import simulate
from tripwatt.trips import Departure
from tripwatt.units import GRAVITY_M_S2
from tripwatt.vehicles import load_vehicle

CAR = load_vehicle("bmw_i3_60ah")
MILD = Departure(ambient_temperature_degc=20.0)


@pytest.fixture(scope="module")
def mild():
    return consumption_curve(CAR, MILD)


@pytest.fixture(scope="module")
def cold():
    return consumption_curve(CAR, Departure(ambient_temperature_degc=-10.0))


def table(text, between, inside):
    return np.array([[float(x) for x in pair.split(inside)] for pair in text.split(between)])


def test_curve_is_the_simulated_energy(mild):
    speed = 90.0 / 3.6
    time = np.arange(0.0, 801.0)
    run = simulate(CAR, time, np.full(801, speed))
    whole = mild.energy_wh_km[8] * speed * 0.8 + mild.auxiliary_power_w * 800 / 3600
    assert mild.speed_km_h[8] == 90
    assert whole == pytest.approx(run.simulated_energy_wh, rel=0.01)


def test_cold_costs_and_stops_cost(mild, cold):
    n = min(len(mild.energy_wh_km), len(cold.energy_wh_km))
    assert np.all(cold.energy_wh_km[:n] > mild.energy_wh_km[:n])
    assert cold.auxiliary_power_w > mild.auxiliary_power_w + 1000.0
    assert np.all(mild.traffic_energy_wh_km > mild.energy_wh_km)


def test_no_perpetual_motion(mild, cold):
    for curve in (mild, cold):
        lift = curve.mass_kg * GRAVITY_M_S2 / 3600.0
        assert curve.ascent_wh_m > lift
        assert 0.3 * lift < curve.descent_wh_m < curve.ascent_wh_m
        assert curve.uphill_efficiency * curve.downhill_efficiency < 1.0
        assert curve.acceleration_efficiency * curve.deceleration_efficiency < 1.0
        assert 0.5 < curve.acceleration_efficiency < 1.0


def test_the_same_car_in_every_service(mild):
    here, tomtom, mapbox, abrp = (EXPORTS[s](mild) for s in ("here", "tomtom", "mapbox", "abrp"))
    flat = np.array(here["ev[freeFlowSpeedTable]"].split(","), dtype=float).reshape(-1, 2)
    hundred = table(tomtom["constantSpeedConsumptionInkWhPerHundredkm"], ":", ",")
    kilometre = table(mapbox["energy_consumption_curve"], ";", ",")
    np.testing.assert_array_equal(flat[:, 0], mild.speed_km_h)
    np.testing.assert_allclose(flat[:, 1] * 1000.0, kilometre[:, 1], atol=0.6)
    np.testing.assert_allclose(hundred[:, 1] * 10.0, kilometre[: len(hundred), 1], atol=0.6)
    watts = float(mapbox["auxiliary_consumption"])
    assert float(here["ev[auxiliaryConsumption]"]) * 3600.0 == pytest.approx(watts, rel=0.01)
    assert float(tomtom["auxiliaryPowerInkW"]) * 1000.0 == pytest.approx(watts, rel=0.01)
    at_110 = float(np.interp(110, mild.speed_km_h, mild.energy_wh_km))
    assert at_110 < float(abrp["ref_consumption"]) < at_110 + watts / 110.0 * 1.5 + 1.0


def test_limits_of_tomtom(mild, cold):
    for curve in (mild, cold):
        said = EXPORTS["tomtom"](curve)
        points = table(said["constantSpeedConsumptionInkWhPerHundredkm"], ":", ",")
        assert 1 <= len(points) <= 25
        assert len(set(points[:, 0])) == len(points)
        assert np.all((points[:, 0] >= 0) & (points[:, 0] <= 255))
        assert np.all((points[:, 1] >= 0.01) & (points[:, 1] <= 100_000))
        assert points[-1, 1] >= points[-2, 1]
        assert float(said["uphillEfficiency"]) * float(said["downhillEfficiency"]) <= 1.0
        assert float(said["accelerationEfficiency"]) * float(said["decelerationEfficiency"]) <= 1.0
        # extrapolated to standstill it stays positive
        slope = (points[1, 1] - points[0, 1]) / (points[1, 0] - points[0, 0])
        assert points[0, 1] - slope * points[0, 0] > 0.0


def test_correction_and_payload_count(mild):
    more = consumption_curve(
        CAR, MILD, correction=lambda trip: 10.0 * trip.distance_m / 1000.0 + trip.duration_s / 36.0
    )

    def whole(curve):
        return curve.energy_wh_km + curve.auxiliary_power_w / curve.speed_km_h

    np.testing.assert_allclose(whole(more) - whole(mild), 10.0 + 100.0 / mild.speed_km_h, atol=1e-6)
    assert more.auxiliary_power_w - mild.auxiliary_power_w == pytest.approx(200.0)  # as at 10 km/h
    assert more.energy_wh_km[0] == pytest.approx(mild.energy_wh_km[0])
    assert more.reference_wh_km - mild.reference_wh_km == pytest.approx(10.0 + 100.0 / 110.0)
    assert more.ascent_wh_m == mild.ascent_wh_m
    assert more.deceleration_efficiency == mild.deceleration_efficiency
    heavy = consumption_curve(CAR, Departure(payload_mass_kg=300.0))
    assert heavy.mass_kg == mild.mass_kg + 300.0
    assert np.all(heavy.energy_wh_km > mild.energy_wh_km)


def test_slow_cars_end_where_they_end():
    weak = load_vehicle("bmw_i3_60ah", overrides={"drivetrain.motor_max_power_w": 20_000.0})
    curve = consumption_curve(weak)
    assert 60 <= curve.speed_km_h[-1] <= 110
    assert np.all(np.diff(curve.energy_wh_km[4:]) > 0)


def test_faults():
    refuses("here, tomtom, mapbox, abrp", export_curve, CAR, "waze")
    refuses("the battery is empty for 30 min", consumption_curve, CAR, Departure(bms_soc=0.01))
    refuses("ambient_temperature_degc", Departure, ambient_temperature_degc=200.0)


def test_query_is_escaped():
    assert render_query({"a b": "1&2"}) == "a%20b=1%262"
