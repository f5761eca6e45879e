"""One forecast: energy and state of charge along the trip with their intervals, by cause, and its update on the way."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput
from tripwatt.forecasting.difference import Difference, Shared, sd_between
from tripwatt.forecasting.document import (
    FlagDocument,
    ForecastResponse,
    LeaveWith,
    Series,
    UnknownClimbDocument,
)
from tripwatt.forecasting.expected import ExpectedTrip
from tripwatt.forecasting.measured import (
    ChargeReading,
    Columns,
    Measured,
    checked_samples,
    columns_measured,
    read_measured,
    since_departure,
)
from tripwatt.forecasting.plausible import implausible_faults
from tripwatt.forecasting.update import updated_power
from tripwatt.parallel import one_blas_thread
from tripwatt.routes.links import FLAT_ROAD
from tripwatt.trips import Departure, Flag, Plan, raise_faults
from tripwatt.trips.columns import require_fraction, require_number
from tripwatt.trips.departure import FIRST_S
from tripwatt.trips.messages import flag_to_dict, leave_in_words, message
from tripwatt.trips.showing import html_table
from tripwatt.uncertainty import ChargeScale, ResidualPower, RouteUncertainty, UncertaintyModel
from tripwatt.uncertainty.charge import FULL
from tripwatt.uncertainty.climb import ClimbingEnergy, Excess, UnknownClimb
from tripwatt.uncertainty.free_flow import FreeFlowUncertainty
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from tripwatt.figures import Axes, Figure
QUANTILES: Final = (0.025, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.975)
ARRIVAL_LEVELS: Final = (0.0, 0.05, 0.1, 0.2)
BAND: Final = 0.9
ARRIVAL_BAND: Final = (0.95, 0.5, 0.05)
"""Probabilities of the low end, the middle and the high end of the band."""
STRAIGHT: Final = 0.75
"""Part of the way from the expected to the least energy over which a distance below counts as it is."""
DRIVEN: Final = "the driven speed trace"
PLANNED: Final = "a planned route"
FREE_FLOW: Final = "a planned route, free flow"
NOT_MEASURED: Final = Measured(0.0)
SOC_PRECISION: Final = 1e-7
"""Of the charge to leave with."""
MOST_SECANTS: Final = 8
"""Steps to it, after which the interval is halved."""
MOST_OFFSET: Final = 5.0
"""A display at departure that differs by more from the converted charge, in scales of the conversion's error, was planned and not read."""
OF_CHARGE: Final = frozenset({"soc_assumed", "battery_empty", "battery_full", "battery_over_voltage"})
"""Flags that depend on the charge at departure."""


@dataclass(frozen=True, eq=False, repr=False)
class Forecast:
    """Forecast of one trip; `update` makes a new one. `ForecastModel.forecast` and `tripwatt.forecast` make it.

    Attributes
    ----------
    energy_wh, sd_wh : float
        Energy of the whole trip at the battery terminals and its standard deviation [Wh]; `interval` and `quantile` have its ends.
    soc_arrival : float
        Displayed state of charge at the end of the trip, 0 to 1; `soc_interval` and `p_arrive` have its uncertainty.
    by_cause_wh : dict of str to float
        Energy by cause [Wh]; the parts add up to `energy_wh`.
    flags : tuple of Flag
        What was assumed, and what limits the forecast.
    plan : Plan
        What was known at departure.
    vehicle : Vehicle
        The car.
    drive : ExpectedTrip
        The plan, simulated and corrected.
    measured : Measured
        What was measured so far.
    uncertainty : UncertaintyModel
        Of the model.
    posterior : ResidualPower
        Residual power of the segments: mean 0 before departure.
    sd_factor : float
        Standard deviation of the trip's energy over that of the process, from held-out trips.
    rest_sd_factor : float
        The same factor for the rest of the trip on the way; 1 before departure.
    state_sd_wh : float
        Standard deviation of the trip's energy by what is unknown of the state at departure [Wh].
    route_sd_wh : float
        Standard deviation that a planned route adds to the trip's energy [Wh]; 0 for a driven trace.
    climbing : ClimbingEnergy or None
        What its climb takes, on a road of unknown heights.
    maker : callable or None
        Forecasts a plan as this one was forecast; None where the forecast was put together by hand.

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
    maker: Callable[[Plan], Forecast] | None = None

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
        """What is taken as known of the speed: the driven speed trace, or a planned route."""
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
        hours = self.drive.table.hours
        if self.measured.hours is None:
            return hours
        return np.maximum(hours - self.measured.hours, 0.0)

    @cached_property
    def segment_energy_wh(self) -> FloatArray:
        """Energy of each segment [Wh]: what was measured, and the mean power and the unknown climb over the rest of it."""
        energy = self.power_w * self.open_hours
        if self.measured.energy_wh is not None:
            energy = self.measured.energy_wh + energy
        return np.asarray(energy + np.diff(self._excess.expected_wh))

    @cached_property
    def energy_wh(self) -> float:
        """Energy of the whole trip [Wh]."""
        return float(self.segment_energy_wh.sum())

    @cached_property
    def sd_wh(self) -> float:
        """Standard deviation of the energy of the whole trip [Wh]; of an unknown climb that of its core, without the far tails."""
        own = float(self.energy_sd_wh[-1])
        return own if self._climb is None else float(np.hypot(own, self._climb.core_sd_wh[-1]))

    def quantile(self, p: float) -> float:
        """Quantile of the energy of the whole trip [Wh]; above the least that the drive can take.

        Parameters
        ----------
        p : float
            Probability, 0 to 1.

        Returns
        -------
        float
            Energy [Wh] that the trip stays below with this probability.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> round(forecast.quantile(0.5), 3) == round(forecast.energy_wh, 3)
        True
        """
        return float(quantiles(self, [require_fraction("p", p)])[0][0])

    def interval(self, level: float) -> tuple[float, float]:
        """Central interval of the energy of the whole trip [Wh].

        Parameters
        ----------
        level : float
            Probability of the interval, 0 to less than 1. The `n` scores of held-out trips support up to ``n / (n + 1)``; beyond it
            the interval grows as that of a t distribution.

        Returns
        -------
        tuple of float
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
        low, high = quantiles(self, _ends(level))[0].tolist()
        return low, high

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
        if self.sd_wh <= 0.0:
            return float(self.energy_wh <= energy_wh)
        below = distance_below(self.energy_wh, energy_wh, float(self._least_wh[-1]))
        return float(self._excess.end.probability_below(np.array([-below]), self.energy_sd_wh[-1:])[0])

    @cached_property
    def charge(self) -> ChargeScale:
        """Energy by displayed charge: as fitted to the car's trips, else of its published values."""
        return self.uncertainty.charge or ChargeScale.from_published(
            self.vehicle.battery, self.drive.wh_per_soc
        )

    @property
    def soc_arrival(self) -> float:
        """Displayed state of charge at the end of the trip, 0 to 1; 0 when the battery does not last."""
        return float(np.clip(self._expected_charge[-1], 0.0, 1.0))

    def soc_quantile(self, p: float) -> float:
        """Quantile of the displayed state of charge at the end of the trip, 0 to 1.

        Parameters
        ----------
        p : float
            Probability, 0 to 1.

        Returns
        -------
        float
            State of charge that the display at arrival stays below with this probability.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> forecast.soc_quantile(0.05) < forecast.soc_arrival < forecast.soc_quantile(0.95) < 0.8
        True
        """
        return float(quantiles(self, [require_fraction("p", p)])[1][0])

    def soc_interval(self, level: float) -> tuple[float, float]:
        """Central interval of the displayed state of charge at the end of the trip, 0 to 1.

        Parameters
        ----------
        level : float
            Probability of the interval, 0 to less than 1. The `n` scores of held-out trips support up to ``n / (n + 1)``; beyond it
            the interval grows as that of a t distribution.

        Returns
        -------
        tuple of float
            Lower and upper bound, 0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> low, high = forecast.soc_interval(0.9)
        >>> round(low, 6) == round(forecast.soc_quantile(0.05), 6), round(high, 6) == round(forecast.soc_quantile(0.95), 6)
        (True, True)
        """
        low, high = quantiles(self, _ends(level))[1].tolist()
        return low, high

    def p_arrive(self, reserve: float = 0.0) -> float:
        """Probability to arrive with at least this displayed state of charge, 0 to 1.

        Energy, capacity and the display itself are uncertain. A battery that is empty on the way, such as on a pass,
        does not arrive, whatever the way down would bring back: the least certain place counts.

        Parameters
        ----------
        reserve : float
            Displayed state of charge to arrive with, 0 to 1.

        Returns
        -------
        float
            0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> forecast.p_arrive(0.1) > forecast.p_arrive(0.7)
        True
        """
        return min(self._p_lasts, p_above(self, require_fraction("reserve", reserve)))

    @cached_property
    def _p_lasts(self) -> float:
        """Probability that the battery is empty at no place."""
        centre, sd = self._charge_band
        wh = self.charge.wh_per_display
        return float(self._excess.probability_below((centre - self._least_charge(0.0)) * wh, sd * wh).min())

    def leaving_with(self, soc: float) -> Forecast:
        """Forecast the trip again from another charge.

        The charge changes the voltage, the resistance and what the battery recovers. On the way, what was measured is
        kept, and the battery is charged to `soc` where its charge was last read.

        Parameters
        ----------
        soc : float
            Displayed state of charge, 0 to 1.

        Returns
        -------
        Forecast
            Of the same trip.

        Raises
        ------
        InvalidInput
            With a charge out of 0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> forecast.leaving_with(0.6).soc_arrival < forecast.soc_arrival
        True
        """
        return forecast_again(self, soc, self._charge_start[0])

    def soc_needed(self, reserve: float = 0.1, probability: float = 0.95) -> float:
        """Displayed state of charge to leave with, to arrive with a reserve with a probability.

        The forecast that leaves with it has this probability: ``leaving_with(soc).p_arrive(reserve) == probability``,
        whatever charge the plan has. Two forecasts in the median.

        Parameters
        ----------
        reserve : float
            Displayed state of charge to arrive with, 0 to 1.
        probability : float
            0.5 to 1.

        Returns
        -------
        float
            0 to 1. 0 where any charge suffices, such as on a way down. Above 1 where a full battery does not suffice:
            1 and what a full display lacks.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> leave = forecast.soc_needed(reserve=0.2, probability=0.95)
        >>> round(forecast.leaving_with(leave).p_arrive(0.2), 3)
        0.95
        """
        reserve = require_fraction("reserve", reserve)
        probability = require_fraction("probability", probability, 0.5)
        own = self.plan.departure.soc if self.measured is NOT_MEASURED else None

        def spare(soc: float) -> float:
            return (self if soc == own else self.leaving_with(soc))._spare(reserve, probability)

        return charge_with_spare(spare, 0.5 if own is None else own)

    def _spare(self, reserve: float, probability: float) -> float:
        """Displayed charge beyond what is needed, at the place where it is least, that is exceeded with a probability."""
        return float((self.soc_along(probability) - self._least_charge(reserve)).min())

    def _least_charge(self, reserve: float) -> FloatArray:
        """Displayed charge that each edge of the segments has to be passed with: none before the last reading."""
        least = np.where(self._ends_s > self._charge_start[0], 0.0, -np.inf)
        least[-1] = reserve
        return least

    def soc_along(self, probability: float) -> FloatArray:
        """Displayed charge at the edges of the segments that is exceeded with a probability.

        Not held in 0..1; the positions are those of `series`.

        Parameters
        ----------
        probability : float
            0 to 1.

        Returns
        -------
        ndarray, shape (segments + 1,)
            Displayed state of charge.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> bool((forecast.soc_along(0.95) <= forecast.soc_along(0.5)).all())
        True
        """
        probability = require_fraction("probability", probability)
        centre, sd = self._charge_band
        wh = self.charge.wh_per_display
        return np.asarray(centre - self._excess.quantile(probability, sd * wh) / wh)

    @property
    def empty_at_m(self) -> tuple[float | None, float | None, float | None]:
        """Distance at which the display reaches 0 [m]: early, expected and late, at the ends of the 90 % band.

        None where it does not on this trip.
        """
        early, expected, late = (first_empty(charge, self.drive.distance_m) for charge in self._arrival_band)
        return early, expected, late

    @property
    def missing_wh(self) -> tuple[float, float, float]:
        """Energy that the trip takes beyond what the battery holds [Wh]: least, expected and most, of the 90 % band.

        0 where the battery holds enough. On the way it counts where the charge is lowest.
        """
        least, expected, most = (self._missing_wh(charge) for charge in reversed(self._arrival_band))
        return least, expected, most

    def _missing_wh(self, charge: FloatArray) -> float:
        """Energy that a displayed charge at the edges of the segments lacks where it is lowest [Wh]."""
        ahead = np.isfinite(self._least_charge(0.0))
        return max(-float(charge[ahead].min()), 0.0) * self.charge.wh_per_display

    def series(self) -> pd.DataFrame:
        """Along the route, a row at the end of each segment and one at the start.

        Returns
        -------
        DataFrame
            `time_s, distance_m, energy_wh, energy_low_wh, energy_high_wh, displayed_soc, displayed_soc_low,
            displayed_soc_high`; the band is the central 90 %.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> abs(forecast.series()["energy_wh"].iloc[-1] / forecast.energy_wh - 1.0) < 1e-9
        np.True_
        """
        return pd.DataFrame(self._series())

    def _series(self) -> dict[str, FloatArray]:
        energy, sd = self.energy_along_wh, self.energy_sd_wh
        low, middle, high = (np.clip(charge, 0.0, 1.0) for charge in self._arrival_band)
        return {
            "time_s": self._ends_s,
            "distance_m": self.drive.distance_m,
            "energy_wh": energy,
            "energy_low_wh": possible_energy(
                energy, -self._excess.quantile(1.0 - ARRIVAL_BAND[0], sd), self._least_wh
            ),
            "energy_high_wh": energy + self._excess.quantile(1.0 - ARRIVAL_BAND[2], sd),
            "displayed_soc": middle,
            "displayed_soc_low": low,
            "displayed_soc_high": high,
        }

    @property
    def by_cause_wh(self) -> dict[str, float]:
        """Energy by cause [Wh]; the parts add up to `energy_wh`. Losses inside the battery are not among them."""
        parts, table = self.drive.simulation.by_cause_wh, self.drive.table
        simulated = float(table.simulated_w @ table.hours)
        parts["climate"] += simulated - sum(parts.values())  # rounding of the segments' ends
        parts["correction"] = self.energy_wh - simulated
        if self._climb is not None:
            expected = float(self._excess.expected_wh[-1])
            parts["climb"] += expected
            parts["correction"] -= expected
        return parts

    @property
    def battery_loss_wh(self) -> float:
        """Heat in the battery itself [Wh], beside the energy at its terminals."""
        simulation = self.drive.simulation
        step = np.diff(simulation.time_s, prepend=simulation.time_s[0])
        return float(simulation.battery_loss_w @ step / SECONDS_PER_HOUR)

    def climb_to(self, reserve: float = 0.0) -> float | None:
        """Net climb of the rest of an unknown road with which the expected charge at arrival falls to a reserve.

        Parameters
        ----------
        reserve : float
            Displayed state of charge to arrive with, 0 to 1.

        Returns
        -------
        float or None
            Climb [m], 0 where the reserve is not reached on a flat road either; None where the heights are known, or where no road of
            this length and terrain climbs so far.

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
        spare = (float(self._charge_band[0][-1]) - reserve) * self.charge.wh_per_display
        spare += float(self._excess.expected_wh[-1])
        climb = self.climbing.climb_for(max(spare, 0.0), self._climbs_from_m)
        return climb if math.isfinite(climb) else None

    @property
    def soc_per_climb_m(self) -> float | None:
        """Displayed charge that each metre of climb takes on the rest of an unknown road [1/m]; None where the heights are known."""
        if self.climbing is None:
            return None
        return self.climbing.more_wh(100.0, self._climbs_from_m) / 100.0 / self.charge.wh_per_display

    def difference(self, other: Forecast) -> Difference:
        """Compare with another forecast of the same car, driver and day, on this road or another.

        Parameters
        ----------
        other : Forecast
            By the same model, before departure.

        Returns
        -------
        Difference
            This forecast less the other one. Its interval is narrower than that of two independent forecasts: what both share cancels.

        Raises
        ------
        InvalidInput
            When they are of two models, or one was updated on the way.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 30_000.0, "speed_m_s": 25.0}])
        >>> cold, mild = (tw.forecast(plan, tw.Departure(ambient_temperature_degc=t)) for t in (0.0, 15.0))
        >>> more = cold.difference(mild)
        >>> more.energy_wh > 0.0, more.sd_wh < cold.sd_wh
        (True, True)
        """
        return difference(self, other)

    def with_route_error(
        self, route: RouteUncertainty | None, free_flow: FreeFlowUncertainty | None = None
    ) -> Forecast:
        """The forecast with the uncertainty of its planned route; that of a driven trace stays as it is.

        The standard deviation of the whole trip becomes ``sqrt(own² + (share · energy)²)``; on the way, the second
        part is in proportion to the time to go. Where the travel times are those of an empty road, their share takes the
        place of that of the links, which it contains.

        Parameters
        ----------
        route : RouteUncertainty or None
            Error of speed profiles that are made from links, by their length; None where it was not estimated.
        free_flow : FreeFlowUncertainty, optional
            Error of the travel times of an empty road.

        Returns
        -------
        Forecast
            With flags for what is not known of the route.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> certain = forecast.with_route_error(None)
        >>> certain.sd_wh < forecast.sd_wh, [flag.code for flag in certain.flags if "route" in flag.code]
        (True, ['route_error_unknown'])
        """
        return with_route_error(self, route, free_flow)

    @one_blas_thread
    def update(self, observed: pd.DataFrame) -> Forecast:
        """Forecast again from what was measured so far. O(samples + segments).

        Parameters
        ----------
        observed : DataFrame
            Samples as for `update_since_departure`, but `time_s` on the clock of the plan's file (`plan.start_s` is
            the departure); 0 at departure for a planned route.

        Returns
        -------
        Forecast
            Of the same trip: what was measured, and the rest.

        Raises
        ------
        InvalidInput
            With every fault of the samples: also when they begin before the trip or after it, or when their current
            has the wrong sign.

        Examples
        --------
        >>> import tripwatt as tw
        >>> trip = tw.synthetic_fleet(1).trips[0]
        >>> before = tw.load_model().forecast(trip)
        >>> after = before.update(trip.samples[trip.samples["time_s"] <= 0.5 * trip.duration_s])
        >>> after.sd_wh < before.sd_wh
        True
        """
        return updated(self, since_departure(columns_measured(observed), self.plan))

    @one_blas_thread
    def update_since_departure(self, observed: pd.DataFrame) -> Forecast:
        """Forecast again from what was measured so far, timed from the departure. O(samples + segments).

        Parameters
        ----------
        observed : DataFrame
            Samples, `time_s` in seconds since departure. With `voltage_v` and `current_a`, or with
            `observed_energy_wh` in their place, each measured segment counts; gaps stay unmeasured. With
            `heating_power_w` and `aircon_power_w` beside them, climate control is updated separately. Without energy,
            `soc` or `displayed_soc` counts. On a planned route `speed_m_s` gives the distance driven; without it, the
            car is assumed to be where it was planned to be.

        Returns
        -------
        Forecast
            Of the same trip: what was measured, and the rest.

        Raises
        ------
        InvalidInput
            With every fault of the samples; also when they have more energy than the battery holds, a charge that
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
    def to_dict(self, reserve: float | None = None, probability: float | None = None) -> ForecastResponse:
        """Plain values, as the command line and the service give them.

        Parameters
        ----------
        reserve : float, optional
            Displayed state of charge to arrive with: one more entry of `p_arrive_by_soc`.
        probability : float, optional
            0.5 to 1: also the charge to leave with, to arrive with the reserve (0 without one) with this probability.

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
        return forecast_document(self, reserve, probability)

    @one_blas_thread
    def to_frame(self) -> pd.DataFrame:
        """Give what `series` gives.

        Returns
        -------
        DataFrame
            A row at the end of each segment and one at the start.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> list(forecast.to_frame().columns[:3])
        ['time_s', 'distance_m', 'energy_wh']
        """
        return self.series()

    def plot(self, ax: Axes | None = None) -> Figure:
        """Energy and state of charge along the trip with their bands, and the energy by cause.

        Parameters
        ----------
        ax : Axes, optional
            Whose place the panels take; a new figure without them.

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
        return plot_forecast(self.series(), self.by_cause_wh, title, self.measured_until_s, ax)

    def __repr__(self) -> str:
        low, high = self.interval(BAND)
        n = len(self.flags)
        flags = f", {n} flag{'s' * (n > 1)}" if n else ""
        return (
            f"<Forecast {self.plan.trip_id}: {self.energy_wh / 1000.0:.2f} kWh, {BAND:.0%} interval "
            f"{low / 1000.0:.2f} to {high / 1000.0:.2f} kWh, arrival with {self.soc_arrival:.0%}{flags}>"
        )

    def _repr_html_(self) -> str:
        return html_table(f"Forecast {self.plan.trip_id}", table_rows(self))

    @cached_property
    def energy_along_wh(self) -> FloatArray:
        """Energy up to each edge of the segments [Wh], shape (segments + 1,)."""
        return np.concatenate(([0.0], np.cumsum(self.segment_energy_wh)))

    @cached_property
    def energy_sd_wh(self) -> FloatArray:
        """Standard deviation of the energy up to each edge of the segments [Wh] apart from an unknown climb, shape (segments + 1,)."""
        own = self.sd_factor * self.rest_sd_factor * self.posterior.energy_wh(self.open_hours)[1]
        return np.concatenate(([0.0], np.hypot(own, remaining_sd_wh(self))))

    @cached_property
    def _climb(self) -> UnknownClimb | None:
        """What the unknown climb of the rest of the way may add; None where the road is known."""
        return None if self.climbing is None else self.climbing.ahead(self._climbs_from_m)

    @property
    def _climbs_from_m(self) -> float:
        """Distance from which on the climb was not measured [m]."""
        anchor = self.measured.anchor
        until = self.measured.until_s if self.measured.hours is not None or anchor is None else anchor.time_s
        return float(np.interp(until, self._ends_s, self.drive.distance_m))

    @cached_property
    def _excess(self) -> Excess:
        """Distribution of what the trip takes more than expected up to each edge."""
        return Excess.from_climb(self.uncertainty.scores, self._climb, self.energy_sd_wh)

    @cached_property
    def _least_wh(self) -> FloatArray:
        """Least energy up to each edge of the segments [Wh], shape (segments + 1,)."""
        ahead, measured = self.drive.least_w * self.open_hours, self.measured.energy_wh
        least = np.concatenate(([0.0], np.cumsum(ahead if measured is None else measured + ahead)))
        return least if self._climb is None else np.asarray(least + self._climb.offsets_wh.min(axis=0))

    @property
    def _charge_start(self) -> tuple[float, float, bool]:
        """Time [s] and displayed charge of the last reading or at departure; whether the display itself was read."""
        anchor, departure = self.measured.anchor, self.plan.departure
        read = anchor is not None and anchor.displayed and not anchor.charged
        if anchor is not None and read and min(anchor.value, departure.soc or 0.0) >= FULL:
            anchor = None  # still full: what it hid at departure is known better than what it hides now
        if anchor is not None:
            converted = float(self.charge.displayed(anchor.value)) + (display_offset(self) or 0.0)
            return anchor.time_s, anchor.value if anchor.displayed else converted, anchor.displayed
        if departure.soc is not None:
            return 0.0, departure.soc, True
        if departure.bms_soc is not None:
            return 0.0, float(self.charge.displayed(departure.bms_soc)), False
        return 0.0, float(self.vehicle.battery.displayed_from_soc(self.drive.departure_soc)), True

    @cached_property
    def _charge_band(self) -> tuple[FloatArray, FloatArray]:
        """Displayed charge at each edge of the segments and its standard deviation; not held in 0..1."""
        time, start, displayed = self._charge_start
        taken = self.energy_along_wh - self._energy_at(time)
        energy_sd = self.energy_sd_wh / self.charge.wh_per_display
        by_change = not displayed and display_offset(self) is not None
        error = self.charge.sd(self.energy_along_wh if by_change else taken, displayed or by_change)
        own_sd = np.where((self._ends_s > time) | (not displayed), error, 0.0)
        return np.asarray(self.charge.left(start, taken, displayed)), np.asarray(np.hypot(energy_sd, own_sd))

    @cached_property
    def _arrival_band(self) -> tuple[FloatArray, ...]:
        """Displayed charge along the way: low end, middle and high end of the 90 % band, each of shape (segments + 1,)."""
        low, _, high = ARRIVAL_BAND
        return self.soc_along(low), self._expected_charge, self.soc_along(high)

    @cached_property
    def _expected_charge(self) -> FloatArray:
        """Middle of the band of the displayed charge along the way, shape (segments + 1,)."""
        return self.soc_along(ARRIVAL_BAND[1])

    @property
    def _ends_s(self) -> FloatArray:
        return np.concatenate(([0.0], np.cumsum(self.drive.table.hours) * SECONDS_PER_HOUR))

    def _energy_at(self, time_s: float) -> float:
        return float(np.interp(time_s, self._ends_s, self.energy_along_wh))


def display_offset(forecast: Forecast) -> float | None:
    """What the display showed at departure beyond the converted charge of the battery management; None where unknown.

    It holds on the way: the level of the conversion has a larger error than its change.
    """
    anchor, shown, charge = forecast.measured.anchor, forecast.plan.departure.soc, forecast.charge
    first = None if anchor is None or anchor.displayed else anchor.first
    if first is None or shown is None or first.time_s > FIRST_S:
        return None
    offset = charge.left(shown, forecast._energy_at(first.time_s)) - charge.displayed(first.value)
    return float(offset) if abs(offset) <= MOST_OFFSET * charge.managed_sd else None


def _ends(level: float) -> tuple[float, float]:
    """Probabilities below the ends of a central interval.

    Raises
    ------
    InvalidInput
        For a level that is no fraction, and for 1: errors have no bound.
    """
    half = 0.5 * require_fraction("level", level)
    if half == 0.5:
        raise InvalidInput.of("no interval holds every trip", "level", f"{level}", "0 to less than 1")
    return 0.5 - half, 0.5 + half


def quantiles(forecast: Forecast, p: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """Quantiles at the end of the trip: of its energy [Wh] and of the displayed charge, each of shape (probabilities,).

    See `Forecast.quantile` and `Forecast.soc_quantile`.
    """
    levels, wh = np.array(p, dtype=np.float64), forecast.charge.wh_per_display
    centre, sd = (values[-1] for values in forecast._charge_band)
    sd_wh = np.repeat([forecast.energy_sd_wh[-1], sd * wh], len(p))
    more = forecast._excess.end.quantiles(np.concatenate((levels, 1.0 - levels)), sd_wh)
    half, more_wh = np.abs(more[: len(p)]), more[len(p) :]
    below = possible_energy(forecast.energy_wh, half, forecast._least_wh[-1])
    energy_wh = np.where(levels >= 0.5, forecast.energy_wh + half, below)
    return energy_wh, np.clip(centre - more_wh / wh, 0.0, 1.0)


def by_probability(values: FloatArray, p: Sequence[float]) -> dict[str, float]:
    """Quantiles as plain values, by their probability."""
    return {f"{level:g}": value for level, value in zip(p, values.tolist(), strict=True)}


def updated(forecast: Forecast, observed: Columns) -> Forecast:
    """A forecast after what was measured so far, timed from the departure: see `Forecast.update_since_departure`."""
    drive, uncertainty = forecast.drive, forecast.uncertainty
    samples = checked_samples(observed, forecast.plan)
    raise_faults(implausible_faults(observed, drive))
    measured, readings = read_measured(samples, drive, uncertainty.process)
    posterior, factor = updated_power(drive, uncertainty, samples, measured, readings)
    return with_empty_flag(replace(forecast, posterior=posterior, rest_sd_factor=factor, measured=measured))


def forecast_again(forecast: Forecast, soc: float, read_s: float) -> Forecast:
    """A forecast from another charge; on the way, from that charge at the time of the last reading [s]."""
    departure = Departure(soc=soc)  # checks it
    if forecast.maker is None or forecast.measured is not NOT_MEASURED:
        charged = ChargeReading(read_s, soc, displayed=True, charged=True)
        return with_empty_flag(replace(forecast, measured=replace(forecast.measured, anchor=charged)))
    again = forecast.maker(forecast.plan.with_departure(departure))
    kept = (flag for flag in forecast.flags if flag.code not in OF_CHARGE)
    flags = tuple(dict.fromkeys((*kept, *again.flags)))
    return replace(again, state_sd_wh=forecast.state_sd_wh, flags=flags)


def with_empty_flag(forecast: Forecast) -> Forecast:
    """The forecast with the flag of a battery that does not hold what the trip takes, where that is expected."""
    gone = {"battery_empty"} | ({"soc_assumed"} if forecast.measured.anchor is not None else set())
    flags = tuple(flag for flag in forecast.flags if flag.code not in gone)
    missing = forecast._missing_wh(forecast._expected_charge)
    if missing > 0.0:
        return replace(forecast, flags=(*flags, Flag("battery_empty", "battery", missing, "wh")))
    # as it is where nothing changes, with what was worked out of it
    return forecast if len(flags) == len(forecast.flags) else replace(forecast, flags=flags)


def charge_with_spare(spare: Callable[[float], float], near: float = 0.5) -> float:
    """The charge, 0 to 1, with which nothing is spare; 0 where every charge has some, above 1 where a full one lacks.

    A charge more leaves about as much more, so that the secant from a charge nearby needs few steps; where it leaves the interval of
    the root, that is halved.

    Examples
    --------
    >>> round(charge_with_spare(lambda soc: soc**2 - 0.25), 5)
    0.5
    >>> charge_with_spare(lambda soc: soc + 0.1), charge_with_spare(lambda soc: soc - 1.5)
    (0.0, 1.5)
    """
    low, high, soc, slope = 0.0, 1.0, near, 1.0
    before: tuple[float, float] | None = None
    for step in itertools.count():
        left = spare(soc)
        if (soc == 0.0 and left >= 0.0) or 0.0 <= left <= 2.0 * SOC_PRECISION:
            return soc
        if soc == 1.0 and left < 0.0:
            return 1.0 - left
        low, high = (soc, high) if left < 0.0 else (low, soc)
        if high - low <= SOC_PRECISION:
            return high
        if before is not None and before[0] != soc:
            slope = (left - before[1]) / (soc - before[0])
        before = soc, left
        has_guess = slope > 0.0 and step < MOST_SECANTS
        guess = soc - (left - SOC_PRECISION) / slope if has_guess else math.nan
        is_end = (low == 0.0 and guess <= low) or (high == 1.0 and guess >= high)
        soc = min(max(guess, low), high) if is_end or low < guess < high else 0.5 * (low + high)
    raise AssertionError("unreachable: the interval is halved until it is narrow")


def difference(one: Forecast, other: Forecast) -> Difference:
    """What `one` takes more than `other`: see `Forecast.difference`."""
    if one.vehicle != other.vehicle or one.measured_until_s or other.measured_until_s:
        got = "of two cars" if one.vehicle != other.vehicle else "one that was updated on the way"
        allowed = "two forecasts of one car by one model before departure"
        raise InvalidInput.of("forecasts without a common part", "forecasts", got, allowed)
    ours, theirs = one.by_cause_wh, other.by_cause_wh
    causes = {cause: wh - theirs[cause] for cause, wh in ours.items()}
    simulated = (wh for cause, wh in causes.items() if cause != "correction")
    return Difference(
        one.energy_wh - other.energy_wh,
        sd_between(
            _shared(one, ours["climate"]), _shared(other, theirs["climate"]), one.uncertainty.scale, simulated
        ),
        one.plan.duration_s - other.plan.duration_s,
        one.soc_arrival - other.soc_arrival,
        causes,
        one.uncertainty.scores,
    )


def _shared(forecast: Forecast, climate_wh: float) -> Shared:
    drive, hours = forecast.drive, forecast.drive.table.hours
    climb, route, link_m = forecast._climb, forecast.uncertainty.route, forecast.plan.link_m
    return Shared(
        forecast.uncertainty.scale.course.hours(float(hours.sum())),
        float((drive.segments.moved_w * hours).sum()),
        drive.segments.net_wh,
        (hours[:, None] * drive.corrector.predict_with_uncertainty(drive.table)[1]).sum(axis=0),
        drive.segments.outside_sd_wh,
        forecast.state_sd_wh,
        forecast.route_sd_wh,
        0.0 if route is None or link_m is None else route.share(link_m) * abs(forecast.energy_wh),
        0.0 if climb is None else float(climb.core_sd_wh[-1]),
        climate_wh,
        float(drive.distance_m[-1]),
    )


def remaining_sd_wh(forecast: Forecast) -> FloatArray:
    """The parts of route and unknown state, in proportion to the time that was not measured, fully correlated [Wh], shape (segments,)."""
    ahead, anchor = forecast.open_hours, forecast.measured.anchor
    if forecast.measured.hours is None and anchor is not None:  # the state of charge was read up to here
        step_s = forecast.drive.segments.step_s
        ahead = ahead * np.clip((forecast.drive.edges_s[1:] - anchor.time_s) / step_s, 0.0, 1.0)
    whole = np.hypot(forecast.route_sd_wh, forecast.state_sd_wh)
    return np.asarray(whole * np.cumsum(ahead) / forecast.drive.table.hours.sum())


def forecast_document(
    forecast: Forecast, reserve: float | None, probability: float | None
) -> ForecastResponse:
    """A forecast as plain values: see `Forecast.to_dict`."""
    levels = ARRIVAL_LEVELS if reserve is None else (*ARRIVAL_LEVELS, require_fraction("reserve", reserve))
    early, expected, late = forecast.empty_at_m
    least, middle, most = forecast.missing_wh
    energies_wh, charges = quantiles(forecast, QUANTILES)
    return {
        "trip": forecast.plan.trip_id,
        "given": forecast.given,
        "energy_wh": forecast.energy_wh,
        "quantiles_wh": by_probability(energies_wh, QUANTILES),
        "soc_arrival": forecast.soc_arrival,
        "soc_quantiles": by_probability(charges, QUANTILES),
        "wh_per_display": forecast.charge.wh_per_display,
        "empty_at_m": {"early": early, "expected": expected, "late": late},
        "missing_wh": {"least": least, "expected": middle, "most": most},
        "p_arrive_by_soc": {f"{level:g}": forecast.p_arrive(level) for level in levels},
        "climb": climb_document(forecast, levels),
        "leave_with": None if probability is None else leave_document(forecast, reserve or 0.0, probability),
        "series": Series(**{name: values.tolist() for name, values in forecast._series().items()}),  # type: ignore[typeddict-item]
        "by_cause_wh": forecast.by_cause_wh,
        "battery_loss_wh": forecast.battery_loss_wh,
        "measured_until_s": forecast.measured_until_s,
        "flags": [FlagDocument(**flag_to_dict(flag)) for flag in forecast.flags],  # type: ignore[typeddict-item]
    }


def with_route_error(
    forecast: Forecast, route: RouteUncertainty | None, free_flow: FreeFlowUncertainty | None
) -> Forecast:
    """A forecast with the uncertainty of its planned route: see `Forecast.with_route_error`."""
    link_m = forecast.plan.link_m
    flags = [*forecast.flags, *(flag for flag in forecast.plan.flags if flag != FLAT_ROAD)]
    if link_m is None:
        return with_empty_flag(replace(forecast, flags=tuple(dict.fromkeys(flags))))
    route_sd_wh = 0.0
    if route is None:
        flags.append(Flag("route_error_unknown", "links"))
    elif forecast.plan.free_flow and free_flow is not None:
        route_sd_wh = free_flow.share(forecast.plan.distance_m) * abs(forecast.energy_wh)
        flags.append(Flag("free_flow_times", "road"))
    else:
        route_sd_wh = route.share(link_m) * abs(forecast.energy_wh)
        if forecast.plan.free_flow:
            flags.append(Flag("travel_time_error_unknown", "road"))
        if link_m > float(route.length_m[-1]):
            flags.append(Flag("links_too_long", "links", link_m, "m"))
    wider = replace(forecast, route_sd_wh=route_sd_wh, flags=tuple(dict.fromkeys(flags)))
    return with_empty_flag(wider)


def climb_document(forecast: Forecast, levels: tuple[float, ...]) -> UnknownClimbDocument | None:
    """What the climb of a road of unknown heights changes, as plain values; None where they are known."""
    soc_per_m = forecast.soc_per_climb_m
    if soc_per_m is None:
        return None
    return {
        "terrain": forecast.plan.departure.terrain or "unknown",
        "soc_per_m": soc_per_m,
        "changes_at_m": {f"{level:g}": forecast.climb_to(level) for level in levels},
    }


def leave_document(forecast: Forecast, reserve: float, probability: float) -> LeaveWith:
    """The charge to leave with as plain values, with its sentence."""
    needed = forecast.soc_needed(reserve, probability)
    sentence = leave_in_words(needed, reserve, probability)
    return {"soc_needed": needed, "reserve": reserve, "probability": probability, "message": sentence}


def table_rows(forecast: Forecast) -> list[tuple[str, str]]:
    """What a notebook shows of a forecast: names and values."""
    (low, high), (least, most) = forecast.interval(BAND), forecast.soc_interval(BAND)
    return [
        ("energy", f"{forecast.energy_wh / 1000.0:.2f} kWh"),
        (f"{BAND:.0%} interval", f"{low / 1000.0:.2f} to {high / 1000.0:.2f} kWh"),
        ("state of charge at arrival", f"{forecast.soc_arrival:.0%} ({least:.0%} to {most:.0%})"),
        ("probability to arrive", f"{forecast.p_arrive():.1%}"),
        ("given", forecast.given),
        *(("note", message(flag)) for flag in forecast.flags),
    ]


def first_empty(charge: FloatArray, distance_m: FloatArray) -> float | None:
    """Distance at which a charge at each edge of the segments reaches 0 [m]; None where it does not.

    Examples
    --------
    >>> first_empty(np.array([0.1, 0.05, -0.05]), np.array([0.0, 1000.0, 2000.0]))
    1500.0
    """
    empty = np.flatnonzero(charge <= 0.0)
    if not len(empty):
        return None
    k = int(empty[0])
    if k == 0:
        return 0.0
    share = charge[k - 1] / (charge[k - 1] - charge[k])
    return float(distance_m[k - 1] + share * (distance_m[k] - distance_m[k - 1]))


def p_above(forecast: Forecast, displayed_soc: float) -> float:
    """Probability that the charge at arrival, not held in 0..1, is at least a value, which may lie outside of 0..1 as well."""
    centre, sd = (values[-1:] for values in forecast._charge_band)
    wh = forecast.charge.wh_per_display
    return float(forecast._excess.end.probability_below((centre - displayed_soc) * wh, sd * wh)[0])


def possible_energy(centre_wh: Any, half_wh: Any, least_wh: Any) -> Any:
    """Energy that lies `half_wh` below a centre, but above the least energy; arrays of one shape, or numbers [Wh].

    The distance is taken as it is over `STRAIGHT` of the way to the least energy. What is left of the way then falls
    exponentially: the result falls with `half_wh` and never reaches the least energy. Without a way down, the distance
    counts as it is.

    Examples
    --------
    >>> float(possible_energy(1000.0, 300.0, 200.0)), round(float(possible_energy(1000.0, 1000.0, 200.0)), 2)
    (700.0, 227.07)
    """
    way = np.asarray(centre_wh, dtype=np.float64) - least_wh
    open_ = way > 0.0
    straight = STRAIGHT * way
    rest = np.where(open_, (1.0 - STRAIGHT) * way, 1.0)
    squeezed = least_wh + rest * np.exp(-np.maximum(half_wh - straight, 0.0) / rest)
    return np.where(open_ & (half_wh > straight), squeezed, centre_wh - half_wh)


def distance_below(centre_wh: float, energy_wh: float, least_wh: float) -> float:
    """The `half_wh` with which `possible_energy` gives an energy; negative above the centre, infinite below the least."""
    way, below = centre_wh - least_wh, centre_wh - energy_wh
    if way <= 0.0 or below <= STRAIGHT * way:
        return below
    if energy_wh <= least_wh:
        return math.inf
    rest = (1.0 - STRAIGHT) * way
    return STRAIGHT * way - rest * math.log((energy_wh - least_wh) / rest)
