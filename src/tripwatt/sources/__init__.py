"""Readers of logs, one module per data set. All renaming and unit conversion of columns happens here and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.trips import TripSet

if TYPE_CHECKING:
    from tripwatt.arrays import FloatArray
    from tripwatt.sources.canonical import Frames
    from tripwatt.vehicles import Vehicle

DATASETS: Final = ("tum", "ved", "table")
"""Data sets: the module of each has its name and a reader `read_` and that name, and is imported when it is used."""


def read_logs(
    source: Path | str | Frames,
    dataset: str = "tum",
    mapping: Path | str | None = None,
    *,
    strict: bool = False,
    car: Vehicle | str | None = None,
    progress: Callable[[int, int], None] | None = None,
    heights: Callable[[FloatArray, FloatArray], FloatArray] | None = None,
) -> TripSet:
    """Read all logs of a data set, or make logs of tables in memory.

    A cell that cannot be read counts as missing. A row that cannot be read is left out, as is a file with too little left. The report
    of the result lists all of these. An error is raised only if nothing can be used.

    Parameters
    ----------
    source : path, DataFrame, sequence of DataFrame, or mapping of str to DataFrame
        The data set's folder or file. Or tables with canonical columns, one for each drive, by name in a mapping; one table may have
        several drives, with their names in a column `trip`. A table without `time_s` may have times as its index. Columns
        that are no signals are kept as covariates, and `TripSet.notes` lists them; the other arguments then have no effect.
    dataset : str
        One of `DATASETS`.
    mapping : path or str, optional
        For `dataset="table"`: a TOML file, or the name of a mapping that comes with the package. By default a mapping is proposed
        from the header and the values of the files.
    strict : bool
        Refuse everything that cannot be read as it stands, with every fault.
    car : Vehicle or str, optional
        For tables without a mapping: the car whose battery converts a state of charge into energy.
    progress : callable, optional
        For tables: called with (number of files read, number of all files).
    heights : callable, optional
        For tables with positions and without heights: latitudes and longitudes [°] -> heights [m], such as
        `tripwatt.roads.maps.Elevation.at` of a map or of a folder of tiles. The positions are not kept.

    Returns
    -------
    TripSet
        Logs not yet audited, with notes on the data set; `TripSet.report` lists what was left out.

    Raises
    ------
    InvalidInput
        When nothing of the data set can be used; with `strict`, with every fault of the data set.

    Examples
    --------
    >>> read_logs("anywhere", dataset="tmu")
    Traceback (most recent call last):
    ...
    tripwatt.errors.InvalidInput: unknown data set: dataset: got 'tmu'; allowed: tum...
    """
    if not isinstance(source, Path | str):
        from tripwatt.sources.canonical import read_frames

        return read_frames(source)
    if dataset not in DATASETS:
        raise InvalidInput(Fault.unknown("unknown data set", "dataset", dataset, DATASETS))
    if dataset == "table":
        from tripwatt.sources.table import read_table
        from tripwatt.vehicles import load_vehicle

        known = load_vehicle(car) if isinstance(car, str) else car
        return read_table(source, mapping, strict=strict, vehicle=known, progress=progress, heights=heights)
    if mapping is not None:
        allowed = "only with the data set 'table'"
        raise InvalidInput.of("mapping has no effect", "mapping", f"{mapping}", allowed)
    reader: Callable[..., TripSet] = getattr(import_module(f"{__name__}.{dataset}"), f"read_{dataset}")
    return reader(Path(source), strict=strict)
