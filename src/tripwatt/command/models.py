"""Commands on models: fit or adapt a model, describe one."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tripwatt as tw
from tripwatt import trips
from tripwatt.command import shared
from tripwatt.command.options import Answer, argument, flag, option, require_effect
from tripwatt.command.printing import console, grouped, kwh, print_notes, print_table, progress, say
from tripwatt.command.sentences import change
from tripwatt.errors import Check, Fault, counted, damage, percent, raise_faults


def fit(
    logs: shared.LogsOfCar,
    out: shared.OutFolder = Path("model"),
    corrector: Annotated[
        str, option("NAME", "Statistical model: linear, gp, boosting, forest, ensemble or split.")
    ] = "split",
    published: Annotated[bool, flag("--published", "Keep the published values of the car.")] = False,
    covariate: Annotated[shared.Texts, option("NAME", "Also use this column of logs. Repeatable.")] = None,
    base: Annotated[Path | None, option("MODEL", "Adapt this model; a few trips are enough.")] = None,
) -> Answer:
    """Fit a forecasting model on logged trips and write it as a folder.

    The command audits the trips, fits on the sound ones, and estimates the uncertainty of forecasts from held-out trips.
    It writes the arrays of the model and metadata.json with inputs, provenance, scores and checksums.

    For example:

      # fit on your copy of the TUM trips
      tripwatt fit data/tum --out my-model
      # fit on tables of one car
      tripwatt fit logs --mapping my.toml --car vw_id3 --out my-model
      # adapt the model of one car to another car with a few of its trips
      tripwatt fit logs --mapping my.toml --car nissan_leaf_24 --base i3-model --out leaf-model
      # fit on the sample of real trips, to try the commands
      tripwatt fit --out example-model
    """
    from tripwatt.hybrid import STORABLE
    from tripwatt.modelfile import require_place

    shown, note = console(), logs.named()[1]
    with Check() as check:
        started = None if base is None else check(tw.load_model, base)
        check(require_effect, {"--covariate": (base and covariate) or None}, "only without --base")
        if corrector not in STORABLE:
            check(raise_faults, [Fault.unknown("unknown corrector", "--corrector", corrector, STORABLE)])
        car = check(logs.car)
        check(require_place, out)
        with shown.status("reading trips"):
            fleet = check(logs.read)
    fleet = replace(fleet, notes=(*fleet.notes, *note))
    say(f"{counted(len(fleet.trips), 'trip')} read ({fleet.name})", err=True)
    from tripwatt.forecasting.fitting import fit_with_provenance
    from tripwatt.forecasting.storage import load_metadata, save_model
    from tripwatt.population.adapting import adapt_model

    if started is not None:
        with shown.status("adapting the model"):
            about = load_metadata(base, check_parts=False)
            model, provenance, figures = adapt_model(fleet, car, started, about)
    else:
        with progress(shown) as advance:
            model, provenance, figures = fit_with_provenance(
                fleet,
                car,
                corrector=corrector,
                identified=not published,
                covariates=covariate or (),
                progress=advance,
            )
    save_model(model, out, provenance=provenance, evaluation=figures)
    notes = provenance["data"]["notes"]
    brief = {k: v for k, v in figures.items() if k != "by_trip"}
    document = {"model": str(out), "data": fleet.name, "evaluation": brief, "notes": notes}
    return Answer(document, partial(_show_fit, fleet, out, notes, figures))


def _show_fit(fleet: trips.TripSet, out: Path, notes: list[str], figures: dict[str, Any]) -> None:
    from tripwatt.population.adapting import PROTOCOL

    how = "adapted to" if figures.get("protocol") == PROTOCOL else "fitted on"
    used, read = figures["trips"], len(fleet.trips)
    unused = f" of {read} (`tripwatt audit` has the reasons)" if used < read else ""
    say(f"model: {out}, {how} {counted(used, 'trip')}{unused} ({fleet.name})")
    say(f"held-out trips: {_errors(figures)}")
    print_notes([*grouped(fleet.notes), *notes[len(fleet.notes) :]])


def _errors(figures: dict[str, Any], *more: str) -> str:
    errors = f"mean error {percent(figures['mape'], 1)}", f"RMSE {kwh(figures['rmse_wh'], 3)}"
    return ", ".join((*errors, *more, figures["given"]))


def inspect(
    model: Annotated[Path | None, argument("MODEL", "Folder of a model. Default: the bundled model.")] = None,
) -> Answer:
    """Show the provenance and the scores of a model, and verify its checksums. With --json, also show its inputs.

    For example:

      # describe the bundled model
      tripwatt inspect
      # print all metadata of your model
      tripwatt inspect my-model --json
    """
    from tripwatt.forecasting import load_metadata

    about = load_metadata(model)
    allowed = "metadata of a model of one car, as `tripwatt fit` writes them"
    with damage(model, allowed, what="metadata cannot be read"):  # digests are no signatures
        facts = _about_rows(about)
    return Answer(about, partial(print_table, "Model", ("", "value"), facts, folding=("value",)))


def _about_rows(about: dict[str, Any]) -> list[tuple[str, str]]:
    fitted, origin, figures = about["model"], about["provenance"], about["evaluation"]
    rows = [
        ("format", f"{about['format_version']}, written by tripwatt {about['tripwatt']}"),
        ("car", f"{fitted['vehicle_title']} ({fitted['vehicle']}, preset {fitted['vehicle_preset']})"),
        ("corrector", f"{fitted['corrector']}, seed {fitted['seed']}, {fitted['trips']} trips"),
    ]
    if "data" in origin:
        rows.append(("data", f"{origin['data']['name']}, SHA-256 {origin['data']['sha256']}"))
        rows += [("citation", origin["data"]["citation"])] if origin["data"]["citation"] else []
        rows += [("note", note) for note in origin["data"]["notes"]]
    if "adapted" in origin:
        rows += _adapted_rows(origin)
    if "mape" in figures:
        bias = f"bias {figures['bias_wh']:+.0f} Wh on {figures['trips']} trips"
        rows += [("held-out trips", _errors(figures, bias)), ("protocol", figures["protocol"])]
    parts = (f"{name} ({part['bytes']} bytes)" for name, part in about["parts"].items())
    return [*rows, ("parts", ", ".join(parts))]


def _adapted_rows(origin: dict[str, Any]) -> list[tuple[str, str]]:
    """Return rows on the origin of an adapted model and on the changes by its own trips."""
    how, base = origin["adapted"], origin["base"]
    changes = [
        f"{name.replace('_', ' ')} {change(value, 'change')} (± {change(value, 'sd', sign='')})"
        for name, value in how["parameters"].items()
    ]
    about = base["model"]
    model = f"{about['vehicle_title']}, {about['corrector']}, {about['trips']} trips"
    return [
        ("base", f"{model}, SHA-256 {base['sha256']}"),
        ("adapted", f"with {how['trips']} own trips"),
        ("car against its simulation", ", ".join(changes)),
    ]
