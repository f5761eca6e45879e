"""Units and meaning of a table's columns from their values.

Units follow from the ranges of values, the format of time stamps from their texts. Newton's second law shows which column is
the current, what its sign means, and which unit the speed has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.arrays import FloatArray
from tripwatt.sources.mapping import POWER, UNITS
from tripwatt.sources.naming import may_hold, unit_in, vocabulary
from tripwatt.trips import COLUMNS
from tripwatt.trips.inertia import apparent_mass
from tripwatt.units import M_S_PER_KM_H, M_S_PER_MPH, SECONDS_PER_HOUR

LIGHTEST_KG, HEAVIEST_KG = 600.0, 4500.0
FURTHEST_KG: Final = (300.0, 9000.0)
"""A stated unit of speed is marked for a check if the car's apparent mass is outside this range: grades and heaters blur the mass."""
PACK_V: Final = (150.0, 950.0)
STAND_IN_V: Final = 360.0
"""Pack voltage if none is logged; any voltage of a pack is good enough to find the sign of the current."""
MAX_COLUMNS: Final = 12

SINCE_1970: Final = 1e8
"""Times above this count from 1970: no trip lasts so many seconds."""


SPEED_UNITS: Final = {"m/s": 1.0, "km/h": M_S_PER_KM_H, "mph": M_S_PER_MPH}


@dataclass(frozen=True, slots=True)
class Guess:
    """A guess which column of the table has the values of our column `ours`, with unit and reason."""

    ours: str
    column: str
    unit: str
    why: str
    format: str = ""
    date: str = ""


@dataclass(frozen=True, slots=True)
class Flow:
    """Findings from the flow of power: recognised columns, sign of the current, mass of the car in the assumed unit of speed."""

    guesses: tuple[Guess, ...] = ()
    sign: str = ""
    why_sign: str = ""
    mass_kg: float | None = None


def stamp_format(texts: Sequence[str]) -> tuple[str, str] | None:
    """The `strptime` format of a column of time stamps, empty for ISO 8601, and the reason; None if the texts are no time stamps.

    Examples
    --------
    >>> stamp_format(["2024-05-31T08:00:00Z", "2024-05-31T08:00:01Z"])
    ('', 'time stamps, ISO 8601')
    >>> stamp_format(["31.05.2024 08:00:00"])[0], stamp_format(["Monday"])
    ('%d.%m.%Y %H:%M:%S', None)
    """
    if fits(texts, "ISO8601"):
        return "", "time stamps, ISO 8601"
    fitting = [form for form in vocabulary()["stamps"] if fits(texts, form)]
    if not fitting:
        return None
    unclear = "" if len(fitting) == 1 else f"; CHECK: may be {' or '.join(fitting[1:3])}"
    return fitting[0], f"time stamps such as {next(filter(None, texts))}{unclear}"


def fits(texts: Sequence[str], form: str) -> bool:
    """Whether there are texts besides empty ones, and the first 200 and last 50 are times in a `strptime` format.

    The first of more than 50 texts is left out: it may be of a line below the header.
    """
    filled = [text for text in texts if text]
    probe = pd.Series(filled[1:200] + filled[-50:], dtype=object)
    stamps = pd.to_datetime(probe, format=form, utc=True, errors="coerce")
    return len(probe) > 0 and bool(stamps.notna().all())


def unit_of_values(ours: str, known: FloatArray) -> tuple[str, str]:
    """Unit of a column whose name states none, from the range of its values, and the reason."""
    low, high = float(np.min(known)), float(np.max(known))
    seen = f"values of {low:g} to {high:g}"
    if ours == "time_s":
        return _unit_of_time(known, low, seen)
    if ours == "speed_m_s":
        fast = "km/h", f"{seen} are km/h rather than m/s"
        return fast if high > 60.0 else ("m/s", f"{seen}: CHECK: m/s or km/h")
    # 1e4: a state of charge above this is in percent times 10,000, as Leaf Spy writes it
    if ours in ("soc", "displayed_soc") and high > 1e4:
        return "ppm", f"{seen} are percent times 10,000"
    if ours in ("soc", "displayed_soc", "grade"):
        return ("%", f"{seen} are percent") if high > 1.5 else ("1", f"{seen} are a fraction")
    if ours.endswith("_degc"):
        if low > 200.0:
            return "k", f"{seen} are kelvin"
        if high > 60.0 and "ambient" in ours:
            return "degf", f"{seen} are °F"
        check = "; CHECK: °C or °F" if high > 42.0 and "ambient" in ours else ""
        return "degc", f"{seen}{check}"
    if ours.endswith("_w"):
        return ("kw", f"{seen} are kW") if max(abs(low), abs(high)) < 1000.0 else ("w", f"{seen} are W")
    if ours == "voltage_v":
        return ("mv", f"{seen} are mV") if high > 2000.0 else ("v", seen)
    if ours == "current_a":
        return ("ma", f"{seen} are mA") if max(abs(low), abs(high)) > 3000.0 else ("a", seen)
    return COLUMNS[ours].unit.lower(), seen


def _unit_of_time(known: FloatArray, low: float, seen: str) -> tuple[str, str]:
    if low > 1e11:
        return "epoch_ms", f"{seen} are milliseconds since 1970"
    if low > SINCE_1970:
        return "epoch_s", f"{seen} are seconds since 1970"
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    if step >= 50.0:
        return "ms", f"steps of {step:g} are milliseconds"
    if abs(step * SECONDS_PER_HOUR - round(step * SECONDS_PER_HOUR)) < 0.02 and step < 0.01:
        return "h", f"steps of {step:.3g} are hours"
    if step < 0.05 and abs(step * 60.0 - round(step * 60.0)) < 0.02:
        return "min", f"steps of {step:.3g} are minutes"
    return "s", f"steps of {step:g}"


def speed_unit(assumed: str, mass_kg: float) -> tuple[str, str]:
    """Unit of speed in which the mass of the car is plausible, and the reason; `mass_kg` is the mass in the assumed unit.

    Examples
    --------
    >>> speed_unit("m/s", 125.0)[0], speed_unit("m/s", 1650.0)[0]
    ('km/h', 'm/s')
    """
    known = SPEED_UNITS.get(assumed, np.nan)  # an unknown unit gives no mass, which fits nothing
    masses = {unit: mass_kg * (known / factor) ** 2 for unit, factor in SPEED_UNITS.items()}
    fitting = {u: m for u, m in masses.items() if LIGHTEST_KG <= m <= HEAVIEST_KG}
    if not fitting:  # samples every few seconds hide part of the acceleration
        fitting = {u: m for u, m in masses.items() if FURTHEST_KG[0] <= m <= FURTHEST_KG[1]}
    if not fitting:
        return assumed, f"CHECK: in {assumed} the mass of the car is {mass_kg:.0f} kg"
    unit = min(fitting, key=lambda u: abs(np.log(fitting[u] / 1700.0)))  # 1700 kg: a usual car
    other_masses = ", ".join(f"{m:.0f} in {u}" for u, m in masses.items() if u != unit)
    check = "; CHECK: the masses are close" if len(fitting) > 1 else ""
    return unit, f"in {unit} the apparent mass of the car is {fitting[unit]:.0f} kg ({other_masses}){check}"


def best_flow(
    time: FloatArray,
    known: Mapping[str, FloatArray],
    unknown: Mapping[str, FloatArray],
    labels: Mapping[str, str],
) -> Flow:
    """Recognise columns of one trip by their values alone, and find the sign of the current.

    Parameters
    ----------
    time : ndarray, shape (samples,)
        Time [s].
    known : mapping of str to ndarray, shape (samples,)
        Our name -> values in our unit.
    unknown : mapping of str to ndarray, shape (samples,)
        Columns that no name has identified. Fewer than 10 values show nothing.
    labels : mapping of str to str
        Name of a column -> the name with the unit of the line below the header, if there is one.
    """
    if not len(time):
        return Flow()
    spare, guesses = {n: values for n, values in unknown.items() if np.isfinite(values).sum() >= 10}, []

    def named(ours: str) -> dict[str, FloatArray]:
        return {n: values for n, values in spare.items() if may_hold(ours, labels.get(n, n))}

    def unit_of(ours: str, name: str) -> str:
        return unit_in(ours, labels.get(name, name)) or COLUMNS[ours].unit.lower()

    volts = known.get("voltage_v", np.full(len(time), STAND_IN_V))
    name = next((n for n, values in named("voltage_v").items() if _is_pack_voltage(values)), None)
    if "voltage_v" not in known and name is not None:
        volts = spare.pop(name)
        text = f"no name matches; values of {np.nanmin(volts):g} to {np.nanmax(volts):g} are those of a traction battery"
        guesses.append(Guess("voltage_v", name, "v", text))
    speeds = {
        n: values * UNITS["speed_m_s"][unit_of("speed_m_s", n)][0]
        for n, values in named("speed_m_s").items()
        if _may_be_speed(values)
    }
    if "speed_m_s" in known:
        speeds = {"": known["speed_m_s"]}
    if "current_a" in known:
        flows = {"": known["current_a"] * volts}
    elif POWER in known:
        flows = {"": known[POWER]}
    else:
        is_sure = "voltage_v" in known or bool(guesses)  # else the column may be a power just as well
        flows = {
            n: values * UNITS["current_a"][unit_of("current_a", n)][0] * volts
            for n, values in named("current_a").items()
            if np.nanmin(values, initial=0.0) < 0.0
            and (is_sure or unit_in("current_a", labels.get(n, n)) is not None)
        }
    mass, correlation, speed_name, flow_name = _best_pair(time, speeds, flows)
    # 0.3: correlation of the power with acceleration above which the sign of the current or power is clear
    # 0.6: correlation above which a column without a matching name is taken for the current or the speed
    if abs(correlation) < (0.6 if speed_name or flow_name else 0.3):
        is_measured = POWER in known or "current_a" in known
        sign = "discharge" if is_measured else ""
        return Flow(tuple(guesses), sign, "CHECK: too little driving to decide")
    for ours, name, why in (
        ("current_a", flow_name, "correlated with speed times acceleration"),
        ("speed_m_s", speed_name, "its change is correlated with the power"),
    ):
        if name:
            text = f"no name matches; {why} (correlation {abs(correlation):.2f})"
            guesses.append(Guess(ours, name, unit_of(ours, name), text))
    sign = "discharge" if correlation > 0 else "charge"
    why_sign = f"correlation of power with acceleration {correlation:.2f}"
    return Flow(tuple(guesses), sign, why_sign, abs(mass))


def _best_pair(
    time: FloatArray, speeds: Mapping[str, FloatArray], flows: Mapping[str, FloatArray]
) -> tuple[float, float, str, str]:
    """Mass [kg], correlation and names of the speed and the power that obey Newton's second law best; zeros if there is no pair."""
    pairs = [(0.0, 0.0, "", "")]
    for speed_name, speed in [*speeds.items()][:MAX_COLUMNS]:
        for flow_name, flow in [*flows.items()][:MAX_COLUMNS]:
            fit = apparent_mass(time, speed, flow) if flow_name != speed_name or not speed_name else None
            if fit is not None:
                pairs.append((*fit, speed_name, flow_name))
    return max(pairs, key=lambda pair: abs(pair[1]))


def _is_pack_voltage(values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    low, middle, high = np.quantile(known, [0.02, 0.5, 0.98])
    steady = abs(float(np.corrcoef(known, np.arange(len(known)))[0, 1])) > 0.9999 if high > low else True
    # 0.35: under load the voltage of a pack varies less, and a signal that rises evenly is a counter
    return bool(PACK_V[0] <= middle <= PACK_V[1] and 0.0 < (high - low) / middle < 0.35 and not steady)


def _may_be_speed(values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.min() >= 0.0 and 5.0 <= known.max() <= 260.0 and known.min() < 0.2 * known.max())
