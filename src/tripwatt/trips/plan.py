"""A road to come with the speed on it, and what is known at the door: all that a forecast before departure may see."""

from __future__ import annotations

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
from tripwatt.trips.gaps import MOST_DURATION_S, gap_flags, time_faults
from tripwatt.trips.messages import flag_to_dict, message
from tripwatt.trips.samples import Sampled, bin_means, columns_of, table_of
from tripwatt.trips.schema import validate_samples
from tripwatt.trips.showing import html_table, journey
from tripwatt.trips.trip import Recorded
from tripwatt.trips.weather import PlanWeather

if TYPE_CHECKING:
    from tripwatt.figures import Axes, Figure
ROUTE_COLUMNS: Final = ("time_s", "speed_m_s", "elevation_m", "grade")
"""Columns of a plan."""


@dataclass(frozen=True, eq=False, slots=True, repr=False)
class Plan(Sampled):
    """A drive to come: speed and road along its time, no measurements.

    Attributes
    ----------
    departure : Departure
        What is known at the door.
    link_m : float or None
        Where the speed was made from links: their mean length [m], each weighed by its own length. None where the
        speed is that of a drive.
    flags : tuple of Flag
        What had to be assumed of the road.
    step_s : float or None
        Length of the steps of the samples [s]; None when they are not equal.
    start_s : float
        Time of the departure on the clock of what is measured on the way [s].
    end_s : float or None
        Time of the arrival on that clock [s]; None when only the plan has it.
    weather : PlanWeather or None
        Wind, density of the air and rain along the plan, from a source of weather; None = calm, dry, standard atmosphere.
    free_flow : bool
        Whether the travel times are those of an empty road, as a router without traffic gives them.
    heading_deg : ndarray, shape (samples,), or None
        Direction of travel, clockwise from north; None where it is unknown.

    Examples
    --------
    >>> import pandas as pd
    >>> plan = Plan.from_samples("drive", pd.DataFrame({"time_s": [0.0, 60.0], "speed_m_s": [10.0, 10.0]}))
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

    def __post_init__(self) -> None:
        _require_duration(self.duration_s, self.trip_id)

    def array(self, column: str) -> FloatArray:
        """One column as a float64 array, shape (samples,), much faster than one of a trip: a plan has few columns.

        Parameters
        ----------
        column : str
            One of `ROUTE_COLUMNS`.

        Returns
        -------
        ndarray, shape (samples,)
            Its values in the unit of the column, NaN where they are unknown.

        Raises
        ------
        KeyError
            When the plan lacks the column.

        Examples
        --------
        >>> plan_from_samples(pd.DataFrame({"time_s": [0.0, 1.0], "speed_m_s": [0.0, 2.0]}), "start").array("speed_m_s")
        array([0., 2.])
        """
        place = self.samples.columns.get_loc(column)
        return np.asarray(self.samples.to_numpy(dtype=np.float64)[:, place])

    @classmethod
    def from_samples(
        cls,
        trip_id: str,
        samples: pd.DataFrame,
        departure: Departure | None = None,
        *,
        link_m: float | None = None,
        flags: tuple[Flag, ...] = (),
    ) -> Plan:
        """A plan from a speed trace as it is, `ROUTE_COLUMNS` alone.

        Parameters
        ----------
        trip_id : str
            Name of the drive.
        samples : DataFrame
            Canonical columns; those that are no `ROUTE_COLUMNS` are dropped.
        departure : Departure, optional
            What is known when the car leaves.
        link_m : float, optional
            Mean length of the links [m] from which the speed was made.
        flags : tuple of Flag
            What had to be assumed of the road.

        Returns
        -------
        Plan
            With the samples as they are.

        Raises
        ------
        InvalidInput
            With every fault of the samples.

        Examples
        --------
        >>> import pandas as pd
        >>> import tripwatt as tw
        >>> drive = pd.DataFrame({"time_s": [0.0, 60.0], "speed_m_s": [10.0, 10.0], "voltage_v": 360.0})
        >>> list(tw.Plan.from_samples("drive", drive).samples)
        ['time_s', 'speed_m_s']
        """
        validate_samples(samples, trip_id)
        route = samples[[name for name in ROUTE_COLUMNS if name in samples.columns]]
        sound, more = _sound({str(name): route[name].to_numpy(dtype=np.float64) for name in route})
        route = route.assign(**sound) if more else route
        return cls(trip_id, route, departure or Departure(), link_m, tuple(dict.fromkeys((*flags, *more))))

    def with_departure(self, departure: Departure | None) -> Plan:
        """The plan with the known fields of a departure in place of its own.

        Parameters
        ----------
        departure : Departure or None
            None changes nothing.

        Returns
        -------
        Plan
            A new one.

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
        """Wind, density of the air and rain: those of the departure where it names any, else `weather`."""
        if not self.departure.has_weather:
            return self.weather
        return PlanWeather.from_departure(self.departure, self.array("speed_m_s"), self.heading_deg)

    def with_weather(self, weather: PlanWeather | None) -> Plan:
        """The plan in other weather, also in place of that of its departure.

        Parameters
        ----------
        weather : PlanWeather or None
            None = calm, dry, standard atmosphere.

        Returns
        -------
        Plan
            A new one.

        Examples
        --------
        >>> import tripwatt as tw
        >>> plan = tw.read_route([{"length_m": 5000.0, "speed_m_s": 20.0}]).with_departure(tw.Departure(wind_speed_m_s=8.0))
        >>> plan.air.any_side_m_s > 0.0, plan.with_weather(plan.air.calm()).air.any_side_m_s
        (True, 0.0)
        """
        return replace(self, weather=weather, departure=self.departure.without_weather())

    @property
    def has_road(self) -> bool:
        """Whether elevation or grade is known."""
        return self.has("elevation_m") or self.has("grade")

    def to_dict(self) -> dict[str, Any]:
        """Plain values, with the names that a request of the service has.

        Returns
        -------
        dict
            Numbers, texts, lists and further dicts only.

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
        """Speed, and elevation where it is known, over time.

        Parameters
        ----------
        ax : Axes, optional
            Whose place the panels take; a new figure without them.

        Returns
        -------
        matplotlib.figure.Figure
            Speed [km/h], elevation [m].

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
    if not duration_s <= MOST_DURATION_S:
        allowed = f"at most {MOST_DURATION_S:g} s"
        raise InvalidInput.of("duration out of range", where, f"{duration_s:g} s", allowed)


def plan_from_trip(trip: Recorded, *, step_s: float = 1.0) -> Plan:
    """What was known of a trip at its departure: its speed trace and road, and the first raw sample of the rest.

    Everything after that (simulation, features, forecast) has no other input, so nothing that was measured on the way
    can leak into a forecast before departure. O(samples).

    Parameters
    ----------
    trip : Trip
        Raw samples.
    step_s : float
        Width of the bins of the speed trace [s].

    Returns
    -------
    Plan
        Columns of `ROUTE_COLUMNS` as bin means; no measured energy.

    Raises
    ------
    InvalidInput
        When a value of the first sample is out of its bounds.

    Examples
    --------
    >>> from tripwatt.study.synthetic import synthetic_fleet
    >>> trip = synthetic_fleet(1).logs[0]
    >>> plan = plan_from_trip(trip)
    >>> plan.has("speed_m_s"), plan.has("current_a"), plan.departure == trip.departure
    (True, False, True)
    """
    return _plan(trip, trip.departure, step_s)


def plan_from_samples(
    samples: pd.DataFrame, trip_id: str = "trip", departure: Departure | None = None, *, step_s: float = 1.0
) -> Plan:
    """A plan from a speed trace and its road; of other signals the first sample counts.

    Gaps of up to `LONGEST_GAP_S` are bridged and flagged.

    Parameters
    ----------
    samples : DataFrame
        Canonical columns.
    trip_id : str
        Name of the plan.
    departure : Departure, optional
        Its known fields take the place of those of the first sample.
    step_s : float
        Width of the bins of the speed trace [s].

    Returns
    -------
    Plan
        Speed trace and road as bin means, with a flag when a gap was bridged.

    Raises
    ------
    InvalidInput
        With every fault of the samples; also when they have a longer gap, or the trip is longer than `MOST_DURATION_S`.

    Examples
    --------
    >>> import pandas as pd
    >>> drive = pd.DataFrame({"time_s": [0.0, 1.0, 2.0], "speed_m_s": [0.0, 1.0, 2.0], "soc": 0.5})
    >>> plan_from_samples(drive, departure=Departure(soc=0.8, payload_mass_kg=150.0)).departure
    Departure(soc=0.8, payload_mass_kg=150.0)
    """
    validate_samples(samples, trip_id)
    time = samples["time_s"].to_numpy(dtype=np.float64)
    raise_faults(time_faults(time, trip_id))
    log = Recorded(trip_id, samples)
    own = replace(log.departure, payload_mass_kg=None, follows_trip=None)
    plan = _plan(log, own.merge(departure), step_s)
    return replace(plan, flags=(*gap_flags(time), *plan.flags))


def _plan(drive: Sampled, departure: Departure, step_s: float) -> Plan:
    route, flags = _sound({c: drive.array(c) for c in ROUTE_COLUMNS if c in drive})
    time = route["time_s"]
    start, end = float(time[0]), float(time[-1])
    _require_duration(end - start, drive.trip_id)
    _, columns = bin_means(time - start, route, step_s)
    return Plan(drive.trip_id, table_of(columns), departure, None, flags, step_s, start, end)


def _sound(route: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], tuple[Flag, ...]]:
    """Columns of a plan without heights that no road can have, and the flag that says so."""
    if "elevation_m" not in route:
        return route, ()
    time, speed, height = (route[name] for name in ROUTE_COLUMNS[:3])
    sound = heights_of_a_road(time, distance_driven(time, speed), height)
    flags = () if sound is height else (Flag("elevation_interpolated", "road"),)
    return {**route, "elevation_m": sound}, flags
