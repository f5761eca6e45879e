"""`tripwatt export`: the consumption curve of a car as routing services take it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from tripwatt.command.departing import DepartureOf, departure_options
from tripwatt.command.journey import CarOption, ModelOption
from tripwatt.command.options import argument, options_named
from tripwatt.command.printing import print_json, print_notes
from tripwatt.errors import Check, Fault, InvalidInput

if TYPE_CHECKING:
    from tripwatt.export import ConsumptionCurve
    from tripwatt.trips import Plan
    from tripwatt.vehicles import Vehicle

USUAL: Final = {"ambient_temperature_degc": 20.0, "payload_mass_kg": 0.0, "soc": 0.8}
"""What a curve is made for by default."""

Asked = Annotated[DepartureOf, departure_options(without=("departs_at", "terrain"), default=USUAL)]


def export(
    service: Annotated[str, argument("SERVICE", "here, tomtom, mapbox or abrp.")],
    departure: Asked,
    model: ModelOption = None,
    vehicle: CarOption = None,
    query: Annotated[bool, typer.Option("--query", help="Print a URL query string instead of JSON.")] = False,
) -> None:
    """Print the consumption curve of a car as the parameters of a routing service: a JSON object of strings.

    here: HERE Routing v8, ev[freeFlowSpeedTable] and others. tomtom: TomTom Routing,
    constantSpeedConsumptionInkWhPerHundredkm and others. mapbox: Mapbox Directions, energy_consumption_curve and others.
    abrp: the reference consumption of A Better Routeplanner, Wh/km at 110 km/h.

    For example:

      # export the car of the bundled model
      tripwatt export here --ambient -5
      # export another car from physics only
      tripwatt export tomtom --vehicle nissan_leaf_40 --query
    """
    from tripwatt.export import EXPORTS, render_query

    if service not in EXPORTS:
        raise InvalidInput(Fault.unknown("unknown service", "SERVICE", service, EXPORTS))
    curve, notes = _curve(model, vehicle, departure)
    parameters = EXPORTS[service](curve)
    typer.echo(render_query(parameters)) if query else print_json(parameters)
    print_notes(notes)


def _curve(
    model: Path | None, vehicle: str | None, departure: DepartureOf
) -> tuple[ConsumptionCurve, list[str]]:
    from tripwatt.export import consumption_curve

    with options_named(), Check() as check:
        described, known = check(_car, model, vehicle), check(departure)
    car, correction, note = described
    return consumption_curve(car, known, correction=correction), [note]


def _car(model: Path | None, vehicle: str | None) -> tuple[Vehicle, Callable[[Plan], float] | None, str]:
    """The car, its correction, and a note about that."""
    if vehicle is None:
        from tripwatt.forecasting import load_model

        fitted = load_model(model)
        note = f"{fitted.vehicle.title}: physics with the correction of the model"
        return fitted.vehicle, lambda trip: fitted.forecast(trip).by_cause_wh["correction"], note
    from tripwatt.vehicles import load_vehicle

    if model is not None:
        got = f"--model {model} --vehicle {vehicle}"
        raise InvalidInput.of("conflicting options", "--model and --vehicle", got, "one of the two")
    car = load_vehicle(vehicle)
    return car, None, f"{car.title}: physics only, without a correction"
