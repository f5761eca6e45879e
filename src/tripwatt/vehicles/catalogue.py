"""The table of cars: published figures with their sources, and the values of classes of cars.

`data/table/cars.csv` has one row for each published figure (a cell): car, key, value, unit, source, note. A car with a `title` is a
car of the library; the table can also have certified figures of a car with its own TOML. Values that the table lacks come from the
class of the car: shared entries, motor and cells of a reference car in proportion to power and energy, and, if no coast-down is
published, the medians of the coast-downs of the table.
"""

from __future__ import annotations

import csv
import math
import statistics
import types
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np

from tripwatt.units import GRAVITY_M_S2, KG_PER_LB, M_S_PER_MPH, N_PER_LBF
from tripwatt.vehicles.inheriting import DATA
from tripwatt.vehicles.parts import Number
from tripwatt.vehicles.vehicle import FIELDS

QUADRICYCLE: Final = "quadricycle"
BODIES: Final = ("small", "hatchback", "sedan", "suv", "van", "pickup", QUADRICYCLE)
"""Kinds of body, which determine the drag area of a car without a coast-down."""

ROAD_LOAD_DENSITY_KG_M3: Final = 1.167
"""Air density of published coast-downs, 20 degC and 98.21 kPa (SAE J2263)."""

SPLIT_SPEEDS_M_S: Final = (10.43, 23.40)
"""Speeds at which a coast-down keeps its force if its part C is changed. They are the zeros of the parabola that is orthogonal to constants
and lines over the distance of UDDS and HWFET, so the energy on these schedules stays the same."""

ROLLING_SPEED_M_S: Final = 15.0
"""Speed at which the sums of the parts A and B of coast-downs are compared; in a fit an error of A is offset by one of B."""

SPREAD_SPEEDS_M_S: Final = (10.0, 30.0)
"""Speeds of city and motorway, at which the scatter of coast-downs is computed."""

SMALLEST_SPREAD: Final = 0.03
"""Smallest relative scatter: the repeatability of a coast-down, SAE J1263, 3 %."""

MIN_CARS: Final = 2
"""Smallest number of cars of a kind of body for which a median drag area is computed."""

VAN_OVER_SUV: Final = 1.15
"""Drag area of a van over that of an SUV, used if the table has no coast-down of a van: Volkswagen's c_d of 0.285 for the ID. Buzz,
1.98 m wide and 1.93 m high, against the SUVs of the table."""

TWIZY_DRAG_AREA_M2: Final = 0.64
"""Renault, technical data of the Twizy."""

TWIZY_ROLLING: Final = 0.0115
"""Rolling resistance of a quadricycle's tyres of 13 inches with bearings, brakes and gear: 10 N/kN, the middle of class D and E of the EU tyre label
(Regulation (EU) 2020/740), which small tyres have, and 1.5 N/kN."""

LOADED_KG: Final = 300.0 * KG_PER_LB
"""Test weight less curb mass: driver and passenger, 40 CFR 86.1803 (loaded vehicle weight)."""

DRIVER_KG: Final = 75.0
"""Driver in the mass in running order, Regulation (EU) 1230/2012."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One published figure of a car.

    Attributes
    ----------
    value : str
        A number in `unit`, or a word.
    unit : str
    source, licence : str
    note : str
        Row of the source, or how the value was chosen.
    """

    value: str
    unit: str
    source: str
    licence: str
    note: str

    @property
    def number(self) -> float:
        """The value as a number."""
        return float(self.value)

    @property
    def citation(self) -> str:
        """Source and note as one text."""
        return f"{self.source}: {self.note}" if self.note else self.source


Row = Mapping[str, tuple[Cell, ...]]
"""Key -> cells of a car; a car may have several certified figures."""


@cache
def records(name: str) -> tuple[Mapping[str, str], ...]:
    """Return the rows of a CSV file in `data/table`."""
    return tuple(csv.DictReader((DATA / "table" / name).read_text(encoding="utf-8").splitlines()))


@cache
def catalogue() -> Mapping[str, Row]:
    """Return the cells of every car of the table, by the name of the car.

    Examples
    --------
    >>> catalogue()["vw_id4_pro"]["test_weight"][0].number
    4750.0
    """
    sources = {row["source"]: row for row in records("sources.csv")}
    cars: dict[str, dict[str, tuple[Cell, ...]]] = {}
    for row in records("cars.csv"):
        source = sources[row["source"]]
        cell = Cell(row["value"], row["unit"], source["text"], source["licence"], row["note"])
        car = cars.setdefault(row["car"], {})
        car[row["key"]] = (*car.get(row["key"], ()), cell)
    return types.MappingProxyType({name: types.MappingProxyType(car) for name, car in cars.items()})


def table_names() -> tuple[str, ...]:
    """Return the names of the library cars that the table describes, sorted."""
    return tuple(sorted(name for name, row in catalogue().items() if "title" in row))


def curb_mass_kg(row: Row) -> float:
    """Return the curb mass of a car of the table, with nobody inside [kg]."""
    if "test_weight" in row:
        return row["test_weight"][0].number * KG_PER_LB - LOADED_KG
    return row["running_mass"][0].number - DRIVER_KG


@cache
def mass_range_kg() -> tuple[float, float]:
    """Return the curb masses of the lightest and of the heaviest library car of the table [kg].

    Examples
    --------
    >>> low, high = mass_range_kg()
    >>> low < 1000.0 < 3000.0 < high
    True
    """
    masses = [curb_mass_kg(row) for row in catalogue().values() if "title" in row]
    return min(masses), max(masses)


def beyond_classes(mass_kg: float) -> float:
    """Distance of a curb mass from the range of the table: |ln| of its ratio to the nearest bound; 0 inside the range.

    Examples
    --------
    >>> beyond_classes(1500.0), round(beyond_classes(0.5 * mass_range_kg()[0]), 2)
    (0.0, 0.69)
    """
    low, high = mass_range_kg()
    return max(0.0, math.log(low / mass_kg), math.log(mass_kg / high))


@dataclass(frozen=True, slots=True)
class ClassValues:
    """Medians of the coast-downs of a set of cars, and the scatter of single cars about them.

    Attributes
    ----------
    rolling : float
        Part A of the coast-down over weight [1].
    rolling_per_speed_s_m : float
        Part B of the coast-down over weight [s/m].
    drag_area_m2 : mapping of str to float
        Kind of body -> drag area [m²].
    rolling_sd, drag_area_sd : float
        Relative standard deviation of a car's rolling and air drag from these values, assumed independent.
    cars : int
        Number of cars in the medians.
    """

    rolling: float
    rolling_per_speed_s_m: float
    drag_area_m2: Mapping[str, float]
    rolling_sd: float
    drag_area_sd: float
    cars: int


@dataclass(frozen=True, slots=True)
class Coastdown:
    """A coast-down, force A + B v + C v², in SI units, with the mass of the car [kg]."""

    a_n: float
    b_n_s_m: float
    c_n_s2_m2: float
    mass_kg: float

    @classmethod
    def from_row(cls, row: Row) -> Coastdown:
        """Convert the measured coast-down of a row from pounds and miles per hour."""
        a, b, c = (row[f"coastdown_{letter}"][0].number * N_PER_LBF for letter in "abc")
        mass = row["test_weight"][0].number * KG_PER_LB
        return cls(a, b / M_S_PER_MPH, c / M_S_PER_MPH**2, mass)

    @classmethod
    def of_parts(cls, row: Row) -> Coastdown:
        """Convert the coast-down of a row, split by its published drag area or else by a usual part B."""
        run = cls.from_row(row)
        if "drag_coefficient" in row:
            return run.with_drag_area(row["drag_coefficient"][0].number * row["frontal_area"][0].number)
        change = (_usual_linear_part_s_m() * run.weight_n - run.b_n_s_m) / sum(SPLIT_SPEEDS_M_S)
        return run.with_drag_area(2.0 * (run.c_n_s2_m2 - change) / ROAD_LOAD_DENSITY_KG_M3)

    def with_drag_area(self, drag_area_m2: float) -> Coastdown:
        """Split the force anew: C follows from a drag area, A and B take the rest.

        The parts of a coast-down are nearly collinear: their sum is well known, each single part is not. The sum stays the
        same at `SPLIT_SPEEDS_M_S`, which keeps the energy on the schedules of certification.

        Parameters
        ----------
        drag_area_m2 : float
            Drag area of the car or of its class [m²].

        Examples
        --------
        >>> run = Coastdown(100.0, 0.0, 0.5, 1500.0)
        >>> parts = run.with_drag_area(0.7)
        >>> [round(parts.force_n(speed) - run.force_n(speed), 6) for speed in SPLIT_SPEEDS_M_S]
        [0.0, 0.0]
        """
        low, high = SPLIT_SPEEDS_M_S
        c = 0.5 * ROAD_LOAD_DENSITY_KG_M3 * drag_area_m2
        removed = self.c_n_s2_m2 - c
        return Coastdown(
            self.a_n - removed * low * high, self.b_n_s_m + removed * (low + high), c, self.mass_kg
        )

    @property
    def weight_n(self) -> float:
        """Weight of the car at the coast-down [N]."""
        return self.mass_kg * GRAVITY_M_S2

    def force_n(self, speed_m_s: Number, air_share: float = 1.0) -> Number:
        """Force at a speed [N]; part C is multiplied by `air_share`."""
        return self.a_n + self.b_n_s_m * speed_m_s + air_share * self.c_n_s2_m2 * speed_m_s**2

    @property
    def drag_area_m2(self) -> float:
        """Drag area that corresponds to part C [m²]."""
        return 2.0 * self.c_n_s2_m2 / ROAD_LOAD_DENSITY_KG_M3


@cache
def _usual_linear_part_s_m() -> float:
    """Return a usual part B over weight [s/m]: the median of the coast-downs that are split by a published drag area.

    Examples
    --------
    >>> 0.5e-4 < _usual_linear_part_s_m() < 2e-4
    True
    """
    rows = [row for row in catalogue().values() if "coastdown_a" in row and "drag_coefficient" in row]
    return statistics.median(run.b_n_s_m / run.weight_n for run in map(Coastdown.of_parts, rows))


@cache
def class_values(without: frozenset[str] = frozenset()) -> ClassValues:
    """Compute the class values from the measured coast-downs of the table. O(cars log cars).

    Parameters
    ----------
    without : frozenset of str
        Cars that are left out, so that the class values can be tested on them.

    Notes
    -----
    B over weight is the median over cars. A over weight is the median of (A + B v) over weight at the speed v of
    `ROLLING_SPEED_M_S`, less v times that B.

    Examples
    --------
    >>> values = class_values()
    >>> values.drag_area_m2["sedan"] < values.drag_area_m2["suv"] < values.drag_area_m2["pickup"]
    True
    """
    runs = [
        (row["body"][0].value, Coastdown.of_parts(row))
        for name, row in catalogue().items()
        if name not in without and "title" in row and "coastdown_a" in row
    ]
    per_speed = statistics.median(run.b_n_s_m / run.weight_n for _, run in runs)
    together = [run.force_n(ROLLING_SPEED_M_S, 0.0) / run.weight_n for _, run in runs]
    rolling = statistics.median(together) - per_speed * ROLLING_SPEED_M_S
    areas = {body: [run.drag_area_m2 for b, run in runs if b == body] for body in BODIES}
    medians = {body: statistics.median(own) for body, own in areas.items() if len(own) >= MIN_CARS}
    medians.setdefault("van", VAN_OVER_SUV * medians["suv"])
    medians[QUADRICYCLE] = TWIZY_DRAG_AREA_M2
    for body in BODIES:
        medians.setdefault(body, statistics.median([area for own in areas.values() for area in own]))
    spreads = _spreads(runs, rolling, per_speed, medians)
    return ClassValues(rolling, per_speed, types.MappingProxyType(medians), *spreads, len(runs))


def _spreads(
    runs: list[tuple[str, Coastdown]], constant: float, per_speed: float, drag_area_m2: Mapping[str, float]
) -> tuple[float, float]:
    """Return independent relative deviations of rolling and air drag that reproduce the scatter of the forces at two speeds.

    Errors of the parts A, B and C of one coast-down offset each other, so the scatter of each part alone is too large. The
    variances of the logarithm of a car's force over that of its class, at `SPREAD_SPEEDS_M_S`, give two equations for the two
    unknown variances.
    """
    speed = np.array(SPREAD_SPEEDS_M_S)
    rolling = np.outer([run.weight_n for _, run in runs], constant + per_speed * speed)
    air = np.outer([drag_area_m2[body] for body, _ in runs], 0.5 * ROAD_LOAD_DENSITY_KG_M3 * speed**2)
    errors = np.log([run.force_n(speed) for _, run in runs] / (rolling + air))
    share = np.mean(rolling / (rolling + air), axis=0)
    found = np.linalg.solve(np.column_stack((share**2, (1.0 - share) ** 2)), errors.var(axis=0, ddof=1))
    rolling_sd, air_sd = np.sqrt(np.maximum(found, SMALLEST_SPREAD**2)).tolist()
    return rolling_sd, air_sd


def entry(value: Any, source: str, licence: str, estimated: str = "") -> dict[str, Any]:
    """Make an entry of a car's document without its unit; `estimated` says how, if the value is an estimate.

    Examples
    --------
    >>> entry(9.5, "class of the car", "estimate")
    {'value': 9.5, 'source': 'class of the car', 'licence': 'estimate'}
    """
    cited = {"value": value, "source": source, "licence": licence}
    return cited | ({"estimated": estimated} if estimated else {})


def with_entries(document: Mapping[str, Any], entries: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return a car's document with entries, by "section.key"; each gets the unit of its field.

    Examples
    --------
    >>> with_entries({"name": "x"}, {"drivetrain.gear_ratio": {"value": 9.5}})
    {'name': 'x', 'drivetrain': {'gear_ratio': {'value': 9.5, 'unit': '1'}}}
    """
    result = dict(document)
    for key, raw in entries.items():
        section, _, name = key.partition(".")
        made = {**raw, "unit": FIELDS[key].metadata["unit"]}
        result[section] = {**result.get(section, {}), name: made}
    return result


LISTED: Final = "simplified by its authors from public charts"


def charging_section(name: str) -> dict[str, Any]:
    """Return the section `charging` of a car's document; empty if no curve of the car is known.

    The curves of `data/table/charging.csv` are simplified from public charts of charging sessions. A car without a curve has that
    of its class (`tripwatt.roads.journey.charging`).

    Parameters
    ----------
    name : str
        A car of the library.

    Returns
    -------
    dict
        {"charging": entries}, or an empty dict.

    Examples
    --------
    >>> charging_section("nissan_leaf_40")["charging"]["power_w"]["value"]
    [41000.0, 45000.0, 36000.0, 15000.0]
    >>> charging_section("bmw_i3_60ah")
    {}
    """
    points = [row for row in records("charging.csv") if row["car"] == name]
    if not points:
        return {}
    (source,) = (row for row in records("sources.csv") if row["source"] == points[0]["source"])
    cited: dict[str, Any] = {"source": f"{source['text']}: {points[0]['note']}", "licence": source["licence"]}
    soc = [float(point["displayed_soc"]) for point in points]
    power = [1000.0 * float(point["power_kw"]) for point in points]
    alternating = 1000.0 * float(points[0]["alternating_kw"])
    entries = {
        "charging.displayed_soc": {**cited, "value": soc},
        "charging.power_w": {**cited, "value": power, "estimated": LISTED},
        "charging.alternating_power_w": {**cited, "value": alternating},
    }
    return with_entries({}, entries)
