"""Statistics of trips for a fleet's linear model: one short row per trip, and sums of the rows by driver.

Sums of two sets of trips add up to those of both, so that trips can be summed anywhere and in any part. Rows are sorted before they are
summed, so the sums do not depend on which worker made which row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd
import pyarrow as pa

from tripwatt.arrays import FloatArray, IntArray
from tripwatt.fleet.features import FEATURES
from tripwatt.hybrid.groups import Sums

NO_DRIVER: Final = ""
"""Name of the driver of a trip for which no driver was logged."""

KEYS: Final = ("car_model", "vehicle_id", "driver", "digest", "drive")
NUMBERS: Final = (
    "distance_m",
    "hours",
    "ambient_temperature_degc",
    "simulated_wh",
    "observed_wh",
    "variance_wh2",
    "displayed_start",
    "displayed_end",
)

ROWS: Final = pa.schema(
    dict.fromkeys((*KEYS, "started_at"), pa.string())
    | dict.fromkeys((*NUMBERS, *(f"x_{name}" for name in FEATURES)), pa.float64())
)
"""Schema of `TripRows`: one row per sound drive with measured energy."""


@dataclass(frozen=True, eq=False)
class TripRows:
    """Rows of trips, sorted by car model, vehicle, driver and digest.

    Attributes
    ----------
    table : pyarrow.Table
        Table with the schema `ROWS`.
    """

    table: pa.Table

    @classmethod
    def join(cls, tables: Sequence[pa.Table]) -> TripRows:
        """Join tables, sort the rows and keep each drive once. O(rows log rows)."""
        table = pa.concat_tables(tables) if tables else ROWS.empty_table()
        table = table.sort_by([(name, "ascending") for name in KEYS])
        if table.num_rows > 1:
            digest, drive = (table[name].to_numpy(zero_copy_only=False) for name in ("digest", "drive"))
            repeated = (digest[1:] == digest[:-1]) & (drive[1:] == drive[:-1])
            table = table.filter(pa.array(np.concatenate(([True], ~repeated))))
        return cls(table.combine_chunks())

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def texts(self, name: str) -> Any:
        """Return a column of text, shape (rows,)."""
        return self.table[name].to_numpy(zero_copy_only=False)

    def numbers(self, name: str) -> FloatArray:
        """Return a column of numbers, shape (rows,)."""
        return np.asarray(self.table[name].to_numpy(), dtype=np.float64)

    @property
    def X(self) -> FloatArray:  # noqa: N802
        """Features [Wh], shape (rows, features)."""
        return np.column_stack([self.numbers(f"x_{name}") for name in FEATURES])

    @property
    def residual_wh(self) -> FloatArray:
        """Observed minus simulated energy [Wh], shape (rows,)."""
        return self.numbers("observed_wh") - self.numbers("simulated_wh")

    @property
    def sums(self) -> Sums:
        """Sums of each driver's trips. O(rows x features^2)."""
        return Sums.from_trips(self.groups, self.X, self.residual_wh, self.numbers("variance_wh2"))

    @property
    def groups(self) -> list[tuple[str, str, str]]:
        """Car model, vehicle and driver of each row."""
        return list(zip(*(self.texts(name) for name in KEYS[:3]), strict=True))

    def where(self, mask: Any) -> TripRows:
        """Return the rows at which a mask is true."""
        return self.take(np.flatnonzero(mask))

    def take(self, index: IntArray, sort: bool = True) -> TripRows:
        """Return the rows of an index, in the order of the table, or in that of the index if not `sort`."""
        return TripRows(self.table.take(pa.array(np.sort(index) if sort else index)))

    @property
    def started(self) -> Any:
        """Time of departure of every row as datetime64: UTC if it has an offset, else as it is; NaT if unknown."""
        texts = pd.Series(self.texts("started_at"), dtype=str)
        # without UTC, times on both sides of a change to summer time cannot be compared
        times = pd.to_datetime(texts, errors="coerce", format="ISO8601", utc=True)
        return times.dt.tz_localize(None).to_numpy()

    @property
    def chronological(self) -> tuple[IntArray, Any]:
        """Numbers of the rows with a time of departure in the order of that time, and the day of departure of every row (NaT if unknown)."""
        started = self.started
        order = np.argsort(started, kind="stable")[: int((~np.isnat(started)).sum())]
        return order, started.astype("datetime64[D]")
