"""The command that fits or adapts a model."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tripwatt.command.options import Answer, Logs, SetOption, VehicleOption, option
from tripwatt.command.printing import console, grouped, print_notes, progress
from tripwatt.errors import Check, Fault, InvalidInput

if TYPE_CHECKING:
    from tripwatt.forecasting import ForecastModel
    from tripwatt.trips import TripSet


def fit(
    logs: Logs,
    out: Annotated[
        Path, option("MODEL", "Folder of the model. It is created when the fit is complete.", "--out", "-o")
    ] = Path("model"),
    vehicle: VehicleOption = None,
    overrides: SetOption = None,
    corrector: Annotated[
        str, option("NAME", "Statistical model: linear, gp, boosting, forest, ensemble or split.")
    ] = "split",
    published: Annotated[
        bool,
        typer.Option(
            "--published",
            help="Keep the published values of the car. Default: identify those that signals of its stages show.",
        ),
    ] = False,
    base: Annotated[
        Path | None,
        option(
            "MODEL",
            "Adapt this model of another car to the trips. A few trips are enough. The corrector is that of this model.",
        ),
    ] = None,
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
    from tripwatt.vehicles import load_vehicle, parse_overrides

    shown = console()
    car, note = logs.car(vehicle)
    with Check() as check:
        started = None if base is None else check(_stored, base)
        check(_require_storable, corrector)
        own = check(lambda: load_vehicle(car, overrides=parse_overrides(overrides or [])))
        check(require_place, out)
        with shown.status("reading trips"):
            fleet = check(logs.read)
    fleet = replace(fleet, notes=(*fleet.notes, *note))
    shown.print(f"{len(fleet.trips)} trips read ({fleet.name})")
    from tripwatt.forecasting.fitting import fit_with_provenance
    from tripwatt.forecasting.storage import save_model

    if started is not None:
        from tripwatt.population.adapting import adapt_model

        with shown.status("adapting the base"):
            model, provenance, figures = adapt_model(fleet, own, *started)
    else:
        with progress(shown) as advance:
            model, provenance, figures = fit_with_provenance(
                fleet,
                own,
                corrector=corrector,
                identified=not published,
                progress=advance,
            )
    save_model(model, out, provenance=provenance, evaluation=figures)
    notes = provenance["data"]["notes"]
    brief = {k: v for k, v in figures.items() if k != "by_trip"}
    document = {"model": str(out), "data": fleet.name, "evaluation": brief, "notes": notes}
    return Answer(document, partial(_show_fit, fleet, out, notes, figures))


def _stored(folder: Path) -> tuple[ForecastModel, dict[str, Any]]:
    """A stored model and its metadata."""
    from tripwatt.forecasting import load_metadata, load_model

    return load_model(folder), load_metadata(folder, check_parts=False)


def _require_storable(corrector: str) -> None:
    from tripwatt.hybrid import STORABLE

    if corrector not in STORABLE:
        raise InvalidInput(Fault.unknown("unknown corrector", "--corrector", corrector, STORABLE))


def _show_fit(fleet: TripSet, out: Path, notes: list[str], figures: dict[str, Any]) -> None:
    from tripwatt.population.adapting import PROTOCOL

    how = "adapted to" if figures.get("protocol") == PROTOCOL else "fitted on"
    used, read = figures["trips"], len(fleet.trips)
    others = f" of {read} (`tripwatt audit` has the reasons)" if used < read else ""
    typer.echo(f"model: {out}, {how} {used} trips{others} ({fleet.name})")
    typer.echo(
        f"held-out trips: mean error {figures['mape']:.1%}, RMSE {figures['rmse_wh'] / 1000.0:.3f} kWh, "
        f"{figures['given']}"
    )
    print_notes([*grouped(fleet.notes), *notes[len(fleet.notes) :]])
