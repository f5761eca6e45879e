"""Simulated signals of the battery against measured ones."""

from __future__ import annotations

from typing import Final

import pandas as pd

from tripwatt.report.panel import Content, panel
from tripwatt.report.tables import Column, Table, tabulated
from tripwatt.report.view import View, natural_key, plain
from tripwatt.report.words import listed

SIGNALS: Final = {
    "current_rmse_a": ("current", "A", 1.0, 1),
    "voltage_rmse_v": ("voltage", "V", 1.0, 2),
    "battery_temperature_rmse_degc": ("battery temperature", "°C", 1.0, 2),
    "soc_rmse": ("SoC", "points", 100.0, 2),
}
"""Column -> words, unit, factor from SI, digits."""


@panel("signals", "Simulated signals against measured ones (default preset)", folded=True)
def signals(view: View) -> Content:
    """Root mean square errors of the simulated signals."""
    errors = view.signals
    if errors is None:
        return Content(
            "No comparison of signals: none of these trips has a measured current, voltage, battery temperature or SoC."
        )
    return Content(on_signals(errors), tables=(signals_table(view, errors),))


def on_signals(signals: pd.DataFrame) -> str:
    """Median root mean square errors of the simulated signals."""
    parts = []
    for column, (name, unit, factor, _) in SIGNALS.items():
        if column in signals and signals[column].notna().any():
            parts.append(f"{name} {factor * float(signals[column].median()):.2g} {unit}")
    return f"Median RMSE of {len(signals)} trips, simulated against measured: {listed(parts)}."


def signals_table(view: View, signals: pd.DataFrame) -> Table:
    """RMSE of simulated against measured signals: median, largest, and every trip."""
    known = [column for column in SIGNALS if column in signals]
    by_trip = signals.sort_values("trip", key=lambda names: names.map(natural_key))
    middle, largest = signals[known].median().to_dict(), signals[known].max().to_dict()
    rows = [{**middle, "trip": "Median of all trips"}, {**largest, "trip": "Largest"}]
    return tabulated(
        view.captioned("RMSE of the simulated signals, by trip"),
        [*rows, *by_trip.to_dict("records")],
        Column("Trip", lambda row: plain(row["trip"])),
        *(
            Column(f"{name[:1].upper()}{name[1:]} [{unit}]", column, factor, digits)
            for column, (name, unit, factor, digits) in SIGNALS.items()
            if column in known
        ),
        strong=frozenset({0, 1}),
    )
