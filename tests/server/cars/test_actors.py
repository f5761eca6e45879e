"""Cars under several actors: a service, a command line beside it, kills at any write, copies and damage, as a state machine.

Nothing acknowledged is lost, nothing forgotten remains on disk, and no car hides another. Learning is replaced by a model that
enters trips in the diary at once. The gate takes a sample; `make bars` takes all runs (TRIPWATT_EVERY_CAR).
"""

from __future__ import annotations

import asyncio
import math
import os
import re
import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

pytest.importorskip("fastapi", reason="the extra tripwatt[service] is not installed")

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.server.cars import car_file
from tripwatt.server.cars import folder as folders
from tripwatt.server.cars.car_file import FILE, CarFile, Database
from tripwatt.server.cars.diary import BOOK, FORECAST, NUMBERS, Diary, Score
from tripwatt.server.cars.folder import create_car, forget_car, open_car
from tripwatt.server.cars.learning import Learner, Lesson
from tripwatt.server.cars.telemetry import Sample
from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.car_schemas import LogsRequest
from tripwatt.server.http.live import LiveCars
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Settings

EVERY: Final = os.environ.get("TRIPWATT_EVERY_CAR") == "1"
NAMES: Final = ("leaf", "zoe", "My car")
UPLOADS: Final = ("upload01", "upload02")
VEHICLE: Final = tw.load_vehicle("nissan_leaf_24")
MAX_BYTES: Final = 100_000_000
START_S: Final = 1_700_000_000.137

WRITES: Final = ("os.remove", "os.rmdir", "os.rename", "os.mkdir", "os.link", "os.truncate")
STATEMENTS: Final = ("BEGIN", "INSERT", "DELETE", "UPDATE", "CREATE", "DROP", "PRAGMA user_version =")
KILLS: Final = st.one_of(st.none(), st.integers(0, 12), st.integers(0, 60))
"""Writes after which the process is killed; None: it goes on."""

SETTINGS: Final = ("vehicle", "label", "token", "state", "live", "plan", "left_out", "base")
VALUES: Final = [f"{name} {value}" for name in SETTINGS for value in ("{", "[1]", '"x"', '{"a":1}')]
DAMAGE: Final = ("empty", "text", "head", "middle", "end", "tables", "diary", "newer", *VALUES)


NOTHING: Final = Score(0, *[math.nan] * 5, 0, math.nan)


class Killed(BaseException):
    """The process ends here; what would run at its end does not."""


class Killer:
    """Raises `Killed` at a write, and at every write after it, below a folder."""

    def __init__(self) -> None:
        self.left: int | None = None
        self.below = ""

    def write(self) -> None:
        """Count a write."""
        if self.left is not None:
            self.left -= 1
            if self.left < 0:
                raise Killed

    def hook(self, event: str, args: tuple[Any, ...]) -> None:
        """Take an event of the interpreter."""
        if self.left is None:
            return
        opened = event == "open" and isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR)
        if (opened or event in WRITES) and (self.below in f"{args[0]}" or not f"{args[0]}".startswith("/")):
            self.write()


KILLER: Final = Killer()
sys.addaudithook(KILLER.hook)


class KilledDatabase(Database):
    """A connection whose process may be killed at each statement that writes, and before and after a commit."""

    def execute(self, sql: str, *args: Any) -> sqlite3.Cursor:
        """Execute a statement."""
        if sql.startswith(STATEMENTS):
            KILLER.write()
        return super().execute(sql, *args)

    def executemany(self, sql: str, *args: Any) -> sqlite3.Cursor:
        """Execute a statement for each row."""
        KILLER.write()
        return super().executemany(sql, *args)

    def __exit__(self, *args: Any) -> Any:
        if args[0] is None:
            KILLER.write()
        super().__exit__(*args)
        if args[0] is None:
            KILLER.write()


@dataclass
class Entity:
    """A folder of a car: its marks on disk, and what was acknowledged."""

    name: str
    marks: set[str] = field(default_factory=set)
    files: set[str] = field(default_factory=set)
    times: set[float] = field(default_factory=set)
    token: str = ""
    sound: bool = True
    older: bool = False

    @property
    def served(self) -> bool:
        """Whether its name can be part of a URL."""
        return folders.VALID_NAME.fullmatch(self.name) is not None


def table(number: int) -> bytes:
    """A log that differs from every other."""
    rows = [f"{k},{8.0 + 0.001 * number if k else 0.0},360.0,{10.0 + 0.01 * k}" for k in range(40)]
    return "\n".join(["time_s,speed_m_s,voltage_v,current_a", *rows]).encode()


def row(trip_id: str) -> dict[str, Any]:
    """A row of a diary."""
    energies = dict.fromkeys((*NUMBERS, *FORECAST, *(f"{BOOK}{name}" for name in FORECAST)), 1000.0)
    return {"trip_id": trip_id, "started_at": "", "has_heights": False, **energies}


class Actors(RuleBasedStateMachine):
    """A service with its worker and its cars on the road, and a command line in the same folder."""

    def __init__(self) -> None:
        super().__init__()
        self.patch = pytest.MonkeyPatch()
        self.patch.setattr(car_file, "Database", KilledDatabase)
        self.patch.setattr(folders, "for_car", lambda *_: None)
        self.patch.setattr(Learner, "learn", lambda learner, *_: self.lesson(learner))
        for name in ("by_temperature", "by_season", "by_cause_wh"):
            self.patch.setattr(Diary, name, lambda _: {})
        self.patch.setattr(Score, "of", lambda *_: NOTHING)
        self.root = Path(tempfile.mkdtemp(prefix="tripwatt-actors-"))
        KILLER.below = self.root.name
        self.loop = asyncio.new_event_loop()
        self.entities: dict[str, Entity] = {}
        self.number = 0
        self.meanwhile: Callable[[], object] | None = None
        self.start()
        self.first()

    def start(self) -> None:
        """Start the service."""
        self.jobs = CarJobs(self.root)
        self.live = LiveCars(Settings(cars=self.root), None, lambda **_: None)  # type: ignore[arg-type]

    def first(self) -> None:
        """Make a car that sends and has an upload."""
        self.jobs.create(NAMES[0], VEHICLE)
        entity = self.entities[NAMES[0]] = Entity(NAMES[0])
        self.store(entity, UPLOADS[0])
        self.token_of(entity)

    def token_of(self, entity: Entity) -> None:
        """Make a token, with which the service follows the car."""
        entity.token = self.jobs.token(entity.name)["token"]
        self.loop.run_until_complete(self.live.follow(self.root / entity.name))

    def restart_service(self) -> None:
        """End the service and start it again."""
        self.live.close()
        self.start()

    def teardown(self) -> None:
        """End everything."""
        KILLER.left = None
        self.live.close()
        self.loop.close()
        self.patch.undo()
        shutil.rmtree(self.root)

    def lesson(self, learner: Learner) -> Lesson:
        """Enter all new trips in the diary; a file may be sent meanwhile."""
        if self.meanwhile is not None:
            self.meanwhile, sent = None, self.meanwhile
            sent()
        return Lesson([row(log.trip_id) for log in learner.logs.logs if log.trip_id not in learner.seen])

    @contextmanager
    def killed_after(self, writes: int | None, entity: Entity | None = None) -> Iterator[None]:
        """Kill the service after some writes of the block, and start it again; nothing after the kill is acknowledged."""
        KILLER.left = writes
        try:
            yield
        except Killed:
            KILLER.left = None
            self.meanwhile = None
            self.restart_service()
        finally:
            KILLER.left = None

    def mark(self, entity: Entity) -> str:
        """A text that is nowhere else."""
        self.number += 1
        mark = f"mark{self.number:06d}"
        entity.marks.add(mark)
        return mark

    def one(self, data: st.DataObject, **which: bool) -> Entity:
        """One of the cars."""
        known = [
            each for each in self.entities.values() if all(getattr(each, k) == v for k, v in which.items())
        ]
        return data.draw(st.sampled_from(known))

    def found(self, name: str, entity: Entity) -> None:
        """Take note of a folder, if it is that of a car."""
        if folders.holds_car(self.root / name):
            self.entities[name] = entity

    def service(self, call: Callable[[], Any], entity: Entity) -> bool:
        """Whether the service does something; a car that is damaged or half erased may be refused."""
        try:
            call()
        except (Problem, InvalidInput):
            assert not entity.sound
            return False
        return True

    @rule(name=st.sampled_from(NAMES), line=st.booleans(), kill=KILLS)
    def create(self, name: str, line: bool, kill: int | None) -> None:
        """Make a car on the page or by the command line."""
        place = folders.folder_name(name)
        before = self.entities.get(place)
        entity = (
            Entity(place, sound=False)
            if before is None
            else Entity(place, before.marks, sound=False, older=before.older)
        )
        with self.killed_after(kill):
            try:
                if line:
                    create_car(self.root / name, VEHICLE, label=self.mark(entity))
                else:
                    self.jobs.create(name, VEHICLE)
            except (Problem, InvalidInput):
                assert before is not None
                return
            assert before is None or not before.sound, "a car that was not finished"
            entity.sound = True
        if before is None or not before.sound:
            self.found(place, entity)
            assert place in self.entities or not entity.sound

    @precondition(lambda self: any(each.served for each in self.entities.values()))
    @rule(data=st.data(), upload=st.sampled_from(UPLOADS), kill=KILLS)
    def send(self, data: st.DataObject, upload: str, kill: int | None) -> None:
        """Send a file."""
        entity = self.one(data, served=True)
        with self.killed_after(kill):
            self.store(entity, upload)

    def store(self, entity: Entity, upload: str) -> None:
        mark = self.mark(entity)
        content = table(self.number)
        if self.service(
            lambda: self.jobs.store(entity.name, upload, f"{mark}.csv", content, MAX_BYTES), entity
        ):
            entity.files.add(mark)

    @precondition(lambda self: any(each.served for each in self.entities.values()))
    @rule(data=st.data(), upload=st.sampled_from(UPLOADS), meanwhile=st.booleans(), kill=KILLS)
    def learn(self, data: st.DataObject, upload: str, meanwhile: bool, kill: int | None) -> None:
        """Learn an upload; a file may be sent to it meanwhile."""
        entity = self.one(data, served=True)
        upload = next(iter(sorted(path.name for path in self.root.glob(f"{entity.name}/uploads/*"))), upload)
        if meanwhile:
            self.meanwhile = lambda: self.store(entity, upload)
        with self.killed_after(kill), suppress(Problem):  # without a file: not-found
            self.service(
                lambda: self.jobs.learn(entity.name, upload, LogsRequest()), replace(entity, sound=False)
            )
        self.meanwhile = None

    @precondition(lambda self: any(each.served for each in self.entities.values()))
    @rule(data=st.data(), kill=KILLS)
    def connect(self, data: st.DataObject, kill: int | None) -> None:
        """Make a token, with which a car sends from now on."""
        entity = self.one(data, served=True)
        entity.token = ""
        with self.killed_after(kill):
            self.service(lambda: self.token_of(entity), entity)

    @precondition(lambda self: any(each.token for each in self.entities.values()))
    @rule(data=st.data(), kill=KILLS)
    def message(self, data: st.DataObject, kill: int | None) -> None:
        """Send a message from the road; it is for the car whose token it has, not for a copy of that car."""
        entity = data.draw(st.sampled_from([each for each in self.entities.values() if each.token]))
        self.number += 1
        time_s = START_S + self.number
        entity.marks.add(f"{time_s!r}")
        with self.killed_after(kill):
            try:
                car = self.live.by_token(entity.token)
                assert car.name == entity.name
                sample = Sample(time_s, {"speed_m_s": 15.0})
                done = self.loop.run_until_complete(self.live.take(car, lambda: sample))
            except (Problem, InvalidInput):
                assert not entity.sound
            else:
                assert (done["status"], done["car"]) == ("ok", entity.name)
                entity.times.add(time_s)

    @precondition(lambda self: self.entities)
    @rule(data=st.data(), line=st.booleans(), kill=st.one_of(st.none(), st.integers(0, 8)))
    def forget(self, data: st.DataObject, line: bool, kill: int | None) -> None:
        """Erase a car on the page, or by the command line beside the service."""
        entity = self.one(data)
        name = entity.name
        is_followed = name in self.live.cars
        if line and is_followed:
            with pytest.raises(InvalidInput, match="end the service"):
                forget_car(self.root / name)
            return
        was_sound, entity.sound = entity.sound, False
        is_done = False
        with self.killed_after(kill):
            if line or not entity.served:
                forget_car(self.root / name)
            else:
                with suppress(Problem):
                    self.loop.run_until_complete(self.live.drop(name))
                self.jobs.forget(name)
            is_done = True
        if is_done or not folders.holds_car(self.root / name):  # nobody could erase it again
            del self.entities[name]
            self.is_gone(name)
        elif was_sound and not is_followed and kill == 0:
            entity.sound = True  # nothing was written

    def is_gone(self, name: str) -> None:
        """Check that the service has no car of a name."""
        with pytest.raises((Problem, InvalidInput)):
            self.jobs.show(name)
        assert name not in {each["name"] for each in self.jobs.list()["cars"]}
        assert self.jobs.model(name) is None

    @precondition(lambda self: self.entities)
    @rule(data=st.data(), form=st.sampled_from(("{} (copy)", "a-{}", "z-{}")), restart=st.booleans())
    def copy(self, data: st.DataObject, form: str, restart: bool) -> None:
        """Copy the folder of a car; the service finds the copy when it starts again."""
        entity = self.one(data)
        name = form.format(entity.name)
        if name in self.entities or len(self.entities) > 5:
            return
        shutil.copytree(self.root / entity.name, self.root / name, dirs_exist_ok=True)
        fields = {field: {*getattr(entity, field)} for field in ("marks", "files", "times")}
        self.found(name, replace(entity, name=name, token="", **fields))
        if restart:
            self.restart_service()

    @precondition(lambda self: self.entities)
    @rule(data=st.data(), kind=st.sampled_from(DAMAGE))
    def damage(self, data: st.DataObject, kind: str) -> None:
        """Damage the file of a car while the service is down."""
        entity = self.one(data)
        path = self.root / entity.name / FILE
        self.live.close()
        if path.is_file():
            with suppress(sqlite3.Error):
                damage(path, kind)
            entity.sound, entity.token = False, ""
        self.start()

    @rule(kind=st.sampled_from(("token.json", "plan.json", "car.json")), name=st.sampled_from(NAMES[:2]))
    def older(self, kind: str, name: str) -> None:
        """Find a damaged folder that an older version made."""
        if name in self.entities:
            return
        entity = self.entities[name] = Entity(name, sound=False, older=True)
        place = self.root / name / ("" if kind == "car.json" else "live")
        place.mkdir(parents=True, exist_ok=True)  # a killed call may have left it
        (place / kind).write_text("{" + self.mark(entity))
        self.restart_service()

    @precondition(lambda self: self.entities)
    @rule(data=st.data(), beside=st.booleans())
    def leftover(self, data: st.DataObject, beside: bool) -> None:
        """Find what a killed process of an older version left."""
        entity = self.one(data)
        place = self.root if beside else self.root / entity.name
        left = place / f".{entity.name if beside else 'learned'}.host.1.2.writing"
        left.mkdir(exist_ok=True)
        (left / "diary.parquet").write_text(self.mark(entity))

    @precondition(lambda self: any(each.served for each in self.entities.values()))
    @rule(data=st.data())
    def read(self, data: st.DataObject) -> None:
        """Show a car, and what it sent."""
        entity = self.one(data, served=True)
        if self.service(lambda: self.jobs.show(entity.name), entity) and entity.token:
            document = self.loop.run_until_complete(self.live.document(self.live.by_name(entity.name)))
            assert document["car"] == entity.name

    @rule()
    def restart(self) -> None:
        """Start the service again."""
        self.restart_service()

    @invariant()
    def no_car_hides_another(self) -> None:
        """Every car is listed, and shown if it is sound."""
        listed = self.jobs.list()
        sound = {each["name"] for each in listed["cars"]}
        damaged = {*listed["damaged"]}
        assert all(listed["damaged"].values())
        # without its description, that of an older version is a car that only sends on the road
        road = {name for name, each in self.entities.items() if each.older} - sound - damaged
        assert sound | damaged | road == {*self.entities}
        assert not sound & damaged
        for name, entity in self.entities.items():
            if entity.sound:
                assert name in (sound if entity.served else damaged)

    @invariant()
    def nothing_acknowledged_is_lost(self) -> None:
        """Each file is in its upload or learned, and each message is stored."""
        for entity in self.entities.values():
            if entity.sound:
                place = self.root / entity.name
                kept = {path.stem for path in place.glob("uploads/*/tables/*.csv")}
                assert entity.files <= kept | {log.trip_id for log in open_car(place).logs()}
                assert entity.times <= {sample.time_s for sample in CarFile(place).messages()}

    @invariant()
    def nothing_forgotten_remains(self) -> None:
        """A mark is on disk only in the folder of its car, and of its copies."""
        for path in self.root.rglob("*"):
            top = path.relative_to(self.root).parts[0]
            own = self.entities.get(
                top.removesuffix(".host.1.2.writing").removeprefix(".") if top[0] == "." else top
            )
            if own is None:
                assert path.is_dir()
                assert path.name not in NAMES or not any(path.iterdir())
            marks = set() if own is None else own.marks
            content = path.name.encode()
            with suppress(FileNotFoundError, IsADirectoryError):  # SQLite removes its files when it closes
                content += path.read_bytes()
            found = {mark.decode() for mark in MARK.findall(content)}
            assert found <= marks


def damage(path: Path, kind: str) -> None:
    """Damage the file of a car."""
    content = path.read_bytes()
    half = len(content) // 2
    match kind:
        case "empty":
            path.write_bytes(b"")
        case "text":
            path.write_bytes(b"no database" * 1000)
        case "head":
            path.write_bytes(b"\0" * 100 + content[100:])
        case "middle":
            path.write_bytes(content[:half] + b"\xff" * 4096 + content[half + 4096 :])
        case "end":
            path.write_bytes(content[:half])
        case _:
            with closing(sqlite3.connect(path)) as db, db:
                if kind == "tables":
                    db.execute("DROP TABLE settings")
                elif kind == "diary":
                    db.execute("INSERT INTO diary VALUES ('x', '[1]')")
                elif kind == "newer":
                    db.execute("PRAGMA user_version = 99")
                else:
                    name, value = kind.split()
                    db.execute("UPDATE settings SET value = ? WHERE name = ?", (value, name))


MARK: Final = re.compile(rb"mark\d{6}|17000\d{5}\.137")


def test_actors() -> None:
    """Nothing acknowledged is lost, nothing forgotten remains, and no car hides another."""
    runs, steps = (2000, 30) if EVERY else (30, 15)
    # a run of some seconds is not shrunk: that takes as long as hundreds of runs
    found = [Phase.explicit, Phase.reuse, Phase.generate]
    bounds = settings(max_examples=runs, stateful_step_count=steps, deadline=None, phases=found)
    run_state_machine_as_test(Actors, settings=bounds)  # type: ignore[no-untyped-call]
