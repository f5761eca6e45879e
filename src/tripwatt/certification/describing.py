"""Cars described by a few published figures, and how well these figures determine the consumption."""

from __future__ import annotations

import math
import statistics
import zlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np

from tripwatt.certification.consumption import (
    FACTORS,
    GEARBOX,
    OPEN,
    ROAD_LOAD,
    CertifiedFigure,
    charging_efficiency,
    closing_factor,
    driven_wh_per_km,
    errors,
    road_parts,
    schedule,
    with_road_load,
    wltp_test_mass,
)
from tripwatt.errors import Fault, InvalidInput, raise_faults
from tripwatt.files import shipped_toml
from tripwatt.trips.columns import Column, number_faults, require_fraction
from tripwatt.vehicles import Vehicle, vehicle_from_document
from tripwatt.vehicles.anchors import CLASS, REPEAT_SD, Anchor, anchors, class_of, with_anchor
from tripwatt.vehicles.catalogue import (
    BODIES,
    LOADED_KG,
    QUADRICYCLE,
    beyond_classes,
    catalogue,
    class_values,
    curb_mass_kg,
    mass_range_kg,
)
from tripwatt.vehicles.similar import Figures, similar_document

PROCEDURES: Final = ("wltp", "epa")
"""Procedures of a published consumption: the WLTP, or the combined city and highway figure of the EPA label."""

LABEL_FACTOR: Final = 0.7
"""Consumption on the dynamometer over consumption on the EPA label, 40 CFR 600.210-12."""

LABEL_SHARES: Final = {"udds": 0.55, "hwfet": 0.45}
"""Shares of city and highway in the combined label, 40 CFR 600.210-12."""

PROCEDURE_SD: Final = 0.05
"""Relative scatter of one procedure's figure about the other's: test masses, tyres and the factor of the label (0.7 to 0.75) differ."""

TWIZY: Final = {"mass_kg": 474.0, "usable_battery_kwh": 6.1, "motor_power_kw": 13.0}
"""Figures of a usual quadricycle, which has no climate control: Renault, technical data of the Twizy 80."""

USUAL_PACK_V: Final = 360.0
"""Nominal voltage of a pack of 96 to 100 cells in series."""

BODY_WORDS: Final = shipped_toml("vehicles/data/table/bodies.toml")["words"]
"""Other words for a kind of body."""

LIMITS: Final = {
    "mass_kg": Column("kg", 400.0, 6000.0, ""),
    "usable_battery_kwh": Column("kWh", 4.0, 300.0, ""),
    "consumption_kwh_per_100km": Column("kWh/100 km", 4.0, 60.0, ""),
    "motor_power_kw": Column("kW", 5.0, 1500.0, ""),
}
"""Unit, smallest and largest value of each figure."""

FOLLOWING: Final = {
    "mass_kg": ("body.curb_mass_kg", "road_load."),
    "usable_battery_kwh": ("battery.",),
    "motor_power_kw": ("drivetrain.",),
}
"""Entries of a described car that follow from each figure."""


def describe_car(
    *,
    mass_kg: float | None = None,
    usable_battery_kwh: float | None = None,
    consumption_kwh_per_100km: float | None = None,
    motor_power_kw: float | None = None,
    body: str | None = None,
    heat_pump: bool | None = None,
    procedure: str = "wltp",
    title: str | None = None,
) -> Vehicle:
    """Make a car that the library does not have from up to six figures.

    A figure that is not given is that of a usual car with this kind of body in the library. If the consumption is given, the road
    load is changed until the simulated test meets it. The fewer figures are given, the wider are the forecasts.

    A car that is lighter or heavier than every car of the library gets a title that says so, and its forecasts widen with the
    distance; if no body is given, it has the kind of body with the nearest usual mass.

    Parameters
    ----------
    mass_kg : float, optional
        Mass ready to drive with nobody inside: the curb mass, or the mass in running order less 75 kg.
    usable_battery_kwh : float, optional
        Energy between an empty and a full display.
    consumption_kwh_per_100km : float, optional
        Published consumption, at the wall; that of a quadricycle is of the urban cycle up to 50 km/h.
    motor_power_kw : float, optional
        Largest power of all motors together.
    body : str, optional
        One of `BODIES`, or a word of `BODY_WORDS`.
    heat_pump : bool, optional
        Whether the car has a heat pump; None counts as no.
    procedure : {"wltp", "epa"}
        Procedure of the consumption; "epa" is the combined figure of the label.
    title : str, optional
        Title of the car; made from the figures if not given.

    Returns
    -------
    Vehicle
        The car; each value names its source or the class that it was taken from.

    Raises
    ------
    InvalidInput
        With every figure that is out of range, or if no such car can have this consumption.

    Examples
    --------
    >>> car = describe_car(mass_kg=1830, usable_battery_kwh=58, consumption_kwh_per_100km=15.5, motor_power_kw=150, body="hatchback")
    >>> car.anchor, car.title
    ('certification', 'hatchback, 1830 kg, 58 kWh, 150 kW, WLTP 15.5 kWh/100 km')
    """
    given = {
        "mass_kg": mass_kg,
        "usable_battery_kwh": usable_battery_kwh,
        "consumption_kwh_per_100km": consumption_kwh_per_100km,
        "motor_power_kw": motor_power_kw,
    }
    return described(given, body, heat_pump, procedure, title)


def described(
    given: Mapping[str, float | None],
    body: str | None = None,
    heat_pump: bool | None = None,
    procedure: str = "wltp",
    title: str | None = None,
    without: Collection[str] = (),
    anchor: Anchor | None = None,
) -> Vehicle:
    """Make a car as `describe_car` does, with class values computed without some cars of the library.

    Parameters
    ----------
    given : mapping of str to float or None
        A value or None for each key of `LIMITS`.
    body, heat_pump, procedure, title
        As for `describe_car`.
    without : collection of str
        Cars whose coast-down is left out of the class values.
    anchor : Anchor, optional
        What a car without a consumption has in common with all cars, in place of what cars of its kind of body have in common.
    """
    kind = _checked(given, body, heat_pump, procedure)
    mass_kg = given["mass_kg"]
    # beyond the classes no body is usual: that of the nearest usual mass is taken
    if body is None and mass_kg is not None and beyond_classes(mass_kg):
        kind = min(BODIES, key=lambda body: abs(math.log(usual_figures(body)["mass_kg"] / mass_kg)))
    test = "town" if kind == QUADRICYCLE else procedure
    usual = usual_figures(kind)
    filled = {key: usual[key] if given[key] is None else float(given[key]) for key in usual}  # type: ignore[arg-type]
    figures = _figures(given, filled, kind, heat_pump, title or _title(given, kind, test))
    document = similar_document(figures, class_values(frozenset(without)))
    name = f"described_{zlib.crc32(repr((filled, given, kind, heat_pump, procedure)).encode()):08x}"
    try:
        car = vehicle_from_document(with_anchor(document, anchor or anchors()[CLASS]), name, name)
    except InvalidInput as error:
        raise InvalidInput([_in_figures(fault) for fault in error.faults]) from error
    consumption = given["consumption_kwh_per_100km"]
    if consumption is not None:
        return _meeting(car, document, 10.0 * consumption, test)
    if anchor is not None or kind == QUADRICYCLE:
        return car
    usual_of = anchors()[class_of(kind)]
    return _closed(car, document, usual_of.entries["factor"], "class", usual_of.before)


def _in_figures(fault: Fault) -> Fault:
    """Rewrite a fault of entries of the described car so that it names the figures from which the entries follow."""
    figures = [figure for figure, entries in FOLLOWING.items() if any(e in fault.where for e in entries)]
    fix = "check the figures; one that is not given is that of a usual car with this body"
    return replace(fault, where=" and ".join(figures), fix=fix) if figures else fault


def _checked(given: Mapping[str, float | None], body: str | None, heat_pump: object, procedure: str) -> str:
    """Check that the figures are valid, and return the kind of body; "suv" if none is given."""
    faults: list[Fault] = []
    for key, value in given.items():
        if value is not None:
            faults += number_faults(key, value, LIMITS[key])
    kind = "suv" if body is None else BODY_WORDS.get(str(body).lower(), str(body).lower())
    if kind not in BODIES:
        faults.append(Fault.unknown("unknown body", "body", body, (*BODIES, *BODY_WORDS)))
    if heat_pump is not None and not isinstance(heat_pump, bool):
        faults.append(Fault("not a truth value", "heat_pump", repr(heat_pump)[:40], "true or false"))
    if procedure not in PROCEDURES:
        faults.append(Fault.unknown("unknown procedure", "procedure", procedure, PROCEDURES))
    raise_faults(faults)
    return kind


@cache
def usual_figures(body: str) -> Mapping[str, float]:
    """Mass [kg], usable energy [kWh] and power [kW] of a usual car with a kind of body: medians of the table.

    For a kind with fewer than two cars they are the medians of all cars, for a quadricycle the figures of the Renault Twizy.

    Parameters
    ----------
    body : str
        Kind of body, such as "suv".

    Examples
    --------
    >>> usual_figures("small")["mass_kg"] < usual_figures("suv")["mass_kg"]
    True
    """
    if body == QUADRICYCLE:
        return TWIZY
    rows = [row for row in catalogue().values() if "title" in row]
    mine = [row for row in rows if row["body"][0].value == body]
    chosen = mine if len(mine) > 1 else rows
    return MappingProxyType(
        {
            "mass_kg": statistics.median(map(curb_mass_kg, chosen)),
            "usable_battery_kwh": statistics.median(row["usable_energy"][0].number for row in chosen),
            "motor_power_kw": statistics.median(row["motor_power"][0].number for row in chosen),
        }
    )


def _title(given: Mapping[str, float | None], kind: str, procedure: str) -> str:
    mass = given["mass_kg"]
    if mass is not None and beyond_classes(mass):
        low, high = mass_range_kg()
        kind = f"extrapolated from {kind} (library: {low:.0f} to {high:.0f} kg)"
    shown = [key for key in ("mass_kg", "usable_battery_kwh", "motor_power_kw") if given[key] is not None]
    parts = [kind, *(f"{given[key]:g} {LIMITS[key].unit}" for key in shown)]
    consumption = given["consumption_kwh_per_100km"]
    if consumption is not None:
        parts.append(f"{procedure.upper()} {consumption:g} kWh/100 km")
    return ", ".join(parts)


def _figures(
    given: Mapping[str, float | None],
    filled: Mapping[str, float],
    kind: str,
    heat_pump: bool | None,
    title: str,
) -> Figures:
    def figure(key: str, factor: float) -> dict[str, Any]:
        value = filled[key] * factor
        if given[key] is not None:
            return {"value": value, "source": "given by the caller", "licence": "user"}
        how = f"median of the library's cars with the body {kind}"
        return {"value": value, "source": "class of the car", "licence": "estimate", "estimated": how}

    return Figures(
        title=title,
        body=kind,
        curb_mass=figure("mass_kg", 1.0),
        motor_power=figure("motor_power_kw", 1000.0),
        usable_energy=figure("usable_battery_kwh", 1000.0),
        pack_voltage={"value": USUAL_PACK_V, "source": "class of the car", "licence": "estimate"},
        heat_pump=bool(heat_pump),
        machine="asm" if kind == QUADRICYCLE else "psm",  # Renault: the Twizy's is asynchronous
    )


def _certified(car: Vehicle, wh_per_km: float, procedure: str) -> list[CertifiedFigure]:
    """Return the certified figures for a consumption: that of the WLTP or of a town, or city and highway figures.

    City and highway figures have the simulated ratio to each other, so both have the same relative error.
    """
    mass, by_cycle = car.body.test_mass_kg, {"town": wh_per_km}
    if procedure == "wltp":
        mass, by_cycle = wltp_test_mass(mass), {"wltc": wh_per_km}
    elif procedure == "epa":
        mass = car.body.curb_mass_kg + LOADED_KG
        driven = {cycle: driven_wh_per_km(car, schedule(cycle), mass) for cycle in LABEL_SHARES}
        combined = sum(share * driven[cycle] for cycle, share in LABEL_SHARES.items())
        by_cycle = {cycle: LABEL_FACTOR * wh_per_km * wh / combined for cycle, wh in driven.items()}
    return [CertifiedFigure(c, wh, True, mass, "given by the caller") for c, wh in by_cycle.items()]


def _meeting(car: Vehicle, document: Mapping[str, Any], wh_per_km: float, procedure: str) -> Vehicle:
    """Return the car with a road load at which its simulated consumption is the given one."""
    figures = _certified(car, wh_per_km, procedure)
    factor = closing_factor(partial(with_road_load, car), figures, FACTORS)
    left = float(errors(with_road_load(car, factor), figures).mean())
    if abs(left) > REPEAT_SD:
        raise InvalidInput.of(
            "consumption does not fit the car",
            "consumption_kwh_per_100km",
            f"{wh_per_km / 10.0:g} kWh/100 km",
            f"{'at most' if left < 0.0 else 'at least'} {wh_per_km / 10.0 * (1.0 + left):.1f} kWh/100 km for its mass, power and body",
            "check the figures; consumption is in kWh/100 km at the wall",
        )
    return _closed(car, document, factor, "certification", float(errors(car, figures).mean()))


def _closed(car: Vehicle, document: Mapping[str, Any], factor: float, level: str, before: float) -> Vehicle:
    """Return the car with its road load multiplied by a factor, which closes an error of the certified consumption."""
    met = with_road_load(car, factor)
    entries = {key: cast(float, met.value(key)) for key in (*road_parts(car), GEARBOX)}
    anchor = Anchor(level, ROAD_LOAD, {**anchors()[CLASS].entries, **entries}, before)
    return vehicle_from_document(with_anchor(document, anchor), car.name, car.name)


@dataclass(frozen=True, slots=True)
class ConsumptionInterval:
    """Median and central interval of the consumption in a test, at the wall [kWh/100 km].

    Attributes
    ----------
    middle : float
        Median [kWh/100 km].
    low : float
        Lower end of the interval [kWh/100 km].
    high : float
        Upper end of the interval [kWh/100 km].

    Examples
    --------
    >>> interval = certified_interval(describe_car(body="suv", mass_kg=1900))
    >>> interval.low < interval.middle < interval.high
    True
    """

    middle: float
    low: float
    high: float


def certified_interval(car: Vehicle, level: float = 0.9) -> ConsumptionInterval:
    """Predict the certified consumption of a described car on the WLTP, with an interval. Up to five simulations of the schedule.

    Parameters
    ----------
    car : Vehicle
        A car from `describe_car`. For another car the interval depends on its anchor.
    level : float
        Probability of the interval, 0 to 1.

    Returns
    -------
    ConsumptionInterval
        At the wall [kWh/100 km].

    Notes
    -----
    If the consumption is unknown, its scatter is that of the library's cars about the cars of their kind of body, each described by its
    few figures. If the car was made to meet a consumption, only the scatter between tests and between procedures is left. Cars of one
    maker are alike, so each maker counts as one car: the logarithm of the consumption has a t distribution with one degree of freedom
    less than there are makers.

    Examples
    --------
    >>> wide = certified_interval(describe_car(body="suv", mass_kg=1900))
    >>> near = certified_interval(describe_car(body="suv", mass_kg=1900, consumption_kwh_per_100km=17))
    >>> wide.high - wide.low > near.high - near.low
    True
    """
    from scipy.special import stdtrit  # slow to import

    level = require_fraction("level", level)
    middle = _wltp_wh_per_km(car) / charging_efficiency() / 10.0
    sd, makers = _relative_sd(car)
    half = float(stdtrit(makers - 1.0, 0.5 + 0.5 * level)) * sd
    return ConsumptionInterval(middle, middle * math.exp(-half), middle * math.exp(half))


def _wltp_wh_per_km(car: Vehicle, mass_factor: float = 1.0) -> float:
    return driven_wh_per_km(car, schedule("wltc"), mass_factor * wltp_test_mass(car.body.test_mass_kg))


def _relative_sd(car: Vehicle) -> tuple[float, float]:
    """Relative standard deviation of the certified consumption, and the number of makers that show it."""
    cars, vans = (anchors()[class_of(kind)].entries for kind in ("suv", "van"))
    if car.anchor != "class":
        return math.hypot(REPEAT_SD, PROCEDURE_SD), cars["makers"]
    van_m2 = class_values().drag_area_m2["van"] * vans["factor"] ** OPEN["air"]
    mine = vans if math.isclose(car.road_load.drag_area_m2, van_m2, rel_tol=1e-4) else cars
    parts = [mine["scatter"], beyond_classes(car.body.curb_mass_kg)]
    if car.entries["body.curb_mass_kg"].licence != "user":
        parts.append(_wltp_wh_per_km(car, 1.0 + _mass_sd()) / _wltp_wh_per_km(car) - 1.0)
    return float(np.linalg.norm(parts)), mine["makers"]


@cache
def _mass_sd() -> float:
    """Relative standard deviation of masses about the median of their kind of body, over the table."""
    logs = [
        math.log(curb_mass_kg(row) / usual_figures(row["body"][0].value)["mass_kg"])
        for row in catalogue().values()
        if "title" in row and "test_weight" in row
    ]
    return statistics.stdev(logs)
