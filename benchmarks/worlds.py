"""Synthetic cars for measurements of coverage: how far a true car is from its published values, by where that comes from.

Intervals contain spreads of these values (`WIDTHS`). Cars that are drawn from the same spreads show that the arithmetic is
right, and nothing of cars on a road. The other worlds are not known to the intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import pandas as pd
from tools import CATALOGUE

from tripwatt.hybrid.parameters import with_values
from tripwatt.units import M_S_PER_KM_H
from tripwatt.vehicles import Vehicle
from tripwatt.vehicles.parts import ROLLING_ENTRIES

World = Callable[[np.random.Generator], dict[str, float]]

WIDTHS: Final = {
    # one more adult (75 kg, Directive 92/21/EEC) or the lightest against the heaviest trim: 3 to 6 % of a small car
    "mass": 0.05,
    # neighbouring classes of the EU tyre label (Regulation (EU) 2020/740, annex I: B to 7.7, C to 9.0, D to 10.5 kg/t)
    "rolling": 0.15,
    # drag area of coast-downs against makers' figures, e.g. Nissan's 0.28 to 0.29 and 0.315 of a coast-down fit
    "air": 0.10,
    # 0.2 to 0.4 kW of auxiliary load, about the 0.25 and 0.3 kW that FASTSim's database gives for electric cars
    "base_load": 0.40,
    # motor and inverter losses are scaled from another car's map where a car's own is not published
    "drivetrain": 0.20,
    # heat demand with and without recirculated air, and of settings 3 K apart at 20 K to the outside
    "climate": 0.30,
}
"""Standard deviation of the relative change of each parameter of a car from its published value, by published sources."""
ENTRIES: Final = {
    "mass": ("body.curb_mass_kg", "body.driver_mass_kg"),
    "rolling": tuple(f"road_load.{name}" for name in ROLLING_ENTRIES),
    "air": ("road_load.coastdown_c_n_s2_m2", "road_load.drag_coefficient"),
    "base_load": ("auxiliaries.base_load_w", "auxiliaries.moving_load_w"),
}
"""Entries of a car that a parameter multiplies; losses of the drivetrain and of climate control have none."""
FARTHEST: Final = 2.5
"""No value is more than so many times larger or smaller than the published one."""
FREEDOM: Final = 3.0
SLOW_M_S: Final = 20.0 * M_S_PER_KM_H
NEWTON_PER_LBF: Final = 4.4482216
M_S_PER_MPH: Final = 0.44704
UNMEASURED: Final = {"base_load": 0.5, "drivetrain": 0.3, "climate": 0.4}
"""Largest relative change, evenly distributed, of what no coast-down shows."""
DRAWS: Final = 2000
LEVELS: Final = (0.5, 0.8, 0.9)


def changed(vehicle: Vehicle, changes: Mapping[str, float]) -> Vehicle:
    """A car whose parameters are changed by relative amounts; parameters without an entry have no effect."""
    published = {
        key: (vehicle.value(key), 1.0 + change)
        for name, change in changes.items()
        for key in ENTRIES.get(name, ())
    }
    values = {key: value * factor for key, (value, factor) in published.items() if isinstance(value, float)}
    return with_values(
        vehicle, values, {key: f"published value times {published[key][1]:.3f}" for key in values}
    )


def relative(logarithm: float) -> float:
    """A relative change of at most `FARTHEST` times, so that no value changes its sign."""
    return float(np.expm1(np.clip(logarithm, -np.log(FARTHEST), np.log(FARTHEST))))


def spread(scale: float = 1.0, shift: float = 0.0, heavy: bool = False) -> World:
    """Log-normal changes by the published spreads, as they are or deliberately not."""

    def draw(rng: np.random.Generator) -> dict[str, float]:
        number = len(WIDTHS)
        normal = (
            rng.standard_t(FREEDOM, number) / np.sqrt(FREEDOM / (FREEDOM - 2.0))
            if heavy
            else rng.standard_normal(number)
        )
        pairs = zip(WIDTHS.items(), normal, strict=True)
        return {name: relative(scale * width * (z + shift)) for (name, width), z in pairs}

    return draw


@cache
def _siblings() -> pd.DataFrame:
    """Logarithms of mass, force at 20 km/h for that mass, and air drag of EPA's coast-downs, over the first one of the same model."""
    rows = pd.read_csv(CATALOGUE / "epa_ev.csv")
    force = NEWTON_PER_LBF * rows[["a_lbf", "b_lbf_mph", "c_lbf_mph2"]].to_numpy(dtype=np.float64)
    mph = SLOW_M_S / M_S_PER_MPH
    slow = force @ np.array([1.0, mph, mph * mph])
    table = pd.DataFrame(
        {
            "model": rows["make"] + " " + rows["model"],
            "mass": rows["test_weight_lb"],
            "rolling": slow / rows["test_weight_lb"],
            "air": force[:, 2],
        }
    )
    table = table[(table[["mass", "rolling", "air"]] > 0.0).all(axis=1)].drop_duplicates()
    values = table[["mass", "rolling", "air"]].apply(np.log)
    values = values - values.groupby(table["model"]).transform("first")
    return values[(values != 0.0).any(axis=1)].reset_index(drop=True)


def sibling(rng: np.random.Generator) -> dict[str, float]:
    """Another coast-down of the same model, and even changes of what it does not show."""
    row = _siblings().iloc[int(rng.integers(len(_siblings())))]
    measured = {name: relative(float(row[name])) for name in ("mass", "rolling", "air")}
    return measured | {name: float(rng.uniform(-most, most)) for name, most in UNMEASURED.items()}


WORLDS: Final[Mapping[str, tuple[str, World]]] = {
    "published": ("the published spreads, which the intervals contain: no test of them", spread()),
    "siblings": (
        "coast-downs of another year, wheel or trim of the same model (EPA, MY2019 to 2025); the rest evenly distributed",
        sibling,
    ),
    "narrow": ("half of the published spreads", spread(0.5)),
    "wide": ("one and a half times the published spreads", spread(1.5)),
    "heavy": ("Student's t with 3 degrees of freedom, of the published spreads", spread(heavy=True)),
    "shifted": (
        "every car takes more: each value one standard deviation higher, with half of the scatter",
        spread(0.5, shift=2.0),
    ),
}
"""Name -> what it is, and how a car is drawn."""


def coverage_interval(inside: np.ndarray, trips: Sequence[int], seed: int = 0) -> tuple[float, float]:
    """95 % interval of a coverage by a bootstrap over cars, because trips of a car err together."""
    owner = np.repeat(np.arange(len(trips)), trips)
    hits, number = np.bincount(owner, inside, len(trips)), np.asarray(trips, dtype=np.float64)
    drawn = np.random.default_rng(seed).integers(len(trips), size=(DRAWS, len(trips)))
    low, high = np.quantile(hits[drawn].sum(axis=1) / number[drawn].sum(axis=1), (0.025, 0.975))
    return float(low), float(high)


@dataclass(frozen=True)
class Row:
    """Forecasts of one set of trips in one world: errors relative to the energy, and intervals."""

    world: str
    known: str
    cars: int
    trips: int
    error: float
    bias: float
    inside: tuple[float, ...]
    interval: tuple[float, float]
    width: float

    @classmethod
    def of(cls, world: str, known: str, cars: Sequence[np.ndarray]) -> Row:
        """Of what `long_trips.scored` gives for each car."""
        rows = np.concatenate(cars)
        inside = rows[:, 1 : 1 + len(LEVELS)]
        return cls(
            world,
            known,
            len(cars),
            len(rows),
            float(np.abs(rows[:, 0]).mean()),
            float(rows[:, 0].mean()),
            tuple(map(float, inside.mean(axis=0))),
            coverage_interval(inside[:, -1], [len(car) for car in cars]),
            float(rows[:, 1 + len(LEVELS)].mean()),
        )

    @property
    def line(self) -> str:
        """As a row of the table."""
        shares = " | ".join(f"{100 * share:.0f}" for share in self.inside)
        low, high = self.interval
        return (
            f"| {self.world} | {self.known} | {self.cars} | {self.trips} | {100 * self.error:.1f} | {100 * self.bias:+.1f} "
            f"| {shares} | {100 * low:.0f} to {100 * high:.0f} | {100 * self.width:.0f} |"
        )


HEAD: Final = (
    "| world | known of the car | cars | trips | mean error [%] | bias [%] | inside 50 % [%] | inside 80 % [%] | inside 90 % [%] "
    "| 95 % interval of it | width of 90 % [% of energy] |\n|---|---|---:|---:|---:|---:|---:|---:|---:|---|---:|"
)


def table(rows: Sequence[Row]) -> str:
    """A table of worlds."""
    return "\n".join([HEAD, *(row.line for row in rows)])
