"""Versions of a fleet's model in a folder, and a pointer to the version in use.

    REGISTRY/
      versions/0001/       a model folder, written once
      versions/0002/
      current              the number of the version in use
      history.jsonl        what was done, one line each

The pointer is one small file that is replaced by a rename: a reader always gets either the old version or the new one.
Versions are never changed, so a reader that loads a version while the pointer moves still loads all of it.
"""

from __future__ import annotations

import datetime as dt
import itertools
import json
import os
import threading
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from tripwatt.arrays import FloatArray
from tripwatt.errors import InvalidInput, percent, system_errors
from tripwatt.fleet.features import trip_features
from tripwatt.fleet.mapping import SampledTrips
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.storage import load_fleet, save_fleet

_BOOTSTRAP_DRAWS: Final = 2000
"""A choice, because the bounds of a 95 % interval then vary by about a fiftieth of its width."""
REPORT_TABLES: Final = (
    "changes", "vehicles", "groups", "months", "drivers", "needs", "routes", "schedule", "batteries", "route_ends",
)  # fmt: skip
REPORT_FILES: Final = (
    "report.html", "report.json", *(f"{name}.csv" for name in REPORT_TABLES), "emhass.json", "evcc.txt",
)  # fmt: skip
"""Files of the folder `report` of a registry, which the fleet's report writes."""
SERVED_FILES: Final = (*REPORT_FILES, "choices.json")
"""Files of that folder that the service serves: also what `tripwatt fleet choose --json` printed into it."""

MARGIN: Final = 0.05
"""A challenger is refused if the whole interval of its difference lies above this share of the champion's error. A smaller difference
has no practical consequence, and a newer model was fitted on more recent trips."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of a new model (challenger) with the model in use (champion) on trips on which neither was fitted, paired by vehicle.

    Attributes
    ----------
    trips, vehicles : int
        Number of trips and vehicles compared.
    champion, challenger : float
        Mean over vehicles of the mean relative error of each model [1].
    difference : float
        Error of the challenger minus that of the champion [1].
    low, high : float
        Bounds of the 95 % interval of the difference, from a bootstrap of vehicles.
    """

    trips: int
    vehicles: int
    champion: float
    challenger: float
    difference: float
    low: float
    high: float

    @property
    def worse(self) -> bool:
        """Whether the challenger is worse beyond chance and by more than `MARGIN` of the champion's error."""
        return self.low > MARGIN * self.champion

    def __str__(self) -> str:
        return (
            f"mean error {percent(self.challenger, 2)} against {percent(self.champion, 2)} on {self.trips} trips of {self.vehicles} vehicles; "
            f"the difference is {percent(self.difference, 2, '+')} (95 % interval {percent(self.low, 2, '+')} to {percent(self.high, 2, '+')}); the new model is refused "
            f"if all of the interval is above {percent(MARGIN * self.champion, 2, '+')}, which {'holds' if self.worse else 'does not hold'}"
        )


def predict_sample(model: FleetModel, sample: SampledTrips) -> FloatArray:
    """Predict the energy [Wh] of sampled trips by linear part and trees, shape (trips,)."""
    table = sample.table
    weights = np.array([model.posterior.weights(*group)[0] for group in sample.groups])
    by_trees = table.totals_wh(table.simulated_w + model.trees.predict(table))
    return np.asarray(by_trees + (trip_features(table) * weights).sum(axis=1))


def without_sampled(model: FleetModel, sample: SampledTrips) -> FleetModel:
    """Return the model without the sampled trips: those on which the model was fitted are subtracted from its sums."""
    fitted = np.array([i for i, d in enumerate(sample.digests) if d in model.digests], dtype=np.int64)
    if not len(fitted):
        return model
    return model.with_sums(model.sums - sample.sums(fitted))


def compare(champion: FleetModel, challenger: FleetModel, sample: SampledTrips, seed: int = 0) -> Comparison:
    """Compare two models on trips; trips on which a model was fitted are first subtracted from its sums.

    Parameters
    ----------
    champion, challenger : FleetModel
    sample : SampledTrips
        Trips of the newest weeks. Trees and scales of neither model should come from them.
    seed : int
    """
    observed = sample.table.totals_wh(sample.table.observed_power_w)
    errors = [
        np.abs(predict_sample(without_sampled(model, sample), sample) - observed) / np.abs(observed)
        for model in (champion, challenger)
    ]
    names, code = np.unique([group[1] for group in sample.groups], return_inverse=True)
    count = np.bincount(code)
    old, new = (np.bincount(code, error) / count for error in errors)
    difference = new - old
    rng = np.random.default_rng(seed)
    draws = difference[rng.integers(len(names), size=(_BOOTSTRAP_DRAWS, len(names)))].mean(axis=1)
    low, high = np.quantile(draws, (0.025, 0.975))
    figures = old.mean(), new.mean(), difference.mean(), low, high
    return Comparison(len(sample), len(names), *map(float, figures))


def is_registry(folder: Path | None) -> bool:
    """Whether a folder holds the versions of a fleet's model."""
    return folder is not None and (folder / "versions").is_dir()


@lru_cache(maxsize=4)
def _parsed(file: Path, written_ns: int) -> Any:
    """Return the data of a file, which is read once for all pages until it is written again."""
    return json.loads(file.read_bytes())


@dataclass(frozen=True, slots=True)
class Registry:
    """A folder of model versions.

    Attributes
    ----------
    folder : Path
    """

    folder: Path

    def versions(self) -> tuple[str, ...]:
        """Return the names of all versions, oldest first."""
        return tuple(sorted(p.name for p in self.folder.glob("versions/*") if p.name.isdigit()))

    def add(self, model: FleetModel, note: str = "") -> str:
        """Write a model as a new version without moving the pointer. Several processes may add versions at once.

        The number of a version that was deleted is not used again.

        Returns
        -------
        str
            Name of the new version.
        """
        versions = self.folder / "versions"
        with system_errors("registry cannot be written", f"{self.folder}", "a writable folder"):
            versions.mkdir(parents=True, exist_ok=True)
        unnamed = versions / f".{uuid.uuid4().hex}"
        save_fleet(model, unnamed)
        named = *self.versions(), *(entry["version"] for entry in self.history())
        for number in itertools.count(int(max(named, default="0")) + 1):
            name = f"{number:04d}"
            try:
                unnamed.rename(versions / name)  # a folder that is not empty is never replaced
                break
            except OSError:
                if not (versions / name).is_dir():
                    raise
        self._record("add", name, note)
        return name

    def path(self, version: str) -> Path:
        """Return the folder of a version.

        Raises
        ------
        InvalidInput
            If there is no such version.
        """
        if version not in self.versions():
            got, allowed = repr(version), ", ".join(self.versions()[-8:]) or "none yet"
            raise InvalidInput.of("unknown version", f"{self.folder}", got, allowed)
        return self.folder / "versions" / version

    def current(self) -> str:
        """Return the name of the version in use.

        Raises
        ------
        InvalidInput
            If no version was promoted, or the promoted one was deleted.
        """
        with suppress(OSError):
            version = (self.folder / "current").read_text("utf-8").strip()
            if (self.folder / "versions" / version).is_dir():
                return version
        where, fix = f"{self.folder}", "run `tripwatt fleet fit` and promote its version"
        raise InvalidInput.of("no version in use", where, "", "a promoted version", fix)

    def load(self, version: str | None = None) -> FleetModel:
        """Load the model of a version, by default of the version in use."""
        return load_fleet(self.path(self.current() if version is None else version))

    def promote(self, version: str, comparison: Comparison | None = None, note: str = "") -> None:
        """Move the pointer to a version, after reading all of the version.

        Parameters
        ----------
        version : str
        comparison : Comparison, optional
            Comparison of this version with the version in use.
        note : str

        Raises
        ------
        InvalidInput
            If the version is damaged, or `comparison.worse` is true. The pointer is then not moved.
        """
        self.load(version)
        if comparison is not None and comparison.worse:
            fix = "promote it without a comparison if you want it all the same"
            raise InvalidInput.of("challenger is worse", version, f"{comparison}", "not worse", fix)
        self._move_pointer(version)
        self._record("promote", version, note, None if comparison is None else asdict(comparison))

    def history(self) -> list[dict[str, Any]]:
        """Return the entries of the history, oldest first; a line that a crash cut off is left out."""
        entries = []
        with suppress(OSError):
            for line in (self.folder / "history.jsonl").read_text("utf-8").splitlines():
                with suppress(json.JSONDecodeError):
                    entries.append(json.loads(line))
        return entries

    def report_file(self, name: str) -> bytes | None:
        """Return a file of the report that was written last into the registry; None if there is no such file."""
        file = self.folder / "report" / name
        return file.read_bytes() if name in SERVED_FILES and file.is_file() else None

    def page(self, table: str, limit: int, cursor: int = 0) -> dict[str, Any]:
        """Return some rows of a table of the last report, or of the history, the newest first, as `health`; `car` is the vehicle.

        Returns
        -------
        dict
            `version` in use, `about` of the last report, `rows`, and `next`, the cursor of the rows that follow, or None.
        """
        file = self.folder / "report" / "report.json"
        report = _parsed(file, file.stat().st_mtime_ns) if file.is_file() else {}
        rows = self.history()[::-1] if table == "health" else report.get(table, [])
        end = cursor + limit
        following = end if end < len(rows) else None
        shown = [{"car" if k == "vehicle_id" else k: v for k, v in row.items()} for row in rows[cursor:end]]
        about = report.get("about", {})
        return {"version": self.current(), "about": about, "rows": shown, "next": following}

    def _move_pointer(self, version: str) -> None:
        partial = self.folder / f".current.{uuid.uuid4().hex}"
        with partial.open("w", encoding="utf-8") as file:
            file.write(version + "\n")
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, self.folder / "current")

    def _record(self, action: str, version: str, note: str, about: Mapping[str, Any] | None = None) -> None:
        now = dt.datetime.now(dt.UTC).isoformat(timespec="seconds")
        entry = {"time": now, "action": action, "version": version, "note": note, "comparison": about}
        with (self.folder / "history.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry, ensure_ascii=False) + "\n")


class FollowedModel:
    """The model of the version in use, for a long-running program: a new version is read when the pointer has moved.

    While a new version is being read, and if it cannot be read, callers get the version before. A version that could not be read is
    tried again only after the pointer has moved to another version and back. Safe for many threads.

    Parameters
    ----------
    registry : Registry
    on_change : callable, optional
        Called with the version that the pointer has moved to, and the error if it could not be read, else None.
    """

    def __init__(
        self,
        registry: Registry,
        on_change: Callable[[str, InvalidInput | None], None] = lambda version, error: None,
    ) -> None:
        self._registry, self._on_change = registry, on_change
        self._lock = threading.Lock()
        version = registry.current()
        self._in_use = (version, registry.load(version))
        self._last_tried = version

    @property
    def version(self) -> str:
        """Name of the version whose model `get` returns."""
        return self._in_use[0]

    @property
    def folder(self) -> Path:
        """Folder of `version`."""
        return self._registry.path(self.version)

    def get(self) -> FleetModel:
        """Return the model. At most one caller at a time reads a new version; the others get the old model meanwhile."""
        with suppress(InvalidInput):  # if there is no pointer, the version in use stays
            if self._registry.current() != self._last_tried and self._lock.acquire(blocking=False):
                try:
                    self._read()
                finally:
                    self._lock.release()
        return self._in_use[1]

    def _read(self) -> None:
        """Read the version that the pointer names now, unless it was tried last, and report it to `on_change`."""
        wanted = self._registry.current()  # the pointer may have moved since the caller looked
        if wanted == self._last_tried:
            return
        self._last_tried, error = wanted, None
        try:
            if wanted != self._in_use[0]:
                self._in_use = (wanted, self._registry.load(wanted))
        except InvalidInput as refused:
            error = refused
        self._on_change(wanted, error)
