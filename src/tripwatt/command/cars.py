"""Commands on cars: list and search the library, describe a new car, simulate a trip, export a consumption curve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, get_type_hints

import typer

import tripwatt as tw
from tripwatt import trips
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, assignments, flag, option, require_effect
from tripwatt.command.printing import print_json, print_notes, print_table, say
from tripwatt.command.sentences import by_cause
from tripwatt.errors import Check, InvalidInput, places_named, raise_faults
from tripwatt.trips.messages import flag_to_dict
from tripwatt.trips.showing import journey

if TYPE_CHECKING:
    from tripwatt.vehicles import Vehicle


@dataclass(frozen=True)
class NewCar:
    """Published values of a new car: the arguments of `describe_car`."""

    mass_kg: Annotated[float | None, option("KG", "New car: curb mass, nobody inside.", "--mass")] = None
    usable_battery_kwh: Annotated[float | None, option("KWH", "New car: usable energy.", "--battery")] = None
    consumption_kwh_per_100km: Annotated[
        float | None, option("KWH", "New car: published, per 100 km at the wall.", "--consumption")
    ] = None
    motor_power_kw: Annotated[float | None, option("KW", "New car: power of all motors.", "--power")] = None
    body: Annotated[
        str | None, option("KIND", "New car: small, hatchback, sedan, estate, suv, van, pickup, quadricycle.")
    ] = None
    heat_pump: Annotated[bool | None, flag("--heat-pump/--no-heat-pump", "New car: heat pump.")] = None
    procedure: Annotated[str | None, option("NAME", "New car: consumption by wltp (default) or epa.")] = None


OPTIONS: Final = {
    name: (said if isinstance(said := hint.__metadata__[0].default, str) else f"--{name}").partition("/")[0]
    for name, hint in get_type_hints(NewCar, include_extras=True).items()
}
"""Argument of `describe_car` -> its option."""


def vehicles(
    words: Annotated[
        list[str] | None,
        argument(
            "NAME|FILE.toml|WORDS...|new",
            "Car to show, words to search for, or `new` to describe a car. Default: the list of all cars.",
        ),
    ] = None,
    overrides: shared.Overrides = None,
    published: NewCar = NewCar(),
    out: shared.TextFile = None,
) -> Answer:
    """List or search the cars of the library, show one with the source of every value, or describe one.

    For example:

      # list the cars of the library
      tripwatt vehicles
      # find the cars whose name has these words, built in this year
      tripwatt vehicles model 3 2022
      # show all values of one car with unit and source
      tripwatt vehicles nissan_leaf_40
      # describe a car that the library does not have
      tripwatt vehicles new --mass 1830 --battery 58 --consumption 15.5 --power 150 --body hatchback --out my_car.toml
      # show your own file with another mass
      tripwatt vehicles my_car.toml --set mass=1620
    """
    name = " ".join(words or [])
    given = {key: value for key, value in asdict(published).items() if value is not None}
    if name == "new":
        return _new(given, out)
    require_effect({OPTIONS[key]: given[key] for key in given} | {"--out": out}, "only together with new")
    from tripwatt.vehicles import find_vehicles, vehicle_titles

    titles = vehicle_titles()
    names = titles if not name else () if name in titles or name.endswith(".toml") else find_vehicles(name)
    if not names:
        return _describe(name, overrides or [])
    rows = [(each, titles[each]) for each in names]
    document = [{"name": each, "title": title} for each, title in rows]
    return Answer(document, partial(print_table, "Cars for --car NAME", ("name", "car"), rows))


def _new(given: dict[str, Any], out: Path | None) -> Answer:
    from tripwatt.certification import certified_interval
    from tripwatt.vehicles import render_vehicle

    if not given:
        raise InvalidInput.of("nothing is said of the car", "new", "no value", ", ".join(OPTIONS.values()))
    with places_named(OPTIONS):
        car = tw.describe_car(**given)
    wltp, text = certified_interval(car), render_vehicle(car)
    document = {"title": car.title, "anchor": car.anchor, "wltp_kwh_per_100km": asdict(wltp), "toml": text}
    if out is None:
        return Answer(document, partial(typer.echo, text, nl=False))
    shared.write_text(text, out)
    return Answer(
        document,
        f"{out} is written: {car.title}. On the WLTP it would use {wltp.middle:.1f} kWh/100 km; 9 in 10 such cars use "
        f"{wltp.low:.1f} to {wltp.high:.1f}. Forecast with `tripwatt forecast ROUTE --car {out}`",
    )


def _describe(name: str, overrides: list[str]) -> Answer:
    from tripwatt.vehicles import describe_vehicle

    given = assignments(overrides, "--set")
    car = tw.load_vehicle(name, overrides=given)
    rows = describe_vehicle(name, overrides=given)
    keys = ("key", "value", "unit", "source", "licence")
    entries = [dict(zip(keys, row, strict=True)) for row in rows]

    def shown() -> None:
        say(f"{car.title} ({car.name})")
        for key, value, unit, source, licence in rows:
            say(f"{key} = {value} {'' if unit == '1' else unit}".rstrip())
            say(f"    {source} (licence: {licence})")

    return Answer({"name": car.name, "title": car.title, "entries": entries}, shown)


def simulate(logs: shared.LogsOfCar, trip: shared.TripId = None) -> Answer:
    """Simulate one logged trip with a car and print the energy by cause beside the measured energy.

    The simulation uses physics only: speed, road, and the state at departure (temperatures, state of charge). Values of the car
    are those of the library, while `tripwatt forecast` uses fitted ones. The log is used without an audit; run `tripwatt audit`
    to find its faults.

    For example:

      # simulate the first trip of the sample in the package
      tripwatt simulate
      # simulate one trip of the TUM set
      tripwatt simulate data/tum --trip TripA01
      # simulate a trip with a cooler cabin
      tripwatt simulate data/tum --trip TripB07 --set setpoint=18
      # simulate your own log with your own car
      tripwatt simulate drive.csv --mapping my.toml --car vw_id3
    """
    from tripwatt.physics import simulate_trip

    note, car = logs.named()[1], logs.car()
    fleet = logs.read()
    log = shared.one_trip(fleet.trips[:1] if trip is None and logs.data is None else fleet.trips, trip)
    # a log is simulated unaudited: only its times have to be sound
    fix = "list the findings with `tripwatt audit`; write one sound trip with `tripwatt mapping apply`"
    raise_faults(replace(f, fix=fix) for f in trips.value_faults(log.samples[["time_s"]], log.trip_id))
    run = simulate_trip(car, trips.resample(log))
    answer = {
        "trip": log.trip_id,
        "vehicle": car.name,
        "distance_km": log.distance_m / 1000.0,
        "duration_s": log.duration_s,
        "simulated_energy_wh": run.simulated_energy_wh,
        "observed_energy_wh": log.observed_energy_wh,
        "observed_energy_std_wh": log.observed_energy_std_wh,
        "by_cause_wh": run.by_cause_wh,
        "soc_at_departure": float(run.soc[0]),
        "soc_at_arrival": float(run.soc[-1]),
        "flags": [flag_to_dict(flag) for flag in run.flags],
        "notes": [flag_to_dict(flag) for flag in (*note, *fleet.notes)],
    }
    return Answer(answer, partial(_show_simulation, answer))


def _show_simulation(answer: dict[str, Any]) -> None:
    total, distance = answer["simulated_energy_wh"], answer["distance_km"]

    def row(name: str, energy: float) -> tuple[str, ...]:
        values = (energy, 100.0 * energy / total if total else None, energy / distance if distance else None)
        return (name, *("–" if v is None else f"{round(v, 1) + 0.0:.1f}" for v in values))

    rows = [row(cause, energy) for cause, energy in by_cause(answer["by_cause_wh"]).items()]
    rows.append(row("simulated, total", total))
    if answer["observed_energy_wh"] is not None:
        rows.append(row("measured", answer["observed_energy_wh"]))
    columns = ("energy", "Wh", "%", "Wh/km")
    driven = f"{answer['trip']}: {journey(1000.0 * distance, answer['duration_s'])}"
    title = f"{driven} with {answer['vehicle']}, no value fitted to trips"
    print_table(title, columns, rows, numbers=columns[1:])
    error_wh = answer["observed_energy_std_wh"]
    if error_wh is not None:
        say(f"measured: from the state of charge, standard error {error_wh:.0f} Wh")
    ends = (f"{100.0 * answer[f'soc_at_{end}']:.1f} % at {end}" for end in ("departure", "arrival"))
    say(f"state of charge of the battery management, not as displayed: {', '.join(ends)} (simulated)")
    print_notes(flag["message"] for flag in (*answer["flags"], *answer["notes"]))


USUAL: Final = {"ambient_temperature_degc": 20.0, "payload_mass_kg": 0.0, "soc": 0.8}
"""Default departure of a curve."""

Asked = Annotated[
    shared.DepartureOf, shared.departure_options(without=("departs_at", "terrain"), default=USUAL)
]


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
      tripwatt export tomtom --car nissan_leaf_40 --query
    """
    from tripwatt.export import export_curve, render_query

    with shared.options_named(), Check() as check:
        described, known = check(_car, model, vehicle), check(departure)
    car, correction, note = described
    parameters = export_curve(car, service, known, correction=correction)
    say(render_query(parameters)) if query else print_json(parameters)
    print_notes([note])


def _car(model: Path | None, vehicle: str | None) -> tuple[Vehicle, Callable[[tw.Plan], float] | None, str]:
    """Return the car, the function for its correction (None for physics only), and a note about the correction."""
    require_effect({"--model": vehicle and model}, "one of the two, --model or --car")
    given = shared.model_and_car(model, vehicle)
    if given["car"] is None:
        fitted = tw.for_car(given["model"])
        note = f"{fitted.vehicle.title}: physics with the correction of the model"
        return fitted.vehicle, lambda trip: fitted.forecast(trip).by_cause_wh["correction"], note
    car = tw.load_vehicle(given["car"])
    return car, None, f"{car.title}: physics only, without a correction"
