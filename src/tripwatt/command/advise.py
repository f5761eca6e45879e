"""What to do about a trip on the command line."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from tripwatt.command.departing import Departing
from tripwatt.command.forecast import model_and_trip
from tripwatt.command.journey import CarOption
from tripwatt.command.options import Answer, argument, model_of, option, options_named
from tripwatt.command.printing import print_few_notes, print_table
from tripwatt.command.sentences import begins, chance
from tripwatt.errors import Check

if TYPE_CHECKING:
    from tripwatt.roads.advice import Action, Advice, Advised, SpeedCap

WORDS: Final[Mapping[str, str]] = {
    "slower": "drive {km_h:.0f} km/h at most",
    "calmer": "accelerate and brake gently",
    "setpoint": "set the cabin to {value:.0f} °C",
    "seats": "heat the seats in place of the cabin",
    "climate_off": "switch off climate control",
    "preheat_cabin": "set the cabin to {value:.0f} °C on the plug, {begins}",
    "preheat_battery": "warm the battery to {value:.0f} °C on the plug, {begins}",
    "no_roof_box": "take off the roof box",
    "summer_tyres": "fit summer tyres",
    "check_tyres": "check the tyres if it has been two months",
    "pump_up": "pump up the tyres, from {value:.0%} to all of the recommended pressure",
    "stop": "stop {value:.0f} times to charge",
    "less_luggage": "leave {value:.0f} kg at home",
    "other_road": "take road {road:.0f}",
    "leave_later": "leave {hours:+.0f} h later",
}
"""Actions in words, by code."""


def advise(
    paths: Annotated[
        list[Path],
        argument(
            "[MODEL] TRIP",
            "Folder of a model (default: the bundled model), and a trip: a speed trace or a planned route, as for `tripwatt forecast`.",
        ),
    ],
    departure: Departing,
    vehicle: CarOption = None,
    reserve: Annotated[float, option("0..1", "Required state of charge at arrival, as displayed.")] = 0.1,
    probability: Annotated[
        float, option("0.5..1", "Chance to arrive with the reserve that is asked for.", "--chance")
    ] = 0.95,
) -> Answer:
    """Say what to do about a trip: the least that helps, and what each action saves.

    Savings are more certain than the total: each has an interval of its own.

    For example:

      # is the charge enough, and what is the least that helps?
      tripwatt advise route.json --soc 0.5 --ambient -5
      # with a roof box, for another car, as data
      tripwatt advise route.json --soc 0.5 --extra roof_box --vehicle vw_id3 --json
    """
    from tripwatt.api import read_route
    from tripwatt.roads.advice import advise as find_advice
    from tripwatt.vehicles import load_vehicle

    model, trip = model_and_trip(paths)
    with options_named():
        with Check() as check:
            plan, fitted = check(read_route, trip), check(model_of, model)
            car = None if vehicle is None else check(load_vehicle, vehicle)
            known = check(departure)
        found = find_advice(plan, known, car, fitted, reserve=reserve, chance=probability)
    return Answer(found.to_dict, partial(_show, found))


def _show(advice: Advice) -> None:
    arrival, now = 100.0 * advice.forecast.soc_arrival, chance(advice.p_arrive)
    typer.echo(
        f"You arrive with {arrival:.0f} %. The chance of {100.0 * advice.reserve:.0f} % or more is {now}."
    )
    if advice.p_arrive < advice.chance:
        for advised in advice.least:
            words = _all(advised, advice)
            typer.echo(f"{words[0].upper()}{words[1:]}: {chance(advised.p_arrive)}{_longer(advised)}.")
        if not advice.least:
            typer.echo("No three actions together are enough.")
        full = "A full battery is not enough: plan a stop to charge with `tripwatt plan`."
        percent = math.ceil(100.0 * advice.charge_to - 1e-6)
        to = f"Charge to {percent} % for a chance of {100.0 * advice.chance:.0f} %."
        typer.echo(to if advice.charge_to <= 1.0 else full)
    typer.echo("")
    rows = [
        (
            _all(advised, advice),
            _kwh(-advised.difference.energy_wh),
            f"{_kwh(-advised.difference.interval()[1])} to {_kwh(-advised.difference.interval()[0])}",
            f"{advised.difference.duration_s / 60.0:+.0f} min",
            f"{100.0 * advised.difference.soc_arrival:+.0f} %",
            chance(advised.p_arrive),
            advised.effort,
            f"{_kwh(advised.wall_wh)}" if advised.wall_wh else "-",
        )
        for advised in advice.singly
    ]
    names = ("action", "saves kWh", "9 in 10", "time", "charge", "arrives", "effort", "from the plug kWh")
    print_table("What saves energy", names, rows, numbers=(names[1], names[3], names[4]))
    if advice.speeds:
        _show_speeds(advice.speeds)
    print_few_notes(advice.forecast.flags)


def _show_speeds(speeds: Sequence[SpeedCap]) -> None:
    rows = [
        (
            f"{3.6 * cap.speed_m_s:.0f}",
            f"{cap.longer_s / 60.0:+.0f} min",
            _kwh(cap.saved_wh),
            f"{cap.charging_w / 1000.0:.0f}",
        )
        for cap in speeds
    ]
    names = ("at most km/h", "time", "saves kWh", "quicker with charging below kW")
    print_table("Speeds to keep", names, rows, numbers=names)


def _all(advised: Advised, advice: Advice) -> str:
    leaves = advice.forecast.plan.departure.departs_at
    return " and ".join(in_words(action, leaves) for action in advised.actions)


def in_words(action: Action, departs_at: dt.datetime | None = None) -> str:
    """An action as an imperative."""
    value, when = action.value or 0.0, begins(action.before_s, departs_at)
    return WORDS[action.code].format(
        value=value, road=value + 1.0, hours=value / 3600.0, km_h=3.6 * value, begins=when
    )


def _longer(advised: Advised) -> str:
    minutes = advised.difference.duration_s / 60.0
    return f", {minutes:.0f} min longer" if minutes >= 0.5 else ""


def _kwh(wh: float) -> str:
    return f"{wh / 1000.0:.2f}"
