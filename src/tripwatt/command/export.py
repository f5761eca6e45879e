"""`tripwatt export`: the consumption curve of a car as parameters of routing services."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.departing import DepartureOf, departure_options
from tripwatt.command.options import argument, flag
from tripwatt.command.printing import print_json, print_notes
from tripwatt.errors import Check, InvalidInput

if TYPE_CHECKING:
    from tripwatt.vehicles import Vehicle

USUAL: Final = {"ambient_temperature_degc": 20.0, "payload_mass_kg": 0.0, "soc": 0.8}
"""Default departure of a curve."""

Asked = Annotated[DepartureOf, departure_options(without=("departs_at", "terrain"), default=USUAL)]


def export(
    service: Annotated[str, argument("SERVICE", "here, tomtom, mapbox or abrp.")],
    departure: Asked,
    model: shared.Model = None,
    vehicle: shared.Car = None,
    query: Annotated[bool, flag("--query", "Print a URL query string instead of JSON.")] = False,
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
    from tripwatt.export import export_curve, render_query

    with shared.options_named(), Check() as check:
        described, known = check(_car, model, vehicle), check(departure)
    car, correction, note = described
    parameters = export_curve(car, service, known, correction=correction)
    typer.echo(render_query(parameters)) if query else print_json(parameters)
    print_notes([note])


def _car(model: Path | None, vehicle: str | None) -> tuple[Vehicle, Callable[[tw.Plan], float] | None, str]:
    """Return the car, the function for its correction (None for physics only), and a note about the correction."""
    if vehicle is None:
        fitted = tw.load_model(model)
        note = f"{fitted.vehicle.title}: physics with the correction of the model"
        return fitted.vehicle, lambda trip: fitted.forecast(trip).by_cause_wh["correction"], note
    if model is not None:
        got = f"--model {model} --vehicle {vehicle}"
        raise InvalidInput.of("conflicting options", "--model and --vehicle", got, "one of the two")
    car = tw.load_vehicle(vehicle)
    return car, None, f"{car.title}: physics only, without a correction"
