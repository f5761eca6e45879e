"""Rows of trips whose deviations are known."""

import numpy as np
import pyarrow as pa

from tripwatt.fleet.statistics import NUMBERS, ROWS, TripRows


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
