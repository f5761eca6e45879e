"""The uncertainty of a forecasting model, estimated from the errors on its held-out trips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.uncertainty.charge import ChargeScale
from tripwatt.uncertainty.conformal import ConformalScores
from tripwatt.uncertainty.free_flow import FreeFlowUncertainty
from tripwatt.uncertainty.process import HeldOutResidual, ResidualProcess, fit_process
from tripwatt.uncertainty.route import RouteUncertainty
from tripwatt.uncertainty.scale import TimeCourse, TotalScale
from tripwatt.uncertainty.shrinkage import UpdateShrinkage


@dataclass(frozen=True, eq=False)
class UncertaintyModel:
    """Uncertainty before departure, on the way, and of a planned route.

    Attributes
    ----------
    process : ResidualProcess
        Covariance of the residual power along a trip.
    scale : TotalScale
        Standard deviation of a trip's energy before departure.
    scores : ConformalScores
        Standardised errors of held-out trips, which give the half widths of intervals.
    shrinkage : UpdateShrinkage
        Share of an update on the way that counts.
    route : RouteUncertainty or None
        Uncertainty that a planned route adds; None if the training trips could not be cut into links.
    charge : ChargeScale or None
        Conversion of energy to displayed charge; None if the training trips have too few readings.
    free_flow : FreeFlowUncertainty or None
        Expected travel times of a free-flow route and the uncertainty that they add; None if they were not measured.

    Examples
    --------
    >>> import tripwatt as tw
    >>> uncertainty = tw.load_model("bmw_i3_tum").uncertainty_
    >>> uncertainty.scores.factor(0.5) < uncertainty.scores.factor(0.9)
    True
    """

    process: ResidualProcess
    scale: TotalScale
    scores: ConformalScores
    shrinkage: UpdateShrinkage
    route: RouteUncertainty | None = None
    charge: ChargeScale | None = None
    free_flow: FreeFlowUncertainty | None = None

    @classmethod
    def from_held_out(
        cls,
        trips: Sequence[HeldOutResidual],
        route: RouteUncertainty | None = None,
        charge: ChargeScale | None = None,
    ) -> UncertaintyModel:
        """Estimate every part from trips that the corrector was not fitted on. O(trips x segments^3) per step of the fit.

        Parameters
        ----------
        trips : sequence of HeldOutResidual
            Residual powers of trips that the corrector was not fitted on.
        route : RouteUncertainty, optional
            Stored in the result as given.
        charge : ChargeScale, optional
            Stored in the result as given.

        Returns
        -------
        UncertaintyModel
            The uncertainty, without `free_flow`.

        Examples
        --------
        >>> import numpy as np
        >>> from tripwatt.uncertainty import Segments
        >>> from tripwatt.uncertainty.process import HeldOutResidual
        >>> segments = Segments(np.arange(12) * 60.0, np.full(12, 60.0), np.full(12, 4000.0), np.zeros(12))
        >>> trips = [HeldOutResidual(segments, np.full(12, power)) for power in (-80.0, 60.0, 20.0, -30.0, 90.0)]
        >>> UncertaintyModel.from_held_out(trips).scores.values.shape
        (5,)
        """
        errors = np.array([trip.error_wh for trip in trips])
        process = fit_process(trips)
        course = TimeCourse.from_process(process)
        measured = np.array([trip.measured_sd_wh for trip in trips])
        scale = TotalScale.from_errors([trip.segments for trip in trips], errors, course, measured)
        sd = scale_wh(scale, trips)
        scores = ConformalScores.from_errors((errors / np.hypot(sd, measured)).tolist())
        along = [i for i, trip in enumerate(trips) if trip.along]
        shrinkage = UpdateShrinkage.from_trips(process, [trips[i] for i in along], sd[along])
        return cls(process, scale, scores, shrinkage, route, charge)


def scale_wh(scale: TotalScale, trips: Sequence[HeldOutResidual]) -> FloatArray:
    """Standard deviation of the energy of each trip [Wh], shape (trips,)."""
    return np.array([scale.sd_wh(trip.segments) for trip in trips])
