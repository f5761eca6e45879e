"""Drives that took place: a `Log` before its audit, a `Trip` after it, and logs that were read together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd

from tripwatt.errors import InvalidInput
from tripwatt.trips.columns import COLUMNS, raise_faults
from tripwatt.trips.departure import Context, Departure
from tripwatt.trips.energy import observed_cumulative_energy, observed_energy, observed_energy_std
from tripwatt.trips.flags import Flag
from tripwatt.trips.reading import ReadingReport
from tripwatt.trips.samples import Sampled, bin_means, columns_of
from tripwatt.trips.schema import faults_named, structure_faults, validate_samples
from tripwatt.trips.showing import html_table, journey

if TYPE_CHECKING:
    from tripwatt.figures import Axes, Figure


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Recorded(Sampled):
    """A drive that took place, with its context and its measured energy.

    Attributes
    ----------
    context : Context
        What is known of the drive as a whole.
    observed_energy_wh : float or None
        Measured energy of the whole drive [Wh], from the raw samples; None without a measurement.
    step_s : float or None
        Length of the steps [s] after `resample`; None for raw samples. After `resample`, the samples also have
        `observed_energy_wh`, the measured cumulative energy at the end of each step.
    observed_energy_std_wh : float or None
        Standard error of `observed_energy_wh` [Wh], if the energy comes from the state of charge or from a power that was
        logged coarsely or rarely; None if the error is negligible.
    observed_energy_common_std : float
        Part of the standard error that all energies of the car have in common, as from an uncertain capacity, over the energy.

    Examples
    --------
    >>> import pandas as pd
    >>> samples = pd.DataFrame({"time_s": [0.0, 60.0, 120.0], "speed_m_s": 10.0, "voltage_v": 360.0, "current_a": 30.0})
    >>> drive = Recorded("A", samples, observed_energy_wh=observed_energy(samples))
    >>> drive
    <Recorded A: 1.2 km in 2 min, 0.36 kWh measured, 3 samples>
    >>> round(drive.between(0.0, 60.0).observed_energy_wh)
    180
    >>> sorted(drive.to_dict())
    ['context', 'distance_m', 'duration_s', 'observed_energy_std_wh', 'observed_energy_wh', 'samples', 'trip']
    >>> len(drive.plot().axes)
    2
    """

    context: Context = field(default_factory=Context)
    observed_energy_wh: float | None = None
    step_s: float | None = None
    observed_energy_std_wh: float | None = None
    observed_energy_common_std: float = 0.0

    @property
    def observed_energy_own_std_wh(self) -> float:
        """Part of `observed_energy_std_wh` that is independent of other trips [Wh]; 0 if it is negligible."""
        common = self.observed_energy_common_std * (self.observed_energy_wh or 0.0)
        return math.sqrt(max((self.observed_energy_std_wh or 0.0) ** 2 - common**2, 0.0))

    @property
    def departure(self) -> Departure:
        """What was known at departure, from the first sample and the context.

        Raises
        ------
        InvalidInput
            If a value of the first sample is out of its bounds.
        """
        return Departure.from_first_sample(self, self.context)

    def between(self, from_s: float, to_s: float, *, trip_id: str | None = None) -> Self:
        """Return the part of a raw drive with `from_s <= time_s <= to_s`, with the energy of this part.

        Parameters
        ----------
        from_s : float
            First time of the part [s], on the clock of `time_s`.
        to_s : float
            Last time of the part [s], included.
        trip_id : str, optional
            Name of the part; the name of the drive by default.

        Returns
        -------
        Recorded
            A drive of the same class.
        """
        time = self.samples["time_s"]
        part = self.samples[(time >= from_s) & (time <= to_s)].reset_index(drop=True)
        return replace(self, trip_id=trip_id or self.trip_id).with_samples(part)

    def with_samples(self, samples: pd.DataFrame) -> Self:
        """Return the drive with other raw samples, their energy and its standard error.

        The standard error of an energy from the state of charge is kept.

        Parameters
        ----------
        samples : DataFrame
            Canonical columns, one row per sample.

        Returns
        -------
        Self
            A changed copy.

        Examples
        --------
        >>> import pandas as pd
        >>> samples = pd.DataFrame({"time_s": [0.0, 3600.0], "speed_m_s": 10.0, "voltage_v": 360.0, "current_a": 2.0})
        >>> Recorded("A", samples).with_samples(samples).observed_energy_wh
        720.0
        """
        measured = {"voltage_v", "current_a"} <= set(samples.columns) or not self.observed_energy_common_std
        std = observed_energy_std(samples) if measured else self.observed_energy_std_wh
        energy = observed_energy(samples)
        return replace(self, samples=samples, observed_energy_wh=energy, observed_energy_std_wh=std)

    def to_dict(self) -> dict[str, Any]:
        """Convert the drive to plain values: name, totals, context and the samples by column.

        Returns
        -------
        dict
            Keys `trip`, `duration_s`, `distance_m`, `observed_energy_wh`, `observed_energy_std_wh`, `context` and `samples`; the
            context has only known fields.
        """
        context = {name: value for name, value in asdict(self.context).items() if value not in (None, "")}
        if self.context.started_at is not None:
            context["started_at"] = self.context.started_at.isoformat()
        names = "duration_s", "distance_m", "observed_energy_wh", "observed_energy_std_wh"
        known = {name: getattr(self, name) for name in names}
        return {"trip": self.trip_id, **known, "context": context, "samples": columns_of(self.samples)}

    def plot(self, ax: Axes | None = None) -> Figure:
        """Plot speed, and elevation and measured energy if they are known, over time.

        Parameters
        ----------
        ax : Axes, optional
            Axes that the panels replace; a new figure if not given.

        Returns
        -------
        Figure
            Figure of matplotlib with one panel for each known quantity.
        """
        from tripwatt.trips.plots import plot_drive  # matplotlib is slow to import

        logged = self.array("observed_energy_wh") if "observed_energy_wh" in self else None
        energy = observed_cumulative_energy(self.samples) if logged is None else logged
        return plot_drive(self, self._title(), energy, ax)

    def _title(self) -> str:
        energy = self.observed_energy_wh
        measured = "energy not measured" if energy is None else f"{energy / 1000.0:.2f} kWh measured"
        return f"{self.trip_id}: {journey(self.distance_m, self.duration_s)}, {measured}"

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._title()}, {len(self)} samples>"

    def _repr_html_(self) -> str:
        rows = [("samples", f"{len(self)}"), ("columns", ", ".join(self.samples.columns))]
        rows += [(name, str(value)) for name, value in self.departure.to_dict().items()]
        return html_table(f"{type(self).__name__} {self._title()}", rows)


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Log(Recorded):
    """A drive as it was logged. Its table is valid, but values may be wrong until `tripwatt.auditing` has judged them.

    Attributes
    ----------
    trip_id : str
        Name of the log.
    samples : DataFrame
        One row per sample, canonical columns (see `tripwatt.trips.COLUMNS`).
    context : Context
        What is known of the drive as a whole.
    observed_energy_wh : float or None
        Measured energy of the whole log [Wh]; None without a measurement.
    step_s : float or None
        None, because a log is raw.
    observed_energy_std_wh : float or None
        Standard error of the measured energy [Wh]; None if it is negligible or unknown.

    Examples
    --------
    >>> import pandas as pd
    >>> Log.from_samples("A", pd.DataFrame({"time_s": [0.0, 60.0], "speed_m_s": [10.0, 10.0]}))
    <Log A: 0.6 km in 60 s, energy not measured, 2 samples>
    """

    @classmethod
    def from_samples(cls, trip_id: str, samples: pd.DataFrame, context: Context | None = None) -> Log:
        """Make a log from a table, if the structure of the table is valid.

        Parameters
        ----------
        trip_id : str
            Name of the log.
        samples : DataFrame
            One row per sample, canonical columns; at least two rows with `time_s` and `speed_m_s`.
        context : Context, optional
            What is known of the drive as a whole; nothing by default.

        Returns
        -------
        Log
            A log with its measured energy, if there is a measurement.

        Raises
        ------
        InvalidInput
            If a required column is missing, a column is not numeric or duplicate, or there are fewer than two samples.
        """
        raise_faults(structure_faults(samples, trip_id))
        return cls(trip_id, samples, context or Context()).with_samples(samples)


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Trip(Recorded):
    """One sound drive that took place.

    Attributes
    ----------
    trip_id : str
        Name of the drive.
    samples : DataFrame
        One row per sample, canonical columns, float64.
    context : Context
        What is known of the drive as a whole.
    observed_energy_wh : float or None
        Measured energy of the whole drive [Wh]; None without a measurement.
    step_s : float or None
        Length of the steps [s] after `resample`; None for raw samples.
    observed_energy_std_wh : float or None
        Standard error of the energy [Wh]; None if it is negligible.
    observed_energy_common_std : float
        Part of the standard error that all energies of the car have in common, over the energy.

    Examples
    --------
    >>> import pandas as pd
    >>> samples = pd.DataFrame({"time_s": [0.0, 3600.0], "speed_m_s": [0.0, 0.0],
    ...                         "voltage_v": [360.0, 360.0], "current_a": [1.0, 1.0]})
    >>> Trip.from_samples("parked", samples)
    <Trip parked: 0.0 km in 1 h 00 min, 0.36 kWh measured, 2 samples>
    """

    @classmethod
    def from_samples(cls, trip_id: str, samples: pd.DataFrame, context: Context | None = None) -> Trip:
        """Validate raw samples and measure their energy. O(samples).

        Parameters
        ----------
        trip_id : str
            Name of the drive.
        samples : DataFrame
            Canonical columns, one row per sample.
        context : Context, optional
            What is known of the drive as a whole.

        Returns
        -------
        Trip
            A trip with its measured energy, if there is a measurement.

        Raises
        ------
        InvalidInput
            With every fault of the samples.

        Examples
        --------
        >>> import pandas as pd
        >>> import tripwatt as tw
        >>> log = pd.DataFrame({"time_s": [0.0, 3600.0], "speed_m_s": 0.0, "voltage_v": 360.0, "current_a": 1.0})
        >>> tw.Trip.from_samples("parked", log).observed_energy_wh
        360.0
        """
        validate_samples(samples, trip_id)
        return cls(trip_id, samples, context or Context()).with_samples(samples)

    @classmethod
    def from_log(cls, log: Recorded) -> Trip:
        """Make a trip of a log without an audit or a check of its values.

        Parameters
        ----------
        log : Recorded
            A log, for example from a reader.

        Returns
        -------
        Trip
            A trip with the samples, the context and the energy of the log.

        Examples
        --------
        >>> import pandas as pd
        >>> import tripwatt as tw
        >>> from tripwatt.trips import Log
        >>> tw.Trip.from_log(Log.from_samples("A", pd.DataFrame({"time_s": [0.0, 60.0], "speed_m_s": [10.0, 10.0]})))
        <Trip A: 0.6 km in 60 s, energy not measured, 2 samples>
        """
        return cls(*(getattr(log, field.name) for field in fields(Recorded)))


def resample(trip: Trip, step_s: float = 1.0) -> Trip:
    """Average every signal over steps (bins) of `step_s` seconds from the first sample. O(samples).

    Bins without samples are interpolated between their neighbours. `time_s` is the mean time in the bin, from near 0 on.
    The column `observed_energy_wh` is the measured cumulative energy at the end of the bin, from the raw samples, so its last
    value is exactly the trip's `observed_energy_wh`.

    Parameters
    ----------
    trip : Trip
        A trip with raw samples.
    step_s : float
        Width of a bin [s], more than 0.

    Returns
    -------
    Trip
        A trip with one row per bin, and its `step_s` set.

    Raises
    ------
    InvalidInput
        If `step_s` is not positive, or there are too many bins.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> time = np.arange(0.0, 3.0, 0.1)
    >>> trip = Trip.from_samples("t", pd.DataFrame({"time_s": time, "speed_m_s": np.floor(time + 1e-9)}))
    >>> resample(trip).array("speed_m_s")
    array([0., 1., 2.])
    """
    if not step_s > 0:
        raise InvalidInput.of("step out of range", "step_s", f"{step_s}", "more than 0 s")
    with faults_named(trip.samples, trip.trip_id):
        time = trip.array("time_s") - float(trip.samples["time_s"].iloc[0])
        signals = {c: trip.array(c) for c in trip.samples.columns if c in COLUMNS}
        samples = pd.DataFrame(bin_means(time, signals, step_s))
    cumulative = observed_cumulative_energy(trip.samples)
    if cumulative is not None:
        ends = np.minimum(np.arange(1, len(samples) + 1) * step_s, time[-1])
        samples["observed_energy_wh"] = np.interp(ends, time, cumulative)
    return replace(trip, samples=samples, step_s=step_s)


def require_unique_ids(drives: Iterable[Sampled]) -> None:
    """Raise `InvalidInput` if two drives have the same id.

    Parameters
    ----------
    drives : iterable of Sampled
        Logs, trips or plans.

    Raises
    ------
    InvalidInput
        With all ids that occur more than once.

    Examples
    --------
    >>> require_unique_ids([Sampled("A", None), Sampled("A", None)])
    Traceback (most recent call last):
        ...
    tripwatt.errors.InvalidInput: duplicate trip id: trips: got A; allowed: one id per trip
    """
    ids = pd.Series([drive.trip_id for drive in drives], dtype=object)
    twice = sorted(set(ids[ids.duplicated()]))
    if twice:
        raise InvalidInput.of("duplicate trip id", "trips", ", ".join(map(str, twice)), "one id per trip")


@dataclass(frozen=True, slots=True, repr=False)
class TripSet:
    """Logs that were read together, and the notes of their source.

    Attributes
    ----------
    name : str
        The data set, e.g. "tum"; "TUM sample" for the trips of the package.
    logs : tuple of Log
        Logs before any audit.
    notes : tuple of Flag
        Notes of a reader, e.g. that season and weather are unknown.
    reference : mapping of str to (float or None), or None
        Reference trips of the data set: id -> time [s] at which the trip is cut off, or None if it is not cut. None if the
        data set defines no reference trips.
    citation : str
        Attribution that the licence of the data requires; empty if there is none.
    report : ReadingReport or None
        What was read from each file; None for logs that were not read from files.

    Examples
    --------
    >>> import tripwatt as tw
    >>> sample = tw.sample_trips()
    >>> sample.name, len(sample.logs), sample.reference_trips()
    ('TUM sample', 15, ())
    """

    name: str
    logs: tuple[Recorded, ...]
    notes: tuple[Flag, ...] = ()
    reference: Mapping[str, float | None] | None = None
    citation: str = ""
    report: ReadingReport | None = None

    @property
    def trips(self) -> tuple[Trip, ...]:
        """The logs as trips, without an audit."""
        return tuple(map(Trip.from_log, self.logs))

    def reference_trips(self) -> tuple[Trip, ...]:
        """Return the reference trips among the logs, cut off where the reference ends; empty without a reference.

        Returns
        -------
        tuple of Trip
            Trips in the order of the logs.
        """
        ends = self.reference or {}
        return tuple(
            t if ends[t.trip_id] is None else t.between(-math.inf, ends[t.trip_id] or math.inf)
            for t in self.trips
            if t.trip_id in ends
        )

    def __len__(self) -> int:
        return len(self.logs)

    def __repr__(self) -> str:
        read = "" if self.report is None else f" from {self.report}"
        return f"<TripSet {self.name}: {len(self)} logs{read}>"
