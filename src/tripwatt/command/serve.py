"""Servers: the HTTP service with the web page, the same with example data, and the tools for assistants."""

from __future__ import annotations

import math
import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import urlencode

from tripwatt.command import shared
from tripwatt.command.options import argument, assignments, flag, option, require_effect
from tripwatt.command.printing import print_notes, say
from tripwatt.errors import Check, Fault, InvalidInput, excerpt, raise_faults, require_extras, system_errors

if TYPE_CHECKING:
    from tripwatt.server.cars.following import MqttSettings


def serve(
    model: Annotated[
        list[str] | None,
        argument(
            "[MODEL ...]",
            "Folders of models, or registry:FOLDER, of which the service follows the version in use. Default: the bundled model.",
            envvar="TRIPWATT_MODEL",
        ),
    ] = None,
    host: Annotated[str, option("ADDRESS", "Address; others than loopback require a token.")] = "127.0.0.1",
    port: shared.Port = 8000,
    workers: Annotated[int, option("N", "Number of worker processes.", min=1)] = 2,
    on_map: shared.OnMap = shared.OnMap(),  # noqa: B008, it is frozen
    cars: shared.Cars = None,
    keep_days: Annotated[float, option("DAYS", "Days to keep what cars sent.", min=0.01)] = math.inf,
    mqtt: Annotated[str, option("URL", "Broker of the cars: mqtt[s]://[NAME@]HOST[:PORT].")] = "",
    follow: Annotated[
        list[str] | None,
        option(
            "CAR=SOURCE:TOPIC",
            "With --mqtt: follow a car; it is made where it is missing. SOURCE: ovms, teslamate, abrp, owntracks, plain, or a mapping. "
            "TOPIC: of whole messages, or above the topics of the values. Repeatable.",
        ),
    ] = None,
    publish: Annotated[
        str, option("TOPIC", "Topic of cars as JSON on the broker; may be empty.")
    ] = "tripwatt",
    discovery: Annotated[
        str, option("PREFIX", "Topics by which Home Assistant finds cars; may be empty.")
    ] = "homeassistant",
    limit: Annotated[
        shared.Texts, option("KEY=VALUE", "A limit of docs/reference/service.md: timeout_s=5. Repeatable.")
    ] = None,
    prefix: Annotated[str, option("PATH", "Path behind a proxy, for example /tripwatt.")] = "",
    cors_origin: Annotated[
        shared.Texts,
        option("ORIGIN", "Origin whose pages may read answers: https://example.org. Repeatable."),
    ] = None,
) -> None:
    """Serve the HTTP API and the web page until you interrupt the command.

    The command requires the extra `tripwatt[service]`. It reads the token for other machines from TRIPWATT_TOKEN, and the
    password of the broker from TRIPWATT_MQTT_PASSWORD. Each option has a variable of the environment, which counts where the
    option is not given; several values are separated by spaces. The command logs each request as one line of JSON to standard error.

    For example:

      # serve the bundled model on http://127.0.0.1:8000
      tripwatt serve
      # serve your own models; the first is the default
      tripwatt serve my-i3 my-id3 --workers 4
      # forecast the vehicles of a fleet, and follow the version in use
      tripwatt serve registry:models
      # also plan journeys on a map (see `tripwatt map build`)
      tripwatt serve --map map
      # also keep cars that learn, and follow them on the road
      tripwatt serve --cars cars
      # also follow a car with OVMS over MQTT, and let Home Assistant find it
      tripwatt serve --cars cars --mqtt mqtt://192.0.2.7 --follow my-leaf=ovms:ovms/me/leaf/metric
      # serve other machines; they need the token
      TRIPWATT_TOKEN=... tripwatt serve --host 0.0.0.0
    """
    from tripwatt.roads.journey import open_atlas

    needed = {"service": "tripwatt serve"} | ({"live": "--mqtt"} if mqtt else {})
    atlas = on_map.settings()
    with Check() as check:
        check(require_extras, needed)
        if atlas.map:
            check(open_atlas, atlas)
    from tripwatt.server.http.serving import require_safe
    from tripwatt.server.http.serving import serve as run
    from tripwatt.server.http.settings import TOKEN_VARIABLE, Settings, limits_of

    with Check() as check:
        folders = check(models_of, model or [])
        limits = check(lambda: limits_of(assignments(limit or [], "--limit")))
        over_mqtt = check(_mqtt_of, mqtt, follow or [], publish, discovery, cars)
        check(make_cars_folder, cars)
    token, prefix, origins = os.environ.get(TOKEN_VARIABLE, ""), prefix.rstrip("/"), tuple(cors_origin or ())
    listens = (folders, host, port, workers, token, limits)
    settings = Settings(*listens, atlas, cars, keep_days, prefix, origins, over_mqtt)
    require_safe(settings)
    hint = () if atlas.map else ("For journeys: tripwatt map build REGION.osm.pbf, then --map map",)
    run(settings, lambda address: say(f"tripwatt: {address}", *hint))


def _mqtt_of(
    url: str, follow: list[str], publish: str, discovery: str, cars: Path | None
) -> MqttSettings | None:
    """Build the settings of MQTT; returns None if no broker is given.

    Raises
    ------
    InvalidInput
        If the URL is invalid, `_car_and_topic` raises, a car is given twice, or an option has no effect.
    """
    from tripwatt.server.cars.following import Broker, MqttSettings
    from tripwatt.server.http.settings import PASSWORD_VARIABLE

    with Check() as check:
        broker = check(Broker.from_url, url, os.environ.get(PASSWORD_VARIABLE)) if url else None
        pairs = [check(_car_and_topic, given) for given in follow]
        if not url:
            check(require_effect, {"--follow": ", ".join(follow) or None}, "only together with --mqtt")
        elif cars is None:
            check(require_effect, {"--mqtt": excerpt(url)}, "only together with --cars")
        names = [pair[0] for pair in pairs if pair]
        check(raise_faults, _twice("duplicate car name", "--follow", names))
    return None if broker is None else MqttSettings(broker, dict(pairs), publish.rstrip("/"), discovery)


def _twice(what: str, where: str, names: list[str]) -> Iterator[Fault]:
    """Yield a fault if a name occurs twice."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        yield Fault(what, where, ", ".join(twice), "each name once")


def _car_and_topic(given: str) -> tuple[str, tuple[str, str]]:
    """Parse `CAR=SOURCE:TOPIC` into the name of the car and a pair of the source of its messages and their topic.

    Raises
    ------
    InvalidInput
        If the text has another form, the name is not valid, the source is unknown, or the topic has a wildcard.

    Examples
    --------
    >>> _car_and_topic("my-3=teslamate:teslamate/cars/1")
    ('my-3', ('teslamate', 'teslamate/cars/1'))
    """
    from tripwatt.server.cars.live_car import VALID_NAME
    from tripwatt.server.cars.topics import TopicJoiner

    parts = re.fullmatch(f"({VALID_NAME.pattern})=([^:]+):(.+)", given)
    if parts is None:
        raise InvalidInput.of("not a car to follow", "--follow", given[:80], "CAR=SOURCE:TOPIC")
    TopicJoiner(parts[2], parts[3])
    return parts[1], (parts[2], parts[3])


def make_cars_folder(folder: Path | None) -> None:
    """Create the folder of cars if it is missing; its parent folder must exist.

    Raises
    ------
    InvalidInput
        If the folder cannot be created.
    """
    with system_errors("cannot make the folder", f"--cars, {folder}", "a folder of cars, or a new one"):
        if folder is not None:
            folder.mkdir(exist_ok=True)


def models_of(given: list[str]) -> dict[str, Path]:
    """Return the folders of models by their names.

    Raises
    ------
    InvalidInput
        If two folders have the same name.
    """
    folders = [Path(place.removeprefix("registry:")).resolve() for place in given]
    raise_faults(_twice("duplicate model name", "MODEL", [folder.name for folder in folders]))
    return {folder.name: folder for folder in folders}


serve.context_settings = {"auto_envvar_prefix": "TRIPWATT"}  # type: ignore[attr-defined]


def mcp(
    model: Annotated[shared.Texts, argument("[MODEL ...]", "Folders of models, as for `serve`.")] = None,
    on_map: shared.OnMap = shared.OnMap(),  # noqa: B008, it is frozen
    cars: shared.Cars = None,
    changes: Annotated[bool, flag("--changes", "Also offer tools that change something.")] = False,
) -> None:
    """Serve an assistant over standard input and output, by the Model Context Protocol.

    The command requires the extra `tripwatt[mcp]`. An assistant starts it; docs/howto/assistants.md has configurations. Its
    tools change nothing without --changes, and nothing leaves this machine unless an option names the URL of a server.

    For example:

      # need, range, advise, forecast
      tripwatt mcp
      # also plan journeys on a map, and read the diaries of your cars
      tripwatt mcp --map map --cars cars
    """
    needed = dict.fromkeys(("service", "mcp"), "tripwatt mcp") | ({"fleet": "--cars"} if cars else {})
    require_extras(needed)
    from tripwatt.roads.journey import open_atlas
    from tripwatt.server.http import jobs, settings
    from tripwatt.server.mcp import Assistant

    atlas = on_map.settings()
    with Check() as check:
        folders = check(models_of, model or [])
        check(make_cars_folder, cars)
        opened = check(open_atlas, atlas) if atlas.map else None
    service = jobs.Jobs.from_folders(folders, settings.Limits(), opened, cars)
    Assistant(service, changes=changes, remote=any("://" in named for named in asdict(atlas).values())).run()


def demo(
    port: shared.Port = 8000,
    folder: Annotated[Path | None, option("DIR", "Keep map, car and diary here for the next time.")] = None,
) -> None:
    """Serve the page with example data: a car, its diary, a live trip and the map of a made-up country.

    The diary and the live trip are real, of a BMW i3 around Munich; the bundled model has seen them, so its errors on your
    trips are larger. The command requires the extras `tripwatt[service,fleet]`, and `tripwatt[routing]` for the map. It takes
    a few seconds, then prints the address of the page. Interrupt the command to end it.

    For example:

      # everything in one page, on http://127.0.0.1:8000
      tripwatt demo
      # keep what it makes, and start at once the next time
      tripwatt demo --folder demo --port 8080
    """
    require_extras(dict.fromkeys(("service", "fleet"), "tripwatt demo"))
    from tripwatt.server.http.demo import DRIVE, depart, make_demo, send
    from tripwatt.server.http.library import examples
    from tripwatt.server.http.serving import serve

    with tempfile.TemporaryDirectory() if folder is None else nullcontext(folder) as place:
        Path(place).mkdir(exist_ok=True)
        settings, token = make_demo(Path(place), lambda step: print_notes([f"making: {step}"]))
        if not settings.atlas.map:
            print_notes(["no map: it needs the extra routing, and Python 3.12 or newer"])
        samples, request = depart(settings), examples()[DRIVE]["request"]
        logged = {name: request[name] for name in ("soc", "ambient_temperature_degc", "cabin_setpoint_degc")}
        link = urlencode({"trip": "examples", "example": DRIVE, "beforeDeparture": "logged", **logged})

        def show(url: str) -> None:
            threading.Thread(target=send, args=(samples, url, token), daemon=True).start()
            say(f"tripwatt: {url}/#{link}")
            say("The page opens with a real trip; its mode Drive replays it.")
            say("The steering wheel shows it on the road. Your cars, in the field of the car, has the diary.")

        serve(replace(settings, port=port), show)
