"""Find vehicles whose consumption or battery changed: since when, by how much and by which cause.

The energy of a vehicle's trips is that of its car model and drivers plus deviations of the vehicle, which are normal with the scales of
the fleet. A change multiplies the energy of one cause from one day on. For every day and cause, the change is estimated together with the
deviations (generalised least squares), from sums over the trips after that day, so the work is linear in the trips. The same is done for
the displayed charge that trips take, which shows a change of the battery or of its display. Outlying trips count less (Huber 1964), also
for what car models, vehicles and drivers take, so that they change no other vehicle. Deviations that vehicles have in common in a month,
such as by winter tyres, are subtracted first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray, by_key
from tripwatt.fleet.features import FEATURES, SCALES, START, WARM_DEGC
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.statistics import TripRows
from tripwatt.hybrid.groups import GroupPosterior, Scales, Sums, fit_scales, group_posterior

CAUSES: Final[Mapping[str, tuple[str, ...]]] = {
    "road load": ("rolling", "air"),
    "climate": ("climate",),
    "base load": ("base_load",),
}
"""Causes of the simulation that each kind of change multiplies."""

BATTERY: Final = "battery energy per displayed percent"

FALSE_CHANGES: Final = 0.05
"""Probability that a change is listed for a fleet without any, for normal errors; shared by all vehicles, days and causes (Bonferroni)."""

MIN_CHANGE: Final = 0.02
"""Smaller changes are not listed, however certain they are: a choice, because nobody would act on less."""

MIN_TRIPS: Final = 8
"""Smallest number of trips before and after a change: a choice, because fewer do not show their own spread."""

_COLUMNS: Final = ("vehicle_id", "car_model", "cause", "probability", "since", "from_day", "to_day", "change", "sd", "z",
                   "before", "after")  # fmt: skip
"""Columns of the listed changes."""

_MAX_CHANGES: Final = 3
"""Largest number of changes of one vehicle and quantity: a choice, because a table of more is not read."""

USUAL_CHANGE: Final = 0.08
"""Prior standard deviation of a change, as a share of the consumption; it makes causes and days comparable. A choice, because tyres, loads and
ageing change the consumption by some percent."""

_HUBER_BOUND: Final = 2.0
"""Standardised error from which the weight of a trip falls: a choice, because normal errors lose little by it (Huber 1964 gives 1 to 2)."""
_ODD_BOUND: Final = 4.0
"""The same for what car models, vehicles and drivers take: a choice, because only errors that are no chance may not count for others."""
_LEAST_SHARE: Final = 0.1
"""Least variance of a trip as a share of its usual one: a choice, because few trips may show none of it."""
_ROUNDS: Final = 2
"""Number of times that the weights of trips follow their errors: a choice, because a third changes them little."""
_READING_SD: Final = 0.001
"""Usual standard deviation of the displayed charge that a trip takes [1], beside a hundredth of it: a choice, because displays are late by
about a tenth of a percent; the level is estimated."""

_DISPLAY_SCALES: Final = Scales(((0.05, 0.03), (0.05, 0.01)), 1.0, (0, 1, 1, 1), 0.3)
"""Usual scales of the displayed charge that an energy takes, of car models and vehicles: of its level, and of the effects of cold, years
and the level of the charge on it. Choices that only begin the search for the estimated scales."""

_MIN_VEHICLES: Final = 5
"""Vehicles of a car model that are needed to tell their common deviation in a month from a change of each: a choice, because the median
of five ignores two that changed."""


@dataclass(frozen=True, eq=False)
class VehicleSeries:
    """Trips of one vehicle in the order of time: measured minus expected values, and the terms that may explain them.

    Attributes
    ----------
    vehicle_id, car_model : str
    day : ndarray of datetime64[D], shape (trips,)
    y, variance : ndarray, shape (trips,)
        Measured minus expected value, and its usual variance.
    X : ndarray, shape (trips, terms)
        Terms that explain the deviations of the vehicle.
    prior : ndarray, shape (terms,)
        Prior variances of the weights of these terms.
    causes : mapping of str to ndarray, shape (terms,)
        Weights of the terms whose sum is the contribution of a cause to the expected value.
    total : float
        Sum of the expected values of all trips; changes are shares of this sum.
    """

    vehicle_id: str
    car_model: str
    day: Any
    y: FloatArray
    variance: FloatArray
    X: FloatArray
    prior: FloatArray
    causes: Mapping[str, FloatArray]
    total: float


def changes(rows: TripRows) -> pd.DataFrame:
    """Find the changes of each vehicle beyond chance and of at least `MIN_CHANGE`, up to `_MAX_CHANGES` of a quantity. O(trips).

    Parameters
    ----------
    rows : TripRows
        Rows of trips; those without a time of departure are left out.

    Returns
    -------
    DataFrame
        One row per change, the largest first. Columns: `vehicle_id`, `car_model`, `cause`; `probability` [1] that the cause is right
        among those of the same quantity; `since` (first day), `from_day` and `to_day` (95 % interval of the first day); `change` [1] as
        a share of the consumption, or of the energy per displayed percent, its standard deviation `sd`, and `z` = change / sd; numbers
        of trips `before` and `after`.
    """
    series = list(vehicle_series(rows))
    tests = sum(max(len(s.y) - 2 * MIN_TRIPS, 0) * len(s.causes) for s in series)
    listed = [row for s in series for row in series_changes(s, FALSE_CHANGES / max(tests, 1))]
    table = pd.DataFrame(listed, columns=[*_COLUMNS])
    return table.sort_values("change", key=np.abs, ascending=False, ignore_index=True)


def without_trips_before_changes(model: FleetModel, rows: TripRows, changed: pd.DataFrame) -> FleetModel:
    """Return the model without the trips that changed vehicles made before their last change of the consumption.

    A change of the battery is left out of account, since it does not change the energy of a trip.

    Parameters
    ----------
    model : FleetModel
    rows : TripRows
        Rows of the trips on which the model was fitted; other rows are not used.
    changed : DataFrame
        Result of `changes`.
    """
    since = last_changes(rows, changed[changed["cause"] != BATTERY])
    fitted = np.isin(rows.texts("digest"), list(model.digests))
    # a comparison with an unknown time is false
    before = rows.where(fitted & (rows.chronological[1] < since))
    return model.with_sums(model.sums - before.sums) if len(before) else model


def last_changes(rows: TripRows, changed: pd.DataFrame) -> Any:
    """Return the first day of the last change of the vehicle of each trip, shape (rows,); NaT without a change."""
    last = changed.groupby("vehicle_id")["since"].max()
    return pd.to_datetime(pd.Series(rows.texts("vehicle_id")).map(last)).to_numpy()


def need_notes(changed: pd.DataFrame) -> dict[str, str]:
    """Say for each changed vehicle whether its need contains its last change of the consumption, and of the battery."""
    notes: dict[tuple[str, bool], str] = {}
    for row in changed.sort_values("since", kind="stable").to_dict("records"):
        battery, share = row["cause"] == BATTERY, f"{100.0 * row['change']:+.0f} %".replace("-", "−")
        how = "does not contain its change" if battery else "is that of its trips after its change"
        note = f"the need {how} of {share} ({row['cause']}, since {row['since']})"
        notes[row["vehicle_id"], battery] = note
    return {v: "; ".join(notes[key] for key in notes if key[0] == v) for v, _ in notes}


def vehicle_series(rows: TripRows) -> Iterator[VehicleSeries]:
    """Yield a series of the energy of each vehicle, and one of the displayed charge from the trips with logged charge that took some."""
    order, day = rows.chronological
    if not len(order):
        return
    rows, day = rows.take(order, sort=False), day[order]
    causes = {name: np.isin(FEATURES, parts) / SCALES for name, parts in CAUSES.items()}
    simulated_wh, y, variance = rows.numbers("simulated_wh"), rows.residual_wh, rows.numbers("variance_wh2")
    posterior = robust_posterior(rows.groups, rows.X, y, variance, START)
    yield from _series_by_vehicle(posterior, rows.groups, day, rows.X, simulated_wh, y, variance, causes)

    display = display_trips(rows)
    if display is not None:
        causes = {BATTERY: np.eye(display.X.shape[1])[0]}
        yield from _series_by_vehicle(*display[:7], causes)


class DisplayTrips(NamedTuple):
    """Trips with logged charge that took some, in the order of time, and the posterior of what the display takes for an energy.

    Attributes
    ----------
    posterior : GroupPosterior
        Weights by car model and vehicle of the terms of `X`: level, cold, years, and level of the charge.
    groups : list of (str, str)
        Car model and vehicle.
    day : ndarray of datetime64[D], shape (trips,)
    X : ndarray, shape (trips, 4)
        Displayed charge by each term.
    usual, residual, variance : ndarray, shape (trips,)
        Displayed charge that the energy takes with the median trip of the car model, what it took more, and its usual variance.
    begins : datetime64[D]
        Day from which the years count.
    full_wh : mapping of str to float
        Energy of the full display in the median trip of a car model [Wh].
    """

    posterior: GroupPosterior
    groups: Sequence[tuple[str, ...]]
    day: Any
    X: FloatArray
    usual: FloatArray
    residual: FloatArray
    variance: FloatArray
    begins: Any
    full_wh: Mapping[str, float]


def display_trips(rows: TripRows) -> DisplayTrips | None:
    """Find the trips with logged charge that took some; returns None if there are none."""
    order, day = rows.chronological
    trips = rows.take(order, sort=False)
    start, end, observed = (trips.numbers(n) for n in ("displayed_start", "displayed_end", "observed_wh"))
    read = np.flatnonzero((start - end > 0.0) & (observed > 0.0))
    if not len(read):
        return None
    names, taken, energy_wh = trips.groups, (start - end)[read], observed[read]
    groups = [names[i][:2] for i in read]
    ratio = pd.Series(energy_wh / taken).groupby([group[0] for group in groups])
    usual = energy_wh / ratio.transform("median").to_numpy()
    ambient = trips.numbers("ambient_temperature_degc")[read]
    cold = np.maximum(WARM_DEGC - np.nan_to_num(ambient, nan=WARM_DEGC), 0.0)
    begins, day = day[order[0]], day[order][read]
    years = (day - begins) / np.timedelta64(365, "D")
    terms = np.column_stack([np.ones(len(read)), cold / WARM_DEGC, years, 0.5 * (start + end)[read] - 0.5])
    X, y, variance = usual[:, None] * terms, taken - usual, _READING_SD**2 + (0.01 * usual) ** 2
    posterior = robust_posterior(groups, X, y, variance, _DISPLAY_SCALES)
    return DisplayTrips(posterior, groups, day, X, usual, y, variance, begins, dict(ratio.median()))


def robust_posterior(
    groups: Sequence[tuple[str, ...]], X: FloatArray, y: FloatArray, variance: FloatArray, start: Scales
) -> GroupPosterior:
    """Fit the weights of groups to trips, of which outlying ones count less.

    An outlier is found beside the other trips of its vehicle, before the vehicle counts for others.

    Parameters
    ----------
    groups : sequence of tuple of str
        Car model and vehicle of each trip, and its driver.
    X, y, variance : ndarray
        As in `VehicleSeries`, from which nothing is subtracted.
    start : Scales
        Usual scales.
    """
    prior = np.sum([start.variances(level) for level in range(len(start.sds) + 1)], axis=0)
    variance = variance.copy()
    for i in by_key(range(len(y)), lambda i: groups[i][:2]).values():
        variance[i] /= _huber(y[i], variance[i], X[i], prior, _ODD_BOUND)[0]
    order = sorted(range(len(groups)), key=lambda i: groups[i])
    sums = Sums.from_trips([groups[i] for i in order], X[order], y[order], variance[order])
    return group_posterior(sums, fit_scales(sums, start))


def _series_by_vehicle(
    posterior: GroupPosterior, groups: Sequence[tuple[str, ...]], day: Any, X: FloatArray, expected: FloatArray, residual: FloatArray,
    variance: FloatArray, causes: Mapping[str, FloatArray],
) -> list[VehicleSeries]:  # fmt: skip
    """Make a series of each vehicle from trips in the order of time.

    The residuals are those after the car model and the drivers, minus the common deviation of the month (`common_monthly_deviation`).
    """
    code, distinct = pd.MultiIndex.from_tuples(groups).factorize()
    base = np.array([posterior.weights(group[0])[0] for group in distinct])
    of_vehicle = np.array([posterior.weights(*group[:2])[0] for group in distinct])
    driver = np.array([posterior.weights(*group)[0] for group in distinct]) - of_vehicle
    correction = (X * (base + driver)[code]).sum(axis=1)
    expected, y = expected + correction, residual - correction
    model, vehicle = (np.array([group[k] for group in groups]) for k in (0, 1))
    own = (X * (of_vehicle - base)[code]).sum(axis=1)
    relative = (y - own) / np.maximum(np.abs(expected), 1e-9)
    y = y - expected * common_monthly_deviation(model, vehicle, day, relative)
    if BATTERY not in causes:
        variance = trip_variance(y - own, variance, [X @ weights for weights in causes.values()])
    prior = posterior.scales.variances(2)
    return [
        VehicleSeries(
            f"{name}", model[i[0]], day[i], y[i], variance[i], X[i], prior, causes, expected[i].sum()
        )
        for name, i in pd.Series(vehicle).groupby(vehicle).indices.items()
    ]


def trip_variance(residual: FloatArray, usual: FloatArray, parts: Sequence[FloatArray]) -> FloatArray:
    """Fit the variance of trips: multiples of the usual one and of the squares of what each cause takes, which are not negative.

    What wind, load and surface change of a trip grows with its road load, not with the energy that it moves to and fro in a town. Trips beyond
    `_ODD_BOUND` standard deviations do not count.

    Parameters
    ----------
    residual, usual : ndarray, shape (trips,)
        Measured minus expected value, and its usual variance.
    parts : sequence of ndarray, shape (trips,)
        What each cause takes.
    """
    from scipy.optimize import nnls

    terms, variance = np.column_stack([usual, *np.square(parts)]), usual
    for _ in range(_ROUNDS):
        ratio = residual**2 / variance
        level = 1.4826**2 * float(np.median(ratio)) + 1e-9
        counts = ratio <= _ODD_BOUND**2 * level
        fitted = terms @ nnls(terms[counts] / variance[counts, None], ratio[counts])[0]
        variance = np.maximum(fitted, _LEAST_SHARE * level * variance)
    return variance


def common_monthly_deviation(model: Any, vehicle: Any, day: Any, relative: FloatArray) -> FloatArray:
    """Return the common relative deviation of the vehicles of a car model in the month of each trip, shape (trips,).

    It is the median of the medians of the vehicles, and 0 if fewer than `_MIN_VEHICLES` vehicles drove in the month.
    """
    month = day.astype("datetime64[M]")
    frame = pd.DataFrame({"model": model, "month": month, "vehicle": vehicle, "r": relative})
    medians = frame.groupby(["model", "month", "vehicle"])["r"].median().groupby(["model", "month"])
    common = medians.median().where(medians.size() >= _MIN_VEHICLES, 0.0).rename("common")
    return np.asarray(frame.join(common, on=["model", "month"])["common"], dtype=np.float64)


def series_changes(series: VehicleSeries, chance: float) -> Iterator[dict[str, object]]:
    """Yield the changes of one series, at most `_MAX_CHANGES`, the most certain first; each is estimated together with those found already.

    Parameters
    ----------
    series : VehicleSeries
    chance : float
        Largest p-value of a test with which a change is listed.
    """
    from scipy.stats import t as student

    X, prior = series.X, series.prior
    may_begin = np.append(True, series.day[1:] != series.day[:-1])  # a change begins on a day, not within one
    for _ in range(_MAX_CHANGES):
        scan = ChangeScan.from_series(series, X, prior, may_begin)
        if scan is None:
            return
        cause, k, share, sd = scan.best()
        z = share / sd
        if 2.0 * student.sf(abs(z), max(len(series.y) - 4, 1)) > chance or abs(share) < MIN_CHANGE:
            return
        probability, *days = scan.certainty(cause, series.day)
        named = series.vehicle_id, series.car_model, cause, probability, *map(str, days)
        yield dict(zip(_COLUMNS, (*named, share, sd, z, k, len(series.y) - k), strict=True))
        step = (series.X @ series.causes[cause]) * (np.arange(len(series.y)) >= k)
        X, prior = np.column_stack([X, step]), np.append(prior, 1e2)
        may_begin &= np.abs(np.arange(len(may_begin)) - k) >= MIN_TRIPS


@dataclass(frozen=True, eq=False)
class ChangeScan:
    """Estimates of a change by each cause from each trip on, made together with the deviations of the vehicle.

    Attributes
    ----------
    names : tuple of str
        Names of the causes.
    first_trip : int
        Number of the trip of the first column.
    share, sd : ndarray, shape (causes, places)
        Estimated change of the total and its standard deviation [1].
    evidence : ndarray, shape (causes, places)
        Logarithm of the Bayes factor against no change.
    """

    names: tuple[str, ...]
    first_trip: int
    share: FloatArray
    sd: FloatArray
    evidence: FloatArray

    @classmethod
    def from_series(
        cls, series: VehicleSeries, X: FloatArray, prior: FloatArray, may_begin: BoolArray
    ) -> ChangeScan | None:
        """Estimate a change by each cause from each trip at which a change may begin.

        The first scan weighs trips by their errors without a change, the second by their errors with the likeliest change of the first.
        Returns None if the series has fewer than 2 x `MIN_TRIPS` trips.
        """
        n = len(series.y)
        if n < 2 * MIN_TRIPS:
            return None
        scan, terms, variances = None, X, prior
        for _ in range(2):
            scan = cls._weighted(series, X, prior, may_begin, _trip_weights(series, terms, variances))
            cause, k, *_ = scan.best()
            step = (series.X @ series.causes[cause]) * (np.arange(n) >= k)
            terms, variances = np.column_stack([X, step]), np.append(prior, 1e2)
        return scan

    @classmethod
    def _weighted(
        cls, series: VehicleSeries, X: FloatArray, prior: FloatArray, may_begin: BoolArray, w: FloatArray
    ) -> ChangeScan:
        """Estimate a change by each cause from each trip at which it may begin, with weights `w` of the trips."""
        inverse = np.linalg.inv((X.T * w) @ X + np.diag(1.0 / prior))
        fit = series.y - X @ (inverse @ (X.T @ (w * series.y)))
        places = slice(MIN_TRIPS, len(w) - MIN_TRIPS + 1)
        shares, sds = [], []
        for weights in series.causes.values():
            z = series.X @ weights
            cross, square, gradient = (
                np.cumsum(values[::-1], axis=0)[::-1][places]
                for values in (X * (w * z)[:, None], w * z * z, w * z * fit)
            )
            information = square - np.einsum("kp,pq,kq->k", cross, inverse, cross)
            estimable = may_begin[places] & (information > 1e-9 * np.maximum(square, 1e-30))
            sds.append(np.where(estimable, 1.0 / np.sqrt(np.where(estimable, information, 1.0)), np.inf))
            shares.append(np.where(estimable, gradient / np.where(estimable, information, 1.0), 0.0))
        # doubling a cause raises the total by this share
        rise = np.array([[(series.X @ weights).sum() / series.total] for weights in series.causes.values()])
        share, sd = np.array(shares) * rise, np.maximum(np.array(sds) * rise, 1e-12)
        ratio = USUAL_CHANGE**2 / sd**2
        evidence = 0.5 * (share / sd) ** 2 * ratio / (1.0 + ratio) - 0.5 * np.log1p(ratio)
        return cls(tuple(series.causes), MIN_TRIPS, share, sd, evidence)

    def best(self) -> tuple[str, int, float, float]:
        """Return the likeliest cause and first trip, with the change and its standard deviation."""
        c, k = np.unravel_index(int(np.argmax(self.evidence)), self.evidence.shape)
        return self.names[c], self.first_trip + int(k), float(self.share[c, k]), float(self.sd[c, k])

    def certainty(self, cause: str, day: Any) -> tuple[float, Any, Any, Any]:
        """Return the probability of a cause, the likeliest first day in the likeliest month, and the 95 % interval of the first day.

        A change may have begun on any day after the last trip without it, up to the day of the first trip with it.
        """
        probability = np.exp(self.evidence - self.evidence.max())
        of_cause = probability[self.names.index(cause)]
        places = np.arange(self.first_trip, self.first_trip + len(of_cause))
        days = np.arange(day[places[0] - 1] + 1, day[places[-1]] + 1)
        k = np.searchsorted(day, days)
        density = of_cause[k - self.first_trip] / (day[k] - day[k - 1]).astype(np.float64)
        month = days.astype("datetime64[M]").astype(np.int64)
        monthly = np.bincount(month - month[0], density)
        since = days[np.argmax(density * (month == month[0] + np.argmax(monthly)))]
        ends = np.searchsorted(np.cumsum(density) / density.sum(), (0.025, 0.975))
        return float(of_cause.sum() / probability.sum()), since, *days[ends]


def _trip_weights(series: VehicleSeries, X: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the weights of trips: inverse variances scaled by the median error, reduced beyond `_HUBER_BOUND` standard deviations."""
    factor, level = _huber(series.y, series.variance, X, prior, _HUBER_BOUND)
    return factor / (level**2 * series.variance)


def _huber(
    y: FloatArray, variance: FloatArray, X: FloatArray, prior: FloatArray, bound: float
) -> tuple[FloatArray, float]:
    """Return the factors of the weights of trips, below 1 beyond `bound` standard deviations, and the median error [1]."""
    factor, level = np.ones(len(y)), 1.0
    for _ in range(_ROUNDS):
        w = factor / (level**2 * variance)
        inverse = np.linalg.inv((X.T * w) @ X + np.diag(1.0 / prior))
        # 1e-3: the only trip of a car model has no error, since it is the usual one; its weight must not outgrow the precision
        z = np.maximum(np.abs(y - X @ (inverse @ (X.T @ (w * y)))) / np.sqrt(variance), 1e-3)
        level = 1.4826 * float(np.median(z)) * np.sqrt(len(z) / max(len(z) - len(prior) / 2.0, 1.0)) + 1e-9
        factor = np.minimum(1.0, bound * level / z)
    return factor, level
