"""The model of a fleet in the service: its vehicles, and the version in use of its registry."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest
from tests.support.service_process import serving

from tripwatt.errors import InvalidInput
from tripwatt.fleet.model import FleetModel
from tripwatt.fleet.registry import Registry
from tripwatt.forecasting.storage import DEFAULT_MODEL, model_folder
from tripwatt.routes import route_from_links
from tripwatt.server.http.fleets import NightResponse
from tripwatt.server.http.jobs import Jobs
from tripwatt.server.http.settings import Limits
from tripwatt.trips import Departure
from tripwatt.vehicles import load_vehicle

LINKS = [{"length_m": 1500.0, "speed_m_s": v} for v in (12.0, 20.0, 15.0)]


def body_of(**fields: Any) -> bytes:
    return orjson.dumps({"links": LINKS, "soc": 0.8, "ambient_temperature_degc": 4.0, **fields})


@pytest.fixture
def registry(fleet: Any, tmp_path: Path) -> Registry:
    registry = Registry(tmp_path / "vans")
    registry.promote(registry.add(fleet[2]))
    return registry


def moved(model: FleetModel) -> FleetModel:
    """Another version: every vehicle takes more."""
    return replace(model, posterior=replace(model.posterior, mean=model.posterior.mean + 0.1))


def energy(model: FleetModel, **vehicle: Any) -> float:
    plan = route_from_links(LINKS).plan()
    return model.forecast(plan, Departure(soc=0.8, ambient_temperature_degc=4.0), **vehicle).energy_wh


def jobs_of(registry: Registry, log: list[dict[str, Any]] | None = None) -> Jobs:
    records = [] if log is None else log
    return Jobs.from_folders({"vans": registry.folder}, Limits(), log=lambda **one: records.append(one))


def fault_of(jobs: Jobs, **fields: Any) -> tuple[str, str]:
    with pytest.raises(InvalidInput) as caught:
        jobs.run("forecast", body_of(**fields))
    (fault,) = caught.value.faults
    return fault.what, fault.where


def test_a_forecast_is_that_of_its_vehicle(fleet: Any, registry: Registry) -> None:
    model: FleetModel = fleet[2]
    jobs = jobs_of(registry)
    jobs.warm_up()
    first, other = (jobs.run("forecast", body_of(car=v))["energy_wh"] for v in ("V00000", "V00002"))
    assert [first, other] == pytest.approx(
        [energy(model, vehicle_id=v) for v in ("V00000", "V00002")], rel=1e-12
    )
    assert first != other
    new = jobs.run("forecast", body_of(model="vans", car="vw_id3"))["energy_wh"]
    assert new == pytest.approx(energy(model, vehicle_id="new", car_model="vw_id3"), rel=1e-12)
    usual = min(model.vehicles().values())
    assert jobs.run("forecast", body_of())["energy_wh"] == pytest.approx(
        energy(model, car_model=usual), rel=1e-12
    )


def test_what_is_no_vehicle_of_the_fleet_is_a_fault(fleet: Any, registry: Registry) -> None:
    jobs = jobs_of(registry)
    assert fault_of(jobs, car="nobody") == ("unknown car", "car")
    assert fault_of(jobs, car={"mass_kg": 1500.0}) == ("not for a fleet", "car")
    assert fault_of(jobs, car=7)[1] == "car"
    assert fault_of(jobs, model="cars")[1] == "model"
    alone = Jobs.from_folders({}, Limits())
    assert fault_of(alone, car="V00000") == ("unknown car", "car")
    assert fault_of(alone, driver="D1") == ("no fleet", "driver")


def test_the_version_in_use_is_followed_and_a_damaged_one_refused(fleet: Any, registry: Registry) -> None:
    model, log = fleet[2], list[dict[str, Any]]()
    jobs = jobs_of(registry, log)

    def answer() -> float:
        return float(jobs.run("forecast", body_of(car="V00000"))["energy_wh"])

    before = answer()
    registry.promote(registry.add(moved(model)))
    after = answer()
    assert (before, after) == pytest.approx(
        (energy(model, vehicle_id="V00000"), energy(moved(model), vehicle_id="V00000")), rel=1e-12
    )
    assert after > 1.001 * before
    registry.promote(registry.add(model))
    (registry.path("0003") / "metadata.json").write_text("{}")
    assert [answer(), answer()] == [after, after]
    changed, refused = log  # once, not at every request
    assert changed == {"event": "model changed", "model": "vans", "version": "0002"}
    assert (refused["event"], refused["version"]) == ("model refused", "0003")
    assert "no model" in refused["reason"]
    assert [m["model"]["version"] for m in jobs.run("summaries")["models"]] == ["0002"]  # type: ignore[index]
    registry._move_pointer("0001")
    assert answer() == before


def test_models_and_fleets_are_listed(fleet: Any, registry: Registry) -> None:
    folders = {"vans": registry.folder, "own": model_folder()}
    jobs = Jobs.from_folders(folders, Limits())
    own, vans = jobs.summaries()["models"]  # a model of one car is the default
    assert (own["name"], own["model"]["car"], vans["name"]) == ("own", "bmw_i3_60ah", "vans")
    of_fleet = jobs.run("forecast", body_of(car="V00000"))["energy_wh"]
    assert of_fleet == jobs.run("forecast", body_of(car="V00000", model="vans"))["energy_wh"]
    assert (vans["model"]["vehicles"], vans["model"]["trips"]) == (8, fleet[2].trips)
    usual = min(fleet[2].vehicles().values())
    assert (vans["model"]["car"], vans["model"]["car_title"]) == (usual, load_vehicle(usual).title)
    listed = {row["name"]: row["models"] for row in jobs.vehicles()["vehicles"]}
    assert [listed["bmw_i3_60ah"], listed["nissan_leaf_24"]] == [["own", "vans"], ["vans"]]
    assert list(Jobs.from_folders({}, Limits()).models) == [DEFAULT_MODEL]


def night(**fields: Any) -> dict[str, Any]:
    trips = [
        {"car": "V00000", "departs_at": "2030-01-12T07:30:00+01:00", "distance_km": 40.0, "soc": 0.1},
        {"car": "V00002", "departs_at": "2030-01-12T08:30:00+01:00", "links": LINKS},
    ]
    return {"trips": trips, "begins_at": "2030-01-11T18:00:00+01:00", **fields}


def asked(jobs: Jobs, **fields: Any) -> dict[str, Any]:
    answer = jobs.run("night", orjson.dumps(night(**fields)))
    assert isinstance(answer, dict)
    return answer


def test_the_night_of_a_fleet_is_that_of_the_library(fleet: Any, registry: Registry) -> None:
    answer = asked(jobs_of(registry), probability=0.9)
    NightResponse.model_validate(answer)
    distance, links = answer["needs"]
    own = fleet[2].forecast(route_from_links(LINKS).plan(), vehicle_id="V00002")
    assert links["energy_quantile_wh"] == pytest.approx(own.quantile(0.9), rel=1e-9)
    assert (links["soc"], links["charge_wh"]) == (None, None)
    assert distance["charge_wh"] > 0.0
    assert answer["emhass"]["vehicles"] == ["V00000"]
    assert answer["evcc"][0].startswith("/api/vehicles/V00000/plan/soc/")


def test_a_trip_with_a_fault_is_left_out_with_its_place(registry: Registry) -> None:
    jobs = jobs_of(registry)
    alone = asked(jobs, trips=night()["trips"][:1])

    def refused(change: dict[str, Any]) -> tuple[str, str]:
        one, other = night()["trips"]
        answer = asked(jobs, trips=[one, {**other, **change}])
        NightResponse.model_validate(answer)
        (fault,) = answer["refused"]
        assert {**answer, "refused": []} == alone
        return fault["what"], fault["where"]

    assert refused({"car": "nobody"}) == ("unknown vehicle", "trips[1].car")
    assert refused({"distance_km": 3.0}) == ("one of them is needed", "trips[1].distance_km, links")
    assert refused({"links": [{"length_m": -1.0, "speed_m_s": 9.0}]})[1].startswith("trips[1].link 1")
    assert refused({"departs_at": "tomorrow"})[1] == "trips[1].departs_at"
    repeated = {"car": "V00000", "departs_at": night()["trips"][0]["departs_at"]}
    assert refused(repeated) == ("the vehicle is not back", "trips[1].departs_at")


def test_a_night_that_cannot_be_planned_is_refused(registry: Registry) -> None:
    jobs = jobs_of(registry)

    def where(**fields: Any) -> list[tuple[str, str]]:
        with pytest.raises(InvalidInput) as caught:
            asked(jobs, **fields)
        return [(fault.what, fault.where) for fault in caught.value.faults]

    assert where(model="cars") == [("no fleet", "model")]
    late = "2030-01-13T18:00:00+01:00"
    assert where(begins_at=late) == [("departs before the charging begins", "V00000")]
    assert where(tariff={late: 0.3}) == [("no price", "tariff")]
    with pytest.raises(InvalidInput) as caught:
        asked(Jobs.from_folders({}, Limits()))
    assert caught.value.faults[0].what == "no fleet"


def test_the_schedule_of_a_night_keeps_the_limit_and_takes_the_cheap_hours(registry: Registry) -> None:
    tariff = {"2030-01-11T18:00:00+01:00": 0.4, "2030-01-12T02:00:00+01:00": 0.1}
    answer = asked(jobs_of(registry), grid_w=3000.0, tariff=tariff)
    NightResponse.model_validate(answer)
    begins = [dt.datetime.fromisoformat(row["begins_at"]) for row in answer["schedule"]]
    assert min(begins) >= dt.datetime.fromisoformat("2030-01-12T02:00:00+01:00")
    assert 0.0 < answer["depot"]["peak_w"] <= 3000.0
    assert answer["depot"]["cost"] == pytest.approx(0.1e-3 * answer["needs"][0]["charge_wh"] / 0.9)
    assert answer["depot"]["fails_first"] is None


def test_files_of_a_report_are_those_of_the_registry(registry: Registry) -> None:
    assert registry.report_file("report.html") is None
    (registry.folder / "report").mkdir()
    (registry.folder / "report" / "report.html").write_bytes(b"<p>")
    (registry.folder / "report" / "secret.txt").write_bytes(b"x")
    assert registry.report_file("report.html") == b"<p>"
    assert [registry.report_file(name) for name in ("secret.txt", "../current")] == [None, None]


@pytest.mark.parametrize("limit", [1, 2, 3, 7, 8])
def test_pages_of_a_list_are_the_list(registry: Registry, limit: int) -> None:
    assert registry.page("vehicles", 5) == {"version": "0001", "about": {}, "rows": [], "next": None}
    (registry.folder / "report").mkdir()
    vehicles = [{"vehicle_id": f"V{k}", "gain": 7 - k} for k in range(7)]
    written = {"about": {"Price": "0.3"}, "vehicles": vehicles, "changes": []}
    (registry.folder / "report" / "report.json").write_bytes(orjson.dumps(written))
    rows, cursor = [], 0
    while cursor is not None:
        page = registry.page("vehicles", limit, cursor)
        rows += page["rows"]
        assert len(page["rows"]) <= limit
        cursor = page["next"]
    assert rows == [{"car": row["vehicle_id"], "gain": row["gain"]} for row in vehicles]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "read_bytes", lambda file: 1 / 0)
        assert registry.page("vehicles", limit)["rows"] == rows[:limit], "the report is read once"
    (registry.folder / "report" / "report.json").write_bytes(orjson.dumps(written | {"vehicles": []}))
    assert registry.page("vehicles", limit)["rows"] == []
    registry.promote(registry.add(registry.load()))
    done = [(row["action"], row["version"]) for row in registry.page("health", 2)["rows"]]
    assert done == [("promote", "0002"), ("add", "0002")]


def test_a_service_follows_its_registry(fleet: Any, registry: Registry, tmp_path: Path) -> None:
    (tmp_path / "log").mkdir()
    place = f"registry:{registry.folder}"
    with serving(tmp_path / "log", place, "--workers", "1") as service:

        def answer() -> float:
            given = {"links": LINKS, "soc": 0.8, "ambient_temperature_degc": 4.0, "car": "V00000"}
            return float(service.forecast(given).json()["energy_wh"])

        before = answer()
        registry.promote(registry.add(moved(fleet[2])))
        (summary,) = service.client.get("/v1/models").json()["models"]
        assert summary["model"]["version"] == "0002"
        assert answer() > 1.001 * before
        assert summary["name"] == "vans"
        assert [r["version"] for r in service.records() if r["event"] == "model changed"] == ["0002"]
        missing = service.client.get("/v1/fleet/report/report.html")
        assert (missing.status_code, missing.json()["type"]) == (404, "/problems/not-found")
        hint = service.client.get("/v1/fleet/report/").json()["detail"]
        assert hint == "the address goes on: /v1/fleet/report/{file}"
        assert "detail" not in service.client.get("/v1/nothing").json()
        (registry.folder / "report").mkdir()
        (registry.folder / "report" / "report.html").write_text("<style>p{}</style><p>of a fleet</p>")
        page = service.client.get("/v1/fleet/report/report.html")
        assert page.headers["content-type"].startswith("text/html")
        assert "style-src 'unsafe-inline'" in page.headers["content-security-policy"]
        assert "default-src 'none'" in page.headers["content-security-policy"]
        again = service.client.get(
            "/v1/fleet/report/report.html", headers={"If-None-Match": page.headers["etag"]}
        )
        assert (page.text, again.status_code) == ("<style>p{}</style><p>of a fleet</p>", 304)
        report = {"about": {}, "vehicles": [{"vehicle_id": "V1"}, {"vehicle_id": "V2"}], "changes": []}
        (registry.folder / "report" / "report.json").write_bytes(orjson.dumps(report))
        first = service.client.get("/v1/fleet/vehicles?limit=1").json()
        assert (first["rows"], first["next"], first["version"]) == ([{"car": "V1"}], 1, "0002")
        second = service.client.get(f"/v1/fleet/vehicles?limit=1&cursor={first['next']}&model=vans").json()
        assert (second["rows"], second["next"]) == ([{"car": "V2"}], None)
        assert service.client.get("/v1/fleet/changes").json()["rows"] == []
        health = service.client.get("/v1/fleet/health").json()["rows"]
        assert health[0]["action"] == "promote"
        refused = {
            path: service.client.get(f"/v1/fleet/{path}").status_code
            for path in (
                "vehicles?cursor=-1",
                "vehicles?limit=9999",
                "vehicles?model=none",
                "drivers",
                "needs",
            )
        }
        assert refused == {
            "vehicles?cursor=-1": 422, "vehicles?limit=9999": 422, "vehicles?model=none": 422, "drivers": 404, "needs": 405,
        }  # fmt: skip
        choice = service.client.get("/v1/fleet/report/choices.json")
        assert choice.status_code == 404
        document = {"choices": [{"route": "r", "car": "V1"}], "chargers": [], "new": None}
        (registry.folder / "report" / "choices.json").write_bytes(orjson.dumps(document))
        assert service.client.get("/v1/fleet/report/choices.json").json() == document
        needs = service.client.post("/v1/fleet/needs", json=night())
        assert (needs.status_code, len(needs.json()["needs"])) == (200, 2)
