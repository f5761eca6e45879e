"""Targets of the fuzzer and of the killer: the inputs and the outputs of the project as a table.

`TARGETS` has a line for each kind of bytes that comes from outside, with sound examples and a function that reads them. A new
source of bytes gets a line here; the gate runs a small number of mutants of each, `make bars` many.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import shutil
import tempfile
import time
import traceback
import urllib.parse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import orjson
import pandas as pd
from tests.support.bombs import zipped
from tests.support.router_server import write_map
from tests.support.service_fuzz import mutant, seeds

import tripwatt as tw
from tripwatt.errors import InvalidInput, or_none
from tripwatt.fleet import batch
from tripwatt.fleet.nights import read_planned
from tripwatt.forecasting import ForecastModel, load_model
from tripwatt.forecasting.plausible import battery_wh
from tripwatt.forecasting.storage import model_folder
from tripwatt.modelfile import read_model, write_model
from tripwatt.roads.maps.folder import INDEX_NAME, INFO_NAME, open_map
from tripwatt.routes import parse_route
from tripwatt.server.cars.car import Car
from tripwatt.server.cars.car_file import text_of
from tripwatt.server.cars.folder import setting_of
from tripwatt.server.cars.telemetry import Sample, sample_from_abrp
from tripwatt.server.cars.topics import TopicJoiner
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.settings import Limits
from tripwatt.sources.archives import unpack
from tripwatt.sources.canonical import read_canonical
from tripwatt.sources.mapping import parse_mapping
from tripwatt.sources.tum import read_overview
from tripwatt.vehicles import load_vehicle

LONGEST_S: Final = 10.0
"""A mutant that takes longer is a hang."""

Read = Callable[[bytes, Path], Any]
Rebuild = Callable[[bytes, np.random.Generator], bytes]


@dataclass(frozen=True)
class Target:
    """One kind of input.

    Attributes
    ----------
    examples : callable
        Makes sound examples.
    read : callable
        Reads bytes, with a folder for a file of them; returns nothing or a forecast.
    """

    examples: Callable[[], Sequence[bytes]]
    read: Read


@dataclass
class Found:
    """What became of the mutants of a target."""

    mutants: int = 0
    read: int = 0
    slowest_s: float = 0.0
    wrong: list[str] = field(default_factory=list)


def absurd(forecast: Any) -> str:
    """What cannot be in a forecast; empty where nothing is."""
    document = forecast.to_dict()
    energy = document["energy_wh"]
    scalars = [
        energy,
        document["soc_arrival"],
        *document["quantiles_wh"].values(),
        *document["p_arrive_by_soc"].values(),
    ]
    if not all(math.isfinite(value) for value in scalars):
        return "a number that is not finite"
    if not all(0.0 <= p <= 1.0 for p in (document["soc_arrival"], *document["p_arrive_by_soc"].values())):
        return "a charge or a probability beyond 0 and 1"
    if not forecast.plan.has_road and energy < 0.0:
        return f"{energy:.0f} Wh on a level road"
    codes = {flag["code"] for flag in document["flags"]}
    if (
        energy > 1.15 * battery_wh(forecast.drive)
        and document["soc_arrival"] > 0.0
        and "battery_empty" not in codes
    ):
        return f"{energy:.0f} Wh without an empty battery"
    return ""


def _file(name: str, read: Callable[[Path], Any]) -> Read:
    def from_file(content: bytes, folder: Path) -> Any:
        path = folder / name
        path.write_bytes(content)
        return read(path)

    return from_file


def _trip() -> pd.DataFrame:
    time = np.arange(120.0)
    return pd.DataFrame(
        {"time_s": time, "speed_m_s": 10.0 - 10.0 * np.cos(time / 9.0), "elevation_m": 500.0 + time / 10}
    )


def _parquet() -> bytes:
    buffer = io.BytesIO()
    _trip().to_parquet(buffer)
    return buffer.getvalue()


def _sheet() -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    assert book.active is not None
    book.active.append(["Trip", "Date", "Weather", "Target Cabin Temperature", "Note"])
    book.active.append(["TripA01", "2019-06-25_13-21-14", "sunny", 23, "+ 80 kg"])
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


def _toml() -> bytes:
    import importlib.resources as resources

    return (resources.files("tripwatt.vehicles") / "data" / "bmw_i3_60ah.toml").read_bytes()


_MAPPING: Final = b'[columns]\ntime_s = {column = "t", unit = "s"}\nspeed_m_s = {column = "v", unit = "mph"}\n[file]\ndecimal = "."\n'


def _forecast_route(content: bytes, folder: Path) -> Any:
    del folder
    from tripwatt.routes import Track

    route = parse_route(content)
    plan = route.plan(speed_m_s=14.0) if isinstance(route, Track) and route.needs_speed else route.plan()
    return _model().forecast(plan)


def _forecast_samples(path: Path) -> Any:
    return _model().forecast(tw.read_route(path))


def _update(path: Path) -> Any:
    plan = tw.read_route([{"length_m": 9000.0, "speed_m_s": 15.0}])
    return (
        _model()
        .forecast(plan, tw.Departure(soc=0.8))
        .update(read_canonical(path, required=("time_s",), minimum=2))
    )


_LOADED: Final[list[ForecastModel]] = []


def _model() -> ForecastModel:
    if not _LOADED:
        _LOADED.append(load_model())
    return _LOADED[0]


def _job(kind: str) -> Read:
    def run(content: bytes, folder: Path) -> Any:
        del folder
        jobs = Jobs({"model": _model()}, Limits())
        orjson.dumps(jobs.run(kind, content, speed_m_s=14.0))

    return run


def _requests(path: str) -> Callable[[], Sequence[bytes]]:
    return lambda: [
        body for uploads in seeds().values() for place, body in uploads if place.partition("?")[0] == path
    ]


def _uploads(kind: str) -> Callable[[], Sequence[bytes]]:
    return lambda: [body for place, body in seeds()[kind] if place.startswith("/v1/routes")]


LIVE_S: Final = 1_700_000_000.0
MESSAGE: Final = {
    "utc": LIVE_S,
    "speed": 72,
    "power": "11.1",
    "soc": 65,
    "ext_temp": 4.5,
    "lat": 48.1,
    "lon": 11.5,
}
METRICS: Final = (
    ("ovms", b"ovms/me/leaf/metric/v/p/speed\n72.5"),
    ("ovms", b"ovms/me/leaf/metric/m/time/utc\n1700000003"),
    ("ovms", b"ovms/me/leaf/metric/v/c/charging\nno"),
    ("teslamate", b"teslamate/cars/1/power\n-7"),
    ("teslamate", b"teslamate/cars/1/shift_state\nP"),
    ("abrp", b"car/abrp\n" + orjson.dumps(MESSAGE)),
)
ROOTS: Final = {"ovms": "ovms/me/leaf/metric", "teslamate": "teslamate/cars/1", "abrp": "car/abrp"}


def _telemetry_bodies() -> list[bytes]:
    form = urllib.parse.urlencode({"token": "abc", "tlm": json.dumps(MESSAGE)}).encode()
    return [orjson.dumps({"token": "abc", "tlm": MESSAGE}), form, orjson.dumps(MESSAGE)]


def _telemetry(content: bytes, folder: Path) -> None:
    """As the service takes a body of either kind; what it accepts is on disk, once."""
    from tripwatt.server.http.car_endpoints import message_of, telemetry_of
    from tripwatt.server.http.openapi import FORM, JSON
    from tripwatt.server.http.problems import Problem

    for kind in (JSON, FORM):
        try:
            sample = sample_from_abrp(telemetry_of(message_of(content, kind)))
        except (Problem, InvalidInput):
            continue
        _kept_once(folder / "by-body", sample)


def _mqtt(content: bytes, folder: Path) -> None:
    """As a message of each source: its first line is the topic."""
    topic, _, payload = content.partition(b"\n")
    for name, root in ROOTS.items():
        joiner = TopicJoiner(name, root)
        for k, (source, example) in enumerate(METRICS):
            if source == name:
                joiner.take(*_message(example), LIVE_S + k)
        for k in range(3):
            arrives = LIVE_S + 100.0 + k
            take = partial(joiner.take, topic.decode("utf-8", "replace"), payload, arrives, retained=k == 2)
            for read in (take, joiner.flush):
                sample = or_none(read)
                if sample is not None:
                    _kept_once(folder / "by-topic", sample)


def _message(example: bytes) -> tuple[str, bytes]:
    topic, _, payload = example.partition(b"\n")
    return topic.decode(), payload


MAX_MESSAGES: Final = 300


def _kept_once(place: Path, sample: Sample) -> None:
    """A sample that a car took is there after it was opened again, and counts once. One with many is put away: each opening reads them."""
    with Car.follow(place) as car:
        many = len(car.file.messages()) > MAX_MESSAGES
    if many:
        shutil.rmtree(place)
    with Car.follow(place) as car:
        taken = car.record(sample, now_s=sample.time_s) == "new"
    with Car.follow(place) as car:
        again = car.record(sample, now_s=sample.time_s)
    assert not (taken and again == "new"), f"an acknowledged sample is lost: {sample}"


def _live_folder(folder: Path) -> Path:
    place = folder / "leaf"
    shutil.rmtree(place, ignore_errors=True)
    (place / "live" / "trips").mkdir(parents=True)
    return place


def _journal_lines() -> list[bytes]:
    drive = [Sample(LIVE_S + k, {"speed_m_s": 15.0, "displayed_soc": 0.6}) for k in range(60)]
    lines = "".join(f"{text_of(sample)}\n" for sample in drive).encode()
    return [
        lines,
        b'{"after_s":1699999999.0}\n' + lines,
        lines + f"{text_of(Sample(LIVE_S + 61.0, charging=True))}\n".encode(),
    ]


def _journal(content: bytes, folder: Path) -> None:
    """A car whose older version wrote this journal opens; what it takes then is there after it was opened again."""
    place = _live_folder(folder)
    (place / "live" / "journal.ndjson").write_bytes(content)
    with Car.follow(place) as car:
        whole = {sample.time_s for sample in car.file.messages()}
        newest = max(whole, default=LIVE_S)
    with Car.follow(place) as car:
        assert {sample.time_s for sample in car.file.messages()} == whole, "what was recovered is lost"
    _kept_once(place, Sample(min(newest + 7.0, LIVE_S + 1e6), {"speed_m_s": 3.0}))


def _live_file(name: str) -> Read:
    """A file of a car's folder: a finished trip, a plan or a token that somebody changed."""

    def read(content: bytes, folder: Path) -> None:
        place = _live_folder(folder)
        (place / "live" / name).write_bytes(content)
        with Car.follow(place) as car:
            setting_of(place, "token")
            if car.plan is not None:
                with contextlib.suppress(InvalidInput):
                    assert car.plan.road.duration_s > 0.0
            car.usual_trip_at(LIVE_S + 86_400.0)
            car.logs()

    return read


def _map_file(name: str) -> Read:
    """A file of a map's folder that somebody changed: its facts, or its index of places."""

    def read(content: bytes, folder: Path) -> None:
        place = folder / "map"
        shutil.rmtree(place, ignore_errors=True)
        write_map(place)
        (place / name).write_bytes(content)
        made = open_map(place)
        assert isinstance(made.covers, str)
        found = [*made.index.search("Westend"), *made.index.settlements(46.0, 8.0, 48.0, 10.0, 9)]
        assert all(math.isfinite(one.latitude_deg + one.longitude_deg) for one in found)
        made.index.stations()

    return read


def _map_files(name: str) -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        return [(write_map(Path(folder) / "map") / name).read_bytes()]


def _unpacked(name: str) -> Read:
    def read(content: bytes, folder: Path) -> None:
        with tempfile.TemporaryDirectory(dir=folder) as tables:
            unpack(name, Path(tables), content=content)

    return read


def _archives() -> list[bytes]:
    csv = _trip().to_csv(index=False).encode()
    return [zipped({"a.csv": csv, "b.xlsx": _sheet(), "c.parquet": _parquet()}), zipped({"a.csv": csv}, 0)]


OBSERVED: Final = b"time_s,voltage_v,current_a,soc\n0,360,3,0.8\n1,361,9,0.8\n2,355,40,0.79\n40,358,20,0.78\n"


def _links_of_a_fleet() -> list[bytes]:
    table = pd.DataFrame({"trip": ["a", "a", "b"], "vehicle_id": "v", "length_m": 900.0, "speed_m_s": 14.0})
    buffer = io.BytesIO()
    table.to_parquet(buffer)
    return [buffer.getvalue()]


def _fleet_links(path: Path) -> None:
    """As a batch reads its input, up to the rows of each trip."""
    with batch._open_parquet(path) as file:
        for part in batch._split_into_parts(batch._read_batches(file, path)):
            batch._to_arrow_stream(part)


def _planned_trips() -> list[bytes]:
    table = pd.DataFrame(
        {
            "trip": ["a", "b"],
            "vehicle_id": "v",
            "departs_at": "2026-01-12T07:30+01:00",
            "distance_km": 9.0,
            "soc": 0.8,
        }
    )
    buffer = io.BytesIO()
    table.to_parquet(buffer)
    return [buffer.getvalue()]


TARGETS: Final[Mapping[str, Target]] = MappingProxyType(
    {
        "GPX": Target(_uploads("application/gpx+xml"), _forecast_route),
        "KML": Target(_uploads("application/vnd.google-earth.kml+xml"), _forecast_route),
        "router responses, GeoJSON and links": Target(_uploads("application/json"), _forecast_route),
        "samples as CSV": Target(
            lambda: [_trip().to_csv(index=False).encode()], _file("t.csv", _forecast_samples)
        ),
        "links of a fleet": Target(_links_of_a_fleet, _file("links.parquet", _fleet_links)),
        "planned trips of a fleet": Target(
            _planned_trips, _file("planned.parquet", lambda path: read_planned(path) and None)
        ),
        "samples as Parquet": Target(lambda: [_parquet()], _file("t.parquet", _forecast_samples)),
        "measured so far": Target(lambda: [OBSERVED], _file("o.csv", _update)),
        "sheet": Target(
            lambda: [_sheet()], _file("Overview.xlsx", lambda path: read_overview(path, ["TripA01"]) and None)
        ),
        "car": Target(lambda: [_toml()], _file("car.toml", lambda path: load_vehicle(path) and None)),
        "mapping": Target(
            lambda: [_MAPPING], lambda raw, _: parse_mapping(raw.decode("utf-8", "replace"), "m") and None
        ),
        "forecast request": Target(_requests("/v1/forecast"), _job("forecast")),
        "update request": Target(_requests("/v1/forecast/update"), _job("update")),
        "uploads": Target(_requests("/v1/routes"), _job("route")),
        "message of a car": Target(_telemetry_bodies, _telemetry),
        "topic and payload of a car": Target(lambda: [example for _, example in METRICS], _mqtt),
        "journal of a car": Target(_journal_lines, _journal),
        "finished trip of a car": Target(
            lambda: [_trip().to_csv(index=False).encode()], _live_file("trips/20231114T221320Z.csv")
        ),
        "plan of a car": Target(
            lambda: [b'{"given_s": 1700000000.0, "departure_s": null, "request": {"links": []}}'],
            _live_file("plan.json"),
        ),
        "facts of a map": Target(lambda: _map_files(INFO_NAME), _map_file(INFO_NAME)),
        "places of a map": Target(lambda: _map_files(INDEX_NAME), _map_file(INDEX_NAME)),
        "workbook of logs": Target(lambda: [_sheet()], _unpacked("a.xlsx")),
        "archive of logs": Target(_archives, _unpacked("a.zip")),
        "token of a car": Target(lambda: [b'{"sha256": "00ff"}'], _live_file("token.json")),
    }
)
"""Kinds of input by name. Model files have `forged_models`, heads and connections `service_attacks.ATTACKS`."""


def fuzz(name: str, mutants: int, seed: int = 0) -> Found:
    """Read mutants of the examples of a target; whatever is no `InvalidInput` and no sane result is noted."""
    target, found = TARGETS[name], Found()
    rng = np.random.default_rng([seed, sorted(TARGETS).index(name)])
    examples = list(target.examples())
    with tempfile.TemporaryDirectory() as folder, np.errstate(all="ignore"):
        for number in range(mutants):
            body = mutant(examples[number % len(examples)], rng)
            _read_one(lambda body=body: target.read(body, Path(folder)), found, f"{body[:300]!r}")
    return found


def _read_one(read: Callable[[], Any], found: Found, what: str) -> None:
    found.mutants += 1
    started = time.perf_counter()
    try:
        forecast = read()
        if forecast is not None and (fault := absurd(forecast)):
            found.wrong.append(f"{fault}: {what}")
        found.read += 1
    except (InvalidInput, Problem):
        pass
    except Exception:
        found.wrong.append(f"{traceback.format_exc()[-600:]}: {what}")
    seconds = time.perf_counter() - started
    found.slowest_s = max(found.slowest_s, seconds)
    if seconds > LONGEST_S:
        found.wrong.append(f"{seconds:.0f} s: {what}")


def forge(folder: Path, part: str, change: Callable[[Any], object]) -> Path:
    """The model of the package with one part changed and all digests computed again."""
    sound = read_model(model_folder())
    parts = {n: json.loads(json.dumps(p)) if n.endswith(".json") else dict(p) for n, p in sound.parts.items()}
    change(parts[part])
    write_model(folder / "m", {"provenance": {}}, parts)
    return folder / "m"


def forged_models(number: int, seed: int = 0) -> Found:
    """Load and use models of which a value, an array or a part was changed and every digest computed again."""
    from tripwatt.modelfile import read_model, write_model

    found, rng = Found(), np.random.default_rng(seed)
    sound = read_model(model_folder())
    metadata = {
        k: v for k, v in sound.metadata.items() if k not in ("format", "format_version", "parts", "sha256")
    }
    plan = tw.read_route([{"length_m": 9000.0, "speed_m_s": 15.0}])
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(number):
            parts, what = forged(sound.parts, rng)
            place = Path(folder) / "m"
            try:
                write_model(place, metadata, parts)
            except (ValueError, InvalidInput):
                continue  # JSON cannot hold it

            def use() -> Any:
                load_model(Path(folder) / "m").forecast(plan)

            _read_one(use, found, what)
    return found


def forged(parts: Mapping[str, Any], rng: np.random.Generator) -> tuple[dict[str, Any], str]:
    """Parts of a model with one thing changed, and what it is."""
    name = sorted(parts)[int(rng.integers(len(parts)))]
    kept = {n: json.loads(json.dumps(p)) if n.endswith(".json") else dict(p) for n, p in parts.items()}
    if rng.random() < 0.05:
        del kept[name]
        return kept, f"{name} is missing"
    if name.endswith(".json"):
        where = _change_value(kept[name], rng)
        return kept, f"{name}: {where}"
    array = sorted(kept[name])[int(rng.integers(len(kept[name])))]
    kept[name][array], how = _changed_array(kept[name][array], rng)
    if kept[name][array] is None:
        del kept[name][array]
    return kept, f"{name}, {array}: {how}"


VALUES: Final = (None, -1, 0, 1e308, -1e308, 10**400, "", "x", [], {}, True, [[]], 1e-320)


def _change_value(document: Any, rng: np.random.Generator) -> str:
    path = ""
    while True:
        keys = list(document) if isinstance(document, dict) else list(range(len(document)))
        key = keys[int(rng.integers(len(keys)))]
        path += f".{key}"
        if isinstance(document[key], dict | list) and document[key] and rng.random() < 0.85:
            document = document[key]
            continue
        choice = int(rng.integers(len(VALUES) + 1))
        if choice == len(VALUES):
            del document[key]
            return f"{path} is missing"
        document[key] = VALUES[choice]
        return f"{path} = {str(VALUES[choice])[:20]}"


def _changed_array(values: Any, rng: np.random.Generator) -> tuple[Any, str]:
    changed = values.copy()
    match int(rng.integers(7)):
        case 0:
            return None, "is missing"
        case 1:
            return changed[:-1], "is shorter"
        case 2:
            return changed.reshape(-1), "is flat"
        case 3:
            return changed.astype("U20"), "is text"
        case 4 if changed.dtype.kind == "i":
            changed.flat[int(rng.integers(changed.size))] = int(rng.integers(-9, 9))
            return changed, "has another number"
        case 5:
            return np.zeros((0, *changed.shape[1:]), dtype=changed.dtype), "is empty"
        case _:
            if changed.dtype.kind == "f":
                changed.flat[int(rng.integers(changed.size))] = rng.choice(
                    [math.nan, math.inf, 1e308, -1e300]
                )
                return changed, "has a strange number"
            return changed[::-1], "is reversed"
