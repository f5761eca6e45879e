"""Every car of the library at steady speed: `python -m benchmarks.steady --write`.

Each of the nine points of `SPEEDS_KM_H` and `AMBIENT_DEGC` is ten minutes at a constant speed on a flat road in calm air, with a car that is
warm at the start and climate control on. Beside it stands what the published mass and drag area of the car give with the losses of its
class: a plain formula, without an anchor. Where both differ by more than `APART`, the causes are listed, largest first. `--write` renews
the table in docs/reference/library.md.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from statistics import median
from typing import Final

import numpy as np
from tools.command import run
from tools.docs import pages

from benchmarks.anchors import unanchored
from tripwatt.physics import DriveConditions, Simulation, simulate
from tripwatt.physics.road_load import air_density
from tripwatt.units import GRAVITY_M_S2, M_S_PER_KM_H, SECONDS_PER_HOUR, WH_PER_J
from tripwatt.vehicles import Vehicle, load_vehicle, vehicle_names
from tripwatt.vehicles.anchors import anchors
from tripwatt.vehicles.catalogue import catalogue, class_values

SPEEDS_KM_H: Final = (90.0, 110.0, 130.0)
AMBIENT_DEGC: Final = (20.0, 0.0, -10.0)
POINTS: Final = tuple((speed, ambient) for ambient in AMBIENT_DEGC for speed in SPEEDS_KM_H)
DURATION_S: Final = 600.0
"""Short, so that the smallest battery is not empty at the highest speed."""
APART: Final = 0.12
WORTH: Final = 0.025
"""Share of the consumption from which a cause is named."""
BODIES: Final = {
    "bmw_i3_60ah": "small",
    "bmw_i3_94ah": "small",
    "bmw_i3_120ah": "small",
    "fiat_500e": "small",
    "peugeot_e_208": "small",
    "renault_zoe_ze50_r135": "small",
    "nissan_leaf_24": "hatchback",
    "nissan_leaf_30": "hatchback",
    "nissan_leaf_40": "hatchback",
    "chevrolet_bolt": "hatchback",
    "vw_e_golf": "hatchback",
    "vw_id3": "hatchback",
    "hyundai_kona_64": "suv",
    "tesla_model_3_lr": "sedan",
    "tesla_model_3_sr_plus": "sedan",
}
"""Kind of body of the cars with a file of their own."""
PARTS: Final = ("rolling", "air", "drivetrain", "climate", "base load")


@dataclass(frozen=True, slots=True)
class Point:
    """Consumption at a steady speed by part [Wh/km]."""

    parts: Mapping[str, float]

    @property
    def wh_per_km(self) -> float:
        return sum(self.parts.values())


def driven(vehicle: Vehicle, speed_km_h: float, ambient_degc: float) -> Point:
    """Simulate some minutes at a constant speed."""
    time = np.arange(0.0, DURATION_S + 1.0, 10.0)
    climate = vehicle.climate
    run = simulate(
        vehicle,
        time,
        np.full_like(time, speed_km_h * M_S_PER_KM_H),
        conditions=DriveConditions(
            ambient_temperature_degc=ambient_degc,
            initial_warmth=1.0,
            initial_cabin_temperature_degc=None if climate is None else climate.setpoint_degc,
            initial_soc=0.6,
        ),
    )
    return Point(_parts(run, speed_km_h))


def _parts(run: Simulation, speed_km_h: float) -> dict[str, float]:
    step = np.diff(run.time_s, prepend=run.time_s[0])
    power, km = run.power_by_cause_w, speed_km_h * DURATION_S / SECONDS_PER_HOUR
    energy = {cause: float(np.sum(power[cause] * step)) * WH_PER_J / km for cause in power}
    parts = {
        "rolling": energy["rolling"],
        "air": energy["air"],
        "climate": energy["climate"],
        "base load": energy["base_load"],
    }
    return {**parts, "drivetrain": sum(energy.values()) - sum(parts.values())}


@cache
def shared_car() -> Vehicle:
    """A car of the table without a coast-down or an anchor: tyres, cabin and loads of a passenger car, without a heat pump."""
    car = unanchored("renault_megane_60")
    assert car.climate is not None
    return replace(car, climate=replace(car.climate, heat_pump_max_heat_w=0.0))


@cache
def drivetrain_loss(machine: str, speed_km_h: float) -> float:
    """Loss between wheel and battery over the energy at the wheels: median of the library's cars with a type of motor."""
    shares = []
    for name in vehicle_names():
        car = load_vehicle(name)
        if car.drivetrain.machine == machine:
            parts = driven(car, speed_km_h, AMBIENT_DEGC[0]).parts
            shares.append(parts["drivetrain"] / (parts["rolling"] + parts["air"]))
    return median(shares)


def drag_area(name: str) -> float:
    """Published drag area [m2]: of the car before its anchor; that of its kind of body where none is published."""
    row = catalogue().get(name, {})
    if "title" in row and "coastdown_a" not in row:
        return class_values().drag_area_m2[row["body"][0].value]
    load = unanchored(name).road_load
    if load.drag_coefficient is not None and load.frontal_area_m2 is not None:
        return load.drag_coefficient * load.frontal_area_m2
    return load.drag_area_m2


def expected(name: str, speed_km_h: float, ambient_degc: float) -> Point:
    """Consumption by the published mass and drag area with the tyres, losses, loads and cabin of the class, as a plain formula.

    Rolling is m g (c0 + c1 v) with the medians of the class, times 1 + k (20 °C - T); air is half rho c_d A v squared; the drivetrain
    loses the median share; loads and climate control are those of the shared passenger car without a heat pump.
    """
    car, classes, shared = unanchored(name), class_values(), shared_car()
    speed = speed_km_h * M_S_PER_KM_H
    weight = car.body.test_mass_kg * GRAVITY_M_S2
    tyres = shared.tyres
    weather = 1.0 if tyres is None else tyres.weather_factor(ambient_degc)
    rolling = weight * (classes.rolling + classes.rolling_per_speed_s_m * speed) * weather
    air = 0.5 * air_density(ambient_degc) * drag_area(name) * speed**2
    shares = driven(shared, speed_km_h, ambient_degc).parts
    per_n = 1000.0 * WH_PER_J  # Wh/km of a newton
    wheels = {"rolling": rolling * per_n, "air": air * per_n}
    loss = drivetrain_loss(car.drivetrain.machine, speed_km_h)
    return Point(
        {
            **wheels,
            "drivetrain": loss * sum(wheels.values()),
            "climate": shares["climate"],
            "base load": shares["base load"],
        }
    )


def body(name: str) -> str:
    """Kind of body of a car."""
    row = catalogue().get(name, {})
    return row["body"][0].value if "body" in row else BODIES[name]


def model_of(title: str) -> str:
    """Maker and model, the same for cars that differ in battery, drive or year."""
    words = re.sub(r"\(.*?\)", "", title).replace("i3s", "i3").split()
    long = words[1] in ("Model", "Mustang", "Electrified") or re.fullmatch(r"\d", words[2])
    return " ".join(words[:3] if long or words[2] in ("SUV", "Electric", "GT") else words[:2])


@dataclass(frozen=True, slots=True)
class CarRow:
    """A car at the nine points, simulated and expected."""

    name: str
    title: str
    simulated: tuple[Point, ...]
    expected: tuple[Point, ...]

    @property
    def apart(self) -> tuple[float, ...]:
        """Relative difference at each point."""
        pairs = zip(self.simulated, self.expected, strict=True)
        return tuple(simulated.wh_per_km / plain.wh_per_km - 1.0 for simulated, plain in pairs)

    @property
    def farthest(self) -> int:
        """Point with the largest difference."""
        return max(range(len(POINTS)), key=lambda i: abs(self.apart[i]))

    def causes(self) -> list[str]:
        """What makes the largest difference, part by part, the largest first."""
        i = self.farthest
        simulated, plain = self.simulated[i], self.expected[i]
        change = {part: (simulated.parts[part] - plain.parts[part]) / plain.wh_per_km for part in PARTS}
        sign = 1.0 if self.apart[i] > 0.0 else -1.0
        order = sorted((p for p in PARTS if sign * change[p] > WORTH), key=lambda p: -sign * change[p])
        return [f"{part} {100.0 * change[part]:+.0f} % ({self._why(part, POINTS[i])})" for part in order]

    def _why(self, part: str, point: tuple[float, float]) -> str:
        """The values of the car behind a part, beside those of the class."""
        car, plain, classes = load_vehicle(self.name), unanchored(self.name), class_values()
        speed = point[0] * M_S_PER_KM_H
        anchor = anchors().get(self.name)
        changed = (
            "" if anchor is None else f"; the anchor ({anchor.loss}) closes {-100.0 * anchor.before:+.0f} %"
        )
        if part == "rolling":
            own, book = (
                sum(c * speed**k for k, c in enumerate(v.road_load.rolling_coefficients))
                for v in (car, plain)
            )
            usual = classes.rolling + classes.rolling_per_speed_s_m * speed
            return f"{own:.4f} of the weight, published {book:.4f}, the class {usual:.4f}"
        if part == "air":
            published = drag_area(self.name)
            own = car.road_load.drag_area_m2
            return f"drag area {own:.2f} m², published {published:.2f}, its kind of body {classes.drag_area_m2[body(self.name)]:.2f}"
        if part == "drivetrain":
            i = POINTS.index(point)
            wheels = [p.parts["rolling"] + p.parts["air"] for p in (self.simulated[i], self.expected[i])]
            shares = [
                p.parts["drivetrain"] / w
                for p, w in zip((self.simulated[i], self.expected[i]), wheels, strict=True)
            ]
            return f"loses {100 * shares[0]:.0f} % of the energy at the wheels, the class {100 * shares[1]:.0f} %{changed}"
        if part == "climate":
            pump = car.climate is not None and car.climate.heat_pump_max_heat_w > 0.0
            return "heat pump" if pump else "its cabin is not that of the class"
        return f"{car.auxiliaries.base_load_w:.0f} W"


def rows(names: Sequence[str] | None = None) -> list[CarRow]:
    """Every car of the library, in order of its title."""
    cars = []
    for name in vehicle_names() if names is None else names:
        car = load_vehicle(name)
        cars.append(
            CarRow(
                name,
                car.title,
                tuple(driven(car, *point) for point in POINTS),
                tuple(expected(name, *point) for point in POINTS),
            )
        )
    return sorted(cars, key=lambda row: (row.title, row.name))


MIDDLE: Final = POINTS.index((110.0, 20.0))
"""Point at which cars of one model are compared."""


def beside_siblings(table: Sequence[CarRow]) -> dict[str, dict[str, float]]:
    """Each part at `MIDDLE` less that of the middle car of the model, over its consumption; without cars that are alone."""
    models: dict[str, list[CarRow]] = {}
    for row in table:
        models.setdefault(model_of(row.title), []).append(row)
    beside = {}
    for group in models.values():
        points = sorted((row.simulated[MIDDLE] for row in group), key=lambda point: point.wh_per_km)
        middle = points[len(points) // 2]
        for row in group if len(group) > 1 else ():
            parts = row.simulated[MIDDLE].parts
            beside[row.name] = {p: (parts[p] - middle.parts[p]) / middle.wh_per_km for p in PARTS}
    return beside


def render(table: Sequence[CarRow]) -> str:
    """Markdown: the nine points of every car, and the causes of what is far from the class or from its siblings."""
    siblings = beside_siblings(table)
    head = " | ".join(f"{speed:.0f} km/h, {ambient:.0f} °C" for speed, ambient in POINTS)
    lines = [
        f"| car | name | {head} | beside the class | beside siblings |",
        "|---|---|" + "---:|" * (len(POINTS) + 2),
    ]
    for row in table:
        low, high = min(row.apart), max(row.apart)
        beside = f"{100 * sum(siblings[row.name].values()):+.0f} %" if row.name in siblings else "–"
        points = " | ".join(f"{point.wh_per_km:.0f}" for point in row.simulated)
        lines.append(
            f"| {row.title} | `{row.name}` | {points} | {100 * low:+.0f} to {100 * high:+.0f} % | {beside} |"
        )
    far = [row for row in table if max(map(abs, row.apart)) > APART]
    apart = np.array([row.apart for row in table])
    lines += [
        "",
        f"{len(table)} cars; {len(far)} are more than {100 * APART:.0f} % from the formula at one of the points. Over cars and points the "
        f"median of the difference is {100 * np.median(apart):+.1f} %, its middle half "
        f"{100 * np.quantile(apart, 0.25):+.1f} to {100 * np.quantile(apart, 0.75):+.1f} %.",
        "",
        "| car | name | farthest at | difference | causes |",
        "|---|---|---|---:|---|",
    ]
    for row in far:
        speed, ambient = POINTS[row.farthest]
        where, by = f"{speed:.0f} km/h, {ambient:.0f} °C", f"{100 * row.apart[row.farthest]:+.0f} %"
        lines.append(f"| {row.title} | `{row.name}` | {where} | {by} | {'; '.join(row.causes())} |")
    lines += ["", "| car | name | beside siblings | parts | masses, drag areas |", "|---|---|---:|---|---|"]
    for row in table:
        parts = siblings.get(row.name, {})
        total = sum(parts.values())
        if abs(total) > APART:
            shown = ", ".join(f"{p} {100 * v:+.0f} %" for p, v in parts.items() if abs(v) > WORTH)
            lines.append(
                f"| {row.title} | `{row.name}` | {100 * total:+.0f} % | {shown} | {_of_model(row, table)} |"
            )
    return "\n".join(lines)


def _of_model(row: CarRow, table: Sequence[CarRow]) -> str:
    """Mass and drag area of a car, and the ranges of its model."""
    group = [load_vehicle(r.name) for r in table if model_of(r.title) == model_of(row.title)]
    car = load_vehicle(row.name)
    masses, areas = [c.body.test_mass_kg for c in group], [c.road_load.drag_area_m2 for c in group]
    return (
        f"{car.body.test_mass_kg:.0f} of {min(masses):.0f} to {max(masses):.0f} kg, "
        f"{car.road_load.drag_area_m2:.2f} of {min(areas):.2f} to {max(areas):.2f} m²"
    )


def main(write: bool = False) -> None:
    """Print the table. `--write` renews that of docs/reference/library.md."""
    table = render(rows())
    print(table)
    if write:
        pages.renew("reference/library.md", "steady", table)


if __name__ == "__main__":
    run(main)
