"""Commands that write, killed or on a full disk at seeded moments: their output is old or new, whole, and a later run works.

`WRITERS` is the table: a command that writes gets a line here. A kill comes before a line of Python, before an operation on files, or
after a time, and so within native code. A full disk is a file system of memory with little space left, where the system has one for users
(`unshare`), or a bound on the length of files.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Final

FILE: Final = """
from tripwatt.command.shared import write_text
if out.exists():
    assert out.read_text() in ("old" * 20_000, "new" * 20_000), "neither old nor new"
def run(text):
    write_text(text * 20_000, out)
"""

FOLDER: Final = """
from tripwatt.command.evaluate import unfinished_folder, write_whole
from tripwatt.files import folder_lock
NAMES = ("a.csv", "report.html", "results.json", "figures")
def fill(text, folder):
    for name in NAMES[:3]:
        (folder / name).write_text(text * 5000)
    (folder / "figures").mkdir()
    (folder / "figures" / "b.svg").write_text(text * 5000)
if out.exists():
    texts = [(out / name).read_text() for name in NAMES[:3]] + [(out / "figures" / "b.svg").read_text()]
    assert len(set(texts)) == 1 and texts[0] in ("old" * 5000, "new" * 5000), "neither old nor new"
def run(text):
    unfinished = unfinished_folder(out)
    with folder_lock(unfinished):
        write_whole(lambda folder: fill(text, folder), out, unfinished)
"""

MODEL: Final = """
import numpy as np
from tripwatt.modelfile import read_model, write_model
if out.exists():
    found = read_model(out)
    assert found.metadata["about"] == found.parts["b.json"]["about"] in ("old", "new"), "neither old nor new"
def run(text):
    write_model(out, {"about": text}, {"a.npz": {"x": np.arange(20_000.0)}, "b.json": {"about": text}})
"""

LIVE: Final = """
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.telemetry import Sample
T0 = 1_700_000_000.0
def samples(text):
    shift = 0.0 if text == "old" else 3600.0
    for k in range(90):
        moves = 5 <= k < 50
        yield Sample(T0 + shift + k, {"speed_m_s": 15.0 if moves else 0.0}, charging=k >= 55)
def kept():
    with Car.follow(out) as car:  # whatever was left undone is done
        found = [round(sample.time_s) for sample in car.file.messages()]
        for start_s in car.file.departures(1e10):
            (log,) = car.file.logs("start_s = ?", start_s)
            found += [round(start_s + t) for t in log.array("time_s")]
        return found
if out.exists():
    place = out / "acknowledged"
    found = kept()
    acknowledged = [int(t) for t in place.read_text().split()] if place.exists() else []
    assert set(acknowledged) <= set(found), "an acknowledged sample is lost"
    assert len(found) == len(set(found)), "a sample counts twice"
def run(text):
    with Car.follow(out) as car:
        for sample in samples(text):
            car.record(sample)
            if sample.values["speed_m_s"]:
                with (out / "acknowledged").open("a") as stream:
                    stream.write(chr(10) + f"{sample.time_s:.0f}" + chr(10))
"""

CAR: Final = """
from tripwatt.forecasting import load_model
load_model()
from dataclasses import replace
from tripwatt.server.cars.folder import create_car, is_car, open_car
from tripwatt.study.synthetic import synthetic_fleet
LOGS = [replace(log, samples=log.samples.iloc[:320]) for log in synthetic_fleet(2).logs]
if out.exists() and (with_old or is_car(out)):
    car = open_car(out)
    stored = [(log.trip_id, len(log.samples)) for log in car.logs()]
    diary, known = list(car.diary.table["trip_id"]), {log.trip_id for log in LOGS}
    assert len(stored) == len(set(stored)) and len(diary) == len(set(diary)), "a trip counts twice"
    assert set(stored) <= {(name, 320) for name in known}, "half a trip"
    least = known if stage == "later" else {LOGS[0].trip_id} if with_old else set()
    assert least <= set(diary) <= {name for name, _ in stored}, "a trip is lost"
    assert car.model().vehicle.name == "nissan_leaf_24", "no model"
def run(text):
    car = open_car(out) if is_car(out) else create_car(out, "nissan_leaf_24")
    car.add(LOGS[:1] if text == "old" else LOGS)
"""

LEARN: Final = """
from tripwatt.forecasting import load_model
load_model()
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.folder import create_car, is_car, open_car
from tripwatt.server.cars.telemetry import Sample
from tripwatt.study.synthetic import synthetic_fleet
ROWS = synthetic_fleet(1).logs[0].samples.iloc[:320].to_dict("records")
STARTS = {"old": [1_700_000_000.0], "new": [1_700_000_000.0, 1_700_100_000.0]}
if out.exists() and is_car(out):
    car = open_car(out)
    stored, diary = [log.trip_id for log in car.logs()], list(car.diary.table["trip_id"])
    assert len(stored) == len(set(stored)) and len(diary) == len(set(diary)), "a trip counts twice"
    assert len(diary) >= (2 if stage == "later" else 1 if with_old else 0), "a trip is lost"
    assert len(stored) >= len(diary), "a finished trip is lost"
def run(text):
    if not is_car(out):
        create_car(out, "nissan_leaf_24")
    with Car.follow(out) as car:
        for start_s in STARTS[text]:
            for row in ROWS:
                values = {n: row[n] for n in ("speed_m_s", "voltage_v", "current_a")}
                car.record(Sample(start_s + row["time_s"], values), now_s=start_s + row["time_s"])
            car.finish_trip()
    open_car(out).learn()
"""

STORE: Final = """
import deltalake, pyarrow.dataset, tripwatt.fleet.store.store
from tripwatt.forecasting import load_model
load_model()
from dataclasses import replace
from tripwatt.fleet.store import create_store, open_store
from tripwatt.errors import InvalidInput
from tripwatt.study.synthetic import synthetic_fleet
LOGS = [replace(log, samples=log.samples.iloc[:200]) for log in synthetic_fleet(4).logs]
def opened():
    try:
        return open_store(out)
    except InvalidInput:
        assert not with_old, "the store is lost"
        return None
if out.exists() and (store := opened()) is not None:
    found = [(log.trip_id, len(log.samples)) for log in store.logs()]
    assert len(found) == len(set(found)), "a trip counts twice"
    assert set(found) <= {(log.trip_id, 200) for log in LOGS}, "half a trip"
    assert len(found) >= (4 if stage == "later" else 1 if with_old else 0), "a trip is lost"
    assert len(store.trips()) == len(found), "rows without samples"
def run(text):
    tripwatt.fleet.store.store.BATCH = 2
    store = (opened() if out.exists() else None) or create_store(out, buckets=1)
    store.add(LOGS[:1] if text == "old" else LOGS, car_model="bmw_i3_60ah", vehicle_id="a")
"""

UPLOADS: Final = """
import io, zipfile
from tripwatt.sources.archives import unpack
def table(number):
    return b"time_s,speed_m_s" + b"".join(chr(10).encode() + b"%d,%d" % (k, number) for k in range(3000))
packed = io.BytesIO()
with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
    for number in range(2, 6):
        archive.writestr(f"t{number}.csv", table(number))
SENT = {"t0.csv": table(0), "t1.csv": table(1), "more.zip": packed.getvalue()}
if out.exists():
    tables = {path.name: path.read_bytes() for path in out.glob("*.csv") if not path.name.startswith(".")}
    assert tables.items() <= {f"t{k}.csv": table(k) for k in range(6)}.items(), "a table that is not whole, or twice"
    assert len(tables) >= (6 if stage == "later" else 1 if with_old else 0), "a table is lost"
def run(text):
    out.mkdir(exist_ok=True)
    for name in ("t0.csv",) if text == "old" else SENT:
        unpack(name, out, content=SENT[name])
"""

MAP: Final = """
import json, osmium.filter, scipy.spatial, sqlite3  # once, so that no kill comes within an import
from tripwatt.roads.maps import folder as module
from tripwatt.roads.maps.folder import build_map, open_map
EXTRACTS = {"old": 60, "new": 180}
module.require_valhalla = lambda: None
def tiles(work, extract):
    for number in range(8):
        (work / f"tile{number}.gph").write_bytes(b"0" * 20_000)
module.build_tiles = tiles
if out.exists():
    made = open_map(out)
    with sqlite3.connect(out / "places.sqlite") as database:
        (count,) = database.execute("SELECT count(*) FROM places").fetchone()
    sizes = [path.stat().st_size for path in out.glob("*.gph")]
    assert (count == made.info["places"] and count in EXTRACTS.values()), "neither old nor new"
    assert stage != "later" or count == EXTRACTS["new"], "the new map is lost"
    assert sizes == [20_000] * 8, "half a map"
def run(text):
    nodes = "".join(
        f'<node id="{k}" lat="{47.0 + k / 5000}" lon="9.0"><tag k="place" v="town"/><tag k="name" v="T{k}"/></node>'
        for k in range(1, EXTRACTS[text] + 1)
    )
    extract = out.parent.parent / f"{text}.osm"
    if not extract.exists():
        extract.write_text(f'<?xml version="1.0"?><osm version="0.6">{nodes}</osm>')
    build_map(extract, out)
"""

WRITERS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "one file (example-trip, mapping, export, vehicles --import)": FILE,
        "a folder of results (evaluate, transfer)": FOLDER,
        "a model (fit)": MODEL,
        "samples and trips of a car on the road (live, serve)": LIVE,
        "trips of a car (car add)": CAR,
        "finished trips of a car (serve)": LEARN,
        "a store of trips (store create, store add)": STORE,
        "tables of an upload (serve)": UPLOADS,
        "a map (map build)": MAP,
    }
)
"""Kind of output, with the commands that write it -> a program that checks `out` and defines `run`."""

FIRST: Final = """
import ctypes, os, pathlib, random, signal, sys
folder = pathlib.Path(sys.argv[1])
out = folder / "out"
with_old, stage = False, "start"
"""


SLOW: Final = tuple(name for name, program in WRITERS.items() if program in (CAR, LEARN, STORE, MAP))
"""Those whose run takes a tenth of a second or more."""


NEEDS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        name: ("deltalake",) if "deltalake" in program else ("osmium",) if program is MAP else ()
        for name, program in WRITERS.items()
    }
)
"""Packages of extras without which a writer does not run."""


@dataclass
class Tried:
    """What became of the runs of a writer.

    Attributes
    ----------
    killed, failed : int
        Runs that a kill ended, and those that a full disk ended.
    wrong : list of str
        What was lost, doubled, not whole, or stuck.
    """

    killed: int = 0
    failed: int = 0
    wrong: list[str] = field(default_factory=list)


def tried_at_random(name: str, kills: int, full: int, seed: int = 0) -> Tried:
    """Kill a writer at seeded moments of its run, and let it run on full disks.

    One process forks a child for each run, so that nothing is imported twice. Native threads begin in children only.
    """
    tried = Tried()
    with tempfile.TemporaryDirectory() as folder:
        program = FIRST + f"SOURCE = {WRITERS[name]!r}\n" + WRITERS[name] + MANY
        (Path(folder) / "work").mkdir()
        words = [sys.executable, "-c", program, f"{folder}/work", f"{kills}", f"{full}", f"{seed}"]
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=1200)
        *lines, last = done.stdout.splitlines() or [""]
        if done.returncode != 0:
            return Tried(wrong=[f"{name}: {line}" for line in (*lines, last, done.stderr[-600:])])
        tried.killed, tried.failed = map(int, last.split())
        tried.wrong += [f"{name}: {line}" for line in lines]
    return tried


MANY: Final = '''
import contextlib, io, resource, shutil, time

LONGEST_S = 60
"""A run that takes longer is stuck."""
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
MOUNT = 0x20000 | 0x10000000  # CLONE_NEWNS, CLONE_NEWUSER

def clear():
    for entry in list(folder.iterdir()):
        shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

old = folder.parent / "old"
def copy(made, place):
    shutil.copytree(made, place) if made.is_dir() else shutil.copy2(made, place)

def child(work):
    """What became of a child that runs `work`: its status, and what it wrote into a pipe."""
    reads, writes = os.pipe()
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        code = 1
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # native code prints there what it raises
        with contextlib.suppress(BaseException):
            try:
                signal.alarm(LONGEST_S)
                code = work(writes) or 0
            except BaseException as error:
                import traceback
                os.write(writes, traceback.format_exc()[-400:].replace(chr(10), " | ").encode())
                code = 3 if isinstance(error, EXPECTED) else 1
        os._exit(code)
    os.close(writes)
    with os.fdopen(reads, "rb") as stream:
        said = stream.read().decode()
    return os.waitpid(pid, 0)[1], said

from tripwatt.errors import InvalidInput
EXPECTED = (InvalidInput, OSError)

def good(what, work):
    status, said = child(work)
    if status:
        print(f"{what}: status {status}, {said}")

def dying(how, at):
    """A run that ends before line or operation on files number `at`, or after `at` seconds."""
    counts = {"line": 0, "file": 0}
    def passed(kind):
        counts[kind] += 1
        if how == kind and counts[kind] >= at:
            os.kill(os.getpid(), signal.SIGKILL)
    def tracer(frame, event, argument):
        passed("line")
        return tracer
    def audit(event, arguments):
        is_write = event == "open" and isinstance(arguments[2], int) and arguments[2] & WRITES
        if is_write or event in ("os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.link", "os.truncate"):
            passed("file")
    def work(writes):
        started = time.monotonic()
        sys.addaudithook(audit)
        if how == "time":
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_REAL, at)
        if how == "line":
            sys.settrace(tracer)
        run("new")
        sys.settrace(None)
        signal.setitimer(signal.ITIMER_REAL, 0)
        os.write(writes, f"{counts['line']} {counts['file']} {time.monotonic() - started}".encode())
    return work

def check(writes):
    exec(compile(SOURCE, "check", "exec"), globals())

def mounted():
    """Whether the folder is a file system of memory from now on, for this process alone."""
    user, group = os.getuid(), os.getgid()
    library = ctypes.CDLL(None, use_errno=True)
    if not hasattr(library, "unshare") or library.unshare(MOUNT if user else MOUNT & 0x20000):
        return False
    if user:
        with contextlib.suppress(OSError):
            pathlib.Path("/proc/self/setgroups").write_text("deny")
            pathlib.Path("/proc/self/uid_map").write_text(f"0 {user} 1")
            pathlib.Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    library.mount(None, b"/", None, 0x4000 | 0x40000, None)  # MS_REC, MS_PRIVATE
    return library.mount(b"none", os.fsencode(folder), b"tmpfs", 0, b"size=64m") == 0

def free_bytes():
    state = os.statvfs(folder)
    return state.f_bavail * state.f_frsize

def short(free, ballast):
    """A run with so many bytes left on the disk, or in a file."""
    def work(writes):
        if ballast is None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (free, free))
        run("new")
    if ballast is not None:
        with ballast.open("wb") as stream:
            os.posix_fallocate(stream.fileno(), 0, max(free_bytes() - free, 1))
    try:
        return child(work)
    finally:
        if ballast is not None:
            ballast.unlink()

def afterwards(what):
    global stage
    stage = what
    if with_old and not out.exists():
        print(f"{what}: the older output is gone")
    good(f"{what}: the check failed", check)
    stage = "later"
    good(f"{what}: a later run failed", lambda writes: run("new"))
    good(f"{what}: the check of a later run failed", check)
    left = [entry.name for entry in folder.iterdir() if entry != out]
    if left:
        print(f"{what}: left behind: {left}")

def prepare():
    global with_old, stage
    clear()
    with_old, stage = random.random() < 0.7, "start"
    if with_old:
        copy(old, out)

kills, full = int(sys.argv[2]), int(sys.argv[3])
random.seed(int(sys.argv[4]))
in_memory = bool(full) and mounted()
most, used = {}, 1 << 16
good("the first run failed", lambda writes: run("old"))
copy(out, old)
for has_old in (False, True):
    found = []
    for how in ("line", "file"):
        clear()
        if has_old:
            copy(old, out)
        before = free_bytes()
        status, said = child(dying(how, 1e12))
        assert status == 0, said
        found.append(said.split())
    most[has_old] = {"line": int(found[0][0]), "file": int(found[1][1]), "time": float(found[1][2])}
    used = max(before - free_bytes(), used)
longest = max(path.stat().st_size for path in folder.rglob("*") if path.is_file())
died = failed = 0
for number in range(kills):
    prepare()
    how, ends = random.choice(list(most[with_old].items()))
    at = random.uniform(0.0, ends) if how == "time" else random.randint(1, max(ends, 1))
    status, said = child(dying(how, max(at, 1e-4)))
    died += os.WIFSIGNALED(status)
    afterwards(f"kill {number} ({how})")
for number in range(full):
    prepare()
    on_disk = in_memory and number % 2 == 0
    free = random.randint(0, used if on_disk else longest)
    status, said = short(free, folder / "ballast" if on_disk else None)
    failed += status != 0
    if status and not (os.WIFEXITED(status) and os.WEXITSTATUS(status) == 3):
        print(f"full disk {number}: no error in words: status {status}, {said}")
    afterwards(f"full disk {number} ({free} bytes, {'disk' if on_disk else 'file'})")
if died < 0.4 * kills:
    print(f"only {died} of {kills} kills")
if failed < 0.3 * full:
    print(f"only {failed} of {full} full disks")
print(died, failed)
'''
