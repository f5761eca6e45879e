"""`tripwatt demo`: the web page with example data."""

from __future__ import annotations

import tempfile
import threading
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from tripwatt.command.options import option
from tripwatt.command.printing import print_notes
from tripwatt.command.shared import Port
from tripwatt.errors import require_extras


def demo(
    port: Port = 8000,
    folder: Annotated[Path | None, option("DIR", "Keep map, car and diary here for the next time.")] = None,
) -> None:
    """Serve the page with example data: a car, its diary, a live trip and the map of a made-up country.

    The command requires the extras `tripwatt[service,fleet]`, and `tripwatt[routing]` for the map. It takes a few seconds, then
    prints the address of the page. Nothing in it is measured. Interrupt the command to end it.

    For example:

      # everything in one page, on http://127.0.0.1:8000
      tripwatt demo
      # keep what it makes, and start at once the next time
      tripwatt demo --folder demo --port 8080
    """
    require_extras(dict.fromkeys(("service", "fleet"), "tripwatt demo"))
    from tripwatt.server.http.demo import depart, make_demo, send
    from tripwatt.server.http.serving import serve

    with tempfile.TemporaryDirectory() if folder is None else nullcontext(folder) as place:
        Path(place).mkdir(exist_ok=True)
        settings, token = make_demo(Path(place), lambda step: print_notes([f"making: {step}"]))
        if not settings.atlas.map:
            print_notes(["no map: install the extra routing on Python 3.12 or later"])
        samples = depart(settings)

        def show(url: str) -> None:
            threading.Thread(target=send, args=(samples, url, token), daemon=True).start()
            typer.echo(f"tripwatt: {url}")
            typer.echo(
                "The page opens with the example car. Its diary is under Your cars, in the field of the car."
            )
            typer.echo("The steering wheel beside the field shows a live trip with its forecast.")

        serve(replace(settings, port=port), show)
