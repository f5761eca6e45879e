"""Where physics meets statistics: simulated energy plus a learned correction, in the paper's four steps.

1. Simulate the car along each trip; the simulated cumulative energy becomes a column.
2. ``residual = observed - simulated``, of the cumulative energy.
3. A corrector learns the residual from covariates; the trip is only the cluster.
4. ``predicted = simulated + correction``.

`TripTable` holds all trips as flat arrays, so that no model walks over trips. `PhysicsOnly`, `DataOnly` and
`EnergyRegression` satisfy the same protocol as `HybridModel`: evaluation has no special cases.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Protocol, Self

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.physics import simulate_trip
from tripwatt.trips import FloatArray, Trip, require_unique_ids, resample
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

IntArray = npt.NDArray[np.int64]

COVARIATES: Final = (
    "time_s",
    "speed_m_s",
    "ambient_temperature_degc",
    "elevation_difference_m",
    "season",
    "weather",
)
"""Covariates of the paper's correctors; those that no trip knows are dropped and said so."""

COMFORT_TEMPERATURE_DEGC: Final = 20.0
"""Threshold of the linear baselines: heating below, cooling above (same value as for the peers' figures)."""

UNKNOWN_LEVEL: Final = "unknown"


@dataclass(frozen=True, eq=False)
class TripTable:
    """Trips as one flat table: rows of trip i are ``offsets[i]:offsets[i + 1]``.

    Attributes
    ----------
    trips : tuple of Trip
        Resampled trips, in order.
    offsets : ndarray of int, shape (trips + 1,)
    covariates : DataFrame, (rows, covariates)
        Numbers as float64, season and weather as categories.
    observed_wh : ndarray, shape (rows,)
        Measured cumulative energy [Wh]; its last value per trip is the trip's observed energy.
    simulated_wh : mapping of str to ndarray, shape (rows,)
        Simulated cumulative energy [Wh] by the name of the physics preset.
    totals : DataFrame, (rows, 6)
        Running sums that the linear baselines use: km, hours, cold and hot hours, cubed speed, acceleration work.
    notes : tuple of str
        Covariates that were dropped, and why.
    """

    trips: tuple[Trip, ...]
    offsets: IntArray
    covariates: pd.DataFrame
    observed_wh: FloatArray
    simulated_wh: Mapping[str, FloatArray]
    totals: pd.DataFrame
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.trips)

    @property
    def trip_ids(self) -> tuple[str, ...]:
        """Ids of the trips, in order."""
        return tuple(t.trip_id for t in self.trips)

    @property
    def groups(self) -> IntArray:
        """Index of the trip that each row belongs to, shape (rows,)."""
        return np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.offsets))

    @property
    def last_rows(self) -> IntArray:
        """Row at the end of each trip, shape (trips,)."""
        return self.offsets[1:] - 1

    def rows_of(self, members: IntArray) -> IntArray:
        """Row numbers of the given trips, in their order."""
        if not len(members):
            return np.empty(0, np.int64)
        return np.concatenate([np.arange(self.offsets[i], self.offsets[i + 1]) for i in members])

    def take(self, members: Sequence[int] | IntArray) -> TripTable:
        """The table of some of the trips. O(their rows)."""
        index = np.asarray(members, dtype=np.int64)
        rows = self.rows_of(index)
        lengths = np.diff(self.offsets)[index]
        return replace(
            self,
            trips=tuple(self.trips[i] for i in index),
            offsets=np.concatenate(([0], np.cumsum(lengths))),
            covariates=self.covariates.iloc[rows].reset_index(drop=True),
            observed_wh=self.observed_wh[rows],
            simulated_wh={name: values[rows] for name, values in self.simulated_wh.items()},
            totals=self.totals.iloc[rows].reset_index(drop=True),
        )

    def without_samples(self) -> TripTable:
        """The same table without the trips' own samples, which no model looks at: cheap to send to a process."""
        return replace(self, trips=tuple(replace(t, samples=t.samples.iloc[:0]) for t in self.trips))

    def digest(self) -> str:
        """SHA-256 of everything that a model can see, to tell whether stored folds still belong to these trips."""
        sha = hashlib.sha256("\n".join(self.trip_ids).encode())
        for values in (
            self.offsets,
            self.observed_wh,
            *(self.simulated_wh[k] for k in sorted(self.simulated_wh)),
        ):
            sha.update(np.ascontiguousarray(values).tobytes())
        sha.update(pd.util.hash_pandas_object(self.covariates, index=False).to_numpy().tobytes())
        return sha.hexdigest()


def build_table(trips: Sequence[Trip], physics: Mapping[str, Vehicle], *, step_s: float = 1.0) -> TripTable:
    """Resample and simulate the trips and lay them side by side. O(samples x presets).

    Parameters
    ----------
    trips : sequence of Trip
        Raw trips with a measured energy.
    physics : mapping of str to Vehicle
        The car under each physics preset, e.g. ``{"physics-paper": ..., "physics": ...}``.
    step_s : float
        Length of the block means [s].

    Raises
    ------
    InvalidInput
        When there is no trip, two share an id, or one has no measured, positive energy.
    """
    require_unique_ids(trips)
    faults = [
        Fault(
            "no measured energy",
            t.trip_id,
            f"{t.observed_energy_wh} Wh",
            "voltage and current, energy above 0 Wh",
        )
        for t in trips
        if t.observed_energy_wh is None or not t.observed_energy_wh > 0
    ]
    if not trips:
        faults.append(Fault("no trips", "trips", "0", "at least one"))
    if faults:
        raise InvalidInput(faults)
    blocks = tuple(resample(trip, step_s) for trip in trips)
    covariates, notes = _covariates(blocks)
    return TripTable(
        trips=blocks,
        offsets=np.concatenate(([0], np.cumsum([len(b) for b in blocks]))).astype(np.int64),
        covariates=covariates,
        observed_wh=np.concatenate([b.array("observed_energy_wh") for b in blocks]),
        simulated_wh={
            name: np.concatenate([simulate_trip(vehicle, b).energy_wh for b in blocks])
            for name, vehicle in physics.items()
        },
        totals=pd.concat([_totals(b) for b in blocks], ignore_index=True),
        notes=notes,
    )


def _covariates(blocks: Sequence[Trip]) -> tuple[pd.DataFrame, tuple[str, ...]]:
    lengths = [len(b) for b in blocks]

    def numbers(column: str) -> FloatArray:
        return np.concatenate([b.array(column) if column in b else np.full(len(b), np.nan) for b in blocks])

    def levels(values: Sequence[str | None]) -> pd.Series[Any]:
        known = [UNKNOWN_LEVEL if v is None else v for v in values]
        categories = pd.CategoricalDtype(sorted(set(known)))
        return pd.Series(np.repeat(np.asarray(known, dtype=object), lengths)).astype(categories)

    elevation = numbers("elevation_m")
    starts = np.concatenate(([0], np.cumsum(lengths)[:-1]))
    frame = pd.DataFrame(
        {
            "time_s": numbers("time_s"),
            "speed_m_s": numbers("speed_m_s"),
            "ambient_temperature_degc": numbers("ambient_temperature_degc"),
            "elevation_difference_m": elevation - np.repeat(elevation[starts], lengths),
            "season": levels([b.context.season for b in blocks]),
            "weather": levels([b.context.weather for b in blocks]),
        }
    )
    unknown = [
        name
        for name in COVARIATES
        if frame[name].isna().all()
        or (frame[name].dtype == "category" and set(frame[name]) == {UNKNOWN_LEVEL})
    ]
    notes = tuple(f"covariate {name} dropped: no trip knows it" for name in unknown)
    return frame.drop(columns=unknown), notes


def _totals(block: Trip) -> pd.DataFrame:
    """Running sums of the linear baselines along one trip; the ambient temperature is the trip's mean."""
    time, speed = block.array("time_s"), block.array("speed_m_s")
    step = np.diff(time, prepend=time[0])
    hours = (time - time[0]) / SECONDS_PER_HOUR
    ambient = (
        float(np.nanmean(block.array("ambient_temperature_degc")))
        if block.has("ambient_temperature_degc")
        else COMFORT_TEMPERATURE_DEGC
    )
    increments = np.diff(speed, prepend=speed[0])
    return pd.DataFrame(
        {
            "distance_km": np.cumsum(speed * step) / 1000.0,
            "duration_h": hours,
            "cold_h": hours * max(0.0, COMFORT_TEMPERATURE_DEGC - ambient),
            "hot_h": hours * max(0.0, ambient - COMFORT_TEMPERATURE_DEGC),
            "cubed_speed": np.cumsum(speed**3 * step),
            "acceleration_work": np.cumsum(np.maximum(increments, 0.0) * speed),
        }
    )


class Corrector(Protocol):
    """What a hybrid asks of a learner: scikit-learn's fit and predict, with the trip as the cluster."""

    def fit(self, X: Any, y: Any, groups: Any = None) -> Any:
        """Learn `y` from the columns of `X`; rows of one group belong together."""
        ...

    def predict(self, X: Any) -> Any:
        """Predicted `y`, shape (rows,)."""
        ...


class EnergyModel(Protocol):
    """Anything that predicts the cumulative energy of trips."""

    simulation: str | None
    """Physics preset that the prediction starts from; None without physics."""

    def fit(self, table: TripTable) -> Self:
        """Learn from the trips of the table."""
        ...

    def predict(self, table: TripTable) -> FloatArray:
        """Cumulative energy at each row [Wh], shape (rows,)."""
        ...


@dataclass
class PhysicsOnly:
    """The simulation as it is; nothing to learn."""

    simulation: str | None

    def fit(self, table: TripTable) -> Self:
        """Nothing is learned."""
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Simulated cumulative energy [Wh], shape (rows,)."""
        return _simulated(table, self.simulation)


@dataclass
class HybridModel:
    """Simulation plus a correction of its cumulative energy.

    Parameters
    ----------
    corrector : Corrector
        Learns ``residual = observed - simulated`` [Wh] from the covariates; its groups are the trips.
    simulation : str or None
        Physics preset to correct; None makes it a purely data-driven model (see `DataOnly`).
    shares_folds : bool
        Whether the corrector has `leave_groups_out`, which gives the held-out predictions of all folds at once,
        identical in law to one refit per fold.
    """

    corrector: Any
    simulation: str | None
    shares_folds: bool = False

    def fit(self, table: TripTable) -> Self:
        """Steps 2 and 3: take the residual, learn it."""
        X, residual, groups = self.training_data(table)
        self.corrector.fit(X, residual, groups=groups)
        return self

    def training_data(self, table: TripTable) -> tuple[pd.DataFrame, FloatArray, IntArray]:
        """What the corrector learns from: covariates, residual [Wh] and the trip of each row."""
        return table.covariates, table.observed_wh - _simulated(table, self.simulation), table.groups

    def predict(self, table: TripTable) -> FloatArray:
        """Step 4: simulated plus correction [Wh], shape (rows,)."""
        correction = np.asarray(self.corrector.predict(table.covariates), dtype=np.float64)
        return _simulated(table, self.simulation) + correction

    def predict_held_out(self, table: TripTable, folds: IntArray) -> FloatArray:
        """Predictions of every row by a model that never saw its fold [Wh].

        Parameters
        ----------
        table : TripTable
        folds : ndarray of int, shape (trips,)
            Fold of each trip.
        """
        row_folds = np.repeat(folds, np.diff(table.offsets))
        X, residual, groups = self.training_data(table)
        correction = self.corrector.leave_groups_out(X, residual, groups=groups, folds=row_folds)
        return _simulated(table, self.simulation) + np.asarray(correction, dtype=np.float64)


def DataOnly(corrector: Corrector, *, shares_folds: bool = False) -> HybridModel:  # noqa: N802 - reads as a model
    """The same learner on the observed energy itself: the paper's purely data-driven benchmark."""
    return HybridModel(corrector, simulation=None, shares_folds=shares_folds)


@dataclass
class EnergyRegression:
    """Linear regression of a trip's energy on running totals, least squares of the relative error.

    Rows of the least-squares problem are trips, divided by the trip's observed energy; no intercept. The totals are
    running sums, so the same coefficients give the energy along the trip. With `simulation`, the simulated energy is
    the first regressor's stand-in for distance (coefficient free).

    Parameters
    ----------
    regressors : tuple of str
        Columns of `TripTable.totals`.
    simulation : str or None
        Physics preset whose energy is one more regressor.
    """

    regressors: tuple[str, ...]
    simulation: str | None = None
    coefficients_: FloatArray = field(default_factory=lambda: np.empty(0))

    def fit(self, table: TripTable) -> Self:
        """Least squares over trips. O(trips x regressors^2)."""
        last = table.last_rows
        observed = table.observed_wh[last]
        design = self._design(table)[last] / observed[:, None]
        self.coefficients_ = np.asarray(
            np.linalg.lstsq(design, np.ones(len(last)), rcond=None)[0], dtype=np.float64
        )
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Cumulative energy [Wh], shape (rows,)."""
        return np.asarray(self._design(table) @ self.coefficients_, dtype=np.float64)

    def _design(self, table: TripTable) -> FloatArray:
        totals = table.totals[list(self.regressors)].to_numpy(dtype=np.float64)
        if self.simulation is None:
            return totals
        return np.column_stack([_simulated(table, self.simulation), totals])


def _simulated(table: TripTable, simulation: str | None) -> FloatArray:
    if simulation is None:
        return np.zeros(len(table.observed_wh))
    return table.simulated_wh[simulation]


TABLE2: Final = (
    "weather",
    "s(time_s)",
    "s(ambient_temperature_degc)",
    "s(speed_m_s)",
    "s(elevation_difference_m)",
    "s(time_s, by=winter)",
    "s(ambient_temperature_degc, by=winter)",
    "s(ambient_temperature_degc, elevation_difference_m, k=30)",
    's(trip, bs="re")',
)
"""Terms of the paper's Table 2; `winter` is a 0/1 variable, `trip` the cluster."""


@dataclass
class Table2Corrector:
    """The paper's GAMM with Student's t errors (its Table 2) as a corrector.

    Terms whose covariates no trip knows, or that are the same in all training rows, are left out. A missing value counts as the training rows' median (a trip
    without elevation counts as flat). Unseen weather and covariates outside the training range follow the engine's
    rule, which is bounded: the mean effect, and the range's edge.

    Parameters
    ----------
    every_rows : int
        The fit takes every so many rows of a trip and its last one. At 1 s the residuals of successive rows are so
        alike (correlation 0.999) that every smooth would run to its largest number of degrees of freedom.

    Attributes
    ----------
    model_ : GAMM
        The fitted engine, for summary, diagnosis and effects.
    left_out_ : tuple of str
        Terms of `TABLE2` that the training rows cannot tell.
    """

    every_rows: int = 60
    model_: Any = None
    medians_: pd.Series | None = None
    left_out_: tuple[str, ...] = ()

    def fit(self, X: pd.DataFrame, y: FloatArray, groups: IntArray) -> Self:
        """Fit by performance iteration and fREML. O(rows x coefficients^2)."""
        self.medians_ = X.select_dtypes("number").median()
        frame, rows = self.training_frame(X, groups)
        varied = {name for name in map(str, frame) if len(frame[name].unique()) > 1}
        terms = [term for term in TABLE2 if varied.issuperset(_names_in(term))]
        self.left_out_ = tuple(term for term in TABLE2 if term not in terms)
        self.model_ = self._engine(terms).fit(frame, np.asarray(y)[rows], groups=groups[rows])
        return self

    def predict(self, X: pd.DataFrame) -> FloatArray:
        """Predicted `y` of new trips: their random effect is 0."""
        return np.asarray(self.model_.predict(self.frame(X)), dtype=np.float64)

    def training_frame(self, X: pd.DataFrame, groups: IntArray) -> tuple[pd.DataFrame, IntArray]:
        """The rows that `fit` takes, as the engine sees them, and their numbers."""
        position = pd.Series(groups).groupby(groups, sort=False).cumcount().to_numpy()
        last = np.append(groups[1:] != groups[:-1], True)
        rows = np.flatnonzero((position % self.every_rows == 0) | last).astype(np.int64)
        return self.frame(X.iloc[rows], groups[rows]), rows

    @staticmethod
    def _engine(terms: Sequence[str]) -> Any:
        from tripwatt.gam import GAMM

        return GAMM("y ~ " + " + ".join(terms), family="scat")

    def frame(self, X: pd.DataFrame, groups: IntArray | None = None) -> pd.DataFrame:
        """Covariates as the engine sees them; with `groups`, the trips are those of the fit. Needs `fit`."""
        assert self.medians_ is not None
        frame = X.fillna(self.medians_.to_dict())
        if "season" in frame:
            frame["winter"] = (frame["season"] == "winter").astype(float)
        if groups is not None:
            frame["trip"] = groups.astype(str)
        return frame


def _names_in(term: str) -> list[str]:
    """Column names that a term of `TABLE2` needs."""
    inner = term[2:-1] if term.startswith("s(") else term
    parts = [part.strip() for part in inner.split(",")]
    return [p.removeprefix("by=") for p in parts if "=" not in p or p.startswith("by=")]


ModelFactory = Callable[[int], EnergyModel]
"""Makes a fresh model from a seed."""
