"""Simulated against measured energy of the BMW i3 on Argonne's dynamometer, row by row.

Run: ``python -m benchmarks.argonne [--write]``. Needs the Argonne rows and the cycles in the folders
of the environment variables TRIPWATT_REFERENCE and TRIPWATT_DATA.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from tools import DATA, REFERENCE
from tools.command import run
from tools.docs import pages

from benchmarks.measure import Row
from tripwatt.physics import DriveConditions, simulate
from tripwatt.units import M_PER_MILE
from tripwatt.vehicles import load_vehicle
from tripwatt.vehicles.parts import RoadLoad

TEST_MASS_KG = 1443.33
"""Argonne D3 Master Summary List, 2014 BMW i3 BEV: 3182 lb."""

SET_LOAD = RoadLoad("coastdown", 104.98, 6.600, 0.2604, TEST_MASS_KG, 1.167)
"""What the dynamometer was set to, same source: 23.6 lbf, 0.6633 lbf/mph, 0.0117 lbf/mph2."""


def argonne_rows(data: Path, reference: Path, vehicle_name: str = "bmw_i3_60ah") -> pd.DataFrame:
    """One row per dynamometer test with `simulated_wh_per_mile` and `error` (simulated over measured - 1)."""
    vehicle = replace(load_vehicle(vehicle_name), road_load=SET_LOAD)
    rows = pd.read_csv(reference / "anl_d3_i3.csv")
    cycles = {name: pd.read_csv(data / "cycles" / f"{name.lower()}.csv") for name in rows["cycle"].unique()}
    simulated = []
    setpoint = 22.2  # 72 °F
    for row in rows.itertuples():
        cycle = cycles[str(row.cycle)]
        time = cycle["cycSecs"].to_numpy(float)
        speed = cycle["cycMps"].to_numpy(float)
        run = simulate(
            vehicle,
            time,
            speed,
            conditions=DriveConditions(
                on_dynamometer=True,
                ambient_temperature_degc=float(str(row.cell_temperature_degc)),
                payload_mass_kg=TEST_MASS_KG - vehicle.body.test_mass_kg,
                climate="off" if row.climate == "off" else "auto",
                initial_cabin_temperature_degc=setpoint if row.start == "hot" else None,
                cabin_setpoint_degc=setpoint,
                solar_irradiance_w_m2=850.0 if "850" in str(row.climate) else 0.0,
                initial_warmth=1.0 if row.start == "hot" else 0.0,
                air_density_kg_m3=vehicle.road_load.coastdown_air_density_kg_m3,
            ),
        )
        simulated.append(run.simulated_energy_wh / (np.trapezoid(speed, time) / M_PER_MILE))
    return rows.assign(
        simulated_wh_per_mile=simulated,
        error=np.asarray(simulated) / rows["dc_wh_per_mile"].to_numpy(float) - 1.0,
    )


def summary(rows: pd.DataFrame) -> dict[str, float]:
    """Mean absolute errors by temperature and start, and the worst row at 21 to 25 °C."""
    error = rows["error"].abs()
    warm = rows["cell_temperature_degc"].between(21, 25)
    return {
        "mean_absolute_error": float(error.mean()),
        "mean_absolute_error_cold_start": float(error[rows["start"] == "cold"].mean()),
        "mean_absolute_error_hot_start": float(error[rows["start"] == "hot"].mean()),
        "worst_error_21_to_25_degc": float(error[warm].max()),
    }


UNUSED = (
    ("US06", -6),
    ("US06", 1),
    ("US06", 2),
    ("US06", 23),
    ("US06", 36),
    ("UDDS", 22),
    ("UDDS", 23),
)
"""Cycle and temperature of the rows that served no estimate of a value (docs/decisions): they are the check."""


def informing(rows: pd.DataFrame) -> pd.Series:
    """Which rows served the estimate of a value."""
    keys = zip(rows["cycle"], rows["cell_temperature_degc"], strict=True)
    return pd.Series([key not in UNUSED for key in keys], index=rows.index)


def render_rows(rows: pd.DataFrame) -> str:
    """Markdown of all rows and of the summary."""
    informed = informing(rows)
    lines = [
        "| cell °C | cycle | start | climate | measured Wh/mile | simulated Wh/mile | error | served an estimate |",
        "|---:|---|---|---|---:|---:|---:|---|",
    ]
    for row, seen in zip(rows.itertuples(), informed, strict=True):
        lines.append(
            f"| {row.cell_temperature_degc} | {row.cycle} | {row.start} | {row.climate} | {row.dc_wh_per_mile:.1f} "
            f"| {row.simulated_wh_per_mile:.1f} | {row.error:+.1%} | {'yes' if seen else ''} |"
        )
    lines += ["", "| mean absolute error | |", "|---|---:|"]
    error = rows["error"].abs()
    figures = {
        f"all {len(rows)} rows": error.mean(),
        "cold-start rows": error[rows["start"] == "cold"].mean(),
        "hot-start rows": error[rows["start"] == "hot"].mean(),
        f"the {int((~informed).sum())} rows that served no estimate": error[~informed].mean(),
        "worst row at 21 to 25 °C": error[rows["cell_temperature_degc"].between(21, 25)].max(),
    }
    lines += [f"| {name} | {value:.1%} |" for name, value in figures.items()]
    return "\n".join(lines) + "\n"


def bars() -> Iterator[Row]:
    """The bar on warm rows."""
    worst = summary(argonne_rows(DATA, REFERENCE))["worst_error_21_to_25_degc"]
    yield Row("moving parts: worst row at 21-25 °C of Argonne's dynamometer", worst, most=0.08)


def main(write: bool = False) -> None:
    """Print the rows. `--write` renews docs/explanation/argonne.md."""
    table = render_rows(argonne_rows(DATA, REFERENCE))
    print(table)
    if write:
        pages.renew("explanation/argonne.md", "argonne", table)


if __name__ == "__main__":
    run(main)
