"""Simulated signals of the battery against measured ones."""

from __future__ import annotations

from typing import Any, Final

import pandas as pd

from tripwatt.report.panel import Content, panel
from tripwatt.report.tables import Table, number
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
    found = view.signals
    if found is None:
        return Content(
            "No comparison of signals: none of these trips has a measured current, voltage, battery temperature or SoC."
        )
    return Content(on_signals(found), tables=(signals_table(view, found),))


def on_signals(signals: pd.DataFrame) -> str:
    """Median root mean square errors of the simulated signals."""
    parts = []
    for column, (name, unit, factor, _) in SIGNALS.items():
        if column in signals and signals[column].notna().any():
            parts.append(f"{name} {factor * float(signals[column].median()):.2g} {unit}")
    return f"Median RMSE of {len(signals)} trips, simulated against measured: {listed(parts)}."


def signals_table(view: View, signals: pd.DataFrame) -> Table:
    """RMSE of simulated against measured signals: median, largest, and every trip."""
    shown = {c: found for c, found in SIGNALS.items() if c in signals}

    def row(head: str, values: pd.Series[Any]) -> tuple[str, ...]:
        return (head, *(number(float(values[c]), factor, n) for c, (_, _, factor, n) in shown.items()))

    columns = list(shown)
    rows = [row("Median of all trips", signals[columns].median()), row("Largest", signals[columns].max())]
    by_trip = signals.sort_values("trip", key=lambda names: names.map(natural_key))
    rows += [row(plain(line["trip"]), line) for _, line in by_trip.iterrows()]
    heads = ("Trip", *(f"{name[:1].upper()}{name[1:]} [{unit}]" for name, unit, _, _ in shown.values()))
    caption = view.captioned("RMSE of the simulated signals, by trip")
    return Table(caption, heads, tuple(rows), strong=frozenset({0, 1}))


PANELS = (signals,)
