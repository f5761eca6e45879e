"""Commands of the forecast: forecast a trip, update the forecast, write an example trip."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.departing import DepartingNow
from tripwatt.command.options import Answer, argument, option
from tripwatt.command.output import write_text
from tripwatt.command.printing import kwh, print_notes, print_table
from tripwatt.command.sentences import chance_to_arrive, forecast_in_words, unknown_climb_in_words
from tripwatt.errors import Check, InvalidInput
from tripwatt.trips.columns import require_fraction
from tripwatt.trips.showing import period
from tripwatt.units import M_S_PER_KM_H

if TYPE_CHECKING:
    from tripwatt.forecasting.document import LeaveWith

LEAVE_PROBABILITY: Final = 0.95
"""Probability that the charge of "leave with" suffices: 19 of 20 trips."""


def forecast(
    paths: Annotated[
        list[Path],
        argument(
            "[MODEL] TRIP",
            "Folder of a model (default: the bundled model), and a trip: a speed trace or a planned route. "
            "Speed trace: CSV or Parquet with time_s, speed_m_s, and optionally elevation_m or grade; of other signals the first "
            "sample counts. Planned route: GPX, KML, GeoJSON, the saved response of OSRM, Valhalla, openrouteservice or "
            "GraphHopper, or links as CSV or JSON (length_m, speed_m_s or travel_time_s, and optionally grade or "
            "start_elevation_m and end_elevation_m, stop_s, speed_limit_m_s).",
        ),
    ],
    departure: DepartingNow,
    vehicle: shared.Car = None,
    speed: Annotated[float | None, option("KM/H", "Mean speed of a track without times and speeds.")] = None,
    observed: Annotated[
        Path | None,
        option(
            "SAMPLES",
            "Samples measured so far, on the clock of the trip: time_s with voltage_v and current_a, soc or displayed_soc; on a "
            "planned route also speed_m_s.",
        ),
    ] = None,
    reserve: shared.Reserve = 0.1,
) -> Answer:
    """Forecast the energy of a trip with its interval and its causes, given a speed trace or a planned route.

    A driver model turns a planned route into a speed trace. The interval includes the error of this step, which was
    measured when the model was fitted. State of charge is the displayed one.

    For example:

      # write an example trip
      tripwatt example-trip --out trip.csv
      # forecast it with the bundled model
      tripwatt forecast trip.csv --soc 0.8 --ambient -5
      # forecast it with your own model
      tripwatt forecast my-model trip.csv --reserve 0.1
      # update the forecast during the trip; so-far.csv has the samples so far, for example `head -601 trip.csv`
      tripwatt forecast trip.csv --observed so-far.csv --json
      # forecast a planned route from the saved response of a router
      tripwatt forecast answer.json --soc 0.8 --ambient 5
      # forecast a track without times at a mean speed of 60 km/h
      tripwatt forecast ride.gpx --speed 60
      # forecast for another car of the library
      tripwatt forecast ride.gpx --vehicle vw_id3 --soc 0.8
    """
    from tripwatt.forecasting.leaving import leave_with
    from tripwatt.sources.canonical import read_canonical

    model, trip = model_and_trip(paths)
    speed_m_s = None if speed is None else speed * M_S_PER_KM_H
    with shared.options_named():
        with Check() as check:
            check(require_fraction, "reserve", reserve)
            fitted = check(shared.model_of, model)
            plan = check(tw.read_route, trip, speed_m_s=speed_m_s)
            measured = (
                None if observed is None else check(read_canonical, observed, required=("time_s",), minimum=2)
            )
            car = vehicle and check(tw.load_vehicle, vehicle)
            known = check(departure)
        expected = tw.for_car(fitted, car).forecast(plan, known)
    if measured is not None:
        expected = expected.update(measured)
    leave = leave_with(expected, reserve, LEAVE_PROBABILITY) if observed is None else None
    return Answer(
        partial(expected.to_dict, reserve, leave), partial(_show_forecast, expected, reserve, leave)
    )


def model_and_trip(paths: list[Path]) -> tuple[Path | None, Path]:
    """Split the arguments `[MODEL] TRIP`; the model is None if it is not given."""
    if len(paths) > 2:
        got, allowed = " ".join(map(str, paths)), "a folder with a model and a file with a trip"
        raise InvalidInput.of("too many arguments", "MODEL TRIP", got, allowed)
    *model, trip = paths
    return (model[0] if model else None), trip


def show_arrival(forecast: tw.Forecast, subject: str, reserve: float) -> None:
    """Print a forecast for a driver: energy, charge at arrival, the probability to arrive with the reserve."""
    sentences = [forecast_in_words(forecast, subject), *unknown_climb_in_words(forecast, reserve)]
    typer.echo("\n".join(sentences))
    chance = chance_to_arrive(forecast, reserve)
    typer.echo(f"The probability to arrive with {100.0 * reserve:g} % or more is {chance}.")


def _show_forecast(forecast: tw.Forecast, reserve: float, leave: LeaveWith | None) -> None:
    from tripwatt.physics.chain import CAUSE_NAMES

    show_arrival(forecast, forecast.plan.trip_id, reserve)
    when = f"after {period(forecast.measured_until_s)}"
    if leave is not None:
        when = "before departure"
        typer.echo(leave["message"])
    typer.echo("")
    causes = [
        (CAUSE_NAMES.get(cause, cause), kwh(energy, 3, "+"))
        for cause, energy in forecast.by_cause_wh.items()
        if cause != "shortfall" or energy
    ]
    causes.append(("in all", kwh(forecast.energy_wh, 3, "+")))
    title = f"{forecast.vehicle.title}, {when}, given {forecast.given}"
    print_table(title, ("cause", "energy"), causes, numbers=("energy",))
    print_notes(forecast.flags)


def example_trip(
    out: shared.TextFile = None,
    seed: Annotated[int, option("N", "Number of the trip.", min=0)] = 0,
) -> None:
    """Print a synthetic trip as a CSV table, as an input for `tripwatt forecast`.

    The trip is computed. It does not describe a real car.

    For example:

      # write an example trip for `tripwatt forecast trip.csv`
      tripwatt example-trip --out trip.csv
    """
    from tripwatt.study import synthetic

    text = synthetic.example_trip(seed).to_csv(index=False, lineterminator="\n")
    if out is None:
        typer.echo(text, nl=False)
        return
    write_text(text, out)
    print_notes([f"{out} is a synthetic trip; it does not describe a real car"])
