"""Text of a proposed mapping: its tables with the reason for each line, and what has to be added by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import Fault
from tripwatt.sources.evidence import STAND_IN_V, Flow, Guess
from tripwatt.sources.mapping import POWER

HOLD_S: Final = 10

SPELLED: Final[Mapping[str, str]] = {
    unit.lower(): unit
    for unit in ("V", "mV", "kV", "A", "mA", "dA", "cA", "W", "kW", "PS", "degC", "degF", "K", "Nm")
} | {"c": "degC", "f": "degF", "kmh": "km/h", "kph": "km/h"}
"""Unit in lower case -> usual spelling."""


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A proposed mapping.

    Attributes
    ----------
    toml : str
        The mapping as a text to be saved, with the reason in each line.
    guesses : tuple of Guess
    missing : tuple of str
        What has to be added by hand before the mapping can be used.
    shipped : str or None
        Name of a shipped mapping whose columns the table has.
    unused : tuple of str
        Columns of the table that were not recognised.
    unfit : tuple of Fault
        Columns that by their names are time, speed, power, voltage or current, and whose cells are not.
    """

    toml: str
    guesses: tuple[Guess, ...]
    missing: tuple[str, ...]
    shipped: str | None
    unused: tuple[str, ...] = ()
    unfit: tuple[Fault, ...] = ()


def missing_entries(guesses: Mapping[str, Guess]) -> list[str]:
    """What has to be added to a proposal by hand: a column or an entry of `[battery]`."""
    missing = [ours for ours in ("time_s", "speed_m_s") if ours not in guesses]
    if "current_a" in guesses and "voltage_v" not in guesses and POWER not in guesses:
        return [*missing, "[battery] nominal_voltage_v"]
    if "current_a" in guesses or POWER in guesses:
        return missing
    by_charge = "soc" in guesses or "displayed_soc" in guesses
    return [*missing, "[battery] usable_capacity_kwh" if by_charge else "voltage_v and current_a"]


def sections_of(
    guesses: Mapping[str, Guess], flow: Flow, columns: Mapping[str, FloatArray], decimal: str
) -> dict[str, list[str]]:
    """The lines of each optional table of a proposal."""
    sections: dict[str, list[str]] = {name: [] for name in ("current", "trip", "battery", "file")}
    if flow.sign and {"current_a", POWER} & guesses.keys():
        sections["current"].append(f'positive = "{flow.sign}"  # {flow.why_sign}')
    if POWER in guesses and "voltage_v" not in guesses:
        note = "assumed, because no voltage is logged; only the power is measured"
        sections["battery"].append(f"nominal_voltage_v = {STAND_IN_V:g}  # {note}")
    if decimal == ",":
        sections["file"].append('decimal = ","  # the numbers have a decimal comma')
    missing = {
        guess.column: float(np.isnan(columns[guess.column]).mean())
        for ours, guess in guesses.items()
        if ours in ("speed_m_s", "voltage_v", "current_a", POWER) and guess.column in columns
    }
    column = max(missing, key=lambda name: missing[name], default="")
    # 0.2: if a larger share of a measured column is missing, the logger is taken to write a value only if
    # it changes
    if missing.get(column, 0.0) > 0.2:
        why = f"{missing[column]:.0%} of {quoted(column)} is missing: the last value is held"
        sections["file"].append(f"hold_s = {HOLD_S}  # {why}")
    return sections


def suggestion_of(
    path: Path,
    guesses: Mapping[str, Guess],
    sections: Mapping[str, Sequence[str]],
    missing: Sequence[str],
    unused: Sequence[str],
    shipped: str | None,
    *,
    always: Sequence[str] | None = None,
) -> Suggestion:
    """The proposal with its TOML; entries that are not in `always` are optional, by default none."""
    lines = [f"# Proposed for {_comment(path.name)} from its header and values. Check every line."]
    if shipped:
        lines.append(f"# The columns are those of the shipped mapping {shipped!r}: try --mapping {shipped}.")
    lines += [f"# TO DO: add {what}" for what in missing]
    if unused:
        shown = ", ".join(quoted(n) for n in unused[:12])
        lines.append(f"# Not used: {shown}" + (f" and {len(unused) - 12} more" if len(unused) > 12 else ""))
    lines.append("[columns]")
    for guess in guesses.values():
        entry = [f"column = {quoted(guess.column)}", f'unit = "{SPELLED.get(guess.unit, guess.unit)}"']
        more = {"date": guess.date, "format": guess.format}
        entry += [f"{key} = {quoted(text)}" for key, text in more.items() if text]
        entry += [] if always is None or guess.ours in always else ["optional = true"]
        lines.append(f"{guess.ours} = {{ {', '.join(entry)} }}  # {_comment(guess.why)}")
    for name, settings in sections.items():
        lines += ["", f"[{name}]", *settings] if settings else []
    toml = "\n".join(lines) + "\n"
    return Suggestion(toml, tuple(guesses.values()), tuple(missing), shipped, tuple(unused))


def _comment(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


def quoted(text: str) -> str:
    """A text as a basic string of TOML.

    Examples
    --------
    >>> quoted("speed [km/h]")
    '"speed [km/h]"'
    """
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
