"""Display of objects: small HTML tables in a notebook, and texts of durations and distances."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from tripwatt.units import M_S_PER_KM_H, SECONDS_PER_MINUTE


def html_table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """Return an HTML table of names and values with a caption; every text is escaped.

    Examples
    --------
    >>> html_table("Trip", [("distance", "1.2 km")])
    '<table><caption>Trip</caption><tr><th scope="row">distance</th><td>1.2 km</td></tr></table>'
    """
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>' for name, value in rows
    )
    return f"<table><caption>{escape(title)}</caption>{body}</table>"


def period(seconds: float) -> str:
    """Format a duration as text.

    Examples
    --------
    >>> period(1.0), period(40.0), period(600.0), period(7500.0)
    ('1 s', '40 s', '10 min', '2 h 05 min')
    """
    if seconds < 2 * SECONDS_PER_MINUTE:
        return f"{seconds:.0f} s"
    minutes = round(seconds / SECONDS_PER_MINUTE)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def in_kwh(energy_wh: float) -> str:
    """Format an energy in kWh without the unit: to 0.1, or to 0.01 below 1 kWh.

    Examples
    --------
    >>> in_kwh(12_340.0), in_kwh(456.0), in_kwh(-0.1)
    ('12.3', '0.46', '0.00')
    """
    digits = 1 if abs(energy_wh) >= 1000.0 else 2
    return f"{energy_wh / 1000.0:z.{digits}f}"


def span(name: str, low: float, high: float) -> str:
    """Format a range as text; the ending of its name determines the unit.

    Examples
    --------
    >>> span("duration_s", 300.0, 3200.0), span("trip_speed_m_s", 5.0, 30.0), span("cabin_setpoint_degc", 19.0, 22.5)
    ('5 min to 53 min', '18 to 108 km/h', '19 to 22.5 °C')
    """
    if name.endswith("_m_s"):
        return f"{low / M_S_PER_KM_H:.0f} to {high / M_S_PER_KM_H:.0f} km/h"
    if name.endswith("_s"):
        return f"{period(low)} to {period(high)}"
    return f"{low:.3g} to {high:.3g}{' °C' if name.endswith('_degc') else ''}"


def with_interval(middle: float, interval: tuple[float, float], unit: str, digits: int = 2) -> str:
    """Format a value and its central 90 % in thousands of their unit as text.

    Examples
    --------
    >>> with_interval(3741.2, (3430.0, 4060.0), "kWh"), with_interval(99_464.0, (74_333.0, 142_604.0), "km", 0)
    ('3.74 kWh, 90 % interval 3.43 to 4.06 kWh', '99 km, 90 % interval 74 to 143 km')
    """
    value, low, high = (f"{number / 1000.0:.{digits}f}" for number in (middle, *interval))
    return f"{value} {unit}, 90 % interval {low} to {high} {unit}"


def journey(distance_m: float, duration_s: float) -> str:
    """Format distance and duration of a drive as text.

    Examples
    --------
    >>> journey(12_345.0, 1500.0), journey(120.0, 30.0)
    ('12.3 km in 25 min', '0.1 km in 30 s')
    """
    return f"{distance_m / 1000.0:.1f} km in {period(duration_s)}"
