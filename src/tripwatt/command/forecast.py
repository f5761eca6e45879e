"""Commands that forecast: a trip, with its update and advice, or a distance and a range without a road; they write an example trip."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, option
from tripwatt.command.printing import kwh, print_few_notes, print_notes, print_table, say
from tripwatt.command.sentences import (
    begins,
    by_cause,
    chance,
    chance_to_arrive,
    forecast_in_words,
    unknown_climb_in_words,
)
from tripwatt.errors import Check, InvalidInput, percent
from tripwatt.files import csv_text
from tripwatt.trips.columns import require_fraction
from tripwatt.trips.showing import in_kwh, period
from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_MINUTE

if TYPE_CHECKING:
    from tripwatt.forecasting.document import LeaveWith
    from tripwatt.roads.advice import Action, Advised

LEAVE_PROBABILITY: Final = 0.95
"""Probability that the charge of "leave with" suffices: 19 of 20 trips."""


def forecast(
    paths: Annotated[
        list[Path],
        argument(
            "[MODEL] TRIP",
            "Folder of a model (default: the bundled model), and a trip: a speed trace or a planned route. "
            "Speed trace: a logger's file, or CSV or Parquet with time_s, speed_m_s, and optionally elevation_m or grade; of other "
            "signals the first sample counts. Planned route: GPX, KML, GeoJSON, the saved response of OSRM, Valhalla, openrouteservice or "
            "GraphHopper, or links as CSV or JSON (length_m, speed_m_s or travel_time_s, and optionally grade or "
            "start_elevation_m and end_elevation_m, stop_s, speed_limit_m_s).",
        ),
    ],
    departure: shared.DepartingNow,
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
      tripwatt forecast ride.gpx --car vw_id3 --soc 0.8
    """
    from tripwatt.forecasting.leaving import leave_with
    from tripwatt.sources.canonical import read_canonical

    model, trip = model_and_trip(paths)
    speed_m_s = None if speed is None else speed * M_S_PER_KM_H
    with shared.options_named(**{"--model": "MODEL"}):
        with Check() as check:
            check(require_fraction, "reserve", reserve)
            plan = check(shared.read_plan, trip, speed_m_s)
            read = partial(read_canonical, required=("time_s",), minimum=2)
            measured = None if observed is None else check(read, observed)
            car, known, fitted = shared.checked(check, vehicle, departure, model)
        expected = tw.for_car(fitted, car).forecast(plan, known)
    if measured is not None:
        expected = expected.update(measured)
    leave = leave_with(expected, reserve, LEAVE_PROBABILITY) if observed is None else None
    shown = partial(_show_forecast, expected, reserve, leave)
    return Answer(partial(expected.to_dict, reserve, leave), shown)


def model_and_trip(paths: list[Path]) -> tuple[Path | None, Path]:
    """Split the arguments `[MODEL] TRIP`; the model is None if it is not given."""
    if len(paths) > 2:
        got, allowed = " ".join(map(str, paths)), "a folder with a model and a file with a trip"
        raise InvalidInput.of("too many arguments", "MODEL TRIP", got, allowed)
    *model, trip = paths
    return (model[0] if model else None), trip


def show_arrival(forecast: tw.Forecast, subject: str, reserve: float) -> None:
    """Print a forecast for a driver: energy, charge at arrival, the probability to arrive with the reserve."""
    said, chance = forecast_in_words(forecast, subject), chance_to_arrive(forecast, reserve)
    say(said, *unknown_climb_in_words(forecast, reserve))
    if reserve > 0.0 or chance not in said:
        say(f"The probability to arrive with {100.0 * reserve:g} % or more is {chance}.")


def _show_forecast(forecast: tw.Forecast, reserve: float, leave: LeaveWith | None) -> None:
    show_arrival(forecast, forecast.plan.trip_id, reserve)
    when = f"after {period(forecast.measured_until_s)}"
    if leave is not None:
        when = "before departure"
        say(leave["message"])
    say("")
    causes = [(cause, kwh(energy, 3, "+")) for cause, energy in by_cause(forecast.by_cause_wh).items()]
    causes.append(("in all", kwh(forecast.energy_wh, 3, "+")))
    title = f"{forecast.vehicle.title}, {when}, given {forecast.given}"
    print_table(title, ("cause", "energy"), causes, numbers=("energy",))
    print_notes(forecast.flags)


def example_trip(
    out: shared.OutFile = Path("trip.csv"),
    trip: Annotated[str, option("ID", "Trip of the sample of the TUM set.")] = "TripB37",
) -> None:
    """Write a real trip of the package as a CSV table, as an input for `tripwatt forecast`.

    For example:

      # write an example trip for `tripwatt forecast trip.csv`
      tripwatt example-trip
    """
    sample = tw.sample_trips()
    shared.write_text(csv_text(shared.one_trip(sample.trips, trip).samples), out)
    print_notes([f"{out}: {trip} of {sample.citation}"])


WORDS: Final[Mapping[str, str]] = {
    "slower": "drive {km_h:.0f} km/h at most",
    "calmer": "accelerate and brake gently",
    "setpoint": "set the cabin to {value:.0f} °C",
    "seats": "heat the seats in place of the cabin",
    "climate_off": "switch off climate control",
    "preheat_cabin": "set the cabin to {value:.0f} °C on the plug, {begins}",
    "no_roof_box": "take off the roof box",
    "summer_tyres": "fit summer tyres",
    "pump_up": "pump up the tyres, from {share} to all of the recommended pressure",
    "less_luggage": "leave {value:.0f} kg at home",
}
"""Code of an action -> words for it."""


def advise(
    paths: Annotated[
        list[Path], argument("[MODEL] TRIP", "As for `tripwatt forecast`: a model, and a trip.")
    ],
    departure: shared.Departing,
    vehicle: shared.Car = None,
    reserve: shared.Reserve = 0.1,
    probability: Annotated[float, option("0.5..0.999", "Wanted probability to arrive.", "--chance")] = 0.95,
) -> Answer:
    """Say what to do about a trip: the least that helps, and what each action saves.

    Savings are more certain than the total: each has an interval of its own.

    For example:

      # is the charge enough, and what is the least that helps?
      tripwatt advise route.json --soc 0.5 --ambient -5
      # with a roof box, for another car, as data
      tripwatt advise route.json --soc 0.5 --extra roof_box --car vw_id3 --json
    """
    model, trip = model_and_trip(paths)
    with shared.options_named(**{"--model": "MODEL"}):
        with Check() as check:
            plan = check(shared.read_plan, trip)
            car, known, fitted = shared.checked(check, vehicle, departure, model)
        advice = tw.advise(plan, known, car, fitted, reserve=reserve, probability=probability)
    return Answer(advice.to_dict, partial(_show_advice, advice))


def _show_advice(advice: tw.Advice) -> None:
    show_arrival(advice.forecast, advice.forecast.plan.trip_id, advice.reserve)
    leaves = advice.forecast.plan.departure.departs_at
    if advice.p_arrive < advice.probability:
        for advised in advice.least:
            words, longer_s = _in_words(advised, leaves), advised.difference.duration_s
            longer = f", {period(longer_s)} longer" if longer_s >= 0.5 * SECONDS_PER_MINUTE else ""
            say(f"{words[0].upper()}{words[1:]}: {chance(advised.p_arrive)}{longer}.")
        if not advice.least:
            rare = "One that brings fewer than 1 in 20 such trips there is not listed: give a higher --soc."
            say(f"No three actions together are enough. {rare}")
        full_percent = math.ceil(100.0 * advice.charge_to - 1e-6)
        to = f"Charge to {full_percent} % for a probability of {percent(advice.probability)}."
        full = "A full battery is not enough: plan a stop to charge with `tripwatt plan`."
        say(to if advice.charge_to <= 1.0 else full)
    say("")
    rows = [
        (
            _in_words(advised, leaves),
            in_kwh(-advised.difference.energy_wh),
            " to ".join(in_kwh(-end) for end in reversed(advised.difference.interval())),
            f"{advised.difference.duration_s / SECONDS_PER_MINUTE:+.0f} min",
            percent(advised.difference.soc_arrival, sign="+"),
            chance(advised.p_arrive),
            advised.effort,
            in_kwh(advised.wall_wh) if advised.wall_wh else "-",
            advised.saves,
        )
        for advised in advice.singly
    ]
    names = ("action", "saves kWh", "9 in 10", "time", "charge", "arrives", "effort", "plug kWh", "gains")
    if rows:
        print_table("What saves energy", names, rows, numbers=(names[1], names[3], names[4]))
    if advice.speeds:
        caps = [
            (
                f"{cap.speed_m_s / M_S_PER_KM_H:.0f}",
                f"{cap.longer_s / SECONDS_PER_MINUTE:+.0f} min",
                in_kwh(cap.saved_wh),
                f"{cap.charging_w / 1000.0:.0f}",
            )
            for cap in advice.speeds
        ]
        heads = ("at most km/h", "time", "saves kWh", "faster overall if you charge below kW")
        print_table("Limit the speed", heads, caps, numbers=heads)
    print_few_notes(advice.forecast.flags)


def _in_words(advised: Advised, leaves: dt.datetime | None) -> str:
    return " and ".join(in_words(action, leaves) for action in advised.actions)


def in_words(action: Action, departs_at: dt.datetime | None = None) -> str:
    """Describe an action as an imperative."""
    value = action.value or 0.0
    when, share = begins(action.before_s, departs_at), percent(value)
    return WORDS[action.code].format(value=value, km_h=value / M_S_PER_KM_H, share=share, begins=when)


@dataclass(frozen=True)
class Drive:
    """Options about the road and the car."""

    kind: Annotated[str, option("KIND", "Road: city, country, motorway, or mixed if unknown.")] = "mixed"
    reserve: shared.Reserve = 0.1
    car: shared.Car = None
    model: shared.Model = None

    def own(self) -> tuple[dict[str, Any], Callable[[str], tw.Plan] | None]:
        """Return the car as keyword arguments of `need` and `range_km`, and for a user's own car what plans its trips."""
        found = shared.model_and_car(self.model, self.car)
        return found, None if found["car"] == self.car else tw.open_car(f"{self.car}").usual_plan


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
        if 0.0 < plug < 500.0:
            fix = f"the value is in watts: --plug {1000.0 * plug:g}"
            raise InvalidInput.of("too little power", "--plug", f"{plug:g} W", "0, or 500 W or more", fix)
        car, again = drive.own()
        if (distance is None) == (trip is None) or (trip is not None and again is None):
            got = "both" if distance and trip else "a trip without its own car" if trip else "neither"
            allowed, fix = "a distance, or --trip with --car FOLDER", "tripwatt need 50 km"
            raise InvalidInput.of("what is to be driven", "DISTANCE, --trip", got, allowed, fix)
        ahead: Any = again(trip) if again and trip else _kilometres(distance or [])
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
    _show_doubt(result, result.kind)


def range_(departure: shared.Departing, drive: Drive) -> Answer:
    """Forecast how far a charge carries, without a road, by kind of road.

    For example:

      # how far with 35 % at 5 degrees
      tripwatt range --soc 0.35 --ambient 5
      # keep 10 %, as data
      tripwatt range --soc 0.8 --reserve 0.1 --car vw_id3 --json
    """
    with shared.options_named():
        result = tw.range_km(None, drive.kind, departure(), reserve=drive.reserve, **drive.own()[0])
    return Answer(result.to_dict, partial(_show_range, result, drive.kind))


def _show_range(result: tw.Range, kind: str) -> None:
    if result.soc <= result.reserve:
        charge, reserve = 100.0 * result.soc, 100.0 * result.reserve
        say(f"No range is left: the charge of {charge:g} % is not above the reserve of {reserve:g} %.")
        return
    rows = []
    for name, far in result.by_kind.items():
        lengths_m = far.range_m, *far.half_m, far.interval_m[0]
        likely, low, high, least = (f"{length / 1000.0:.0f}" for length in lengths_m)
        rows.append((name, f"{likely} km", f"{low} to {high} km", f"{least} km"))
    title = f"Range from {percent(result.soc)} down to {percent(result.reserve)}"
    heads = ("kind of road", "likely", "middle half", "19 of 20 times at least")
    print_table(title, heads, rows, numbers=(heads[1], heads[3]))
    _show_doubt(result, kind)


_NARROWS: Final = {
    "ambient_temperature_degc": "The outside temperature (--ambient)",
    "kind": "The kind of road (--kind)",
    "own trips": "Trips of your own car (tripwatt car new)",
}


def _show_doubt(result: tw.Need | tw.Range, kind: str) -> None:
    """Say which causes contribute to the interval on a kind of road, and what would narrow it most; then the notes."""
    doubt = result.doubt
    shares = ", ".join(f"{n} {percent(getattr(doubt, n))}" for n in ("car", "road", "weather", "day"))
    answered = isinstance(result, tw.Range) and doubt.narrows == "kind"  # the table has every kind
    narrows = "" if answered else _NARROWS.get(doubt.narrows or "")
    most = f" {narrows} would narrow it most, by up to {percent(doubt.narrower)}." if narrows else ""
    say(f"Shares of the uncertainty, {kind}: {shares}.{most}")
    print_few_notes(result.flags)


def _kilometres(words: list[str]) -> float:
    text = "".join(words).lower()
    try:
        return float(text.removesuffix("km"))
    except ValueError:
        raise InvalidInput.of("not a distance", "DISTANCE", text[:40], "kilometres", "50 km") from None
