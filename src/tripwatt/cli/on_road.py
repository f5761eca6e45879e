"""`tripwatt live`: follow a car over MQTT."""

from __future__ import annotations

import asyncio
import json
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from tripwatt.cli.options import JsonOption, argument, model_of, option, require_extras
from tripwatt.cli.printing import print_notes
from tripwatt.errors import Check, InvalidInput

if TYPE_CHECKING:
    from tripwatt.forecasting import ForecastModel
    from tripwatt.live.documents import LiveDocument

PASSWORD_VARIABLE: Final = "TRIPWATT_MQTT_PASSWORD"
"""Environment variable of the broker's password."""


def live(
    car: Annotated[
        Path,
        argument(
            "CAR",
            "Folder of the car; made where it is missing. A car of `tripwatt car new` is forecast with what it learned.",
        ),
    ],
    mqtt: Annotated[str, option("URL", "Broker: mqtt://[NAME@]HOST[:PORT], or mqtts:// encrypted.")],
    source: Annotated[str, option("NAME", "What sends: ovms, teslamate or abrp.")],
    topic: Annotated[
        str,
        option(
            "TOPIC",
            "Topic below which the metrics of the car are: ovms/USER/CAR/metric, teslamate/cars/1. Of abrp, the topic "
            "of the messages.",
            "--topic",
        ),
    ],
    plan: Annotated[
        Path | None,
        option(
            "TRIP",
            "The road, as for `tripwatt forecast`: a planned route. Default: that of an earlier trip which began at "
            "about the same time of day.",
        ),
    ] = None,
    model: Annotated[
        Path | None, option("MODEL", "Folder of a model. Default: the bundled model.", "--model")
    ] = None,
    vehicle: Annotated[
        str | None, option("NAME|FILE", "A car other than that of the model, or a TOML file.")
    ] = None,
    reserve: Annotated[
        float, option("0..1", "State of charge to keep, as displayed.", min=0.0, max=1.0)
    ] = 0.1,
    every: Annotated[
        float, option("S", "Shortest time between two forecasts [s].", min=0.1, max=3600.0)
    ] = 5.0,
    publish: Annotated[str, option("TOPIC", "Also publish each forecast as JSON to this topic.")] = "",
    discovery: Annotated[
        str,
        option(
            "PREFIX",
            "Let Home Assistant find what --publish sends, below this prefix of topics: usually homeassistant.",
        ),
    ] = "",
    keep_days: Annotated[
        float | None,
        option(
            "DAYS",
            "Erase what the car sent after so many days. Default: keep it until the car is forgotten.",
            min=0.01,
            max=36_500.0,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Follow a car over MQTT until you interrupt the command: keep its trips, and forecast the one that it is on.

    The command requires the extra `tripwatt[live]`. It reads the password of the broker from TRIPWATT_MQTT_PASSWORD. What the
    plan leaves unknown of the departure is what the car's messages show.

    For example:

      # follow a car with OVMS to work
      tripwatt live cars/my-leaf --mqtt mqtt://192.0.2.7 --source ovms --topic ovms/me/leaf/metric --plan to-work.gpx
      # keep the trips of a car that TeslaMate reads
      tripwatt live cars/my-3 --mqtt mqtt://192.0.2.7 --source teslamate --topic teslamate/cars/1
    """
    require_extras({"live": "tripwatt live"})
    from tripwatt.live import Broker, Follower, RoadCar, TopicJoiner, is_car

    own = car if is_car(car) else None
    with Check() as check:
        broker = check(Broker.from_url, mqtt, os.environ.get(PASSWORD_VARIABLE))
        joiner = check(TopicJoiner, source, topic)
        check(_require_topic, publish, discovery)
        request = None if plan is None else check(_request, plan)
        known = check(_model, model or own, vehicle)
    days = math.inf if keep_days is None else keep_days
    with RoadCar(car, lambda _: known, reserve=reserve, keep_days=days) as opened:
        if request is not None:
            opened.set_plan(request)
        _note(waiting(joiner.filter, broker.host, opened.plan is not None))
        show = _printer(as_json)
        follower = Follower(opened, joiner, show, every, publish, discovery, _note)
        asyncio.run(follower.follow(broker))


def _require_topic(publish: str, discovery: str) -> None:
    if discovery and not publish:
        raise InvalidInput.of("nothing is published", "--discovery", discovery, "beside --publish TOPIC")


def _model(model: Path | None, vehicle: str | None) -> ForecastModel:
    from tripwatt.population import for_car
    from tripwatt.vehicles import load_vehicle

    own = for_car(model_of(model), None if vehicle is None else load_vehicle(vehicle))
    print_notes(own.flags)
    return own


def _request(path: Path) -> dict[str, Any]:
    """The road of a file as the fields of a request."""
    from tripwatt.api import read_route
    from tripwatt.live.plan import request_of_samples
    from tripwatt.routes import Track, is_route, parse_route, route_from_track
    from tripwatt.routes.link_objects import fields_of_route
    from tripwatt.sources.canonical import read_canonical
    from tripwatt.sources.tum import is_tum_log, read_tum_file

    plan = read_route(path)  # checks the file
    if not is_route(path):
        return request_of_samples(
            read_tum_file(path, path.stem).samples if is_tum_log(path) else read_canonical(path)
        )
    route = parse_route(path)
    if not isinstance(route, Track):
        return fields_of_route(route)
    return request_of_samples(plan.samples) if route.is_log else fields_of_route(route_from_track(route))


def waiting(topics: str, host: str, planned: bool) -> str:
    """What the command waits for, as a sentence.

    Examples
    --------
    >>> waiting("cars/leaf", "192.0.2.7", planned=False)
    'waiting for messages of cars/leaf at 192.0.2.7; the trip is forecast on the road of an earlier trip at this time of day'
    """
    road = "its plan" if planned else "the road of an earlier trip at this time of day"
    return f"waiting for messages of {topics} at {host}; the trip is forecast on {road}"


def _printer(as_json: bool) -> Any:
    if as_json:
        return lambda document: typer.echo(json.dumps(document))
    return lambda document: typer.echo(sentence(document))


def _note(text: str) -> None:
    typer.echo(f"note: {text}", err=True)


def sentence(document: LiveDocument) -> str:
    """The state of a car in one line.

    Examples
    --------
    >>> sentence({"vehicle": "leaf", "messages": {"new": 7}, "trip": None, "forecast": None, "faults": []})
    'leaf: on no trip, 7 messages'
    """
    trip, forecast = document["trip"], document["forecast"]
    where = "on no trip" if trip is None else f"{trip['distance_m'] / 1000.0:.1f} km driven"
    parts = [f"{document['vehicle']}: {where}", f"{document['messages']['new']} messages"]
    if forecast is not None:
        low, _, high = forecast["soc_quantiles"].values()
        parts += [
            f"{forecast['energy_wh'] / 1000.0:.2f} kWh in all",
            f"arrival with {forecast['soc_arrival']:.0%} ({low:.0%} to {high:.0%})",
            f"{forecast['p_arrive_at_all']:.1%} to arrive",
            f"{forecast['p_arrive']:.1%} with {forecast['reserve']:.0%}",
        ]
    return ", ".join([*parts, *(fault["what"] for fault in document["faults"])])
