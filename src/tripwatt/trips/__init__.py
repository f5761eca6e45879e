"""Drives as data: `Log` as it came, `Trip` after its audit, `Plan` to come, and what is known at the `Departure`."""

from tripwatt.trips.context import Context
from tripwatt.trips.departure import ASKED, EXTRAS, SIGNALS, TEMPERATURES, TERRAINS, Departure
from tripwatt.trips.drive import Drive
from tripwatt.trips.energy import observed_cumulative_energy, observed_energy
from tripwatt.trips.flags import Flag
from tripwatt.trips.fleet import Fleet
from tripwatt.trips.gaps import MOST_DURATION_S, gap_flags, time_faults
from tripwatt.trips.plan import ROUTE_COLUMNS, Plan, plan_from_samples, plan_from_trip
from tripwatt.trips.samples import bin_means, table_of
from tripwatt.trips.schema import (
    COLUMNS,
    DEPARTURE_BOUNDS,
    LINK_COLUMNS,
    QUANTITIES,
    REQUIRED_COLUMNS,
    STEEPEST_GRADE,
    Column,
    is_sound,
    raise_faults,
    scalar_faults,
    structure_faults,
    validate_samples,
    value_faults,
)
from tripwatt.trips.trip import Log, Recorded, Trip, require_unique_ids, resample
from tripwatt.trips.weather import PlanWeather

__all__ = [
    "ASKED",
    "COLUMNS",
    "DEPARTURE_BOUNDS",
    "EXTRAS",
    "LINK_COLUMNS",
    "MOST_DURATION_S",
    "QUANTITIES",
    "REQUIRED_COLUMNS",
    "ROUTE_COLUMNS",
    "SIGNALS",
    "STEEPEST_GRADE",
    "TEMPERATURES",
    "TERRAINS",
    "Column",
    "Context",
    "Departure",
    "Drive",
    "Flag",
    "Fleet",
    "Log",
    "Plan",
    "PlanWeather",
    "Recorded",
    "Trip",
    "bin_means",
    "gap_flags",
    "is_sound",
    "observed_cumulative_energy",
    "observed_energy",
    "plan_from_samples",
    "plan_from_trip",
    "raise_faults",
    "require_unique_ids",
    "resample",
    "scalar_faults",
    "structure_faults",
    "table_of",
    "time_faults",
    "validate_samples",
    "value_faults",
]
