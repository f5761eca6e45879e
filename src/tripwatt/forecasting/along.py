"""Energy and displayed charge along the road with their uncertainty, and the charge at arrival that follows from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, TypeVar, cast

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput
from tripwatt.trips.columns import require_fraction
from tripwatt.uncertainty.climb import Excess
from tripwatt.units import with_units

BAND: Final = (0.95, 0.5, 0.05)
"""Probabilities that the charge exceeds the low end, the middle and the high end of the band along the road."""
F = TypeVar("F", float, FloatArray)
"""A number, or an array of numbers: the result has the shape of the argument."""

STRAIGHT: Final = 0.75
"""Part of the way from the expected to the least energy over which `possible_energy` does not squeeze the lower half."""


@dataclass(frozen=True, eq=False)
class Along:
    """Energy and displayed charge at the edges of the segments, from the departure to the end of the trip.

    Attributes
    ----------
    time_s : ndarray, shape (edges,)
        Time since departure [s].
    distance_m : ndarray, shape (edges,)
        Distance since departure [m].
    energy_wh : ndarray, shape (edges,)
        Expected energy since departure [Wh].
    energy_sd_wh : ndarray, shape (edges,)
        Standard deviation of `energy_wh`, without that of an unknown climb [Wh].
    min_wh : ndarray, shape (edges,)
        Least energy that the drive can take [Wh].
    excess : Excess
        Distribution of the energy beyond the expected one.
    charge : ndarray, shape (edges,)
        Displayed charge after the expected energy; not limited to 0 to 1.
    charge_sd : ndarray, shape (edges,)
        Standard deviation of `charge`.
    wh_per_display : float
        Energy of a display range from 0 to 1 [Wh].
    read_s : float
        Time of the last reading of the charge [s since departure].

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> along = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0)).along
    >>> bool((along.soc(0.95) <= along.soc(0.5)).all()), along.empty_at_m
    (True, (None, None, None))
    """

    time_s: FloatArray
    distance_m: FloatArray
    energy_wh: FloatArray
    energy_sd_wh: FloatArray
    min_wh: FloatArray
    excess: Excess
    charge: FloatArray
    charge_sd: FloatArray
    wh_per_display: float
    read_s: float

    def soc(self, probability: float) -> FloatArray:
        """Displayed charge that is exceeded with a probability; not limited to 0 to 1.

        Parameters
        ----------
        probability : float
            Probability, 0 to 1.

        Returns
        -------
        ndarray, shape (edges,)
            Displayed state of charge.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> round(float(forecast.along.soc(0.95)[0]), 6)
        0.8
        """
        return np.asarray(self._socs(require_fraction("probability", probability))[0])

    def _socs(self, *probabilities: float) -> FloatArray:
        """Charges of `soc`, shape (probabilities, edges)."""
        wh = self.wh_per_display
        return self.charge - self.excess.quantile(np.array(probabilities), self.charge_sd * wh) / wh

    @property
    def expected_soc(self) -> FloatArray:
        """Median of the displayed charge, not limited to 0 to 1, shape (edges,)."""
        return self.soc_band[1]

    @cached_property
    def soc_band(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Displayed charge at the low end, the middle and the high end of the 90 % band, each of shape (edges,)."""
        low, middle, high = self._socs(*BAND)
        return low, middle, high

    @property
    def empty_at_m(self) -> tuple[float | None, ...]:
        """Distance at which the display reaches 0 [m]: early, expected and late, at the ends of the 90 % band.

        An entry is None if that charge does not reach 0 on this trip.
        """
        return tuple(first_empty(charge, self.distance_m) for charge in self.soc_band)

    @property
    def missing_wh(self) -> tuple[float, ...]:
        """Energy that the trip takes beyond what the battery holds [Wh]: lowest, expected and highest of the 90 % band.

        An entry is 0 if the battery holds enough. The place with the lowest charge counts, even if it is before the end.
        """
        return tuple(map(self.missing_at, reversed(self.soc_band)))

    def missing_at(self, charge: FloatArray) -> float:
        """The entry of `missing_wh` [Wh] of one course of the displayed state of charge, shape (edges,)."""
        return max(-float(charge[self._ahead].min()), 0.0) * self.wh_per_display

    def spare(self, reserve: float, probability: float) -> float:
        """Smallest spare charge along the road that is exceeded with a probability.

        Spare is the displayed charge above what is needed: above `reserve` at the end, above 0 before.

        Parameters
        ----------
        reserve : float
            Displayed state of charge to arrive with.
        probability : float
            Probability, 0 to 1.

        Returns
        -------
        float
            Spare displayed charge; below 0 if charge is missing.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> forecast.along.spare(0.1, 0.95) < forecast.along.spare(0.1, 0.5)
        True
        """
        needed = np.zeros(len(self.time_s))
        needed[-1] = reserve
        return float((self.soc(probability) - needed)[self._ahead].min())

    @cached_property
    def p_lasts(self) -> float:
        """Probability that the battery is nowhere empty on the way, by the place where this is least probable."""
        wh = self.wh_per_display
        least = np.where(self._ahead, 0.0, -np.inf)
        return float(self.excess.probability_below((self.charge - least) * wh, self.charge_sd * wh).min())

    @property
    def _ahead(self) -> Any:
        """Mask of the edges after the last reading of the charge, always including the end."""
        ahead = self.time_s > self.read_s
        ahead[-1] = True
        return ahead

    def columns(self) -> dict[str, FloatArray]:
        """Columns of `Forecast.to_frame`, each of shape (edges,).

        Returns
        -------
        dict of str to ndarray
            `time_s, distance_m, energy_wh, energy_low_wh, energy_high_wh, displayed_soc, displayed_soc_low, displayed_soc_high`; the
            band is the central 90 %.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> list(tw.forecast(plan).along.columns())[:3]
        ['time_s', 'distance_m', 'energy_wh']
        """
        low, middle, high = (np.clip(charge, 0.0, 1.0) for charge in self.soc_band)
        below, above = self.excess.quantile(1.0 - np.array(BAND[::2]), self.energy_sd_wh)
        return {
            "time_s": self.time_s,
            "distance_m": self.distance_m,
            "energy_wh": self.energy_wh,
            "energy_low_wh": self.energy_beyond(below),
            "energy_high_wh": self.energy_beyond(above),
            "displayed_soc": middle,
            "displayed_soc_low": low,
            "displayed_soc_high": high,
        }

    def energy_beyond(self, more_wh: FloatArray, at: Any = slice(None)) -> FloatArray:
        """Energy at edges that is higher than expected by `more_wh`, or lower, but above the least possible one [Wh], shape of `more_wh`."""
        below = possible_energy(self.energy_wh[at], np.abs(more_wh), self.min_wh[at])
        return np.asarray(np.where(more_wh < 0.0, below, self.energy_wh[at] + more_wh))

    def draws(
        self, normal: FloatArray, own: FloatArray, scenario: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Draws of energy [Wh] and displayed charge, each of shape (draws, edges), with the distributions of each edge.

        Parameters
        ----------
        normal : ndarray, shape (draws, edges)
            Error of the energy as a value of a standard normal distribution [1].
        own : ndarray, shape (draws, 1)
            Error of the charge beside that of the energy, likewise.
        scenario : ndarray, shape (draws,)
            Uniform values from 0 to less than 1 that choose the climb of each draw.
        """
        wh, sd_wh = self.wh_per_display, self.energy_sd_wh
        energy_wh = self.energy_beyond(self.excess.draws(normal, sd_wh, scenario))
        charge_sd_wh = self.charge_sd * wh
        share = np.divide(sd_wh, charge_sd_wh, out=np.ones(len(sd_wh)), where=charge_sd_wh > 0.0)
        share = np.minimum(share, 1.0)  # the charge was read later than the energy was measured
        both = share * normal + np.sqrt(np.maximum(1.0 - share**2, 0.0)) * own
        taken_wh = self.excess.draws(both, charge_sd_wh, scenario)
        return energy_wh, np.clip(self.charge - taken_wh / wh, 0.0, 1.0)

    def interval(self, level: F, of: int) -> tuple[F, F]:
        """Central interval at the end of the trip of the energy (`of` = 0) or of the displayed charge (1); see `Forecast.interval`.

        Raises
        ------
        InvalidInput
            If a level is not in 0 to 1, or is 1: errors have no bound.
        """

        def ends(levels: FloatArray) -> FloatArray:
            if (levels == 1.0).any():
                raise InvalidInput.of("no interval holds every trip", "level", "1", "0 to less than 1")
            half = 0.5 * levels
            return self.quantiles(np.concatenate((0.5 - half, 0.5 + half)))[of].reshape(2, -1)

        both: Any = at_fractions("level", level, ends)
        return both[0], both[1]

    def quantiles(self, p: Sequence[float] | FloatArray) -> tuple[FloatArray, FloatArray]:
        """Quantiles of energy and displayed charge at the end of the trip.

        Parameters
        ----------
        p : sequence of float, or ndarray, shape (probabilities,)
            Probabilities.

        Returns
        -------
        tuple of ndarray, each of shape (probabilities,)
            Quantiles of the energy of the trip [Wh] and of the displayed charge at arrival, 0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> forecast = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0))
        >>> energies_wh, charges = forecast.along.quantiles([0.05, 0.95])
        >>> energies_wh[0] < energies_wh[1], charges[0] < charges[1]
        (np.True_, np.True_)
        """
        levels, wh = np.array(p, dtype=np.float64), self.wh_per_display
        sd_wh = np.repeat([self.energy_sd_wh[-1], self.charge_sd[-1] * wh], len(p))
        excess_wh = self.excess.at(-1).quantiles(np.concatenate((levels, 1.0 - levels)), sd_wh)
        charge = self.charge[-1] - excess_wh[len(p) :] / wh
        return self.energy_beyond(excess_wh[: len(p)], -1), np.clip(charge, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Arrival:
    """Displayed state of charge at the end of the trip.

    Attributes
    ----------
    along : Along
        Energy and displayed charge along the road.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> arrival = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0)).arrival
    >>> low, high = arrival.interval(0.9)
    >>> low < arrival.soc < high < 0.8, arrival.probability(0.1) > arrival.probability(0.7)
    (True, True)
    """

    along: Along

    @property
    def soc(self) -> float:
        """Median of the displayed charge at arrival, 0 to 1; 0 if the battery does not last."""
        return float(np.clip(self.along.expected_soc[-1], 0.0, 1.0))

    def quantile(self, p: F) -> F:
        """Quantile of the displayed charge at arrival.

        Parameters
        ----------
        p : float or ndarray
            Probability, 0 to 1.

        Returns
        -------
        float or ndarray, shape of `p`
            0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> arrival = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0)).arrival
        >>> round(arrival.quantile(0.5), 6) == round(arrival.soc, 6)
        True
        """
        return at_fractions("p", p, lambda levels: self.along.quantiles(levels)[1])

    def interval(self, level: F) -> tuple[F, F]:
        """Central interval of the displayed charge at arrival, 0 to 1.

        Parameters
        ----------
        level : float or ndarray
            Probability of the interval, 0 to less than 1, as for `Forecast.interval`.

        Returns
        -------
        tuple of float or of ndarray, shape of `level`
            Lower and upper bound, 0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> arrival = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0)).arrival
        >>> [round(end, 6) for end in arrival.interval(0.9)] == [round(arrival.quantile(p), 6) for p in (0.05, 0.95)]
        True
        """
        return self.along.interval(level, 1)

    def probability(self, reserve: F) -> F:
        """Probability of arriving with at least a displayed state of charge; see `Forecast.p_arrive`.

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
        >>> forecast.arrival.probability(0.1) == forecast.p_arrive(0.1)
        True
        """
        return at_fractions("reserve", reserve, lambda soc: np.minimum(self.along.p_lasts, self._above(soc)))

    def p_above(self, soc: float) -> float:
        """Probability that the displayed charge at arrival is at least `soc`.

        Parameters
        ----------
        soc : float
            Displayed state of charge; may lie outside of 0 to 1.

        Returns
        -------
        float
            0 to 1.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> arrival = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0)).arrival
        >>> round(arrival.p_above(arrival.quantile(0.25)), 6)
        0.75
        """
        return float(self._above(np.array([soc]))[0])

    def _above(self, soc: FloatArray) -> FloatArray:
        along, wh = self.along, self.along.wh_per_display
        more_wh, sd_wh = (along.charge[-1:] - soc) * wh, along.charge_sd[-1:] * wh
        return along.excess.at(-1).probability_below(more_wh, sd_wh)


def at_fractions(name: str, values: F, result: Callable[[FloatArray], FloatArray]) -> F:
    """Return a function of fractions from 0 to 1 for a number as numbers, for an array in its shape.

    Parameters
    ----------
    name : str
        Name of the argument, quoted in the error message.
    values : float or array_like
        Fractions.
    result : callable
        Function from fractions, shape (n,), to values of shape (any, n) or (n,).

    Returns
    -------
    float, list of float or ndarray
        Values of shape (any, *shape of `values`).

    Raises
    ------
    InvalidInput
        If a value is no number from 0 to 1.

    Examples
    --------
    >>> at_fractions("p", 0.5, np.square), at_fractions("p", np.array([[0.5], [1.0]]), np.square).tolist()
    (0.25, [[0.25], [1.0]])
    """
    given: Any = np.array(values, dtype=object)
    each: FloatArray = result(np.array([require_fraction(name, value) for value in given.ravel().tolist()]))
    shaped: Any = each.reshape((*each.shape[:-1], *given.shape))
    return cast("F", shaped if given.ndim else shaped.tolist())


def first_empty(charge: FloatArray, distance_m: FloatArray) -> float | None:
    """Distance at which the charge first reaches 0 [m], interpolated between edges of segments; None if the charge stays above 0.

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


def possible_energy(centre_wh: Any, half_wh: Any, min_wh: Any) -> Any:
    """Energy `half_wh` below a centre, squeezed to stay above the least energy [Wh]; arguments are arrays of one shape or numbers.

    Down to `STRAIGHT` of the way from the centre to the least energy, the result is ``centre_wh - half_wh``. Below that, the
    remaining way falls exponentially with `half_wh`: the result never reaches the least energy. If the centre is not above the
    least energy, the result is ``centre_wh - half_wh``.

    Examples
    --------
    >>> float(possible_energy(1000.0, 300.0, 200.0)), round(float(possible_energy(1000.0, 1000.0, 200.0)), 2)
    (700.0, 227.07)
    """
    way = np.asarray(centre_wh, dtype=np.float64) - min_wh
    open_ = way > 0.0
    straight = STRAIGHT * way
    rest = np.where(open_, (1.0 - STRAIGHT) * way, 1.0)
    squeezed = min_wh + rest * np.exp(-np.maximum(half_wh - straight, 0.0) / rest)
    return np.where(open_ & (half_wh > straight), squeezed, centre_wh - half_wh)


def distance_below(centre_wh: float, energy_wh: float, min_wh: float) -> float:
    """Inverse of `possible_energy`: the `half_wh` that gives `energy_wh`; negative above the centre, infinite below the least energy."""
    way, below = centre_wh - min_wh, centre_wh - energy_wh
    if way <= 0.0 or below <= STRAIGHT * way:
        return below
    if energy_wh <= min_wh:
        return math.inf
    rest = (1.0 - STRAIGHT) * way
    return STRAIGHT * way - rest * math.log((energy_wh - min_wh) / rest)


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Drives that are drawn from a forecast, each along the whole road; made by `Forecast.sample`.

    Attributes
    ----------
    time_s, distance_m : ndarray, shape (edges,)
        Time [s] and distance [m] since departure.
    cumulative_energy_wh : ndarray, shape (draws, edges)
        Energy since departure [Wh].
    displayed_soc : ndarray, shape (draws, edges)
        Displayed state of charge, 0 to 1.

    Examples
    --------
    >>> import tripwatt as tw
    >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
    >>> drawn = tw.forecast(plan, tw.Departure(soc=0.8, ambient_temperature_degc=5.0)).sample(200)
    >>> bool((drawn.displayed_soc[:, 0] == 0.8).all())
    True
    """

    time_s: FloatArray
    distance_m: FloatArray
    cumulative_energy_wh: FloatArray
    displayed_soc: FloatArray

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the drives, one row for each draw and edge.

        Returns
        -------
        DataFrame
            `draw, time_s, distance_m, cumulative_energy_wh, displayed_soc`; ``attrs["units"]`` has the units.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 20_000.0, "speed_m_s": 15.0}])
        >>> tw.forecast(plan).sample(2).to_frame().attrs["units"]["cumulative_energy_wh"]
        'Wh'
        """
        n, edges = self.displayed_soc.shape
        columns = {
            "draw": np.repeat(np.arange(n), edges),
            "time_s": np.tile(self.time_s, n),
            "distance_m": np.tile(self.distance_m, n),
            "cumulative_energy_wh": self.cumulative_energy_wh.ravel(),
            "displayed_soc": self.displayed_soc.ravel(),
        }
        return with_units(pd.DataFrame(columns))
