"""Commands of the forecast: fit a model, forecast a trip with one, look into one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from tripwatt.cli.options import (
    DataArgument,
    DatasetOption,
    JsonOption,
    MappingOption,
    SetOption,
    VehicleOption,
    car_of,
    examples,
    gather,
    read_logs,
)
from tripwatt.cli.output import write_text
from tripwatt.cli.printing import console, print_json, print_notes, print_table, progress
from tripwatt.errors import Fault, InvalidInput

if TYPE_CHECKING:
    from tripwatt.forecasting import Forecast, ForecastModel
    from tripwatt.trips import Departure, Flag, Fleet, Plan

OPTION_OF: Final = {
    "soc": "--soc",
    "ambient_temperature_degc": "--ambient",
    "cabin_setpoint_degc": "--setpoint",
    "cabin_temperature_degc": "--cabin-temperature",
    "battery_temperature_degc": "--battery-temperature",
    "payload_mass_kg": "--payload",
    "speed_m_s": "--speed",
    "vehicle": "--vehicle",
}
"""Field of a departure, or argument of the library -> the option that gives it."""
FAR_K: Final = 10.0
"""A cabin or battery so far from the air outside is worth a word when the air was chosen."""
PLOT_SUFFIXES: Final = (".png", ".svg", ".pdf")


def add_commands(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command(
        epilog=examples(
            ("tripwatt fit data/tum --out my-model", "fit on your copy of the TUM trips"),
            (
                "tripwatt fit logs --mapping my.toml --vehicle vw_id3 --out my-model",
                "fit on tables of one car",
            ),
            (
                "tripwatt fit logs --mapping my.toml --vehicle nissan_leaf_24 --base i3-model --out leaf-model",
                "adapt the model of one car to another car with a few of its trips",
            ),
            ("tripwatt fit --out example-model", "fit on the synthetic fleet, to try the commands"),
        )
    )(fit)
    app.command(
        epilog=examples(
            ("tripwatt example-trip --out trip.csv", "write an example trip"),
            (
                "tripwatt forecast trip.csv --soc 0.8 --ambient -5",
                "forecast it with the bundled model",
            ),
            (
                "tripwatt forecast my-model trip.csv --reserve 0.1 --plot forecast.png",
                "forecast it with your own model",
            ),
            (
                "tripwatt forecast trip.csv --observed so-far.csv --json",
                "update the forecast during the trip; so-far.csv has the samples so far, for example `head -601 trip.csv`",
            ),
            (
                "tripwatt forecast answer.json --soc 0.8 --ambient 5",
                "forecast a planned route from the saved response of a router",
            ),
            (
                "tripwatt forecast ride.gpx --speed 60",
                "forecast a track without times at a mean speed of 60 km/h",
            ),
            (
                "tripwatt forecast ride.gpx --vehicle vw_id3 --soc 0.8",
                "forecast for another car of the library",
            ),
        )
    )(forecast)
    app.command(
        epilog=examples(
            ("tripwatt inspect", "describe the bundled model"),
            ("tripwatt inspect my-model --json", "print all metadata of your model"),
        )
    )(inspect)
    app.command(
        "example-trip",
        epilog=examples(
            ("tripwatt example-trip --out trip.csv", "write an example trip for `tripwatt forecast trip.csv`")
        ),
    )(example)


def fit(
    data: DataArgument = None,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="MODEL",
            help="Folder of the model. It is created when the fit is complete.",
        ),
    ] = Path("model"),
    dataset: DatasetOption = None,
    mapping: MappingOption = None,
    vehicle: VehicleOption = None,
    overrides: SetOption = None,
    corrector: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Statistical model: linear, gp, boosting, forest, ensemble or split."
        ),
    ] = "split",
    calibrate: Annotated[
        bool,
        typer.Option(
            "--calibrate",
            help="Calibrate mass, rolling resistance, air drag and base load of the car on the trips before the fit. The "
            "estimates are shrunk towards the published values.",
        ),
    ] = False,
    base: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL",
            help="Adapt this model of another car to the trips. A few trips are enough. --corrector and --seed are then "
            "taken from this model.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Seed of the random numbers. The same seed gives the same model."
        ),
    ] = 0,
    as_json: JsonOption = False,
) -> None:
    """Fit a forecasting model on logged trips and write it as a folder.

    The command audits the trips, fits on the sound ones, and estimates the uncertainty of forecasts from held-out trips.
    It writes the arrays of the model and metadata.json with inputs, provenance, scores and checksums.
    """
    from tripwatt.modelfile import require_place
    from tripwatt.vehicles import load_vehicle, parse_overrides

    shown = console()
    car, note = car_of(vehicle, data, dataset, mapping)
    fleets: list[Fleet] = []
    cars: list[Any] = []
    bases: list[tuple[ForecastModel, dict[str, Any]]] = []

    def read() -> None:
        with shown.status("reading trips"):
            fleets.append(read_logs(data, dataset, mapping))

    gather(
        lambda: None if base is None else bases.append(_stored(base)),
        lambda: _require_storable(corrector),
        lambda: _require_one_way(base, calibrate),
        lambda: cars.append(load_vehicle(car, overrides=parse_overrides(overrides or []))),
        lambda: require_place(out),
        read,
    )
    fleet = replace(fleets[0], notes=(*fleets[0].notes, *note))
    shown.print(f"{len(fleet.trips)} trips read ({fleet.name})")
    from tripwatt.forecasting.storage import save_model
    from tripwatt.forecasting.training import train_model

    if bases:
        from tripwatt.transfer.adapting import adapt_model

        with shown.status("adapting the base"):
            model, provenance, figures = adapt_model(fleet, cars[0], *bases[0])
    else:
        with progress(shown) as advance:
            model, provenance, figures = train_model(
                fleet,
                cars[0],
                corrector=corrector,
                seed=seed,
                calibrated=calibrate,
                progress=advance,
            )
    save_model(model, out, provenance=provenance, evaluation=figures)
    _show_fit(fleet, out, provenance, figures, as_json)


def _stored(folder: Path) -> tuple[ForecastModel, dict[str, Any]]:
    """A stored model and what it says of itself."""
    from tripwatt.forecasting import load_metadata, load_model

    return load_model(folder), load_metadata(folder, check_parts=False)


def _require_storable(corrector: str) -> None:
    from tripwatt.hybrid import POWER_CORRECTORS

    storable = [name for name in POWER_CORRECTORS if name != "gamm"]
    if corrector not in storable:
        raise InvalidInput(Fault("unknown corrector", "--corrector", corrector, ", ".join(storable)))


def _require_one_way(base: Path | None, calibrate: bool) -> None:
    if base is not None and calibrate:
        fix = "remove --calibrate; --base includes the calibration of the car"
        raise InvalidInput(Fault("conflicting options", "--calibrate", "with --base", "one of the two", fix))


def _show_fit(
    fleet: Fleet, out: Path, provenance: Mapping[str, Any], figures: dict[str, Any], as_json: bool
) -> None:
    from tripwatt.transfer.adapting import PROTOCOL

    notes = provenance["data"]["notes"]
    if as_json:
        brief = {k: v for k, v in figures.items() if k != "by_trip"}
        print_json({"model": str(out), "data": fleet.name, "evaluation": brief, "notes": notes})
        return
    how = "adapted to" if figures.get("protocol") == PROTOCOL else "fitted on"
    typer.echo(f"model: {out}, {how} {figures['trips']} trips ({fleet.name})")
    typer.echo(
        f"held-out trips: mean error {figures['mape']:.1%}, RMSE {figures['rmse_wh'] / 1000.0:.3f} kWh, "
        f"{figures['given']}"
    )
    print_notes(notes)


def forecast(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="[MODEL] TRIP",
            help="Folder of a model (default: the bundled model), and a trip. The trip is a speed trace or a planned route. "
            "Speed trace: CSV or Parquet with the columns time_s, speed_m_s, and optionally elevation_m or grade; other "
            "signals give only their first sample. Planned route: GPX, GeoJSON, the saved response of OSRM, Valhalla, "
            "openrouteservice or GraphHopper, or links as CSV or JSON (length_m, speed_m_s or travel_time_s, and optionally "
            "grade or start_elevation_m and end_elevation_m, stop_s, speed_limit_m_s).",
            show_default=False,
        ),
    ],
    soc: Annotated[
        float | None,
        typer.Option(
            "--soc", metavar="0..1", help="Displayed state of charge at departure.", show_default=False
        ),
    ] = None,
    ambient: Annotated[
        float | None,
        typer.Option(
            "--ambient",
            "--ambient-temperature-degc",
            metavar="°C",
            help="Outside temperature.",
            show_default=False,
        ),
    ] = None,
    setpoint: Annotated[
        float | None,
        typer.Option(
            "--setpoint",
            "--cabin-setpoint-degc",
            metavar="°C",
            help="Set-point of the cabin temperature.",
            show_default=False,
        ),
    ] = None,
    payload: Annotated[
        float | None,
        typer.Option(
            "--payload",
            "--payload-mass-kg",
            metavar="KG",
            help="Mass of passengers and luggage, without the driver.",
            show_default=False,
        ),
    ] = None,
    battery_temperature: Annotated[
        float | None,
        typer.Option(
            "--battery-temperature",
            "--battery-temperature-degc",
            metavar="°C",
            help="Battery temperature at departure.",
            show_default=False,
        ),
    ] = None,
    cabin_temperature: Annotated[
        float | None,
        typer.Option(
            "--cabin-temperature",
            "--cabin-temperature-degc",
            metavar="°C",
            help="Cabin temperature at departure.",
            show_default=False,
        ),
    ] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            metavar="NAME|FILE",
            help="Forecast for another car: a name from `tripwatt vehicles`, or a TOML file. The model has no trips of "
            "this car, so the interval is wider.",
            show_default=False,
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="KM/H",
            help="Mean speed on a track without times and speeds.",
            show_default=False,
        ),
    ] = None,
    observed: Annotated[
        Path | None,
        typer.Option(
            metavar="SAMPLES",
            help="Samples measured so far, on the clock of the trip: time_s with voltage_v and current_a, or with soc or "
            "displayed_soc. On a planned route, speed_m_s gives the distance driven.",
            show_default=False,
        ),
    ] = None,
    reserve: Annotated[
        float, typer.Option(metavar="0..1", help="Required state of charge at arrival, as displayed.")
    ] = 0.1,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write a figure of the forecast: .png, .svg or .pdf.", show_default=False
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Forecast the energy of a trip with its interval and its causes, given a speed trace or a planned route.

    A driver model turns a planned route into a speed trace. The interval includes the error of this step, which was
    measured when the model was fitted. State of charge is the displayed one.
    """
    from tripwatt.api import read_route
    from tripwatt.forecasting import load_model
    from tripwatt.transfer.zero_shot import on_vehicle
    from tripwatt.trips import Departure
    from tripwatt.units import M_S_PER_KM_H
    from tripwatt.vehicles import load_vehicle

    model, trip = _model_and_trip(paths)
    got: dict[str, Any] = {}
    with options_named():
        gather(
            lambda: _require_options(reserve, plot),
            lambda: got.update(model=load_model(model)),
            lambda: got.update(
                plan=read_route(trip, speed_m_s=None if speed is None else speed * M_S_PER_KM_H)
            ),
            lambda: None if observed is None else got.update(observed=_measured(observed)),
            lambda: got.update(car=None if vehicle is None else load_vehicle(vehicle)),
            lambda: got.update(
                departure=Departure(
                    soc=soc,
                    ambient_temperature_degc=ambient,
                    cabin_setpoint_degc=setpoint,
                    cabin_temperature_degc=cabin_temperature,
                    battery_temperature_degc=battery_temperature,
                    payload_mass_kg=payload,
                )
            ),
        )
        fitted, flags = on_vehicle(got["model"], got["car"])
    plan, departure = got["plan"], got["departure"]
    found = fitted.forecast(plan, departure)
    found = replace(found, flags=(*flags, *found.flags, *_still_warm(plan, departure)))
    if observed is not None:
        found = found.update(got["observed"])
    if plot is not None:
        _draw(found, plot)
    print_json(found.to_dict(reserve)) if as_json else _show_forecast(found, reserve)


@contextmanager
def options_named() -> Iterator[None]:
    """Faults of what options give, under the names of the options."""
    try:
        yield
    except InvalidInput as error:
        named = [replace(fault, where=OPTION_OF.get(fault.where, fault.where)) for fault in error.faults]
        raise InvalidInput(named) from error


def _still_warm(plan: Plan, asked: Departure) -> list[Flag]:
    """Temperatures of the file that are far from the outside temperature that was given."""
    from tripwatt.trips import Flag

    ambient = asked.ambient_temperature_degc
    flags = []
    for name in ("cabin_temperature_degc", "battery_temperature_degc"):
        start = getattr(plan.departure, name)
        if ambient is None or getattr(asked, name) is not None or start is None:
            continue
        if abs(start - ambient) > FAR_K:
            flags.append(Flag("file_value_kept", name, start, "degc"))
    return flags


def _model_and_trip(paths: list[Path]) -> tuple[Path | None, Path]:
    if len(paths) > 2:
        got = " ".join(map(str, paths))
        raise InvalidInput(
            Fault("too many arguments", "MODEL TRIP", got, "a folder with a model and a file with a trip")
        )
    return (None, paths[0]) if len(paths) == 1 else (paths[0], paths[1])


def _require_options(reserve: float, plot: Path | None) -> None:
    faults = []
    if not 0.0 <= reserve <= 1.0:
        faults.append(Fault("value out of range", "--reserve", f"{reserve:g}", "0 to 1"))
    if plot is not None and plot.suffix.lower() not in PLOT_SUFFIXES:
        faults.append(Fault("unknown image format", "--plot", str(plot), ", ".join(PLOT_SUFFIXES)))
    if plot is not None and not plot.absolute().parent.is_dir():
        faults.append(Fault("no such folder", "--plot", str(plot.parent), "an existing folder"))
    if faults:
        raise InvalidInput(faults)


def _measured(path: Path) -> Any:
    from tripwatt.sources.canonical import read_canonical

    return read_canonical(path, required=("time_s",), least=2)


def _draw(found: Forecast, plot: Path) -> None:
    try:
        found.plot().savefig(plot, dpi=150)
    except OSError as error:
        got = f"{plot}: {error.strerror or error}"
        raise InvalidInput(Fault("cannot write the image", "--plot", got, "a writable file")) from error


def _show_forecast(found: Forecast, reserve: float) -> None:
    from tripwatt.cli.sentences import chance, forecast_in_words
    from tripwatt.forecasting.plots import CAUSE_NAMES
    from tripwatt.trips.messages import period

    low, high = found.interval(0.9)
    when = "before departure" if found.measured_until_s <= 0.0 else f"after {period(found.measured_until_s)}"
    rows = [
        ("energy", f"{found.energy_wh / 1000.0:.2f} kWh"),
        ("90 % interval", f"{low / 1000.0:.2f} to {high / 1000.0:.2f} kWh"),
        ("state of charge at arrival", f"{100.0 * found.soc_arrival:.0f} %"),
        ("probability to arrive", chance(found.p_arrive())),
        (f"probability to arrive with {100.0 * reserve:g} % or more", chance(found.p_arrive(reserve))),
    ]
    typer.echo(f"{forecast_in_words(found, found.plan.trip_id)}\n")
    print_table(f"Forecast {when}, given {found.given}", ("forecast", ""), rows, numbers=("",))
    causes = [
        (CAUSE_NAMES.get(cause, cause), f"{round(energy / 1000.0, 3) + 0.0:+.3f} kWh")
        for cause, energy in found.by_cause_wh.items()
        if cause != "shortfall" or energy
    ]
    print_table("Energy by cause", ("cause", "energy"), causes, numbers=("energy",))
    print_notes(found.flags)


def inspect(
    model: Annotated[
        Path | None,
        typer.Argument(
            metavar="MODEL",
            help="Folder of a model. Default: the bundled model.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the inputs, the provenance and the scores of a model, and verify its checksums."""
    from tripwatt.forecasting import load_metadata

    about = load_metadata(model)
    if as_json:
        print_json(about)
        return
    print_table("Model", ("", "value"), _about_rows(about), folding=("value",))
    columns = ("input", "unit", "allowed", "range in training", "required")
    rows = [
        (
            entry["name"],
            entry["unit"],
            _range(entry["minimum"], entry["maximum"]),
            _range(*entry["training"]) if "training" in entry else "",
            ("yes" if entry["required"] else "no")
            + (", first sample" if entry["samples"] == "first" else ""),
        )
        for entry in about["contract"]["inputs"]
    ]
    print_table("Inputs", columns, rows)


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
        rows.append(
            (
                "held-out trips",
                f"mean error {figures['mape']:.1%}, RMSE {figures['rmse_wh'] / 1000.0:.3f} kWh, "
                f"bias {figures['bias_wh']:+.0f} Wh on {figures['trips']} trips, {figures['given']}",
            )
        )
        rows.append(("protocol", figures["protocol"]))
    rows.append(
        ("parts", ", ".join(f"{name} ({part['bytes']} bytes)" for name, part in about["parts"].items()))
    )
    return rows


def _adapted_rows(origin: dict[str, Any]) -> list[tuple[str, str]]:
    """Where an adapted model comes from, and what its own trips changed."""
    how, base = origin["adapted"], origin["base"]
    changes = [
        f"{name.replace('_', ' ')} {value['change']:+.1%} (standard deviation {value['sd']:.1%})"
        for name, value in how["parameters"].items()
    ]
    told = base["model"]
    return [
        (
            "base",
            f"{told['vehicle_title']}, {told['corrector']}, {told['trips']} trips, SHA-256 {base['sha256']}",
        ),
        (
            "adapted",
            f"with {how['trips']} own trips; {how['share_in_common']:.0%} of the base's correction is shared",
        ),
        *([("car against published values", ", ".join(changes))] if changes else []),
    ]


def _range(low: float | None, high: float | None) -> str:
    return f"{'-' if low is None else f'{low:g}'} to {'-' if high is None else f'{high:g}'}"


def example(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Write the table to this file instead of printing it.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Number of the trip.")] = 0,
) -> None:
    """Print a synthetic trip as a CSV table, as an input for `tripwatt forecast`.

    The trip is computed. It does not describe a real car.
    """
    from tripwatt.synthetic import example_trip

    text = example_trip(seed).to_csv(index=False, lineterminator="\n")
    if out is None:
        typer.echo(text, nl=False)
        return
    write_text(text, out)
    print_notes([f"{out} is a synthetic trip; it does not describe a real car"])
