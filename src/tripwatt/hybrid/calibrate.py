"""Calibration of a few uncertain values of a car on its own logged trips, shrunk to the published values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.hybrid.parameters import changed, parameters, sensitivities
from tripwatt.hybrid.segments import require_measured, segment_trips
from tripwatt.trips import Plan, Trip
from tripwatt.vehicles import Vehicle

TAIL_DF: Final = 4.0
"""Degrees of freedom of the trips' t errors, as Lange, Little and Taylor (1989) advise for few data."""
USUAL_ERROR: Final = 0.05
"""Usual relative error of a trip's energy with the right values: wind, traffic, and influences that the log lacks."""
USUAL_DF: Final = 4.0
"""Weight of the usual error, in trips; a choice."""
MIN_TRIPS: Final = 3
"""Fewest trips to calibrate on; a choice, because fewer trips show next to nothing of several values."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Relative changes of a car's values, estimated from trips.

    Attributes
    ----------
    changes : dict of str to float
        Relative change of each of `parameters`, by name.
    sd : dict of str to float
        Standard deviation of each change; its prior width if the trips carry no information.
    trips : int
        Number of trips.
    """

    changes: Mapping[str, float]
    sd: Mapping[str, float]
    trips: int

    def __str__(self) -> str:
        """One line of text."""
        values = [f"{name} {change:+.0%} (± {self.sd[name]:.0%})" for name, change in self.changes.items()]
        return f"calibrated on {self.trips} trips: {', '.join(values)}"

    def applied(self, vehicle: Vehicle) -> Vehicle:
        """Return the car with the changed values; parameters without an entry of the car have no effect."""
        return changed(vehicle, self.changes, source=f"calibrated on {self.trips} trips")


def calibrate(trips: Sequence[Trip], vehicle: Vehicle) -> Calibration:
    """Most probable changes of the car's uncertain values, from the energies of whole trips.

    The residual of each trip's energy is linear in small changes. Each change is normal around 0 with its published width; the
    trips' errors follow a t distribution whose scale is estimated as well. Segments within a trip are far from independent, so
    only totals count. O(samples) for each value and a few solutions of a small system.

    Parameters
    ----------
    trips : sequence of Trip
        Raw trips with measured energy.
    vehicle : Vehicle

    Raises
    ------
    InvalidInput
        If there are fewer than `MIN_TRIPS` trips, or a trip has no measured energy.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> calibration = calibrate(synthetic_fleet(8).trips, load_vehicle("bmw_i3_60ah"))
    >>> sorted(calibration.changes) == sorted(p.name for p in parameters())
    True
    """
    require_measured(trips, MIN_TRIPS)
    plans = [Plan.from_trip(trip) for trip in trips]
    table = segment_trips(trips, vehicle)
    by_change = sensitivities(plans, vehicle, table)
    totals = np.column_stack([table.totals_wh(column) for column in by_change.T])
    width = np.array([parameter.width for parameter in parameters()])
    usual_wh = USUAL_ERROR * float(np.median(np.abs(table.totals_wh(table.simulated_w))))
    mean, covariance = most_probable(totals, table.totals_wh(table.residual_w), width, usual_wh)
    names = [parameter.name for parameter in parameters()]
    sd = np.sqrt(np.diag(covariance))
    return Calibration(
        dict(zip(names, mean.tolist(), strict=True)), dict(zip(names, sd.tolist(), strict=True)), len(trips)
    )


def most_probable(
    X: FloatArray, residual: FloatArray, width: FloatArray, usual_wh: float
) -> tuple[FloatArray, FloatArray]:
    """Posterior mode and covariance of a regression with t errors, by iterated weights (Lange et al. 1989).

    The scale of the errors has a prior at `usual_wh` that counts as `USUAL_DF` trips. Without it, the values could fit a few trips
    exactly, and the scale would vanish.
    """
    mean: FloatArray = np.zeros(len(width))
    weight = np.ones(len(residual))
    # bounds the time: the weights settle in fewer passes
    for _ in range(20):
        left = residual - X @ mean
        known = float(np.sum(weight * left**2)) + USUAL_DF * usual_wh**2
        scale2 = max(known / (len(left) + USUAL_DF), 1e-12)
        weight = (TAIL_DF + 1.0) / (TAIL_DF + left**2 / scale2)
        precision = (X.T * weight) @ X / scale2 + np.diag(1.0 / width**2)
        covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
        mean = covariance @ (X.T @ (weight * residual)) / scale2
    return mean, covariance
