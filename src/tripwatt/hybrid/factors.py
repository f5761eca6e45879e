"""Named factors by which a car on the road differs from its simulation, and the evidence of trips on these factors.

The residual energy of a trip, observed minus simulated, is linear in a few named factors. There are relative changes of everything but
the climb, of the climb, road load, drivetrain, base load, heating, heating in mild air, and cooling; losses in the cold and with changes of
speed; loads below freezing and while the car warms up; and relative changes around a temperature. The energies by factor follow from the
simulation of the car; no second simulation is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput
from tripwatt.hybrid.groups import Sums
from tripwatt.hybrid.power import PowerCorrector, Uncertain, summed
from tripwatt.hybrid.rows import Records
from tripwatt.hybrid.segments import LINE_CAUSES, SegmentTable
from tripwatt.vehicles import Vehicle

EVERYTHING: Final = "everything"
"""A relative change of all energy but the potential energy of the climb, which the mass alone determines."""
CLIMB: Final = "climb"
CLIMATE: Final = ("heating", "mild_heating", "cooling")
BY_SPEED: Final = ("rolling", "air", "drivetrain", "base_load", "transients")
"""Factors whose share of the driving energy differs between roads at the same outside temperature."""


@dataclass(frozen=True, slots=True)
class Factor:
    """A way in which a car differs from its simulation.

    Attributes
    ----------
    name : str
    sd : float
        Usual standard deviation, in which weights are measured: about that between all cars.
    unit : str
        "1" for a relative change of a simulated power, "kW" for a power that the simulation lacks.
    models : float
        Standard deviation between car models, in `unit`.
    vehicles : float
        Standard deviation between vehicles of one model, by tyres, driver, age, load and the log, in `unit`.
    df : int
        Degrees of freedom of `models`: those of certified cars, or `ASSUMED_DF`, which is also that of `vehicles`.
    source : str
        Source of the standard deviations before the trips of any vehicle.
    """

    name: str
    sd: float
    unit: str
    models: float
    vehicles: float
    df: int
    source: str


ASSUMED_DF: Final = 4
"""Degrees of freedom of an assumed spread."""

SEASONS: Final = {"near_minus_8": -8.0, "near_2": 2.0, "near_12": 12.0, "near_22": 22.0, "near_32": 32.0}
"""Factors of the consumption around an outside temperature [°C]: trips at 20 °C do not show the consumption at -10 °C."""

CERTIFIED_EVERYTHING: Final = 0.031
CERTIFIED_TILT: Final = 0.325
"""Spreads between car models from certified consumption, by `python -m tools.data.certified_spread`. The first is the part of the spread
of 6.1 % over 10 models that the causes of driving do not explain. The second, over 99 models, is the ratio of the spreads of these causes
to those published for each cause alone."""

VEHICLES_EVERYTHING: Final = 0.048
"""Part of the 8 % between four cars of one model that tyres, drag area, base load and season do not explain, by the same command."""

_CERTIFIED: Final = "between models: certified consumption on city and highway schedules"
_SEASON: Final = "with everything, the 8 % between four cars of one model"


def _driving(name: str, sd: float, published: float, vehicles: float, source: str) -> Factor:
    models = CERTIFIED_TILT * published
    return Factor(name, sd, "1", models, vehicles, 98, f"{_CERTIFIED}; between vehicles: {source}")


FACTORS: Final = (
    Factor(EVERYTHING, 0.10, "1", CERTIFIED_EVERYTHING, VEHICLES_EVERYTHING, 9, "between models: WLTP figures that no value rests on; between vehicles: 8 % of four cars of one model; what the other factors leave of both"),
    _driving("rolling", 0.12, 0.12, 0.08, "half a class of the EU tyre label (Regulation (EU) 2020/740, annex I)"),
    _driving("air", 0.10, 0.10, 0.05, "wheels and trims of one car in the EPA test car list; roof loads"),
    _driving("drivetrain", 0.20, 0.20, 0.05, "an assumption"),
    _driving("base_load", 0.40, 0.40, 0.30, "lights, fans and seats that drivers switch on: an assumption"),
    Factor("heating", 0.35, "1", 0.20, 0.15, ASSUMED_DF, "heat demand with and without recirculated air: an assumption"),
    Factor("mild_heating", 0.35, "1", 0.10, 0.15, ASSUMED_DF, "sun, passengers and the chosen temperature count for more in mild air: an assumption"),
    Factor("cooling", 0.35, "1", 0.20, 0.15, ASSUMED_DF, "compressors of one car alone are measured: an assumption"),
    Factor("cold", 0.04, "1", 0.02, 0.03, ASSUMED_DF, "share of the energy moved at the wheels for each 10 K below 15 °C: tyres and oil"),
    _driving("transients", 0.10, 0.10, 0.01, "share of mass times speed times the mean change of speed; the driver is in the trace"),
    Factor("frost", 0.30, "kW", 0.16, 0.25, ASSUMED_DF, "for each 10 K below freezing: windows, battery, snow"),
    Factor("warm_up", 0.30, "kW", 0.16, 0.25, ASSUMED_DF, "at departure at 0 °C, fading within 10 minutes: soaked cabin and oil"),
    Factor(CLIMB, 0.05, "1", 0.02, 0.04, ASSUMED_DF, "mass on the road: trims, passengers and luggage that nobody states: an assumption"),
    *(Factor(name, 0.06, "1", 0.03, 0.05, ASSUMED_DF, _SEASON) for name in SEASONS),
)  # fmt: skip
"""The factors, with their spreads between car models and between vehicles of one model."""

ACTS_DEGC: Final = {"heating": (-60.0, 19.0), "mild_heating": (-5.0, 19.0), "cooling": (19.0, 60.0), "cold": (-60.0, 15.0), "frost": (-60.0, 0.0), "warm_up": (-60.0, 15.0)}  # fmt: skip
"""Outside temperatures [°C] between which a factor acts. A factor of `SEASONS` acts within `_NEAR_K` of its temperature; the others
always act. `mild_heating` acts in full from 5 °C on: who heats little in spring may heat as others do in winter; choices."""

NAMES: Final = tuple(factor.name for factor in FACTORS)
UNITS: Final = {factor.name: factor.unit for factor in FACTORS}
SDS: Final = np.array([factor.sd for factor in FACTORS])

MILD_DEGC: Final = 19.0
"""Outside temperature at which climate control changes from heating to cooling [°C]; at this temperature it does half of each."""

_NEAR_K: Final = 8.0
"""Width [K] around its temperature within which a factor of `SEASONS` acts; a choice, a little less than the distance to the next."""

USUAL_WH: Final = 40.0
USUAL_SHARE: Final = 0.042
USUAL_SHARE_KM: Final = 0.33
MIN_NET: Final = 0.3
"""Usual error of a trip's energy with the right factors, by climate, wind, traffic and influences that the log lacks.

It has an error of every trip [Wh] and two shares of the net energy: one that is the same at any length, and one over a kilometre, which
evens out along the trip. The net energy is that of the trip without the potential energy of its climb, because wind and traffic do not
change the climb; it counts as at least `MIN_NET` of the energy moved. The second share is near the least of the vehicles that
`python -m tools.data.population` prints; no log is long enough to show the first, which is an assumption. The scale of a car's errors
relative to these is estimated from its trips."""

TAIL_DF: Final = 4.0
"""Degrees of freedom of the errors' t distribution, as Lange, Little and Taylor (1989) advise for few data."""


def acts_between(name: str) -> tuple[float, float]:
    """Lowest and highest outside temperature [°C] between which a factor acts.

    Examples
    --------
    >>> acts_between("frost"), acts_between("near_2"), acts_between("rolling")
    ((-60.0, 0.0), (-6.0, 10.0), (-60.0, 60.0))
    """
    if name in SEASONS:
        return SEASONS[name] - _NEAR_K, SEASONS[name] + _NEAR_K
    return ACTS_DEGC.get(name, (-60.0, 60.0))


def factor_power(table: SegmentTable, mass_kg: float) -> FloatArray:
    """Power in each segment of one usual standard deviation of each factor [W], shape (segments, factors). O(segments).

    Parameters
    ----------
    table : SegmentTable
    mass_kg : float
        Mass of the car on the road [kg].
    """
    column = table.columns
    known = column["ambient_temperature_degc"]
    # unknown air is neither cold nor warm
    ambient = np.where(np.isfinite(known), known, 15.0)
    # the turn from heating to cooling takes some 3 K; a choice
    cooling = 1.0 / (1.0 + np.exp(-np.clip((ambient - MILD_DEGC) / 1.5, -30.0, 30.0)))
    heating_w = column["climate_w"] * (1.0 - cooling)
    level_w = table.simulated_w - column["climb_w"]
    # soaked cabin and oil are warm within some ten minutes
    powers = (
        level_w,
        column["rolling_w"],
        column["air_w"],
        column["drivetrain_w"],
        column["base_load_w"],
        heating_w,
        heating_w * np.clip((ambient - ACTS_DEGC["mild_heating"][0]) / 10.0, 0.0, 1.0),
        column["climate_w"] * cooling,
        column["moved_w"] * np.maximum(0.0, 15.0 - ambient) / 10.0,
        mass_kg * column["speed_change_m_s2"] * column["speed_m_s"],
        100.0 * np.maximum(0.0, -ambient),
        50.0 * np.maximum(0.0, 20.0 - ambient) * np.exp(-column["time_s"] / 600.0),
        column["climb_w"],
    )
    # air beyond the bounds counts as air at the bounds; a choice
    inside = np.clip(ambient, -20.0, 45.0)
    near = np.exp(-0.5 * ((inside[:, None] - np.array(list(SEASONS.values()))) / _NEAR_K) ** 2)
    seasons = level_w[:, None] * near / np.sqrt((near**2).sum(axis=1, keepdims=True))
    return np.asarray(np.column_stack([*powers, seasons]) * SDS)


def _shortfall_power(table: SegmentTable) -> FloatArray:
    """Power in each segment that the simulated car lacks to follow the speed [W], shape (segments,).

    It comes from logs that hold a speed between two samples, so that the speed changes in steps. The error due to the steps is as large
    as this power.
    """
    causes = table.features[[f"{cause}_w" for cause in LINE_CAUSES]].to_numpy(dtype=np.float64)
    return np.asarray(table.simulated_w - causes.sum(axis=1))


@dataclass(frozen=True, eq=False)
class TripEvidence(Records):
    """Evidence of one car's trips on its factors, in the order in which the trips are used.

    Attributes
    ----------
    trip_ids : tuple of str
    factors_wh : ndarray, shape (trips, factors)
        Energy of one usual standard deviation of each factor [Wh].
    residual_wh : ndarray, shape (trips,)
        Observed minus simulated energy [Wh]; NaN if nothing was measured.
    usual_wh2 : ndarray, shape (trips,)
        Usual variance of the energy of each trip [Wh²].
    measured_wh2 : ndarray, shape (trips,)
        Variance of the measurement [Wh²], including an unknown climb and the error of held speeds.
    day : ndarray, shape (trips,)
        Departure in days since 1970; NaN if unknown.
    charge : ndarray, shape (trips, 4)
        Readings of the state of charge, see `SegmentTable`; NaN if unknown.
    """

    trip_ids: tuple[str, ...]
    factors_wh: FloatArray
    residual_wh: FloatArray
    usual_wh2: FloatArray
    measured_wh2: FloatArray
    day: FloatArray
    charge: FloatArray

    @property
    def simulated_wh(self) -> FloatArray:
        """Simulated energy [Wh], shape (trips,): the climb, and everything else."""
        parts = [NAMES.index(EVERYTHING), NAMES.index(CLIMB)]
        return np.asarray((self.factors_wh[:, parts] / SDS[parts]).sum(axis=1))

    @property
    def observed_wh(self) -> FloatArray:
        """Measured energy [Wh], shape (trips,)."""
        return self.residual_wh + self.simulated_wh

    def __len__(self) -> int:
        return len(self.trip_ids)

    @classmethod
    def from_table(cls, table: SegmentTable, vehicle: Vehicle) -> TripEvidence:
        """Collect the evidence of simulated trips. O(segments).

        Parameters
        ----------
        table : SegmentTable
        vehicle : Vehicle
            The car that was simulated.
        """
        rows = factor_power(table, vehicle.body.test_mass_kg) * table.hours[:, None]
        factors_wh = np.add.reduceat(rows, table.offsets[:-1], axis=0)
        column = table.columns
        moved, km = map(table.totals_wh, (column["moved_w"], 3.6 * column["speed_m_s"]))
        return cls(
            table.trip_ids,
            factors_wh,
            np.full(len(table), np.nan) if table.observed_w is None else table.totals_wh(table.residual_w),
            usual_variance_wh2(factors_wh[:, 0] / SDS[0], moved, km),
            table.energy_errors.own_wh**2 + table.totals_wh(_shortfall_power(table)) ** 2,
            column["day"][table.offsets[:-1]],
            np.full((len(table), 4), np.nan) if table.charge is None else table.charge,
        )

    @classmethod
    def empty(cls) -> TripEvidence:
        """Make evidence without trips."""
        nothing = np.empty(0)
        return cls((), np.empty((0, len(NAMES))), nothing, nothing, nothing, nothing, np.empty((0, 4)))

    def sums(self, car_model: str, vehicle: str) -> Sums:
        """Sums of the trips as one vehicle of a population; each trip is weighted by the errors of this car's trips.

        Outlying trips count less: the errors follow a t distribution whose scale is estimated as well (Lange, Little and Taylor 1989).
        """
        X, y = self.factors_wh, self.residual_wh
        noise, weight = 1.0, np.ones(len(y))
        # the weights settle in fewer passes
        for _ in range(20):
            usual = noise * self.usual_wh2 + self.measured_wh2
            gram = (X.T / (usual * weight)) @ X + np.eye(X.shape[1])
            inverse = np.linalg.inv(gram)
            error = y - X @ (inverse @ ((X.T / (usual * weight)) @ y))
            square = error**2 + np.einsum("ij,jk,ik->i", X, inverse, X)
            weight = (TAIL_DF + error**2 / usual) / (TAIL_DF + 1.0)
            # expected square of the part of the error that is not due to its measurement
            share = noise * self.usual_wh2 / usual
            own = (share**2 * square / weight + share * self.measured_wh2) / self.usual_wh2
            # no car's errors are below a seventh of the usual ones; a choice
            noise = max((_USUAL_DF + float(own.sum())) / (_USUAL_DF + len(y)), 0.02)
        return Sums.from_trips([(car_model, vehicle)] * len(y), X, y, usual * weight)


_USUAL_DF: Final = 2.0
"""Weight of the usual error, in trips; a choice."""


def usual_variance_wh2(net_wh: FloatArray, moved_wh: FloatArray, km: FloatArray) -> FloatArray:
    """Usual variance of a trip's energy with the right factors [Wh²], from its net energy, its moved energy and its length.

    Examples
    --------
    >>> one, far = usual_variance_wh2(np.array([1500.0, 30000.0]), np.array([2000.0, 32000.0]), np.array([10.0, 200.0]))
    >>> round(one**0.5), round(far**0.5)
    (173, 1442)
    """
    size = np.maximum(np.abs(net_wh), MIN_NET * moved_wh)
    share = USUAL_SHARE**2 + USUAL_SHARE_KM**2 / np.maximum(km, MIN_KM)
    return np.asarray(USUAL_WH**2 + size**2 * share)


MIN_KM: Final = 0.1
"""Shorter trips count as this long."""


USUAL_DAYS: Final = 1.0
"""Days assumed between two trips if a date is unknown."""


def drift_kept(day: FloatArray, since: float | None) -> FloatArray:
    """Share of a drift that remains on other days, shape of `day`; an unknown date counts as `USUAL_DAYS` away."""
    away = np.abs(day - (np.nan if since is None else since))
    # a slow drift is forgotten in 60 days: about a season; a choice
    return np.asarray(np.exp(-np.where(np.isfinite(away), away, USUAL_DAYS) / 60.0))


@dataclass(frozen=True, eq=False)
class FactorCorrector(PowerCorrector):
    """Correction of a car by its factors and its drift.

    Attributes
    ----------
    mass_kg : float
        Mass of the car on the road [kg].
    mean : ndarray, shape (factors + 1,)
        Mean of the factors and, last, of the drift, which acts on everything; in usual standard deviations.
    factor : ndarray, shape (factors + 1, any)
        ``factor @ factor.T`` is the covariance of factors and drift.
    day : float or None
        Day of the drift, in days since 1970; None if unknown.
    drift_sd : float
        Standard deviation of the drift on days far from `day`.
    """

    refit: ClassVar[str] = "adapt the base again"

    mass_kg: float
    mean: FloatArray
    factor: FloatArray
    day: float | None
    drift_sd: float

    def __post_init__(self) -> None:
        if self.mean.shape != (len(NAMES) + 1,):
            got, allowed = f"{len(self.mean) - 1} factors", f"{len(NAMES)} factors"
            raise InvalidInput.of(
                "model of an older version", "model.json, corrector", got, allowed, self.refit
            )

    @property
    def changes(self) -> dict[str, tuple[float, float]]:
        """Mean and standard deviation of each factor, in the unit of the factor; without the drift."""
        sd = np.sqrt((self.factor[:-1] ** 2).sum(axis=1)) * SDS
        return {n: (float(m), float(s)) for n, m, s in zip(NAMES, self.mean[:-1] * SDS, sd, strict=True)}

    def predict_with_uncertainty(self, table: SegmentTable, hours: FloatArray | None = None) -> Uncertain:
        """Residual power [W], and the factor of its covariance due to factors, drift and shortfall of power."""
        rows = factor_power(table, self.mass_kg)
        kept = drift_kept(table.columns["day"], self.day)
        rows = np.column_stack([rows, rows[:, 0] * kept])
        forgotten = rows[:, 0] * self.drift_sd * np.sqrt(1.0 - kept**2)
        factor = np.column_stack([rows @ self.factor, forgotten, _shortfall_power(table)])
        return rows @ self.mean, summed(factor, hours)

    def predict_climate(self, table: SegmentTable) -> FloatArray:
        """The part of the correction by heating and cooling [W]."""
        return self._part(factor_power(table, self.mass_kg), CLIMATE)

    def predict_driving(self, table: SegmentTable) -> FloatArray:
        """The part of the correction by the factors `BY_SPEED` [W]."""
        return self._part(factor_power(table, self.mass_kg), BY_SPEED)

    def driving_wh(self, evidence: TripEvidence) -> FloatArray:
        """The part of the correction by the factors `BY_SPEED` in the energy of trips [Wh], shape (trips,)."""
        return self._part(evidence.factors_wh, BY_SPEED)

    def _part(self, rows: FloatArray, names: Sequence[str]) -> FloatArray:
        its = [NAMES.index(name) for name in names]
        return np.asarray(rows[:, its] @ self.mean[its])
