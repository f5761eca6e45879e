"""One forecast: energy and state of charge along the trip with their intervals, by cause, and its update on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.forecasting.expected import ExpectedDrive
from tripwatt.forecasting.measured import Measured, checked_samples, read_measured, since_departure
from tripwatt.forecasting.plausible import implausible_faults
from tripwatt.forecasting.update import updated_power
from tripwatt.parallel import one_blas_thread
from tripwatt.trips import Flag, Plan, raise_faults
from tripwatt.trips.messages import flag_to_dict, message
from tripwatt.trips.schema import require_fraction, require_number
from tripwatt.trips.showing import html_table
from tripwatt.uncertainty import (
    ChargeScale,
    ResidualPower,
    RouteUncertainty,
    UncertaintyModel,
)
from tripwatt.uncertainty.charge import FULL
from tripwatt.uncertainty.free_flow import FreeFlowUncertainty
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUANTILES: Final = (0.025, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.975)
ARRIVAL_LEVELS: Final = (0.0, 0.05, 0.1, 0.2)
BAND: Final = 0.9
STRAIGHT: Final = 0.75
"""Part of the way from the expected to the least energy over which a distance below counts as it is."""
DRIVEN: Final = "the driven speed trace"
PLANNED: Final = "a planned route"
FREE_FLOW: Final = "a planned route, free flow"
NOT_MEASURED: Final = Measured(0.0)


@dataclass(frozen=True, eq=False, repr=False)
class Forecast:
    """Forecast of one trip; `update` makes a new one.

    Attributes
    ----------
    drive : ExpectedDrive
        The plan, simulated and corrected.
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
    flags : tuple of Flag
        What was assumed, and what limits the forecast.
    measured : Measured
        What was measured so far.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
    >>> low, high = found.interval(0.9)
    >>> bool(low < found.energy_wh < high)
    True
    """

    drive: ExpectedDrive
    uncertainty: UncertaintyModel
    posterior: ResidualPower
    sd_factor: float = 1.0
    rest_sd_factor: float = 1.0
    state_sd_wh: float = 0.0
    route_sd_wh: float = 0.0
    flags: tuple[Flag, ...] = ()
    measured: Measured = NOT_MEASURED

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
        """Energy of each segment [Wh]: what was measured, and the mean power over the rest of it."""
        ahead = self.power_w * self.open_hours
        return ahead if self.measured.energy_wh is None else np.asarray(self.measured.energy_wh + ahead)

    @cached_property
    def energy_wh(self) -> float:
        """Energy of the whole trip [Wh]."""
        return float(self.segment_energy_wh.sum())

    @cached_property
    def sd_wh(self) -> float:
        """Standard deviation of the energy of the whole trip [Wh]."""
        return float(self._cumulative_sd_wh[-1])

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
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> found.quantile(0.5) == found.energy_wh
        True
        """
        half = self.uncertainty.scores.factor(abs(2.0 * require_fraction("p", p) - 1.0)) * self.sd_wh
        if p >= 0.5:
            return self.energy_wh + half
        return float(possible_energy(self.energy_wh, half, float(self._least_wh[-1])))

    def interval(self, level: float) -> tuple[float, float]:
        """Central interval of the energy of the whole trip [Wh].

        Parameters
        ----------
        level : float
            Probability of the interval, 0 to 1.

        Returns
        -------
        tuple of float
            Lower and upper bound [Wh].

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> found.interval(0.9) == (found.quantile(0.05), found.quantile(0.95))
        True
        """
        half = 0.5 * require_fraction("level", level)
        return self.quantile(0.5 - half), self.quantile(0.5 + half)

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
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> round(found.probability_below(found.quantile(0.75)), 6)
        0.75
        """
        energy_wh = require_number("energy_wh", energy_wh)
        if self.sd_wh <= 0.0:
            return float(self.energy_wh <= energy_wh)
        below = distance_below(self.energy_wh, energy_wh, float(self._least_wh[-1]))
        return self.uncertainty.scores.probability(-below / self.sd_wh)

    @cached_property
    def charge(self) -> ChargeScale:
        """Energy by displayed charge: as learned from the car's trips, else of its published values."""
        found = self.uncertainty.charge
        return found or ChargeScale.from_book(self.vehicle.battery, self.drive.wh_per_soc)

    @property
    def soc_arrival(self) -> float:
        """Displayed state of charge at the end of the trip, 0 to 1; 0 when the battery does not last."""
        return float(np.clip(self._charge_band[0][-1], 0.0, 1.0))

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
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> found.soc_quantile(0.05) < found.soc_arrival < found.soc_quantile(0.95) < 0.8
        True
        """
        centre, sd = (values[-1] for values in self._charge_band)
        half = self.uncertainty.scores.factor(abs(2.0 * require_fraction("p", p) - 1.0)) * sd
        return float(np.clip(centre + np.sign(p - 0.5) * half, 0.0, 1.0))

    def soc_interval(self, level: float) -> tuple[float, float]:
        """Central interval of the displayed state of charge at the end of the trip, 0 to 1.

        Parameters
        ----------
        level : float
            Probability of the interval, 0 to 1.

        Returns
        -------
        tuple of float
            Lower and upper bound, 0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> found.soc_interval(0.9) == (found.soc_quantile(0.05), found.soc_quantile(0.95))
        True
        """
        half = 0.5 * require_fraction("level", level)
        return self.soc_quantile(0.5 - half), self.soc_quantile(0.5 + half)

    def p_arrive(self, reserve: float = 0.0) -> float:
        """Probability to arrive with at least this displayed state of charge, 0 to 1.

        Energy, capacity and the display itself are uncertain.

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
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> found.p_arrive(0.1) > found.p_arrive(0.7)
        True
        """
        return p_above(self, require_fraction("reserve", reserve))

    def soc_needed(self, reserve: float = 0.1, probability: float = 0.95) -> float:
        """Displayed state of charge to leave with, to arrive with a reserve with a probability.

        Energy and its uncertainty are those of this forecast, whatever the charge at departure. Above 1 where a full
        battery does not suffice.

        Parameters
        ----------
        reserve : float
            Displayed state of charge to arrive with, 0 to 1.
        probability : float
            0.5 to 1.

        Returns
        -------
        float
            Displayed state of charge, 0 to 1, or above 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> leave = found.soc_needed(reserve=0.2, probability=0.95)
        >>> 0.2 < leave < 0.8
        True
        """
        reserve = require_fraction("reserve", reserve)
        probability = require_fraction("probability", probability, 0.5)
        _, start, _ = self._charge_start
        centre, sd = (float(values[-1]) for values in self._charge_band)
        lower = centre - self.uncertainty.scores.factor(abs(2.0 * probability - 1.0)) * sd
        return start + reserve - lower

    def soc_along(self, probability: float) -> FloatArray:
        """Displayed charge at the edges of the segments that is exceeded with a probability, 0.5 to 1.

        Not held in 0..1; the positions are those of `series`.

        Parameters
        ----------
        probability : float
            0.5 to 1.

        Returns
        -------
        ndarray, shape (segments + 1,)
            Displayed state of charge.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> bool((found.soc_along(0.95) <= found.soc_along(0.5)).all())
        True
        """
        level = 2.0 * require_fraction("probability", probability, 0.5) - 1.0
        centre, sd = self._charge_band
        return np.asarray(centre - self.uncertainty.scores.factor(level) * sd)

    @property
    def empty_at_m(self) -> tuple[float | None, float | None, float | None]:
        """Distance at which the display reaches 0 [m]: early, expected and late, at the ends of the 90 % band.

        None where it does not on this trip.
        """
        centre, sd = self._charge_band
        half = self.uncertainty.scores.factor(BAND) * sd
        early, expected, late = (self._first_empty(line) for line in (centre - half, centre, centre + half))
        return early, expected, late

    def _first_empty(self, charge: FloatArray) -> float | None:
        empty = np.flatnonzero(charge <= 0.0)
        if not len(empty):
            return None
        k, distance = int(empty[0]), self.drive.distance_m
        if k == 0:
            return 0.0
        share = charge[k - 1] / (charge[k - 1] - charge[k])
        return float(distance[k - 1] + share * (distance[k] - distance[k - 1]))

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
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> abs(found.series()["energy_wh"].iloc[-1] / found.energy_wh - 1.0) < 1e-9
        np.True_
        """
        return pd.DataFrame(self._series())

    def _series(self) -> dict[str, FloatArray]:
        energy, factor = self._cumulative_wh, self.uncertainty.scores.factor(BAND)
        half = factor * np.concatenate(([0.0], self._cumulative_sd_wh))
        charge, charge_sd = self._charge_band
        return {
            "time_s": self._ends_s,
            "distance_m": self.drive.distance_m,
            "energy_wh": energy,
            "energy_low_wh": possible_energy(energy, half, self._least_wh),
            "energy_high_wh": energy + half,
            "displayed_soc": np.clip(charge, 0.0, 1.0),
            "displayed_soc_low": np.clip(charge - factor * charge_sd, 0.0, 1.0),
            "displayed_soc_high": np.clip(charge + factor * charge_sd, 0.0, 1.0),
        }

    @property
    def by_cause_wh(self) -> dict[str, float]:
        """Energy by cause [Wh]; the parts add up to `energy_wh`. Losses inside the battery are not among them."""
        simulation, table = self.drive.simulation, self.drive.table
        parts = {cause: float(energy[-1]) for cause, energy in simulation.energy_by_cause_wh.items()}
        simulated = float(table.simulated_w @ table.hours)
        parts["hvac"] += simulated - sum(parts.values())  # rounding of the segments' ends
        parts["learned_correction"] = self.energy_wh - simulated
        return parts

    @property
    def battery_loss_wh(self) -> float:
        """Heat in the battery itself [Wh], beside the energy at its terminals."""
        simulation = self.drive.simulation
        step = np.diff(simulation.time_s, prepend=simulation.time_s[0])
        return float(simulation.battery_loss_w @ step / SECONDS_PER_HOUR)

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
            Error of speed profiles that are made from links, by their length; None where it was not learned.
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
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> certain = found.with_route_error(None)
        >>> certain.sd_wh < found.sd_wh, [flag.code for flag in certain.flags if "route" in flag.code]
        (True, ['route_error_unknown'])
        """
        link_m = self.plan.link_m
        flags = [*self.flags, *self.plan.flags]
        if link_m is None:
            return replace(self, flags=tuple(dict.fromkeys(flags)))
        route_sd_wh = 0.0
        if route is None:
            flags.append(Flag("route_error_unknown", "links"))
        elif self.plan.free_flow and free_flow is not None:
            route_sd_wh = free_flow.share(self.plan.distance_m) * abs(self.energy_wh)
            flags.append(Flag("free_flow_times", "road"))
        else:
            route_sd_wh = route.share(link_m) * abs(self.energy_wh)
            if self.plan.free_flow:
                flags.append(Flag("travel_time_error_unknown", "road"))
            if link_m > float(route.length_m[-1]):
                flags.append(Flag("links_too_long", "links", link_m, "m"))
        return replace(self, route_sd_wh=route_sd_wh, flags=tuple(dict.fromkeys(flags)))

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
        return self.update_since_departure(since_departure(observed, self.plan))

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
        samples = checked_samples(observed, self.plan)
        raise_faults(implausible_faults(observed, self.drive))
        measured, readings = read_measured(samples, self.drive, self.uncertainty.process)
        posterior, factor = updated_power(self.drive, self.uncertainty, samples, measured, readings)
        return replace(self, posterior=posterior, rest_sd_factor=factor, measured=measured)

    @one_blas_thread
    def to_dict(self, reserve: float | None = None) -> dict[str, Any]:
        """Plain values, as the command line and the service give them.

        Parameters
        ----------
        reserve : float, optional
            Displayed state of charge to arrive with: one more entry of `p_arrive`.

        Returns
        -------
        dict
            Numbers, texts, lists and further dicts only; energies [Wh], states of charge 0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> found.to_dict()["energy_wh"] == found.energy_wh
        True
        """
        levels = (
            ARRIVAL_LEVELS if reserve is None else (*ARRIVAL_LEVELS, require_fraction("reserve", reserve))
        )
        return {
            "trip": self.plan.trip_id,
            "given": self.given,
            "energy_wh": self.energy_wh,
            "quantiles_wh": {f"{p:g}": self.quantile(p) for p in QUANTILES},
            "soc_arrival": self.soc_arrival,
            "soc_quantiles": {f"{p:g}": self.soc_quantile(p) for p in QUANTILES},
            "wh_per_display": self.charge.wh_per_display,
            "empty_at_m": dict(zip(("early", "expected", "late"), self.empty_at_m, strict=True)),
            "p_arrive": {f"{level:g}": self.p_arrive(level) for level in levels},
            "series": {name: values.tolist() for name, values in self._series().items()},
            "by_cause_wh": self.by_cause_wh,
            "battery_loss_wh": self.battery_loss_wh,
            "measured_until_s": self.measured_until_s,
            "flags": [flag_to_dict(flag) for flag in self.flags],
        }

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
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> list(found.to_frame().columns[:3])
        ['time_s', 'distance_m', 'energy_wh']
        """
        return self.series()

    def plot(self) -> Figure:
        """Energy and state of charge along the trip with their bands, and the energy by cause.

        Returns
        -------
        matplotlib.figure.Figure
            Three panels.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> found = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> found.plot().savefig("forecast.png")  # doctest: +SKIP
        """
        from tripwatt.forecasting.plots import plot_forecast  # matplotlib is slow to import

        title = f"{self.plan.trip_id}: {self.energy_wh / 1000.0:.2f} kWh, given {self.given}"
        return plot_forecast(self.series(), self.by_cause_wh, title, self.measured_until_s)

    def __repr__(self) -> str:
        low, high = self.interval(BAND)
        return (
            f"<Forecast {self.plan.trip_id}: {self.energy_wh / 1000.0:.2f} kWh, {BAND:.0%} interval "
            f"{low / 1000.0:.2f} to {high / 1000.0:.2f} kWh, arrival with {self.soc_arrival:.0%}>"
        )

    def _repr_html_(self) -> str:
        low, high = self.interval(BAND)
        rows = [
            ("energy", f"{self.energy_wh / 1000.0:.2f} kWh"),
            (f"{BAND:.0%} interval", f"{low / 1000.0:.2f} to {high / 1000.0:.2f} kWh"),
            ("state of charge at arrival", f"{self.soc_arrival:.0%}"),
            ("probability to arrive", f"{self.p_arrive():.1%}"),
            ("given", self.given),
            *(("note", message(flag)) for flag in self.flags),
        ]
        return html_table(f"Forecast {self.plan.trip_id}", rows)

    @cached_property
    def _cumulative_wh(self) -> FloatArray:
        """Energy up to each edge of the segments [Wh], shape (segments + 1,)."""
        return np.concatenate(([0.0], np.cumsum(self.segment_energy_wh)))

    @cached_property
    def _cumulative_sd_wh(self) -> FloatArray:
        """Standard deviation of the energy up to the end of each segment [Wh], shape (segments,)."""
        own = self.sd_factor * self.rest_sd_factor * self.posterior.energy_wh(self.open_hours)[1]
        return np.asarray(np.hypot(own, self._remaining_sd_wh))

    @property
    def _remaining_sd_wh(self) -> FloatArray:
        """The parts of route and unknown state, in proportion to the time that was not measured, fully correlated [Wh]."""
        ahead, anchor = self.open_hours, self.measured.anchor
        if self.measured.hours is None and anchor is not None:  # the state of charge was read up to here
            step_s = self.drive.segments.step_s
            ahead = ahead * np.clip((self.drive.edges_s[1:] - anchor.time_s) / step_s, 0.0, 1.0)
        whole = np.hypot(self.route_sd_wh, self.state_sd_wh)
        return np.asarray(whole * np.cumsum(ahead) / self.drive.table.hours.sum())

    @cached_property
    def _least_wh(self) -> FloatArray:
        """Least energy up to each edge of the segments [Wh], shape (segments + 1,)."""
        ahead, measured = self.drive.least_w * self.open_hours, self.measured.energy_wh
        return np.concatenate(([0.0], np.cumsum(ahead if measured is None else measured + ahead)))

    @property
    def _charge_start(self) -> tuple[float, float, bool]:
        """Time [s] and displayed charge of the last reading or at departure; whether the display itself was read."""
        anchor, departure = self.measured.anchor, self.plan.departure
        if anchor is not None and anchor.displayed and min(anchor.value, departure.soc or 0.0) >= FULL:
            anchor = None  # still full: what it hid at departure is known better than what it hides now
        if anchor is not None:
            shown = anchor.value if anchor.displayed else float(self.charge.displayed(anchor.value))
            return anchor.time_s, shown, anchor.displayed
        if departure.soc is not None:
            return 0.0, departure.soc, True
        if departure.bms_soc is not None:
            return 0.0, float(self.charge.displayed(departure.bms_soc)), False
        return 0.0, float(self.vehicle.battery.displayed_from_soc(self.drive.departure_soc)), True

    @cached_property
    def _charge_band(self) -> tuple[FloatArray, FloatArray]:
        """Displayed charge at each edge of the segments and its standard deviation; not held in 0..1."""
        time, start, displayed = self._charge_start
        taken = self._cumulative_wh - self._energy_at(time)
        energy_sd = np.concatenate(([0.0], self._cumulative_sd_wh)) / self.charge.wh_per_display
        own_sd = np.where((self._ends_s > time) | (not displayed), self.charge.sd(taken, displayed), 0.0)
        return np.asarray(self.charge.left(start, taken, displayed)), np.asarray(np.hypot(energy_sd, own_sd))

    @property
    def _ends_s(self) -> FloatArray:
        return np.concatenate(([0.0], np.cumsum(self.drive.table.hours) * SECONDS_PER_HOUR))

    def _energy_at(self, time_s: float) -> float:
        return float(np.interp(time_s, self._ends_s, self._cumulative_wh))


def p_above(forecast: Forecast, displayed_soc: float) -> float:
    """Probability that the charge at arrival, not held in 0..1, is at least a value, which may lie outside of 0..1 as well."""
    centre, sd = (float(values[-1]) for values in forecast._charge_band)
    if sd <= 0.0:
        return float(centre >= displayed_soc)
    return forecast.uncertainty.scores.probability((centre - displayed_soc) / sd)


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
