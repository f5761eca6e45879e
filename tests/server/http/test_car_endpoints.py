"""Cars that learn, through a service: made, given logs of any logger, shown, forecast by, and erased without a trace."""

from __future__ import annotations

import io
import os
import sys
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pytest
from tests.sources.test_loggers import WHOLE_UNITS, charge, written
from tests.sources.test_suggest import drive
from tests.support.bombs import BOMBS
from tests.support.full_disk import full_disk
from tests.support.service_attacks import seen_by_another
from tests.support.service_process import Service, serving
from tests.support.service_schema import conformance

import tripwatt as tw
from tripwatt.errors import InvalidInput
from tripwatt.hybrid.factors import NAMES, UNITS
from tripwatt.hybrid.learning import KINDS
from tripwatt.server.cars.folder import create_car, open_car
from tripwatt.server.http.car_jobs import CarJobs
from tripwatt.server.http.car_schemas import LogsRequest
from tripwatt.server.http.problems import Problem
from tripwatt.study.synthetic import synthetic_fleet

BYTES = {"content-type": "application/octet-stream"}
TRIPS = 5
LINKS = [{"length_m": 9000.0, "speed_m_s": 16.0}, {"length_m": 6000.0, "speed_m_s": 25.0}]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cars")


@pytest.fixture(scope="module")
def service(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    place = tmp_path_factory.mktemp("service")
    with serving(place, "--workers", "1", "--cars", f"{folder}") as found:
        yield found


def logs_of(count: int = TRIPS) -> dict[str, bytes]:
    """Synthetic trips as tables with our names."""
    names = [
        "time_s",
        "speed_m_s",
        "voltage_v",
        "current_a",
        "soc",
        "elevation_m",
        "ambient_temperature_degc",
    ]
    return {
        f"{trip.trip_id}.csv": trip.samples[[n for n in names if n in trip.samples]]
        .to_csv(index=False)
        .encode()
        for trip in synthetic_fleet(count).logs
    }


def archive(files: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in files.items():
            made.writestr(name, content)
    return packed.getvalue()


def new_car(service: Service, name: str, vehicle: str = "bmw_i3_60ah") -> dict[str, Any]:
    response = service.client.post("/v1/cars", json={"name": name, "car": vehicle})
    assert response.status_code == 200, response.text
    found: dict[str, Any] = response.json()
    assert response.headers["location"] == f"/v1/cars/{found['car']}"
    return found


def put(service: Service, car: str, upload: str, name: str, content: bytes) -> Any:
    return service.client.put(f"/v1/cars/{car}/uploads/{upload}/{name}", content=content, headers=BYTES)


def logs(service: Service, car: str, upload: str, **more: Any) -> dict[str, Any]:
    response = service.client.post(f"/v1/cars/{car}/uploads/{upload}", json=more)
    assert response.status_code == 200, response.text
    found: dict[str, Any] = response.json()
    return found


def learned(service: Service, car: str, upload: str, **more: Any) -> dict[str, Any]:
    """The car after it has learned an upload."""
    response = service.client.post(f"/v1/cars/{car}/uploads/{upload}/learn", json=more)
    assert response.status_code == 200, response.text
    assert response.json()["learning"]["state"] in ("running", "done")
    for _ in range(600):
        answer = service.client.get(f"/v1/cars/{car}")
        assert answer.status_code == 200, answer.text
        found: dict[str, Any] = answer.json()
        if found["learning"]["state"] != "running":
            return found
        time.sleep(0.1)
    raise AssertionError


def test_a_car_learns_an_archive_forecasts_and_is_forgotten(service: Service, folder: Path) -> None:
    made = new_car(service, "my-i3")
    assert (made["trips"], made["in_diary"], made["diary"], made["learning"]) == (0, 0, [], None)
    assert made["learned"] == made["experts"] == {}
    request = {"links": LINKS, "soc": 0.9, "ambient_temperature_degc": 8.0, "car": "my-i3"}
    by_book = service.client.post("/v1/forecast", json=request).json()
    files = logs_of()
    assert put(service, "my-i3", "upload01", "logs.zip", archive(files)).json()["files"] == TRIPS
    preview = logs(service, "my-i3", "upload01")["preview"]
    fleet = synthetic_fleet(TRIPS)
    energy = sum(trip.observed_energy_wh or 0.0 for trip in fleet.logs)
    assert (preview["logs"], preview["drives"]) == (TRIPS, TRIPS)
    assert preview["energy_wh"] == pytest.approx(energy, rel=0.02)
    car = learned(service, "my-i3", "upload01")
    learning = car["learning"]
    assert (learning["state"], learning["added"], learning["known"], learning["entries"]) == (
        "done",
        TRIPS,
        0,
        TRIPS,
    )
    assert [entry["trips_learned"] for entry in car["diary"]] == [4, 3, 2, 1, 0]
    assert {entry["started_at"] for entry in car["diary"]} == {None}, "these tables have no dates"
    assert car["score"]["trips"] == car["latest"]["trips"] == TRIPS
    assert list(car["learned"]) == list(NAMES)
    for name, factor in car["learned"].items():
        assert (sorted(factor), factor["unit"]) == (["change", "sd", "seen_degc", "unit"], UNITS[name])
        assert 0.0 < factor["sd"] < 2.0
    assert list(car["experts"]) == list(KINDS)
    assert sum(car["experts"].values()) == pytest.approx(1.0)
    own = open_car(folder / "my-i3")
    assert car["score"] == own.diary.score.to_dict()
    found = service.client.post("/v1/forecast", json=request).json()
    assert found["energy_wh"] != by_book["energy_wh"]
    plan = tw.read_route(LINKS)
    departure = tw.Departure(soc=0.9, ambient_temperature_degc=8.0)
    assert found["energy_wh"] == pytest.approx(own.model().forecast(plan, departure).energy_wh, rel=1e-9)
    assert not any((folder / "my-i3" / "uploads").iterdir())
    # a second time, with one more file: the known ones are not counted twice
    more = {**files, "new.csv": logs_of(TRIPS + 1)[sorted(logs_of(TRIPS + 1))[-1]]}
    put(service, "my-i3", "upload02", "more.zip", archive(more))
    again = learned(service, "my-i3", "upload02")["learning"]
    assert (again["added"], again["known"], again["entries"]) == (1, TRIPS, 1)
    listed = service.client.get("/v1/cars").json()["cars"]
    assert [(row["name"], row["trips"], row["has_token"]) for row in listed if row["name"] == "my-i3"] == [
        ("my-i3", TRIPS + 1, False)
    ]
    assert service.client.delete("/v1/cars/my-i3").json() == {"forgotten": "my-i3"}
    assert not (folder / "my-i3").exists()
    assert service.client.get("/v1/cars/my-i3").status_code == 404
    refused = service.client.post("/v1/forecast", json=request)
    assert refused.status_code == 422
    assert refused.json()["faults"][0]["what"] == "unknown car"


@pytest.mark.parametrize("logger", ["leaf_spy", "german"])
def test_an_export_is_read_as_the_drive_that_it_is(service: Service, tmp_path: Path, logger: str) -> None:
    """One with a shipped mapping and one without; `tests/sources/test_loggers.py` has them all."""
    car = f"by-{logger.replace('_', '-')}"
    new_car(service, car, "nissan_leaf_24")
    put(service, car, "exports1", f"{logger}.csv", written(tmp_path, logger).read_bytes())
    found = logs(service, car, "exports1")
    d = drive()
    energy = float(np.trapezoid(d.u * d.i, d.t)) / 3600.0
    step = WHOLE_UNITS.get(logger, 0.0) * d.t.iloc[-1] / 3600.0
    assert found["faults"] == []
    (kind,) = found["kinds"]
    assert kind["shipped"] == (None if logger == "german" else logger)
    assert found["preview"]["drives"] == 1
    assert found["preview"]["energy_wh"] == pytest.approx(energy, abs=step, rel=0.01)
    assert not {entry["column"] for entry in kind["mapping"]} & set(kind["unused"])
    has_voltage = "voltage_v" in {entry["ours"] for entry in kind["mapping"]}
    assert set(kind["assumed"]) == (set() if has_voltage else {"nominal_voltage_v"})
    service.client.delete(f"/v1/cars/{car}")


def workbook(table: pd.DataFrame) -> bytes:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(["My drives"])
    sheet.append([])
    sheet.append(list(table.columns))
    for row in table.itertuples(index=False):
        sheet.append(list(row))
    packed = io.BytesIO()
    book.save(packed)
    return packed.getvalue()


def test_columns_are_corrected_and_the_battery_fills_in_what_the_log_lacks(service: Service) -> None:
    new_car(service, "corrected", "nissan_leaf_24")
    d = drive()
    table = pd.DataFrame(
        {
            "t [s]": d.t,
            "GPS speed [km/h]": d.v * 3.6,
            "wheel": d.v * 3.6,
            "SoC [%]": charge(d).round(),
            "note": "x",
        }
    )
    put(service, "corrected", "upload03", "drive.xlsx", workbook(table))
    found = logs(service, "corrected", "upload03")
    (kind,) = found["kinds"]
    by_ours = {entry["ours"]: entry for entry in kind["mapping"]}
    assert by_ours["speed_m_s"]["column"] == "GPS speed [km/h]"
    assert by_ours["speed_m_s"]["why"]
    assert kind["columns"] == list(table.columns)
    assert set(kind["unused"]) == {"wheel", "note"}
    assert kind["assumed"]["usable_capacity_kwh"] == pytest.approx(21.3, rel=0.05)
    assert found["preview"]["drives"] == 1
    assert found["preview"]["energy_wh"] == pytest.approx(3.0 / 100.0 * 21_300.0, rel=0.1)
    change = {"speed_m_s": {"column": "wheel", "unit": "mph"}}
    changed = logs(service, "corrected", "upload03", kinds={"0": {"changes": change}})
    entry = next(e for e in changed["kinds"][0]["mapping"] if e["ours"] == "speed_m_s")
    assert (entry["column"], entry["unit"], entry["why"]) == ("wheel", "mph", "")
    assert changed["preview"]["distance_m"] == pytest.approx(
        1.609344 * found["preview"]["distance_m"], rel=1e-3
    )
    without = logs(service, "corrected", "upload03", kinds={"0": {"changes": {"speed_m_s": None}}})
    assert without["preview"] is None
    assert without["faults"][0]["what"] == "missing key"
    refused = service.client.post(
        "/v1/cars/corrected/uploads/upload03/learn",
        json={"kinds": {"0": {"changes": {"speed_m_s": {"column": "none"}}}}},
    )
    assert refused.status_code == 422
    fault = refused.json()["faults"][0]
    assert (fault["what"], fault["where"], fault["allowed"]) == (
        "missing column",
        "drive.csv",
        "a column 'none'",
    )
    assert service.client.get("/v1/cars/corrected").json()["learning"] is None


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_an_energy_that_the_car_cannot_take_is_held_back_unless_asked_for(
    service: Service, factor: float
) -> None:
    car = f"held-{factor:g}"
    new_car(service, car)
    for log in synthetic_fleet(2).logs:
        table = log.samples.drop(columns=["soc", "displayed_soc"], errors="ignore")
        table = table.assign(current_a=factor * table["current_a"])[::12]  # too rare for the audit
        put(service, car, "upload09", f"{log.trip_id}.csv", table.to_csv(index=False).encode())
    read = logs(service, car, "upload09")
    assert read["preview"]["drives"] == 2
    if factor == 1.0:
        assert read["faults"] == []
        assert learned(service, car, "upload09")["learning"]["entries"] == 2
        return
    (fault,) = read["faults"]
    assert fault["what"] == "implausible energy"
    assert fault["where"] == "logs"
    assert fault["got"].endswith("times the energy of BMW i3 60 Ah")
    refused = service.client.post(f"/v1/cars/{car}/uploads/upload09/learn", json={})
    assert (refused.status_code, refused.json()["faults"][0]["what"]) == (422, "implausible energy")
    assert service.client.get(f"/v1/cars/{car}").json()["learning"] is None
    assert logs(service, car, "upload09", implausible=True)["faults"] == []
    assert learned(service, car, "upload09", implausible=True)["learning"]["entries"] == 2


@pytest.mark.parametrize(
    ("body", "what"),
    [
        ({"name": "", "car": "vw_id3"}, "text too short"),
        ({"name": "none"}, "missing field"),
        ({"name": "number", "car": 3}, "not an object"),
        ({"name": "other", "car": "vw_id33"}, "unknown car"),
        ({"name": "bmw_i3_tum", "car": "vw_id3"}, "name is taken"),
        ({"name": "\U0001f4a5\u202eabc\0x", "car": "vw_id3"}, "control characters"),
    ],
)
def test_what_cannot_be_a_car_is_refused(service: Service, body: dict[str, Any], what: str) -> None:
    if body["name"] == "bmw_i3_tum":
        body = {**body, "name": service.client.get("/v1/models").json()["models"][0]["name"]}
    response = service.client.post("/v1/cars", json=body)
    assert response.status_code == 422, response.text
    assert what in response.json()["faults"][0]["what"]
    assert body["name"] not in [row["name"] for row in service.client.get("/v1/cars").json()["cars"]]


def test_a_car_by_figures_has_a_model_at_once(service: Service) -> None:
    body = {"name": "by-figures", "car": {"mass_kg": 1900.0, "usable_battery_kwh": 70.0}}
    made = service.client.post("/v1/cars", json=body).json()
    assert made["car"]
    request = {"links": LINKS, "soc": 0.9, "car": "by-figures"}
    assert service.client.post("/v1/forecast", json=request).json()["energy_wh"] > 1500.0
    model = service.client.get("/v1/models").json()["models"][0]["name"]
    two = service.client.post("/v1/forecast", json=request | {"model": model}).json()
    assert two["faults"][0]["what"] == "the car has its own model"
    unplanned = service.client.get("/v1/need", params={"car": "by-figures"}).json()
    assert unplanned["type"] == "/problems/no-plan", "it is known without a token"
    (fault,) = service.client.post("/v1/cars", json=body | {"car": 7}).json()["faults"]
    assert (fault["where"], fault["allowed"]) == ("car", "a name or an object")
    (fault,) = service.client.post("/v1/cars/by-figures/uploads/AB", json={}).json()["faults"]
    assert (fault["where"], fault["got"]) == ("path.upload", "'AB'")
    assert fault["fix"] == "8 to 32 small letters and digits, chosen by the client"
    again = service.client.post("/v1/cars", json=body)
    assert (again.status_code, again.json()["type"]) == (409, "/problems/name-taken")
    (fault,) = again.json()["faults"]
    assert (fault["pointer"], "/" in fault["got"]) == ("/name", False)


@pytest.mark.parametrize(
    ("name", "content", "status", "what"),
    [
        ("..%2F..%2Fetc%2Fpasswd", b"time_s,speed_m_s\n", 404, ""),
        ("drive.exe", b"MZ", 422, "no trips"),
        ("empty.zip", {}, 422, "no trips"),
        ("broken.zip", b"PK\x03\x04 and nothing more", 422, "unreadable archive"),
        ("broken.xlsx", b"PK\x03\x04", 422, "unreadable sheet"),
        ("bomb.zip", {"zeros.csv": 300 << 20}, 422, "archive too large"),
    ],
)
def test_files_that_are_no_logs_are_refused_and_leave_nothing(
    service: Service, folder: Path, name: str, content: bytes | dict[str, int], status: int, what: str
) -> None:
    """An archive is named by its files with the zeros that they have."""
    if isinstance(content, dict):
        content = archive({file: b"0" * size for file, size in content.items()})
    if not (folder / "hostile").exists():
        new_car(service, "hostile")
    response = put(service, "hostile", "upload04", name, content)
    assert response.status_code == status, response.text
    if what:
        assert what in response.json()["faults"][0]["what"]
    assert list((folder / "hostile").rglob("uploads/*/tables/*")) == []
    assert sorted(place.name for place in folder.parent.iterdir() if place.name == "passwd") == []


def test_names_in_an_archive_stay_inside_the_upload(service: Service, folder: Path) -> None:
    new_car(service, "inside")
    names = {"../../../evil.csv": b"a", "/abs/evil.csv": b"b", "..\\evil.csv": b"c", "__MACOSX/._x.csv": b"d"}
    assert put(service, "inside", "upload05", "names.zip", archive(names)).json()["files"] == 3
    tables = folder / "inside" / "uploads" / "upload05" / "tables"
    assert sorted(file.name for file in tables.iterdir()) == ["evil 2.csv", "evil 3.csv", "evil.csv"]
    # nothing of it can be read, and the answer says so
    found = service.client.post("/v1/cars/inside/uploads/upload05", json={})
    assert found.status_code == 422 or found.json()["preview"] is None


def test_a_token_makes_the_car_send_at_once(service: Service) -> None:
    new_car(service, "on-road")
    message = {"tlm": {"utc": 1.7e9, "speed": 30.0, "soc": 80.0}, "token": "wrong-token-of-some-length"}
    assert service.client.post("/v1/telemetry", json=message).status_code == 401
    token = service.client.post("/v1/cars/on-road/token").json()["token"]
    sent = service.client.post("/v1/telemetry", json={**message, "token": token})
    assert (sent.status_code, sent.json()["car"]) == (200, "on-road")
    other = service.client.post("/v1/cars/on-road/token").json()["token"]
    assert service.client.post("/v1/telemetry", json={**message, "token": token}).status_code == 401
    assert service.client.post("/v1/telemetry", json={**message, "token": other}).status_code == 200
    assert service.client.delete("/v1/cars/on-road").status_code == 200
    assert service.client.get("/v1/live/on-road").status_code == 404


def test_the_operations_on_cars_conform_to_their_description(service: Service) -> None:
    """Without uploads, whose files schemathesis cannot make up."""
    found = conformance(
        service.url,
        3,
        seed=3,
        only=r"^/v1/cars(/\{car\}(/token)?)?$",
        phases="examples,fuzzing",
        timeout_s=400,
    )
    assert found.clean, found.text


def car_jobs(folder: Path) -> CarJobs:
    create_car(folder / "car", "bmw_i3_60ah")
    return CarJobs(folder)


def test_logs_with_positions_get_the_heights_of_the_map(tmp_path: Path) -> None:
    create_car(tmp_path / "car", "bmw_i3_60ah")
    samples = synthetic_fleet(1).logs[0].samples.drop(columns=["elevation_m", "grade"], errors="ignore")
    way_deg = np.cumsum(samples["speed_m_s"].to_numpy()) / 111_195.0
    content = samples.assign(latitude=47.3, longitude=9.2 + 0.5 * way_deg).to_csv(index=False).encode()
    seen: list[int] = []

    def hill(latitude_deg: np.ndarray, longitude_deg: np.ndarray) -> np.ndarray:
        seen.append(len(latitude_deg))
        return np.full(len(longitude_deg), 500.0)

    own = CarJobs(tmp_path, hill)
    own.store("car", "first001", "a.csv", content, 10**8)
    assert own.logs("car", "first001", LogsRequest())["faults"] == []
    assert own.learn("car", "first001", LogsRequest())["flat"] == 0
    assert seen == [len(samples)] * 2
    (trip,) = open_car(tmp_path / "car").logs()
    assert trip.array("elevation_m") == pytest.approx(np.full(len(samples), 500.0))


def stored(own: CarJobs, place: Path, name: str, content: bytes, max_bytes: int = 3000) -> dict[str, int]:
    return own.store("car", place.name, name, content, max_bytes)


def test_what_waits_to_be_learned_has_a_bound_and_expires(tmp_path: Path) -> None:
    uploads = tmp_path / "car" / "uploads"
    own = car_jobs(tmp_path)
    content = b"time_s,speed_m_s\n" + b"0,1\n" * 200
    assert stored(own, uploads / "first001", "a.csv", content) == {
        "files": 1,
        "bytes": len(content),
    }
    assert stored(own, uploads / "first001", "a.csv", content.replace(b"1", b"2")) == {
        "files": 2,
        "bytes": 2 * len(content),
    }
    assert stored(own, uploads / "second02", "b.csv", content)["files"] == 1
    with pytest.raises(Problem, match="3000 bytes that are not learned"):
        stored(own, uploads / "third003", "c.csv", content)
    assert sorted(place.name for place in uploads.iterdir()) == ["first001", "second02"]
    with pytest.raises(Problem, match="3000 bytes that are not learned"):
        stored(own, uploads / "first001", "d.csv", content)  # those that were sent before stay
    assert sorted(file.name for file in (uploads / "first001" / "tables").iterdir()) == ["a 2.csv", "a.csv"]
    for age_s in (3500.0, 3700.0):
        with pytest.raises(Problem, match="3000 bytes that are not learned"):
            stored(own, uploads / "third003", "c.csv", content)
        old = time.time() - age_s
        for place in (uploads / "first001", *(uploads / "first001").rglob("*")):
            os.utime(place, (old, old))
    assert stored(own, uploads / "third003", "c.csv", content)["files"] == 1
    assert sorted(place.name for place in uploads.iterdir()) == ["second02", "third003"]


def test_a_refused_file_leaves_nothing_and_may_be_sent_again(tmp_path: Path) -> None:
    own = car_jobs(tmp_path)
    place = tmp_path / "car" / "uploads" / "upload08"
    content = b"time_s,speed_m_s\n" + b"0,1\n" * 2000
    packed = archive({"first.csv": b"time_s,speed_m_s\n0,1\n", "t00.csv": content})
    for name, sent in (("t00.csv", content), ("logs.zip", packed)):
        with full_disk(4096), pytest.raises(Problem, match="cannot be stored"):
            stored(own, place, name, sent, 1_000_000)
        assert not [file for file in place.rglob("*") if file.is_file()]
    whole = {"files": 1, "bytes": len(content)}
    assert [stored(own, place, "t00.csv", content, 1_000_000) for _ in range(2)] == [whole, whole]
    # the tables of an earlier request stay when a later one is refused
    with full_disk(4096), pytest.raises(Problem, match="cannot be stored"):
        stored(
            own, place, "more.zip", archive({"t00.csv": content, "t01.csv": content + b"1,1\n"}), 1_000_000
        )
    assert [file.name for file in (place / "tables").iterdir()] == ["t00.csv"]
    (place / "tables" / ".t00.csv.1.1.writing").write_bytes(b"left by a process that was killed")
    assert stored(own, place, "t00.csv", content, 1_000_000) == whole


def test_one_bad_file_costs_no_good_one_and_a_file_can_be_left_out(service: Service) -> None:
    assert new_car(service, "My Model 3")["label"] == "My Model 3"
    car = next(c["name"] for c in service.client.get("/v1/cars").json()["cars"] if c["label"] == "My Model 3")
    good = logs_of(4)
    for name, content in {**good, "empty.csv": b"", "binary.csv": bytes(range(256)) * 8}.items():
        assert put(service, car, "upload06", name, content).status_code == 200
    found = logs(service, car, "upload06")
    states = {file["name"]: (file["state"], bool(file["faults"])) for file in found["files"]}
    assert states == {
        **dict.fromkeys(good, ("read", False)),
        **dict.fromkeys(["empty.csv", "binary.csv"], ("left out", True)),
    }
    assert (found["preview"]["drives"], found["faults"]) == (4, [])
    assert {row["what"]: row["places"] for row in found["report"]}["empty file"] == 1
    first, *rest = good
    ignored = [first, "empty.csv", "binary.csv"]
    again = logs(service, car, "upload06", ignored=ignored)
    assert {f["name"] for f in again["files"] if f["state"] == "ignored"} == set(ignored)
    assert (again["preview"]["drives"], again["report"]) == (3, [])
    assert learned(service, car, "upload06", ignored=ignored)["learning"]["entries"] == len(rest)
    service.client.delete(f"/v1/cars/{car}")


def test_a_bomb_is_refused_while_others_are_served_and_leaves_nothing(service: Service, folder: Path) -> None:
    new_car(service, "bombed")
    before = service.resident_bytes()
    for kind in BOMBS:
        name, content = BOMBS[kind](np.random.default_rng(3))
        refused = put(service, "bombed", "upload09", name, content)
        assert refused.status_code == 422, (kind, refused.text)
        assert refused.json()["faults"][0]["where"].startswith(name), kind
    assert not [file for file in (folder / "bombed" / "uploads").rglob("*") if file.is_file()]
    assert service.resident_bytes() - before < 100e6
    service.client.delete("/v1/cars/bombed")


def test_tables_never_take_more_than_there_is_room_for(tmp_path: Path) -> None:
    own, place = car_jobs(tmp_path), tmp_path / "car" / "uploads" / "upload08"
    with pytest.raises(InvalidInput, match=r"archive too large: a.zip: got 4000 bytes .*at most 3000 bytes"):
        stored(own, place, "a.zip", archive({"a.csv": bytes(4000)}))
    assert stored(own, place, "a.zip", archive({"a.csv": bytes(2000)})) == {"files": 1, "bytes": 2000}
    with pytest.raises(InvalidInput, match="at most 1000 bytes"):
        stored(own, place, "b.zip", archive({"a.csv": bytes(2000)}))


def test_files_of_one_name_that_come_at_once_are_all_kept(tmp_path: Path) -> None:
    own = car_jobs(tmp_path)
    place = tmp_path / "car" / "uploads" / "upload07"
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: stored(own, place, "a.csv", b"%d" % k), range(40)))
    assert sorted(int(file.read_bytes()) for file in (place / "tables").iterdir()) == list(range(40))


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone bounds it")
def test_what_takes_too_much_memory_is_refused_while_others_are_served_and_its_worker_goes_on(
    tmp_path: Path,
) -> None:
    rng, limits = np.random.default_rng(5), ("--limit", "memory_bytes=300_000_000")
    rows = b"".join(rng.bytes(200).hex().encode() * 60 for _ in range(8_000))
    packed = archive({"a.csv": rows})  # 190 MB in 2 MB, within the bounds
    with serving(tmp_path, "--workers", "2", "--cars", f"{tmp_path}", *limits) as service:
        new_car(service, "large")
        workers, after = service.workers(), []
        with ThreadPoolExecutor(1) as pool:
            for _ in range(3):
                seen = pool.submit(seen_by_another, service, 1.0)
                refused = put(service, "large", "upload01", "a.zip", packed)
                assert (refused.status_code, refused.json()["type"]) == (413, "/problems/too-large")
                assert refused.json()["detail"] == "it takes more than 300000000 bytes of memory"
                assert seen.result().wrong == []
                after.append(service.resident_bytes())
        assert service.workers() == workers
        assert after[2] < 1.1 * after[1], "nothing is kept of what was refused"
        assert service.client.post("/v1/cars/large/uploads/upload01", json={}).status_code == 404
        assert put(service, "large", "upload01", "a.zip", archive(logs_of(1))).status_code == 200
