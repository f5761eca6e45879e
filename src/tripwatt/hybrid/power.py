"""Correct power: the residual power of short segments, estimated from what is known before departure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Final, Self

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


class PowerCorrector:
    """The residual power of segments, predicted from what is known before departure.

    A corrector implements `predict`, or `predict_with_uncertainty` where it has an uncertainty of its own. One that can be fitted
    implements `fit` and `clone_tuned` as well.

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
    """What to do in place of a fit, for one that cannot be fitted."""

    def fit(self, table: SegmentTable) -> Self:
        """Fit to the trips of a table.

        Parameters
        ----------
        table : SegmentTable
            Segments of trips with measured power.

        Returns
        -------
        PowerCorrector
            Itself.

        Raises
        ------
        InvalidInput
            For one that was made from a fitted one, and not from trips.
        """
        raise InvalidInput.of("corrector cannot be fitted", type(self).__name__, fix=self.refit)

    def clone_tuned(self) -> PowerCorrector:
        """Make an unfitted copy with the settings that `fit` chose, to fit on a part of the same trips.

        Returns
        -------
        PowerCorrector
            Of the same kind.

        Raises
        ------
        InvalidInput
            As `fit`.
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

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[FloatArray, FloatArray]:
        """Predict the residual power of each row, and the corrector's own uncertainty.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.

        Returns
        -------
        power_w : ndarray, shape (rows,)
            As of `predict` [W].
        factor_w : ndarray, shape (rows, any)
            `L` with ``L @ L.T`` the covariance of the corrector's own uncertainty [W]; zeros where it has none.
        """
        return self.predict(table), np.zeros((len(table.hours), 1))

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Compute `L` as `predict_with_uncertainty` does, of what the correction may be outside of what it was fitted to.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.

        Returns
        -------
        ndarray, shape (rows, any)
            `L` [W]; no columns where that is not known.
        """
        return np.zeros((len(table.hours), 0))

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

    def predict_driving(self, table: SegmentTable) -> FloatArray:
        """Predict the part of `predict` that the speeds of the road decide.

        Parameters
        ----------
        table : SegmentTable
            Segments; their measured power is not used.

        Returns
        -------
        ndarray, shape (rows,)
            Power [W]: all but climate control, where that is known.
        """
        climate = self.predict_climate(table)
        return self.predict(table) - (0.0 if climate is None else climate)


def smooth_terms(corrector: str) -> tuple[KernelTerm, ...]:
    """The smooth terms of a corrector, from `kernels.toml`.

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


SETTLED_S: Final = 3600.0
"""Time after which cabin and driveline have settled: the cabin's time constant is 24 minutes (102 kJ/K of air and interior
over 70 W/K), so a twelfth of the difference is left. The battery then follows weather and load, not the time: a longer drive is
no other kind of drive."""


class GPCorrector(PowerCorrector):
    """Additive Gaussian process: calibrated causes plus smooth functions of the departure state.

    The weights are fitted to the trips' totals, because rows of a trip are far from independent. The course along
    the trip is fitted to the rows: the remaining residual less the trip's mean is regressed on the same features,
    also less their trip's mean. It moves energy along the trip and does not change the total. A total counts by the
    standard deviation of its measurement; a trip whose energy was not measured along the way has no course.
    """

    def __init__(
        self,
        terms: tuple[KernelTerm, ...] = (*LINES, *smooth_terms("joint")),
        share_column: str = "simulated_w",
    ) -> None:
        self._set_terms(terms, share_column)

    def _set_terms(self, terms: tuple[KernelTerm, ...], share_column: str) -> None:
        self.terms = terms
        self.share_column = share_column
        self.familiarity = Familiarity()
        self.model = AdditiveGP(terms, effect_sd=220.0, share_column=share_column, share_sd=0.05)
        self.shape = np.empty(0)

    def fit(self, table: SegmentTable) -> Self:
        """Learn from trip totals, then from the rows within trips. O(rows x features^2).

        Terms with a column that no row has are left out.
        """
        known = {name for name, column in table.features.items() if bool(column.notna().any())}
        self._set_terms(
            tuple(term for term in self.terms if known.issuperset(term.columns)), self.share_column
        )
        self.familiarity = Familiarity.from_features(table.features, fading_columns(self.terms))
        errors = table.energy_errors
        self.model.fit(table.features, table.residual_w, table.groups, table.hours, errors.own_wh)
        features, prior = self.model.features(table.features)
        left = table.residual_w - self.model.predict(table.features)
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

    def clone_tuned(self) -> GPCorrector:
        """The same terms."""
        return GPCorrector(self.terms, self.share_column)

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]."""
        return self._mean(self.model.features(table.features)[0], table)

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """From the prior of the process: of time beyond that of the training, and of the part that does not count."""
        share = self.familiarity.share(table.features)[:, None]
        edge = self.model.outside_factor(
            table.features, {"time_s": SETTLED_S}, inside=self.familiarity.ranges
        )
        if (share == 1.0).all():
            return edge
        lost = self.model.prior_factor(self.model.features(table.features)[0])
        return np.hstack([edge * share, lost * np.sqrt(1.0 - share**2)])

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[FloatArray, FloatArray]:
        """Both from the same features."""
        features, _ = self.model.features(table.features)
        share = self.familiarity.share(table.features)
        return self._mean(features, table), self.model.factor(features) * share[:, None]

    def _mean(self, features: FloatArray, table: SegmentTable) -> FloatArray:
        """The mean of the process and the shape within the trip, as far as they count."""
        share = self.familiarity.share(table.features)
        shape = less_trip_mean((features @ self.shape * share)[:, None], table)[:, 0]
        return self.model.mean(features) * share + shape


def fading_columns(terms: Iterable[KernelTerm]) -> tuple[str, ...]:
    """Covariates of the smooth terms; every one of `FADING` where there are only lines."""
    smooth = dict.fromkeys(c for term in terms if term.kind == "smooth" for c in term.columns)
    return tuple(smooth) or FADING


def less_trip_mean(values: FloatArray, table: SegmentTable) -> FloatArray:
    """Columns less their mean over the time of each trip, shape (rows, columns)."""
    sums = np.add.reduceat(values * table.hours[:, None], table.offsets[:-1], axis=0)
    means = sums / np.add.reduceat(table.hours, table.offsets[:-1])[:, None]
    return np.asarray(values - means[table.groups])


TREE_FEATURES: Final = (
    "simulated_w",
    *(f"{cause}_w" for cause in LINE_CAUSES if cause != "base_load"),
    "speed_m_s",
    "speed_change_m_s2",
    "time_s",
    *TEMPERATURES,
    "payload_mass_kg",
)


class LearnerCorrector(PowerCorrector):
    """A scikit-learn style learner on segment rows, each trip weighing the same."""

    def __init__(self, model: Any, features: tuple[str, ...] = TREE_FEATURES) -> None:
        self.model = model
        self.features = features
        self.familiarity = Familiarity()

    def fit(self, table: SegmentTable) -> Self:
        """Learn from segment rows, the trip as the cluster."""
        self.familiarity = Familiarity.from_features(table.features, self.features)
        self.model.fit(self.columns(table), table.residual_w, groups=table.groups)
        return self

    def clone_tuned(self) -> LearnerCorrector:
        """An unfitted copy with the settings that `fit` chose."""
        return LearnerCorrector(self.model.tuned(), self.features)

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]."""
        power = np.asarray(self.model.predict(self.columns(table)), dtype=np.float64)
        return power * self.familiarity.share(table.features)

    def columns(self, table: SegmentTable) -> pd.DataFrame:
        """The learner's features of a table."""
        return table.features[list(self.features)]


class EnsembleCorrector(PowerCorrector):
    """Mean of several correctors; the uncertainty is that of the first."""

    def __init__(self, members: Sequence[PowerCorrector]) -> None:
        self.members = tuple(members)

    def fit(self, table: SegmentTable) -> Self:
        """Fit each member.

        The others weigh every row alike and have no errors of measurement: of a trip that was not measured along the way they are fitted to
        the first one's estimate.
        """
        first, *others = self.members
        first.fit(table)
        total_only = ~table.energy_errors.along[table.groups]
        if total_only.any():
            learned = table.simulated_w + first.predict(table)
            table = replace(table, observed_w=np.where(total_only, learned, table.observed_power_w))
        for member in others:
            member.fit(table)
        return self

    def clone_tuned(self) -> EnsembleCorrector:
        """Copies of the members with the settings that `fit` chose."""
        return EnsembleCorrector([m.clone_tuned() for m in self.members])

    def predict(self, table: SegmentTable) -> FloatArray:
        """Mean residual power [W]."""
        return np.asarray(np.mean([m.predict(table) for m in self.members], axis=0))

    def outside_factor(self, table: SegmentTable) -> FloatArray:
        """Of the first member; trees fade outside of their range and have no variance of their own."""
        return self.members[0].outside_factor(table)

    def predict_with_uncertainty(self, table: SegmentTable) -> tuple[FloatArray, FloatArray]:
        """The first member does both at once."""
        mean, uncertainty = self.members[0].predict_with_uncertainty(table)
        return np.asarray(np.mean([mean, *(m.predict(table) for m in self.members[1:])], axis=0)), uncertainty


def boosting_corrector(seed: int, features: tuple[str, ...] = TREE_FEATURES) -> LearnerCorrector:
    """Clustered boosting on segment rows, fresh."""
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
    """Clustered forest on segment rows, fresh."""
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
        """Gaussian errors, REML."""
        self.medians_ = table.features.median()
        self.familiarity = Familiarity.from_features(table.features, FADING)
        with gamm_engine() as engine:
            self.model = engine.GAMM(self.FORMULA).fit(self._frame(table, trips=True), table.residual_w)
        return self

    def clone_tuned(self) -> GammCorrector:
        """The same formula."""
        return GammCorrector()

    def predict(self, table: SegmentTable) -> FloatArray:
        """Residual power [W]; the random effect of a new trip is 0."""
        power = np.asarray(self.model.predict(self._frame(table)), dtype=np.float64)
        return power * self.familiarity.share(table.features)

    def _frame(self, table: SegmentTable, *, trips: bool = False) -> pd.DataFrame:
        frame = table.features.fillna(self.medians_.fillna(0.0).to_dict())
        return frame.assign(trip=table.groups.astype(str)) if trips else frame
