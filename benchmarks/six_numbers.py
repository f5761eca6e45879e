"""Cars from a few figures against their published WLTP consumption: `python -m benchmarks.six_numbers`.

Three trials: cars that the library lacks, without their consumption; cars of the library with a WLTP figure, each left out of the
class, without it too; and some of them with the combined label of the EPA alone. Masses and WLTP figures come from the lists (`TRIPWATT_CATALOGUE`). Which cars take part was
written down before the first run; no value of the description was chosen on those that the library lacks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from tools import CATALOGUE
from tools.command import run
from tools.docs import pages

from benchmarks.measure import Row
from tripwatt.certification.describing import (
    LABEL_FACTOR,
    LABEL_SHARES,
    certified_interval,
    describe_car,
    described,
)
from tripwatt.units import M_PER_MILE
from tripwatt.vehicles import load_vehicle
from tripwatt.vehicles.catalogue import DRIVER_KG, catalogue

LACKED: Final = (
    ("EQA 250+", 70.5, 140.0, "suv", True),
    ("EQC 400 4MATIC", 80.0, 300.0, "suv", True),
    ("E-UP! (83ch) Trans Elec 14'' rlt fbl résist DCC FIB", 32.3, 61.0, "small", False),
    ("ID.3 Pro S (77kWh/204ch) prop monorap 19'' Airstop FIA", 77.0, 150.0, "hatchback", False),
    ("ID. BUZZ Pro 2988 mm 204ch Boîte 1 vitesse automatique", 77.0, 150.0, "van", False),
    ('MG5 Autonomie Standard 50kWh (jantes 17")', 46.0, 130.0, "sedan", False),
    ("MARVEL R 2WD", 65.0, 132.0, "suv", False),
    ("MARVEL R 4WD", 65.0, 212.0, "suv", False),
    ("DS3 CROSSBACK E-Tense (136ch)", 46.3, 100.0, "suv", True),
    ("e-BERLINGO M (57Kw)", 46.3, 100.0, "van", True),
    ("EQV (150kW) long", 90.0, 150.0, "van", False),
    ("EQB 250", 66.5, 140.0, "suv", True),
)
"""Row of the list, usable energy [kWh], power [kW], body and heat pump of cars that the library lacks."""

BOTH: Final = {
    "hyundai_kona_64": "KONA electric 64 kWh",
    "kia_niro_64": "e-NIRO Moteur électrique (204ch)",
    "kia_niro_2023": "Niro EV Moteur électrique (204ch)",
    "kia_soul_64": "e-Soul Moteur électrique (204ch)",
    "kia_ev6_sr_rwd": "EV6 Moteur électrique 125kW (170ch)",
    "kia_ev6_lr_rwd": "EV6 Moteur électrique 168kW (229ch)",
    "kia_ev6_lr_awd": "EV6 Moteur électrique 239kW (325ch)",
    "kia_ev6_gt": "EV6 Moteur électrique 430kW (585ch)",
    "mazda_mx_30": "MX-30 e-SKYACTIV (145ch)",
    "tesla_model_3_2024_rwd": "RWD type 003 H6LR",
    "vw_id4_pro_2024": "Pro 210 kW 4ACEDFAD7PX2",
    "volvo_ex30_er": "Single Motor ER 2ZEL",
    "polestar_2_2025": "LR Single Motor VSFE",
}
"""Cars of the library with certified city and highway figures -> their row of the WLTP list."""

MIN_HELD: Final = 0.8
MAX_WIDTH: Final = 0.40


@dataclass(frozen=True, slots=True)
class Trial:
    """One car: its published figure and the interval [kWh/100 km]."""

    name: str
    published: float
    middle: float
    low: float
    high: float

    @property
    def held(self) -> bool:
        return self.low <= self.published <= self.high

    @property
    def width(self) -> float:
        return (self.high - self.low) / self.middle


def listed(description: str) -> tuple[float, float]:
    """Curb mass [kg] and WLTP consumption [kWh/100 km], the middle of a family."""
    rows = pd.read_csv(CATALOGUE / "wltp.csv")
    line = rows[rows.description == description].iloc[0]
    middle = 0.5 * (float(line.wltp_kwh_100km_min) + float(line.wltp_kwh_100km_max))
    return float(line.mass_running_order_kg_min) - DRIVER_KG, middle


def without_consumption() -> Iterator[Trial]:
    for description, energy, power, body, pump in LACKED:
        mass, published = listed(description)
        car = describe_car(
            mass_kg=mass, usable_battery_kwh=energy, motor_power_kw=power, body=body, heat_pump=pump
        )
        interval = certified_interval(car)
        yield Trial(description, published, interval.middle, interval.low, interval.high)


def known_of(name: str, consumption: float | None = None) -> dict[str, float | None]:
    """The figures of a car of the library."""
    car, energy = load_vehicle(name), catalogue()[name].get("usable_energy")
    return {
        "mass_kg": car.body.curb_mass_kg,
        "usable_battery_kwh": energy[0].number if energy else 64.0,
        "motor_power_kw": car.drivetrain.motor_max_power_w / 1000.0,
        "consumption_kwh_per_100km": consumption,
    }


def body_of(name: str) -> str:
    row = catalogue()[name]
    return row["body"][0].value if "body" in row else "suv"


def of_the_library() -> Iterator[Trial]:
    for name, row in catalogue().items():
        if "wltc" in row:
            interval = certified_interval(described(known_of(name), body_of(name), without=(name,)))
            published = float(np.mean([cell.number for cell in row["wltc"]]))
            yield Trial(load_vehicle(name).title, published, interval.middle, interval.low, interval.high)


def label_kwh_per_100km(name: str) -> float:
    """Combined label of a car from its certified city and highway figures."""
    row = catalogue()[name]
    both = {cycle: float(np.mean([cell.number for cell in row[cycle]])) for cycle in LABEL_SHARES}
    combined = sum(share * both[cycle] for cycle, share in LABEL_SHARES.items())
    return combined / (M_PER_MILE / 1000.0) / LABEL_FACTOR


def with_label() -> Iterator[Trial]:
    for name, description in BOTH.items():
        _, published = listed(description)
        given = known_of(name, label_kwh_per_100km(name))
        own = described(given, body_of(name), procedure="epa", without=(name,))
        interval = certified_interval(own)
        yield Trial(load_vehicle(name).title, published, interval.middle, interval.low, interval.high)


def summary(trials: list[Trial]) -> tuple[float, float]:
    """Share of the intervals that hold the published figure, and their median width."""
    return float(np.mean([t.held for t in trials])), float(np.median([t.width for t in trials]))


def all_trials() -> dict[str, list[Trial]]:
    """What is known of the cars -> their trials."""
    return {
        "without the consumption": list(without_consumption()),
        "the same, cars of the library": list(of_the_library()),
        "with the label of the EPA alone": list(with_label()),
    }


def bars() -> Iterator[Row]:
    """The bars on described cars."""
    for what, trials in all_trials().items():
        held, width = summary(trials)
        yield Row(f"described cars {what}: WLTP figure inside the 90 % interval", held, least=MIN_HELD)
        yield Row(f"described cars {what}: median width", width, most=MAX_WIDTH)


def main(write: bool = False) -> None:
    """Print all tables. `--write` renews that of docs/reference/vehicles.md."""
    rows = []
    for title, trials in all_trials().items():
        print(
            f"\n{title}\n\n| car | WLTP, kWh/100 km | described | 90 % interval | held |\n|---|---:|---:|---|---|"
        )
        for t in trials:
            print(
                f"| {t.name} | {t.published:.1f} | {t.middle:.1f} | {t.low:.1f} to {t.high:.1f} | {'yes' if t.held else 'no'} |"
            )
        held, width = summary(trials)
        print(f"\n{sum(t.held for t in trials)} of {len(trials)} held ({held:.0%}), median width {width:.1%}")
        rows.append(f"| {title} | {sum(t.held for t in trials)} of {len(trials)} | {100 * width:.0f} |")
    if write:
        head = "| described | inside the 90 % interval | median width of it [%] |\n|---|---:|---:|"
        pages.renew("reference/vehicles.md", "six-numbers", "\n".join([head, *rows]))


if __name__ == "__main__":
    run(main)
