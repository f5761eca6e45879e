"""Plan of a drive to come: speed along the road, and what is known at departure. A forecast before departure uses nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray, distance_driven
from tripwatt.errors import InvalidInput
from tripwatt.trips.columns import raise_faults
from tripwatt.trips.departure import Departure
from tripwatt.trips.elevation import heights_of_a_road
from tripwatt.trips.flags import Flag
from tripwatt.trips.gaps import MAX_DURATION_S, gap_flags, time_faults
from tripwatt.trips.messages import flag_to_dict, message
from tripwatt.trips.samples import Sampled, bin_means, columns_of, table_of
from tripwatt.trips.schema import faults_named, structure_faults, validate_samples, value_faults
from tripwatt.trips.showing import html_table, journey
from tripwatt.trips.trip import Recorded
from tripwatt.trips.weather import PlanWeather

if TYPE_CHECKING:
    from tripwatt.figures import Axes, Figure
ROUTE_COLUMNS: Final = ("time_s", "speed_m_s", "elevation_m", "grade")
"""Columns of a plan."""

BIN_S: Final = 1.0
"""Width of the bins of a logged speed trace [s]; corrections are fitted on such bins."""


@dataclass(frozen=True, slots=True)
class Pause:
    """A time on the way in which the car is off: it is parked, or a ferry or a train carries it.

    Attributes
    ----------
    position_m : float
        Distance driven before the pause [m].
    duration_s : float
        Length of the pause [s].
    carried_m : float
        Distance over which the car is carried [m]; 0 = parked.
    cools : bool
        Whether the car is known to be off, so that it has to get warm again. A gap in a track, or a crossing, does not show this.

    Examples
    --------
    >>> Pause(9900.0, duration_s=2700.0)
    Pause(position_m=9900.0, duration_s=2700.0, carried_m=0.0, cools=False)
    """

    position_m: float
    duration_s: float
    carried_m: float = 0.0
    cools: bool = False


@dataclass(frozen=True, eq=False)
class KnownClimb:
    """Climb of a road of unknown heights, as far as the heights of places beside it show it.

    Attributes
    ----------
    distance_m : ndarray, shape (points,)
        Distance from the start [m], ascending from 0.
    climb_m, sd_m : ndarray, shape (points,)
        Expected net climb from the start to each point, and its standard deviation [m]; 0 at the start.
    start_m : float
        Expected height of the start [m].

    Examples
    --------
    >>> over_a_pass = KnownClimb(np.array([0.0, 5e3, 9e3]), np.array([0.0, 400.0, 100.0]), np.array([0.0, 80.0, 30.0]), 900.0)
    >>> over_a_pass.height(np.array([0.0, 2.5e3, 9e3])).tolist()
    [900.0, 1100.0, 1000.0]
    """

    distance_m: FloatArray
    climb_m: FloatArray
    sd_m: FloatArray
    start_m: float

    def height(self, at_m: FloatArray | float) -> FloatArray:
        """Expected height at distances from the start [m], shape of `at_m`."""
        return np.asarray(self.start_m + np.interp(at_m, self.distance_m, self.climb_m))


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Plan(Sampled):
    """A drive to come: speed and road over time, without measurements.

    Attributes
    ----------
    departure : Departure
        What is known at departure.
    link_m : float or None
        Mean length of the links from which the speed was made [m], weighted by length. None if the speed is that of a drive.
    flags : tuple of Flag
        What had to be assumed about the road.
    step_s : float or None
        Step of the samples [s]; None if the steps are not equal.
    start_s : float
        Time of departure on the clock of the measurements on the way [s].
    end_s : float or None
        Time of arrival on that clock [s]; None if only the plan itself gives the arrival.
    weather : PlanWeather or None
        Wind, air density and rain along the plan, from a source of weather; None means calm, dry, standard atmosphere.
    free_flow : bool
        Whether the travel times are those of an empty road, as from a router without traffic.
    heading_deg : ndarray, shape (samples,), or None
        Direction of travel, clockwise from north [°]; None if unknown.
    pauses : tuple of Pause
        Times on the way in which the car is off; they are no part of the samples.
    climb : KnownClimb or None
        What is known of the climb if the heights of the road are unknown: the simulated road climbs as expected.

    Examples
    --------
    >>> import pandas as pd
    >>> plan = Plan.from_trace("drive", pd.DataFrame({"time_s": [0.0, 60.0], "speed_m_s": [10.0, 10.0]}))
    >>> plan
    <Plan drive: 0.6 km in 60 s, driven speed>
    >>> plan.with_departure(Departure(soc=0.8)).departure
    Departure(soc=0.8)
    """

    departure: Departure = field(default_factory=Departure)
    link_m: float | None = None
    flags: tuple[Flag, ...] = ()
    step_s: float | None = None
    start_s: float = 0.0
    end_s: float | None = None
    weather: PlanWeather | None = None
    free_flow: bool = False
    heading_deg: FloatArray | None = None
    pauses: tuple[Pause, ...] = ()
    climb: KnownClimb | None = None
    _values: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with faults_named(self.samples, self.trip_id):
            object.__setattr__(self, "_values", self.samples.to_numpy(dtype=np.float64))
            _require_duration(self.duration_s, self.trip_id)
            self.array("speed_m_s")  # simulated without a further check that it is there

    def array(self, column: str) -> FloatArray:
        """Return one column as a float64 array, shape (samples,); much faster than for a trip, as a plan has few columns.

        Parameters
        ----------
        column : str
            One of `ROUTE_COLUMNS`.

        Returns
        -------
        ndarray, shape (samples,)
            Values in the unit of the column; unknown values are NaN.

        Raises
        ------
        KeyError
            If the plan lacks the column.

        Examples
        --------
        >>> Plan.from_samples(pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 2.0]}), "start").array("speed_m_s")
        array([0., 2.])
        """
        return np.asarray(self._values[:, self.samples.columns.get_loc(column)])

    @classmethod
    def from_trace(
        cls,
        trip_id: str,
        samples: pd.DataFrame | Mapping[str, FloatArray],
        departure: Departure | None = None,
        *,
        link_m: float | None = None,
        flags: tuple[Flag, ...] = (),
    ) -> Plan:
        """Make a plan from a speed trace with its samples unchanged, except for heights that no road can have.

        Parameters
        ----------
        trip_id : str
            Name of the drive.
        samples : DataFrame or mapping of str to ndarray
            Canonical columns; all but `ROUTE_COLUMNS` are dropped.
        departure : Departure, optional
            What is known at departure.
        link_m : float, optional
            Mean length of the links [m] from which the speed was made.
        flags : tuple of Flag
            What had to be assumed about the road.

        Returns
        -------
        Plan
            The plan, with a flag if heights were replaced.

        Raises
        ------
        InvalidInput
            With every fault of the samples.

        Examples
        --------
        >>> import pandas as pd
        >>> import tripwatt as tw
        >>> drive = pd.DataFrame({"time_s": [0.0, 60.0], "speed_m_s": [10.0, 10.0], "voltage_v": 360.0})
        >>> list(tw.Plan.from_trace("drive", drive).samples)
        ['time_s', 'speed_m_s']
        """
        if isinstance(samples, pd.DataFrame):
            raise_faults(structure_faults(samples, trip_id))
        raise_faults(value_faults(samples, trip_id))
        names = [name for name in ROUTE_COLUMNS if name in samples]
        route, more = _sound({name: np.asarray(samples[name], dtype=np.float64) for name in names})
        all_flags = tuple(dict.fromkeys((*flags, *more)))
        return cls(trip_id, table_of(route), departure or Departure(), link_m, all_flags)

    @classmethod
    def from_trip(cls, trip: Recorded) -> Plan:
        """Make a plan of a trip: its speed trace, road and covariates, and of the other signals only their values at departure.

        Simulation, features and forecast have no other input, so nothing that was measured on the way can leak into a forecast
        before departure. O(samples).

        Parameters
        ----------
        trip : Trip
            A trip with raw samples.

        Returns
        -------
        Plan
            Columns of `ROUTE_COLUMNS` as means over bins of `BIN_S`, without the measured energy.

        Raises
        ------
        InvalidInput
            If a value of the first sample is out of its bounds.

        Examples
        --------
        >>> from tripwatt.study.synthetic import synthetic_fleet
        >>> trip = synthetic_fleet(1).logs[0]
        >>> plan = Plan.from_trip(trip)
        >>> plan.has("speed_m_s"), plan.has("current_a"), plan.departure == trip.departure
        (True, False, True)
        """
        with faults_named(trip.samples, trip.trip_id):
            return cls._binned(trip, trip.departure)

    @classmethod
    def from_samples(
        cls, samples: pd.DataFrame, trip_id: str = "trip", departure: Departure | None = None
    ) -> Plan:
        """Make a plan from a speed trace and its road; of the other signals only the values at departure are used.

        Gaps of up to `LONGEST_GAP_S` are bridged and flagged.

        Parameters
        ----------
        samples : DataFrame
            Canonical columns.
        trip_id : str
            Name of the plan.
        departure : Departure, optional
            Departure whose known fields replace those of the first sample.

        Returns
        -------
        Plan
            Speed trace and road as means over bins of `BIN_S`, with a flag if a gap was bridged.

        Raises
        ------
        InvalidInput
            With every fault of the samples, including a longer gap and a duration above `MAX_DURATION_S`.

        Examples
        --------
        >>> import pandas as pd
        >>> drive = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_m_s": [0.0, 1.0, 2.0], "soc": 0.5})
        >>> Plan.from_samples(drive, departure=Departure(soc=0.8, payload_mass_kg=150.0)).departure
        Departure(soc=0.8, payload_mass_kg=150.0)
        """
        validate_samples(samples, trip_id)
        time = samples["time_s"].to_numpy(dtype=np.float64)
        raise_faults(time_faults(time, trip_id))
        log = Recorded(trip_id, samples)
        own = replace(log.departure, payload_mass_kg=None, follows_trip=None)
        plan = cls._binned(log, own.merge(departure))
        return replace(plan, flags=(*gap_flags(time), *plan.flags))

    @classmethod
    def _binned(cls, drive: Sampled, departure: Departure) -> Plan:
        route, flags = _sound({c: drive.array(c) for c in ROUTE_COLUMNS if c in drive})
        time = route["time_s"]
        start, end = float(time[0]), float(time[-1])
        _require_duration(end - start, drive.trip_id)
        columns = bin_means(time - start, route, BIN_S)
        return cls(drive.trip_id, table_of(columns), departure, None, flags, BIN_S, start, end)

    def with_departure(self, departure: Departure | None) -> Plan:
        """Return the plan with its departure updated by the known fields of another departure.

        Parameters
        ----------
        departure : Departure or None
            The other departure; None changes nothing.

        Returns
        -------
        Plan
            A changed copy.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 5000.0, "speed_m_s": 20.0}], trip_id="commute")
        >>> plan.with_departure(tw.Departure(soc=0.8)).departure.soc
        0.8
        """
        return self if departure is None else replace(self, departure=self.departure.merge(departure))

    @property
    def air(self) -> PlanWeather | None:
        """Wind, air density and rain: from the departure if it has any weather, else `weather`."""
        if not self.departure.has_weather:
            return self.weather
        return PlanWeather.from_departure(self.departure, self.array("speed_m_s"), self.heading_deg)

    def with_weather(self, weather: PlanWeather | None) -> Plan:
        """Return the plan with other weather, which also replaces the weather of its departure.

        Parameters
        ----------
        weather : PlanWeather or None
            The other weather; None means calm, dry, standard atmosphere.

        Returns
        -------
        Plan
            A changed copy.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 5000.0, "speed_m_s": 20.0}]).with_departure(tw.Departure(wind_speed_m_s=8.0))
        >>> plan.air.any_side_m_s > 0.0, plan.with_weather(plan.air.calm()).air.any_side_m_s
        (True, 0.0)
        """
        return replace(self, weather=weather, departure=self.departure.without_weather())

    @property
    def elapsed_s(self) -> float:
        """Time from departure to arrival [s]: the drive and its pauses."""
        return self.duration_s + sum(pause.duration_s for pause in self.pauses)

    @property
    def has_road(self) -> bool:
        """Whether elevation or grade is known."""
        return self.has("elevation_m") or self.has("grade")

    @property
    def elevation_m(self) -> FloatArray | None:
        """Elevation at the samples [m], that of the expected climb if the heights are unknown; None if nothing is known of it."""
        if self.climb is None or self.has_road:
            return super(Plan, self).elevation_m  # without arguments it fails in a class with slots
        return self.climb.height(distance_driven(self.array("time_s"), self.array("speed_m_s")))

    def to_dict(self) -> dict[str, Any]:
        """Convert the plan to plain values, with the names that a request to the service uses.

        Returns
        -------
        dict
            Only numbers, texts, lists, dicts and None.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 5000.0, "speed_m_s": 20.0}], trip_id="commute")
        >>> plan.to_dict()["trip"]
        'commute'
        """
        return {
            "trip": self.trip_id,
            **self.departure.to_dict(),
            "link_m": self.link_m,
            "duration_s": self.duration_s,
            "distance_m": self.distance_m,
            "flags": [flag_to_dict(flag) for flag in self.flags],
            "samples": columns_of(self.samples),
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Plot speed, and elevation if it is known, over time.

        Parameters
        ----------
        ax : Axes, optional
            Axes that the panels replace; a new figure if not given.

        Returns
        -------
        matplotlib.figure.Figure
            Panels of speed [km/h] and elevation [m].

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 5000.0, "speed_m_s": 20.0}], trip_id="commute")
        >>> plan.plot().savefig("plan.png")  # doctest: +SKIP
        """
        from tripwatt.trips.plots import plot_drive  # matplotlib is slow to import

        return plot_drive(self, self._title(), None, ax)

    def _title(self) -> str:
        how = "driven speed" if self.link_m is None else f"links of {self.link_m:.0f} m"
        return f"{self.trip_id}: {journey(self.distance_m, self.duration_s)}, {how}"

    def __repr__(self) -> str:
        return f"<Plan {self._title()}>"

    def _repr_html_(self) -> str:
        known = [(name, str(value)) for name, value in self.departure.to_dict().items()]
        known += [("assumed", message(flag)) for flag in self.flags]
        return html_table(f"Plan {self._title()}", known)


def _require_duration(duration_s: float, where: str) -> None:
    if not duration_s <= MAX_DURATION_S:
        allowed = f"at most {MAX_DURATION_S:g} s"
        raise InvalidInput.of("duration out of range", where, f"{duration_s:g} s", allowed)


def _sound(route: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], tuple[Flag, ...]]:
    """Replace heights that no road can have in the columns of a plan; return the columns, and a flag if any were replaced."""
    if "elevation_m" not in route:
        return route, ()
    time, speed, height = (route[name] for name in ROUTE_COLUMNS[:3])
    sound = heights_of_a_road(time, distance_driven(time, speed), height)
    flags = () if sound is height else (Flag("elevation_interpolated", "road"),)
    return {**route, "elevation_m": sound}, flags
