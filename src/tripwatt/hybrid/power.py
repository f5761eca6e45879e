"""Correctors of power: estimates of the residual power of short segments from quantities known before departure."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, Literal, Self

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, require_extras
from tripwatt.files import shipped_toml
from tripwatt.hybrid.familiarity import FADING, Familiarity
from tripwatt.hybrid.gamm import gamm_engine
from tripwatt.hybrid.segments import LINE_CAUSES, SegmentTable
from tripwatt.learners.gp import AdditiveGP, KernelTerm
from tripwatt.trips import TEMPERATURES

Uncertain = tuple[FloatArray, FloatArray]
"""A prediction, and the factor of the covariance of its uncertainty."""

Way = Literal["fit", "tune"]


class PowerCorrector:
    """Base class of correctors, which predict the residual power of segments from quantities known before departure.

    A subclass implements `predict`, or `predict_with_uncertainty` if it has an uncertainty of its own. If it can be fitted, it also
    implements `fit` and `clone_tuned`.

    Examples
    --------
    >>> from tripwatt.hybrid import power_corrector, segment_trips
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = segment_trips(synthetic_fleet(6).trips, load_vehicle(VEHICLE))
    >>> corrector: PowerCorrector = power_corrector("linear").fit(table)
    >>> power_w, factor_w = corrector.predict_with_uncertainty(table)
    >>> corrector.predict(table).shape == power_w.shape == table.hours.shape
    True
    >>> len(factor_w) == len(corrector.outside_factor(table)) == len(table.hours)
    True
    >>> corrector.predict_climate(table) is None, corrector.clone_tuned() is corrector
    (True, False)
    >>> bool((corrector.predict_driving(table) == power_w).all())
    True
    """

    refit: ClassVar[str] = "fit a new ForecastModel"
    """Advice in the error message of a corrector that cannot be fitted."""

    familiarity: Familiarity = Familiarity()
    """Training ranges, outside of which the corrector is uncertain."""

    def fit(self, table: SegmentTable) -> Self:
        """Fit to the trips of a table.

        Parameters
        ----------
        table : SegmentTable
            Segments of trips with measured power.

        Returns
        -------
        PowerCorrector
            The corrector itself.

        Raises
        ------
        InvalidInput
            If the corrector cannot be fitted, such as stored trees or a corrector by factors.
        """
        raise InvalidInput.of("corrector cannot be fitted", type(self).__name__, fix=self.refit)

    def tune(self, table: SegmentTable) -> Self:
        """Choose the settings for `clone_tuned` as `fit` does; the rest of the fit may be left out.

        Parameters
        ----------
        table : SegmentTable
            As for `fit`.

        Returns
        -------
        PowerCorrector
            The corrector itself, with its settings.

        Raises
        ------
        InvalidInput
            If the corrector cannot be fitted.

        Examples
        --------
        >>> from tripwatt.hybrid import power_corrector, segment_trips
        >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
        >>> from tripwatt.vehicles import load_vehicle
        >>> table = segment_trips(synthetic_fleet(4).trips, load_vehicle(VEHICLE))
        >>> type(power_corrector("linear").tune(table).clone_tuned()).__name__
        'GPCorrector'
        """
        return self.fit(table)

    def clone_tuned(self) -> PowerCorrector:
        """Make an unfitted copy with the settings that `fit` or `tune` chose, to fit on a part of the same trips.

        Returns
        -------
        PowerCorrector
            Unfitted corrector of the same kind.

        Raises
        ------
        InvalidInput
            If the corrector cannot be fitted.
        """
        raise InvalidInput.of("corrector cannot be fitted", type(self).__name__, fix=self.refit)

    def predict(self, table: SegmentTable) -> FloatArray:
        """Predict the residual power of each row.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.

        Returns
        -------
        ndarray, shape (rows,)
            Observed minus simulated power [W].
        """
        return self.predict_with_uncertainty(table)[0]

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Predict the residual power of each row, and the corrector's own uncertainty.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.
        hours : ndarray, shape (rows,), optional
            Durations [h] over which the uncertain power is summed, much faster than afterwards.

        Returns
        -------
        power_w : ndarray, shape (rows,)
            Predicted residual power, as of `predict` [W].
        factor_w : ndarray, shape (rows, any)
            Factor `L` of the covariance ``L @ L.T`` of the corrector's own uncertainty [W]; zeros if it has none. With `hours`
            it is that of the energy [Wh], shape (any,).
        """
        return self.predict(table), summed(np.zeros((len(table.hours), 1)), hours)

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Compute a factor `L` as in `predict_with_uncertainty`, for the uncertainty outside the range of the training.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.

        Returns
        -------
        ndarray, shape (rows, any)
            Factor `L` [W]. A corrector without a prior is as uncertain far outside as the simulation was on the training trips.
        """
        return self.familiarity.lost_factor(table.columns)

    def predict_climate(self, table: SegmentTable) -> FloatArray | None:
        """Predict the part of `predict` that is climate control.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.

        Returns
        -------
        ndarray, shape (rows,), or None
            Power [W]; None for a joint corrector.
        """
        return None

    def unknown(self, table: SegmentTable) -> tuple[tuple[str, ...], float]:
        """Find the covariates that the corrector uses and the plan of a trip lacks.

        Parameters
        ----------
        table : SegmentTable
            Segments of one trip.

        Returns
        -------
        names : tuple of str
            Unknown covariates.
        sd_wh : float
            Standard deviation of the energy due to them [Wh].

        Examples
        --------
        >>> from tripwatt.hybrid import power_corrector, segment_trips
        >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
        >>> from tripwatt.vehicles import load_vehicle
        >>> table = segment_trips(synthetic_fleet(4).trips, load_vehicle(VEHICLE))
        >>> power_corrector("linear").fit(table).unknown(table.take([0]))
        ((), 0.0)
        """
        return (), 0.0

    def predict_driving(self, table: SegmentTable) -> FloatArray:
        """Predict the part of `predict` that depends on the speeds of the road.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.

        Returns
        -------
        ndarray, shape (rows,)
            Power [W]; by default the prediction minus that of climate control, if the latter is not None.
        """
        climate = self.predict_climate(table)
        return self.predict(table) - (0.0 if climate is None else climate)


class TunedCorrector(PowerCorrector):
    """A corrector with parts that are all fitted, or all only tuned."""

    def fit(self, table: SegmentTable) -> Self:
        """Fit all parts, see `_each`."""
        self._each(table, "fit")
        return self

    def tune(self, table: SegmentTable) -> Self:
        """Choose the settings of all parts."""
        self._each(table, "tune")
        return self

    def _each(self, table: SegmentTable, way: Way) -> None:
        raise NotImplementedError


def summed(rows: FloatArray, hours: FloatArray | None, share: FloatArray | float = 1.0) -> FloatArray:
    """Rows times the share of each; their sum over durations [h] if these are given.

    Examples
    --------
    >>> rows, share = np.array([[2.0], [4.0]]), np.array([1.0, 0.5])
    >>> summed(rows, None, share).tolist(), summed(rows, np.array([1.0, 3.0]), share).tolist()
    ([[2.0], [2.0]], [8.0])
    """
    return (rows.T * share).T if hours is None else (hours * share) @ rows


def smooth_terms(corrector: str) -> tuple[KernelTerm, ...]:
    """Smooth terms of a corrector, from `kernels.toml`.

    Examples
    --------
    >>> smooth_terms("climate")[0]
    KernelTerm(columns=('ambient_temperature_degc',), kind='smooth', sd=200.0, length=1.0)
    """
    about = shipped_toml("hybrid/kernels.toml")[corrector]
    terms = [(columns, 1.0) for columns in about["columns"]] + [(columns, 1.5) for columns in about["wide"]]
    return tuple(KernelTerm(tuple(columns), "smooth", about["sd_w"], length) for columns, length in terms)


LINES: Final = tuple(KernelTerm((f"{cause}_w",), "line", 0.1) for cause in LINE_CAUSES)
"""Each cause of the simulation may be off by about 10 %: a calibration of the physics that is shrunk to none."""


COVARIATE_SD_W: Final = 100.0
"""Prior standard deviation of the term of a covariate [W], as of the other terms of driving in `kernels.toml`."""

SETTLED_S: Final = 3600.0
"""Time after which cabin and driveline have settled [s]: the cabin's time constant is 24 minutes (102 kJ/K of air and interior
over 70 W/K), so a twelfth of the difference is left. The battery then follows weather and load, not the time, so a longer drive
counts as the same kind of drive."""


class GPCorrector(PowerCorrector):
    """Additive Gaussian process: calibrated causes plus smooth functions of the departure state.

    The weights are fitted to the trips' totals, because rows of a trip are far from independent. The course along
    the trip is fitted to the rows: the remaining residual minus the trip's mean is regressed on the same features,
    also minus their trip's mean. The course moves energy along the trip and does not change the total. Totals are weighted by
    the standard deviation of their measurement; trips whose energy was not measured along the way do not count for the course.
    """

    def __init__(
        self,
        terms: tuple[KernelTerm, ...] = (*LINES, *smooth_terms("joint")),
        share_column: str = "simulated_w",
    ) -> None:
        self.terms = terms
        self.share_column = share_column
        self.familiarity = Familiarity()
        self.model = AdditiveGP(terms, effect_sd=220.0, share_column=share_column, share_sd=0.05)
        self.shape = np.empty(0)

    def fit(self, table: SegmentTable) -> Self:
        """Fit to trip totals, then to the rows within trips. O(rows x features^2)."""
        self.tune(table)
        self.model = replace(self.model, terms=self.terms)
        smooth = dict.fromkeys(c for term in self.terms if term.kind == "smooth" for c in term.columns)
        self.familiarity = Familiarity.from_features(table.features, tuple(smooth) or FADING)
        errors = table.energy_errors
        self.model.fit(table.features, table.residual_w, table.groups, table.hours, errors.own_wh)
        features = self.model.features(table.features)
        prior = self.model.by_feature([term.sd**2 for term in self.terms])
        left = table.residual_w - features @ self.model.weights_
        within = less_trip_mean(np.column_stack([features, left]), table)
        within = within[errors.along[table.groups]]
        if not len(within):
            self.shape = np.zeros(features.shape[1])
            return self
        X, r = within[:, :-1], within[:, -1]
        # the shape may be twice as far from the simulation as the totals; a choice
        gram = X.T @ X + np.diag(np.mean(r**2) / (4.0 * prior))
        self.shape = np.linalg.solve(gram, X.T @ r)
        return self

    def tune(self, table: SegmentTable) -> Self:
        """Leave out terms with a column that is unknown in all rows; each covariate of the table adds one."""
        covariates = (KernelTerm(columns, "smooth", COVARIATE_SD_W, 1.5) for columns in table.added.values())
        known = {name for name, column in table.features.items() if bool(column.notna().any())}
        self.terms = tuple(
            t for t in dict.fromkeys((*self.terms, *covariates)) if known.issuperset(t.columns)
        )
        return self

    def clone_tuned(self) -> GPCorrector:
        """Return an unfitted corrector with the same terms."""
        return GPCorrector(self.terms, self.share_column)

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Factor from the prior of the process: for times beyond those of the training, and for the faded part of the correction."""
        rows = table.columns
        share = self.familiarity.share(rows)[:, None]
        edge = self.model.outside_factor(rows, {"time_s": SETTLED_S}, inside=self.familiarity.ranges)
        if (share == 1.0).all():
            return edge
        lost = self.model.prior_factor(self.model.features(rows))
        return np.hstack([edge * share, lost * np.sqrt(1.0 - share**2)])

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Residual power and factor of its covariance, computed from the same features."""
        features = self.model.features(table.columns)
        share = self.familiarity.share(table.columns)
        shape = less_trip_mean((features @ self.shape * share)[:, None], table)[:, 0]
        factor = self.model.factor(summed(features, hours, share))
        return features @ self.model.weights_ * share + shape, factor


def less_trip_mean(values: FloatArray, table: SegmentTable) -> FloatArray:
    """Columns minus their mean over the time of each trip, shape (rows, columns)."""
    sums = np.add.reduceat(values * table.hours[:, None], table.offsets[:-1], axis=0)
    means = sums / np.add.reduceat(table.hours, table.offsets[:-1])[:, None]
    return np.asarray(values - np.repeat(means, np.diff(table.offsets), axis=0))


TREE_FEATURES: Final = (
    "simulated_w",
    *(f"{cause}_w" for cause in LINE_CAUSES if cause != "base_load"),
    "speed_m_s",
    "speed_change_m_s2",
    "time_s",
    *TEMPERATURES,
    "payload_mass_kg",
)


def familiarity_of(table: SegmentTable, columns: Collection[str] = FADING) -> Familiarity:
    """Ranges of the trips of a table, with the root mean square of the residual power over the trips."""
    mean_w = table.totals_wh(table.residual_w) / np.add.reduceat(table.hours, table.offsets[:-1])
    seen = Familiarity.from_features(table.features, columns)
    return replace(seen, lost_w=float(np.sqrt(np.mean(mean_w**2))))


class LearnerCorrector(TunedCorrector):
    """A learner in the style of scikit-learn on segment rows, with the trip as the group of its rows."""

    def __init__(self, model: Any, features: tuple[str, ...] = TREE_FEATURES) -> None:
        self.model = model
        self.features = features
        self.familiarity = Familiarity()

    def _each(self, table: SegmentTable, way: Way) -> None:
        """Fit to segment rows, with the trip as the cluster; columns of covariates are further features."""
        self.features = tuple(dict.fromkeys((*self.features, *itertools.chain(*table.added.values()))))
        self.familiarity = familiarity_of(table, self.features)
        learn = getattr(self.model, way, self.model.fit)
        learn(self.columns(table), table.residual_w, groups=table.groups)

    def clone_tuned(self) -> LearnerCorrector:
        """An unfitted copy with the settings that `fit` chose."""
        return LearnerCorrector(self.model.tuned(), self.features)

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]."""
        power = np.asarray(self.model.predict(self.columns(table)), dtype=np.float64)
        return power * self.familiarity.share(table.columns)

    def columns(self, table: SegmentTable) -> pd.DataFrame:
        """Columns of a table that the learner uses as features."""
        return table.features[list(self.features)]


@dataclass(eq=False, repr=False)
class EnsembleCorrector(TunedCorrector):
    """Mean of several correctors; the uncertainty is that of the first."""

    members: Sequence[PowerCorrector]

    def _each(self, table: SegmentTable, way: Way) -> None:
        """Fit each member.

        The members after the first weigh every row alike and ignore errors of measurement. For a trip that was not measured along the
        way they are fitted to the first member's estimate.
        """
        first, *others = self.members
        total_only = ~table.energy_errors.along[table.groups]
        getattr(first, "fit" if total_only.any() else way)(table)
        if total_only.any():
            learned = table.simulated_w + first.predict(table)
            table = replace(table, observed_w=np.where(total_only, learned, table.observed_power_w))
        for member in others:
            getattr(member, way)(table)

    def clone_tuned(self) -> EnsembleCorrector:
        """Copies of the members with the settings that `fit` chose."""
        return EnsembleCorrector([m.clone_tuned() for m in self.members])

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Factor of the first member; trees fade outside of their range and have no variance of their own."""
        return self.members[0].outside_factor(table)

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Mean residual power of all members, and the uncertainty of the first."""
        mean, uncertainty = self.members[0].predict_with_uncertainty(table, hours)
        return np.asarray(np.mean([mean, *(m.predict(table) for m in self.members[1:])], axis=0)), uncertainty


def boosting_corrector(seed: int, features: tuple[str, ...] = TREE_FEATURES) -> LearnerCorrector:
    """Make an unfitted corrector by clustered boosting on segment rows."""
    require_extras({"learners": "the corrector boosting"})
    from tripwatt.learners.boosting import ClusteredBoosting

    settings: dict[str, Any] = {
        "max_leaf_nodes": 4,
        "learning_rate": 0.05,
        "max_features": 0.6,
        "subsample": 0.7,
    }
    model = ClusteredBoosting(random_state=seed, max_rows_per_group=None, **settings)
    return LearnerCorrector(model, features)


def forest_corrector(seed: int) -> LearnerCorrector:
    """Make an unfitted corrector by a clustered forest on segment rows."""
    require_extras({"learners": "the corrector forest"})
    from tripwatt.learners.forest import ClusteredForest

    return LearnerCorrector(ClusteredForest(n_trees=200, random_state=seed, max_rows_per_group=None))


class GammCorrector(PowerCorrector):
    """The GAMM engine on segment power: smooths of the departure state and the drive, a random effect per trip."""

    FORMULA: Final = (
        "y ~ s(ambient_temperature_degc, k=6) + s(cabin_temperature_degc, k=6) + s(battery_temperature_degc, k=6) + "
        's(time_s, k=6) + s(speed_m_s, k=6) + s(simulated_w, k=6) + s(climate_w, k=6) + s(trip, bs="re")'
    )

    def fit(self, table: SegmentTable) -> Self:
        """Fit the GAMM with Gaussian errors by REML."""
        self.medians_, self.added_ = table.features.median(), table.added
        self.familiarity = familiarity_of(table)
        with gamm_engine() as engine:
            random = [
                f' + s(covariate{i}, bs="re")' if len(c) > 1 else f" + covariate{i}"
                for i, c in enumerate(table.added.values())
            ]
            self.model = engine.GAMM(self.FORMULA + "".join(random), extrapolation="clamp").fit(
                self._frame(table, trips=True), table.residual_w
            )
        return self

    def clone_tuned(self) -> GammCorrector:
        """Return an unfitted corrector with the same formula."""
        return GammCorrector()

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]; the random effect of a new trip is 0."""
        power = np.asarray(self.model.predict(self._frame(table)), dtype=np.float64)
        return power * self.familiarity.share(table.columns)

    def _frame(self, table: SegmentTable, *, trips: bool = False) -> pd.DataFrame:
        frame = table.features.fillna(self.medians_.fillna(0.0).to_dict())
        for i, columns in enumerate(self.added_.values()):
            values = frame[[*columns]].to_numpy()
            frame[f"covariate{i}"] = values[:, 0] if len(columns) == 1 else values.argmax(axis=1).astype(str)
        return frame.assign(trip=table.groups.astype(str)) if trips else frame


CLIMATE_TERMS: Final = (KernelTerm(("climate_w",), "line", 0.3), *smooth_terms("climate"))
"""Terms of the climate correction: a share of the simulated power (sd 30 %) and smooth functions of the state."""

DRIVE_TERMS: Final = (*(term for term in LINES if term.columns != ("climate_w",)), *smooth_terms("drive"))
"""Terms of the driving correction: those of the joint corrector without the cabin's."""

DRIVE_TREE_FEATURES: Final = tuple(
    n for n in TREE_FEATURES if n != "climate_w" and not n.startswith("cabin_")
)


@dataclass(eq=False, repr=False)
class SplitCorrector(TunedCorrector):
    """One corrector for climate control and one for driving, or a joint one if too few trips log climate control.

    A log with the power of heater and air conditioner splits the residual in two. The power of climate control depends on
    temperatures and time, the power of driving on road and speed. If both are fitted separately, neither is disturbed by the
    noise of the other, and each is updated on the way by its own measurements. If too few trips log climate control, one
    corrector corrects both jointly.

    Parameters
    ----------
    climate, drive, joint : PowerCorrector
        Correctors of climate control, of driving, and of the undivided residual.
    split : bool or None
        Whether to correct separately; None decides by the trips of `fit`.

    Attributes
    ----------
    split_ : bool
        Whether climate control and driving are corrected separately.
    """

    climate: PowerCorrector
    drive: PowerCorrector
    joint: PowerCorrector
    split: bool | None = None

    def __post_init__(self) -> None:
        self.split_ = bool(self.split)

    def _each(self, table: SegmentTable, way: Way) -> None:
        """Fit climate control to the trips that log it, then driving to the remaining residual of all trips."""
        logged = climate_logged(table)
        # eight trips and half of all with logged climate control: a separate correction from fewer is worse; a choice
        enough = int(logged.sum()) >= 8 and float(logged.mean()) >= 0.5
        self.split_ = enough if self.split is None else self.split
        if not self.split_:
            getattr(self.joint, way)(table)
            return
        own = replace(
            table,
            simulated_w=table.columns["climate_w"],
            observed_w=table.observed_climate_w,
            errors=None,
        )
        residual = table.climate_residual_w
        getattr(self.climate, way if logged.all() else "fit")(own.take(np.flatnonzero(logged)))
        if not logged.all():
            residual = np.where(logged[table.groups], residual, self.climate.predict(table))
        getattr(self.drive, way)(replace(table, observed_w=table.observed_power_w - residual))

    def clone_tuned(self) -> SplitCorrector:
        """Unfitted copies with the settings that `fit` chose."""
        if self.split_:
            return SplitCorrector(self.climate.clone_tuned(), self.drive.clone_tuned(), self.joint, True)
        return SplitCorrector(self.climate, self.drive, self.joint.clone_tuned(), False)

    @property
    def _parts(self) -> tuple[PowerCorrector, ...]:
        return (self.climate, self.drive) if self.split_ else (self.joint,)

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Factors of the parts side by side, since the covariances of independent corrections add up."""
        return np.hstack([part.outside_factor(table) for part in self._parts])

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Sum of the parts' residual powers, and their factors side by side."""
        of_parts = [part.predict_with_uncertainty(table, hours) for part in self._parts]
        powers, factors = zip(*of_parts, strict=True)
        return np.asarray(sum(powers)), np.hstack(factors)

    def predict_climate(self, table: SegmentTable) -> FloatArray | None:
        """Correction of climate control [W]; None if climate control and driving are corrected jointly."""
        return self.climate.predict(table) if self.split_ else None


def climate_logged(table: SegmentTable) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether a trip logs the power of its climate control in every segment, shape (trips,)."""
    known = np.isfinite(table.climate_residual_w).astype(np.int64)
    return np.asarray(np.minimum.reduceat(known, table.offsets[:-1]) == 1)


def split_corrector(seed: int) -> SplitCorrector:
    """Make the default corrector.

    Climate control is corrected by an additive Gaussian process, driving and both jointly by the mean of such a process and boosting.
    """
    return SplitCorrector(
        GPCorrector(CLIMATE_TERMS, share_column="climate_w"),
        EnsembleCorrector([GPCorrector(DRIVE_TERMS), boosting_corrector(seed, DRIVE_TREE_FEATURES)]),
        EnsembleCorrector([GPCorrector(), boosting_corrector(seed)]),
    )
