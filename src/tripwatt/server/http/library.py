"""Cars and example trips of the service, and tables in the form of requests."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any, Final

import numpy as np

from tripwatt.certification import certified_interval
from tripwatt.forecasting import load_model
from tripwatt.physics.battery import usable_energy_wh
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.schemas import BMS_SOC, ExampleSummary, ForecastRequest
from tripwatt.sources.sample import sample_trips
from tripwatt.trips.samples import columns_of
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_names

EXAMPLE_CAR: Final = "bmw_i3_60ah"


@cache
def vehicles() -> tuple[dict[str, Any], ...]:
    """Return the cars of the library, without the models of the service."""
    cars = [(car, car.climate is not None) for car in map(load_vehicle, vehicle_names())]
    return tuple({"name": car.name, "has_climate": has, **_vehicle_values(car)} for car, has in cars)


def describe_vehicle(car: Vehicle) -> dict[str, Any]:
    """Return the values of a car from a few figures, with the WLTP consumption and interval that it would be certified with."""
    certified = certified_interval(car)
    return {
        **_vehicle_values(car),
        "wltp_kwh_per_100km": certified.middle,
        "wltp_low_kwh_per_100km": certified.low,
        "wltp_high_kwh_per_100km": certified.high,
    }


def _vehicle_values(car: Vehicle) -> dict[str, Any]:
    return {
        "title": car.title,
        "test_mass_kg": car.body.test_mass_kg,
        "usable_energy_wh": usable_energy_wh(car.battery),
        "anchor": car.anchor,
    }


@cache
def examples() -> dict[str, dict[str, Any]]:
    """Return every other trip of the sample of the TUM set as an example, by name, from the first to the last trip."""
    charge = load_model().fitted_parts("examples")[1].charge
    battery = load_vehicle(EXAMPLE_CAR).battery
    sample, by_trip = sample_trips(), {}
    for trip in sample.trips[::2]:  # as many as a page lists without scrolling
        departure = replace(trip.departure, departs_at=None).to_dict()  # of an unknown zone
        at_departure = {name: departure[name] for name in ForecastRequest.model_fields if name in departure}
        managed = float(trip.array("soc")[0])
        # converted as the bundled model converts the samples on the way, so that the curve starts at the charge of the departure
        displayed = battery.displayed_from_soc(managed) if charge is None else charge.displayed(managed)
        at_departure["soc"] = float(np.clip(displayed, 0.0, 1.0))
        road = trip.samples[["time_s", "speed_m_s", "elevation_m"]]
        measured = trip.samples[["time_s", "voltage_v", "current_a", "soc"]]
        by_trip[trip.trip_id] = {
            "trip": trip.trip_id,
            "title": f"{trip.trip_id}: {trip.context.route}",
            "car": EXAMPLE_CAR,
            "note": sample.citation,
            "duration_s": trip.duration_s,
            "distance_m": trip.distance_m,
            "ambient_temperature_degc": at_departure.get("ambient_temperature_degc"),
            "observed_energy_wh": trip.observed_energy_wh,
            "request": {"trip": trip.trip_id, "samples": columns_of(road), **at_departure},
            "observed": columns_of(measured.rename(columns=BMS_SOC)),
        }
    return by_trip


def example_summaries() -> dict[str, Any]:
    """Return the examples without their samples."""
    fields = ExampleSummary.model_fields
    return {"examples": [{name: example[name] for name in fields} for example in examples().values()]}


def example(trip: str) -> dict[str, Any]:
    """Return an example by its name.

    Raises
    ------
    Problem
        `not-found`.
    """
    if trip not in examples():
        raise Problem("not-found", "unknown example")
    return examples()[trip]
