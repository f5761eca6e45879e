"""Correct power: the residual power of short blocks, learned from what is known before departure.

`planned` reduces a logged trip to what a driver knows at the door: the speed trace and road of the trip to come, and
every other signal as its first raw sample says. Everything after that (simulation, features, forecast) sees nothing
else, so nothing measured on the way can leak into a departure forecast.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, Protocol, Self

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.hybrid.climate_log import logged_climate
from tripwatt.hybrid.cumulative import IntArray
from tripwatt.kriging import ClusteredKriging, Part
from tripwatt.physics import Simulation, simulate_trip
from tripwatt.trips import FloatArray, Trip, block_means, resample
from tripwatt.units import SECONDS_PER_HOUR
from tripwatt.vehicles import Vehicle

BLOCK_S: Final = 30.0
"""Length of the blocks: a few changes of speed, so that the residual is about the car and not about its timing."""

ROUTE_COLUMNS: Final = ("time_s", "speed_m_s", "elevation_m", "grade")
DEPARTURE_COLUMNS: Final = (
    "ambient_temperature_degc",
    "cabin_temperature_degc",
    "cabin_setpoint_degc",
    "battery_temperature_degc",
    "soc",
    "displayed_soc",
)
LINE_CAUSES: Final = (
    "air",
    "rolling",
    "climb",
    "acceleration",
    "friction_brakes",
    "drivetrain",
    "base_load",
    "hvac",
)
"""Causes whose simulated power the correctors may scale; `shortfall` is no property of the car."""


def planned(trip: Trip, *, step_s: float = 1.0) -> Trip:
    """What is known of a trip at departure: its speed trace and road, and the first raw sample of the rest.

    Parameters
    ----------
    trip : Trip
        Raw samples. Measured columns other than those of `DEPARTURE_COLUMNS` are dropped.
    step_s : float
        Block means of the speed trace [s].

    Returns
    -------
    Trip
        Columns of `ROUTE_COLUMNS` as block means, of `DEPARTURE_COLUMNS` as constants; no measured energy.
    """
    route = {c: trip.array(c) for c in ROUTE_COLUMNS if c in trip}
    n_blocks, columns = block_means(route["time_s"] - route["time_s"][0], route, step_s)
    for name in DEPARTURE_COLUMNS:
        if name in trip:
            columns[name] = np.full(n_blocks, trip.array(name)[0])
    return Trip(trip.trip_id, _frame(columns), trip.context, step_s=step_s)


def _frame(columns: Mapping[str, FloatArray]) -> pd.DataFrame:
    """A table of numbers, each column contiguous; much faster than column by column."""
    return pd.DataFrame(np.array(list(columns.values())).T, columns=_names(tuple(columns)))


@lru_cache(maxsize=64)
def _names(columns: tuple[str, ...]) -> pd.Index:
    return pd.Index(columns, dtype=object)  # looked up many times, which a string index is slow at


@dataclass(frozen=True, eq=False)
class BlockTable:
    """Blocks of trips as one flat table: rows of trip i are ``offsets[i]:offsets[i + 1]``.

    Attributes
    ----------
    trip_ids : tuple of str
    offsets : ndarray of int, shape (trips + 1,)
    features : DataFrame, (rows, features)
        Known before departure; NaN where unknown.
    hours : ndarray, shape (rows,)
        Length of each block [h].
    simulated_w : ndarray, shape (rows,)
    observed_w : ndarray or None, shape (rows,)
        Measured power at the battery terminals.
    observed_hvac_w : ndarray or None, shape (rows,)
        Measured power of climate control; NaN where it was not logged.
    """

    trip_ids: tuple[str, ...]
    offsets: IntArray
    features: pd.DataFrame
    hours: FloatArray
    simulated_w: FloatArray
    observed_w: FloatArray | None = None
    observed_hvac_w: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.trip_ids)

    @property
    def groups(self) -> IntArray:
        """Index of the trip that each row belongs to, shape (rows,)."""
        return np.repeat(np.arange(len(self), dtype=np.int64), np.diff(self.offsets))

    @property
    def observed_power_w(self) -> FloatArray:
        """Measured power [W], shape (rows,); refuses a table without it."""
        if self.observed_w is None:
            raise InvalidInput(
                Fault("no measured energy", "trips", "none", "voltage and current of each trip")
            )
        return self.observed_w

    @property
    def residual_w(self) -> FloatArray:
        """Observed minus simulated power [W], shape (rows,)."""
        return self.observed_power_w - self.simulated_w

    @property
    def climate_residual_w(self) -> FloatArray:
        """Observed minus simulated power of climate control [W], shape (rows,); NaN where it was not logged."""
        if self.observed_hvac_w is None:
            return np.full(len(self.hours), np.nan)
        return np.asarray(self.observed_hvac_w - self.features["hvac_w"].to_numpy())

    def take(self, members: Sequence[int] | IntArray) -> BlockTable:
        """The table of some of the trips. O(their rows)."""
        index = np.asarray(members, dtype=np.int64)
        rows = np.concatenate([np.arange(self.offsets[i], self.offsets[i + 1]) for i in index])
        return BlockTable(
            trip_ids=tuple(self.trip_ids[i] for i in index),
            offsets=np.concatenate(([0], np.cumsum(np.diff(self.offsets)[index]))),
            features=self.features.iloc[rows].reset_index(drop=True),
            hours=self.hours[rows],
            simulated_w=self.simulated_w[rows],
            observed_w=None if self.observed_w is None else self.observed_w[rows],
            observed_hvac_w=None if self.observed_hvac_w is None else self.observed_hvac_w[rows],
        )

    def totals_wh(self, power_w: FloatArray) -> FloatArray:
        """Energy of each trip [Wh] of a power at each row, shape (trips,)."""
        return np.add.reduceat(power_w * self.hours, self.offsets[:-1])

    @classmethod
    def join(cls, tables: Sequence[BlockTable]) -> BlockTable:
        """One table of several."""
        observed = [t.observed_w for t in tables]
        climate = [
            np.full(len(t.hours), np.nan) if t.observed_hvac_w is None else t.observed_hvac_w for t in tables
        ]
        return cls(
            trip_ids=tuple(i for t in tables for i in t.trip_ids),
            offsets=np.concatenate(([0], np.cumsum([len(t.hours) for t in tables]))).astype(np.int64),
            features=pd.concat([t.features for t in tables], ignore_index=True),
            hours=np.concatenate([t.hours for t in tables]),
            simulated_w=np.concatenate([t.simulated_w for t in tables]),
            observed_w=None
            if any(o is None for o in observed)
            else np.concatenate([o for o in observed if o is not None]),
            observed_hvac_w=None
            if all(t.observed_hvac_w is None for t in tables)
            else np.concatenate(climate),
        )


def block_table(
    plan: Trip, simulation: Simulation, measured: Trip | None = None, *, block_s: float = BLOCK_S
) -> BlockTable:
    """Blocks of one trip, from its plan and simulation; with the measured power where there is a measured trip.

    Parameters
    ----------
    plan : Trip
        From `planned`.
    simulation : Simulation
        Of the plan.
    measured : Trip, optional
        The raw trip; its cumulative energy is read at the ends of the blocks.
    """
    time = plan.array("time_s")
    step = np.diff(time, prepend=time[0] - np.median(np.diff(time)))
    block = np.minimum(
        np.floor((time - time[0]) / block_s).astype(np.int64),
        max(int((time[-1] - time[0]) // block_s - 0.5), 0),
    )
    n = int(block[-1]) + 1
    seconds = np.asarray(np.bincount(block, step, n), dtype=np.float64)

    def mean(values: FloatArray) -> FloatArray:
        return np.bincount(block, values * step, n) / seconds

    speed = plan.array("speed_m_s")
    features: dict[str, Any] = {
        "simulated_w": mean(simulation.battery_power_w),
        **{f"{cause}_w": mean(simulation.power_by_cause_w[cause]) for cause in LINE_CAUSES},
        "moved_w": mean(np.abs(simulation.wheel_power_w)),
        "speed_m_s": mean(speed),
        "speed_change_m_s2": mean(np.abs(np.diff(speed, prepend=speed[0])) / np.maximum(step, 1e-9)),
        "time_s": mean(time - time[0]),
        "trip_speed_m_s": float((speed * step).sum() / step.sum()),
        "payload_mass_kg": plan.context.payload_mass_kg,
    }
    for name in DEPARTURE_COLUMNS[:5]:
        features[name] = float(plan.array(name)[0]) if name in plan else np.nan
    if not np.isfinite(features["cabin_setpoint_degc"]):
        setpoint = plan.context.cabin_setpoint_degc
        features["cabin_setpoint_degc"] = np.nan if setpoint is None else setpoint
    features["winter"] = {"winter": 1.0, "summer": 0.0}.get(plan.context.season or "", np.nan)
    return BlockTable(
        trip_ids=(plan.trip_id,),
        offsets=np.array([0, n]),
        features=_frame({name: np.broadcast_to(values, n) for name, values in features.items()}),
        hours=seconds / SECONDS_PER_HOUR,
        simulated_w=np.asarray(features["simulated_w"]),
        observed_w=None if measured is None else _measured_power(measured, block, plan, seconds),
        observed_hvac_w=None if measured is None else _measured_climate(measured, seconds),
    )


def _measured_power(measured: Trip, block: IntArray, plan: Trip, seconds: FloatArray) -> FloatArray | None:
    """Mean measured power of each block [W]; the blocks' energies add up to the trip's energy."""
    step_s = plan.step_s or float(np.median(np.diff(plan.array("time_s"))))
    raw = measured if measured.step_s is not None else resample(measured, step_s)
    if "observed_energy_wh" not in raw:
        return None
    cumulative = raw.array("observed_energy_wh")
    ends = np.append(np.flatnonzero(np.diff(block)), len(block) - 1)
    return np.asarray(np.diff(cumulative[ends], prepend=0.0) / (seconds / SECONDS_PER_HOUR))


def _measured_climate(measured: Trip, seconds: FloatArray) -> FloatArray | None:
    """Mean measured power of climate control in each block [W]; None when it was not logged."""
    start = float(measured.array("time_s")[0])
    return logged_climate(measured.samples, start + np.concatenate(([0.0], np.cumsum(seconds))))


def trip_blocks(trip: Trip, vehicle: Vehicle, *, with_energy: bool = True) -> BlockTable:
    """Blocks of a logged trip: plan, simulate, cut."""
    plan = planned(trip)
    return block_table(plan, simulate_trip(vehicle, plan), trip if with_energy else None)


class PowerCorrector(Protocol):
    """Learns the residual power of blocks."""

    def fit(self, table: BlockTable) -> Self:
        """Learn from the trips of a table."""
        ...

    def again(self) -> PowerCorrector:
        """A fresh corrector with the settings that `fit` chose, to fit on a part of the same trips."""
        ...

    def predict(self, table: BlockTable) -> FloatArray:
        """Residual power of each row [W]."""
        ...

    def uncertainty_factor(self, table: BlockTable) -> FloatArray:
        """`L` with `L @ L.T` the covariance of what the corrector does not know, shape (rows, any)."""
        ...

    def predict_with_doubt(self, table: BlockTable) -> tuple[FloatArray, FloatArray]:
        """`predict` and `uncertainty_factor` at once."""
        ...

    def predict_climate(self, table: BlockTable) -> FloatArray | None:
        """The part of `predict` that is climate control [W]; None for a corrector that does not tell it apart."""
        ...


_AMBIENT, _CABIN, _SETPOINT, _BATTERY = DEPARTURE_COLUMNS[:4]
_SMOOTH_W: Final = 100.0
_SMOOTH: Final = tuple(
    Part(columns, "smooth", _SMOOTH_W, length)
    for columns, length in (
        ((_AMBIENT,), 1.0),
        ((_CABIN,), 1.0),
        ((_SETPOINT,), 1.0),
        ((_BATTERY,), 1.0),
        (("time_s",), 1.0),
        (("speed_m_s",), 1.0),
        (("speed_change_m_s2",), 1.0),
        ((_AMBIENT, _CABIN, "time_s"), 1.0),
        ((_AMBIENT, _SETPOINT), 1.0),
        ((_AMBIENT, _BATTERY), 1.0),
        ((_AMBIENT, _CABIN, _SETPOINT, _BATTERY, "trip_speed_m_s"), 1.5),
    )
)
LINES: Final = tuple(Part((f"{cause}_w",), "line", 0.1) for cause in LINE_CAUSES)
"""Each cause of the simulation may be off by about 10 %: a calibration of the physics that is shrunk to none."""


class _Whole:
    """A corrector that does not tell climate control from driving."""

    def predict_climate(self, table: BlockTable) -> FloatArray | None:
        """Not told apart."""
        return None


class _OneByOne(_Whole):
    """Both answers, when one does not help with the other."""

    def predict_with_doubt(self: PowerCorrector, table: BlockTable) -> tuple[FloatArray, FloatArray]:
        """`predict` and `uncertainty_factor`."""
        return self.predict(table), self.uncertainty_factor(table)


class KrigingCorrector(_Whole):
    """Additive Gaussian process: calibrated causes plus smooth functions of the departure state.

    The trips' totals decide how much, because rows of a trip are far from independent. The rows decide when: what is
    left within a trip, less the trip's mean, is regressed on the same features, also less their trip's mean, so that
    it moves energy along the trip and never changes the total.
    """

    def __init__(
        self, parts: tuple[Part, ...] = (*LINES, *_SMOOTH), share_column: str = "simulated_w"
    ) -> None:
        self._take(parts, share_column)

    def _take(self, parts: tuple[Part, ...], share_column: str) -> None:
        self.parts = parts
        self.share_column = share_column
        self.model = ClusteredKriging(parts, effect_sd=220.0, share_column=share_column, share_sd=0.05)
        self.shape = np.empty(0)

    def fit(self, table: BlockTable) -> Self:
        """Learn from trip totals, then from the rows within trips. O(rows x features^2).

        Parts with a column that no row knows are left out.
        """
        known = {name for name, column in table.features.items() if bool(column.notna().any())}
        self._take(tuple(part for part in self.parts if known.issuperset(part.columns)), self.share_column)
        self.model.fit(table.features, table.residual_w, table.groups, table.hours)
        features, prior = self.model.features(table.features)
        left = table.residual_w - self.model.predict(table.features)
        within = less_trip_mean(np.column_stack([features, left]), table)
        X, r = within[:, :-1], within[:, -1]
        gram = X.T @ X + np.diag(np.mean(r**2) / (_SHAPE_SHARE * prior))
        self.shape = np.linalg.solve(gram, X.T @ r)
        return self

    def again(self) -> KrigingCorrector:
        """The same parts."""
        return KrigingCorrector(self.parts, self.share_column)

    def predict(self, table: BlockTable) -> FloatArray:
        """Residual power [W]."""
        return self._mean(self.model.features(table.features)[0], table)

    def uncertainty_factor(self, table: BlockTable) -> FloatArray:
        """From the posterior of the process."""
        return self.model.uncertainty_factor(table.features)

    def predict_with_doubt(self, table: BlockTable) -> tuple[FloatArray, FloatArray]:
        """Both from the same features."""
        features, _ = self.model.features(table.features)
        return self._mean(features, table), self.model.doubt(features)

    def _mean(self, features: FloatArray, table: BlockTable) -> FloatArray:
        return self.model.mean(features) + less_trip_mean(features @ self.shape[:, None], table)[:, 0]


_SHAPE_SHARE: Final = 4.0
"""Prior variance of the shape's weights, over that of the totals' weights: twice as far from the simulation."""


def less_trip_mean(values: FloatArray, table: BlockTable) -> FloatArray:
    """Columns less their mean over the time of each trip, shape (rows, columns)."""
    sums = np.add.reduceat(values * table.hours[:, None], table.offsets[:-1], axis=0)
    means = sums / np.add.reduceat(table.hours, table.offsets[:-1])[:, None]
    return np.asarray(values - means[table.groups])


class LearnerCorrector(_OneByOne):
    """A scikit-learn style learner on block rows, each trip weighing the same."""

    def __init__(
        self,
        make: Callable[[Mapping[str, Any]], Any],
        tuned: Callable[[Any], dict[str, Any]],
        settings: Mapping[str, Any] | None = None,
        features: tuple[str, ...] | None = None,
    ) -> None:
        self.make = make
        self.tuned = tuned
        self.features = TREE_FEATURES if features is None else features
        self.model = make(settings or {})

    def fit(self, table: BlockTable) -> Self:
        """Learn from block rows, the trip as the cluster."""
        self.model.fit(self.columns(table), table.residual_w, groups=table.groups)
        return self

    def again(self) -> LearnerCorrector:
        """The same learner with its choice made."""
        return LearnerCorrector(self.make, self.tuned, self.tuned(self.model), self.features)

    def predict(self, table: BlockTable) -> FloatArray:
        """Residual power [W]."""
        return np.asarray(self.model.predict(self.columns(table)), dtype=np.float64)

    def uncertainty_factor(self, table: BlockTable) -> FloatArray:
        """A tree does not say what it does not know."""
        return np.zeros((len(table.hours), 1))

    def columns(self, table: BlockTable) -> pd.DataFrame:
        """What the learner sees of a table."""
        return table.features[list(self.features)]


TREE_FEATURES: Final = (
    "simulated_w",
    *(f"{cause}_w" for cause in LINE_CAUSES if cause != "base_load"),
    "speed_m_s",
    "speed_change_m_s2",
    "time_s",
    _AMBIENT,
    _CABIN,
    _SETPOINT,
    _BATTERY,
    "payload_mass_kg",
)


class EnsembleCorrector(_Whole):
    """Mean of several correctors; what is not known is the first one's."""

    def __init__(self, members: Sequence[PowerCorrector]) -> None:
        self.members = tuple(members)

    def fit(self, table: BlockTable) -> Self:
        """Fit each member."""
        for member in self.members:
            member.fit(table)
        return self

    def again(self) -> EnsembleCorrector:
        """The members with their choices made."""
        return EnsembleCorrector([m.again() for m in self.members])

    def predict(self, table: BlockTable) -> FloatArray:
        """Mean residual power [W]."""
        return np.asarray(np.mean([m.predict(table) for m in self.members], axis=0))

    def uncertainty_factor(self, table: BlockTable) -> FloatArray:
        """Of the first member."""
        return self.members[0].uncertainty_factor(table)

    def predict_with_doubt(self, table: BlockTable) -> tuple[FloatArray, FloatArray]:
        """The first member does both at once."""
        mean, doubt = self.members[0].predict_with_doubt(table)
        return np.asarray(np.mean([mean, *(m.predict(table) for m in self.members[1:])], axis=0)), doubt


def boosting_corrector(seed: int, features: tuple[str, ...] | None = None) -> LearnerCorrector:
    """Clustered boosting on block rows, fresh."""
    from tripwatt.boosting import ClusteredBoosting

    def make(settings: Mapping[str, Any]) -> Any:
        base = {
            "max_leaf_nodes": 4,
            "learning_rate": 0.05,
            "max_features": 0.6,
            "subsample": 0.7,
            "max_rows_per_group": None,
        }
        return ClusteredBoosting(random_state=seed, **{**base, **settings})

    def tuned(model: Any) -> dict[str, Any]:
        return {"n_rounds": max(int(model.n_rounds_), 1), "n_folds": None}

    return LearnerCorrector(make, tuned, features=features)


def forest_corrector(seed: int) -> LearnerCorrector:
    """Clustered forest on block rows, fresh."""
    from tripwatt.forest import ClusteredForest

    def make(settings: Mapping[str, Any]) -> Any:
        return ClusteredForest(n_trees=200, random_state=seed, max_rows_per_group=None, **settings)

    return LearnerCorrector(make, lambda model: {"param_grid": None, **model.best_params_})


class GammCorrector(_OneByOne):
    """The GAMM engine on block power: smooths of the departure state and the drive, a random effect per trip."""

    FORMULA: Final = (
        "y ~ s(ambient_temperature_degc, k=6) + s(cabin_temperature_degc, k=6) + s(battery_temperature_degc, k=6) + "
        's(time_s, k=6) + s(speed_m_s, k=6) + s(simulated_w, k=6) + s(hvac_w, k=6) + s(trip, bs="re")'
    )

    def fit(self, table: BlockTable) -> Self:
        """Gaussian errors, REML."""
        from tripwatt.gam import GAMM

        self.medians_ = table.features.median()
        self.model = GAMM(self.FORMULA).fit(self._frame(table, trips=True), table.residual_w)
        return self

    def again(self) -> GammCorrector:
        """The same formula."""
        return GammCorrector()

    def predict(self, table: BlockTable) -> FloatArray:
        """Residual power [W]; the random effect of a new trip is 0."""
        return np.asarray(self.model.predict(self._frame(table)), dtype=np.float64)

    def uncertainty_factor(self, table: BlockTable) -> FloatArray:
        """Not given."""
        return np.zeros((len(table.hours), 1))

    def _frame(self, table: BlockTable, *, trips: bool = False) -> pd.DataFrame:
        frame = table.features.fillna(self.medians_.fillna(0.0).to_dict())
        return frame.assign(trip=table.groups.astype(str)) if trips else frame
