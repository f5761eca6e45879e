"""`tripwatt mcp`: the tools for assistants."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

from tripwatt.command import shared
from tripwatt.command.options import argument, flag
from tripwatt.command.serve import make_cars_folder, models_of
from tripwatt.errors import Check, require_extras


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
    from tripwatt.server.http import car_jobs, jobs, journeys, settings
    from tripwatt.server.mcp import make_server, serve

    atlas = on_map.settings()
    with Check() as check:
        folders = check(models_of, model or [])
        check(make_cars_folder, cars)
        planned = check(journeys.JourneyJobs.from_settings, atlas)
    service = jobs.Jobs.from_folders(folders, settings.Limits(), planned, car_jobs.CarJobs(cars))
    serve(
        make_server(service, changes=changes, remote=any("://" in named for named in asdict(atlas).values()))
    )
