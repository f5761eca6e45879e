"""What a job of a worker is told and returns, and how many of each thing it takes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import orjson
import pytest
from cachetools import LRUCache

from tripwatt.errors import Fault, InvalidInput
from tripwatt.forecasting import ForecastModel
from tripwatt.forecasting.storage import DEFAULT_MODEL
from tripwatt.server.http import jobs as room
from tripwatt.server.http.jobs import Jobs, require_finite
from tripwatt.server.http.problems import Problem
from tripwatt.server.http.route_uploads import read_route
from tripwatt.server.http.settings import Limits
from tripwatt.server.http.worker import run_job

LINKS = [{"length_m": 800.0, "speed_m_s": 8.0}, {"length_m": 400.0, "speed_m_s": 8.0}]
CSV = b"time_s,speed_m_s\n5,10\n6,10\n7,12\n"


@pytest.fixture(scope="module")
def jobs() -> Jobs:
    return Jobs.from_folders({}, Limits())


def limited(jobs: Jobs, **limits: Any) -> Jobs:
    return replace(jobs, limits=Limits(**limits))


def faults_of(jobs: Jobs, kind: str, body: bytes) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        jobs.run(kind, body)
    return caught.value.faults


def upload_faults(upload: bytes, limits: Limits) -> tuple[Fault, ...]:
    with pytest.raises(InvalidInput) as caught:
        read_route(upload, None, limits)
    return caught.value.faults


def body_of(**fields: Any) -> bytes:
    return orjson.dumps({"links": LINKS, **fields})


def test_without_folders_there_is_the_model_of_the_package(jobs: Jobs) -> None:
    assert list(jobs.models) == [DEFAULT_MODEL]
    assert jobs.journeys.atlas is None
    jobs.warm_up()


def test_a_forecast_has_the_name_and_the_reserve_of_its_request(jobs: Jobs) -> None:
    found = jobs.run("forecast", body_of(trip="mine", soc=0.5, reserve=0.35))
    assert found["trip"] == "mine"
    assert "0.35" in found["p_arrive_by_soc"]


def test_an_update_is_measured_until_its_last_sample(jobs: Jobs) -> None:
    observed = {"time_s": [0.0, 1.0, 4.0], "voltage_v": [360.0] * 3, "current_a": [10.0] * 3}
    found = jobs.run("update", body_of(soc=0.5, observed=observed))
    assert isinstance(found, dict)
    assert found["measured_until_s"] == 4.0


def test_what_is_wrong_is_named_once_and_together(jobs: Jobs) -> None:
    body = body_of(soc=2.0, model="bmw_i3_tu", car="nothing", observed={"time_s": 1})
    found = [fault.where for fault in faults_of(jobs, "update", body)]
    assert len(found) == len(set(found))
    assert {"soc", "model", "car", "observed.time_s"} == set(found)


def test_a_body_that_is_no_object_is_one_fault(jobs: Jobs) -> None:
    for kind in ("forecast", "update", "plan", "reach"):
        assert [fault.where for fault in faults_of(jobs, kind, b"[]")] == ["body"]
    with pytest.raises(Problem) as caught:
        jobs.run("forecast", b"{")
    assert caught.value.kind == "not-json"


def test_a_trip_has_samples_or_links(jobs: Jobs) -> None:
    samples = {"time_s": [0, 1, 2], "speed_m_s": [10, 10, 10]}
    (both,) = faults_of(jobs, "forecast", body_of(samples=samples))
    (neither,) = faults_of(jobs, "forecast", b"{}")
    assert [both.got, neither.got] == ["both", "neither"]
    assert jobs.run("forecast", orjson.dumps({"samples": samples}))["given"] == "the driven speed trace"


def test_a_model_and_a_car_are_texts(jobs: Jobs) -> None:
    assert [fault.where for fault in faults_of(jobs, "forecast", body_of(model=3))] == ["model"]
    assert [fault.where for fault in faults_of(jobs, "forecast", body_of(car=3))] == ["car"]
    assert [fault.where for fault in faults_of(jobs, "forecast", body_of(model=3, car="nothing"))] == [
        *("car", "model")
    ]


def test_the_car_of_the_model_needs_no_transfer(jobs: Jobs) -> None:
    own = jobs.models[DEFAULT_MODEL].vehicle.name
    found = limited(jobs)
    assert found.run("forecast", body_of(car=own)) == found.run("forecast", body_of())
    assert len(found.transferred) == 0


def test_a_distance_is_answered_for_a_described_car(jobs: Jobs) -> None:
    def asked(**more: Any) -> bytes:
        return orjson.dumps({"distance_km": 50, **more})

    heavy = '{"mass_kg": 2600, "usable_battery_kwh": 90, "body": "van"}'
    described = jobs.run("distance", asked(car=heavy))
    assert described["energy_wh"] > 1.2 * jobs.run("distance", asked())["energy_wh"]
    far = jobs.run("range", orjson.dumps({"car": heavy}))
    assert far["range_m"] > 1.5 * jobs.run("range", b"{}")["range_m"]
    assert {f.where for f in faults_of(jobs, "distance", asked(car='{"mass_kg": 1}'))} == {"car.mass_kg"}
    (fault,) = faults_of(jobs, "distance", asked(car="{"))
    assert (fault.what, fault.where) == ("not JSON", "car")


def test_the_charge_that_the_car_of_a_request_shows_is_that_of_its_departure(jobs: Jobs) -> None:
    own = jobs.models[DEFAULT_MODEL].vehicle.name
    shown = {"car": own, "soc": 0.37}

    def arrival(**given: Any) -> float:
        return float(jobs.run("forecast", body_of(**given), last_message=shown)["soc_arrival"])

    assert arrival(car=own) == arrival(soc=0.37) != arrival(car=own, soc=0.8) == arrival(soc=0.8)
    assert arrival() != arrival(car=own) != arrival(car="vw_id3"), "of another car"


def test_a_transferred_model_is_kept_and_the_least_recent_one_goes_first(
    jobs: Jobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []

    def for_car(model: Any, car: Any) -> Any:
        made.append(car)
        return replace(model)

    monkeypatch.setattr(room, "for_car", for_car)
    kept = LRUCache[tuple[str, str | None], ForecastModel](64)
    kept.update({(DEFAULT_MODEL, f"car {k}"): jobs.models[DEFAULT_MODEL] for k in range(63)})
    found = replace(jobs, transferred=kept)
    found.run("forecast", body_of(car="vw_id3"))
    assert len(found.transferred) == 64
    assert found.transferred[DEFAULT_MODEL, "car 0"]  # which makes car 1 the least recent
    found.run("forecast", body_of(car="vw_id3"))
    assert made == ["vw_id3"]
    found.run("forecast", body_of(car="tesla_model_3_lr"))
    assert len(found.transferred) == 64
    assert (DEFAULT_MODEL, "car 1") not in found.transferred
    assert {(DEFAULT_MODEL, name) for name in ("car 0", "vw_id3", "tesla_model_3_lr")} <= set(
        found.transferred
    )


def test_the_flags_of_a_transfer_come_first(jobs: Jobs) -> None:
    found = limited(jobs).run("forecast", body_of(car="vw_id3"))
    assert found["flags"][0]["code"] == "no_trips_of_car"
    assert "no_trips_of_car" not in {flag["code"] for flag in jobs.run("forecast", body_of())["flags"]}


def test_an_uploaded_trip_is_measured_from_its_first_sample(jobs: Jobs) -> None:
    found = read_route(CSV, None, limited(jobs, samples=3, duration_s=2.0).limits)
    assert (found["duration_s"], found["distance_m"]) == (2.0, 21.0)
    assert (found["links"], found["elevation"], found["notes"]) == (None, None, [])
    assert found["samples"]["speed_m_s"] == [10.0, 10.0, 12.0]


def test_an_uploaded_trip_has_its_limits(jobs: Jobs) -> None:
    assert upload_faults(CSV, limited(jobs, samples=2).limits) == (
        Fault("too many samples", "upload", "3", "at most 2"),
    )
    (fault,) = upload_faults(CSV, limited(jobs, duration_s=1.9).limits)
    assert (fault.what, fault.got) == ("duration out of range", "2 s")


def test_an_uploaded_route_has_its_limits(jobs: Jobs) -> None:
    body = orjson.dumps(LINKS)
    found = read_route(body, None, limited(jobs, links=2, duration_s=150.0).limits)
    assert [link["length_m"] for link in found["links"]] == [800.0, 400.0]
    assert found["elevation"] is None
    assert [note["code"] for note in found["notes"]] == ["no_elevation"]
    assert upload_faults(body, limited(jobs, links=1).limits) == (
        Fault("too many links", "upload", "2", "at most 1"),
    )
    assert upload_faults(body, limited(jobs, duration_s=149.0).limits)[0].got == "150 s"


def line_of(*points: list[float]) -> bytes:
    return orjson.dumps({"type": "LineString", "coordinates": points})


def test_a_track_without_times_is_driven_at_the_speed(jobs: Jobs) -> None:
    points = ([11.5, 48.1, 500.0], [11.6, 48.1, 510.0])
    slow, fast = (jobs.run("route", line_of(*points), speed_m_s=v) for v in (10.0, 20.0))
    assert isinstance(slow, dict)
    assert isinstance(fast, dict)
    assert slow["links"][0]["travel_time_s"] == pytest.approx(2.0 * fast["links"][0]["travel_time_s"])
    assert slow["elevation"]["elevation_m"][0] == pytest.approx(500.0, abs=1.0)
    assert len(slow["elevation"]["position_m"]) == len(slow["elevation"]["elevation_m"])


def gpx_of(*seconds: int) -> bytes:
    points = "".join(
        f'<trkpt lat="{48 + k / 3e3:.5f}" lon="11.5"><ele>500</ele><time>2026-05-01T08:{s // 60:02d}:{s % 60:02d}Z</time></trkpt>'
        for k, s in enumerate(seconds)
    )
    return f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>".encode()


def test_a_log_has_its_duration_and_no_links(jobs: Jobs) -> None:
    log = gpx_of(*range(0, 124, 4))
    found = read_route(log, None, limited(jobs, duration_s=120.0).limits)
    assert (found["links"], found["duration_s"]) == (None, 120.0)
    (fault,) = upload_faults(log, limited(jobs, duration_s=119.0).limits)
    assert (fault.where, fault.got) == ("upload", "120 s")


def test_a_track_with_few_times_is_a_road(jobs: Jobs) -> None:
    """A point every 4 s is a log; one every 10 min is a plan, whose links have the times."""
    found = read_route(gpx_of(0, 600, 1200), None, jobs.limits)
    assert found["duration_s"] == pytest.approx(1200.0)
    assert sum(link["travel_time_s"] for link in found["links"]) == pytest.approx(1200.0)


def test_the_cars_and_the_models_fitted_on_them(jobs: Jobs) -> None:
    rows = {row["name"]: row["models"] for row in jobs.vehicles()["vehicles"]}
    own = jobs.models[DEFAULT_MODEL].vehicle.name
    assert rows.pop(own) == [DEFAULT_MODEL]
    assert set(map(tuple, rows.values())) == {()}
    searched = jobs.run("vehicles", search="zoe")
    assert isinstance(searched, dict)
    assert [row["name"] for row in searched["vehicles"]] == ["renault_zoe_ze50_r135"]


def test_a_described_car(jobs: Jobs) -> None:
    found = jobs.run("describe", b'{"mass_kg": 1830, "title": "mine"}')
    assert isinstance(found, dict)
    assert (found["title"], found["test_mass_kg"], found["anchor"]) == ("mine", 1905.0, "class")


def test_figures_that_no_car_has_together_are_a_fault_of_the_request(jobs: Jobs) -> None:
    figures = {"mass_kg": 400, "usable_battery_kwh": 300}
    for kind, body in (
        ("describe", orjson.dumps(figures)),
        ("forecast", body_of(soc=0.5, car=figures)),
    ):
        status, answer = run_job(jobs, {"kind": kind}, body)
        assert status == 422
        (fault,) = orjson.loads(answer)["faults"]
        assert fault["what"] == "no car has these values together"
        assert fault["where"] == "mass_kg and usable_battery_kwh"
        assert fault["allowed"] == "2 to 200 Wh/kg"


def test_a_forecast_that_physics_forbids_is_a_fault_of_the_request(jobs: Jobs) -> None:
    model = jobs.models[DEFAULT_MODEL]
    battery = replace(
        model.vehicle.battery, resistance_ohm=(0.5,) * len(model.vehicle.battery.resistance_ohm)
    )
    weak = replace(model, vehicle=replace(model.vehicle, battery=battery))
    broken = replace(jobs, models={DEFAULT_MODEL: weak})
    status, answer = run_job(broken, {"kind": "forecast"}, body_of(soc=0.5))
    assert status == 422
    assert orjson.loads(answer)["faults"][0]["what"] == "energy that physics forbids"


def test_a_fault_of_one_of_two_trips_names_its_trip(jobs: Jobs) -> None:
    wrong = {"links": [{"length_m": -1.0, "speed_m_s": 9.0}], "model": "zzz"}
    found = faults_of(jobs, "difference", orjson.dumps({"one": {"links": LINKS}, "other": wrong}))
    assert [fault.where for fault in found] == ["other.model", "other.link 1, length_m"]


def test_an_unknown_model_gets_a_suggestion(jobs: Jobs) -> None:
    for name, fix in (("bmw_i3_tu", "did you mean 'bmw_i3_tum'?"), ("zzz", "")):
        (fault,) = faults_of(jobs, "forecast", body_of(model=name))
        found = (fault.what, fault.where, fault.allowed, fault.fix)
        assert found == ("unknown model", "model", DEFAULT_MODEL, fix)


def test_the_content_of_an_upload_decides(jobs: Jobs) -> None:
    for before in (b"", b"\xef\xbb\xbf", b" \t\r\n"):
        assert read_route(before + orjson.dumps(LINKS), None, jobs.limits)["links"] is not None
    assert read_route(b"length_m,speed_m_s\n800,8\n", None, jobs.limits)["links"] is not None
    assert read_route(CSV, None, jobs.limits)["links"] is None


def test_every_value_of_a_forecast_is_finite() -> None:
    """JSON would hold null instead."""
    sound: dict[str, Any] = {
        **dict.fromkeys(("energy_wh", "soc_arrival", "battery_loss_wh"), 1.0),
        "quantiles_wh": {"0.5": 1.0},
        "p_arrive_by_soc": {"0": 1.0},
        "series": {"time_s": [0.0, 1.0]},
    }
    assert require_finite(sound) == sound
    for wrong in (float("nan"), float("inf")):
        spoiled = [{name: wrong} for name in ("energy_wh", "soc_arrival", "battery_loss_wh")]
        spoiled += [{"quantiles_wh": {"0.5": wrong}}, {"p_arrive_by_soc": {"0": wrong}}]
        for one in (*spoiled, {"series": {"time_s": [0.0, wrong]}}):
            with pytest.raises(InvalidInput, match="no forecast"):
                require_finite(sound | one)
