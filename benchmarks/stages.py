"""Each stage of the simulation against its own signal: ``python -m benchmarks.stages [--docs]``.

The energy of a trip can be right although its parts are wrong. Here every part is compared with the signal that
measures it, over means of a second: shaft power with motor torque and speed; drive power with the battery less
climate control less what the car draws at standstill; the loss of motor and inverter with the difference of these
two; base load at standstill and while coasting; heater and air conditioner; voltage at rest. TUM logs have all of
them, VED logs have no torque and no voltage at rest worth the name.

The i3 stands there twice: with its published values, and with values that are identified from the same signals on the other half
of the trips (`tripwatt.hybrid.identification`), so that no value has seen the seconds that it is held against.

Prints all tables as Markdown; with ``--docs``, writes docs/explanation/stages.md, which has the figures and the tables that they do not show; with ``--identify``, prints the values from
every second trip. Needs TRIPWATT_DATA. Costs one simulation of each trip and car, and arrays.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from tools import DATA, DOCS
from tools.command import run

from tripwatt.auditing import audit
from tripwatt.auditing.signals import blank_stuck_heater
from tripwatt.hybrid import identify, stage_record
from tripwatt.physics import Simulation, simulate_trip
from tripwatt.sources import read_logs
from tripwatt.trips import Trip, resample
from tripwatt.units import M_S_PER_KM_H, WH_PER_J
from tripwatt.vehicles import Vehicle, load_vehicle

SPEEDS_KM_H: Final = (0.0, 10.0, 30.0, 50.0, 70.0, 100.0, 150.0)
TORQUES_NM: Final = (-90.0, -50.0, -20.0, 20.0, 50.0, 90.0, 260.0)
HEAD: Final = """# Each stage of the simulation against its own signal

The sum of a trip can be right although its parts are wrong, so each part stands beside the signal that measures it, in the logs of the
BMW i3 (TUM) and of two Nissan Leafs (VED): means over seconds, with the default car and nothing fitted; for the BMW i3 also with values
that are identified from these signals on the other half of the trips ([how](../decisions/physics-07-identification.md)).
`python -m benchmarks.stages` prints more: shaft, drive and climate power by speed, the loss of motor and inverter by torque, and the
voltage at rest.

Warm trips have outside air of 15 °C and more. Drive power is that of the battery less climate control and less the standing car, which
is the median power at standstill without climate control. VED logs change speed and current at different moments: their bins of speed
are blurred.
The air conditioner, the heat capacity of the cabin and the moving load of the Leaf have values from the logs of the BMW i3
([the values](../reference/vehicles.md#values-from-the-logs-of-one-car)). No log has blower, rear window and seats as part of heater and
air conditioner.

"""
WARM_DEGC: Final = 15.0
"""Outside air that parts the seasons: TUM's summer trips are warmer, its winter trips colder."""
STANDING_M_S: Final = 0.1
STANDING_NM: Final = 3.0
COASTING_M_S: Final = 5.0
COASTING_NM: Final = 2.0
CLIMATE_OFF_W: Final = 50.0
RESTING_A: Final = 3.0
RESTING_S: Final = 10.0
"""A battery whose current stays below this for so long shows its open-circuit voltage, less a few tenths of a volt."""
STEADY_NM: Final = 4.0
"""Change of torque within a second up to which speed, torque and power belong together."""


def shaft_power_w(vehicle: Vehicle, run: Simulation) -> np.ndarray:
    """Mechanical power of the motor of a simulation [W], shape (samples,)."""
    efficiency = vehicle.drivetrain.gearbox_efficiency
    driven = np.maximum(run.wheel_power_w + np.minimum(run.power_by_cause_w["shortfall"], 0.0), 0.0)
    braked = np.maximum(-run.wheel_power_w, 0.0) - run.friction_brake_power_w
    return np.asarray(driven / efficiency - braked * efficiency, dtype=np.float64)


def _over_intervals(values: np.ndarray) -> np.ndarray:
    return np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1])))


def seconds_of(vehicle: Vehicle, trip: Trip) -> pd.DataFrame:
    """Measured and simulated signals of a trip, a row a second; NaN where a signal is missing."""
    trip = resample(trip)
    run = simulate_trip(vehicle, trip)
    samples = blank_stuck_heater(trip.samples, "")[0]
    missing = np.full(len(samples), np.nan)

    def signal(name: str) -> np.ndarray:
        known = samples[name].to_numpy(dtype=np.float64) if name in samples else missing
        return _over_intervals(known)

    drivetrain = vehicle.drivetrain
    speed = signal("speed_m_s")
    heater, cooler = (np.maximum(signal(name), 0.0) for name in ("heating_power_w", "aircon_power_w"))
    torque, power = signal("motor_torque_nm"), signal("voltage_v") * signal("current_a")
    warm = float(np.nanmean(signal("ambient_temperature_degc"))) >= WARM_DEGC
    return pd.DataFrame(
        {
            "trip": trip.trip_id,
            "season": "warm" if warm else "cold",
            "time_s": run.time_s,
            "speed_m_s": speed,
            "torque_nm": torque,
            "torque_step_nm": np.abs(np.diff(torque, prepend=torque[:1])),
            "shaft": torque * speed * drivetrain.gear_ratio / drivetrain.wheel_radius_m,
            "shaft_simulated": shaft_power_w(vehicle, run),
            "less_climate": power - heater - cooler,
            "drive_simulated": run.motor_power_w
            + (run.power_by_cause_w["base_load"] - vehicle.auxiliaries.base_load_w),
            "heater": heater,
            "cooler": cooler,
            "climate": heater + cooler,
            "climate_simulated": run.climate_power_w - run.fan_power_w,
            "battery": power,
            "battery_simulated": run.battery_power_w,
            "current_a": signal("current_a"),
            "voltage": signal("voltage_v"),
            "voltage_simulated": run.terminal_voltage_v,
            "soc": signal("soc"),
            "step_s": np.diff(run.time_s, prepend=run.time_s[:1]),
        }
    ).iloc[1:]


def read_seconds(cars: Sequence[Vehicle], trips: Sequence[Trip]) -> pd.DataFrame:
    """Rows of `seconds_of` of all trips, each with its car, and the drive power: less what that season's standing car draws."""
    rows = pd.concat(
        [
            seconds_of(car, trip).assign(base_w=car.auxiliaries.base_load_w)
            for car, trip in zip(cars, trips, strict=True)
        ],
        ignore_index=True,
    )
    standing = rows[_standing(rows)].groupby("season")["less_climate"].median()
    return rows.assign(drive=rows["less_climate"] - rows["season"].map(standing))


def _standing(rows: pd.DataFrame) -> pd.Series[bool]:
    still = rows["torque_nm"].isna() | (rows["torque_nm"].abs() < STANDING_NM)
    return (rows["speed_m_s"] < STANDING_M_S) & still


def _bins(values: pd.Series[float], edges: Sequence[float], unit: str) -> pd.Series[Any]:
    names = [f"{low:g} to {high:g} {unit}" for low, high in pairwise(edges)]
    return pd.cut(values, list(edges), labels=names)


def by_speed(rows: pd.DataFrame, measured: str) -> pd.DataFrame:
    """Mean measured and simulated power [W] of each season and speed, with the relative difference."""
    known = rows.dropna(subset=[measured])
    speed = _bins(known["speed_m_s"] / M_S_PER_KM_H, SPEEDS_KM_H, "km/h")
    return _compared(known.groupby(["season", speed.rename("speed")], observed=True), measured)


def loss_by_torque(rows: pd.DataFrame) -> pd.DataFrame:
    """Mean loss of motor and inverter [W] by torque and speed where the torque is steady."""
    known = rows.dropna(subset=["torque_nm", "drive"])
    known = known[(known["torque_step_nm"] < STEADY_NM) & (known["speed_m_s"] > STANDING_M_S)]
    known = known.assign(
        loss=known["drive"] - known["shaft"],
        loss_simulated=known["drive_simulated"] - known["shaft_simulated"],
    )
    speed = _bins(known["speed_m_s"] / M_S_PER_KM_H, SPEEDS_KM_H, "km/h").rename("speed")
    torque = _bins(known["torque_nm"], TORQUES_NM, "Nm").rename("torque")
    return _compared(known.groupby([torque, speed], observed=True), "loss")


def identified_cars(vehicle: Vehicle, trips: Sequence[Trip]) -> list[Vehicle]:
    """For each trip the car as the signals of the other half of the trips show its stages: of the odd for the even ones."""
    records = [stage_record(trip, vehicle) for trip in trips]
    halves = [identify(records[other::2], vehicle).applied(vehicle) for other in (1, 0)]
    return [halves[number % 2] for number in range(len(trips))]


def base_loads(rows: pd.DataFrame, moving_load_w: float) -> pd.DataFrame:
    """Median power without climate control [W] at standstill and while the car coasts, beside the car's base load."""
    coasting = (rows["speed_m_s"] > COASTING_M_S) & (rows["torque_nm"].abs() < COASTING_NM)
    states = []
    for name, mask in (("standing", _standing(rows)), ("coasting", coasting)):
        for off in (False, True):
            chosen = rows[mask & ((rows["climate"] < CLIMATE_OFF_W) | (not off))]
            for season, part in chosen.groupby("season"):
                middle = part["less_climate"].median()
                climate = "off" if off else "any"
                simulated = part["base_w"].mean() + (moving_load_w if name == "coasting" else 0.0)
                states.append((name, season, climate, middle, simulated, simulated / middle - 1.0, len(part)))
    return pd.DataFrame(
        states,
        columns=["state", "season", "climate control", "measured", "simulated", "difference", "seconds"],
    )


def climate_power(rows: pd.DataFrame) -> pd.DataFrame:
    """Mean power of heater and air conditioner [W] of each season."""
    return _compared(rows.dropna(subset=["climate"]).groupby("season"), "climate")


def resting_voltage(rows: pd.DataFrame) -> pd.DataFrame:
    """Voltage [V] at rest by state of charge: bias and root mean square of the simulated one."""
    small = (rows["current_a"].abs() < RESTING_A).astype(float)
    lasting = small.groupby(rows["trip"]).transform(lambda x: x.rolling(int(RESTING_S)).min()) == 1.0
    rest = rows[lasting].assign(error=lambda r: r["voltage_simulated"] - r["voltage"])
    soc = pd.cut(rest["soc"], np.arange(0.0, 1.01, 0.1)).rename("soc").astype(str)
    grouped = rest.groupby(soc)["error"]
    table = grouped.agg(bias="mean", rmse=lambda e: float(np.sqrt((e**2).mean())), seconds="count")
    whole = rest["error"].agg(["mean", lambda e: float(np.sqrt((e**2).mean())), "count"]).to_numpy()
    table.loc["all"] = whole
    return table.reset_index()


def energy_per_charge(rows: pd.DataFrame) -> pd.DataFrame:
    """Energy of each whole unit of charge [kWh]: measured, and by the simulated voltage at the measured current."""
    seasons = []
    for season, part in rows.dropna(subset=["soc"]).groupby("season"):
        trips = part.groupby("trip")
        drop = float((trips["soc"].first() - trips["soc"].last()).sum())
        hours = part["step_s"] * WH_PER_J
        measured = float((part["battery"] * hours).sum()) / drop / 1000.0
        simulated = float((part["voltage_simulated"] * part["current_a"] * hours).sum()) / drop / 1000.0
        seasons.append((season, measured, simulated, simulated / measured - 1.0))
    return pd.DataFrame(seasons, columns=["season", "measured", "simulated", "difference"])


def trip_errors(rows: pd.DataFrame) -> pd.DataFrame:
    """Relative error of the energy of each trip by season: bias, mean, and its correlation with the mean speed."""
    hours = rows["step_s"] * WH_PER_J
    sums = rows.assign(e=rows["battery"] * hours, s=rows["battery_simulated"] * hours).groupby("trip")
    trips = sums.agg(e=("e", "sum"), s=("s", "sum"), speed=("speed_m_s", "mean"), season=("season", "first"))
    error = trips["s"] / trips["e"] - 1.0
    seasons = []
    for name, part in (*error.groupby(trips["season"]), ("all", error)):
        speed = trips.loc[part.index, "speed"]
        together = float(np.corrcoef(part, speed)[0, 1]) if len(part) > 2 else np.nan
        seasons.append((name, part.mean(), part.abs().mean(), together, len(part)))
    columns = ["season", "bias", "mean error", "correlation with mean speed", "trips"]
    return pd.DataFrame(seasons, columns=columns)


def _compared(groups: Any, measured: str) -> pd.DataFrame:
    table = groups[[measured, f"{measured}_simulated"]].mean()
    table.columns = ["measured", "simulated"]
    table["difference"] = table["simulated"] / table["measured"] - 1.0
    table["seconds"] = groups.size()
    return table.reset_index()


BASE, CHARGE, TRIPS = "Base load [W]", "Energy of the whole charge [kWh]", "Energy of trips"
"""Titles of the tables that the page shows; its figures have the powers over speed."""


def tables_of(vehicle: Vehicle, rows: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Title and table of each stage that the logs have a signal for."""
    if rows["torque_nm"].notna().any():
        yield "Shaft power [W]", by_speed(rows, "shaft")
    yield "Drive power: battery less climate control less the standing car [W]", by_speed(rows, "drive")
    if rows["torque_nm"].notna().any():
        yield "Loss of motor and inverter at steady torque [W]", loss_by_torque(rows)
    yield BASE, base_loads(rows, vehicle.auxiliaries.moving_load_w)
    yield "Heater and air conditioner [W]", climate_power(rows)
    if rows["torque_nm"].notna().any():
        yield "Voltage at rest [V]", resting_voltage(rows)
        yield CHARGE, energy_per_charge(rows)
    yield TRIPS, trip_errors(rows)


def markdown(table: pd.DataFrame) -> str:
    """A table in Markdown; shares in per cent, powers without and small numbers with digits."""

    def shown(name: str, value: Any) -> str:
        if not isinstance(value, float):
            return str(value)
        if name in ("difference", "mean error") or (name == "bias" and "trips" in table):
            return f"{value:+.1%}" if name != "mean error" else f"{value:.1%}"
        return f"{value:.0f}" if abs(value) >= 100.0 or name == "seconds" else f"{value:.2f}"

    lines = ["| " + " | ".join(map(str, table.columns)) + " |", "|" + "---|" * len(table.columns)]
    lines += [
        "| " + " | ".join(shown(str(n), v) for n, v in zip(table.columns, row, strict=True)) + " |"
        for row in table.itertuples(index=False)
    ]
    return "\n".join(lines)


def figure(rows: pd.DataFrame, place: Path) -> None:
    """Shaft and drive power over speed, measured and simulated, a panel each season."""
    from matplotlib.figure import Figure

    seasons = sorted(rows["season"].unique(), reverse=True)
    stages = [s for s in ("shaft", "drive", "climate") if rows[s].notna().any()]
    drawn = Figure(figsize=(3.6 * len(stages), 2.9 * len(seasons)), layout="constrained")
    panels = drawn.subplots(len(seasons), len(stages), squeeze=False, sharex=True)
    titles = {"shaft": "motor shaft", "drive": "drive", "climate": "heater and air conditioner"}
    for row, season in enumerate(seasons):
        for column, stage in enumerate(stages):
            part = rows[(rows["season"] == season)].dropna(subset=[stage])
            kmh = part["speed_m_s"] / M_S_PER_KM_H
            groups = part.groupby(pd.cut(kmh, np.arange(0.0, 141.0, 10.0)), observed=True)
            axis = panels[row][column]
            middle = kmh.groupby(pd.cut(kmh, np.arange(0.0, 141.0, 10.0)), observed=True).mean()
            for name, colour, mark in ((stage, "#000000", "o"), (f"{stage}_simulated", "#0072B2", "s")):
                label = "simulated" if name.endswith("simulated") else "measured"
                axis.plot(middle, groups[name].mean() / 1000.0, mark + "-", color=colour, label=label, ms=4)
            axis.set_title(f"{titles[stage]}, {season} trips", fontsize=10)
            axis.grid(alpha=0.3)
            axis.set_ylim(bottom=0.0)
            if row == len(seasons) - 1:
                axis.set_xlabel("speed [km/h]")
            if column == 0:
                axis.set_ylabel("mean power [kW]")
    panels[0][0].legend(frameon=False)
    drawn.savefig(place, dpi=110)


def main(docs: bool = False, identified: bool = False) -> None:
    """Print all tables. `--docs` writes the page and its figures, `--identified` prints the values from every second trip of the i3."""
    i3, leaf = load_vehicle("bmw_i3_60ah"), load_vehicle("nissan_leaf_24")
    tum = read_logs(DATA / "tum").reference_trips()
    if identified:
        print(identify([stage_record(trip, i3) for trip in tum[::2]], i3))
        return
    ved = audit(read_logs(DATA / "ved", dataset="ved")).trips
    parts, shown = [], []
    for title, place, vehicle, cars, trips in (
        ("BMW i3, TUM logs", "bmw_i3_60ah", i3, [i3] * len(tum), tum),
        (
            "BMW i3, TUM logs, identified on the other half",
            "bmw_i3_60ah-identified",
            i3,
            identified_cars(i3, tum),
            tum,
        ),
        ("Nissan Leaf, VED logs", "nissan_leaf_24", leaf, [leaf] * len(ved), ved),
    ):
        rows = read_seconds(cars, trips)
        tables = {head: f"### {head}\n\n{markdown(table)}" for head, table in tables_of(vehicle, rows)}
        parts += [f"## {title}", *tables.values()]
        picture = f"![Measured and simulated power over speed: {title}](../images/stages-{place}.png)"
        shown += [f"## {title}", picture, *(tables[head] for head in (BASE, CHARGE, TRIPS) if head in tables)]
        if docs:
            figure(rows, DOCS / "images" / f"stages-{place}.png")
    print("\n\n".join(parts))
    if docs:
        (DOCS / "explanation" / "stages.md").write_text(HEAD + "\n\n".join(shown) + "\n", encoding="utf-8")


if __name__ == "__main__":
    run(main)
