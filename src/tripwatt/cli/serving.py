"""`tripwatt serve`: the service and the page."""

from __future__ import annotations

from typing import Annotated

import typer

from tripwatt.cli.options import examples


def add_commands(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command(epilog=examples(("tripwatt serve", "the page on http://127.0.0.1:8000")))(serve)


def serve(
    host: Annotated[str, typer.Option(metavar="HOST", help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="PORT", help="0 for a free one.")] = 8000,
) -> None:
    """Serve forecasts over HTTP, and the page."""
    import uvicorn

    from tripwatt.service.app import create_app

    uvicorn.run(create_app(), host=host, port=port)
