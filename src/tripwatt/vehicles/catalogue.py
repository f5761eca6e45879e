"""The table of cars: published figures with their sources, one cell each, and the cars that they describe.

`data/table/cars.csv` has one row for each cell: car, key, value, unit, source, note. A car that has a `title` is a car of the
library; the table can also hold certified figures of a car that has a TOML of its own. What the table does not have comes from
its class: shared entries, the motor and the cells of a reference car, similar in power and energy, and, where no coast-down is
published, the medians of the coast-downs of the table.
"""

from __future__ import annotations

import csv
import dataclasses
import math
import statistics
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final

from tripwatt.units import GRAVITY_M_S2, KG_PER_LB, M_PER_MILE, N_PER_LBF, SECONDS_PER_HOUR
from tripwatt.vehicles.inheriting import data_folder

QUADRICYCLE: Final = "quadricycle"
BODIES: Final = ("small", "hatchback", "sedan", "suv", "van", "pickup", QUADRICYCLE)
"""Kinds of body, by which the drag area of a car without a coast-down is chosen."""

M_S_PER_MPH: Final = M_PER_MILE / SECONDS_PER_HOUR

ROAD_LOAD_DENSITY_KG_M3: Final = 1.167
"""Air density of published coast-downs, 20 degC and 98.21 kPa (SAE J2263)."""

SPLIT_SPEEDS_M_S: Final = (10.43, 23.40)
"""Speeds at which a coast-down with another part C keeps its force. They are the zeros of the parabola that is orthogonal to constants and
lines over the distance of UDDS and HWFET, so that the energy on these schedules stays."""

ROLLING_SPEED_M_S: Final = 15.0
"""Speed at which the parts A and B of coast-downs are compared; they trade against each other in a fit."""

SPREAD_SPEEDS_M_S: Final = (10.0, 30.0)
"""Speeds of city and motorway, at which the scatter of coast-downs is taken."""

SMALLEST_SPREAD: Final = 0.03
"""Repeatability of a coast-down, SAE J1263: 3 %."""

LEAST_CARS: Final = 2
"""Fewest cars of a kind of body for a drag area of its own."""

VAN_OVER_SUV: Final = 1.15
"""Drag area of a van over that of an SUV where no coast-down of one is in the table: Volkswagen's c_d of 0.285 for the ID. Buzz,
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
        Which row of the source it is, or how it was chosen.
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
        """Source and note."""
        return f"{self.source}: {self.note}" if self.note else self.source


Row = Mapping[str, tuple[Cell, ...]]
"""Cells of a car by their key; certified figures can come several times."""


def records(name: str) -> Iterator[dict[str, str]]:
    """Rows of a file of `data/table`."""
    file = data_folder() / "table" / name
    yield from csv.DictReader(file.read_text(encoding="utf-8").splitlines())


@cache
def catalogue() -> Mapping[str, Row]:
    """Every car of the table.

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
    """Names of the cars that the table describes, sorted."""
    return tuple(sorted(name for name, row in catalogue().items() if "title" in row))


def curb_mass_kg(row: Row) -> float:
    """Mass of a car of the table with nobody inside [kg]."""
    if "test_weight" in row:
        return row["test_weight"][0].number * KG_PER_LB - LOADED_KG
    return row["running_mass"][0].number - DRIVER_KG


@cache
def mass_range_kg() -> tuple[float, float]:
    """Curb mass of the lightest and of the heaviest car of the table [kg].

    Examples
    --------
    >>> low, high = mass_range_kg()
    >>> low < 1000.0 < 3000.0 < high
    True
    """
    masses = [curb_mass_kg(row) for row in catalogue().values() if "title" in row]
    return min(masses), max(masses)


def beyond_classes(mass_kg: float) -> float:
    """Logarithm of a curb mass over that of the nearest car of the table; 0 inside its range.

    Examples
    --------
    >>> beyond_classes(1500.0), round(beyond_classes(0.5 * mass_range_kg()[0]), 2)
    (0.0, 0.69)
    """
    low, high = mass_range_kg()
    return max(0.0, math.log(low / mass_kg), math.log(mass_kg / high))


@dataclass(frozen=True, slots=True)
class ClassValues:
    """Medians of the coast-downs of a set of cars, and how far single cars are from them.

    Attributes
    ----------
    rolling : float
        Part A over weight [1].
    rolling_per_speed_s_m : float
        Part B over weight [s/m].
    drag_area_m2 : mapping of str to float
        By body.
    rolling_sd, drag_area_sd : float
        Relative standard deviation of a car's rolling and air drag from these, as if independent.
    cars : int
    """

    rolling: float
    rolling_per_speed_s_m: float
    drag_area_m2: Mapping[str, float]
    rolling_sd: float
    drag_area_sd: float
    cars: int


@dataclass(frozen=True, slots=True)
class Coastdown:
    """A coast-down in SI units with its mass [kg]."""

    a_n: float
    b_n_s_m: float
    c_n_s2_m2: float
    mass_kg: float

    @classmethod
    def from_row(cls, row: Row) -> Coastdown:
        """From pounds and miles per hour."""
        a, b, c = (row[f"coastdown_{letter}"][0].number * N_PER_LBF for letter in "abc")
        mass = row["test_weight"][0].number * KG_PER_LB
        return cls(a, b / M_S_PER_MPH, c / M_S_PER_MPH**2, mass)

    @classmethod
    def of_parts(cls, row: Row) -> Coastdown:
        """From pounds and miles per hour, with the published drag area, or else a usual part B."""
        run = cls.from_row(row)
        if "drag_coefficient" in row:
            return run.with_drag_area(row["drag_coefficient"][0].number * row["frontal_area"][0].number)
        return run.with_linear_part(usual_linear_part_s_m() * run.weight_n)

    def with_drag_area(self, drag_area_m2: float) -> Coastdown:
        """The force split into other parts: C is that of a drag area, A and B take the rest.

        The parts of a coast-down are collinear, so that their sum is known and each of them is not. The sum stays at
        `SPLIT_SPEEDS_M_S`, which keeps the energy on the schedules of certification.

        Parameters
        ----------
        drag_area_m2 : float
            Published, or of a class [m²].

        Examples
        --------
        >>> run = Coastdown(100.0, 0.0, 0.5, 1500.0)
        >>> parts = run.with_drag_area(0.7)
        >>> [round(parts.force_n(speed) - run.force_n(speed), 6) for speed in SPLIT_SPEEDS_M_S]
        [0.0, 0.0]
        """
        low, high = SPLIT_SPEEDS_M_S
        c = 0.5 * ROAD_LOAD_DENSITY_KG_M3 * drag_area_m2
        change = self.c_n_s2_m2 - c
        return Coastdown(
            self.a_n - change * low * high, self.b_n_s_m + change * (low + high), c, self.mass_kg
        )

    def with_linear_part(self, b_n_s_m: float) -> Coastdown:
        """The force split so that B has a value; A and C take the rest."""
        change = (b_n_s_m - self.b_n_s_m) / sum(SPLIT_SPEEDS_M_S)
        return self.with_drag_area(2.0 * (self.c_n_s2_m2 - change) / ROAD_LOAD_DENSITY_KG_M3)

    @property
    def weight_n(self) -> float:
        """Weight of the car at the coast-down [N]."""
        return self.mass_kg * GRAVITY_M_S2

    def force_n(self, speed_m_s: float, air_share: float = 1.0) -> float:
        """Force at a speed [N]; `air_share` 0 leaves part C out."""
        return self.a_n + self.b_n_s_m * speed_m_s + air_share * self.c_n_s2_m2 * speed_m_s**2

    @property
    def drag_area_m2(self) -> float:
        """Drag area of part C [m²]."""
        return 2.0 * self.c_n_s2_m2 / ROAD_LOAD_DENSITY_KG_M3


@cache
def usual_linear_part_s_m() -> float:
    """Part B over weight [s/m]: the median of the coast-downs of the table that are split by a published drag area.

    Examples
    --------
    >>> 0.5e-4 < usual_linear_part_s_m() < 2e-4
    True
    """
    rows = [row for row in catalogue().values() if "coastdown_a" in row and "drag_coefficient" in row]
    return statistics.median(run.b_n_s_m / run.weight_n for run in map(Coastdown.of_parts, rows))


@cache
def class_values(without: frozenset[str] = frozenset()) -> ClassValues:
    """Medians of the measured coast-downs of the table. O(cars log cars).

    Parameters
    ----------
    without : frozenset of str
        Cars that take no part, to hold the class values against them.

    Notes
    -----
    B over weight is the median; A is the median of what A and B are together at `ROLLING_SPEED_M_S`, less that B.

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
    medians = {body: statistics.median(own) for body, own in areas.items() if len(own) >= LEAST_CARS}
    medians.setdefault("van", VAN_OVER_SUV * medians["suv"])
    medians[QUADRICYCLE] = TWIZY_DRAG_AREA_M2
    for body in BODIES:
        medians.setdefault(body, statistics.median([area for own in areas.values() for area in own]))
    classes = ClassValues(rolling, per_speed, types.MappingProxyType(medians), 0.0, 0.0, len(runs))
    spreads = _spreads(runs, classes)
    return dataclasses.replace(classes, rolling_sd=spreads[0], drag_area_sd=spreads[1])


def _spreads(runs: list[tuple[str, Coastdown]], classes: ClassValues) -> tuple[float, float]:
    """Independent relative deviations of rolling and air drag that give the scatter of the forces at two speeds.

    Parts A, B and C of one coast-down trade against each other, so that the scatter of each alone is too large. The variances
    of the logarithm of force over that of the class, at `SPREAD_SPEEDS_M_S`, are two equations for the two variances.
    """
    variances, shares = [], []
    for speed in SPREAD_SPEEDS_M_S:
        errors, rolling_shares = [], []
        for body, run in runs:
            rolling = (classes.rolling + classes.rolling_per_speed_s_m * speed) * run.weight_n
            air = 0.5 * ROAD_LOAD_DENSITY_KG_M3 * classes.drag_area_m2[body] * speed**2
            errors.append(math.log(run.force_n(speed) / (rolling + air)))
            rolling_shares.append(rolling / (rolling + air))
        variances.append(statistics.variance(errors))
        shares.append(statistics.fmean(rolling_shares))
    (p, q), (s, t) = ((share**2, (1.0 - share) ** 2) for share in shares)
    v, w = variances
    determinant = p * t - q * s
    rolling_variance, air_variance = (v * t - q * w) / determinant, (p * w - v * s) / determinant
    least = SMALLEST_SPREAD**2
    return math.sqrt(max(rolling_variance, least)), math.sqrt(max(air_variance, least))
