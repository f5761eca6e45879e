"""What a fleet's linear model needs of its trips: one short row a trip, and sums by vehicle that add up.

With features `X`, residual energies `y` and usual variances `n` of the trips of a group, its sums are ``X' N^-1 X``,
``X' N^-1 y`` and ``y' N^-1 y``. Those of two sets of trips add up to those of both, so that trips can be summed anywhere
and in any part. Rows are sorted before they are summed: the sums do not depend on who made which row.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import pyarrow as pa

from tripwatt.arrays import FloatArray
from tripwatt.fleet.features import FEATURES

NO_DRIVER: Final = ""
"""The driver of a trip of which none was logged."""

KEYS: Final = ("car_model", "vehicle_id", "driver", "digest", "drive")
NUMBERS: Final = (
    "distance_m",
    "hours",
    "ambient_temperature_degc",
    "simulated_wh",
    "observed_wh",
    "variance_wh2",
)

ROWS: Final = pa.schema(
    [
        *(pa.field(name, pa.string()) for name in KEYS),
        pa.field("started_at", pa.string()),
        *(pa.field(name, pa.float64()) for name in (*NUMBERS, *(f"x_{name}" for name in FEATURES))),
    ]
)
"""One row a sound drive with measured energy."""


@dataclass(frozen=True, eq=False)
class TripRows:
    """Rows of trips, sorted by car model, vehicle, driver and digest.

    Attributes
    ----------
    table : pyarrow.Table
        Of the schema `ROWS`.
    """

    table: pa.Table

    @classmethod
    def join(cls, tables: Sequence[pa.Table]) -> TripRows:
        """One table of several, each drive once, sorted. O(rows log rows)."""
        table = pa.concat_tables(tables) if tables else ROWS.empty_table()
        table = table.sort_by([(name, "ascending") for name in KEYS])
        if table.num_rows > 1:
            digest, drive = (table[name].to_numpy(zero_copy_only=False) for name in ("digest", "drive"))
            again = (digest[1:] == digest[:-1]) & (drive[1:] == drive[:-1])
            table = table.filter(pa.array(np.concatenate(([True], ~again))))
        return cls(table.combine_chunks())

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def texts(self, name: str) -> Any:
        """A column of text, shape (rows,)."""
        return self.table[name].to_numpy(zero_copy_only=False)

    def numbers(self, name: str) -> FloatArray:
        """A column of numbers, shape (rows,)."""
        return np.asarray(self.table[name].to_numpy(), dtype=np.float64)

    @property
    def X(self) -> FloatArray:  # noqa: N802
        """Features [Wh], shape (rows, features)."""
        return np.column_stack([self.numbers(f"x_{name}") for name in FEATURES])

    @property
    def residual_wh(self) -> FloatArray:
        """Observed minus simulated energy, shape (rows,)."""
        return self.numbers("observed_wh") - self.numbers("simulated_wh")

    @property
    def weight(self) -> FloatArray:
        """One over the usual variance [1/Wh²], shape (rows,)."""
        return 1.0 / self.numbers("variance_wh2")

    def where(self, mask: Any) -> TripRows:
        """Some of the rows."""
        return TripRows(self.table.filter(pa.array(np.asarray(mask, dtype=bool))))


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of the trips of groups: car model, vehicle, driver.

    Attributes
    ----------
    groups : tuple of (str, str, str)
        Car model, vehicle, driver; sorted.
    count : ndarray, shape (groups,)
        Trips.
    log_variance : ndarray, shape (groups,)
        Sum of the logarithms of the usual variances.
    xx : ndarray, shape (groups, features, features)
    xy : ndarray, shape (groups, features)
    yy : ndarray, shape (groups,)

    Examples
    --------
    >>> one = Sums((("m", "v", ""),), np.ones(1), np.zeros(1), np.ones((1, 1, 1)), np.ones((1, 1)), np.ones(1))
    >>> (one + one).count, (one + one).xy.ravel()
    (array([2.]), array([2.]))
    """

    groups: tuple[tuple[str, str, str], ...]
    count: FloatArray
    log_variance: FloatArray
    xx: FloatArray
    xy: FloatArray
    yy: FloatArray

    @classmethod
    def empty(cls, features: int = len(FEATURES)) -> Sums:
        """No trips."""
        p = features
        return cls((), np.zeros(0), np.zeros(0), np.zeros((0, p, p)), np.zeros((0, p)), np.zeros(0))

    @classmethod
    def from_rows(cls, rows: TripRows) -> Sums:
        """Sums of sorted rows. O(rows x features^2)."""
        if not len(rows):
            return cls.empty()
        keys = [rows.texts(name) for name in KEYS[:3]]
        changes = np.zeros(len(rows) - 1, dtype=bool)
        for key in keys:
            changes |= key[1:] != key[:-1]
        starts = np.concatenate(([0], np.flatnonzero(changes) + 1, [len(rows)]))
        root = np.sqrt(rows.weight)
        X, y = rows.X * root[:, None], rows.residual_wh * root
        spans = [slice(a, b) for a, b in pairwise(starts)]
        return cls(
            tuple((str(keys[0][s.start]), str(keys[1][s.start]), str(keys[2][s.start])) for s in spans),
            np.diff(starts).astype(np.float64),
            np.add.reduceat(-np.log(rows.weight), starts[:-1]),
            np.array([X[s].T @ X[s] for s in spans]),
            np.array([X[s].T @ y[s] for s in spans]),
            np.array([y[s] @ y[s] for s in spans]),
        )

    def __add__(self, other: Sums) -> Sums:
        return self._merged(other, 1.0)

    def __sub__(self, other: Sums) -> Sums:
        """Without trips that are in it; groups without a trip remain, at zero."""
        return self._merged(other, -1.0)

    def _merged(self, other: Sums, sign: float) -> Sums:
        groups = tuple(sorted({*self.groups, *other.groups}))
        place = {group: i for i, group in enumerate(groups)}
        p = self.xx.shape[1] or other.xx.shape[1]
        total = Sums.empty(p)
        n = len(groups)
        total = replace(
            total,
            groups=groups,
            count=np.zeros(n),
            log_variance=np.zeros(n),
            xx=np.zeros((n, p, p)),
            xy=np.zeros((n, p)),
            yy=np.zeros(n),
        )
        for part, factor in ((self, 1.0), (other, sign)):
            index = [place[group] for group in part.groups]
            for name in ("count", "log_variance", "xx", "xy", "yy"):
                getattr(total, name)[index] += factor * getattr(part, name)
        return total

    def take(self, wanted: Sequence[int]) -> Sums:
        """Some of the groups."""
        index = np.asarray(wanted, dtype=np.int64)
        arrays = {n: getattr(self, n)[index] for n in ("count", "log_variance", "xx", "xy", "yy")}
        return Sums(tuple(self.groups[i] for i in index), **arrays)

    def to_arrays(self) -> dict[str, Any]:
        """Plain arrays."""
        names = np.array(self.groups, dtype=np.str_).reshape(-1, 3)
        return {
            "groups": names,
            **{n: getattr(self, n) for n in ("count", "log_variance", "xx", "xy", "yy")},
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Sums:
        """Reverse of `to_arrays`."""
        groups = tuple((str(a), str(b), str(c)) for a, b, c in arrays["groups"])
        return cls(groups, *(arrays[n] for n in ("count", "log_variance", "xx", "xy", "yy")))
