"""The report of a transfer: one self-contained page, its figures and tables, said from the numbers."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tripwatt.report.html import inline_svg, png_bytes, svg_text
from tripwatt.report.panels import Panel
from tripwatt.report.sentences import listed, percent
from tripwatt.report.tables import Table, number, span
from tripwatt.report.transfer_figures import (
    GIVEN,
    MODE_LABELS,
    best_own,
    model_name,
    plot_curve,
    plot_models,
    plot_trips,
)

if TYPE_CHECKING:
    from tripwatt.evaluation.transfer import TransferRun

COLUMNS: Final = ("Model", "Error [%]", "95 % interval", "Bias [%]", "95 % interval of the bias")
CURVE_COLUMNS: Final = (
    "Own trips",
    "Draws",
    "Error [%]",
    "95 % interval",
    "Bias [%]",
    "In common",
    "Inside 90 % [%]",
    "Terms alone [%]",
    "Parameters alone [%]",
)


def write_transfer(run: TransferRun, out: Path) -> None:
    """Write `results.json`, `trips.csv`, `report.html` and `figures/` into a folder, `results.json` last.

    Parameters
    ----------
    run : TransferRun
    out : Path
        Made when it is not there.
    """
    panels = transfer_panels(run)
    folder = out / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for panel in panels:
        if panel.figure is not None:
            _write(folder / f"{panel.key}.svg", svg_text(panel.figure).encode("utf-8"))
            _write(folder / f"{panel.key}.png", png_bytes(panel.figure))
    run.trips.to_csv(out / "trips.csv", index=False, lineterminator="\n")
    _write(out / "report.html", _page(run.results, panels).encode("utf-8"))
    text = json.dumps(run.results, indent=1, allow_nan=False)
    _write(out / "results.json", text.encode("utf-8"))


def _write(path: Path, content: bytes) -> None:
    partial = path.with_name(f"{path.name}.partial")
    partial.write_bytes(content)
    os.replace(partial, path)


def transfer_panels(run: TransferRun) -> list[Panel]:
    """Every panel of the page: for each car its models, its curve and its trips, then what was assumed."""
    results = run.results
    panels: list[Panel] = []
    for car in results["cars"]:
        stem, note = _stem(car), _note(results, car)
        panels.append(
            Panel(
                f"{stem}models",
                f"{_called(car)}: what a model of another car is worth",
                said_of_models(car),
                plot_models(car, note=note),
                (models_table(results, car),),
            )
        )
        if not car["trips_first"]:
            continue
        panels.append(
            Panel(
                f"{stem}curve",
                f"{_called(car)}: how many trips of its own it takes",
                said_of_curve(car),
                plot_curve(car, note=note),
                (curve_table(results, car),),
            )
        )
        own = run.trips[run.trips["car"] == car["car"]]
        last = f"adapted-{car['trips_first']}"
        shown = plot_trips(own, ("physics", "zero-shot", last), note=note)
        panels.append(Panel(f"{stem}trips", f"{_called(car)}: trip by trip", _said_of_trips(car), shown, ()))
        panels.append(_calibration(results, car, stem))
    return panels


def _stem(car: Mapping[str, Any]) -> str:
    return "".join(c if c.isalnum() else "-" for c in f"car-{car['car']}-") if car["car"] else ""


def _called(car: Mapping[str, Any]) -> str:
    return f"Car {car['car']}" if car["car"] else "The car"


def _note(results: Mapping[str, Any], car: Mapping[str, Any]) -> str:
    halves = (
        f"first half {car['trips_first']} trips, scored on the other {car['trips_second']}"
        if car["trips_first"]
        else f"scored on {car['trips_second']} trips, nothing learned from it"
    )
    name = f", car {car['car']}" if car["car"] else ""
    return f"{results['from']['vehicle_title']} → {results['to']['vehicle_title']}{name}\n{halves}"


def _line(results: Mapping[str, Any], car: Mapping[str, Any]) -> str:
    return _note(results, car).replace("\n", "; ")


def said_of_models(car: Mapping[str, Any]) -> str:
    """The zero-shot error beside physics and the data-driven model, with what is told apart."""
    models = car["models"]
    text = (
        f"Without a trip of its own the transfer is off by {percent(models['zero-shot']['error'])}, its physics alone by "
        f"{percent(models['physics']['error'])}, a data-driven model of the other car as it is by "
        f"{percent(models['data-only']['error'])}, {GIVEN}."
    )
    told = []
    for pair in car["paired"]:
        if pair["a"] == "zero-shot" and pair["b"] in ("physics", "data-only"):
            low, high = pair["diff_ci95"]
            word = ("lower" if pair["diff"] < 0 else "higher") if pair["significant"] else "not told apart"
            told.append(
                f"{model_name(pair['b'])}: {number(pair['diff'], 100)} points ({number(low, 100)} to {number(high, 100)}, {word})"
            )
    return f"{text} Difference to {'; to '.join(told)}." if told else text


def said_of_curve(car: Mapping[str, Any]) -> str:
    """How the error falls with own trips, and how it stands to a model of the car's own."""
    rows = car["curves"]["both"]
    text = (
        "Error "
        + listed([f"{percent(row['error'])} with {row['k']}" for row in rows])
        + f" own trips, {GIVEN}."
    )
    best = best_own(car)
    if best:
        text += f" The best model trained on the whole first half alone ({model_name(best)}): {percent(car['models'][best]['error'])}."
    bar = car["bars"].get("ten_trips_within_15_percent_of_own")
    if bar:
        text += f" With 10 trips the transfer errs {number(bar['ratio'])} times as much as that."
    return text


def _said_of_trips(car: Mapping[str, Any]) -> str:
    models = car["models"]
    shown = ("physics", "zero-shot", f"adapted-{car['trips_first']}")
    return (
        "Bias " + listed([f"{percent(models[m]['bias'])} ({model_name(m)})" for m in shown]) + f"; {GIVEN}."
    )


def models_table(results: Mapping[str, Any], car: Mapping[str, Any]) -> Table:
    """Every model with error and bias."""
    names = sorted(car["models"], key=lambda name: float(car["models"][name]["error"]))
    rows = [
        (
            model_name(name),
            number(car["models"][name]["error"], 100, 1),
            span(car["models"][name]["error_ci95"]),
            number(car["models"][name]["bias"], 100, 1),
            span(car["models"][name]["bias_ci95"]),
        )
        for name in names
    ]
    return Table(f"Errors, {_line(results, car)}, {GIVEN}", COLUMNS, tuple(rows))


def curve_table(results: Mapping[str, Any], car: Mapping[str, Any]) -> Table:
    """Error by the number of own trips."""
    other = [car["curves"][mode] for mode in ("effects", "parameters")]
    rows = [
        (
            str(row["k"]),
            str(row["draws"]),
            number(row["error"], 100, 1),
            span(row["error_ci95"]),
            number(row["bias"], 100, 1),
            number(row["share_in_common"]),
            number(row["inside_90"], 100, 0),
            number(terms["error"], 100, 1),
            number(parameters["error"], 100, 1),
        )
        for row, terms, parameters in zip(car["curves"]["both"], *other, strict=True)
    ]
    return Table(f"Error by own trips, {_line(results, car)}, {GIVEN}", CURVE_COLUMNS, tuple(rows))


def _calibration(results: Mapping[str, Any], car: Mapping[str, Any], stem: str) -> Panel:
    found = car["calibrated"] or {}
    rows = [
        (
            p["name"].replace("_", " "),
            number(p["width"], 100, 0),
            number(found.get(p["name"], {}).get("change"), 100, 1),
            number(found.get(p["name"], {}).get("sd"), 100, 1),
            p["source"],
        )
        for p in results["parameters"]
    ]
    moved = [name for name, value in found.items() if abs(value["change"]) > value["sd"]]
    said = (
        f"With the whole first half, further from their book value than one standard deviation: {listed([m.replace('_', ' ') for m in moved])}. "
        f"Widths are published spreads and not fitted; modes: {listed(list(MODE_LABELS.values()))}."
    )
    columns = ("Parameter", "Prior width [%]", "Change [%]", "± [%]", "Where the width comes from")
    table = Table("Physical parameters of the car", columns, tuple(rows), text_columns=frozenset({4}))
    return Panel(
        f"{stem}parameters", f"{_called(car)}: what its book may have wrong", said, None, (table,), wide=True
    )


def _page(results: Mapping[str, Any], panels: Sequence[Panel]) -> str:
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tripwatt.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawn = {
        panel.key: Markup(  # our own SVG, in which matplotlib has escaped every name
            inline_svg(svg_text(panel.figure), panel.key, f"{panel.title}. {panel.sentence}")
        )
        for panel in panels
        if panel.figure is not None
    }
    source, target = results["from"], results["to"]
    facts = [
        ("From", f"{source['vehicle_title']}, {source['trips_used']} trips ({source['dataset']})"),
        ("To", f"{target['vehicle_title']}, {target['trips_used']} trips ({target['dataset']})"),
        ("Draws, seed", f"{results['draws']}, {results['seed']}"),
        ("Hidden", ", ".join(results["hidden"]).replace("_", " ") or "nothing"),
    ]
    return environment.get_template("transfer.html.jinja").render(
        facts=facts,
        panels=panels,
        drawn=drawn,
        notes=results["notes"],
        audit=results["audit"],
        citations=results["citations"],
        versions=", ".join(f"{name} {version}" for name, version in results["versions"].items()),
    )
