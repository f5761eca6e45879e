"""One forecast: energy and state of charge along the trip with their intervals, by cause, and its update on the way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, changes, running_sum
from tripwatt.errors import InvalidInput, counted, percent
from tripwatt.forecasting.along import Along, Arrival, F, Trajectories, at_fractions, distance_below
from tripwatt.forecasting.difference import Difference, Shared, sd_between
from tripwatt.forecasting.document import (
    ARRIVAL_LEVELS,
    QUANTILES,
    FlagDocument,
    ForecastResponse,
    LeaveWith,
    Series,
    UnknownClimbDocument,
    by_probability,
)
from tripwatt.forecasting.expected import PARKED_W, ExpectedTrip
from tripwatt.forecasting.measured import (
    ChargeReading,
    Columns,
    Measured,
    along_the_plan,
    columns_measured,
    read_measured,
    since_departure,
    updated_power,
)
from tripwatt.forecasting.plausible import battery_wh, contradicts_energy, implausible_faults
from tripwatt.parallel import one_blas_thread
from tripwatt.routes.links import FLAT_ROAD
from tripwatt.trips import Flag, Plan, raise_faults
from tripwatt.trips.columns import require_fraction, require_number
from tripwatt.trips.departure import FIRST_S
from tripwatt.trips.messages import flag_to_dict, message
from tripwatt.trips.showing import html_table, with_interval
from tripwatt.uncertainty import ChargeScale, ResidualPower, RouteUncertainty, UncertaintyModel
from tripwatt.uncertainty.charge import FULL
from tripwatt.uncertainty.climb import ClimbingEnergy, Excess, UnknownClimb
from tripwatt.uncertainty.free_flow import FreeFlowUncertainty
from tripwatt.units import SECONDS_PER_HOUR, with_units
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from tripwatt.figures import Axes, Figure
BAND: Final = 0.9
DRIVEN: Final = "the driven speed trace"
PLANNED: Final = "a planned route"
FREE_FLOW: Final = "a planned route, free flow"
NOT_MEASURED: Final = Measured(0.0)
MEDIAN: Final = np.array([0.5])
MAX_OFFSET: Final = 5.0
"""Largest difference of the display at departure from the converted charge, in scales of the error of the conversion.

A display that differs by more was planned, not read."""


class Forecaster(Protocol):
    """Interface of objects that forecast plans, such as a `ForecastModel`."""

    def forecast(self, trip: Plan) -> Forecast:
        """Forecast a plan."""


@dataclass(frozen=True, eq=False, repr=False)
class Forecast:
    """Forecast of one trip, made by `ForecastModel.forecast` or `tripwatt.forecast`; `update` returns a new one.

    Attributes
    ----------
    energy_wh, sd_wh : float
        Energy of the whole trip at the battery terminals and its standard deviation [Wh]. For bounds see `interval` and `quantile`.
    arrival : Arrival
        Displayed state of charge at the end of the trip, as a distribution.
    along : Along
        Energy and displayed charge along the road.
    by_cause_wh : dict of str to float
        Energy by cause [Wh]; the parts add up to `energy_wh`.
    flags : tuple of Flag
        Assumptions and limits of the forecast.
    plan : Plan
        What was known at departure.
    vehicle : Vehicle
        The car.
    drive : ExpectedTrip
        The plan, simulated and corrected.
    measured : Measured
        What was measured so far.
    uncertainty : UncertaintyModel
        Uncertainty of the model.
    posterior : ResidualPower
        Residual power of the segments: mean 0 before departure.
    sd_factor : float
        Standard deviation of the trip's energy divided by that of the residual process, from held-out trips.
    rest_sd_factor : float
        Further factor of the standard deviation of the rest of the trip on the way; 1 before departure.
    state_sd_wh : float
        Standard deviation of the trip's energy due to the unknown part of the state at departure [Wh].
    route_sd_wh : float
        Standard deviation that a planned route adds to the trip's energy [Wh]; 0 for a driven trace.
    climbing : ClimbingEnergy or None
        Energy of the unknown climb; None if the heights of the road are known.
    model : Forecaster or None
        Model that made the forecast; None if the forecast was put together by hand.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
    >>> low, high = forecast.interval(0.9)
    >>> bool(low < forecast.energy_wh < high)
    True
    """

    drive: ExpectedTrip
    uncertainty: UncertaintyModel
    posterior: ResidualPower
    sd_factor: float = 1.0
    rest_sd_factor: float = 1.0
    state_sd_wh: float = 0.0
    route_sd_wh: float = 0.0
    climbing: ClimbingEnergy | None = None
    flags: tuple[Flag, ...] = ()
    measured: Measured = NOT_MEASURED
    model: Forecaster | None = None

    @property
    def plan(self) -> Plan:
        """What was known at departure."""
        return self.drive.plan

    @property
    def vehicle(self) -> Vehicle:
        """The car."""
        return self.drive.vehicle

    @property
    def given(self) -> str:
        """Source of the speed: the driven speed trace, a planned route, or a planned route in free flow."""
        if self.plan.free_flow:
            return FREE_FLOW
        return DRIVEN if self.plan.link_m is None else PLANNED

    @property
    def measured_until_s(self) -> float:
        """Time up to which the trip was measured [s since departure]; 0 before departure."""
        return self.measured.until_s

    @property
    def power_w(self) -> FloatArray:
        """Mean power of each segment [W], shape (segments,)."""
        return self.drive.power_w + self.posterior.mean_w

    @property
    def open_hours(self) -> FloatArray:
        """Part of each segment that was not measured [h], shape (segments,)."""
        hours, measured = self.drive.table.hours, self.measured.hours
        return hours if measured is None else np.maximum(hours - measured, 0.0)

    @cached_property
    def along(self) -> Along:
        """Energy and displayed charge along the road."""
        drive, measured, scale = self.drive, self.measured, self.charge
        hours = self.open_hours
        time_s = running_sum(drive.table.hours) * SECONDS_PER_HOUR
        sd_wh, unread = self.sds_wh(hours), _unread_hours(self)
        charge_sd_wh = sd_wh if np.array_equal(unread, hours) else self.sds_wh(unread)
        scores, climb = self.uncertainty.scores, self._unknown_climb
        expected_wh = np.zeros(len(sd_wh)) if climb is None else climb.quantile(scores, MEDIAN, sd_wh)[0]
        energy_wh = self._course_wh + expected_wh
        min_wh = running_sum(measured.energy_wh + drive.min_w * hours)
        if climb is not None:
            min_wh = min_wh + climb.offsets_wh.min(axis=0)
        start, by_change = _charge_start(self, energy_wh)
        taken_wh = energy_wh - np.interp(start.time_s, time_s, energy_wh)
        error = scale.sd(energy_wh if by_change else taken_wh, start.displayed or by_change)
        own_sd = np.where((time_s > start.time_s) | (not start.displayed), error, 0.0)
        return Along(
            time_s,
            drive.distance_m,
            energy_wh,
            sd_wh,
            min_wh,
            Excess(scores, climb, expected_wh),
            np.asarray(scale.left(start.value, taken_wh, start.displayed)),
            np.hypot(charge_sd_wh / scale.wh_per_display, own_sd),
            scale.wh_per_display,
            start.time_s,
        )

    def sds_wh(self, hours: FloatArray) -> FloatArray:
        """Standard deviations of the energy since departure, without that of an unknown climb.

        Parameters
        ----------
        hours : ndarray, shape (segments,)
            Part of each segment over which the error adds up [h], such as `open_hours`.

        Returns
        -------
        ndarray, shape (edges,)
            Standard deviation at each edge of the segments [Wh].

        Examples
        --------
        >>> import tripwatt as tw
        >>> forecast = tw.forecast(tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}]))
        >>> bool(forecast.sds_wh(forecast.open_hours)[-1] == forecast.along.energy_sd_wh[-1])
        True
        """
        return np.concatenate(([0.0], np.hypot(self._own_sd_wh(hours), _remaining_sd_wh(self))))

    def _own_sd_wh(self, hours: FloatArray) -> FloatArray:
        """The part of `sds_wh` by the residual power; `rest_sd_factor` widens what is still to come, shape (segments,)."""
        now_wh, unread = self.posterior.sd_wh(hours), _unread_hours(self)
        rest_wh = now_wh if np.array_equal(unread, hours) else self.posterior.sd_wh(unread)
        variance = now_wh**2 + (self.rest_sd_factor**2 - 1.0) * rest_wh**2
        return self.sd_factor * np.sqrt(np.maximum(variance, 0.0))

    @cached_property
    def _departing_sd_wh(self) -> float:
        """The part of `sd_wh` by the residual power before anything was measured [Wh]."""
        return float(self.uncertainty.process.prior(self.drive.segments).sd_wh(self.drive.table.hours)[-1])

    @property
    def arrival(self) -> Arrival:
        """Displayed state of charge at the end of the trip."""
        return Arrival(self.along)

    @cached_property
    def energy_wh(self) -> float:
        """Energy of the whole trip [Wh]: as at the end of `along`, without the course along the road."""
        if self.climbing is None:
            return float(self._course_wh[-1])
        climb = Excess(self.uncertainty.scores, self._unknown_climb, np.zeros(1)).at(-1)
        return float(self._course_wh[-1] + climb.quantile(MEDIAN, self.sds_wh(self.open_hours)[-1:])[0, 0])

    @cached_property
    def _course_wh(self) -> FloatArray:
        """Energy up to the edges of the segments without that of an unknown climb [Wh], shape (edges,)."""
        return running_sum(self.measured.energy_wh + self.power_w * self.open_hours)

    @cached_property
    def _unknown_climb(self) -> UnknownClimb | None:
        from_m, drive = self._climbs_from_m, self.climbing
        return drive if drive is None else drive.ahead(from_m) if from_m else drive.whole

    @property
    def sd_wh(self) -> float:
        """Standard deviation of the energy of the whole trip [Wh]; an unknown climb counts without its far tails."""
        error_wh, climb = float(self.along.energy_sd_wh[-1]), self.along.excess.climb
        return error_wh if climb is None else float(np.hypot(error_wh, climb.core_sd_wh[-1]))

    def quantile(self, p: F) -> F:
        """Quantile of the energy of the whole trip [Wh], always above the least energy that the drive can take.

        Parameters
        ----------
        p : float or ndarray
            Probability, 0 to 1.

        Returns
        -------
        float or ndarray, shape of `p`
            Energy [Wh] that the trip stays below with this probability.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> round(forecast.quantile(0.5), 3) == round(forecast.energy_wh, 3), forecast.quantile(np.array([0.05, 0.95])).shape
        (True, (2,))
        """
        return at_fractions("p", p, lambda levels: self.along.quantiles(levels)[0])

    def interval(self, level: F) -> tuple[F, F]:
        """Central interval of the energy of the whole trip [Wh].

        Parameters
        ----------
        level : float or ndarray
            Probability of the interval, 0 to less than 1. The `n` scores of held-out trips support up to ``n / (n + 1)``; at higher
            levels the interval grows as that of a t distribution.

        Returns
        -------
        tuple of float or of ndarray, shape of `level`
            Lower and upper bound [Wh].

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> low, high = forecast.interval(0.9)
        >>> round(low, 3) == round(forecast.quantile(0.05), 3), round(high, 3) == round(forecast.quantile(0.95), 3)
        (True, True)
        """
        return self.along.interval(level, 0)

    def sample(self, n: int, seed: int = 0) -> Trajectories:
        """Draw drives along the whole road, such as for a simulation of a fleet or of a charging plan.

        At each edge of the segments the draws have the distribution of the forecast, and at the end that of `arrival`. Along the
        road the errors have the correlation of the residual power, of route and state, and of one unknown climb (a Gaussian copula).

        Parameters
        ----------
        n : int
            Number of draws, at least 1.
        seed : int
            The same seed gives the same draws.

        Returns
        -------
        Trajectories
            Energy and displayed charge, each of shape (draws, edges).

        Raises
        ------
        InvalidInput
            If `n` is less than 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> bool(abs(np.median(forecast.sample(2000).cumulative_energy_wh[:, -1]) / forecast.energy_wh - 1.0) < 0.02)
        True
        """
        if n < 1:
            raise InvalidInput.of("value out of range", "n", f"{n}", "1 or more")
        along, hours, rng = self.along, self.open_hours, np.random.default_rng(seed)
        sums = np.tril(np.broadcast_to(hours, (len(hours), len(hours))))
        covariance = sums @ self.posterior.covariance_w2 @ sums.T
        error_wh = rng.multivariate_normal(
            np.zeros(len(hours)), covariance, n, check_valid="ignore", method="eigh"
        )
        own_wh = self.posterior.sd_wh(hours)
        error_wh *= np.divide(self._own_sd_wh(hours), own_wh, out=np.zeros(len(hours)), where=own_wh > 0.0)
        error_wh += rng.standard_normal((n, 1)) * _remaining_sd_wh(self)
        sd_wh, normal = along.energy_sd_wh[1:], np.zeros((n, len(along.time_s)))
        np.divide(error_wh, sd_wh, out=normal[:, 1:], where=sd_wh > 0.0)
        drawn = along.draws(normal, rng.standard_normal((n, 1)), rng.uniform(size=n))
        return Trajectories(along.time_s, along.distance_m, *drawn)

    def probability_below(self, energy_wh: float) -> float:
        """Probability that the trip takes less than `energy_wh`: the inverse of `quantile`.

        Parameters
        ----------
        energy_wh : float
            An energy at the battery [Wh].

        Returns
        -------
        float
            0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> round(forecast.probability_below(forecast.quantile(0.75)), 6)
        0.75
        """
        energy_wh = require_number("energy_wh", energy_wh)
        along = self.along
        below = distance_below(self.energy_wh, energy_wh, float(along.min_wh[-1]))
        return float(along.excess.at(-1).probability_below(np.array([-below]), along.energy_sd_wh[-1:])[0])

    @cached_property
    def charge(self) -> ChargeScale:
        """Conversion between energy and displayed charge: as fitted to the car's trips, else from its published values."""
        voltage_v = self.drive.simulation.terminal_voltage_v
        return self.uncertainty.charge or ChargeScale.from_published(self.vehicle.battery, voltage_v)

    @property
    def soc_arrival(self) -> float:
        """Displayed state of charge at the end of the trip, 0 to 1; 0 if the battery does not last."""
        return self.arrival.soc

    def p_arrive(self, reserve: F = 0.0) -> F:  # type: ignore[assignment]  # 0 is a number
        """Probability of arriving with at least `reserve` of displayed charge, 0 to 1.

        Energy, capacity and the display itself are uncertain. A car whose battery is empty on the way, such as on a pass,
        does not arrive, even if the descent would recover enough: the place with the lowest probability counts.

        Parameters
        ----------
        reserve : float or ndarray
            Displayed state of charge to arrive with, 0 to 1.

        Returns
        -------
        float or ndarray, shape of `reserve`
            0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> forecast.p_arrive(0.1) > forecast.p_arrive(0.7)
        True
        """
        return self.arrival.probability(reserve)

    @property
    def by_cause_wh(self) -> dict[str, float]:
        """Energy by cause [Wh]; the parts add up to `energy_wh`. Losses inside the battery are not included.

        What the model learned of climate control is a part of it; what it learned of everything else is the correction.
        """
        parts, table = dict(self.drive.simulation.by_cause_wh), self.drive.table
        simulated, climate_w = float(table.simulated_w @ table.hours), self.drive.climate_w
        learned_w = 0.0 if climate_w is None else climate_w - self.drive.segments.climate_w
        learned = float(np.sum(learned_w * table.hours))
        parts["climate"] += learned + simulated - sum(parts.values())  # with rounding of the segments' ends
        course_wh = float(self._course_wh[-1])
        parts["climb"] += self.energy_wh - course_wh
        return {**parts, "correction": course_wh - simulated - learned}

    @property
    def level_wh(self) -> float:
        """Energy of the whole trip without those of its climb and of the parked car [Wh], which speeds and traffic do not change."""
        parked_s = sum(pause.duration_s for pause in self.plan.pauses if pause.cools)
        climb_wh = self.drive.simulation.by_cause_wh["climb"]
        return float(self._course_wh[-1]) - climb_wh - PARKED_W * parked_s / SECONDS_PER_HOUR

    @property
    def battery_loss_wh(self) -> float:
        """Energy lost as heat inside the battery [Wh], not included in the energy at its terminals."""
        simulation = self.drive.simulation
        return float(simulation.battery_loss_w @ changes(simulation.time_s) / SECONDS_PER_HOUR)

    def climb_to(self, reserve: float = 0.0) -> float | None:
        """Net climb of the rest of the road at which the expected charge at arrival falls to a reserve, for unknown heights.

        Parameters
        ----------
        reserve : float
            Displayed state of charge to arrive with, 0 to 1.

        Returns
        -------
        float or None
            Climb [m]. Returns 0 if the charge is below the reserve on a flat road already. Returns None if the heights of the road
            are known, or if no road of this length and terrain climbs that much.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.5, ambient_temperature_degc=5.0))
        >>> 800.0 < forecast.climb_to(0.1) < forecast.climb_to(0.0) < 2000.0
        True
        """
        if self.climbing is None:
            return None
        along = self.along
        spare_wh = (along.charge[-1] - reserve) * along.wh_per_display + along.excess.expected_wh[-1]
        return self.climbing.climb_for(float(spare_wh), self._climbs_from_m)

    @property
    def soc_per_climb_m(self) -> float | None:
        """Displayed charge used by each metre of climb on the rest of the road [1/m]; None if its heights are known."""
        if self.climbing is None:
            return None
        (more_wh,) = np.diff(self.climbing.more_wh(np.array([0.0, 100.0]), self._climbs_from_m))
        return float(more_wh) / 100.0 / self.charge.wh_per_display

    def difference(self, other: Forecast) -> Difference:
        """Compare with another forecast of the same car, driver and day, on this road or another.

        Parameters
        ----------
        other : Forecast
            Forecast by the same model, before departure.

        Returns
        -------
        Difference
            This forecast minus the other one. Errors that both share cancel: the interval is narrower than that of two independent
            forecasts.

        Raises
        ------
        InvalidInput
            If the two forecasts are of different cars, or one was updated on the way.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 25.0}])
        >>> cold, mild = (tw.forecast(plan, tw.Departure(ambient_temperature_degc=t)) for t in (0.0, 15.0))
        >>> more = cold.difference(mild)
        >>> more.energy_wh > 0.0, more.sd_wh < cold.sd_wh
        (True, True)
        """
        if self.vehicle != other.vehicle or self.measured_until_s or other.measured_until_s:
            got = "of two cars" if self.vehicle != other.vehicle else "one that was updated on the way"
            allowed = "two forecasts of one car by one model before departure"
            raise InvalidInput.of("forecasts without a common part", "forecasts", got, allowed)
        theirs = other.by_cause_wh
        causes = {cause: wh - theirs[cause] for cause, wh in self.by_cause_wh.items()}
        simulated = (wh for cause, wh in causes.items() if cause != "correction")
        return Difference(
            self.energy_wh - other.energy_wh,
            sd_between(_shared(self), _shared(other), self.uncertainty.scale, simulated),
            self.plan.duration_s - other.plan.duration_s,
            self.soc_arrival - other.soc_arrival,
            causes,
            self.uncertainty.scores,
        )

    def update(self, observed: pd.DataFrame) -> Forecast:
        """Forecast again from what was measured so far. O(samples + segments).

        Parameters
        ----------
        observed : DataFrame
            Samples as for `update_since_departure`, but with `time_s` on the clock of the plan's file (`plan.start_s` is
            the departure). For a planned route, `time_s` is 0 at departure.

        Returns
        -------
        Forecast
            Forecast of the same trip: the measured part and the rest.

        Raises
        ------
        InvalidInput
            Lists every fault of the samples. Also raised if the samples begin before the trip or after it, or if their
            current has the wrong sign.

        Examples
        --------
        >>> import tripwatt as tw
        >>> trip = tw.sample_trips().trips[0]
        >>> before = tw.load_model().forecast(trip)
        >>> after = before.update(trip.samples[trip.samples["time_s"] <= 0.5 * trip.duration_s])
        >>> after.sd_wh < before.sd_wh
        True
        """
        return updated(self, since_departure(columns_measured(observed), self.plan))

    def update_since_departure(self, observed: pd.DataFrame) -> Forecast:
        """Forecast again from what was measured so far, timed from the departure. O(samples + segments).

        Parameters
        ----------
        observed : DataFrame
            Samples with `time_s` in seconds since departure. Energy comes from `voltage_v` and `current_a`, or from
            `observed_energy_wh`; segments in gaps stay unmeasured. If `heating_power_w` and `aircon_power_w` are given
            too, climate control is updated separately. Without energy, `soc` or `displayed_soc` is used. On a planned
            route `speed_m_s` gives the distance driven; without this column, the car is assumed to be on schedule.

        Returns
        -------
        Forecast
            Forecast of the same trip: the measured part and the rest.

        Raises
        ------
        InvalidInput
            Lists every fault of the samples. Also raised for more energy than the battery holds, a charge that
            rises by more than the road falls, or a time after the trip.

        Examples
        --------
        >>> import pandas as pd
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> seen = pd.DataFrame({"time_s": [0.0, 300.0], "speed_m_s": 15.0, "observed_energy_wh": [0.0, 600.0]})
        >>> tw.forecast(plan).update_since_departure(seen).measured_until_s > 0.0
        True
        """
        return updated(self, columns_measured(observed))

    @one_blas_thread
    def to_dict(self, reserve: float | None = None, leave_with: LeaveWith | None = None) -> ForecastResponse:
        """Return the forecast as plain values, as the command line and the service give them.

        Parameters
        ----------
        reserve : float, optional
            Displayed state of charge to arrive with; adds an entry to `p_arrive_by_soc`.
        leave_with : dict, optional
            The charge to leave with, from `tripwatt.forecasting.leaving.leave_with`.

        Returns
        -------
        ForecastResponse
            Numbers, texts, lists and further dicts only; energies [Wh], states of charge 0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> forecast.to_dict()["energy_wh"] == forecast.energy_wh
        True
        """
        own = () if reserve is None else (require_fraction("reserve", reserve),)
        along, levels = self.along, (*ARRIVAL_LEVELS, *own)
        early, expected, late = along.empty_at_m
        least, middle, most = along.missing_wh
        energies_wh, charges = along.quantiles(QUANTILES)
        return {
            "trip": self.plan.trip_id,
            "given": self.given,
            "energy_wh": self.energy_wh,
            "quantiles_wh": by_probability(energies_wh, QUANTILES),
            "soc_arrival": self.soc_arrival,
            "soc_quantiles": by_probability(charges, QUANTILES),
            "wh_per_display": along.wh_per_display,
            "empty_at_m": {"early": early, "expected": expected, "late": late},
            "missing_wh": {"least": least, "expected": middle, "most": most},
            "p_arrive_by_soc": by_probability(self.p_arrive(np.array(levels)), levels),
            "climb": _climb_document(self, levels),
            "leave_with": leave_with,
            "series": Series(**{name: values.tolist() for name, values in along.columns().items()}),  # type: ignore[typeddict-item]
            "by_cause_wh": self.by_cause_wh,
            "battery_loss_wh": self.battery_loss_wh,
            "measured_until_s": self.measured_until_s,
            "flags": [FlagDocument(**flag_to_dict(flag)) for flag in self.flags],  # type: ignore[typeddict-item]
        }

    @one_blas_thread
    def to_frame(self) -> pd.DataFrame:
        """Table of energy and charge along the road: one row at the start and one at the end of each segment.

        Returns
        -------
        DataFrame
            `time_s, distance_m, energy_wh, energy_low_wh, energy_high_wh, displayed_soc, displayed_soc_low, displayed_soc_high`; the
            band is the central 90 %.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> list(forecast.to_frame().columns[:3])
        ['time_s', 'distance_m', 'energy_wh']
        """
        return with_units(pd.DataFrame(self.along.columns()))

    def plot(self, ax: Axes | None = None) -> Figure:
        """Plot energy and state of charge along the trip with their bands, and the energy by cause.

        Parameters
        ----------
        ax : Axes, optional
            Axes that the panels replace; a new figure if not given.

        Returns
        -------
        matplotlib.figure.Figure
            Three panels.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> forecast.plot().savefig("forecast.png")  # doctest: +SKIP
        """
        from tripwatt.forecasting.plots import plot_forecast  # matplotlib is slow to import

        title = f"{self.plan.trip_id}: {self.energy_wh / 1000.0:.2f} kWh, given {self.given}"
        return plot_forecast(self.to_frame(), self.by_cause_wh, title, self.measured_until_s, ax)

    def __repr__(self) -> str:
        energy = with_interval(self.energy_wh, self.interval(BAND), "kWh")
        flags = f", {counted(len(self.flags), 'flag')}" if self.flags else ""
        return f"<Forecast {self.plan.trip_id}: {energy}, arrival with {percent(self.soc_arrival)}{flags}>"

    def _repr_html_(self) -> str:
        (low, high), interval = self.interval(BAND), self.arrival.interval(BAND)
        charge, least, most = map(percent, (self.soc_arrival, *interval))
        rows = [
            ("energy", f"{self.energy_wh / 1000.0:.2f} kWh"),
            (f"{percent(BAND)} interval", f"{low / 1000.0:.2f} to {high / 1000.0:.2f} kWh"),
            ("state of charge at arrival", f"{charge} ({least} to {most})"),
            ("probability to arrive", percent(self.p_arrive(), 1)),
            ("given", self.given),
            *(("note", message(flag)) for flag in self.flags),
        ]
        return html_table(f"Forecast {self.plan.trip_id}", rows)

    @property
    def _climbs_from_m(self) -> float:
        """Distance from the start beyond which the climb was not measured [m]."""
        anchor = self.measured.anchor
        until = self.measured.until_s if self.measured.hours is not None or anchor is None else anchor.time_s
        return float(np.interp(until, self.drive.edges_s, self.drive.distance_m))


def _charge_start(forecast: Forecast, energy_wh: FloatArray) -> tuple[ChargeReading, bool]:
    """Displayed charge from which the charge along the road is computed: the last reading on the way, else that at departure.

    If the display was not read, the charge of the battery management is converted. The second value says whether this was shifted to
    match the display at departure: only the change since departure then has an error. `energy_wh` is the energy at the edges of the
    segments, shape (edges,).
    """
    anchor, departure, scale = forecast.measured.anchor, forecast.plan.departure, forecast.charge
    if anchor and anchor.displayed and not anchor.charged and min(anchor.value, departure.soc or 0.0) >= FULL:
        anchor = None  # a full display hides charge; the hidden charge at departure is known better than that of now
    if anchor is not None and anchor.displayed:
        return anchor, False
    if anchor is not None:
        offset = _display_offset(forecast, anchor.first, energy_wh)
        converted = float(scale.displayed(anchor.value)) + (offset or 0.0)
        return ChargeReading(anchor.time_s, converted, displayed=False), offset is not None
    if departure.soc is not None:
        return ChargeReading(0.0, departure.soc, displayed=True), False
    if departure.bms_soc is not None:
        return ChargeReading(0.0, float(scale.displayed(departure.bms_soc)), displayed=False), False
    start = float(forecast.vehicle.battery.displayed_from_soc(float(forecast.drive.simulation.soc[0])))
    return ChargeReading(0.0, start, displayed=True), False


def _display_offset(forecast: Forecast, first: ChargeReading | None, energy_wh: FloatArray) -> float | None:
    """Displayed charge at departure minus the converted charge of the battery management; None if unknown.

    The offset is kept on the way, because the conversion has a larger error in its level than in its change.
    """
    shown, scale = forecast.plan.departure.soc, forecast.charge
    if first is None or shown is None or first.time_s > FIRST_S:
        return None
    taken_wh = float(np.interp(first.time_s, forecast.drive.edges_s, energy_wh))
    offset = scale.left(shown, taken_wh) - scale.displayed(first.value)
    return float(offset) if abs(offset) <= MAX_OFFSET * scale.managed_sd else None


@one_blas_thread
def updated(forecast: Forecast, observed: Columns) -> Forecast:
    """Update a forecast with samples timed from the departure: see `Forecast.update_since_departure`."""
    drive, uncertainty = forecast.drive, forecast.uncertainty
    samples = along_the_plan(observed, forecast.plan)
    raise_faults(implausible_faults(observed, drive))
    measured, readings = read_measured(samples, drive, uncertainty.process, forecast.charge)
    anchor, flags = measured.anchor, [flag for flag in forecast.flags if flag.code != "charge_contradicted"]
    wh_per_charge = forecast.charge.wh_per_display if anchor and anchor.displayed else battery_wh(drive)
    if contradicts_energy(anchor, samples, wh_per_charge):
        measured = replace(measured, anchor=None)
        flags.append(Flag("charge_contradicted", "displayed_soc", anchor.value if anchor else None, "1"))
    posterior, factor = updated_power(drive, uncertainty, samples, measured, readings, forecast.sd_factor)
    before_wh = forecast._departing_sd_wh
    forecast = replace(forecast, flags=tuple(flags), posterior=posterior, measured=measured)
    now_wh, rest_wh = (posterior.sd_wh(hours)[-1] for hours in (forecast.open_hours, _unread_hours(forecast)))
    # the trip is never less certain than at departure
    most = float(np.sqrt(1.0 + max(before_wh**2 - now_wh**2, 0.0) / max(rest_wh, 1e-9) ** 2))
    return with_empty_flag(replace(forecast, rest_sd_factor=min(factor, most)))


def with_empty_flag(forecast: Forecast) -> Forecast:
    """Return the forecast with the flag `battery_empty` if the trip is expected to take more than the battery holds."""
    gone = {"battery_empty"} | ({"soc_assumed"} if forecast.measured.anchor is not None else set())
    flags = tuple(flag for flag in forecast.flags if flag.code not in gone)
    # the same object if nothing changes: its cached properties are kept
    forecast = forecast if len(flags) == len(forecast.flags) else replace(forecast, flags=flags)
    missing = forecast.along.missing_at(forecast.along.expected_soc)
    empty = Flag("battery_empty", "battery", missing, "wh")
    return replace(forecast, flags=(*flags, empty)) if missing > 0.0 else forecast


def _shared(forecast: Forecast) -> Shared:
    drive, hours = forecast.drive, forecast.drive.table.hours
    climb, route, link_m = forecast.along.excess.climb, forecast.uncertainty.route, forecast.plan.link_m
    return Shared(
        forecast.uncertainty.scale.course.hours(float(hours.sum())),
        float((drive.segments.moved_w * hours).sum()),
        drive.segments.net_wh,
        drive.corrector.predict_with_uncertainty(drive.table, hours)[1],
        drive.segments.outside_sd_wh,
        forecast.state_sd_wh,
        forecast.route_sd_wh,
        0.0 if route is None or link_m is None else route.share(link_m) * abs(forecast.level_wh),
        0.0 if climb is None else float(climb.core_sd_wh[-1]),
        forecast.by_cause_wh["climate"],
        float(drive.distance_m[-1]),
    )


def _unread_hours(forecast: Forecast) -> FloatArray:
    """Part of each segment that was not measured, nor driven before the last reading of the charge [h], shape (segments,)."""
    ahead, anchor = forecast.open_hours, forecast.measured.anchor
    if forecast.measured.hours is not None or anchor is None:
        return ahead
    step_s = forecast.drive.segments.step_s
    return np.asarray(ahead * np.clip((forecast.drive.edges_s[1:] - anchor.time_s) / step_s, 0.0, 1.0))


def _remaining_sd_wh(forecast: Forecast) -> FloatArray:
    """Standard deviation due to route and unknown state up to each segment's end [Wh], shape (segments,).

    It grows with the time that was not measured; the errors of the segments are fully correlated.
    """
    trip_sd_wh = np.hypot(forecast.route_sd_wh, forecast.state_sd_wh)
    return np.asarray(trip_sd_wh * np.cumsum(_unread_hours(forecast)) / forecast.drive.table.hours.sum())


def _climb_document(forecast: Forecast, levels: tuple[float, ...]) -> UnknownClimbDocument | None:
    """Effect of the climb of a road of unknown heights, as plain values; None if the heights are known."""
    soc_per_m, known = forecast.soc_per_climb_m, forecast.plan.climb
    if soc_per_m is None:
        return None
    return {
        "terrain": forecast.plan.departure.terrain or "unknown",
        "expected_m": None if known is None else float(known.climb_m[-1]),
        "soc_per_m": soc_per_m,
        "changes_at_m": {f"{level:g}": forecast.climb_to(level) for level in levels},
    }


def with_route_error(
    forecast: Forecast, route: RouteUncertainty | None, free_flow: FreeFlowUncertainty | None
) -> Forecast:
    """Add the uncertainty of the planned route to a forecast; a forecast of a driven trace only gets the flags of its road.

    The standard deviation of the whole trip becomes ``sqrt(own² + (share · level)²)``, with the energy without the climb; on the way,
    the second part is in proportion to the time to go. If the travel times are those of an empty road, the share of the travel times is used instead of that of the
    links, which it contains. Flags name what is unknown about the route.
    """
    link_m, flags = forecast.plan.link_m, [*forecast.flags]
    if forecast.soc_per_climb_m is not None:
        terrain = forecast.plan.departure.terrain or "unknown"
        flags.append(Flag("unknown_climb", terrain, 100.0 * forecast.soc_per_climb_m, "1"))
    flags += (flag for flag in forecast.plan.flags if flag != FLAT_ROAD)
    route_sd_wh = 0.0
    if route is None and link_m is not None:
        flags.append(Flag("route_error_unknown", "links"))
    elif link_m is not None and forecast.plan.free_flow and free_flow is not None:
        route_sd_wh = free_flow.share(forecast.plan.distance_m) * abs(forecast.level_wh)
        flags.append(Flag("free_flow_times", "road"))
    elif link_m is not None and route is not None:
        route_sd_wh = route.share(link_m) * abs(forecast.level_wh)
        if forecast.plan.free_flow:
            flags.append(Flag("travel_time_error_unknown", "road"))
        if link_m > float(route.length_m[-1]):
            flags.append(Flag("links_too_long", "links", link_m, "m"))
    return replace(forecast, route_sd_wh=route_sd_wh, flags=tuple(dict.fromkeys(flags)))
