"""The conversion between energy and displayed state of charge, with its errors.

The car computes the displayed state of charge from a window of the battery management's state of charge, rounded and
smoothed. If logs have the readings, the window, the energy of the whole display and their errors are fitted to the logs.
Otherwise they come from the car's published values, with usual errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.vehicles.parts import Battery

CAPACITY_SD: Final = 0.03
"""Relative standard deviation of the energy per state of charge, by ageing and temperature."""
PUBLISHED_DISPLAY_SD: Final = 0.01
"""Scale of the error of a displayed charge if no logs have it: displays step by 0.5 to 1 %, and lag behind."""
PUBLISHED_MANAGED_SD: Final = 0.03
"""The same for a display computed from the battery management's charge by a published window. A tenth of the battery is held in
reserve, and how much of it lies at either end is not published: 0.1 / sqrt(12)."""
NORMAL_SCALE: Final = 0.7716
"""Scale of a t distribution with 4 degrees of freedom, assumed for all errors, over the standard deviation of a normal
distribution with the same central 90 %: 1.6449 / 2.1318."""
FULL: Final = 0.995
"""A display of this or more is full: further charge does not show."""
NEARLY_FULL: Final = 0.985
"""Between this display and `FULL` the hidden charge rises linearly, so that the charge to leave with has no jump."""


@dataclass(frozen=True, slots=True)
class ChargeScale:
    """Conversion between displayed state of charge, energy and the battery management's state of charge of one car.

    Attributes
    ----------
    zero_soc, full_soc : float
        State of charge of the battery management when the display shows 0 and 1.
    wh_per_display : float
        Energy at the terminals from a display of 1 to one of 0 [Wh].
    displayed_sd : float
        Scale of the error of the displayed charge at arrival, if the energy and the display at departure are known [1].
    managed_sd : float
        The same if the battery management's charge at departure is known instead of the display [1].
    trips : int
        Number of trips that the values were fitted to; 0 for published values.
    hidden : float
        Charge that a battery with a full display gives before the display falls, in units of the display [1].

    Examples
    --------
    >>> scale = ChargeScale(0.1, 0.9, 16000.0, 0.01, 0.02)
    >>> round(scale.displayed(0.5), 3), scale.left(0.8, 4000.0), float(scale.sd(4000.0, True).round(4))
    (0.5, 0.55, 0.0125)
    >>> round(ChargeScale(0.1, 0.9, 16000.0, 0.01, 0.02, hidden=0.02).left(1.0, 4000.0), 3)
    0.77
    """

    zero_soc: float
    full_soc: float
    wh_per_display: float
    displayed_sd: float
    managed_sd: float
    trips: int = 0
    hidden: float = 0.0

    def displayed(self, soc: Any) -> Any:
        """Convert the battery management's state of charge to the displayed one.

        Parameters
        ----------
        soc : float or ndarray
            State of charge of the battery management, 0 to 1.

        Returns
        -------
        float or ndarray
            Displayed state of charge, shape of `soc`; not clipped to 0 to 1.
        """
        return (soc - self.zero_soc) / (self.full_soc - self.zero_soc)

    def left(self, start: float, energy_wh: Any, from_display: bool = True) -> Any:
        """Compute the displayed charge after an energy was taken from the battery.

        If a full display was read, its hidden charge is taken first, so the result may lie above 1.

        Parameters
        ----------
        start : float
            Displayed state of charge before, 0 to 1.
        energy_wh : float or ndarray
            Energy taken at the terminals [Wh].
        from_display : bool
            Whether `start` was read from the display, not converted from the battery management's charge.

        Returns
        -------
        float or ndarray
            Displayed state of charge, shape of `energy_wh`; below 0 if the charge does not last.
        """
        shown = min(max((start - NEARLY_FULL) / (FULL - NEARLY_FULL), 0.0), 1.0) if from_display else 0.0
        return start + self.hidden * shown - energy_wh / self.wh_per_display

    def sd(self, energy_wh: Any, from_display: bool) -> Any:
        """Compute the scale of the error of `left`, without the error of the energy.

        The error has two sources: reading or conversion of the charge, and the capacity.

        Parameters
        ----------
        energy_wh : float or ndarray
            Energy taken at the terminals [Wh].
        from_display : bool
            Whether the charge before was read from the display, not converted from the battery management's charge.

        Returns
        -------
        float or ndarray
            Scale in displayed state of charge [1], shape of `energy_wh`.
        """
        base = self.displayed_sd if from_display else self.managed_sd
        return np.hypot(base, CAPACITY_SD * np.abs(energy_wh) / self.wh_per_display)

    @classmethod
    def from_published(cls, battery: Battery, voltage_v: FloatArray) -> ChargeScale:
        """Make the scale from a car's published values.

        Parameters
        ----------
        battery : Battery
            The car's battery.
        voltage_v : ndarray, shape (samples,)
            Simulated voltage at the terminals [V], whose mean counts.

        Returns
        -------
        ChargeScale
            Published window, with usual errors for a display that was not compared with trips.

        Examples
        --------
        >>> from tripwatt.vehicles import load_vehicle
        >>> ChargeScale.from_published(load_vehicle("bmw_i3_60ah").battery, np.full(2, 350.0)).trips
        0
        """
        zero, full = battery.displayed_zero_soc, battery.displayed_full_soc
        wh = battery.capacity_ah * float(np.mean(voltage_v)) * (full - zero)
        return cls(zero, full, wh, PUBLISHED_DISPLAY_SD, PUBLISHED_MANAGED_SD)

    @classmethod
    def from_readings(cls, readings: FloatArray, energy_wh: FloatArray) -> ChargeScale | None:
        """Fit the scale to readings of trips. O(trips).

        The slope of displayed charge taken over energy gives the energy of the display. Trips that start with a full display
        take less displayed charge, by the hidden charge. The window follows from a straight line: the display at arrival plus
        the charge taken, over the battery management's charge at departure. The residuals of the displayed charge at arrival
        give the errors, after the part due to the capacity is subtracted.

        Parameters
        ----------
        readings : ndarray, shape (trips, 4)
            Battery management's charge at departure and arrival, displayed charge at both; NaN where unknown.
        energy_wh : ndarray, shape (trips,)
            Measured energy of each trip [Wh].

        Returns
        -------
        ChargeScale or None
            None if fewer than 8 trips have all readings, or the readings do not determine the scale.

        Examples
        --------
        >>> ChargeScale.from_readings(np.full((3, 4), 0.5), np.zeros(3)) is None
        True
        """
        known = np.isfinite(readings).all(axis=1) & np.isfinite(energy_wh)
        soc, shown, energy = readings[known, 0], readings[known, 2:], energy_wh[known]
        taken = shown[:, 0] - shown[:, 1]
        # eight trips for two values and two scales; a choice
        if len(energy) < 8 or float(np.ptp(soc)) <= 0.0:
            return None
        full = (shown[:, 0] >= FULL).astype(np.float64)
        per_wh, hidden = float(energy @ taken) / float(energy @ energy), 0.0
        # five trips from a full display, and five others; a choice
        if 5 <= full.sum() <= len(full) - 5:
            both = np.linalg.lstsq(np.column_stack([energy, -full]), taken, rcond=None)[0]
            if both[1] > 0.0:
                per_wh, hidden = float(both[0]), float(both[1])
        if per_wh <= 0.0:
            return None
        wh_per_display = 1.0 / per_wh
        expected = energy / wh_per_display
        slope, shift = np.polyfit(soc, shown[:, 1] + expected, 1)
        if slope <= 0.0:
            return None
        capacity2 = (CAPACITY_SD * expected) ** 2

        def scale(error: FloatArray) -> float:
            left = float(np.sum(error**2 - capacity2)) / (len(error) - 1)
            # a display steps by half a percent at least
            least = 0.005**2 / 6.0
            return float(np.sqrt(max(left, least))) * NORMAL_SCALE

        from_display = taken + hidden * full - expected
        from_soc = shown[:, 1] - (slope * soc + shift - expected)
        ends = float(-shift / slope), float((1.0 - shift) / slope)
        return cls(*ends, wh_per_display, scale(from_display), scale(from_soc), len(energy), hidden)
