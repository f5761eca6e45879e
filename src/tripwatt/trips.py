"""A trip: its samples under canonical names, its context, and the energy that the battery gave.

Everything that reads a log ends here and everything that models a trip starts here. The columns of `COLUMNS`
are the only names that the rest of the package knows; `sources/` does all renaming and unit conversion.
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.units import WH_PER_J

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Column:
    """A canonical sample column: what it means and the range outside which a value cannot be one."""

    unit: str
    minimum: float
    maximum: float
    meaning: str


COLUMNS: Final[Mapping[str, Column]] = MappingProxyType(
    {
        "time_s": Column("s", -math.inf, math.inf, "time of the sample, increasing"),
        "speed_m_s": Column("m/s", 0.0, 90.0, "vehicle speed"),
        "elevation_m": Column("m", -500.0, 9000.0, "height above sea level, as logged"),
        "grade": Column("1", -0.6, 0.6, "road inclination, rise over horizontal distance"),
        "ambient_temperature_degc": Column("°C", -60.0, 70.0, "outside air temperature"),
        "cabin_temperature_degc": Column("°C", -60.0, 100.0, "cabin air temperature"),
        "cabin_setpoint_degc": Column("°C", 0.0, 50.0, "cabin temperature that the driver asked for"),
        "battery_temperature_degc": Column("°C", -60.0, 100.0, "battery temperature"),
        "voltage_v": Column("V", 30.0, 1200.0, "battery terminal voltage"),
        "current_a": Column("A", -3000.0, 3000.0, "battery current, + discharges"),
        "soc": Column("1", 0.0, 1.0, "state of charge, the battery management's value"),
        "displayed_soc": Column("1", 0.0, 1.0, "state of charge that the driver sees"),
        "motor_torque_nm": Column("Nm", -2000.0, 2000.0, "motor torque, + propels"),
        "heating_power_w": Column("W", -500.0, 60_000.0, "electric power of the cabin heater"),
        "requested_heating_power_w": Column(
            "W", -500.0, 60_000.0, "heating power that the driver's setting requests"
        ),
        "aircon_power_w": Column("W", -500.0, 30_000.0, "electric power of the air conditioner"),
    }
)
"""Canonical sample columns in SI units; temperatures in °C, `soc` as a fraction."""

REQUIRED_COLUMNS: Final = ("time_s", "speed_m_s")


@dataclass(frozen=True, slots=True)
class Context:
    """What is known of a trip as a whole. None means unknown, never zero.

    Attributes
    ----------
    season : {"summer", "winter"} or None
    weather : str or None
        One of the data set's own levels, in lower case.
    started_at : datetime or None
        Local time of departure; its date is the day of leave-one-day-out.
    route : str or None
    cabin_setpoint_degc : float or None
        Set-point [°C] at departure.
    payload_mass_kg : float
        Load on top of the vehicle's test mass [kg].
    follows_trip : bool
        Whether the log says that the trip directly follows another one.
    notes : str
        Free text from the source.
    planned_link_m : float or None
        Of a planned trip whose speed was made from links: their mean length [m], each weighed by its own length. None
        where the speed is that of a drive.
    car : str or None
        Which car of a data set of several drove it; None where the set has one car.
    """

    season: str | None = None
    weather: str | None = None
    started_at: dt.datetime | None = None
    route: str | None = None
    cabin_setpoint_degc: float | None = None
    payload_mass_kg: float = 0.0
    follows_trip: bool = False
    notes: str = ""
    planned_link_m: float | None = None
    car: str | None = None

    @property
    def day(self) -> dt.date | None:
        """Date of departure, None when unknown."""
        return None if self.started_at is None else self.started_at.date()


@dataclass(frozen=True, eq=False, slots=True)
class Trip:
    """One drive. Samples are never changed in place; each step makes a new trip.

    Attributes
    ----------
    trip_id : str
    samples : DataFrame
        One row per sample, canonical columns (see `COLUMNS`), float64. After `resample` it also holds
        `observed_energy_wh`, the measured cumulative energy at the end of each block.
    context : Context
    observed_energy_wh : float or None
        Measured energy of the whole trip [Wh], from the raw samples; None without voltage and current.
    step_s : float or None
        Length of the blocks [s] after `resample`, None for raw samples.
    observed_energy_std_wh : float or None
        Standard error of `observed_energy_wh` [Wh] where it was not measured at the terminals but taken from the
        state of charge; None otherwise.

    Examples
    --------
    >>> import pandas as pd
    >>> samples = pd.DataFrame({"time_s": [0.0, 3600.0], "speed_m_s": [0.0, 0.0],
    ...                         "voltage_v": [360.0, 360.0], "current_a": [1.0, 1.0]})
    >>> Trip.from_samples("parked", samples).observed_energy_wh
    360.0
    """

    trip_id: str
    samples: pd.DataFrame
    context: Context = field(default_factory=Context)
    observed_energy_wh: float | None = None
    step_s: float | None = None
    observed_energy_std_wh: float | None = None

    @classmethod
    def from_log(cls, trip_id: str, samples: pd.DataFrame, context: Context | None = None) -> Trip:
        """A trip as it was logged: its table is sound, its values may still be wrong, which is the audit's work.

        Raises
        ------
        InvalidInput
            When the table itself cannot be a trip: a required column is missing, is not numeric, or is too short.
        """
        raise_faults(structure_faults(samples, trip_id))
        return cls(trip_id, samples, context or Context(), observed_energy(samples))

    @classmethod
    def from_samples(cls, trip_id: str, samples: pd.DataFrame, context: Context | None = None) -> Trip:
        """Validate raw samples and measure their energy. O(samples).

        Raises
        ------
        InvalidInput
            With every fault of the samples.
        """
        validate_samples(samples, trip_id)
        return cls(trip_id, samples, context or Context(), observed_energy(samples))

    def __len__(self) -> int:
        return len(self.samples)

    def __contains__(self, column: object) -> bool:
        return column in self.samples.columns

    def array(self, column: str) -> FloatArray:
        """One column as a float64 array, shape (samples,).

        Raises
        ------
        KeyError
            When the trip lacks the column.
        """
        return self.samples[column].to_numpy(dtype=np.float64)

    def has(self, *columns: str) -> bool:
        """Whether every named column is there with at least one finite value."""
        return all(c in self.samples.columns and not bool(np.isnan(self.array(c)).all()) for c in columns)

    @property
    def duration_s(self) -> float:
        """Time between the first and the last sample [s]."""
        time = self.samples["time_s"]
        return float(time.iloc[-1] - time.iloc[0]) if len(time) else 0.0

    @property
    def distance_m(self) -> float:
        """Distance by the trapezoid of speed over time [m]."""
        return float(np.trapezoid(self.array("speed_m_s"), self.array("time_s")))

    def between(self, from_s: float, to_s: float, *, trip_id: str | None = None) -> Trip:
        """The part of a raw trip with `from_s <= time_s <= to_s`, its energy measured anew."""
        time = self.samples["time_s"]
        part = self.samples[(time >= from_s) & (time <= to_s)].reset_index(drop=True)
        return replace(
            self, trip_id=trip_id or self.trip_id, samples=part, observed_energy_wh=observed_energy(part)
        )


def observed_cumulative_energy(samples: pd.DataFrame) -> FloatArray | None:
    """Cumulative energy at the battery terminals [Wh], trapezoid of voltage times current.

    Samples in which voltage or current is missing are bridged by the trapezoid between their neighbours. A log that
    has neither may bring a column `observed_energy_wh` of its own, such as one from the state of charge.

    Returns
    -------
    ndarray, shape (samples,), or None
        Starts at 0; None without a measurement.
    """
    if not {"voltage_v", "current_a"} <= set(samples.columns):
        if "observed_energy_wh" not in samples.columns or not len(samples):
            return None
        counted = np.asarray(samples["observed_energy_wh"], dtype=np.float64)
        return np.asarray(counted - counted[np.argmax(np.isfinite(counted))], dtype=np.float64)
    time = np.asarray(samples["time_s"], dtype=np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        power = np.asarray(samples["voltage_v"], dtype=np.float64) * np.asarray(
            samples["current_a"], dtype=np.float64
        )
    known = np.isfinite(power)
    if not known.any():
        return None
    if not known.all():
        power = np.interp(time, time[known], power[known])
    with np.errstate(invalid="ignore", over="ignore"):  # a log may hold anything until it is audited
        energy_j = np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(time))))
    return np.asarray(energy_j * WH_PER_J, dtype=np.float64)


def observed_energy(samples: pd.DataFrame) -> float | None:
    """Energy at the battery terminals over all samples [Wh], None without voltage and current."""
    cumulative = observed_cumulative_energy(samples)
    return None if cumulative is None or not len(cumulative) else float(cumulative[-1])


def table_of(columns: Mapping[str, FloatArray]) -> pd.DataFrame:
    """Columns of floats of one length as one block of numbers, which is quick to make and to look into.

    Examples
    --------
    >>> table_of({"time_s": np.arange(2.0), "speed_m_s": np.ones(2)}).shape
    (2, 2)
    """
    names = pd.Index(list(columns), dtype=object)  # a string index is slow to look into
    if not columns:
        return pd.DataFrame(columns=names)
    return pd.DataFrame(np.array(list(columns.values()), dtype=np.float64).T, columns=names)


def is_sound(samples: pd.DataFrame) -> bool:
    """Whether a table of nothing but canonical columns of floats has no fault; False also where nothing can be said.

    It says at once what `structure_faults` and `value_faults` find out column by column. O(samples x columns).
    """
    names = samples.columns.tolist()
    if len(samples) < 2 or not {*REQUIRED_COLUMNS} <= set(names) <= set(COLUMNS):
        return False
    table = samples.to_numpy()
    if table.dtype != np.float64:
        return False
    low = np.array([COLUMNS[name].minimum for name in names])
    high = np.array([COLUMNS[name].maximum for name in names])
    required = table[:, [names.index(name) for name in REQUIRED_COLUMNS]]
    time = table[:, names.index("time_s")]
    outside = (table < low) | (table > high)
    return bool(not outside.any() and np.isfinite(required).all() and (np.diff(time) > 0).all())


def structure_faults(samples: pd.DataFrame, where: str) -> Iterator[Fault]:
    """Every reason why a table cannot be a trip at all. O(columns)."""
    for name in REQUIRED_COLUMNS:
        if name not in samples.columns:
            yield Fault("missing column", where, f"columns {sorted(samples.columns)}", f"a column {name!r}")
    if len(samples) < 2:
        yield Fault("too few samples", where, f"{len(samples)}", "at least 2")
    for name in samples.columns:
        if name in COLUMNS and not pd.api.types.is_numeric_dtype(samples[name]):
            yield Fault("not a number", f"{where}, column {name!r}", str(samples[name].dtype), "numbers")


def value_faults(samples: pd.DataFrame, where: str) -> Iterator[Fault]:
    """Every value that cannot be one, of a table without structure faults. O(samples x columns)."""
    for name in samples.columns:
        if name not in COLUMNS:
            continue
        column = COLUMNS[name]
        values = np.asarray(samples[name], dtype=np.float64)
        place = f"{where}, column {name!r}, row "
        missing = np.flatnonzero(~np.isfinite(values)) if name in REQUIRED_COLUMNS else np.empty(0, np.int64)
        if len(missing):
            got = f"{values[missing[0]]}{_and_more(missing)}"
            yield Fault("missing value", f"{place}{missing[0] + 1}", got, "a finite number")
        outside = np.flatnonzero((values < column.minimum) | (values > column.maximum))
        if len(outside):
            unit = "" if column.unit == "1" else f" {column.unit}"
            allowed = f"{column.minimum:g} to {column.maximum:g}{unit}"
            got = f"{values[outside[0]]:g}{unit}{_and_more(outside)}"
            yield Fault("value out of range", f"{place}{outside[0] + 1}", got, allowed)
    time = np.asarray(samples["time_s"], dtype=np.float64)
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        row = int(back[0]) + 1
        got = f"{time[row]:g} s after {time[row - 1]:g} s{_and_more(back)}"
        yield Fault(
            "time does not increase", f"{where}, column 'time_s', row {row + 1}", got, "increasing times"
        )


def _and_more(rows: npt.NDArray[np.int64]) -> str:
    return f" (and {len(rows) - 1} more rows)" if len(rows) > 1 else ""


def raise_faults(faults: Iterable[Fault]) -> None:
    """Raise `InvalidInput` with all faults when there is one."""
    found = tuple(faults)
    if found:
        raise InvalidInput(found)


def validate_samples(samples: pd.DataFrame, where: str) -> None:
    """Raise `InvalidInput` with every fault of the samples; return None when there is none."""
    if is_sound(samples):
        return
    raise_faults(structure_faults(samples, where))
    raise_faults(value_faults(samples, where))


def resample(trip: Trip, step_s: float = 1.0) -> Trip:
    """Block means of every column over steps of `step_s` seconds from the first sample. O(samples).

    A block without samples is interpolated between its neighbours. `time_s` is the mean time of the block and
    starts near 0; the column `observed_energy_wh` is the measured cumulative energy at the end of the block, from
    the raw samples, so that its last value is the trip's `observed_energy_wh` to the last bit.

    Raises
    ------
    InvalidInput
        When `step_s` is not positive.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> time = np.arange(0.0, 3.0, 0.1)
    >>> trip = Trip.from_samples("t", pd.DataFrame({"time_s": time, "speed_m_s": np.floor(time + 1e-9)}))
    >>> resample(trip).array("speed_m_s")
    array([0., 1., 2.])
    """
    if not step_s > 0:
        raise InvalidInput(Fault("step out of range", "step_s", f"{step_s}", "more than 0 s"))
    time = trip.array("time_s") - float(trip.samples["time_s"].iloc[0])
    n_blocks, means = block_means(time, {c: trip.array(c) for c in trip.samples.columns}, step_s)
    samples = pd.DataFrame(means)
    cumulative = observed_cumulative_energy(trip.samples)
    if cumulative is not None:
        ends = np.minimum(np.arange(1, n_blocks + 1) * step_s, time[-1])
        samples["observed_energy_wh"] = np.interp(ends, time, cumulative)
    return replace(trip, samples=samples, step_s=step_s)


def block_means(
    time: FloatArray, columns: Mapping[str, FloatArray], step_s: float
) -> tuple[int, dict[str, FloatArray]]:
    """Number of blocks of `step_s` seconds, and the mean of each column over each; see `resample`. O(samples).

    Parameters
    ----------
    time : ndarray, shape (samples,)
        Increasing times [s] since the first sample; they stand for the column `time_s`.
    """
    block = np.floor(time / step_s + 1e-6).astype(np.int64)
    n_blocks = int(block[-1]) + 1
    count = np.bincount(block, minlength=n_blocks)
    some_empty = bool((count == 0).any())
    centre = (np.arange(n_blocks) + 0.5) * step_s
    means: dict[str, FloatArray] = {}
    for name, values in columns.items():
        values = time if name == "time_s" else values
        known = np.isfinite(values)
        complete = bool(known.all())
        total = np.bincount(
            block, weights=values if complete else np.where(known, values, 0.0), minlength=n_blocks
        )
        number = count if complete else np.bincount(block[known], minlength=n_blocks)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / number
        if name == "time_s":
            mean = np.where(count > 0, mean, centre)
        elif some_empty and number.any():
            empty = count == 0
            usable = number > 0
            mean[empty] = np.interp(centre[empty], centre[usable], mean[usable])
        means[name] = mean
    return n_blocks, means


def require_unique_ids(trips: Iterable[Trip]) -> None:
    """Raise `InvalidInput` when two trips share an id."""
    ids = pd.Series([t.trip_id for t in trips], dtype=object)
    twice = sorted(set(ids[ids.duplicated()]))
    if twice:
        raise InvalidInput(
            Fault("two trips with one id", "trips", ", ".join(map(str, twice)), "one id per trip")
        )


@dataclass(frozen=True, slots=True)
class Fleet:
    """Trips that were read together, and what their source says of them.

    Attributes
    ----------
    name : str
        The data set, e.g. "tum"; "synthetic" for the built-in fleet.
    trips : tuple of Trip
        Raw trips, before any audit.
    notes : tuple of str
        What a reader had to say, e.g. that season and weather are unknown. Shown to the user, never lost.
    reference : mapping of str to (float or None), or None
        The data set's reference trips: id -> time [s] at which the trip ends, None for its own end. None when the
        data set defines none.
    citation : str
        Attribution that the data's licence asks for, empty when it asks for none.
    """

    name: str
    trips: tuple[Trip, ...]
    notes: tuple[str, ...] = ()
    reference: Mapping[str, float | None] | None = None
    citation: str = ""

    def reference_trips(self) -> tuple[Trip, ...]:
        """The reference trips among `trips`, ended where the reference says; empty without a reference."""
        ends = self.reference or {}
        return tuple(
            t if ends[t.trip_id] is None else t.between(-math.inf, ends[t.trip_id] or math.inf)
            for t in self.trips
            if t.trip_id in ends
        )
