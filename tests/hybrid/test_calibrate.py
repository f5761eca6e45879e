"""Calibration finds a car's values on its trips and stays with the book where they say nothing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize
from tests.hybrid.tables import EXACT, table

from tripwatt.errors import InvalidInput
from tripwatt.hybrid import calibrate as room
from tripwatt.hybrid.calibrate import calibrate, most_probable
from tripwatt.hybrid.parameters import Parameter, changed, parameters
from tripwatt.physics import simulate_trip
from tripwatt.study.synthetic import synthetic_fleet
from tripwatt.trips import Trip
from tripwatt.vehicles import load_vehicle


def driven_by(car, trips: tuple[Trip, ...], noise_wh: float) -> list[Trip]:
    """The same drives with the energy that another car takes, and an error of each trip."""
    rng = np.random.default_rng(0)
    made = []
    for trip in trips:
        run = simulate_trip(car, trip)
        power = run.battery_power_w + rng.normal(0.0, noise_wh) * 3600.0 / trip.duration_s
        samples = trip.samples.assign(voltage_v=360.0, current_a=power / 360.0)
        made.append(replace(trip, samples=samples, observed_energy_wh=float(run.simulated_energy_wh)))
    return made


def test_known_changes_are_found_and_the_rest_stays_with_the_book():
    book = load_vehicle("bmw_i3_60ah")
    truth = changed(book, {"base_load": 0.3, "air": -0.15})
    trips = driven_by(truth, synthetic_fleet(40, seed=3).trips, 5.0)
    found = calibrate(trips, book)
    assert found.changes["base_load"] == pytest.approx(0.3, abs=0.08)
    assert found.changes["air"] == pytest.approx(-0.15, abs=0.07)
    assert abs(found.changes["mass"]) < 0.03
    for parameter in parameters():
        assert 0.0 < found.sd[parameter.name] < parameter.width
    car = found.applied(book)
    errors = [
        np.mean([abs(simulate_trip(c, t).simulated_energy_wh - t.observed_energy_wh) for t in trips])
        for c in (book, car)
    ]
    assert errors[1] < 0.4 * errors[0]
    assert "calibrated on 40 trips" in car.entries["auxiliaries.base_load_w"].source


def test_too_few_and_silent_trips_are_named_together():
    trips = synthetic_fleet(2).trips
    silent = replace(trips[1], samples=trips[1].samples.drop(columns=["voltage_v"]), observed_energy_wh=None)
    with pytest.raises(InvalidInput) as error:
        calibrate([trips[0], silent], load_vehicle("bmw_i3_60ah"))
    assert "too few trips" in str(error.value)
    assert silent.trip_id in str(error.value)


def test_a_few_trips_cannot_be_sure_of_six_values():
    book = load_vehicle("bmw_i3_60ah")
    found = calibrate(synthetic_fleet(3).trips, book)
    for parameter in parameters():
        assert found.sd[parameter.name] > 0.2 * parameter.width


def test_calibration_is_the_mode_of_the_errors_t_distribution():
    rng = np.random.default_rng(7)
    X = rng.normal(0.0, 400.0, (12, 2))
    width, usual_wh = np.array([0.3, 0.1]), 60.0
    residual = X @ np.array([0.25, -0.05]) + rng.normal(0.0, 50.0, 12)
    residual[3] += 900.0  # one trip on a stormy day

    def cost(values: np.ndarray) -> float:
        mean, scale2 = values[:2], np.exp(values[2])
        left = residual - X @ mean
        trips = 2.5 * np.log1p(left**2 / (4.0 * scale2)).sum() + 6.0 * np.log(scale2)
        usual = 2.0 * np.log(scale2) + 2.0 * usual_wh**2 / scale2
        return float(trips + usual + 0.5 * np.sum((mean / width) ** 2))

    best = minimize(cost, [0.0, 0.0, 8.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-11})
    mean, covariance = most_probable(X, residual, width, usual_wh)
    assert mean == pytest.approx(best.x[:2], rel=2e-3)
    # the outlier weighs (4 + 1) / (4 + r^2 / s^2), the others about 5 / 4 at most
    left = residual - X @ mean
    weight = 5.0 / (4.0 + left**2 / np.exp(best.x[2]))
    assert weight[3] < 0.1
    precision = (X.T * weight) @ X / np.exp(best.x[2]) + np.diag(1.0 / width**2)
    np.testing.assert_allclose(covariance, np.linalg.inv(precision), rtol=0.02)


class TestCalibration:
    def test_the_usual_error_is_five_percent_of_the_usual_trip(self, monkeypatch) -> None:
        """Trips of 1, 3 and 8 kWh: 150 Wh."""
        seen = {}

        def solved(X, residual, width, usual_wh):
            seen.update(X=X, residual=residual, width=width, usual_wh=usual_wh)
            return np.array([0.1, -0.2]), np.diag([0.04, 0.09])

        trips = [SimpleNamespace(trip_id=f"t{i}", observed_energy_wh=1.0) for i in range(3)]
        simulated, observed = [1000.0, 6000.0, -4000.0], [1100.0, 6000.0, -4000.0]
        own = table([1, 1, 1], [1.0, 0.5, 2.0], simulated=simulated, observed=observed)
        two = tuple(Parameter(name, width, "", (), ("climate",)) for name, width in (("a", 0.3), ("b", 0.1)))
        monkeypatch.setattr(room, "parameters", lambda: two)
        monkeypatch.setattr(room.Plan, "from_trip", lambda trip: trip)
        monkeypatch.setattr(room, "segment_trips", lambda trips, car: own)
        slopes = np.array([[10.0, 1.0], [20.0, 2.0], [30.0, 3.0]])
        monkeypatch.setattr(room, "sensitivities", lambda *_: slopes)
        monkeypatch.setattr(room, "most_probable", solved)
        found = calibrate(trips, None)
        assert seen["usual_wh"] == pytest.approx(150.0, **EXACT)
        assert seen["X"] == pytest.approx(np.array([[10.0, 1.0], [10.0, 1.0], [60.0, 6.0]]), **EXACT)
        assert seen["residual"].tolist() == [100.0, 0.0, 0.0]
        assert seen["width"].tolist() == [0.3, 0.1]
        assert found.changes == {"a": 0.1, "b": -0.2}
        assert found.sd == pytest.approx({"a": 0.2, "b": 0.3})
        assert str(found) == "calibrated on 3 trips: a +10% (± 20%), b -20% (± 30%)"
        with pytest.raises(InvalidInput, match=r"too few trips.*got 2; allowed: at least 3"):
            calibrate(trips[:2], None)

    def test_one_trip_and_one_value(self) -> None:
        """The fixed point: weight 5 / (4 + r²/s²), and a scale of the trip and of four that err by 150 Wh."""
        mean, covariance = most_probable(np.array([[1000.0]]), np.array([400.0]), np.array([0.3]), 150.0)
        left = 400.0 - 1000.0 * mean[0]
        scale2 = 150.0**2
        for _ in range(500):
            scale2 = (left**2 * 5.0 / (4.0 + left**2 / scale2) + 4.0 * 150.0**2) / 5.0
        weight = 5.0 / (4.0 + left**2 / scale2)
        precision = weight * 1000.0**2 / scale2 + 1.0 / 0.3**2
        assert covariance[0, 0] == pytest.approx(1.0 / precision, rel=1e-6)
        assert mean[0] == pytest.approx(weight * 1000.0 * 400.0 / scale2 / precision, rel=1e-6)
