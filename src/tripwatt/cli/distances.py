"""Commands without a road: what some kilometres need, how far a charge carries."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tripwatt.cli.departing import DepartureOf, departure_options
from tripwatt.cli.journey import CarOption, ModelOption
from tripwatt.cli.options import JsonOption, argument, option, options_named
from tripwatt.cli.printing import print_few_notes, print_json, print_table
from tripwatt.cli.sentences import begins
from tripwatt.errors import InvalidInput

KindOption = Annotated[
    str, option("KIND", "city, country, motorway, or mixed: nothing is known of the road.", "--kind")
]
OwnCarOption = Annotated[Path | None, option("FOLDER", "Your own car, made by `tripwatt car new`.", "--car")]
ReserveOption = Annotated[float, option("0..1", "State of charge to keep.")]


@departure_options()
def need(
    departure: DepartureOf,
    distance: Annotated[list[str] | None, argument("DISTANCE [km]", "Kilometres of each trip.")] = None,
    kind: KindOption = "mixed",
    quantile: Annotated[float, option("0.5..1", "Probability with which the energy suffices.")] = 0.9,
    trips: Annotated[int, option("N", "Equal trips ahead; their errors are shared.", min=1, max=100)] = 1,
    car: OwnCarOption = None,
    trip: Annotated[
        str | None, option("NAME", "A usual trip of your own car, in place of the distance.", "--trip")
    ] = None,
    plug: Annotated[
        float, option("W", "Power of the plug at home; 0: the car is not plugged in.", min=0.0)
    ] = 7400.0,
    reserve: ReserveOption = 0.0,
    vehicle: CarOption = None,
    model: ModelOption = None,
    as_json: JsonOption = False,
) -> None:
    """Forecast what some kilometres need, without a road: energy and charge, with a margin, and what to do until then.

    For example:

      # 50 km tomorrow at -5 degrees
      tripwatt need 50 km --ambient -5
      # five days to work and back on the motorway, enough in 19 of 20 weeks
      tripwatt need 80 km --kind motorway --trips 5 --quantile 0.95 --vehicle vw_id3
      # by when to charge, and when to preheat
      tripwatt need 50 km --ambient -5 --soc 0.3 --depart 07:30 --plug 3700 --json
      # a usual trip of your own car
      tripwatt need --car cars/my-leaf --trip 2026-01-12T07-30 --ambient -5
    """
    from tripwatt.advice.preheating import need_before_departure

    with options_named():
        if (distance is None) == (trip is None) or (trip is not None and car is None):
            got = "both" if distance and trip else "a trip without its car" if trip else "neither"
            allowed = "a distance, or --trip with --car"
            raise InvalidInput.of(
                "what is to be driven", "DISTANCE, --trip", got, allowed, "tripwatt need 50 km"
            )
        own = _own(car, vehicle, model)
        again = own.pop("plan", None)
        ahead: Any = again(trip) if trip else _kilometres(distance or [])
        known, more = departure(), {"quantile": quantile, "trips": trips, "reserve": reserve}
        found, until = need_before_departure(ahead, kind, known, plug, **more, **own)
    if as_json:
        print_json(found.to_dict() | until)
        return
    low, high = (wh / 1000.0 for wh in found.interval_wh)
    rows = [
        ("energy, median and 9 in 10", f"{found.energy_wh / 1000.0:.2f} kWh ({low:.2f} to {high:.2f})"),
        (f"enough in {quantile:.0%}", f"{found.energy_quantile_wh / 1000.0:.2f} kWh"),
        ("charge for it", f"{100.0 * found.soc_needed:.0f} %"),
    ]
    if until["charging_s"]:
        rows.append(
            ("on the plug", f"{until['wall_wh'] / 1000.0:.2f} kWh, {until['charging_s'] / 3600.0:.1f} h")
        )
    if until["preheat"]:
        rows.append(("preheat", begins(until["preheat"]["before_s"], known.departs_at)))
    print_table(f"{found.distance_m / 1000.0:.1f} km, {found.kind}, {found.car}", ("what", "value"), rows)
    typer.echo(until["message"])
    print_few_notes(found.flags)


@departure_options()
def range_(
    departure: DepartureOf,
    kind: KindOption = "mixed",
    reserve: ReserveOption = 0.0,
    car: OwnCarOption = None,
    vehicle: CarOption = None,
    model: ModelOption = None,
    as_json: JsonOption = False,
) -> None:
    """Forecast how far a charge carries, without a road, by kind of road.

    For example:

      # how far with 35 % at 5 degrees
      tripwatt range --soc 0.35 --ambient 5
      # keep 10 %, as data
      tripwatt range --soc 0.8 --reserve 0.1 --vehicle vw_id3 --json
    """
    from tripwatt.journey import range_km

    with options_named():
        own = _own(car, vehicle, model)
        own.pop("plan", None)
        found = range_km(None, kind, departure(), reserve=reserve, **own)
    if as_json:
        print_json(found.to_dict())
        return
    rows = [
        (name, f"{middle / 1000.0:.0f} km", f"{ends[0] / 1000.0:.0f} to {ends[1] / 1000.0:.0f} km")
        for name, (middle, ends) in found.by_kind.items()
    ]
    title = f"Range from {found.soc:.0%} down to {found.reserve:.0%}"
    print_table(title, ("kind of road", "median", "9 in 10"), rows, numbers=("median",))
    print_few_notes(found.flags)


def _own(car: Path | None, vehicle: str | None, model: Path | None) -> dict[str, Any]:
    if car is None:
        return {"model": model, "vehicle": vehicle}
    from tripwatt.live import open_car
    from tripwatt.live.usual import usual_plan

    if vehicle is not None or model is not None:
        raise InvalidInput.of("two cars", "--car", "--vehicle or --model too", "one of them")
    own = open_car(car)
    return {"model": own.model(), "plan": lambda trip: usual_plan(own, trip)}


def _kilometres(words: list[str]) -> float:

    text = "".join(words).lower()
    try:
        return float(text.removesuffix("km"))
    except ValueError:
        raise InvalidInput.of("not a distance", "DISTANCE", text[:40], "kilometres", "50 km") from None
