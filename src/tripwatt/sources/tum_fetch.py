"""Where to get the TUM set, and whether a folder holds all of it in one piece."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from tripwatt.errors import Fault, InvalidInput
from tripwatt.sources.tum import ALL_TRIP_IDS, OVERVIEW_NAME, REFERENCE_TRIPS, read_tum_file, trip_files
from tripwatt.sources.tum_overview import read_durations
from tripwatt.trips.messages import message

_DURATION_TOLERANCE_S: Final = 5.0
"""The sheet's durations agree with whole logs within a second; re-saved copies may lose a block at the end."""


@dataclass(frozen=True, slots=True)
class FolderReport:
    """What a folder holds of the TUM set.

    Attributes
    ----------
    present : tuple of str
        Trips whose files can be read.
    missing : tuple of str
        Published trips without a file.
    unreadable : mapping of str to tuple of Fault
        Trips whose files cannot be used, and why.
    shortened : mapping of str to tuple of (float, float)
        Trips whose log [s] is shorter than in the sheet [s].
    overview : bool
        Whether the sheet of contexts is there and can be read.
    notes : tuple of str
    """

    present: tuple[str, ...]
    missing: tuple[str, ...]
    unreadable: dict[str, tuple[Fault, ...]]
    shortened: dict[str, tuple[float, float]]
    overview: bool
    notes: tuple[str, ...]

    @property
    def reference_missing(self) -> tuple[str, ...]:
        """Reference trips without a readable file: the comparison with other systems needs all of them."""
        return tuple(t for t in REFERENCE_TRIPS if t not in self.present)

    @property
    def complete(self) -> bool:
        """Whether every reference trip and the sheet are there, whole."""
        damaged = self.unreadable or any(t in REFERENCE_TRIPS for t in self.shortened)
        return self.overview and not damaged and not self.reference_missing

    def as_dict(self) -> dict[str, object]:
        """The report as plain types, for JSON."""
        spans = self.shortened.items()
        return {
            **asdict(self),
            "unreadable": {trip: [str(f) for f in faults] for trip, faults in self.unreadable.items()},
            "shortened": {trip: {"log_s": log_s, "sheet_s": sheet_s} for trip, (log_s, sheet_s) in spans},
            "reference_missing": self.reference_missing,
            "complete": self.complete,
        }

    def __str__(self) -> str:
        lines = [f"{len(self.present)} of {len(ALL_TRIP_IDS)} trips can be read"]
        if self.missing:
            lines.append(f"missing: {', '.join(self.missing)}")
        lines += [str(fault) for faults in self.unreadable.values() for fault in faults]
        for trip, (log_s, sheet_s) in self.shortened.items():
            lines.append(f"shortened: {trip} has {log_s:.1f} s, the sheet gives {sheet_s:.1f} s")
        if not self.overview:
            lines.append(f"{OVERVIEW_NAME} is missing or unreadable: season and weather are unknown")
        lines += self.notes
        needed = len(REFERENCE_TRIPS)
        lines.append(f"reference trips: {needed - len(self.reference_missing)} of {needed}")
        return "\n".join(lines)


def check_tum_folder(folder: Path | str) -> FolderReport:
    """Read every trip of a folder and report what is there, missing, unreadable or shortened.

    Raises
    ------
    InvalidInput
        When there is no such folder, or it holds no trip at all.
    """
    folder = Path(folder)
    files, flags = trip_files(folder)
    notes = list(map(message, flags))
    overview, durations = False, {}
    try:
        durations = read_durations(folder / OVERVIEW_NAME)
        overview = (folder / OVERVIEW_NAME).exists()
    except InvalidInput as error:
        notes += map(str, error.faults)
    present: list[str] = []
    unreadable: dict[str, tuple[Fault, ...]] = {}
    shortened: dict[str, tuple[float, float]] = {}
    for trip_id, path in files.items():
        try:
            trip = read_tum_file(path, trip_id)
        except InvalidInput as error:
            unreadable[trip_id] = error.faults
            continue
        present.append(trip_id)
        said = durations.get(trip_id, 0.0)
        if trip.duration_s < said - _DURATION_TOLERANCE_S:
            shortened[trip_id] = (trip.duration_s, said)
    missing = tuple(t for t in ALL_TRIP_IDS if t not in files)
    return FolderReport(tuple(present), missing, unreadable, shortened, overview, tuple(notes))
