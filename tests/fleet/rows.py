"""Rows of trips whose deviations are known."""

import numpy as np
import pandas as pd
import pyarrow as pa

from tripwatt.fleet.features import SCALES
from tripwatt.fleet.statistics import NUMBERS, ROWS, TripRows


def mapped(store, folder, chosen=()):
    """Results of all trips of a store, with the segments of the chosen ones."""
    from tripwatt.fleet.executors import Workers
    from tripwatt.fleet.mapping import file_tasks, map_store

    return list(map_store(file_tasks(store, store.trip_rows(), folder, chosen), Workers()))


def table_rows(frame):
    """Rows of trips from a data frame."""
    return TripRows.join([pa.Table.from_pandas(frame, schema=ROWS, preserve_index=False)])


CAUSES = {"road load": ("rolling", "air"), "climate": ("climate",), "base load": ("base_load",)}


def made_rows(n_vehicles=12, per_vehicle=14, seed=0):
    """Rows of a fleet whose residual is linear in two features, by vehicle."""
    rng = np.random.default_rng(seed)
    table = []
    for v in range(n_vehicles):
        own = rng.normal(0.0, 0.4)
        for k in range(per_vehicle):
            simulated = float(rng.uniform(1500.0, 3000.0))
            x = {f"x_{name.removeprefix('x_')}": 0.0 for name in ROWS.names if name.startswith("x_")}
            x["x_rolling"] = 0.04 * simulated
            error = float(rng.normal(0.0, 15.0))
            table.append(
                {
                    "car_model": f"m{v % 3}",
                    "vehicle_id": f"v{v:02d}",
                    "driver": "",
                    "digest": f"{v:02d}-{k:02d}",
                    "drive": f"{v}-{k}",
                    "started_at": f"2024-{1 + k // 2:02d}-{1 + k % 28:02d}T08:00:00",
                    **dict.fromkeys(NUMBERS, 1.0),
                    "distance_m": 5000.0 * (1 + k % 6),
                    "ambient_temperature_degc": -5.0 + 4.0 * (k % 8),
                    "simulated_wh": simulated,
                    "observed_wh": simulated + (1.0 + own) * x["x_rolling"] + error,
                    "variance_wh2": 225.0,
                    **x,
                }
            )
    return TripRows.join([pa.Table.from_pylist(table, schema=ROWS)])


def year_of_rows(seed, vehicles=24, trips=140, changes=(), ageing=0.0, winter=0.0):
    """Rows of a year of a fleet of two car models.

    `changes` are (number of the vehicle, cause or "battery", day, share of the energy); `ageing` is the loss of capacity in the
    year, and `winter` the share of the road load that all vehicles have on top from November on.
    """
    rng = np.random.default_rng([seed, 17])
    v = np.repeat(np.arange(vehicles), trips)
    day = np.sort(rng.integers(0, 365, (vehicles, trips)), axis=1).ravel()
    n = len(v)
    ambient = 10.0 - 11.0 * np.cos((day - 20) / 365.0 * 2.0 * np.pi) + rng.normal(0.0, 4.0, n)
    km, hours = rng.uniform(8.0, 30.0, n), rng.uniform(0.3, 0.7, n)
    parts = {
        "rolling": 60.0 * km,
        "air": rng.uniform(20.0, 60.0, n) * km,
        "climate": hours * (150.0 + 90.0 * np.abs(ambient - 20.0)),
        "base_load": 250.0 * hours,
    }
    own = {name: (1.0 + rng.normal(0.0, 0.05, vehicles)[v]) for name in parts}
    true = {name: wh * own[name] for name, wh in parts.items()}
    true["rolling"] = true["rolling"] * (1.0 + winter * (day >= 304))
    total = sum(true.values())
    wh_per_percent = 500.0 * (1.0 + rng.normal(0.0, 0.02, vehicles)[v]) * (1.0 - ageing * day / 365.0)
    for number, cause, since, share in changes:
        its = (v == number) & (day >= since)
        if cause == "battery":
            wh_per_percent = np.where(its, wh_per_percent / (1.0 + share), wh_per_percent)
            continue
        whole = sum(true[name] for name in CAUSES[cause])
        rise = share * total[v == number].sum() / whole[v == number].sum()
        for name in CAUSES[cause]:
            true[name] = np.where(its, (1.0 + rise) * true[name], true[name])
    simulated = sum(parts.values())
    observed = sum(true.values()) * (1.0 + 0.03 * rng.standard_t(5, n)) + rng.normal(0.0, 30.0, n)
    start = np.round(rng.uniform(60.0, 95.0, n))
    end = np.round(2.0 * (start - observed / wh_per_percent)) / 2.0
    features = [name for name in ROWS.names if name.startswith("x_")]
    made = {name: np.zeros(n) for name in features} | {
        f"x_{name}": SCALES[0] * wh for name, wh in parts.items()
    }
    numbers = {
        "distance_m": 1000.0 * km,
        "hours": hours,
        "ambient_temperature_degc": ambient,
        "simulated_wh": simulated,
        "observed_wh": observed,
        "variance_wh2": 40.0**2 + (0.05 * simulated) ** 2,
        "displayed_start": start / 100.0,
        "displayed_end": end / 100.0,
    }
    texts = {
        "car_model": [f"m{k % 2}" for k in v],
        "vehicle_id": [f"v{k:02d}" for k in v],
        "driver": "",
        "digest": [f"{k}-{i}" for i, k in enumerate(v)],
        "drive": [f"{i}" for i in range(n)],
        "started_at": [
            f"{pd.Timestamp(2025, 1, 1, 8) + pd.Timedelta(days=int(d)):%Y-%m-%dT%H:%M:%S}" for d in day
        ],
    }
    return table_rows(pd.DataFrame(texts | numbers | made))
