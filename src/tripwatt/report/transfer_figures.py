"""Figures of a transfer: each `plot_` takes a car's part of the results and gives a matplotlib `Figure`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from tripwatt.report.style import INK, RULE, new_figure, percent_axis, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GIVEN: Final = "given the driven speed trace"
COLOUR: Final[Mapping[str, str]] = MappingProxyType(
    {"hybrid": "#0f8797", "physics": "#d55e00", "data": "#7d6bc6", "own": "#7c7c7c"}
)
"""Colour by what a model stands on."""

LABELS: Final[Mapping[str, tuple[str, str]]] = MappingProxyType(
    {
        "physics": ("its physics alone", "physics"),
        "zero-shot": ("transfer, no own trip", "hybrid"),
        "kriging-as-is": ("corrector as is", "hybrid"),
        "boosting-as-is": ("trees on physics as is", "data"),
        "data-only": ("data only, as is", "data"),
        "own-kriging": ("own model: process", "own"),
        "own-ensemble": ("own model: ensemble", "own"),
        "own-channels": ("own model: default", "own"),
        "own-data-only": ("own model: data only", "own"),
    }
)
"""Model -> name for readers and what it stands on."""

MODE_LABELS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "both": "terms of the corrector and physical parameters",
        "effects": "terms of the corrector alone",
        "parameters": "physical parameters alone",
    }
)
_MODE_STYLE: Final = {"both": ("-", "o", 2.4), "effects": ("--", "^", 1.3), "parameters": (":", "s", 1.3)}


def model_name(model: str) -> str:
    """A model's name for readers.

    Examples
    --------
    >>> model_name("physics"), model_name("adapted-69")
    ('its physics alone', 'transfer, all 69 own')
    """
    if model.startswith("adapted-"):
        return f"transfer, all {model.removeprefix('adapted-')} own"
    return LABELS.get(model, (model, "own"))[0]


def best_own(car: Mapping[str, Any]) -> str | None:
    """The model of the car's own, with physics, that errs least; None when none could be trained."""
    own = [m for m in car["models"] if m.startswith("own-") and m != "own-data-only"]
    return min(own, key=lambda m: float(car["models"][m]["error"]), default=None)


@styled
def plot_curve(car: Mapping[str, Any], *, note: str = "") -> Figure:
    """Error against the number of own trips, with what needs none or all of them as lines."""
    figure = new_figure(4.9, "How many trips of its own a car needs", f"{note}\n{GIVEN}", False)
    axes = figure.add_subplot()
    main = car["curves"]["both"]
    place = {row["k"]: i for i, row in enumerate(main)}
    band = np.array([row["error_ci95"] for row in main]) * 100.0
    axes.fill_between(
        range(len(main)),
        band[:, 0],
        band[:, 1],
        color=COLOUR["hybrid"],
        alpha=0.15,
        lw=0,
        label="95 % interval over draws and trips",
    )
    for mode, (line, marker, width) in _MODE_STYLE.items():
        rows = car["curves"][mode]
        axes.plot(
            [place[row["k"]] for row in rows],
            [100.0 * row["error"] for row in rows],
            linestyle=line,
            marker=marker,
            ms=5,
            lw=width,
            color=COLOUR["hybrid"],
            label=f"transfer: {MODE_LABELS[mode]}",
            gid=f"curve-{mode}",
        )
    for model, line in (("physics", "-"), (best_own(car) or "", "--"), ("data-only", "-")):
        if model in car["models"]:
            axes.axhline(
                100.0 * car["models"][model]["error"],
                color=COLOUR[LABELS[model][1]],
                lw=1.6,
                ls=line,
                label=model_name(model),
                gid=f"line-{model}",
            )
    axes.set_xticks(range(len(main)), [str(row["k"]) for row in main])
    axes.set(xlabel="trips of its own", ylabel="error of the energy [%]")
    axes.set_ylim(bottom=0.0)
    axes.grid(axis="y")
    figure.legend(loc="outside lower left", ncols=1)
    return figure


@styled
def plot_models(car: Mapping[str, Any], *, note: str = "") -> Figure:
    """Error of every model with its interval over trips."""
    models = sorted(car["models"], key=lambda name: float(car["models"][name]["error"]))
    figure = new_figure(
        1.5 + 0.3 * len(models), "Error on trips that nobody learned from", f"{note}\n{GIVEN}", False
    )
    axes = figure.add_subplot()
    for row, name in enumerate(models):
        score = car["models"][name]
        kind = "hybrid" if name.startswith("adapted-") else LABELS[name][1]
        low, high = score["error_ci95"]
        axes.plot([low, high], [row, row], color=COLOUR[kind], lw=2.2, solid_capstyle="butt")
        axes.plot(score["error"], row, "o", color=COLOUR[kind], ms=7, gid=f"model-{name}")
        axes.annotate(
            f"{100 * score['error']:.1f}",
            (score["error"], row),
            (0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=8,
        )
    axes.set_yticks(range(len(models)), [model_name(name) for name in models])
    axes.set_ylim(len(models) - 0.4, -0.8)
    axes.set_xlim(left=0.0)
    axes.tick_params(axis="y", length=0)
    percent_axis(axes, "error of the energy [%], 95 % interval over trips")
    return figure


@styled
def plot_trips(trips: pd.DataFrame, models: Sequence[str], *, note: str = "") -> Figure:
    """Forecast against measured energy, one panel a model."""
    figure = new_figure(3.0, "Trip by trip", f"{note}\n{GIVEN}", False)
    panels = figure.subplots(1, len(models), sharex=True, sharey=True, squeeze=False)[0]
    most = 1.05 * float(trips[["observed_energy_wh", "predicted_energy_wh"]].max().max()) / 1e3
    for axes, model in zip(panels, models, strict=True):
        own = trips[trips["model"] == model]
        kind = "hybrid" if model.startswith("adapted-") else LABELS[model][1]
        axes.plot([0, most], [0, most], color=RULE, lw=1.2)
        axes.plot(
            own["observed_energy_wh"] / 1e3,
            own["predicted_energy_wh"] / 1e3,
            "o",
            ms=3.2,
            alpha=0.75,
            color=COLOUR[kind],
            mec="none",
        )
        axes.set_title(model_name(model), color=INK, fontsize=8.5)
        axes.set(xlim=(0, most), ylim=(0, most), xlabel="measured [kWh]", aspect="equal")
    panels[0].set_ylabel("forecast [kWh]")
    return figure
