"""Folders of cars that tripwatt 0.2.0 and 0.3.0.dev0 wrote: read once into the file of the car, and then removed.

They had a description, a Delta store of logs, a folder with model and diary, and a folder `live` with the token, finished trips as tables
and their forecasts. A trip under way, with its plan, is not read.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import math
import secrets
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Final

import pandas as pd

from tripwatt.errors import DAMAGE, InvalidInput, damage
from tripwatt.files import WRITING, folder_lock, read_file, read_text_file, restore_folder
from tripwatt.fleet.store import open_store
from tripwatt.forecasting.storage import vehicle_values
from tripwatt.server.cars.car_file import Database, MadeForecast, row_of_log
from tripwatt.sources.canonical import read_canonical
from tripwatt.trips import Context, Log
from tripwatt.vehicles import load_vehicle

ABOUT: Final = "car.json"
"""File with the description; a folder without it is that of a car that only sends on the road, or of no car."""

LIVE: Final = "live"
NAMES: Final = ("trips", "learned", ".learned.older", LIVE, "car.toml", "left-out.json", ABOUT)
"""Files and folders of an older version; the description goes last."""

MAX_TEXT_BYTES: Final = 1 << 24
"""Largest text file that is read [bytes]; a choice."""

OLD_CAUSES: Final = {
    "cause_hvac_wh": "cause_climate_wh",
    "cause_learned_correction_wh": "cause_correction_wh",
}
"""Columns of diaries of 0.2.0."""

UNREADABLE: Final = (*DAMAGE, InvalidInput)


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
            token = live / "token.json"
            if token.is_file():
                with damage(token, "the digest of a token"):
                    digest = f"{json.loads(read_text_file(token, MAX_TEXT_BYTES))['sha256']}"
                db.put_settings({"token": digest})
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
            change = "UPDATE trips SET start_s = ?, is_learned = ? WHERE trip_id = ?"
            if not db.execute(change, (start_s, is_learned, log_name)).rowcount:
                context = Context(started_at=start.astimezone().replace(tzinfo=None))
                row = row_of_log(Log.from_samples(log_name, read_canonical(path), context))
                db.put_logs([row], start_s=start_s, is_learned=is_learned)
        except UNREADABLE:
            unread[path.name] = read_file(path).decode("utf-8", "replace")
        else:
            db.put_forecasts(start_s, _read_forecasts(path.with_name(f"{name}.forecasts.json")))
    db.put_settings({"unread": unread or None})


def _read_forecasts(path: Path) -> tuple[MadeForecast, ...]:
    """Return the forecasts of a trip from a file; none if it is missing or damaged."""
    with contextlib.suppress(*UNREADABLE):
        document = json.loads(read_text_file(path, MAX_TEXT_BYTES))
        rows = [[float(row[name]) for name in MadeForecast.__slots__] for row in document["forecasts"]]
        if all(math.isfinite(value) for row in rows for value in row):
            return tuple(MadeForecast(*row) for row in rows)
    return ()
