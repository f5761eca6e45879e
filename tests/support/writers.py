"""Commands that write, killed at seeded moments: their output is old or new, whole, and a later run works.

`WRITERS` is the table: a command that writes gets a line here.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final

FILE: Final = """
from tripwatt.cli.output import write_text
if out.exists():
    assert out.read_text() in ("old" * 20_000, "new" * 20_000), "neither old nor new"
def run(text):
    write_text(text * 20_000, out)
"""

FOLDER: Final = """
from tripwatt.cli.output import unfinished_folder, write_whole
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
import json, os
import pandas as pd
from tripwatt.live import Sample, RoadCar
T0 = 1_700_000_000.0
def samples(text):
    shift = 0.0 if text == "old" else 3600.0
    for k in range(90):
        moves = 5 <= k < 50
        yield Sample(T0 + shift + k, {"speed_m_s": 15.0 if moves else 0.0}, charging=k >= 55)
def kept():
    found = []
    for path in (out / "live" / "trips").glob("*.csv"):
        table = pd.read_csv(path)
        start = pd.to_datetime(path.stem, format="%Y%m%dT%H%M%SZ").timestamp()
        found += [round(start + t) for t in table["time_s"]]
    with RoadCar(out) as car:
        found += [round(s.time_s) for s in car._journal.read()]
    return found
if out.exists():
    place = out / "acknowledged"
    with RoadCar(out):
        pass  # whatever was left undone is done
    found = kept()
    acknowledged = [int(t) for t in place.read_text().split()] if place.exists() else []
    assert set(acknowledged) <= set(found), "an acknowledged sample is lost"
    assert len(found) == len(set(found)), "a sample counts twice"
def run(text):
    with RoadCar(out) as car:
        for sample in samples(text):
            car.add(sample)
            if sample.values["speed_m_s"]:
                with (out / "acknowledged").open("a") as stream:
                    stream.write(f"{sample.time_s:.0f}" + chr(10))
"""

WRITERS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "one file (example-trip, mapping, export, vehicles --import, forecast --plot)": FILE,
        "a folder of results (evaluate, transfer)": FOLDER,
        "a model (fit)": MODEL,
        "samples and trips of a car on the road (live, serve)": LIVE,
    }
)
"""Kind of output, with the commands that write it -> a program that checks `out` and defines `run`."""

FIRST: Final = """
import os, pathlib, random, signal, sys
out, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[1]).parent
"""


def _python(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=False, timeout=120
    )


def killed_at_random(name: str, kills: int, seed: int = 0) -> Iterator[str]:
    """Kill a writer at seeded lines of its run; yields what is wrong afterwards.

    One process forks a child for each kill, so that nothing is imported twice.
    """
    with tempfile.TemporaryDirectory() as folder:
        program = FIRST + f"SOURCE = {WRITERS[name]!r}\n" + WRITERS[name] + MANY
        done = _python(program, f"{folder}/out", str(kills), str(seed))
        if done.returncode != 0:
            yield f"{name}: {done.stderr[-600:]}"
        yield from (f"{name}: {line}" for line in done.stdout.splitlines() if not line.startswith("kills"))


MANY: Final = '''
import shutil

def clear():
    for entry in list(folder.iterdir()):
        shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

def child(work):
    """Status of a child that runs `work`."""
    pid = os.fork()
    if pid == 0:
        try:
            work()
            os._exit(0)
        except BaseException:
            import traceback
            print(traceback.format_exc()[-400:].replace(chr(10), " | "), flush=True)
            os._exit(1)
    return os.waitpid(pid, 0)[1]

def traced(die_at):
    steps = 0
    def tracer(frame, event, argument):
        nonlocal steps
        steps += 1
        if steps >= die_at:
            os.kill(os.getpid(), signal.SIGKILL)
        return tracer
    def work():
        sys.settrace(tracer)
        run("new")
        sys.settrace(None)
    return work, lambda: steps

def check():
    exec(compile(SOURCE, "check", "exec"), globals())

random.seed(int(sys.argv[3]))
run("old")
work, steps = traced(10**12)
work()
total = steps()
died = 0
for _ in range(int(sys.argv[2])):
    clear()
    with_old = random.random() < 0.7
    if with_old:
        run("old")
    work, _ = traced(random.randint(1, total))
    status = child(work)
    died += os.WIFSIGNALED(status)
    if with_old and not out.exists():
        print("the older output is gone")
    if child(check):
        print("the check failed")
    if child(lambda: run("new")) or child(check):
        print("a later run failed")
    left = [entry.name for entry in folder.iterdir() if entry != out]
    if left:
        print(f"left behind: {left}")
print(f"kills {died}")
if died < 0.6 * int(sys.argv[2]):
    print(f"only {died} kills")
'''
