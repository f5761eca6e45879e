"""Pipes, devices, sockets, folders and circles of links in place of every file that a command takes: one message, at once."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
from tests.support.command import Answer, answered

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")

from tripwatt.command import app
from tripwatt.sources.sample import sample_trips

LONGEST_S = 5.0
OF_FILES = ("FILE", "FOLDER", "STORE")
"""Parts of the names of values that are files though their type is text."""
ONLY_FILES = ("FILE", "SAMPLES", "TRIPS.parquet", "REGION.osm.pbf", "FILE.html")
"""Values that are never folders."""
EARLIER = (
    "no map",
    "no trips: fleet",
    "no version in use",
    "too few trips",
    "times of departure are missing",
    "missing package: pyvalhalla",
    "no vehicles",
)
"""What ends a command before it comes to the file: here are no map, no fleet and no trips, and perhaps no Valhalla to build a map with."""
WITH = {
    "stations": ("--map", "nowhere"),
    "store add data": ("--car", "nissan_leaf_24"),
    **dict.fromkeys(("fleet choose routes", "fleet choose climate"), ("--car", "vw_id3")),
}
"""Options without which another one is not read."""
OTHERS = {
    "paths": "trip.csv",
    "data": "trip.csv",
    "trip": "trip.csv",
    "trips": "trip.csv",
    "file": "trip.csv",
    "extract": "trip.csv",
    "distance": "50",
    "vehicle": "nissan_leaf_24",
    "mqtt": "mqtt://localhost:1",
    "service": "here",
    "source": "plain",
    "new car": "another",
}
"""Required values beside the strange one; elsewhere their own name."""


def commands(command: Any, names: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    inner = getattr(command, "commands", None)
    if inner is None:
        yield names, command
    for name, one in (inner or {}).items():
        yield from commands(one, (*names, name))


def takes_file(parameter: Any) -> bool:
    is_named = any(part in (parameter.metavar or "") for part in OF_FILES)
    return type(parameter.type).__name__ == "TyperPath" or is_named


ALL = [
    (names, command, parameter)
    for names, command in commands(typer.main.get_command(app))
    for parameter in command.params
    if takes_file(parameter)
]
CASES = list({(case[2].name, case[2].metavar, case[2].help): case for case in reversed(ALL)}.values())
"""An option that several commands share is tried in the first of them."""


def line(names: tuple[str, ...], command: Any, strange: Any, value: Path) -> list[str]:
    """The shortest command with this value."""
    full = f"{' '.join(names)} {strange.name}"
    options: list[str] = [*WITH.get(strange.name, ()), *WITH.get(full, ())]
    arguments = []
    for one in command.params:
        if one is not strange and not one.required and one.name != "distance":
            continue
        given = (
            f"{value}"
            if one is strange
            else OTHERS.get(f"{names[-1]} {one.name}", OTHERS.get(one.name, one.name))
        )
        if one.param_type_name == "argument":
            arguments.append(given)
        else:
            options += [one.opts[0], given]
    return [*names, *options, *arguments]


def in_time(seconds: float, *arguments: str) -> Answer:
    def late(*_: object) -> None:
        raise RuntimeError(f"longer than {seconds} s")  # an exit code of 70

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        return answered(*arguments)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def strange(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    place = tmp_path_factory.mktemp("strange")
    os.mkfifo(place / "pipe")
    (place / "circle").symlink_to(place / "circle")
    (place / "folder").mkdir()
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(f"{place / 'socket'}")
    return {
        "device": Path("/dev/zero"),
        **{name: place / name for name in ("pipe", "circle", "socket", "folder")},
    }


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("here")
    rows = "".join(f"{t},10,360,20,{0.9 - t / 1e5}\n" for t in range(60))
    (made / "trip.csv").write_text(f"time_s,speed_m_s,voltage_v,current_a,soc\n{rows}")
    assert answered("store", "create", made / "store").code == 0
    assert answered("car", "new", made / "car", "--car", "nissan_leaf_24").code == 0
    return made


@pytest.fixture(autouse=True)
def here(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def test_every_kind_of_command_is_tried() -> None:
    tried = {names[0] for names, _, _ in CASES}
    assert {"evaluate", "fit", "forecast", "serve", "map", "mapping", "store", "fleet", "car"} <= tried
    assert len(CASES) > 40


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes as files")
@pytest.mark.parametrize(
    ("names", "command", "parameter"), CASES, ids=[f"{' '.join(n)} {p.name}" for n, _, p in CASES]
)
def test_a_strange_file_ends_a_command_with_one_message(
    names: tuple[str, ...], command: Any, parameter: Any, strange: dict[str, Path]
) -> None:
    imported = False
    for kind, place in strange.items():
        if kind == "folder" and parameter.metavar not in ONLY_FILES:
            continue
        given = line(names, command, parameter, place)
        answer = in_time(LONGEST_S if imported else 60.0, *given)  # the first one imports what it needs
        imported = True
        assert answer.code == 2, (kind, given, answer.err)
        assert len(answer.err) < 2000, given
        assert f"{place}" in answer.err or any(why in answer.err for why in EARLIER), (given, answer.err)


FAKED = "a\nfaked: \x1b[2J\r\u2028b"
"""A name that fakes a line of output and steers a terminal."""


@pytest.mark.parametrize(
    "command",
    [
        ("example-trip", "--out", "{new}"),
        ("audit", "{file}"),
        ("audit", "{folder}"),
        ("audit", "{missing}"),
        ("audit", "{torn}"),
        ("forecast", "{file}", "--soc", "0.8"),
        ("forecast", "{torn}"),
        ("mapping", "suggest", "{file}"),
        ("mapping", "suggest", "{file}", "--out", "{new}"),
        ("mapping", "apply", "{torn}", "--out", "{new}"),
        ("mapping", "apply", "{file}", "--out", "{folder}"),
        ("simulate", "{file}", "--car", "bmw_i3_60ah"),
        ("simulate", "{file}", "--car", "{new}"),
        ("car", "new", "{car}", "--car", "vw_id3"),
        ("car", "add", "{car}", "{file}"),
        ("inspect", "{folder}"),
        ("example-trip", "--out", "{folder}"),
    ],
)
def test_no_name_of_a_file_fakes_a_line_or_steers_a_terminal(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    folder = tmp_path / f"folder {FAKED}"
    folder.mkdir()
    names = {name: folder / f"{name} {FAKED}.csv" for name in ("file", "torn", "missing", "new", "car")}
    sample_trips().trips[0].samples.to_csv(names["file"], index=False)
    names["torn"].write_text("time_s,speed_m_s\n0,1\n0,x\n")
    answer = answered(*(part.format(folder=folder, **names) for part in command))
    printed = answer.out + answer.err
    assert printed.isprintable() or not {*printed} & {"\x1b", "\r", "\u2028"}
    assert not [line for line in printed.splitlines() if line.startswith("faked")]
