"""Commands without a road: the energy that a distance needs, and the range of a charge."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, option, require_effect
from tripwatt.command.printing import kwh, print_few_notes, print_table, say
from tripwatt.command.sentences import begins, share
from tripwatt.errors import InvalidInput
from tripwatt.trips.showing import period

CAR: Final = f"{shared.ANOTHER} Or the folder of your own car (`tripwatt car new`)."


@dataclass(frozen=True)
class Drive:
    """Options about the road and the car."""

    kind: Annotated[str, option("KIND", "Road: city, country, motorway, or mixed if unknown.")] = "mixed"
    reserve: shared.Reserve = 0.1
    car: Annotated[str | None, option("NAME|FILE|FOLDER", CAR, "--car")] = None
    model: shared.Model = None

    def own(self) -> dict[str, Any]:
        """Return the car as keyword arguments of `need` and `range_km`; for a user's own car also `plan`, which plans its trips."""
        if self.car is None or not Path(self.car).is_dir():
            return {"model": self.model, "car": self.car}
        require_effect({"--model": self.model}, "only without the folder of a car")
        own = tw.open_car(self.car)
        return {"model": own.model(), "plan": own.usual_plan}


def need(
    departure: shared.Departing,
    drive: Drive,
    distance: Annotated[list[str] | None, argument("DISTANCE [km]", "Kilometres of each trip.")] = None,
    probability: shared.Probability = 0.95,
    trips: Annotated[int, option("N", "Number of equal trips.", min=1, max=100)] = 1,
    trip: Annotated[str | None, option("NAME", "A trip of your own car in place of the distance.")] = None,
    plug: shared.Plug = 7400.0,
) -> Answer:
    """Forecast what a distance takes, without a road: energy and charge with a margin, and when to charge and preheat.

    For example:

      # 50 km tomorrow at -5 degrees
      tripwatt need 50 km --ambient -5
      # five days to work and back on the motorway, enough in 9 of 10 weeks
      tripwatt need 80 km --kind motorway --trips 5 --probability 0.9 --car vw_id3
      # by when to charge, and when to preheat
      tripwatt need 50 km --ambient -5 --soc 0.3 --depart 07:30 --plug 3700 --json
      # a usual trip of your own car
      tripwatt need --car cars/my-leaf --trip 2026-01-12T07-30 --ambient -5
    """
    from tripwatt.roads.advice.preheating import need_before_departure

    with shared.options_named():
        car = drive.own()
        again = car.pop("plan", None)
        if (distance is None) == (trip is None) or (trip is not None and again is None):
            got = "both" if distance and trip else "a trip without its own car" if trip else "neither"
            allowed, fix = "a distance, or --trip with --car FOLDER", "tripwatt need 50 km"
            raise InvalidInput.of("what is to be driven", "DISTANCE, --trip", got, allowed, fix)
        ahead: Any = again(trip) if trip else _kilometres(distance or [])
        known, asked = departure(), {"probability": probability, "trips": trips, "reserve": drive.reserve}
        result, document = need_before_departure(ahead, drive.kind, known, plug, **asked, **car)
        document |= {"usual_trip": trip} | ({"car": Path(f"{drive.car}").name} if again else {})
    return Answer(document, partial(_show_need, result, trips, document, known.departs_at))


def _show_need(result: tw.Need, trips: int, answer: Mapping[str, Any], leaves: dt.datetime | None) -> None:
    lower, upper = map(kwh, result.half_wh)
    rows = [
        ("likely", kwh(result.energy_wh)),
        ("middle half", f"{lower.removesuffix(' kWh')} to {upper}"),
        (f"cautious ({100.0 * result.probability:g} %)", kwh(result.energy_quantile_wh)),
    ]
    if answer["charging_s"]:
        power = f"{answer['charging_w'] / 1e3:.3g} kW"
        rows.append(("on the plug", f"{kwh(answer['wall_wh'])} at {power}, {period(answer['charging_s'])}"))
    if answer["preheat"]:
        rows.append(("preheat", begins(answer["preheat"]["before_s"], leaves)))
    times = f"{trips} trips of " if trips > 1 else ""
    title = f"{times}{result.distance_m / 1000.0 / trips:.1f} km, {result.kind}, {result.title}"
    print_table(title, ("what", "value"), rows)
    say(answer["message"])
    _show_doubt(result)


def range_(departure: shared.Departing, drive: Drive) -> Answer:
    """Forecast how far a charge carries, without a road, by kind of road.

    For example:

      # how far with 35 % at 5 degrees
      tripwatt range --soc 0.35 --ambient 5
      # keep 10 %, as data
      tripwatt range --soc 0.8 --reserve 0.1 --car vw_id3 --json
    """
    with shared.options_named():
        car = drive.own()
        car.pop("plan", None)
        result = tw.range_km(None, drive.kind, departure(), reserve=drive.reserve, **car)
    return Answer(result.to_dict, partial(_show_range, result))


def _show_range(result: tw.Range) -> None:
    if result.soc <= result.reserve:
        charge, reserve = 100.0 * result.soc, 100.0 * result.reserve
        say(f"No range is left: the charge of {charge:g} % is not above the reserve of {reserve:g} %.")
        return
    rows = []
    for name, far in result.by_kind.items():
        lengths_m = far.range_m, *far.half_m, far.interval_m[0]
        likely, low, high, least = (f"{length / 1000.0:.0f}" for length in lengths_m)
        rows.append((name, f"{likely} km", f"{low} to {high} km", f"{least} km"))
    title = f"Range from {share(result.soc, 0)} down to {share(result.reserve, 0)}"
    heads = ("kind of road", "likely", "middle half", "19 of 20 times at least")
    print_table(title, heads, rows, numbers=(heads[1], heads[3]))
    _show_doubt(result)


_NARROWS: Final = {
    "ambient_temperature_degc": "The outside temperature (--ambient)",
    "kind": "The kind of road (--kind)",
    "own trips": "Trips of your own car (tripwatt car new)",
}


def _show_doubt(result: tw.Need | tw.Range) -> None:
    """Say which causes contribute to the interval, and what information would narrow it most; then the notes."""
    doubt = result.doubt
    shares = ", ".join(f"{n} {share(getattr(doubt, n), 0)}" for n in ("car", "road", "weather", "day"))
    answered = isinstance(result, tw.Range) and doubt.narrows == "kind"  # the table has every kind
    narrows = "" if answered else _NARROWS.get(doubt.narrows or "")
    most = f" {narrows} would narrow it most, by up to {share(doubt.narrower, 0)}." if narrows else ""
    say(f"Shares of the uncertainty: {shares}.{most}")
    print_few_notes(result.flags)


def _kilometres(words: list[str]) -> float:
    text = "".join(words).lower()
    try:
        return float(text.removesuffix("km"))
    except ValueError:
        raise InvalidInput.of("not a distance", "DISTANCE", text[:40], "kilometres", "50 km") from None
