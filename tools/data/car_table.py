"""The table of cars from the public lists: `python -m tools.data.car_table --write`.

`car_selection.csv` names each car, its variant and the rows of the lists that are its own. The values are taken from the
lists by this module, so that no figure of them is typed by hand. `car_makers.csv` has the figures that makers publish of cars that the
lists lack; each is compared with a second list (`unconfirmed`), which is not shipped. The lists are not part of this repository
(`TRIPWATT_CATALOGUE`, default ../shared/reference/ev_catalogue); their README names sources, licences and faults.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from tools import CATALOGUE, ROOT
from tools.command import run

SELECTION: Final = Path(__file__).with_name("car_selection.csv")
MAKERS: Final = SELECTION.with_name("car_makers.csv")
CHARGING_SELECTION: Final = Path(__file__).with_name("charging_selection.csv")
TABLE: Final = ROOT / "src" / "tripwatt" / "vehicles" / "data" / "table" / "cars.csv"

CHARGING: Final = TABLE.with_name("charging.csv")

LABEL_FACTOR: Final = 0.7
"""Label over dynamometer in miles per gallon equivalent, 40 CFR 600.210-12, for makers that do not run five cycles."""

KWH_PER_GALLON: Final = 33.705
"""Energy of a gallon of gasoline in miles per gallon equivalent, 40 CFR 600.002."""

KM_PER_MILE: Final = 1.609344
DRIVER_KG: Final = 75.0

IRON_PHOSPHATE: Final = frozenset({"tesla_model_3_2022_rwd", "tesla_model_3_2024_rwd"})
"""Cars of the selection whose cells have an iron phosphate cathode."""

LABELS: Final = (
    ("bmw_i3_60ah", 3125, 137, 111, "2014-2016"),
    ("bmw_i3_94ah", 3250, 129, 106, "2017"),
    ("bmw_i3_120ah", 3250, 124, 102, "2019"),
    ("nissan_leaf_24", 3625, 126, 101, "2014-2016"),
    ("nissan_leaf_30", 3625, 124, 101, "2016"),
    ("tesla_model_3_sr_plus", 3875, 140, 124, "2019"),
    ("vw_e_golf", 3750, 126, 111, "2017-2019"),
    ("fiat_500e", 3250, 121, 103, "2016-2019"),
)
"""Car with a file of its own, test weight [lb], and its label for city and highway [mpg equivalent] (fueleconomy.gov)."""

TESTS: Final = (
    (
        "nissan_leaf_40",
        3875,
        33.705e2 / 175.55,
        33.705e2 / 141.2,
        "KWB115: 174.0 and 177.1, 141.1 and 141.3 mpg equivalent",
    ),
    (
        "tesla_model_3_lr",
        4250,
        8940.4 / 495.04,
        8940.4 / 454.64,
        "EPA application HTSLV00.0L13: 89.404 kWh for 495.04 and 454.64 mi",
    ),
    ("hyundai_kona_64", 4000, 17.2, 21.7, "OS9F6EU03AC"),
    ("chevrolet_bolt", 3875, 33.705e2 * 0.7 / 130.5, 33.705e2 * 0.7 / 109.0, "1NFV5831: printed as label"),
)
"""Car with a file of its own, test weight [lb], certified UDDS and HWFET [kWh/100 mi], and the row of the list."""

WLTP: Final = (
    ("vw_id3", 2260, None, 58_000 / 426, "range 426 km with 58 kWh"),
    ("renault_zoe_ze50_r135", 1988, 17.7, 52_000 / 386, "range 386 km with 52 kWh"),
    ("peugeot_e_208", 1910, 16.4, 46_000 / 340, "range 340 km with 46 kWh"),
)
"""Car with a file of its own, largest mass [kg], consumption at the wall [kWh/100 km] and at the battery [Wh/km]."""

FRONTAL_SHARE: Final = 0.84
"""Frontal area over width times height without mirrors: 0.83 to 0.86 for the cars of which an area is published (Model 3, e-Golf, e-tron 55, Taycan, EQS)."""

AGREEMENT: Final = 0.05
"""Two sources of a usable energy, a mass or a range agree within this."""

WIDEST_FAMILY: Final = 1.2
"""Highest over lowest consumption of a family up to which the middle stands for the car."""

CYCLES: Final = {"Charge Depleting UDDS": "udds", "Charge Depleting Highway": "hwfet"}

CERTIFICATES: Final = {
    "Tesla Model 3 RWD MY2024 base": "tesla_model_3_2024_rwd",
    "Volvo EX30 SM ER MY2025 19/20 in": "volvo_ex30_er_19",
    "Volvo EX30 SM ER MY2025 18 in": "volvo_ex30_er",
    "Polestar 2 LR SM MY2025 19 in": "polestar_2_2025",
    "Polestar 2 LR SM MY2025 20 in": "polestar_2_2025_20",
    "VW ID.4 Pro MY2024 D mode": "vw_id4_pro_2024",
    "VW ID.4 Pro MY2024 B mode": "vw_id4_pro_2024",
}
"""Car and configuration of a certificate -> the car of the table."""

EEA: Final = {
    "polestar_2_2025": "LR Single Motor VSFE",
    "tesla_model_3_2024_rwd": "RWD type 003 H6LR",
    "vw_id3": "Pro 150 kW ACEBJCL1FX2",
    "vw_id4_pro_2024": "Pro 210 kW 4ACEDFAD7PX2",
}
"""Cars whose WLTP figure is in the list of registrations, by its type. Its last part reaches 131 km/h, the highway schedule 97.
The Volvo EX30 of the list has unknown wheels, and takes 9 % more for its schedules than the American certificate says; it is left out."""

OTHER_ROW: Final = {"honda_e": 1}
"""Cars whose first row in the French list is of larger wheels, and the row of the standard ones."""

TOKENS: Final = {
    "Audi": r"e-?tron|q4|gt",
    "Tesla": r"3|y|s|x",
}
"""Words of a model's name in lists of batteries, where the title's first word is not one."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of the table: a value of a car, with its unit and its source."""

    car: str
    key: str
    value: str
    unit: str
    source: str
    note: str = ""


def number(value: float, digits: int = 7) -> str:
    """As the table writes it."""
    return f"{value:.{digits}g}"


def cells(folder: Path = CATALOGUE) -> list[Cell]:
    """Every cell of every selected car."""
    epa = pd.read_csv(folder / "epa_ev.csv")
    wltp = pd.read_csv(folder / "wltp.csv")
    certificates = pd.read_csv(folder / "epa_cert_dc.csv")
    ratings = pd.read_csv(folder / "ratings.csv")
    specs = json.loads((folder / "ev_specs.json").read_text("utf-8"))
    second = pd.read_csv(folder / "oed_specs.csv")
    table: list[Cell] = []
    with SELECTION.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            table += described(row)
            table += usable(row, specs, second)
            if row["make"] == "ADEME":
                table += from_ademe(row, wltp)
            else:
                table += from_epa(row, epa, ratings)
                table += from_certificates(row["car"], certificates)
    with MAKERS.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            table += [*described(row), *usable(row, specs, second), *from_maker(row, wltp)]
    for car, kind in EEA.items():
        rows: Any = wltp[wltp.description == kind].itertuples()
        (line,) = rows
        table.append(Cell(car, "wltc", number(line.wltp_kwh_100km_min), "kWh/100 km", "eea"))
        table.append(Cell(car, "wltc_mass", number(line.wltp_test_mass_kg), "kg", "eea"))
    return [*table, *with_own_file()]


def with_own_file() -> Iterator[Cell]:
    """Certified figures of the cars that have a file of their own."""
    for car, weight, city, highway, years in LABELS:
        yield Cell(car, "test_weight", number(weight), "lb", "label")
        for key, mpge in (("udds", city), ("hwfet", highway)):
            value = number(100.0 * KWH_PER_GALLON * LABEL_FACTOR / mpge, 6)
            yield Cell(car, key, value, "kWh/100 mi", "label", f"{mpge} mpg equivalent over 0.7, {years}")
    for car, pounds, udds, hwfet, note in TESTS:
        yield Cell(car, "test_weight", number(pounds), "lb", "epa_list")
        yield Cell(car, "udds", number(udds, 6), "kWh/100 mi", "epa_list", note)
        yield Cell(car, "hwfet", number(hwfet, 6), "kWh/100 mi", "epa_list", note)
    for car, largest, wall, battery, note in WLTP:
        yield Cell(car, "largest_mass", number(largest), "kg", "maker")
        if wall is not None:
            yield Cell(car, "wltc", number(wall), "kWh/100 km", "maker", "WLTP consumption")
        yield Cell(car, "wltc_battery", number(0.1 * battery, 6), "kWh/100 km", "maker", note)


def described(row: dict[str, str]) -> Iterator[Cell]:
    """What makers publish of every car."""
    car = row["car"]
    years = re.search(r"\((\d{4})(?:-(\d{4}))?\)", row["title"])
    assert years is not None, car
    yield Cell(car, "title", row["title"], "", "maker")
    yield Cell(car, "year_first", years[1], "year", "maker")
    yield Cell(car, "year_last", years[2] or years[1], "year", "maker")
    for key, unit in (("body", ""), ("drive", ""), ("machine", ""), ("pack_v", "V"), ("motor_kw", "kW")):
        yield Cell(
            car, {"pack_v": "pack_voltage", "motor_kw": "motor_power"}.get(key, key), row[key], unit, "maker"
        )
    yield Cell(car, "heat_pump", row["heat_pump"], "1", "maker")
    if row.get("c_d"):
        yield Cell(car, "drag_coefficient", row["c_d"], "1", "maker")
        area, _, source = row["frontal_m2"].partition(" ")
        width, _, height = row["width_x_height_m"].partition(" x ")
        note = f"{FRONTAL_SHARE} of {width} m times {height} m" if width else "as published"
        area = area or number(FRONTAL_SHARE * float(width) * float(height), 3)
        yield Cell(car, "frontal_area", area, "m2", source or "maker", note)
    if car in IRON_PHOSPHATE or row.get("chemistry") == "lfp":
        yield Cell(car, "chemistry", "lfp", "", "maker")


def token(title: str) -> tuple[str, str]:
    """Maker and a pattern of the model's name."""
    make, model, *_ = title.split()
    make = {"Mercedes-AMG": "Mercedes", "Mercedes-Benz": "Mercedes", "MINI": "Mini", "Škoda": "Skoda"}.get(
        make, make
    )
    if make in TOKENS:
        return make, TOKENS[make]
    if model == "Mustang":
        model = "mach"
    return make, re.escape(model.lower().replace("ë-", "").replace("e-", ""))


def usable(row: dict[str, str], specs: list[dict[str, Any]], second: pd.DataFrame) -> Iterator[Cell]:
    """Usable energy, its source, and whether a second source agrees."""
    car, energy = row["car"], float(row["usable_kwh"])
    make, pattern = token(row["title"])

    def named(name: str) -> bool:
        return re.search(rf"(?<![a-z0-9])(?:{pattern})", name.lower()) is not None

    first = [
        s["source"].split("@")[0]
        for s in specs
        if s["brand"].lower() == make.lower()
        and s["usable_kwh"]
        and abs(s["usable_kwh"] - energy) < 0.05
        and (named(f"{s['model']} {s['variant']}") or not re.search(r"[a-z]{3}", s["model"].lower()))
    ]
    agreeing = second[
        second.make.str.lower().str.startswith(make.lower())
        & second.model.map(lambda model: named(str(model)))
        & ((second.net_kwh / energy - 1.0).abs() <= AGREEMENT)
    ]
    source = "maker"
    if any("chargeprice" in name for name in first):
        source = "chargeprice"
    elif first:
        source = "kilowatt"
    yield Cell(car, "usable_energy", number(energy), "kWh", source)
    confirmed = len(agreeing) > 0 and bool(first)
    note = f"{len(agreeing)} rows of open-ev-data-dataset within 5 %" if confirmed else "one source"
    yield Cell(car, "confirmed", str(int(confirmed)), "1", "estimate", note)


def from_epa(row: dict[str, str], epa: pd.DataFrame, ratings: pd.DataFrame) -> Iterator[Cell]:
    """Coast-down, test weight and certified consumption of the two cycles."""
    car = row["car"]
    mine = epa[
        (epa.make == row["make"])
        & (epa.model == row["models"])
        & (epa.test_weight_lb == float(row["test_weight_lb"]))
        & (epa.a_lbf == float(row["a_lbf"]))
    ]
    assert len(mine), f"{car}: no row"
    sound = mine[~mine.c_lbf_mph2.isin(mine[mine.flag.notna()].c_lbf_mph2)]
    last = (sound if len(sound) else mine).sort_values("model_year").iloc[-1]
    mine = mine[(mine.b_lbf_mph == last.b_lbf_mph) & (mine.c_lbf_mph2 == last.c_lbf_mph2)]
    years = sorted(set(mine.model_year))
    where = f"{row['models']}, MY{years[0]}" + (f"-{years[-1]}" if len(years) > 1 else "")
    source = source_of(str(last.source_file))
    yield Cell(car, "test_weight", number(last.test_weight_lb), "lb", source, where)
    yield Cell(car, "coastdown_a", number(last.a_lbf), "lbf", source, where)
    yield Cell(car, "coastdown_b", number(last.b_lbf_mph), "lbf/mph", source, where)
    yield Cell(car, "coastdown_c", number(last.c_lbf_mph2), "lbf/mph2", source, where)
    for cycle, key in CYCLES.items():
        tests = mine[(mine.cycle == cycle) & mine.kwh_per_100mi.notna()]
        if not len(tests):
            continue
        kinds = set(tests.fe_kind)
        note = f"mean of {len(tests)} tests" if len(tests) > 1 else "one test"
        if any("as filed" in kind for kind in kinds):
            note += f"; as filed, {agreement(row['make'], key, float(tests.kwh_per_100mi.mean()), ratings)}"
        flagged = tests.flag.notna().any()
        note += "; ratio_outlier" if flagged else ""
        yield Cell(
            car,
            key,
            number(tests.kwh_per_100mi.mean(), 6),
            "kWh/100 mi",
            source_of(str(last.source_file)),
            note,
        )


def agreement(make: str, key: str, value: float, ratings: pd.DataFrame) -> str:
    """Whether fueleconomy.gov gives a figure as filed as its unadjusted consumption."""
    column = {"udds": "unadj_city_kwh_100km", "hwfet": "unadj_hwy_kwh_100km"}[key]
    theirs = ratings[ratings.make == make][column].dropna() * 1.609344
    agrees = (theirs / value - 1.0).abs() < 0.01
    return (
        "equal to an unadjusted figure of fueleconomy.gov" if agrees.any() else "not found at fueleconomy.gov"
    )


def source_of(file: str) -> str:
    """What a list is called in the column of sources."""
    for part, source in (("NREL", "epa_list"), ("eco-route", "epa_list_copy"), ("zero705", "epa_list_2025")):
        if part in file:
            return source
    raise LookupError(file)


def from_certificates(car: str, certificates: pd.DataFrame) -> Iterator[Cell]:
    """Energy at the battery and at the mains of the certificates of a car, each configuration."""
    mine: list[Any] = [
        line for line in certificates.itertuples() if CERTIFICATES.get(f"{line.car} {line.config}") == car
    ]
    if not mine:
        return
    for line in mine:
        note = f"document {line.epa_docid}, {line.config}"
        yield Cell(car, "udds_battery", number(line.dc_udds_wh_mi, 6), "Wh/mi", "epa_certificate", note)
        yield Cell(car, "hwfet_battery", number(line.dc_hwfet_wh_mi, 6), "Wh/mi", "epa_certificate", note)
        for key, column in (("udds", "range_udds_mi"), ("hwfet", "range_hwfet_mi")):
            value = 100.0 * line.recharge_ac_kwh / getattr(line, column)
            yield Cell(
                car, key, number(value, 6), "kWh/100 mi", "epa_certificate", f"recharge over range; {note}"
            )
        efficiency = number(line.charge_efficiency, 6)
        yield Cell(car, "charging_efficiency", efficiency, "1", "epa_certificate", note)


def from_ademe(row: dict[str, str], wltp: pd.DataFrame) -> Iterator[Cell]:
    """Mass in running order and consumption of a car that is not sold in the United States."""
    car = row["car"]
    mine = wltp[(wltp.description == row["models"]) & wltp.source.str.startswith("ADEME")]
    assert len(mine), f"{car}: no row"
    line = mine.iloc[OTHER_ROW.get(car, 0)]
    low, high = float(line.wltp_kwh_100km_min), float(line.wltp_kwh_100km_max)
    assert high / low <= WIDEST_FAMILY, f"{car}: a family of {low} to {high}"
    yield Cell(car, "running_mass", number(line.mass_running_order_kg_min), "kg", "ademe", row["models"])
    note = f"middle of the family, {low:g} to {high:g}" if high > low else row["models"]
    yield Cell(car, "wltc", number(0.5 * (low + high), 6), "kWh/100 km", "ademe", note)


def from_maker(row: dict[str, str], wltp: pd.DataFrame) -> Iterator[Cell]:
    """Mass, consumption and range that a maker publishes of a car; the mass of a public list where it has the car."""
    car, note = row["car"], row["note"]
    if row["test_weight_lb"]:
        yield Cell(car, "test_weight", row["test_weight_lb"], "lb", "epa_list_2025", note)
        for key in ("udds", "hwfet") if row["udds"] else ():
            per_mile = number(float(row[key]) * KM_PER_MILE, 6)
            yield Cell(
                car, key, per_mile, "kWh/100 mi", "fuel_economy_guide", f"{note}, {row[key]} kWh/100 km"
            )
    else:
        kept = wltp[
            (wltp.description == row["ademe"]) & (wltp.mass_running_order_kg_min == float(row["running_kg"]))
        ]
        assert len(kept) or not row["ademe"], f"{car}: no row with this mass"
        source = ("ademe", row["ademe"]) if row["ademe"] else ("maker", note)
        yield Cell(car, "running_mass", row["running_kg"], "kg", *source)
    if row["wltc"]:
        yield Cell(car, "wltc", row["wltc"], "kWh/100 km", "maker", note)
    if row["range_km"]:
        battery = number(100.0 * float(row["usable_kwh"]) / float(row["range_km"]), 6)
        how = f"{note}: range {row['range_km']} km with {row['usable_kwh']} kWh"
        yield Cell(car, "wltc_battery", battery, "kWh/100 km", "maker", how)


def unconfirmed(folder: Path = CATALOGUE) -> Iterator[str]:
    """Figures of `car_makers.csv` that no list has within `AGREEMENT`. The lists are for checking only."""
    second, wltp = pd.read_csv(folder / "oed_specs.csv"), pd.read_csv(folder / "wltp.csv")
    names = second.make.str.lower().str.replace("š", "s") + " " + second.model.astype(str)
    descriptions = wltp.model.astype(str) + " " + wltp.description
    with MAKERS.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        make, pattern = token(row["title"])
        named = rf"(?i)(?<![a-z0-9])(?:{pattern})(?![0-9])"
        specs = second[names.str.startswith(make.lower()) & names.str.contains(named)]
        official = wltp[descriptions.str.contains(named)]
        range_km = pd.to_numeric(official.range_km_max, errors="coerce")
        listed: dict[str, Any] = {
            "running_kg": [*(specs.curb_kg + DRIVER_KG), *official.mass_running_order_kg_min],
            "wltc": np.linspace(official.wltp_kwh_100km_min.min(), official.wltp_kwh_100km_max.max()),
            "range_km": [*specs.wltp_range_km, *range_km],
        }
        for key, values in listed.items():
            if row[key] and not any(abs(value / float(row[key]) - 1.0) <= AGREEMENT for value in values):
                yield f"{row['car']}: {key} {row[key]}"


def charging_points(folder: Path = CATALOGUE) -> list[list[str]]:
    """Points of the charging curves that were drawn for a car, one row each; `charging_selection.csv` names the cars."""
    specs = json.loads((folder / "ev_specs.json").read_text("utf-8"))
    rows = []
    with CHARGING_SELECTION.open(encoding="utf-8", newline="") as file:
        for chosen in csv.DictReader(file):
            drawn = [s for s in specs if is_drawn(s, chosen)]
            assert drawn, f"{chosen['car']}: no drawn curve"
            line = max(drawn, key=lambda s: s["release_year"])
            note = " ".join(
                filter(None, (line["brand"], line["model"], line["variant"], str(line["release_year"])))
            )
            rows += [
                [
                    chosen["car"],
                    number(soc / 100.0),
                    number(power),
                    number(line["ac_kw"]),
                    chosen["source"],
                    note,
                ]
                for soc, power in line["curve"]
            ]
    return rows


def is_drawn(spec: dict[str, Any], chosen: dict[str, str]) -> bool:
    """Whether a row of the list is the chosen car, with a curve of its own."""
    same = all(spec[key] == chosen[key] for key in ("brand", "model", "variant"))
    return same and spec["curve_kind"].startswith("drawn") and chosen["source"] in spec["source"].lower()


def write_charging(rows: list[list[str]], path: Path = CHARGING) -> None:
    """Write the charging curves."""
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["car", "displayed_soc", "power_kw", "alternating_kw", "source", "note"])
        out.writerows(rows)


def write_table(rows: list[Cell], path: Path = TABLE) -> None:
    """Write the cells."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["car", "key", "value", "unit", "source", "note"])
        out.writerows([r.car, r.key, r.value, r.unit, r.source, r.note] for r in rows)


def main(write: bool = False) -> None:
    """Count what the lists give. `--write` renews the tables of the package."""
    rows = cells()
    cars = {row.car for row in rows if row.key == "title"}
    points = charging_points()
    confirmed = sum(row.value == "1" for row in rows if row.key == "confirmed")
    print(f"{len(rows)} cells of {len(cars)} cars; usable energy of {confirmed} confirmed by a second source")
    print(f"charging curves of {len({row[0] for row in points})} cars")
    print("\n".join(("makers' figures that no list confirms:", *unconfirmed())))
    if write:
        write_table(rows)
        write_charging(points)


if __name__ == "__main__":
    run(main)
