"""One forecast: energy and state of charge along the trip with bands, why, and the same again on the way."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting.gain import Gain
from tripwatt.forecasting.observed import since_departure
from tripwatt.forecasting.planned import DRIVEN_S, along_the_plan, given_of, measured_energy, route_sd_wh
from tripwatt.forecasting.process import EXACT_W2, Belief, Blocks, ResidualProcess
from tripwatt.forecasting.scale import TotalScale
from tripwatt.forecasting.scores import Scores
from tripwatt.hybrid import BlockTable, PowerCorrector
from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.physics import Simulation
from tripwatt.routes.links import FLAT_ROAD
from tripwatt.trips import (
    Flag,
    FloatArray,
    Plan,
    raise_faults,
    structure_faults,
    value_faults,
)
from tripwatt.trips.messages import message
from tripwatt.trips.showing import html_table
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUANTILES: Final = (0.025, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.975)
ARRIVAL_LEVELS: Final = (0.0, 0.05, 0.1, 0.2)
BAND: Final = 0.9
GAP_S: Final = 15.0
"""A longer gap between samples leaves the blocks under it unmeasured."""
SOC_STEP: Final = 0.005
"""Smallest step that a logged state of charge is trusted to."""
CAPACITY_SD: Final = 0.03
"""Relative doubt of the energy behind a unit of state of charge: ageing and temperature."""
MOST_STRETCH: Final = 1.5
"""On a planned route, a block that took more than so many times as long as planned tells no power."""
MIN_COVER: Final = 0.8
"""Share of a block that has to be measured before it counts as observed: within a block, power changes with every
change of speed, so a part of it says little of the rest."""


@dataclass(frozen=True, eq=False, repr=False)
class Forecast:
    """Forecast of one trip; `update` makes a new one.

    Attributes
    ----------
    plan : Plan
        What was known at departure.
    table : BlockTable
    correction_w : ndarray, shape (blocks,)
        Learned correction of the power before departure [W].
    corrector : PowerCorrector
        Where it comes from; an update asks it for the part of climate control.
    belief : Belief
        Of the residual power that remains: mean 0 before departure.
    spread : float
        Standard deviation of the trip's energy over that of the process: the scale that held-out trips showed.
    rest_spread : float
        The same factor for what is left on the way; 1 before departure.
    widening : float
        Factor of the standard deviation for what training never saw.
    route_doubt_wh : float
        Standard deviation that a planned route adds to the trip's energy [Wh]; 0 for a driven trace.
    measured_until_s : float
        Time up to which the trip was measured [s since departure]; 0 before departure.
    measured_wh, measured_hours : ndarray or None, shape (blocks,)
        Energy that was measured in each block, and for how long; None before departure.
    """

    plan: Plan
    vehicle: Vehicle
    simulation: Simulation
    table: BlockTable
    correction_w: FloatArray
    corrector: PowerCorrector
    blocks: Blocks
    process: ResidualProcess
    belief: Belief
    scores: Scores
    gain: Gain
    spread: float = 1.0
    rest_spread: float = 1.0
    widening: float = 1.0
    route_doubt_wh: float = 0.0
    flags: tuple[Flag, ...] = ()
    measured_until_s: float = 0.0
    measured_wh: FloatArray | None = None
    measured_hours: FloatArray | None = None
    anchor: tuple[float, float] | None = field(default=None)
    """Time [s] and state of charge (battery management's) of the last reading; None for the start."""

    @classmethod
    def at_departure(
        cls,
        *,
        plan: Plan,
        vehicle: Vehicle,
        simulation: Simulation,
        table: BlockTable,
        correction_w: FloatArray,
        corrector: PowerCorrector,
        blocks: Blocks,
        process: ResidualProcess,
        scale: TotalScale,
        scores: Scores,
        gain: Gain,
        outside: Mapping[str, float],
        unknown: Sequence[str],
    ) -> Forecast:
        """The forecast before departure."""
        flags = [Flag("outside_training", name, beyond, "sd") for name, beyond in outside.items()]
        flags += [Flag("usual_value_assumed", name) for name in unknown]
        if plan.departure.bms_soc is None and plan.departure.soc is None:
            start = vehicle.battery.displayed_from_soc(float(simulation.soc[0]))
            flags.append(Flag("soc_assumed", "soc", start, "1"))
        if not plan.has_road:
            flags.append(FLAT_ROAD)
        belief = Belief.of(process.covariance(blocks))
        return cls(
            plan=plan,
            vehicle=vehicle,
            simulation=simulation,
            table=table,
            correction_w=correction_w,
            corrector=corrector,
            blocks=blocks,
            process=process,
            belief=belief,
            scores=scores,
            gain=gain,
            spread=scale.sd_wh(blocks) / float(belief.energy_wh(blocks.hours)[1][-1]),
            widening=float(np.sqrt(1.0 + sum(b**2 + 0.25 for b in outside.values()) + 0.1 * len(unknown))),
            flags=(*flags, *simulation.flags),
        )

    @property
    def given(self) -> str:
        """What is taken as known of the speed: the driven speed trace, or a planned route."""
        return given_of(self.plan)

    @property
    def power_w(self) -> FloatArray:
        """Mean power of each block [W], shape (blocks,)."""
        return self.table.simulated_w + self.correction_w + self.belief.mean_w

    @property
    def open_hours(self) -> FloatArray:
        """Part of each block that was not measured [h], shape (blocks,)."""
        if self.measured_hours is None:
            return self.table.hours
        return np.maximum(self.table.hours - self.measured_hours, 0.0)

    @cached_property
    def block_energy_wh(self) -> FloatArray:
        """Energy of each block [Wh]: what was measured, and the mean power over the rest of it."""
        ahead = self.power_w * self.open_hours
        return ahead if self.measured_wh is None else np.asarray(self.measured_wh + ahead)

    @cached_property
    def energy_wh(self) -> float:
        """Energy of the whole trip [Wh]."""
        return float(self.block_energy_wh.sum())

    @cached_property
    def sd_wh(self) -> float:
        """Standard deviation of the energy of the whole trip [Wh]."""
        return float(self._cumulative_sd_wh[-1])

    def quantile(self, p: float) -> float:
        """Quantile of the energy of the whole trip [Wh]."""
        return self.energy_wh + float(np.sign(p - 0.5)) * self.scores.factor(abs(2.0 * p - 1.0)) * self.sd_wh

    def interval(self, level: float) -> tuple[float, float]:
        """Central interval of the energy of the whole trip [Wh]."""
        half = self.scores.factor(level) * self.sd_wh
        return self.energy_wh - half, self.energy_wh + half

    def probability_below(self, energy_wh: float) -> float:
        """Probability that the trip takes less than `energy_wh`."""
        if self.sd_wh <= 0.0:
            return float(self.energy_wh <= energy_wh)
        return self.scores.probability((energy_wh - self.energy_wh) / self.sd_wh)

    @cached_property
    def wh_per_soc(self) -> float:
        """Terminal energy behind a unit of the battery management's state of charge [Wh]."""
        return self.vehicle.battery.capacity_ah * float(np.mean(self.simulation.terminal_voltage_v))

    @property
    def soc_arrival(self) -> float:
        """Displayed state of charge at the end of the trip; below 0 when the battery does not last."""
        return float(self._displayed(self._soc_after(np.array([self.energy_wh])))[0])

    def p_arrive(self, reserve: float = 0.0) -> float:
        """Probability to arrive with at least this state of charge, as the driver sees it, 0 to 1."""
        soc = self.vehicle.battery.soc_from_displayed(reserve)
        time, start = self.anchor or (0.0, float(self.simulation.soc[0]))
        return self.probability_below((start - soc) * self.wh_per_soc + self._energy_at(time))

    def series(self) -> pd.DataFrame:
        """Along the route, a row at the end of each block and one at the start.

        Returns
        -------
        DataFrame
            `time_s, distance_m, energy_wh, energy_low_wh, energy_high_wh, displayed_soc, displayed_soc_low,
            displayed_soc_high`; the band is the central 90 %.
        """
        return pd.DataFrame(self._series())

    def _series(self) -> dict[str, FloatArray]:
        energy = np.concatenate(([0.0], np.cumsum(self.block_energy_wh)))
        half = self.scores.factor(BAND) * np.concatenate(([0.0], self._cumulative_sd_wh))
        time = np.concatenate(([0.0], np.cumsum(self.table.hours) * SECONDS_PER_HOUR))
        speed = self.table.features["speed_m_s"].to_numpy()
        distance = np.concatenate(([0.0], np.cumsum(speed * self.table.hours * SECONDS_PER_HOUR)))
        low, high = energy - half, energy + half
        return {
            "time_s": time,
            "distance_m": distance,
            "energy_wh": energy,
            "energy_low_wh": low,
            "energy_high_wh": high,
            "displayed_soc": self._displayed(self._soc_after(energy)),
            "displayed_soc_low": self._displayed(self._soc_after(high)),
            "displayed_soc_high": self._displayed(self._soc_after(low)),
        }

    @property
    def by_cause_wh(self) -> dict[str, float]:
        """Energy by cause [Wh]; the parts add up to `energy_wh`. `battery_loss` is inside the battery and not counted."""
        parts = {cause: float(energy[-1]) for cause, energy in self.simulation.energy_by_cause_wh.items()}
        simulated = float(self.table.simulated_w @ self.table.hours)
        parts["learned_correction"] = self.energy_wh - simulated
        parts["hvac"] += simulated - sum(
            v for k, v in parts.items() if k != "learned_correction"
        )  # rounding of blocks
        return parts

    @property
    def battery_loss_wh(self) -> float:
        """Heat in the battery itself [Wh], on top of the energy at its terminals."""
        step = np.diff(self.simulation.time_s, prepend=self.simulation.time_s[0])
        return float(self.simulation.battery_loss_w @ step / SECONDS_PER_HOUR)

    def update(self, observed: pd.DataFrame) -> Forecast:
        """Forecast again from what was measured so far. O(blocks^2 x measured blocks).

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
        """Forecast again from what was measured so far, timed from the departure. O(blocks^2 x measured blocks).

        Parameters
        ----------
        observed : DataFrame
            Samples, `time_s` in seconds since departure. With `voltage_v` and
            `current_a`, or with `observed_energy_wh` in their place, each block that was measured counts, gaps stay
            unmeasured; `heating_power_w` and `aircon_power_w` beside them tell climate control from driving. Without
            them `soc` or `displayed_soc` count. On a planned route `speed_m_s` tells how far the car is; without it,
            it is taken to be where it was planned.

        Returns
        -------
        Forecast

        Raises
        ------
        InvalidInput
            With every fault of the samples.
        """
        samples = observed if "speed_m_s" in observed else observed.assign(speed_m_s=0.0)
        raise_faults(structure_faults(samples, "observed samples"))
        raise_faults(value_faults(samples, "observed samples"))
        if "speed_m_s" in observed:
            samples = along_the_plan(samples, self.plan)
        time = np.asarray(samples["time_s"], dtype=np.float64)
        soc = self._measured_soc(samples)
        measured_wh = measured_hours = None
        until = float(time[-1])
        cumulative = measured_energy(samples)
        if cumulative is not None:
            until = float(time[np.flatnonzero(np.isfinite(cumulative))[-1]])
            measured_wh, measured_hours = self._measured(cumulative, time)
            real_s = np.interp(self._edges(), time, samples[DRIVEN_S]) if DRIVEN_S in samples else None
            weights, power, variance = self._observed_power(measured_wh, measured_hours, real_s)
        elif soc is not None:
            weights, power, variance = self._observed_soc(time, soc)
        else:
            where = f"columns {sorted(samples.columns)}"
            raise InvalidInput(
                Fault("no measured energy", "observed samples", where, "voltage_v and current_a, or soc")
            )
        belief, rest_spread = self._updated(samples, until, weights, power, variance)
        anchor = None
        if soc is not None and np.isfinite(soc).any():
            last = int(np.flatnonzero(np.isfinite(soc))[-1])
            anchor = (float(time[last]), float(soc[last]))
        return replace(
            self,
            belief=belief,
            rest_spread=rest_spread,
            measured_until_s=until,
            measured_wh=measured_wh,
            measured_hours=measured_hours,
            anchor=anchor,
        )

    def _updated(
        self,
        samples: pd.DataFrame,
        until_s: float,
        weights: FloatArray,
        power: FloatArray,
        variance: FloatArray,
    ) -> tuple[Belief, float]:
        """Belief after powers were observed and its `rest_spread`; climate control apart where the samples tell it."""
        if not len(power):  # nothing that was measured tells a power: the departure forecast stands
            return Belief.of(self.process.covariance(self.blocks)), 1.0
        edges = self._edges()
        ahead = edges[1:] > until_s + 1e-9
        fraction = min(until_s / float(edges[-1]), 1.0)
        residual = power - weights @ (self.table.simulated_w + self.correction_w)
        climate = self._climate_residual(samples, edges) if self.process.apart else None
        needed = (weights > 0.0).any(axis=0)
        if climate is None or not np.isfinite(climate[needed]).all():
            whole = Belief.of(self.process.covariance(self.blocks)).given(weights, residual, variance)
            return self.gain.applied("whole", whole, ahead, fraction), self.gain.spread(False, fraction)
        seen = weights @ np.nan_to_num(climate)
        exact = np.full(len(seen), EXACT_W2)
        own = Belief.of(self.process.climate_covariance(self.blocks))
        own = own.given(weights, self.process.limited(seen), exact)
        drive = Belief.of(self.process.drive_covariance(self.blocks))
        drive = drive.given(weights, residual - seen, variance)
        belief = self.gain.applied("climate", own, ahead, fraction)
        belief += self.gain.applied("drive", drive, ahead, fraction)
        return belief, self.gain.spread(True, fraction)

    def _climate_residual(self, samples: pd.DataFrame, edges_s: FloatArray) -> FloatArray | None:
        """Measured less expected power of climate control [W]; NaN in blocks that were not measured."""
        logged = logged_climate(samples, edges_s)
        expected = None if logged is None else self.corrector.predict_climate(self.table)
        if logged is None or expected is None:
            return None
        return np.asarray(logged - self.blocks.hvac_w - expected)

    def to_dict(self, reserve: float | None = None) -> dict[str, Any]:
        """Plain values, as the command line and the service give them.

        Parameters
        ----------
        reserve : float, optional
            State of charge to arrive with, as the driver sees it: one more entry of `p_arrive`.
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
            "flags": [flag.to_dict() for flag in self.flags],
        }

    def to_frame(self) -> pd.DataFrame:
        """As `series`."""
        return self.series()

    def plot(self) -> Figure:
        """Energy and state of charge along the trip with their bands, and the energy by cause."""
        from tripwatt.forecasting.plot import plot_forecast  # matplotlib is slow to import

        return plot_forecast(self)

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
    def _cumulative_sd_wh(self) -> FloatArray:
        own = self.spread * self.rest_spread * self.belief.energy_wh(self.open_hours)[1]
        return self.widening * np.asarray(np.hypot(own, route_sd_wh(self)))

    def _energy_at(self, time_s: float) -> float:
        ends = np.concatenate(([0.0], np.cumsum(self.table.hours) * SECONDS_PER_HOUR))
        return float(np.interp(time_s, ends, np.concatenate(([0.0], np.cumsum(self.block_energy_wh)))))

    def _soc_after(self, energy_wh: FloatArray) -> FloatArray:
        """State of charge when so much energy was taken since departure."""
        time, soc = self.anchor or (0.0, float(self.simulation.soc[0]))
        return np.asarray(soc - (energy_wh - self._energy_at(time)) / self.wh_per_soc)

    def _displayed(self, soc: FloatArray) -> FloatArray:
        zero, full = self.vehicle.battery.displayed_zero_soc, self.vehicle.battery.displayed_full_soc
        return np.asarray((soc - zero) / (full - zero))

    def _measured_soc(self, samples: pd.DataFrame) -> FloatArray | None:
        if "soc" in samples and samples["soc"].notna().any():
            return np.asarray(samples["soc"], dtype=np.float64)
        if "displayed_soc" in samples and samples["displayed_soc"].notna().any():
            displayed = np.asarray(samples["displayed_soc"], dtype=np.float64)
            zero, full = self.vehicle.battery.displayed_zero_soc, self.vehicle.battery.displayed_full_soc
            return zero + displayed * (full - zero)
        return None

    def _measured(self, cumulative: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Energy [Wh] and time [h] of each block that the samples cover; long gaps cover nothing."""
        known = np.isfinite(cumulative)
        cumulative, time = cumulative[known], time[known]
        step = np.diff(time)
        sound = step <= GAP_S
        edges = self._edges()
        edges[-1] = max(edges[-1], time[-1])
        seconds = np.concatenate(([0.0], np.cumsum(np.where(sound, step, 0.0))))
        gained = np.concatenate(([0.0], np.cumsum(np.where(sound, np.diff(cumulative), 0.0))))
        covered = np.diff(np.interp(edges, time, seconds))
        return np.diff(np.interp(edges, time, gained)), covered / SECONDS_PER_HOUR

    def _edges(self) -> FloatArray:
        """Time at the edges of the blocks [s], shape (blocks + 1,)."""
        return np.concatenate(([0.0], np.cumsum(self.blocks.step_s)))

    def _observed_power(
        self, measured_wh: FloatArray, measured_hours: FloatArray, real_s: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean measured power of each block that was measured for long enough, as weights, values, variances.

        `real_s` is the car's own clock at the edges, None where it is the plan's: energy of a block that took much longer
        than planned is no power of the block.
        """
        share = np.minimum(measured_hours / self.table.hours, 1.0)
        counts = share >= MIN_COVER
        if real_s is not None:
            counts &= np.diff(real_s) <= MOST_STRETCH * self.blocks.step_s
        seen = np.flatnonzero(counts)
        noise = (self.process.drive.noise * self.blocks.drive_noise_w[seen]) ** 2
        variance = (1.0 - share[seen]) * noise + EXACT_W2
        return np.eye(len(self.blocks))[seen], measured_wh[seen] / measured_hours[seen], variance

    def _observed_soc(self, time: FloatArray, soc: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean power between readings of the state of charge that differ by a few steps."""
        known = np.isfinite(soc)
        time, soc = time[known], soc[known]
        changes = np.unique(np.concatenate(([0], np.flatnonzero(np.diff(soc) != 0) + 1)))
        resolution = max(
            float(np.min(np.abs(np.diff(soc[changes])))) if len(changes) > 1 else SOC_STEP, SOC_STEP
        )
        marks = [0]
        for k in changes[1:]:
            if abs(soc[k] - soc[marks[-1]]) >= 3.0 * resolution:
                marks.append(int(k))
        if len(marks) < 2:
            empty = np.empty(0)
            return np.empty((0, len(self.blocks))), empty, empty
        edges = self._edges()
        edges[-1] = max(edges[-1], time[-1])
        weights, power, variance = [], [], []
        for a, b in itertools.pairwise(marks):
            inside = np.clip(np.minimum(edges[1:], time[b]) - np.maximum(edges[:-1], time[a]), 0.0, None)
            hours = (time[b] - time[a]) / SECONDS_PER_HOUR
            taken = (soc[a] - soc[b]) * self.wh_per_soc
            doubt = (resolution * self.wh_per_soc) ** 2 / 6.0 + (CAPACITY_SD * taken) ** 2
            weights.append(inside / (time[b] - time[a]))
            power.append(taken / hours)
            variance.append(doubt / hours**2)
        return np.array(weights), np.array(power), np.array(variance)
