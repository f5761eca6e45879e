"""Commands on a trip: forecast it, update the forecast, say what to do about it, write an example trip."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, option
from tripwatt.command.output import write_text
from tripwatt.command.printing import kwh, print_few_notes, print_notes, print_table, say
from tripwatt.command.sentences import (
    begins,
    by_cause,
    chance,
    chance_to_arrive,
    forecast_in_words,
    unknown_climb_in_words,
)
from tripwatt.errors import Check, InvalidInput
from tripwatt.files import csv_text
from tripwatt.trips.columns import require_fraction
from tripwatt.trips.showing import period
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
    with shared.options_named():
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
    say(forecast_in_words(forecast, subject), *unknown_climb_in_words(forecast, reserve))
    chance = chance_to_arrive(forecast, reserve)
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
    write_text(csv_text(shared.one_trip(sample.trips, trip).samples), out)
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
    "pump_up": "pump up the tyres, from {value:.0%} to all of the recommended pressure",
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
    with shared.options_named():
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
            words, minutes = _in_words(advised, leaves), advised.difference.duration_s / SECONDS_PER_MINUTE
            longer = f", {minutes:.0f} min longer" if minutes >= 0.5 else ""
            say(f"{words[0].upper()}{words[1:]}: {chance(advised.p_arrive)}{longer}.")
        if not advice.least:
            say("No three actions together are enough.")
        percent = math.ceil(100.0 * advice.charge_to - 1e-6)
        to = f"Charge to {percent} % for a probability of {100.0 * advice.probability:.0f} %."
        full = "A full battery is not enough: plan a stop to charge with `tripwatt plan`."
        say(to if advice.charge_to <= 1.0 else full)
    say("")
    rows = [
        (
            _in_words(advised, leaves),
            _kwh(-advised.difference.energy_wh),
            " to ".join(_kwh(-end) for end in reversed(advised.difference.interval())),
            f"{advised.difference.duration_s / SECONDS_PER_MINUTE:+.0f} min",
            f"{100.0 * advised.difference.soc_arrival:+.0f} %",
            chance(advised.p_arrive),
            advised.effort,
            _kwh(advised.wall_wh) if advised.wall_wh else "-",
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
                _kwh(cap.saved_wh),
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
    when = begins(action.before_s, departs_at)
    return WORDS[action.code].format(value=value, km_h=value / M_S_PER_KM_H, begins=when)


def _kwh(wh: float) -> str:
    return f"{wh / 1000.0:.2f}"
