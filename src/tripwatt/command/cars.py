"""Commands on cars: the library, describing one, driving a trip with one."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from tripwatt.command.options import (
    Answer,
    Logs,
    SetOption,
    TripOption,
    VehicleOption,
    argument,
    option,
    require_effect,
)
from tripwatt.command.output import write_text
from tripwatt.command.printing import console, print_notes, print_table
from tripwatt.errors import InvalidInput, places_named

if TYPE_CHECKING:
    from tripwatt.trips import Trip, TripSet

PresetOption = Annotated[
    str,
    option(
        "NAME",
        "default, paper (the simplified model of the paper), or a preset of the vehicle file.",
        "--preset",
    ),
]


def vehicles(
    words: Annotated[
        list[str] | None,
        argument(
            "NAME|FILE.toml|WORDS...|new",
            "Car to show, words to search for, or `new` to describe a car. Default: the list of all cars.",
        ),
    ] = None,
    preset: PresetOption = "default",
    overrides: SetOption = None,
    mass: Annotated[float | None, option("KG", "With new: curb mass, nobody inside.")] = None,
    battery: Annotated[float | None, option("KWH", "With new: usable energy of the battery.")] = None,
    consumption: Annotated[
        float | None, option("KWH", "With new: published consumption per 100 km, at the wall.")
    ] = None,
    power: Annotated[float | None, option("KW", "With new: largest power of all motors together.")] = None,
    body: Annotated[
        str | None,
        option("KIND", "With new: small, hatchback, sedan, estate, suv, van, pickup or quadricycle."),
    ] = None,
    heat_pump: Annotated[
        bool | None, typer.Option("--heat-pump/--no-heat-pump", help="With new: whether the car has one.")
    ] = None,
    procedure: Annotated[
        str | None,
        option(
            "NAME", "With new: where the consumption comes from, wltp or epa (combined label). Default: wltp."
        ),
    ] = None,
    out: Annotated[
        Path | None, option("FILE", "With new: write the TOML to this file.", "--out", "-o")
    ] = None,
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
    name = " ".join(words or []) or None
    given = (mass, battery, consumption, power, body, heat_pump, procedure)
    figures = dict(zip(FIGURES, given, strict=True))
    if name == "new":
        return _new(figures, out)
    require_effect({**figures, "--out": out}, "only together with new")
    return _list(None) if name is None else _find_or_describe(name, preset, overrides or [])


FIGURES: Final = {
    "--mass": "mass_kg",
    "--battery": "usable_battery_kwh",
    "--consumption": "consumption_kwh_per_100km",
    "--power": "motor_power_kw",
    "--body": "body",
    "--heat-pump": "heat_pump",
    "--procedure": "procedure",
}
"""Option -> argument of `describe_car`, in the order of the command's parameters."""


def _new(figures: dict[str, Any], out: Path | None) -> Answer:
    from tripwatt.certification import certified_interval, describe_car
    from tripwatt.vehicles import render_vehicle

    given = {FIGURES[option]: value for option, value in figures.items() if value is not None}
    with places_named({argument: option for option, argument in FIGURES.items()}):
        car = describe_car(**given)
    certified, text = certified_interval(car), render_vehicle(car)
    if out is not None:
        write_text(text, out)
    wltp = {"middle": certified.middle, "low": certified.low, "high": certified.high}
    done = (
        f"{out} is written: {car.title}. On the WLTP it would use {certified.middle:.1f} kWh/100 km; 9 in 10 such cars use "
        f"{certified.low:.1f} to {certified.high:.1f}. Forecast with `tripwatt forecast ROUTE --vehicle {out}`"
    )
    return Answer(
        {"title": car.title, "anchor": car.anchor, "wltp_kwh_per_100km": wltp, "toml": text},
        partial(typer.echo, text, nl=False) if out is None else partial(console().print, done),
    )


def _find_or_describe(name: str, preset: str, overrides: list[str]) -> Answer:
    """Show the car of this name, or else list those that the words find."""
    from tripwatt.vehicles import find_vehicles, vehicle_names

    names = () if name in vehicle_names() or name.endswith(".toml") else find_vehicles(name)
    return _list(names) if names else _describe(name, preset, overrides)


def _describe(name: str, preset: str, overrides: list[str]) -> Answer:
    from rich.padding import Padding

    from tripwatt.vehicles import describe_vehicle, load_vehicle, parse_overrides

    given = parse_overrides(overrides)
    car = load_vehicle(name, preset, given)
    rows = describe_vehicle(name, preset, given)
    keys = ("key", "value", "unit", "source", "licence")
    entries = [dict(zip(keys, row, strict=True)) for row in rows]

    def shown() -> None:
        out = console(sys.stdout)
        out.print(f"{car.title} ({car.name}, preset {car.preset})")
        for key, value, unit, source, licence in rows:
            out.print(f"{key} = {value} {'' if unit == '1' else unit}".rstrip())
            out.print(Padding(f"{source} (licence: {licence})", (0, 0, 0, 4), expand=False))

    return Answer({"name": car.name, "title": car.title, "preset": car.preset, "entries": entries}, shown)


def _list(names: Sequence[str] | None) -> Answer:
    from tripwatt.vehicles import vehicle_titles

    titles = vehicle_titles()
    rows = [(name, titles[name]) for name in (titles if names is None else names)]
    document = [{"name": name, "title": title} for name, title in rows]
    return Answer(document, partial(print_table, "Cars for --vehicle NAME", ("name", "car"), rows))


def simulate(
    logs: Logs,
    trip: TripOption = None,
    vehicle: VehicleOption = None,
    preset: PresetOption = "default",
    overrides: SetOption = None,
) -> Answer:
    """Simulate one logged trip with a car and print the energy by cause beside the measured energy.

    The simulation uses physics only: speed, road, and the state at departure (temperatures, state of charge). The log is
    used without an audit; run `tripwatt audit` to find its faults.

    For example:

      # simulate the first trip of the synthetic fleet
      tripwatt simulate
      # simulate one trip of the TUM set
      tripwatt simulate data/tum --trip TripA01
      # simulate a trip with a cooler cabin
      tripwatt simulate data/tum --trip TripB07 --set setpoint=18
      # simulate your own log with your own car
      tripwatt simulate drive.csv --mapping my.toml --vehicle vw_id3
    """
    from tripwatt.physics import simulate_trip
    from tripwatt.trips import resample
    from tripwatt.trips.messages import flag_to_dict
    from tripwatt.vehicles import load_vehicle, parse_overrides

    name, note = logs.car(vehicle)
    car = load_vehicle(name, preset, parse_overrides(overrides or []))
    fleet = logs.read()
    log = _chosen(fleet, trip, logs.data)
    _require_clock(log)
    run = simulate_trip(car, resample(log))
    distance_km = log.distance_m / 1000.0
    answer = {
        "trip": log.trip_id,
        "vehicle": car.name,
        "preset": car.preset,
        "distance_km": distance_km,
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


def _chosen(fleet: TripSet, trip: str | None, data: Path | None) -> Trip:
    if trip is None and (len(fleet.trips) == 1 or data is None):
        return fleet.trips[0]
    log = next((t for t in fleet.trips if t.trip_id == trip), None)
    if log is None:
        ids = [t.trip_id for t in fleet.trips]
        more = f" and {len(ids) - 12} more" if len(ids) > 12 else ""
        what, got = ("unknown trip", trip) if trip is not None else ("no single trip", f"{len(ids)} trips")
        raise InvalidInput.of(what, "--trip", got, ", ".join(ids[:12]) + more)
    return log


def _require_clock(log: Trip) -> None:
    """A log is simulated as it is, but not without a time that goes on."""
    from tripwatt.trips import value_faults

    columns = log.samples[["time_s"]]
    faults = [*value_faults(columns, log.trip_id)]
    if faults:
        fix = "list the findings with `tripwatt audit`; write one sound drive with `tripwatt mapping apply`"
        raise InvalidInput([replace(fault, fix=fix) for fault in faults])


def _show_simulation(answer: dict[str, Any]) -> None:
    total, distance = answer["simulated_energy_wh"], answer["distance_km"]

    def row(name: str, energy: float) -> tuple[str, ...]:
        per_km = energy / distance if distance > 0 else None
        share = 100.0 * energy / total if total else None
        values = (energy, share, per_km)
        return (name, *("–" if v is None else f"{round(v, 1) + 0.0:.1f}" for v in values))

    rows = [row(cause.replace("_", " "), energy) for cause, energy in answer["by_cause_wh"].items()]
    rows.append(row("simulated, total", total))
    if answer["observed_energy_wh"] is not None:
        rows.append(row("measured", answer["observed_energy_wh"]))
    columns = ("energy", "Wh", "%", "Wh/km")
    title = f"{answer['trip']}: {distance:.1f} km in {answer['duration_s'] / 60.0:.0f} min with {answer['vehicle']}, preset {answer['preset']}"
    print_table(title, columns, rows, numbers=columns[1:])
    shown, error_wh = console(sys.stdout), answer["observed_energy_std_wh"]
    if error_wh is not None:
        shown.print(f"measured: from the state of charge, standard error {error_wh:.0f} Wh")
    ends = (f"{100.0 * answer[f'soc_at_{end}']:.1f} % at {end}" for end in ("departure", "arrival"))
    shown.print(f"state of charge: {', '.join(ends)} (simulated)")
    print_notes(flag["message"] for flag in (*answer["flags"], *answer["notes"]))
