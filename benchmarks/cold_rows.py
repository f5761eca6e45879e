"""Cars on the cold dynamometer of the EPA: `python -m benchmarks.cold_rows [--write]`.

The test car list has 35 usable rows of the FTP at 20 degF (-6.7 degC, 40 CFR 1066 subpart H: car and battery soaked in the cold, heater
on). Whether their energy is that at the wall or at the battery is not stated, so each row stands beside the same car's row of the UDDS at
23 degC: the ratio of both is free of that. How warm the cabin is kept is not stated either, so the city schedule is simulated with
climate control off and at 22 degC, with the coast-down and weight of the row and, of everything else, the car of the library that is
nearest. Nothing is fitted to these rows.
`--write` renews the summary in docs/reference/library.md. Needs the lists of `TRIPWATT_CATALOGUE`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
import pandas as pd
from tools import CATALOGUE
from tools.command import run
from tools.docs import pages

from tripwatt.certification.consumption import driven_wh_per_km, schedule
from tripwatt.physics import DriveConditions, simulate
from tripwatt.units import KG_PER_LB, M_S_PER_MPH, N_PER_LBF
from tripwatt.vehicles import Vehicle, load_vehicle

COLD: Final = "Charge Depleting 20 Degree F FTP"
CITY: Final = "Charge Depleting UDDS"
COLD_DEGC: Final = -6.7
MIN_KWH: Final = 10.0
"""Energy of 100 miles below which a row of this list is a fault: miles per gallon equivalent, or a slipped decimal."""
WARM_DEGC: Final = 23.9
SEQUENCE: Final = ("udds", "hwfet", "udds", "udds", "hwfet", "udds", "udds")
"""Phases of the multi-cycle range test of SAE J1634 without those at a steady speed."""
TESTED: Final = ("bmw_i3s_120ah", "chevrolet_bolt", "nissan_leaf_40", "vw_e_golf_2019")
"""Cars of "Electric Vehicle Range Testing", American Automobile Association, February 2019, that the library has; the fifth is a Model S 75D."""
TOLD: Final = (0.12, 0.41)
"""What that report says of the range without and with climate control, mean of its five cars."""
CHARGED: Final = 0.89
"""Share of the energy at the wall that reaches the battery, as in the EPA's certificates."""
SETPOINT_DEGC: Final = 22.0
NEAREST: Final = MappingProxyType(
    {
        "Model 3": "tesla_model_3_2022_lr_awd",
        "Model Y": "tesla_model_y_2022_lr_awd",
        "Model S": "tesla_model_s_2021_lr",
        "Model X": "tesla_model_x_2021_lr",
        "VF 8": "vw_id4_awd_pro",
        "Ocean": "vw_id4_awd_pro",
    }
)
"""Beginning of a model in the list, and the car of the library with its body and motors."""


@dataclass(frozen=True, slots=True)
class ColdRow:
    """A car in the cold: measured energy [kWh/100 mi] there and in the UDDS, and both simulated at the battery [Wh/km]."""

    title: str
    cold_kwh: float
    city_kwh: float
    off_wh_km: float
    heated_wh_km: float
    city_wh_km: float

    @property
    def measured(self) -> float:
        """Cold over warm."""
        return self.cold_kwh / self.city_kwh

    @property
    def off(self) -> float:
        """Cold over warm, simulated without climate control."""
        return self.off_wh_km / self.city_wh_km

    @property
    def heated(self) -> float:
        """Cold over warm, simulated with a cabin of 22 °C."""
        return self.heated_wh_km / self.city_wh_km


def car_of(row: pd.Series) -> Vehicle:
    """The nearest car of the library with the coast-down and weight of a row."""
    car = load_vehicle(next(name for start, name in NEAREST.items() if str(row["model"]).startswith(start)))
    mass = float(row["test_weight_lb"]) * KG_PER_LB
    load = replace(
        car.road_load,
        coastdown_a_n=float(row["a_lbf"]) * N_PER_LBF,
        coastdown_b_n_s_m=float(row["b_lbf_mph"]) * N_PER_LBF / M_S_PER_MPH,
        coastdown_c_n_s2_m2=float(row["c_lbf_mph2"]) * N_PER_LBF / M_S_PER_MPH**2,
        coastdown_mass_kg=mass,
    )
    return replace(car, road_load=load, body=replace(car.body, curb_mass_kg=mass - car.body.driver_mass_kg))


def in_the_cold(car: Vehicle, climate: str) -> float:
    """Energy of the city schedule at -6.7 degC at the battery [Wh/km], after the start: the battery is driven empty, for hours."""
    time, speed = schedule("udds")
    conditions = DriveConditions(
        on_dynamometer=True,
        ambient_temperature_degc=COLD_DEGC,
        initial_battery_temperature_degc=0.0,
        initial_cabin_temperature_degc=SETPOINT_DEGC,
        cabin_setpoint_degc=SETPOINT_DEGC,
        solar_irradiance_w_m2=0.0,
        initial_warmth=1.0,
        climate=climate,
        air_density_kg_m3=car.road_load.coastdown_air_density_kg_m3,
    )
    run = simulate(car, time, speed, conditions=conditions)
    return float(run.simulated_energy_wh / (np.trapezoid(speed, time) / 1000.0))


def compute() -> list[ColdRow]:
    """The usable rows of the list, each with the UDDS of the same car and year."""
    table = pd.read_csv(CATALOGUE / "epa_ev.csv")
    warm = table[(table["cycle"] == CITY) & (table["kwh_per_100mi"] > MIN_KWH)]
    rows = []
    for _, row in table[(table["cycle"] == COLD) & (table["kwh_per_100mi"] > MIN_KWH)].iterrows():
        same = warm[(warm["model"] == row["model"]) & (warm["model_year"] == row["model_year"])]
        if same.empty:
            continue
        car = car_of(row)
        city = driven_wh_per_km(car, schedule("udds"), car.body.test_mass_kg)
        title = f"{row['make']} {row['model']} {row['model_year']}"
        off, heated = (in_the_cold(car, climate) for climate in ("off", "auto"))
        rows.append(
            ColdRow(
                title, float(row["kwh_per_100mi"]), float(same["kwh_per_100mi"].mean()), off, heated, city
            )
        )
    return rows


def of_schedules(car: Vehicle, ambient_degc: float, climate: str) -> float:
    """Energy of a city and a highway schedule one after the other, soaked before [Wh/km]; the weights of the label, 55 and 45 %."""
    state: dict[str, float] = {}
    found = []
    for cycle in SEQUENCE:
        time, speed = schedule(cycle)
        conditions = DriveConditions(
            on_dynamometer=True,
            ambient_temperature_degc=ambient_degc,
            initial_battery_temperature_degc=state.get("battery", ambient_degc),
            initial_cabin_temperature_degc=state.get("cabin", ambient_degc),
            cabin_setpoint_degc=SETPOINT_DEGC,
            solar_irradiance_w_m2=0.0,
            initial_warmth=state.get("warmth", 0.0),
            climate=climate,
            air_density_kg_m3=car.road_load.coastdown_air_density_kg_m3,
        )
        run = simulate(car, time, speed, conditions=conditions)
        found.append((cycle, float(run.simulated_energy_wh / (np.trapezoid(speed, time) / 1000.0))))
        # the tyres are warm after the first of seven
        state = {"warmth": 1.0, "battery": float(run.battery_temperature_degc[-1])}
        cabin = float(run.cabin_temperature_degc[-1])
        if np.isfinite(cabin):
            state["cabin"] = cabin
    mean = {cycle: np.mean([wh for name, wh in found if name == cycle]) for cycle in dict(found)}
    return float(0.55 * mean["udds"] + 0.45 * mean["hwfet"])


def sentences() -> str:
    """Markdown: the loss of range at 20 °F that the American Automobile Association measured, and that of the library's cars."""
    lines = ["| car | climate off | climate on |", "|---|---:|---:|"]
    losses = []
    for name in TESTED:
        car = load_vehicle(name)
        warm = of_schedules(car, WARM_DEGC, "off")
        losses.append([1.0 - warm / of_schedules(car, COLD_DEGC, climate) for climate in ("off", "auto")])
        lines.append(f"| `{name}` | {-losses[-1][0]:.0%} | {-losses[-1][1]:.0%} |")
    off, on = np.mean(losses, axis=0)
    lines += [
        f"| mean | {-off:.0%} | {-on:.0%} |",
        f"| measured, mean of five cars | {-TOLD[0]:.0%} | {-TOLD[1]:.0%} |",
    ]
    return "\n".join(lines)


def render(rows: list[ColdRow]) -> str:
    """Markdown: each row."""
    lines = [
        "| car | 20 °F FTP | UDDS | cold over warm, measured | simulated, climate off | simulated, cabin of 22 °C |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {row.title} | {row.cold_kwh:.1f} | {row.city_kwh:.1f} | {row.measured:.2f} | {row.off:.2f} | {row.heated:.2f} |"
        for row in rows
    ]
    return "\n".join(lines)


def summary(rows: list[ColdRow]) -> str:
    """Markdown: the mean and the median over all rows, and the loss of range."""
    means = [np.mean([getattr(row, name) for row in rows]) for name in ("measured", "off", "heated")]
    medians = [np.median([getattr(row, name) for row in rows]) for name in ("measured", "off", "heated")]
    inside = sum(row.off <= row.measured <= row.heated for row in rows)
    lines = [
        f"{len(rows)} rows. Mean rise in the cold: measured {means[0]:.2f}, simulated {means[1]:.2f} without and {means[2]:.2f} "
        f"with climate control; {inside} measured rows lie between both. Medians: {medians[0]:.2f}, {medians[1]:.2f} and {medians[2]:.2f}; read as energy at the "
        f"battery, with {CHARGED:.0%} of the wall's arriving there, the measured one is {medians[0] / CHARGED:.2f}.",
        "",
        "Loss of range from 75 to 20 °F (23.9 to -6.7 °C), city and highway schedules:",
        "",
        sentences(),
    ]
    return "\n".join(lines)


def main(write: bool = False) -> None:
    """Print rows and summary. `--write` renews the summary in docs/reference/library.md."""
    rows = compute()
    print(f"{render(rows)}\n\n{summary(rows)}")
    if write:
        pages.renew("reference/library.md", "cold", summary(rows))


if __name__ == "__main__":
    run(main)
