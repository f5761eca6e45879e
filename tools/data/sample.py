"""Write the sample of real trips that comes with the package: ``python -m tools.data.sample [--data DATA] [--out FOLDER]``.

DATA has the folders `tum`, `ved` and `twizy`. The README of the folder states the rule of choice. Two runs write the same bytes.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from tools import DATA
from tools.command import run
from tools.data.population import CITATIONS
from tripwatt.arrays import FloatArray
from tripwatt.sources import read_logs
from tripwatt.sources.sample import FOLDER
from tripwatt.trips import Flag, Log, TripSet
from tripwatt.trips.trip import Recorded

EVERY_TUM: Final = 4
EVERY_LEAF: Final = 10
LEAF: Final = "10"
"""Car of the VED."""
DECIMALS: Final = {"speed_m_s": 3, "soc": 4, "displayed_soc": 4, "motor_torque_nm": 1} | dict.fromkeys(
    ("time_s", "heating_power_w", "requested_heating_power_w", "aircon_power_w"), 0
)
"""Decimals of the means over a second: finer than the resolution of the logs. All other columns have two."""
ENERGY: Final = ("observed_energy_std_wh", "observed_energy_common_std")
"""What a log does not compute again from its samples if its energy comes from the state of charge."""


def sets(data: Path) -> Iterator[tuple[str, TripSet]]:
    """The sample of each data set by the name of the set."""
    tum = read_logs(data / "tum", "tum")
    reference = tum.reference_trips()
    chosen = _by_date(reference)[::EVERY_TUM]
    of_set = Flag("sample", "TUM set, 1 Hz", f"{len(chosen)} of {len(reference)}")
    logs = [_each_second(trip) for trip in chosen]
    yield "tum", TripSet("TUM sample", tuple(logs), (of_set,), None, tum.citation)
    ved = read_logs(data / "ved", "ved")
    leaf = _by_date([log for log in ved.logs if log.context.car == LEAF])
    chosen = leaf[EVERY_LEAF - 1 :: EVERY_LEAF]
    of_set = Flag("sample", f"VED, car {LEAF}", f"{len(chosen)} of {len(leaf)}")
    notes = of_set, *(note for note in ved.notes if note.code == "no_elevation")
    yield "ved", TripSet("VED sample", tuple(chosen), notes, None, ved.citation)
    twizy = read_logs(data / "twizy", "table", Path(__file__).parent / "twizy.toml")
    logs = _by_date([_with_date(log, data / "twizy" / f"{log.trip_id}.csv") for log in twizy.logs])
    citation = f"{CITATIONS['twizy']}, licensed under CC BY 4.0"
    notes = tuple(note for note in twizy.notes if note.code != "columns_unread")
    yield "twizy", TripSet("Twizy", tuple(logs), notes, None, citation)


def _by_date(logs: Sequence[Recorded]) -> list[Recorded]:
    """Logs in the order of departure; several of one time in the order of their ids."""
    return sorted(logs, key=lambda log: (log.context.started_at or dt.datetime.max, log.trip_id))


def _each_second(trip: Recorded) -> Recorded:
    """Means of a log of 10 Hz over each second."""
    time = trip.samples["time_s"]
    second = np.floor(time.to_numpy() - time[0] + 1e-6)  # 0.1 s has no exact binary value
    means = trip.samples.assign(time_s=second).groupby(second).mean()
    means = means.round({name: DECIMALS.get(f"{name}", 2) for name in means}).reset_index(drop=True)
    return Log.from_samples(trip.trip_id, means, trip.context)


def _with_date(log: Recorded, path: Path) -> Recorded:
    """A log of the Twizy with the date, the time and the weather of its first row."""
    first = pd.read_csv(path, nrows=1).iloc[0]
    started_at = dt.datetime.strptime(f"{first['Date']} {first['Time']}", "%m/%d/%Y %H:%M:%S")
    return replace(log, context=replace(log.context, started_at=started_at, weather=first["Weather"].lower()))


def text_of(sample: TripSet) -> str:
    """All of a sample but its tables, as TOML."""
    lines = [f"name = {_quote(sample.name)}", f"citation = {_quote(sample.citation)}", "notes = ["]
    lines += [f"    {_inline(asdict(note))}," for note in sample.notes] + ["]"]
    for log in sample.logs:
        energy = {name: getattr(log, name) for name in ENERGY}
        lines += ["", "[[trips]]", f'trip = "{log.trip_id}"', f"rows = {len(log)}"]
        lines += [f"context = {_inline(asdict(log.context))}", f"energy = {_inline(energy)}"]
    return "\n".join(lines) + "\n"


def _inline(values: Mapping[str, object]) -> str:
    """An inline table of TOML, without values that are unknown, empty or zero."""
    known = {name: value for name, value in values.items() if value not in (None, "", False, 0.0)}
    return (
        f"{{ {', '.join(f'{name} = {_quote(value)}' for name, value in known.items())} }}" if known else "{}"
    )


def _quote(value: object) -> str:
    return f"{value}" if isinstance(value, dt.datetime | float) else json.dumps(value, ensure_ascii=False)


def write_sample(name: str, sample: TripSet, out: Path) -> None:
    """Write the table and the text of one sample into a folder."""
    table = pd.concat([log.samples for log in sample.logs])
    arrays: dict[str, npt.NDArray[Any]] = {}
    for column in table:
        arrays |= listed(f"{column}", table[column].to_numpy(dtype=np.float64))
    np.savez_compressed(out / f"{name}.npz", allow_pickle=False, **arrays)
    (out / f"{name}.toml").write_text(text_of(sample), "utf-8")


def listed(name: str, values: FloatArray) -> dict[str, npt.NDArray[Any]]:
    """A column as differences of the places of its values in a list of them, and the list in whole parts of a unit if it has so few decimals.

    This deflates to two thirds of the bytes of the values, and `sample_trips` makes the same bits of it.
    """
    distinct, places = np.unique(values + 0.0, return_inverse=True)  # + 0.0 makes a zero of a minus zero
    steps = np.diff(places, prepend=0)
    whole, parts = distinct, 1.0
    for power in (1.0, 10.0, 100.0, 1000.0, 10_000.0):
        if np.array_equal(np.rint(distinct * power) / power, distinct, equal_nan=True):
            whole, parts = np.rint(distinct * power), power
            break
    return {
        name: steps.astype(np.min_scalar_type(-1 - int(np.abs(steps).max()))),
        f"{name}.whole": whole,
        f"{name}.parts": np.array(parts),
    }


def main(data: Path = DATA, out: Path = FOLDER) -> None:
    """Write the sample into the package, or into another folder."""
    for name, sample in sets(data):
        write_sample(name, sample, out)


if __name__ == "__main__":
    run(main)
