"""Panels of a transfer report, for each car: its models, its learning curve, its trips and its physical parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from tripwatt.evaluation.transfer import TransferRun
from tripwatt.forecasting import GIVEN
from tripwatt.report.intervals import energy_rows, intervals_table
from tripwatt.report.panel import Panel
from tripwatt.report.style import (
    INK,
    RULE,
    annotate,
    legend_below,
    new_figure,
    percent_axis,
    row_names,
    style_context,
)
from tripwatt.report.tables import Column, Table, in_percent, in_words, number, tabulated
from tripwatt.report.words import listed, percent

Record = Mapping[str, Any]

COLOUR: Final[Mapping[str, str]] = MappingProxyType(
    {"transfer": "#0f8797", "physics": "#d55e00", "data": "#7d6bc6", "own": "#7c7c7c"}
)
"""Colour by the kind of a model."""


@dataclass(frozen=True, slots=True)
class TransferModel:
    """A model of a transfer run.

    Attributes
    ----------
    label : str
        Name for readers.
    kind : {"physics", "transfer", "data", "own"}
        `own` = trained on the scored car's own trips alone.
    physics : bool
        Whether it has a simulation.
    """

    label: str
    kind: Literal["physics", "transfer", "data", "own"]
    physics: bool = True


MODELS: Final[Mapping[str, TransferModel]] = MappingProxyType(
    {
        "physics": TransferModel("its physics alone", "physics"),
        "zero-shot": TransferModel("transfer, no own trip", "transfer"),
        "kriging-as-is": TransferModel("corrector as is", "transfer"),
        "boosting-as-is": TransferModel("trees on physics as is", "data"),
        "data-only": TransferModel("data only, as is", "data", physics=False),
        "own-kriging": TransferModel("own model: process", "own"),
        "own-ensemble": TransferModel("own model: ensemble", "own"),
        "own-channels": TransferModel("own model: default", "own"),
        "own-data-only": TransferModel("own model: data only", "own", physics=False),
    }
)
"""Models of every car by their names in the files; `models_of` adds the adapted model of a car."""

MODE_LABELS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "both": "terms of the corrector and physical parameters",
        "effects": "terms of the corrector alone",
        "parameters": "physical parameters alone",
    }
)
_MODE_STYLE: Final = {"both": ("-", "o", 2.4), "effects": ("--", "^", 1.3), "parameters": (":", "s", 1.3)}


def adapted_name(car: Record) -> str:
    """Name in the files of the model that is adapted with all own trips.

    Examples
    --------
    >>> adapted_name({"trips_first": 69})
    'adapted-69'
    """
    return f"adapted-{car['trips_first']}"


def models_of(car: Record) -> dict[str, TransferModel]:
    """The models of a car by name, the one with the lowest error first."""
    known = {
        **MODELS,
        adapted_name(car): TransferModel(f"transfer, all {car['trips_first']} own", "transfer"),
    }
    names = sorted(car["models"], key=lambda name: float(car["models"][name]["error"]))
    return {name: known.get(name, TransferModel(name, "own")) for name in names}


def best_own(car: Record) -> str | None:
    """The model of the car's own, with physics, that has the lowest error; None when none could be trained."""
    return next((name for name, m in models_of(car).items() if m.kind == "own" and m.physics), None)


def transfer_panels(run: TransferRun) -> list[Panel]:
    """Every panel of the page: for each car its models, its curve, its trips and its parameters."""
    with style_context():
        return [panel for car in run.results["cars"] for panel in _car_panels(run, car)]


def _car_panels(run: TransferRun, car: Record) -> Iterator[Panel]:
    results, note = run.results, _note(run.results, car)
    stem = "".join(c if c.isalnum() else "-" for c in f"car-{car['car']}-") if car["car"] else ""
    name = f"Car {car['car']}" if car["car"] else "The car"
    yield Panel(
        f"{stem}models",
        f"{name}: models on its second half of trips",
        said_of_models(car),
        plot_models(car, note),
        (models_table(results, car),),
    )
    if not car["trips_first"]:
        return
    yield Panel(
        f"{stem}curve",
        f"{name}: error by the number of own trips",
        said_of_curve(car),
        plot_curve(car, note),
        (curve_table(results, car), coverage_table(results, car)),
    )
    shown = ("physics", "zero-shot", adapted_name(car))
    yield Panel(
        f"{stem}trips",
        f"{name}: trip by trip",
        _said_of_trips(car, shown),
        plot_trips(run.trips[run.trips["car"] == car["car"]], car, shown, note),
    )
    yield Panel(
        f"{stem}parameters",
        f"{name}: physical parameters",
        _said_of_parameters(car),
        tables=(parameters_table(results, car),),
        wide=True,
    )


def _note(results: Record, car: Record) -> str:
    halves = (
        f"first half {car['trips_first']} trips, scored on the other {car['trips_second']}"
        if car["trips_first"]
        else f"scored on {car['trips_second']} trips, nothing learned from it"
    )
    name = f", car {car['car']}" if car["car"] else ""
    return f"{results['from']['vehicle_title']} → {results['to']['vehicle_title']}{name}\n{halves}"


def _captioned(caption: str, results: Record, car: Record) -> str:
    return f"{caption}, {'; '.join(_note(results, car).splitlines())}, {GIVEN}"


def said_of_models(car: Record) -> str:
    """The zero-shot error beside those of physics and of the data-driven model, and their paired differences."""
    error = {name: percent(score["error"]) for name, score in car["models"].items()}
    text = (
        f"Without a trip of its own, the error of the transfer is {error['zero-shot']}, that of its physics alone "
        f"{error['physics']}, and that of a data-driven model of the other car {error['data-only']}, {GIVEN}."
    )
    pairs = {(pair["a"], pair["b"]): pair for pair in car["paired"]}
    parts = []
    for other in ("physics", "data-only"):
        pair = pairs.get(("zero-shot", other))
        if pair is not None:
            low, high = pair["diff_ci95"]
            word = ("lower" if pair["diff"] < 0 else "higher") if pair["significant"] else "not significant"
            parts.append(
                f"{MODELS[other].label}: {number(pair['diff'], 100)} points ({number(low, 100)} to {number(high, 100)}, {word})"
            )
    return f"{text} Difference to {'; to '.join(parts)}." if parts else text


def models_table(results: Record, car: Record) -> Table:
    """Every model with error and bias."""
    return tabulated(
        _captioned("Errors", results, car),
        [{**car["models"][name], "label": model.label} for name, model in models_of(car).items()],
        Column("Model", "label"),
        in_percent("Error [%]", "error"),
        in_percent("95 % interval", "error_ci95"),
        in_percent("Bias [%]", "bias"),
        in_percent("95 % interval of the bias", "bias_ci95"),
    )


def plot_models(car: Record, note: str) -> Figure:
    """Error of every model with its interval over trips."""
    models = models_of(car)
    figure = new_figure(1.5 + 0.3 * len(models), "Error on held-out trips", f"{note}\n{GIVEN}", False)
    axes = figure.add_subplot()
    for row, (name, model) in enumerate(models.items()):
        score, colour = car["models"][name], COLOUR[model.kind]
        axes.plot(score["error_ci95"], [row, row], color=colour, lw=2.2, solid_capstyle="butt")
        axes.plot(score["error"], row, "o", color=colour, ms=7, gid=f"model-{name}")
        at = (score["error"], row)
        annotate(axes, f"{100 * score['error']:.1f}", at, (0, 6), size=8, ha="center")
    row_names(axes, [model.label for model in models.values()])
    axes.set_ylim(len(models) - 0.4, -0.8)
    axes.set_xlim(left=0.0)
    percent_axis(axes, "error of the energy [%], 95 % interval over trips")
    return figure


def said_of_curve(car: Record) -> str:
    """The error by the number of own trips, beside that of a model of the car's own."""
    rows = car["curves"]["both"]
    parts = [f"{percent(row['error'])} with {row['k']}" for row in rows]
    text = f"Error {listed(parts)} own trips, {GIVEN}."
    best = best_own(car)
    if best:
        text += (
            f" The best model trained on the whole first half alone ({MODELS[best].label}): "
            f"{percent(car['models'][best]['error'])}."
        )
    bar = car["bars"].get("ten_trips_within_15_percent_of_own")
    if bar:
        text += f" With 10 trips, the error of the transfer is {number(bar['ratio'])} times as large."
    return text


def curve_table(results: Record, car: Record) -> Table:
    """Error by the number of own trips."""
    curves = car["curves"]
    alone = zip(curves["effects"], curves["parameters"], strict=True)
    rows = [
        {**row, "terms": terms["error"], "parameters": parameters["error"]}
        for row, (terms, parameters) in zip(curves["both"], alone, strict=True)
    ]
    return tabulated(
        _captioned("Error by own trips", results, car),
        rows,
        Column("Own trips", "k", digits=0),
        Column("Draws", "draws", digits=0),
        in_percent("Error [%]", "error"),
        in_percent("95 % interval", "error_ci95"),
        in_percent("Bias [%]", "bias"),
        Column("In common", "share_in_common"),
        in_percent("Inside 90 % [%]", "inside_90", 0),
        in_percent("Terms alone [%]", "terms"),
        in_percent("Parameters alone [%]", "parameters"),
    )


def coverage_table(results: Record, car: Record) -> Table:
    """What the normal intervals without own trips and with the first half hold; results of older versions have none."""
    rows: list[tuple[str, ...]] = []
    for row in car["curves"]["both"]:
        if "coverage" in row:
            name = "no own trip" if row["k"] == 0 else f"{row['k']} own trips"
            rows += energy_rows(name, row, int(car["trips_second"]))
    return intervals_table(_captioned("Intervals by own trips", results, car), rows)


def plot_curve(car: Record, note: str) -> Figure:
    """Error against the number of own trips, with the models that need none or all of them as lines."""
    figure = new_figure(4.9, "How many trips of its own a car needs", f"{note}\n{GIVEN}", False)
    axes, models = figure.add_subplot(), models_of(car)
    main = car["curves"]["both"]
    place = {row["k"]: i for i, row in enumerate(main)}
    band = np.array([row["error_ci95"] for row in main]) * 100.0
    colour, words = COLOUR["transfer"], "95 % interval over draws and trips"
    axes.fill_between(range(len(main)), *band.T, color=colour, alpha=0.15, lw=0, label=words)
    for mode, (line, marker, width) in _MODE_STYLE.items():
        rows, label = car["curves"][mode], f"transfer: {MODE_LABELS[mode]}"
        at, errors = [place[row["k"]] for row in rows], [100.0 * row["error"] for row in rows]
        look: dict[str, Any] = {"linestyle": line, "marker": marker, "lw": width, "ms": 5}
        axes.plot(at, errors, color=colour, label=label, gid=f"curve-{mode}", **look)
    for name, line in (("physics", "-"), (best_own(car), "--"), ("data-only", "-")):
        if name in models:
            error, model = 100.0 * car["models"][name]["error"], models[name]
            look = {"color": COLOUR[model.kind], "lw": 1.6, "ls": line}
            axes.axhline(error, label=model.label, gid=f"line-{name}", **look)
    axes.set_xticks(range(len(main)), [str(row["k"]) for row in main])
    axes.set(xlabel="trips of its own", ylabel="error of the energy [%]")
    axes.set_ylim(bottom=0.0)
    axes.grid(axis="y")
    return legend_below(figure)


def _said_of_trips(car: Record, names: Sequence[str]) -> str:
    models = models_of(car)
    biases = [f"{percent(car['models'][name]['bias'])} ({models[name].label})" for name in names]
    return f"Bias {listed(biases)}; {GIVEN}."


def plot_trips(trips: pd.DataFrame, car: Record, names: Sequence[str], note: str) -> Figure:
    """Forecast against measured energy, one panel a model."""
    figure = new_figure(3.0, "Trip by trip", f"{note}\n{GIVEN}", False)
    panels = figure.subplots(1, len(names), sharex=True, sharey=True, squeeze=False)[0]
    most = 1.05 * float(trips[["observed_energy_wh", "predicted_energy_wh"]].max().max()) / 1e3
    models = models_of(car)
    for axes, name in zip(panels, names, strict=True):
        own = trips[trips["model"] == name]
        axes.plot([0, most], [0, most], color=RULE, lw=1.2)
        look: dict[str, Any] = {"ms": 3.2, "alpha": 0.75, "color": COLOUR[models[name].kind], "mec": "none"}
        axes.plot(own["observed_energy_wh"] / 1e3, own["predicted_energy_wh"] / 1e3, "o", **look)
        axes.set_title(models[name].label, color=INK, fontsize=8.5)
        axes.set(xlim=(0, most), ylim=(0, most), xlabel="measured [kWh]", aspect="equal")
    panels[0].set_ylabel("forecast [kWh]")
    return figure


def _said_of_parameters(car: Record) -> str:
    calibrated = (car["calibrated"] or {}).items()
    moved = [name.replace("_", " ") for name, value in calibrated if abs(value["change"]) > value["sd"]]
    return (
        "With the whole first half, further from their book value than one standard deviation: "
        f"{listed(moved)}. Widths are published spreads and not fitted; modes: {listed(list(MODE_LABELS.values()))}."
    )


def parameters_table(results: Record, car: Record) -> Table:
    """Prior and calibrated change of every physical parameter."""
    calibrated = car["calibrated"] or {}
    return tabulated(
        "Physical parameters of the car",
        [{**p, **calibrated.get(p["name"], {})} for p in results["parameters"]],
        Column("Parameter", lambda p: p["name"].replace("_", " ")),
        in_percent("Prior width [%]", "width", 0),
        in_percent("Change [%]", "change"),
        in_percent("± [%]", "sd"),
        in_words("Source of the width", "source"),
    )
