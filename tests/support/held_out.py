"""Small stand-ins for trips, segments and forecasts that an evaluation holds out."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from tripwatt.hybrid import SegmentTable
from tripwatt.study.evaluation.forecast_data import ForecastData
from tripwatt.trips import Trip

EXACT = {"rel": 1e-9, "abs": 1e-9}


NO = np.nan


def log_of(time, **columns) -> Trip:
    rows = {"time_s": np.asarray(time, dtype=float), "speed_m_s": 10.0, "voltage_v": 360.0, "current_a": 10.0}
    return Trip.from_samples("t", pd.DataFrame(rows | columns))


def segments(*rows: int, observed=2.0) -> SegmentTable:
    """Trips with these numbers of segments of half an hour, 100 W simulated, 2 W for each row more observed."""
    n = sum(rows)
    return SegmentTable(
        tuple(f"t{i}" for i in range(len(rows))),
        np.concatenate(([0], np.cumsum(rows))),
        pd.DataFrame({"row": np.arange(float(n))}),
        np.full(n, 0.5),
        np.full(n, 100.0),
        observed_w=100.0 + observed * np.arange(n),
    )


class Trips:
    """As a table of trips."""

    def __init__(self, ids) -> None:
        self.trip_ids = tuple(ids)

    def __len__(self) -> int:
        return len(self.trip_ids)

    def take(self, members):
        return Trips(self.trip_ids[i] for i in members)


def data(*rows: int) -> ForecastData:
    own = segments(*rows)
    plans = tuple(f"plan {i}" for i in range(len(rows)))
    logs = tuple(f"log {i}" for i in range(len(rows)))
    return ForecastData(
        "car", Trips(own.trip_ids), own, own.features.rename(columns={"row": "seen"}), plans, logs, logs
    )


class Told:
    """A forecast of 100 Wh over 1000 m in 100 s whose updates add 1000 Wh for each measured column and keep the rows."""

    energy_wh, sd_wh, flags = 100.0, 10.0, ("one", "two")
    soc_arrival = 0.4

    def __init__(self, energy_wh=100.0) -> None:
        self.energy_wh = energy_wh
        scores = SimpleNamespace(factor=lambda level: 4.0 * level)
        self.uncertainty = SimpleNamespace(scores=scores)
        self.by_cause_wh = {"air": 60.0, "climate": 40.0}
        self.told: list[pd.DataFrame] = []
        self.arrival = SimpleNamespace(
            interval=lambda level: (0.4 - 0.1 * level, 0.4 + 0.2 * level), p_above=lambda soc: 1.0 - soc
        )

    def to_frame(self):
        return pd.DataFrame(
            {
                "time_s": [0.0, 50.0, 100.0],
                "energy_wh": [0.0, 30.0, 100.0],
                "distance_m": [0.0, 400.0, 1000.0],
            }
        )

    def interval(self, level):
        return self.energy_wh - 10.0 * level, self.energy_wh + 20.0 * level

    def probability_below(self, energy):
        return energy / 1000.0

    def update_since_departure(self, observed):
        self.told.append(observed)
        return Told(1000.0 * len(observed.columns))


def driven_log(**columns) -> pd.DataFrame:
    time = np.array([0.0, 10.0, 20.0, 25.0, 60.0, 110.0])
    return pd.DataFrame(
        {"time_s": time, "observed_energy_wh": 2.0 * time, "distance_m": 5.0 * time, **columns}
    )
