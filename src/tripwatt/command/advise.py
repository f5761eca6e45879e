"""`tripwatt advise`: what to do about a trip."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

import tripwatt as tw
from tripwatt.command import shared
from tripwatt.command.departing import Departing
from tripwatt.command.forecast import model_and_trip
from tripwatt.command.options import Answer, argument, option
from tripwatt.command.printing import print_few_notes, print_table
from tripwatt.command.sentences import begins, chance
from tripwatt.errors import Check
from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_MINUTE

if TYPE_CHECKING:
    from tripwatt.roads.advice import Action, Advised

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
        list[Path],
        argument(
            "[MODEL] TRIP",
            "Folder of a model (default: the bundled model), and a trip: a speed trace or a planned route, as for `tripwatt forecast`.",
        ),
    ],
    departure: Departing,
    vehicle: shared.Car = None,
    reserve: shared.Reserve = 0.1,
    probability: Annotated[float, option("0.5..1", "Wanted probability to arrive.", "--chance")] = 0.95,
) -> Answer:
    """Say what to do about a trip: the least that helps, and what each action saves.

    Savings are more certain than the total: each has an interval of its own.

    For example:

      # is the charge enough, and what is the least that helps?
      tripwatt advise route.json --soc 0.5 --ambient -5
      # with a roof box, for another car, as data
      tripwatt advise route.json --soc 0.5 --extra roof_box --vehicle vw_id3 --json
    """
    model, trip = model_and_trip(paths)
    with shared.options_named():
        with Check() as check:
            plan, fitted = check(tw.read_route, trip), check(shared.model_of, model)
            car = vehicle and check(tw.load_vehicle, vehicle)
            known = check(departure)
        advice = tw.advise(plan, known, car, fitted, reserve=reserve, chance=probability)
    return Answer(advice.to_dict, partial(_show, advice))


def _show(advice: tw.Advice) -> None:
    arrival, now = 100.0 * advice.forecast.soc_arrival, chance(advice.p_arrive)
    typer.echo(
        f"You arrive with {arrival:.0f} %. The probability of {100.0 * advice.reserve:.0f} % or more is {now}."
    )
    leaves = advice.forecast.plan.departure.departs_at
    if advice.p_arrive < advice.chance:
        for advised in advice.least:
            words, longer_s = _in_words(advised, leaves), advised.difference.duration_s
            longer = (
                f", {longer_s / SECONDS_PER_MINUTE:.0f} min longer"
                if longer_s >= SECONDS_PER_MINUTE / 2.0
                else ""
            )
            typer.echo(f"{words[0].upper()}{words[1:]}: {chance(advised.p_arrive)}{longer}.")
        if not advice.least:
            typer.echo("No three actions together are enough.")
        percent = math.ceil(100.0 * advice.charge_to - 1e-6)
        to = f"Charge to {percent} % for a probability of {100.0 * advice.chance:.0f} %."
        full = "A full battery is not enough: plan a stop to charge with `tripwatt plan`."
        typer.echo(to if advice.charge_to <= 1.0 else full)
    typer.echo("")
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
    names = (
        "action",
        "saves kWh",
        "9 in 10",
        "time",
        "charge",
        "arrives",
        "effort",
        "from the plug kWh",
        "gains",
    )
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
