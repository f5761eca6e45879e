"""The sample of public logs that comes with the package; `data/README.md` has its rule of choice and its sources."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from tripwatt.errors import Fault, InvalidInput
from tripwatt.files import shipped_toml
from tripwatt.trips import Context, Flag, Log, TripSet

FOLDER: Final = Path(__file__).parent / "data"
SAMPLES: Final = ("tum", "ved", "twizy")
"""Data sets of which the package has a sample."""


def sample_trips(dataset: str = "tum") -> TripSet:
    """Read the sample of a public data set that comes with the package: logs of real trips. O(samples).

    Parameters
    ----------
    dataset : {"tum", "ved", "twizy"}
        The data set: 15 trips of a BMW i3 around Munich ("bmw_i3_60ah" in `load_vehicle`), 20 of a Nissan Leaf in Ann Arbor
        ("nissan_leaf_24"), or 17 of a Renault Twizy around Rabat, without a heater (``describe_car(body="quadricycle")``).

    Returns
    -------
    TripSet
        Logs in the order of departure, with their context and with the attribution that the licence requires. The set defines no
        reference trips: a figure from a sample is not the published figure of the data set.

    Raises
    ------
    InvalidInput
        On an unknown data set.

    Examples
    --------
    >>> sample = sample_trips()
    >>> sample, sample.trips[-1].context.season, sample.trips[-1].context.weather
    (<TripSet TUM sample: 15 logs>, 'winter', 'slightly cloudy')
    """
    if dataset not in SAMPLES:
        raise InvalidInput(Fault.unknown("unknown data set", "dataset", dataset, SAMPLES))
    about = shipped_toml(f"sources/data/{dataset}.toml")
    with np.load(FOLDER / f"{dataset}.npz") as file:
        lists = {name: file[f"{name}.whole"] / file[f"{name}.parts"] for name in file if "." not in name}
        table = pd.DataFrame({name: values[np.cumsum(file[name])] for name, values in lists.items()})
    logs = []
    for row in about["trips"]:
        samples, table = table.iloc[: row["rows"]].reset_index(drop=True), table.iloc[row["rows"] :]
        log = Log.from_samples(row["trip"], samples, Context(**row["context"]))
        logs.append(replace(log, **row["energy"]))
    notes = tuple(Flag(**note) for note in about["notes"])
    return TripSet(about["name"], tuple(logs), notes, None, about["citation"])
