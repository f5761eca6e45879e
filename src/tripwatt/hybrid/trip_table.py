"""Trips as one flat table, so that no model loops over trips, the protocol of models of their energy, and baselines of these."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol, Self

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, IntArray, changes
from tripwatt.hybrid.rows import RowTable
from tripwatt.hybrid.segments import require_measured
from tripwatt.physics import simulate_trip
from tripwatt.trips import Trip, require_unique_ids, resample
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

COVARIATES: Final = (
    "time_s",
    "speed_m_s",
    "ambient_temperature_degc",
    "elevation_difference_m",
    "season",
    "weather",
)
"""Covariates of the paper's correctors; covariates that no trip has are dropped, with a note."""

COMFORT_TEMPERATURE_DEGC: Final = 20.0
"""Threshold of the linear baselines [°C]: heating below, cooling above (same value as for the peers' figures)."""

UNKNOWN_LEVEL: Final = "unknown"


@dataclass(frozen=True, eq=False)
class TripTable(RowTable):
    """Trips as one flat table: rows of trip i are ``offsets[i]:offsets[i + 1]``.

    Attributes
    ----------
    trips : tuple of Trip
        Resampled trips, in order.
    offsets : ndarray of int, shape (trips + 1,)
        First row of each trip, and the number of rows.
    covariates : DataFrame, (rows, covariates)
        Covariates: numbers as float64, season and weather as categories.
    observed_wh : ndarray, shape (rows,)
        Measured cumulative energy [Wh]; its last value per trip is the trip's observed energy.
    simulated_wh : mapping of str to ndarray, shape (rows,)
        Simulated cumulative energy [Wh] by the name of the physics preset.
    totals : DataFrame, (rows, 6)
        Running sums that the linear baselines use: km, hours, cold and hot hours, cubed speed, acceleration work.
    notes : tuple of str
        Covariates that were dropped, and why.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(2).trips, {"physics": load_vehicle(VEHICLE)})
    >>> len(table.take([1]).trips), len(table.rows_of(np.array([0]))) == int(table.offsets[1])
    (1, True)
    >>> float(table.simulated(None).sum())
    0.0
    >>> light = table.without_samples()
    >>> len(light.trips[0].samples), light.digest() == table.digest()
    (0, True)
    """

    by_trip = ("trips",)
    by_row = ("covariates", "observed_wh", "simulated_wh", "totals")

    trips: tuple[Trip, ...]
    offsets: IntArray
    covariates: pd.DataFrame
    observed_wh: FloatArray
    simulated_wh: Mapping[str, FloatArray]
    totals: pd.DataFrame
    notes: tuple[str, ...] = ()

    @property
    def trip_ids(self) -> tuple[str, ...]:
        """Ids of the trips, in order."""
        return tuple(t.trip_id for t in self.trips)

    @property
    def days(self) -> tuple[str, ...]:
        """Date of each trip, or its id if it has no date."""
        return tuple(
            t.trip_id if t.context.started_at is None else f"{t.context.started_at:%Y-%m-%d}"
            for t in self.trips
        )

    @property
    def last_rows(self) -> IntArray:
        """Row at the end of each trip, shape (trips,)."""
        return self.offsets[1:] - 1

    def simulated(self, preset: str | None) -> FloatArray:
        """Look up the simulated cumulative energy of a physics preset.

        Parameters
        ----------
        preset : str or None
            A key of `simulated_wh`.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy [Wh]; zeros for None.
        """
        return np.zeros(len(self.observed_wh)) if preset is None else self.simulated_wh[preset]

    def without_samples(self) -> TripTable:
        """Drop the samples of the trips, which no model uses, so that the table is cheap to send to a process.

        Returns
        -------
        TripTable
            Table with the same rows.
        """
        return replace(self, trips=tuple(replace(t, samples=t.samples.iloc[:0]) for t in self.trips))

    def digest(self) -> str:
        """Compute the SHA-256 of every input of a model; stored folds belong to trips with the same digest.

        Returns
        -------
        str
            Hexadecimal digest.
        """
        sha = hashlib.sha256("\n".join(self.trip_ids).encode())
        simulated = (self.simulated_wh[name] for name in sorted(self.simulated_wh))
        for values in (self.offsets, self.observed_wh, *simulated):
            sha.update(np.ascontiguousarray(values).tobytes())
        sha.update(pd.util.hash_pandas_object(self.covariates, index=False).to_numpy().tobytes())
        return sha.hexdigest()


def build_table(trips: Sequence[Trip], physics: Mapping[str, Vehicle], *, step_s: float = 1.0) -> TripTable:
    """Resample and simulate the trips and join them to one table. O(samples x presets).

    Parameters
    ----------
    trips : sequence of Trip
        Raw trips with a measured energy.
    physics : mapping of str to Vehicle
        The car under each physics preset, e.g. ``{"physics-paper": ..., "physics": ...}``.
    step_s : float
        Length of the block means [s].

    Returns
    -------
    TripTable
        Table with the rows of all trips.

    Raises
    ------
    InvalidInput
        If there is no trip, two trips share an id, or a trip has no measured, positive energy.

    Examples
    --------
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(2).trips, {"physics": load_vehicle(VEHICLE)})
    >>> len(table.trips), sorted(table.simulated_wh)
    (2, ['physics'])
    """
    require_unique_ids(trips)
    require_measured(trips, positive=True)
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
    """Return the covariates that some trip has, and a note on each of the others."""
    columns = ["time_s", "speed_m_s", "ambient_temperature_degc", "elevation_m"]
    frames = []
    for block in blocks:
        frame = block.samples.reindex(columns=columns).astype(np.float64)
        climb = frame.pop("elevation_m")
        season, weather = (level or UNKNOWN_LEVEL for level in (block.context.season, block.context.weather))
        frames.append(
            frame.assign(elevation_difference_m=climb - climb.iloc[0], season=season, weather=weather)
        )
    frame = pd.concat(frames, ignore_index=True)
    frame = frame.astype({"season": "category", "weather": "category"})
    unknown = [
        name for name in COVARIATES if frame[name].isna().all() or (frame[name] == UNKNOWN_LEVEL).all()
    ]
    notes = tuple(f"covariate {name} dropped: no trip has it" for name in unknown)
    return frame.drop(columns=unknown), notes


def _totals(block: Trip) -> pd.DataFrame:
    """Running sums for the linear baselines along one trip; the outside temperature is the trip's mean."""
    time, speed = block.array("time_s"), block.array("speed_m_s")
    step = changes(time)
    hours = (time - time[0]) / SECONDS_PER_HOUR
    ambient = COMFORT_TEMPERATURE_DEGC
    if block.has("ambient_temperature_degc"):
        ambient = float(np.nanmean(block.array("ambient_temperature_degc")))
    increments = changes(speed)
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


class EnergyModel(Protocol):
    """Protocol of models that predict the cumulative energy of trips.

    Examples
    --------
    >>> from tripwatt.hybrid import PhysicsOnly
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(2).trips, {"physics": load_vehicle(VEHICLE)})
    >>> model: EnergyModel = PhysicsOnly("physics")
    >>> bool((model.fit(table).predict(table) == table.simulated_wh["physics"]).all())
    True
    """

    simulation: str | None
    """Physics preset that the prediction starts from; None for a model without physics."""

    def fit(self, table: TripTable) -> Self:
        """Fit to the trips of the table.

        Parameters
        ----------
        table : TripTable
            Trips with measured energy.

        Returns
        -------
        EnergyModel
            The model itself.
        """

    def predict(self, table: TripTable) -> FloatArray:
        """Predict the cumulative energy.

        Parameters
        ----------
        table : TripTable
            Trips; their measured energy is not used.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy at each row [Wh].
        """


@dataclass
class PhysicsOnly:
    """The simulation as it is, without a fit.

    Parameters
    ----------
    simulation : str or None
        Physics preset, a key of `TripTable.simulated_wh`; None predicts 0.

    Examples
    --------
    >>> from tripwatt.hybrid import build_table
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(1).trips, {"physics": load_vehicle(VEHICLE)})
    >>> predicted = PhysicsOnly("physics").fit(table).predict(table)
    >>> float(predicted[-1]) == float(table.simulated("physics")[-1])
    True
    """

    simulation: str | None

    def fit(self, table: TripTable) -> Self:
        """Do nothing: there is nothing to fit.

        Parameters
        ----------
        table : TripTable
            Not used.

        Returns
        -------
        PhysicsOnly
            The model itself.
        """
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Predict the simulated cumulative energy.

        Parameters
        ----------
        table : TripTable
            Trips with their simulated energy.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy at each row [Wh].
        """
        return table.simulated(self.simulation)


@dataclass
class EnergyRegression:
    """Linear regression of a trip's energy on running totals, by least squares of the relative error.

    Rows of the least-squares problem are trips, divided by the trip's observed energy; there is no intercept. The totals are
    running sums, so the same coefficients give the energy along the trip. With `simulation`, the simulated energy is the first
    regressor, with a free coefficient.

    Parameters
    ----------
    regressors : tuple of str
        Columns of `TripTable.totals`.
    simulation : str or None
        Physics preset whose energy is an additional regressor.
    coefficients_ : ndarray, shape (regressors,)
        Energy per unit of each regressor [Wh per unit], set by `fit`; with `simulation` first that of the simulated energy [1].

    Examples
    --------
    >>> from tripwatt.hybrid import build_table
    >>> from tripwatt.study.synthetic import VEHICLE, synthetic_fleet
    >>> from tripwatt.vehicles import load_vehicle
    >>> table = build_table(synthetic_fleet(3).trips, {"physics": load_vehicle(VEHICLE)})
    >>> model = EnergyRegression((), simulation="physics").fit(table)
    >>> model.coefficients_.shape, model.predict(table).shape == table.observed_wh.shape
    ((1,), True)
    """

    regressors: tuple[str, ...]
    simulation: str | None = None
    coefficients_: FloatArray = field(default_factory=lambda: np.empty(0))

    def fit(self, table: TripTable) -> Self:
        """Fit the coefficients by least squares over trips. O(trips x regressors^2).

        Parameters
        ----------
        table : TripTable
            Trips with measured energy.

        Returns
        -------
        EnergyRegression
            The model itself.
        """
        last = table.last_rows
        observed = table.observed_wh[last]
        design = self._design(table)[last] / observed[:, None]
        self.coefficients_ = np.asarray(np.linalg.lstsq(design, np.ones(len(last)), rcond=None)[0])
        return self

    def predict(self, table: TripTable) -> FloatArray:
        """Predict the cumulative energy.

        Parameters
        ----------
        table : TripTable
            Trips; their measured energy is not used.

        Returns
        -------
        ndarray, shape (rows,)
            Cumulative energy at each row [Wh].
        """
        return np.asarray(self._design(table) @ self.coefficients_, dtype=np.float64)

    def _design(self, table: TripTable) -> FloatArray:
        totals = table.totals[list(self.regressors)].to_numpy(dtype=np.float64)
        if self.simulation is None:
            return totals
        return np.column_stack([table.simulated(self.simulation), totals])
