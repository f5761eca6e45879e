"""`tripwatt serve`: the service and the page."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Annotated

import typer

from tripwatt.cli.journey import MapOption, PlacesOption, StationsOption, WeatherOption
from tripwatt.cli.options import argument, option, require_extras
from tripwatt.errors import Check, Fault, raise_faults, system_errors


def serve(
    model: Annotated[
        list[str] | None,
        argument(
            "[MODEL ...]", "Folders of models; the folder name is the model name. Default: the bundled model."
        ),
    ] = None,
    also: Annotated[
        list[str] | None,
        option(
            "FOLDER|registry:FOLDER",
            "One more model, or the version in use of a fleet's registry, which the service follows. You can repeat the option.",
            "--model",
            envvar="TRIPWATT_MODEL",
        ),
    ] = None,
    models: Annotated[Path | None, option("DIR", "Also serve every model in this folder.")] = None,
    host: Annotated[
        str, option("ADDRESS", "Address to listen on. Addresses other than loopback require a token.")
    ] = "127.0.0.1",
    port: Annotated[
        int, option("PORT", "Port to listen on; 0 selects a free port.", "--port", min=0, max=65535)
    ] = 8000,
    workers: Annotated[int, option("N", "Number of worker processes.", min=1)] = 2,
    map_: MapOption = "",
    places: PlacesOption = "",
    weather: WeatherOption = "",
    stations: StationsOption = None,
    cars: Annotated[
        Path | None,
        option(
            "DIR",
            "Also keep cars that learn from their trips, and follow those with a token on the road: a folder of "
            "cars, which may be empty (see `tripwatt car`).",
        ),
    ] = None,
    keep_days: Annotated[
        float | None,
        option(
            "DAYS",
            "Erase what cars sent on the road after so many days. Default: keep it until the car is forgotten.",
            min=0.01,
            max=36_500.0,
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        option(
            "KEY=VALUE",
            "Change a limit, for example timeout_s=5. You can repeat the option. docs/reference/service.md lists the limits.",
        ),
    ] = None,
    prefix: Annotated[
        str, option("PATH", "Path under which a proxy serves the service, for example /tripwatt.")
    ] = "",
    cors_origin: Annotated[
        list[str] | None,
        option(
            "ORIGIN",
            "Let pages of this origin read answers, for example https://example.org. You can repeat the option. Default: no "
            "other origin.",
        ),
    ] = None,
) -> None:
    """Serve the HTTP API and the web page until you interrupt the command.

    The command requires the extra `tripwatt[service]`. It reads the token for other machines from TRIPWATT_TOKEN. Each option
    has a variable of the environment, which counts where the option is not given; several values are separated by spaces. The
    command logs each request as one line of JSON to standard error.

    For example:

      # serve the bundled model on http://127.0.0.1:8000
      tripwatt serve
      # serve your own models; the first is the default
      tripwatt serve my-i3 my-id3 --workers 4
      # forecast the vehicles of a fleet, and follow the version in use
      tripwatt serve --model registry:models
      # also plan journeys on a map (see `tripwatt map build`)
      tripwatt serve --map map
      # also keep cars that learn, and follow them on the road
      tripwatt serve --cars cars
      # serve other machines; they need the token
      TRIPWATT_TOKEN=... tripwatt serve --host 0.0.0.0
    """
    from tripwatt.journey import AtlasSettings, open_atlas

    needed = {"service": "tripwatt serve"}
    if cars is not None:
        needed["fleet"] = "--cars"
    atlas = AtlasSettings(map_, places, weather, "" if stations is None else str(stations))
    with Check() as check:
        check(require_extras, needed)
        if map_:
            check(open_atlas, atlas)
    from tripwatt.service.serving import require_safe
    from tripwatt.service.serving import serve as run
    from tripwatt.service.settings import TOKEN_VARIABLE, Limits, Settings, parse_limits

    with Check() as check:
        folders = check(models_of, [*(model or ()), *(also or ())], models)
        limits = check(parse_limits, limit) if limit else Limits()
        check(make_cars_folder, cars)
    token = os.environ.get(TOKEN_VARIABLE, "")
    days = math.inf if keep_days is None else keep_days
    origins = tuple(cors_origin or ())
    settings = Settings(
        folders, host, port, workers, token, limits, atlas, cars, days, prefix.rstrip("/"), origins
    )
    require_safe(settings)
    run(settings, lambda address: typer.echo(f"tripwatt: {address}"))


def make_cars_folder(folder: Path | None) -> None:
    """Make the folder of cars where there is none; the folder around it has to be there.

    Raises
    ------
    InvalidInput
        When it cannot be made.
    """
    if folder is None or folder.is_dir():
        return
    with system_errors("cannot make the folder", f"--cars, {folder}", "a folder of cars, or a new one"):
        folder.mkdir()


def models_of(given: list[str], folder: Path | None) -> dict[str, Path]:
    """Models by the names of their folders, those that are named first.

    Raises
    ------
    InvalidInput
        When the folder holds none, or two have one name.
    """
    folders = [Path(place.removeprefix("registry:")) for place in given]
    faults = []
    if folder is not None:
        inside = sorted(p.parent for p in folder.glob("*/metadata.json")) if folder.is_dir() else []
        if not inside:
            faults.append(Fault("no models", "--models", str(folder), "a folder that contains models"))
        folders += inside
    names = [place.resolve().name for place in folders]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        faults.append(Fault("duplicate model name", "MODEL", ", ".join(twice), "each name once"))
    raise_faults(faults)
    return {name: place.resolve() for name, place in zip(names, folders, strict=True)}
