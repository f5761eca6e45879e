"""How warm a car is at departure."""

import pytest

from tripwatt.physics import conditions_at_departure
from tripwatt.physics.conditions import warmth_from_cabin
from tripwatt.trips import Departure
from tripwatt.vehicles import load_vehicle


class TestDeparture:
    """The i3's cabin sensor shows nothing below 10 °C; its usual set-point is 22 °C."""

    car = load_vehicle("bmw_i3_60ah")

    def test_cabin(self) -> None:
        assert self.car.climate is not None
        assert self.car.climate.sensor_minimum_degc == 10.0

        def cabin(reading: float | None, ambient: float, *, logged: bool) -> float | None:
            known = Departure(
                ambient_temperature_degc=ambient, cabin_temperature_degc=reading, cabin_logged=logged
            )
            return conditions_at_departure(self.car, known).initial_cabin_temperature_degc

        for logged in (False, True):
            assert cabin(10.1, 3.0, logged=logged) == 10.1
            assert cabin(None, 3.0, logged=logged) == 3.0
        assert cabin(10.0, 3.0, logged=True) == 3.0
        assert cabin(9.0, 15.0, logged=True) == 9.0
        assert cabin(10.0, 3.0, logged=False) == 10.0
        assert cabin(-5.0, 3.0, logged=False) == -5.0

    def test_warmth(self) -> None:
        """The excess over the air outside, over that at the set-point or 5 K; from 10 to 14 °C outside it fades."""
        assert warmth_from_cabin(self.car, 17.0, 22.0, 2.0) == pytest.approx(0.75)
        assert warmth_from_cabin(self.car, 30.0, 22.0, 2.0) == 1.0
        assert warmth_from_cabin(self.car, 10.1, 22.0, 11.9) == 0.0
        assert warmth_from_cabin(self.car, 17.0, None, 2.0) == pytest.approx(
            15.0 / (self.car.climate.setpoint_degc - 2.0)
        )
        assert warmth_from_cabin(self.car, 20.0, 22.0, 14.0) == 0.0
        assert warmth_from_cabin(self.car, 20.0, 22.0, 11.0) == pytest.approx(0.75 * 9.0 / 11.0)
        assert warmth_from_cabin(self.car, 20.0, 22.0, 10.0) == pytest.approx(10.0 / 12.0)
        assert warmth_from_cabin(self.car, 10.0, 22.0, -8.0) == pytest.approx(18.0 / 30.0)
        assert warmth_from_cabin(self.car, 8.0, 5.0, 5.0) == pytest.approx(3.0 / 5.0)
        assert warmth_from_cabin(self.car, None, 22.0, 2.0) == 0.0
