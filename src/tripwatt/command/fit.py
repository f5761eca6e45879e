"""The command that fits or adapts a model."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

import tripwatt as tw
from tripwatt import trips
from tripwatt.command import shared
from tripwatt.command.options import Answer, flag, option
from tripwatt.command.printing import console, grouped, kwh, print_notes, progress, share
from tripwatt.errors import Check, Fault, InvalidInput


def fit(
    logs: shared.LogsOfCar,
    out: shared.OutFolder = Path("model"),
    corrector: Annotated[
        str, option("NAME", "Statistical model: linear, gp, boosting, forest, ensemble or split.")
    ] = "split",
    published: Annotated[bool, flag("--published", "Keep the published values of the car.")] = False,
    base: Annotated[Path | None, option("MODEL", "Adapt this model; a few trips are enough.")] = None,
) -> Answer:
    """Fit a forecasting model on logged trips and write it as a folder.

    The command audits the trips, fits on the sound ones, and estimates the uncertainty of forecasts from held-out trips.
    It writes the arrays of the model and metadata.json with inputs, provenance, scores and checksums.

    For example:

      # fit on your copy of the TUM trips
      tripwatt fit data/tum --out my-model
      # fit on tables of one car
      tripwatt fit logs --mapping my.toml --vehicle vw_id3 --out my-model
      # adapt the model of one car to another car with a few of its trips
      tripwatt fit logs --mapping my.toml --vehicle nissan_leaf_24 --base i3-model --out leaf-model
      # fit on the synthetic fleet, to try the commands
      tripwatt fit --out example-model
    """
    from tripwatt.modelfile import require_place

    shown, note = console(), logs.named()[1]
    with Check() as check:
        started = None if base is None else check(_stored, base)
        check(_require_storable, corrector)
        car = check(logs.car)
        check(require_place, out)
        with shown.status("reading trips"):
            fleet = check(logs.read)
    fleet = replace(fleet, notes=(*fleet.notes, *note))
    shown.print(f"{len(fleet.trips)} trips read ({fleet.name})")
    from tripwatt.forecasting.fitting import fit_with_provenance
    from tripwatt.forecasting.storage import save_model
    from tripwatt.population.adapting import adapt_model

    if started is not None:
        with shown.status("adapting the model"):
            model, provenance, figures = adapt_model(fleet, car, *started)
    else:
        with progress(shown) as advance:
            model, provenance, figures = fit_with_provenance(
                fleet, car, corrector=corrector, identified=not published, progress=advance
            )
    save_model(model, out, provenance=provenance, evaluation=figures)
    notes = provenance["data"]["notes"]
    brief = {k: v for k, v in figures.items() if k != "by_trip"}
    document = {"model": str(out), "data": fleet.name, "evaluation": brief, "notes": notes}
    return Answer(document, partial(_show_fit, fleet, out, notes, figures))


def _stored(folder: Path) -> tuple[tw.ForecastModel, dict[str, Any]]:
    """Load a stored model and its metadata."""
    from tripwatt.forecasting import load_metadata

    return tw.load_model(folder), load_metadata(folder, check_parts=False)


def _require_storable(corrector: str) -> None:
    from tripwatt.hybrid import STORABLE

    if corrector not in STORABLE:
        raise InvalidInput(Fault.unknown("unknown corrector", "--corrector", corrector, STORABLE))


def _show_fit(fleet: trips.TripSet, out: Path, notes: list[str], figures: dict[str, Any]) -> None:
    from tripwatt.population.adapting import PROTOCOL

    how = "adapted to" if figures.get("protocol") == PROTOCOL else "fitted on"
    used, read = figures["trips"], len(fleet.trips)
    unused = f" of {read} (`tripwatt audit` has the reasons)" if used < read else ""
    typer.echo(f"model: {out}, {how} {used} trips{unused} ({fleet.name})")
    errors = f"mean error {share(figures['mape'])}, RMSE {kwh(figures['rmse_wh'], 3)}"
    typer.echo(f"held-out trips: {errors}, {figures['given']}")
    print_notes([*grouped(fleet.notes), *notes[len(fleet.notes) :]])
