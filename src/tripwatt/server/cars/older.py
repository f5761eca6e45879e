"""Folders of cars that tripwatt 0.2.0 and 0.3.0.dev0 wrote: read once into the file of the car, and then removed.

They had a description, a Delta store of logs, a folder with model and diary, and a folder `live` with a journal of samples, finished trips
as tables, the plan, the token, and forecasts.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import math
import secrets
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from tripwatt.errors import InvalidInput, damage
from tripwatt.files import WRITING, folder_lock, read_file, read_text_file, restore_folder
from tripwatt.fleet.store import open_store
from tripwatt.forecasting.storage import vehicle_values
from tripwatt.server.cars.car_file import Database, MadeForecast, row_of_log, sample_of_text
from tripwatt.server.cars.plan import LivePlan
from tripwatt.server.cars.telemetry import CHARGES, Sample, number_of
from tripwatt.sources.canonical import read_canonical
from tripwatt.trips import Context, Log
from tripwatt.vehicles import load_vehicle

ABOUT: Final = "car.json"
"""File with the description; a folder without it is that of a car that only sends on the road, or of no car."""

LIVE: Final = "live"
NAMES: Final = ("trips", "learned", ".learned.older", LIVE, "car.toml", "left-out.json", ABOUT)
"""Files and folders of an older version; the description goes last."""

MAX_TEXT_BYTES: Final = 1 << 24
MAX_LINE_BYTES: Final = 4096
"""Largest text file and line that are read [bytes]; a choice."""

OLD_CAUSES: Final = {
    "cause_hvac_wh": "cause_climate_wh",
    "cause_learned_correction_wh": "cause_correction_wh",
}
"""Columns of diaries of 0.2.0."""

UNREADABLE: Final = (
    ValueError,
    TypeError,
    KeyError,
    AttributeError,
    OverflowError,
    RecursionError,
    InvalidInput,
)


def read_into(folder: Path, db: Database) -> None:
    """Read the folder of an older version into the new file of its car. O(bytes).

    Raises
    ------
    InvalidInput
        When a part is damaged that cannot be left out, or a process of an older version follows the car.
    """
    live = folder / LIVE
    if (folder / ABOUT).is_file():
        _read_description(folder, db)
    if live.is_dir():
        with folder_lock(live):
            _read_settings(live, db)
            _read_journal(live / "journal.ndjson", db)
            _read_trips(folder.name, live, db)


def older_parts(folder: Path) -> list[Path]:
    """Return the files and folders of an older version in its folder, the description last; none in any other folder."""
    if not is_older_folder(folder):
        return []
    return [*folder.glob(f".*{WRITING}"), *(folder / name for name in NAMES)]


def remove(part: Path) -> None:
    """Remove a file, a folder or a link; a missing one stays missing."""
    if part.is_dir() and not part.is_symlink():
        shutil.rmtree(part)
    else:
        part.unlink(missing_ok=True)


def is_older_folder(folder: Path) -> bool:
    """Whether an older version wrote this folder."""
    return (folder / ABOUT).is_file() or (folder / LIVE).is_dir()


def _read_description(folder: Path, db: Database) -> None:
    with damage(folder / ABOUT, "the description of a car"):
        description = json.loads(read_text_file(folder / ABOUT, MAX_TEXT_BYTES))
        car = replace(load_vehicle(folder / "car.toml"), name=f"{description['vehicle']}")
        settings = {"vehicle": vehicle_values(car), "base": description["base"]}
        settings["label"] = description.get("label")
    left_out = folder / "left-out.json"
    if left_out.is_file():
        with damage(left_out, "reasons by trip"):
            settings["left_out"] = dict(json.loads(read_text_file(left_out, MAX_TEXT_BYTES)))
    db.put_settings({**settings, "state": secrets.token_hex(8)})
    db.put_logs(map(row_of_log, open_store(folder / "trips").logs()), is_learned=True)
    learned = folder / "learned"
    restore_folder(learned)
    if learned.is_dir():
        with damage(learned / "diary.parquet", "a diary"):
            table = pd.read_parquet(learned / "diary.parquet").rename(columns=OLD_CAUSES)
            rows = [(f"{row['trip_id']}", json.dumps(row)) for row in table.to_dict("records")]
        db.executemany("INSERT INTO diary VALUES (?, ?)", rows)
        parts = [(part.name, read_file(part)) for part in (learned / "model").iterdir()]
        db.executemany("INSERT INTO model VALUES (?, ?)", parts)


def _read_settings(live: Path, db: Database) -> None:
    token, plan = live / "token.json", live / "plan.json"
    if token.is_file():
        with damage(token, "the digest of a token"):
            db.put_settings({"token": f"{json.loads(read_text_file(token, MAX_TEXT_BYTES))['sha256']}"})
    if plan.is_file():
        with damage(plan, "a plan", "remove it"):
            document = json.loads(read_file(plan, MAX_TEXT_BYTES))
            db.put_settings({"plan": LivePlan.from_dict(document).to_dict()})
    start_s, forecasts = _read_forecasts(live / "forecasts.json")
    db.put_forecasts(start_s, forecasts)


def _read_journal(path: Path, db: Database) -> None:
    """Read the samples of a journal; damaged lines, and an incomplete end that a killed process left, are left out."""
    if not path.is_file():
        return
    samples: list[Sample] = []
    with path.open("rb") as stream:
        first_line = stream.readline(MAX_LINE_BYTES)
        stream.seek(0)
        while line := stream.readline(MAX_LINE_BYTES):
            with contextlib.suppress(*UNREADABLE):
                samples.append(sample_of_text(line))
    if samples and samples[-1].received_s is None:
        samples[-1] = replace(samples[-1], received_s=path.stat().st_mtime)
    db.put_messages(samples)
    with contextlib.suppress(*UNREADABLE):
        db.put_settings({"live": _state_of_line(json.loads(first_line))})


def _state_of_line(line: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the first line of a journal holds of earlier samples, in the form of `Recorder._state_before_samples`."""
    charge, parked, offset_s = None, False, number_of(line.get("offset_s"))
    if line.get("charge") is not None:
        time_s, field, value, parked = line["charge"]
        charge = Sample(time_s, {CHARGES[field]: value}).time_s, field, value
    return {
        "after_s": Sample(line["after_s"]).time_s,
        "offset_s": None if math.isnan(offset_s) else offset_s,
        "charge": charge,
        "parked": parked,
        "air": [number_of(line.get(name)) for name in ("air_s", "air_degc")],
    }


def _read_trips(car: str, live: Path, db: Database) -> None:
    """Read the finished trips on the road; the text of a trip that cannot be read is kept in the setting `unread`."""
    taught: set[str] = set()
    with contextlib.suppress(*UNREADABLE):
        taught = set(json.loads(read_text_file(live / "taught.json", MAX_TEXT_BYTES))["trips"])
    unread = {}
    for path in sorted((live / "trips").glob("*.csv")):
        name = path.stem
        try:
            start = dt.datetime.strptime(name, "%Y%m%dT%H%M%SZ").replace(tzinfo=dt.UTC)
            log_name, start_s, is_learned = f"{car}-{name}", start.timestamp(), name in taught
            values = (start_s, is_learned, log_name)
            if not db.execute(
                "UPDATE trips SET start_s = ?, is_learned = ? WHERE trip_id = ?", values
            ).rowcount:
                context = Context(started_at=start.astimezone().replace(tzinfo=None))
                row = row_of_log(Log.from_samples(log_name, read_canonical(path), context))
                db.put_logs([row], start_s=start_s, is_learned=is_learned)
        except UNREADABLE:
            unread[path.name] = read_file(path).decode("utf-8", "replace")
        else:
            db.put_forecasts(start_s, _read_forecasts(path.with_name(f"{name}.forecasts.json"))[1])
    if unread:
        db.put_settings({"unread": unread})


def _read_forecasts(path: Path) -> tuple[float, tuple[MadeForecast, ...]]:
    """Return the departure of a trip and its forecasts from a file; NaN and no forecasts if it is missing or damaged."""
    with contextlib.suppress(*UNREADABLE):
        document = json.loads(read_text_file(path, MAX_TEXT_BYTES))
        rows = [[float(row[name]) for name in MadeForecast.__slots__] for row in document["forecasts"]]
        if all(math.isfinite(value) for row in rows for value in row):
            return float(document["start_s"]), tuple(MadeForecast(*row) for row in rows)
    return math.nan, ()
