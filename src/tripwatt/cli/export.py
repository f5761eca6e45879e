"""`tripwatt export`: the consumption curve of a car as routing services take it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from tripwatt.cli.departing import DepartureOf, departure_options
from tripwatt.cli.options import EXAMPLES, SetOption, option, options_named
from tripwatt.cli.output import write_text
from tripwatt.cli.printing import print_json, print_notes
from tripwatt.errors import Check, InvalidInput

if TYPE_CHECKING:
    from tripwatt.export import ConsumptionCurve
    from tripwatt.trips import Plan
    from tripwatt.vehicles import Vehicle

ModelOption = Annotated[
    Path | None,
    option(
        "MODEL",
        "Folder of a model, for its car with the correction. Default without --vehicle: the bundled model.",
        "--model",
        "-m",
    ),
]
CarOption = Annotated[
    str | None,
    option(
        "NAME|FILE.toml",
        "Car to simulate without a model: a name from `tripwatt vehicles`, or a TOML file.",
        "--vehicle",
    ),
]
OutOption = Annotated[Path | None, option("FILE", "Also write the JSON to this file.", "--out", "-o")]
QueryOption = Annotated[bool, typer.Option("--query", help="Print a URL query string instead of JSON.")]

GROUP: Final = "Print the consumption curve of a car as parameters of a routing service."
USUAL: Final = {"ambient_temperature_degc": 20.0, "payload_mass_kg": 0.0, "soc": 0.8}
"""What a curve is made for by default."""

Asked = Annotated[DepartureOf, departure_options(without=("departs_at", "terrain"), default=USUAL)]
SERVICES: Final = {
    "here": "HERE Routing v8: ev[freeFlowSpeedTable], ev[trafficSpeedTable], ascent, descent, auxiliaryConsumption.",
    "tomtom": "TomTom Routing: constantSpeedConsumptionInkWhPerHundredkm, auxiliaryPowerInkW, efficiencies.",
    "mapbox": "Mapbox Directions: energy_consumption_curve, auxiliary_consumption, ascent, descent, ev_max_charge.",
    "abrp": "A Better Routeplanner: reference consumption, Wh/km at 110 km/h.",
}


def command_of(service: str) -> Callable[..., None]:
    """The command of a service, under its name."""

    def command(
        departure: Asked,
        model: ModelOption = None,
        vehicle: CarOption = None,
        overrides: SetOption = None,
        out: OutOption = None,
        query: QueryOption = False,
    ) -> None:
        from tripwatt.export import EXPORTS, render_query

        curve, notes = _curve(model, vehicle, overrides or [], departure)
        parameters = EXPORTS[service](curve)
        if out is not None:
            write_text(json.dumps(parameters, indent=1, ensure_ascii=False) + "\n", out)
        typer.echo(render_query(parameters)) if query else print_json(parameters)
        print_notes(notes)

    command.__name__ = service
    command.__doc__ = f"""{SERVICES[service]}

Print the parameters of a request as a JSON object of strings.

{EXAMPLES}

  # export the car of the bundled model
  tripwatt export {service} --ambient -5
  # export another car from physics only
  tripwatt export {service} --vehicle nissan_leaf_40 --query"""
    return command


def _curve(
    model: Path | None, vehicle: str | None, overrides: list[str], departure: DepartureOf
) -> tuple[ConsumptionCurve, list[str]]:
    from tripwatt.export import consumption_curve

    with options_named(), Check() as check:
        described, known = check(_car, model, vehicle, overrides), check(departure)
    car, correction, notes = described
    return consumption_curve(car, known, correction=correction), notes


def _car(
    model: Path | None, vehicle: str | None, overrides: list[str]
) -> tuple[Vehicle, Callable[[Plan], float] | None, list[str]]:
    """The car, its correction, and notes about that."""
    from tripwatt.vehicles import load_vehicle, parse_overrides

    if vehicle is not None:
        if model is not None:
            got = f"--model {model} --vehicle {vehicle}"
            raise InvalidInput.of("conflicting options", "--model and --vehicle", got, "one of the two")
        car = load_vehicle(vehicle, overrides=parse_overrides(overrides))
        return car, None, [f"{car.title}: physics only, without a correction"]
    if overrides:
        fix = "name a car with --vehicle, or fit a model on the changed car"
        raise InvalidInput.of(
            "option has no effect", "--set", " ".join(overrides), "only together with --vehicle", fix
        )
    from tripwatt.forecasting import load_model

    fitted = load_model(model)
    notes = [f"{fitted.vehicle.title}: physics with the correction of the model"]
    return fitted.vehicle, lambda trip: fitted.forecast(trip).by_cause_wh["correction"], notes
