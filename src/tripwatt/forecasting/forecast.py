"""One forecast: energy and state of charge along the trip with their intervals, by cause, and its update on the way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.forecasting.expected import ExpectedDrive
from tripwatt.forecasting.measured import Measured, checked_samples, read_measured, since_departure
from tripwatt.forecasting.update import updated_power
from tripwatt.trips import Flag, Plan
from tripwatt.trips.messages import flag_to_dict, message
from tripwatt.trips.showing import html_table
from tripwatt.uncertainty import PowerPosterior, RouteUncertainty, UncertaintyModel
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUANTILES: Final = (0.025, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.975)
ARRIVAL_LEVELS: Final = (0.0, 0.05, 0.1, 0.2)
BAND: Final = 0.9
DRIVEN: Final = "the driven speed trace"
PLANNED: Final = "a planned route"
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
    posterior : PowerPosterior
        Residual power of the segments: mean 0 before departure.
    sd_factor : float
        Standard deviation of the trip's energy over that of the process, from held-out trips.
    rest_sd_factor : float
        The same factor for the rest of the trip on the way; 1 before departure.
    widening : float
        Factor of the standard deviation for values outside the range of the training trips.
    route_sd_wh : float
        Standard deviation that a planned route adds to the trip's energy [Wh]; 0 for a driven trace.
    flags : tuple of Flag
    measured : Measured
        What was measured so far.
    """

    drive: ExpectedDrive
    uncertainty: UncertaintyModel
    posterior: PowerPosterior
    sd_factor: float = 1.0
    rest_sd_factor: float = 1.0
    widening: float = 1.0
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
        """Quantile of the energy of the whole trip [Wh]."""
        factor = self.uncertainty.scores.factor(abs(2.0 * p - 1.0))
        return self.energy_wh + float(np.sign(p - 0.5)) * factor * self.sd_wh

    def interval(self, level: float) -> tuple[float, float]:
        """Central interval of the energy of the whole trip [Wh]."""
        half = self.uncertainty.scores.factor(level) * self.sd_wh
        return self.energy_wh - half, self.energy_wh + half

    def probability_below(self, energy_wh: float) -> float:
        """Probability that the trip takes less than `energy_wh`."""
        if self.sd_wh <= 0.0:
            return float(self.energy_wh <= energy_wh)
        return self.uncertainty.scores.probability((energy_wh - self.energy_wh) / self.sd_wh)

    @property
    def soc_arrival(self) -> float:
        """Displayed state of charge at the end of the trip; below 0 when the battery does not last."""
        return float(self._displayed_soc(np.array([self.energy_wh]))[0])

    def p_arrive(self, reserve: float = 0.0) -> float:
        """Probability to arrive with at least this displayed state of charge, 0 to 1."""
        time, start = self._anchor
        taken = (start - self.vehicle.battery.soc_from_displayed(reserve)) * self.drive.wh_per_soc
        return self.probability_below(taken + self._energy_at(time))

    def series(self) -> pd.DataFrame:
        """Along the route, a row at the end of each segment and one at the start.

        Returns
        -------
        DataFrame
            `time_s, distance_m, energy_wh, energy_low_wh, energy_high_wh, displayed_soc, displayed_soc_low,
            displayed_soc_high`; the band is the central 90 %.
        """
        return pd.DataFrame(self._series())

    def _series(self) -> dict[str, FloatArray]:
        energy = self._cumulative_wh
        half = self.uncertainty.scores.factor(BAND) * np.concatenate(([0.0], self._cumulative_sd_wh))
        low, high = energy - half, energy + half
        return {
            "time_s": self._ends_s,
            "distance_m": self.drive.distance_m,
            "energy_wh": energy,
            "energy_low_wh": low,
            "energy_high_wh": high,
            "displayed_soc": self._displayed_soc(energy),
            "displayed_soc_low": self._displayed_soc(high),
            "displayed_soc_high": self._displayed_soc(low),
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

    def with_route_error(self, route: RouteUncertainty | None) -> Forecast:
        """The forecast with the uncertainty of its planned route; that of a driven trace stays as it is.

        The standard deviation of the whole trip becomes ``sqrt(own² + (share · energy)²)``; on the way, the second
        part is in proportion to the time to go.
        """
        link_m = self.plan.link_m
        if link_m is None:
            return self
        flags = [*self.flags, *self.plan.flags]
        route_sd_wh = 0.0
        if route is None:
            flags.append(Flag("route_error_unknown", "links"))
        else:
            route_sd_wh = route.share(link_m) * abs(self.energy_wh)
            if link_m > float(route.length_m[-1]):
                flags.append(Flag("links_too_long", "links", link_m, "m"))
        return replace(self, route_sd_wh=route_sd_wh, flags=tuple(dict.fromkeys(flags)))

    def update(self, observed: pd.DataFrame) -> Forecast:
        """Forecast again from what was measured so far. O(segments^2 x measured segments).

        Parameters
        ----------
        observed : DataFrame
            Samples as for `update_since_departure`, but `time_s` on the clock of the plan's file (`plan.start_s` is
            the departure); 0 at departure for a planned route.

        Raises
        ------
        InvalidInput
            With every fault of the samples: also when they begin before the trip or after it, or when their current
            has the wrong sign.
        """
        return self.update_since_departure(since_departure(observed, self.plan))

    def update_since_departure(self, observed: pd.DataFrame) -> Forecast:
        """Forecast again from what was measured so far, timed from the departure. O(segments^2 x measured segments).

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

        Raises
        ------
        InvalidInput
            With every fault of the samples.
        """
        samples = checked_samples(observed, self.plan)
        measured, readings = read_measured(samples, self.drive, self.uncertainty.process)
        posterior, factor = updated_power(self.drive, self.uncertainty, samples, measured, readings)
        return replace(self, posterior=posterior, rest_sd_factor=factor, measured=measured)

    def to_dict(self, reserve: float | None = None) -> dict[str, Any]:
        """Plain values, as the command line and the service give them.

        Parameters
        ----------
        reserve : float, optional
            Displayed state of charge to arrive with: one more entry of `p_arrive`.
        """
        levels = ARRIVAL_LEVELS if reserve is None else (*ARRIVAL_LEVELS, reserve)
        return {
            "trip": self.plan.trip_id,
            "given": self.given,
            "energy_wh": self.energy_wh,
            "quantiles_wh": {f"{p:g}": self.quantile(p) for p in QUANTILES},
            "soc_arrival": self.soc_arrival,
            "p_arrive": {f"{level:g}": self.p_arrive(level) for level in levels},
            "series": {name: values.tolist() for name, values in self._series().items()},
            "by_cause_wh": self.by_cause_wh,
            "battery_loss_wh": self.battery_loss_wh,
            "measured_until_s": self.measured_until_s,
            "flags": [flag_to_dict(flag) for flag in self.flags],
        }

    def to_frame(self) -> pd.DataFrame:
        """As `series`."""
        return self.series()

    def plot(self) -> Figure:
        """Energy and state of charge along the trip with their bands, and the energy by cause."""
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
        return self.widening * np.asarray(np.hypot(own, self._remaining_route_sd_wh))

    @property
    def _remaining_route_sd_wh(self) -> FloatArray:
        """The route's part, in proportion to the time that was not measured, as if all links erred together [Wh]."""
        ahead, anchor = self.open_hours, self.measured.anchor
        if self.measured.hours is None and anchor is not None:  # the state of charge was read up to here
            step_s = self.drive.segments.step_s
            ahead = ahead * np.clip((self.drive.edges_s[1:] - anchor[0]) / step_s, 0.0, 1.0)
        return np.asarray(self.route_sd_wh * np.cumsum(ahead) / self.drive.table.hours.sum())

    @property
    def _anchor(self) -> tuple[float, float]:
        """Time [s] and state of charge (battery management's) of the last reading, or at departure."""
        return self.measured.anchor or (0.0, self.drive.departure_soc)

    @property
    def _ends_s(self) -> FloatArray:
        return np.concatenate(([0.0], np.cumsum(self.drive.table.hours) * SECONDS_PER_HOUR))

    def _energy_at(self, time_s: float) -> float:
        return float(np.interp(time_s, self._ends_s, self._cumulative_wh))

    def _displayed_soc(self, energy_wh: FloatArray) -> FloatArray:
        """Displayed state of charge after this energy was taken since departure."""
        time, soc = self._anchor
        soc_after = soc - (energy_wh - self._energy_at(time)) / self.drive.wh_per_soc
        return self.vehicle.battery.displayed_from_soc(np.asarray(soc_after))
