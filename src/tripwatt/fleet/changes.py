"""Find vehicles whose consumption or battery changed: since when, by how much and by which cause.

The energy of a vehicle's trips is that of its car model and drivers plus deviations of the vehicle, which are normal with the scales of
the fleet. A change multiplies the energy of one cause from one day on. For every day and cause, the change is estimated together with the
deviations (generalised least squares), from sums over the trips after that day, so the work is linear in the trips. The same is done for
the displayed charge that trips take, which shows a change of the battery or of its display. Outlying trips count less (Huber 1964).
Deviations that vehicles have in common in a month, such as by winter tyres, are subtracted first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import BoolArray, FloatArray
from tripwatt.fleet.features import FEATURES, SCALES, WARM_DEGC
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
"""Smaller changes are not listed, however certain they are."""

MIN_TRIPS: Final = 8
"""Smallest number of trips before and after a change."""

MAX_CHANGES: Final = 3
"""Largest number of changes of one vehicle and quantity."""

USUAL_CHANGE: Final = 0.08
"""Prior standard deviation of a change, as a share of the consumption; it makes causes and days comparable."""

HUBER: Final = 2.0
READING: Final = 0.003
"""Usual standard deviation of the difference of two readings of a display [1]; the level is estimated."""

DISPLAY: Final = Scales(((0.05, 0.03), (0.05, 0.01)), 1.0, (0, 1, 1, 1), 0.3)
"""Usual scales of the displayed charge that an energy takes, of car models and vehicles: of its level, and of the effects of cold, years
and the level of the charge on it."""

SISTERS: Final = 5
"""Number of vehicles of a car model from which on their common deviation in a month is not taken for a change of each of them."""


@dataclass(frozen=True, eq=False)
class Series:
    """Trips of one vehicle in the order of time: measured minus expected values, and the terms that may explain them.

    Attributes
    ----------
    vehicle_id, car_model : str
    day : ndarray of datetime64[D], shape (trips,)
    y, variance : ndarray, shape (trips,)
        Measured minus expected value, and its usual variance.
    X : ndarray, shape (trips, terms)
        Terms of the vehicle's own deviations.
    prior : ndarray, shape (terms,)
        Prior variances of the weights of these terms.
    causes : mapping of str to ndarray, shape (terms,)
        Weights of the terms that add a cause once more, which doubles it.
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


def changes(posterior: GroupPosterior, rows: TripRows) -> pd.DataFrame:
    """Find every change of every vehicle that is beyond chance and at least `MIN_CHANGE`. O(trips).

    Parameters
    ----------
    posterior : GroupPosterior
        Posterior of the fleet.
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
    series = list(series_of(posterior, rows))
    tests = sum(max(len(s.y) - 2 * MIN_TRIPS, 0) * len(s.causes) for s in series)
    listed = [row for s in series for row in changes_of(s, FALSE_CHANGES / max(tests, 1))]
    columns = ["vehicle_id", "car_model", "cause", "probability", "since", "from_day", "to_day", "change", "sd", "z",
               "before", "after"]  # fmt: skip
    table = pd.DataFrame(listed, columns=columns)
    return table.sort_values("change", key=np.abs, ascending=False, ignore_index=True)


def after_changes(model: FleetModel, rows: TripRows, changed: pd.DataFrame) -> FleetModel:
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
    last = changed[changed["cause"] != BATTERY].groupby("vehicle_id")["since"].max()
    since = pd.to_datetime(pd.Series(rows.texts("vehicle_id")).map(last)).to_numpy()
    seen = np.isin(rows.texts("digest"), list(model.digests))
    before = rows.where(seen & (rows.in_time[1] < since))  # no time is before one that is not known
    return model.with_sums(model.sums - before.sums) if len(before) else model


def said_of_need(changed: pd.DataFrame) -> dict[str, str]:
    """Say for each changed vehicle whether its need contains its last change of the consumption, and of the battery."""
    said: dict[tuple[str, bool], str] = {}
    for row in changed.sort_values("since", kind="stable").to_dict("records"):
        battery, share = row["cause"] == BATTERY, f"{100.0 * row['change']:+.0f} %".replace("-", "−")
        how = "does not contain its change" if battery else "is that of its trips after its change"
        what = f"the need {how} of {share} ({row['cause']}, since {row['since']})"
        said[row["vehicle_id"], battery] = what
    return {v: "; ".join(said[key] for key in said if key[0] == v) for v, _ in said}


def series_of(posterior: GroupPosterior, rows: TripRows) -> Iterator[Series]:
    """Yield a series of the energy of each vehicle, and one of the displayed charge if it was logged."""
    order, day = rows.in_time
    if not len(order):
        return
    rows, day = rows.take(order, sort=False), day[order]
    X, observed = rows.X, rows.numbers("observed_wh")
    causes = {name: np.isin(FEATURES, parts) / SCALES for name, parts in CAUSES.items()}
    amounts = rows.numbers("simulated_wh"), rows.residual_wh, rows.numbers("variance_wh2")
    trips = rows.groups
    yield from _by_vehicle(posterior, trips, day, X, *amounts, causes)

    start, end = rows.numbers("displayed_start"), rows.numbers("displayed_end")
    read = np.flatnonzero((start - end > 0.0) & (observed > 0.0))
    if not len(read):
        return
    groups = [trips[i][:2] for i in read]
    ratio = pd.Series(observed[read] / (start - end)[read])
    share = observed[read] / ratio.groupby([group[0] for group in groups]).transform("median").to_numpy()
    cold = np.maximum(
        WARM_DEGC - np.nan_to_num(rows.numbers("ambient_temperature_degc")[read], nan=WARM_DEGC), 0.0
    )
    years = (day[read] - day[0]) / np.timedelta64(365, "D")
    terms = np.column_stack([np.ones(len(read)), cold / WARM_DEGC, years, 0.5 * (start + end)[read] - 0.5])
    X, y, n = share[:, None] * terms, (start - end)[read] - share, READING**2 + (0.01 * share) ** 2
    by_group = sorted(range(len(read)), key=lambda i: groups[i])
    sums = Sums.from_trips([groups[i] for i in by_group], X[by_group], y[by_group], n[by_group])
    display = group_posterior(sums, fit_scales(sums, DISPLAY))
    yield from _by_vehicle(display, groups, day[read], X, share, y, n, {BATTERY: np.eye(terms.shape[1])[0]})


def _by_vehicle(
    posterior: GroupPosterior, groups: Sequence[tuple[str, ...]], day: Any, X: FloatArray, expected: FloatArray, residual: FloatArray,
    variance: FloatArray, causes: Mapping[str, FloatArray],
) -> list[Series]:  # fmt: skip
    """Make a series of each vehicle from trips in the order of time.

    The residuals are those after the car model and the drivers, minus the common deviation of the month (`common_of_month`).
    """
    names = sorted(set(groups))
    place = {name: k for k, name in enumerate(names)}
    code = np.array([place[group] for group in groups])
    base = np.array([posterior.weights(name[0])[0] for name in names])
    own = np.array([posterior.weights(*name[:2])[0] for name in names])
    driver = np.array([posterior.weights(*name)[0] for name in names]) - own
    known = (X * (base + driver)[code]).sum(axis=1)
    expected, y = expected + known, residual - known
    model, vehicle = (np.array([group[k] for group in groups]) for k in (0, 1))
    relative = (y - (X * (own - base)[code]).sum(axis=1)) / np.maximum(np.abs(expected), 1e-9)
    y = y - expected * common_of_month(model, vehicle, day, relative)
    prior = posterior.scales.variances(2)
    return [
        Series(
            str(name),
            str(model[i[0]]),
            day[i],
            y[i],
            variance[i],
            X[i],
            prior,
            causes,
            float(expected[i].sum()),
        )
        for name, i in pd.Series(vehicle).groupby(vehicle).indices.items()
    ]


def common_of_month(model: Any, vehicle: Any, day: Any, relative: FloatArray) -> FloatArray:
    """Return the common relative deviation of the vehicles of a car model in the month of each trip, shape (trips,).

    It is the median of the medians of the vehicles, and 0 if there are fewer than `SISTERS` vehicles.
    """
    frame = pd.DataFrame(
        {"model": model, "month": day.astype("datetime64[M]"), "vehicle": vehicle, "r": relative}
    )
    medians = frame.groupby(["model", "month", "vehicle"])["r"].median().groupby(["model", "month"])
    common = medians.median().where(medians.size() >= SISTERS, 0.0).rename("common")
    return np.asarray(frame.join(common, on=["model", "month"])["common"], dtype=np.float64)


def changes_of(series: Series, chance: float) -> Iterator[dict[str, object]]:
    """Yield the changes of one series, the most certain first, each estimated together with those before.

    Parameters
    ----------
    series : Series
    chance : float
        Largest p-value of a test with which a change is listed.
    """
    from scipy.stats import t as student

    X, prior = series.X, series.prior
    free = np.append(True, series.day[1:] != series.day[:-1])  # a day's trips stay together
    for _ in range(MAX_CHANGES):
        scan = Scan.of(series, X, prior, free)
        if scan is None:
            return
        cause, k, share, sd = scan.best()
        z = share / sd
        if 2.0 * student.sf(abs(z), max(len(series.y) - 4, 1)) > chance or abs(share) < MIN_CHANGE:
            return
        probability, since, from_day, to_day = scan.certainty(cause, series.day)
        yield {
            "vehicle_id": series.vehicle_id,
            "car_model": series.car_model,
            "cause": cause,
            "probability": probability,
            "since": f"{since}",
            "from_day": f"{from_day}",
            "to_day": f"{to_day}",
            "change": share,
            "sd": sd,
            "z": z,
            "before": k,
            "after": len(series.y) - k,
        }
        step = (series.X @ series.causes[cause]) * (np.arange(len(series.y)) >= k)
        X, prior = np.column_stack([X, step]), np.append(prior, 1e2)
        free &= np.abs(np.arange(len(free)) - k) >= MIN_TRIPS


@dataclass(frozen=True, eq=False)
class Scan:
    """Estimates of a change by each cause from each trip on, made together with the vehicle's own deviations.

    Attributes
    ----------
    names : tuple of str
        Names of the causes.
    first : int
        Number of the trip of the first column.
    share, sd : ndarray, shape (causes, places)
        Estimated change of the total and its standard deviation [1].
    evidence : ndarray, shape (causes, places)
        Logarithm of the Bayes factor against no change.
    """

    names: tuple[str, ...]
    first: int
    share: FloatArray
    sd: FloatArray
    evidence: FloatArray

    @classmethod
    def of(cls, series: Series, X: FloatArray, prior: FloatArray, free: BoolArray) -> Scan | None:
        """Scan all causes and the `free` trips of a series; returns None if it has fewer than 2 x `MIN_TRIPS` trips.

        The scan is done twice: the level of the errors and the weights of outlying trips are those with the likeliest change of the
        first scan.
        """
        n = len(series.y)
        if n < 2 * MIN_TRIPS:
            return None
        scan, terms, own = None, X, prior
        for _ in range(2):
            scan = cls._weighted(series, X, prior, free, _weights(series, terms, own))
            cause, k, *_ = scan.best()
            step = (series.X @ series.causes[cause]) * (np.arange(n) >= k)
            terms, own = np.column_stack([X, step]), np.append(prior, 1e2)
        return scan

    @classmethod
    def _weighted(
        cls, series: Series, X: FloatArray, prior: FloatArray, free: BoolArray, w: FloatArray
    ) -> Scan:
        inverse = np.linalg.inv((X.T * w) @ X + np.diag(1.0 / prior))
        fit = series.y - X @ (inverse @ (X.T @ (w * series.y)))
        places = slice(MIN_TRIPS, len(w) - MIN_TRIPS + 1)
        shares, sds = [], []
        for weights in series.causes.values():
            z = series.X @ weights
            both, square, error = (
                np.cumsum(values[::-1], axis=0)[::-1][places]
                for values in (X * (w * z)[:, None], w * z * z, w * z * fit)
            )
            information = square - np.einsum("kp,pq,kq->k", both, inverse, both)
            known = free[places] & (information > 1e-9 * np.maximum(square, 1e-30))
            sds.append(np.where(known, 1.0 / np.sqrt(np.where(known, information, 1.0)), np.inf))
            shares.append(np.where(known, error / np.where(known, information, 1.0), 0.0))
        # a rise of a cause by all of itself, as a share of the total
        unit = np.array([[(series.X @ weights).sum() / series.total] for weights in series.causes.values()])
        share, sd = np.array(shares) * unit, np.maximum(np.array(sds) * unit, 1e-12)
        ratio = USUAL_CHANGE**2 / sd**2
        evidence = 0.5 * (share / sd) ** 2 * ratio / (1.0 + ratio) - 0.5 * np.log1p(ratio)
        return cls(tuple(series.causes), MIN_TRIPS, share, sd, evidence)

    def best(self) -> tuple[str, int, float, float]:
        """Return the likeliest cause and first trip, with the change and its standard deviation."""
        c, k = np.unravel_index(int(np.argmax(self.evidence)), self.evidence.shape)
        return self.names[c], self.first + int(k), float(self.share[c, k]), float(self.sd[c, k])

    def certainty(self, cause: str, day: Any) -> tuple[float, Any, Any, Any]:
        """Return the probability of a cause, the likeliest first day in the likeliest month, and the 95 % interval of the first day.

        A change may have begun on any day after the last trip without it, up to the day of the first trip with it.
        """
        probability = np.exp(self.evidence - self.evidence.max())
        mine = probability[self.names.index(cause)]
        places = np.arange(self.first, self.first + len(mine))
        days = np.arange(day[places[0] - 1] + 1, day[places[-1]] + 1)
        k = np.searchsorted(day, days)
        density = mine[k - self.first] / (day[k] - day[k - 1]).astype(np.float64)
        month = days.astype("datetime64[M]").astype(np.int64)
        of_month = np.bincount(month - month[0], density)
        since = days[np.argmax(density * (month == month[0] + np.argmax(of_month)))]
        ends = np.searchsorted(np.cumsum(density) / density.sum(), (0.025, 0.975))
        return float(mine.sum() / probability.sum()), since, *days[ends]


def _weights(series: Series, X: FloatArray, prior: FloatArray) -> FloatArray:
    """Return the weights of trips: inverse variances scaled by the median error, reduced beyond `HUBER` standard deviations."""
    w = 1.0 / series.variance
    for _ in range(2):
        inverse = np.linalg.inv((X.T * w) @ X + np.diag(1.0 / prior))
        z = np.abs(series.y - X @ (inverse @ (X.T @ (w * series.y)))) / np.sqrt(series.variance)
        level = 1.4826 * float(np.median(z)) * np.sqrt(len(z) / max(len(z) - len(prior) / 2.0, 1.0)) + 1e-9
        w = np.minimum(1.0, HUBER / np.maximum(z / level, 1e-9)) / (level**2 * series.variance)
    return np.asarray(w)
