"""A car followed over MQTT with a real broker: the forecast of `update`, a broker that is killed, a command that prints."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.live.brokers import MOSQUITTO, Sent, broker, replay
from tests.live.messages import NOON_S, abrp_messages, measured, samples_of

pytest.importorskip("aiomqtt", reason="the extra tripwatt[live] is not installed")

import aiomqtt

import tripwatt as tw
from tripwatt.cli.on_road import sentence
from tripwatt.errors import Fault, InvalidInput
from tripwatt.live import Broker, Follower, LiveForecaster, Sample, TopicJoiner, following, open_live_car
from tripwatt.live.discovery import SENSORS, discovery
from tripwatt.live.live_trip import SILENCE_S
from tripwatt.routes import links_of_trip, plan_from_links
from tripwatt.synthetic import example_trip
from tripwatt.trips import plan_from_samples

needs_broker = pytest.mark.skipif(
    MOSQUITTO is None, reason="no mosquitto: install it from the distribution's packages"
)
ROOT = "ovms/me/leaf/metric"
METRICS = {
    "speed_m_s": ("v/p/speed", 3.6),
    "voltage_v": ("v/b/voltage", 1.0),
    "current_a": ("v/b/current", 1.0),
    "elevation_m": ("v/p/altitude", 1.0),
    "ambient_temperature_degc": ("v/e/temp", 1.0),
}


@pytest.fixture(scope="module")
def drive() -> pd.DataFrame:
    return measured(example_trip()).iloc[:300]


@pytest.fixture
def forecaster() -> LiveForecaster:
    return LiveForecaster(tw.load_model(), plan_from_samples(example_trip()), reserve=0.2)


async def publish(where: Broker, rows: pd.DataFrame) -> None:
    """Each second of a drive as OVMS sends it: the time, then the metrics."""
    async with aiomqtt.Client(where.host, where.port) as client:
        for row in rows.to_dict("records"):
            await client.publish(f"{ROOT}/m/time/utc", f"{NOON_S + row['time_s']:.0f}", qos=1)
            for ours, (metric, factor) in METRICS.items():
                await client.publish(f"{ROOT}/{metric}", repr(float(row[ours] * factor)), qos=1)


async def until(condition: Callable[[], Any]) -> None:
    for _ in range(1200):
        if condition():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it did not come true in a minute")


def following_car(
    folder: Path,
    where: Broker,
    work: Callable[[Follower, list[dict[str, Any]]], Awaitable[None]],
    **more: Any,
) -> list[dict[str, Any]]:
    """Do something while a car is followed; what it showed."""
    shown: list[dict[str, Any]] = []

    async def run() -> None:
        with open_live_car(folder) as car:
            follower = Follower(car, TopicJoiner("ovms", ROOT), shown.append, every_s=0.1, **more)
            task = asyncio.ensure_future(follower.follow(where))
            try:
                await work(follower, shown)
            finally:
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)

    asyncio.run(run())
    return shown


async def subscribed(where: Broker) -> None:
    """Wait until the follower's session is there: what is published after that is kept for it."""
    async with aiomqtt.Client(where.host, where.port) as client:
        await client.subscribe("$SYS/broker/subscriptions/count")
        async for message in client.messages:
            if int(bytes(message.payload)) >= 2:  # type: ignore[arg-type]
                return


@needs_broker
def test_the_forecast_over_mqtt_is_that_of_update(
    drive: pd.DataFrame, forecaster: LiveForecaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    published: list[dict[str, Any]] = []

    async def work(follower: Follower, shown: list[dict[str, Any]]) -> None:
        await subscribed(where)
        await publish(where, drive)
        await until(lambda: follower.car.counts["new"] == len(drive))
        await until(lambda: shown and shown[-1]["messages"]["new"] == len(drive))
        async with aiomqtt.Client(where.host, where.port) as client:
            await client.subscribe("tripwatt/leaf")
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                published.append(json.loads(message.payload))
                if published[-1]["messages"]["new"] == len(drive):
                    break

    found_by_home_assistant: dict[str, Any] = {}

    async def work_and_look(follower: Follower, shown: list[dict[str, Any]]) -> None:
        await work(follower, shown)
        async with aiomqtt.Client(where.host, where.port) as client:
            await client.subscribe("homeassistant/#")
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                assert message.retain
                found_by_home_assistant[message.topic.value] = json.loads(message.payload)
                if len(found_by_home_assistant) == len(SENSORS):
                    break

    with broker(tmp_path) as (where, _):
        shown = following_car(
            tmp_path / "leaf",
            where,
            work_and_look,
            forecaster=forecaster,
            publish_to="tripwatt/leaf",
            announce_below="homeassistant",
        )
    assert found_by_home_assistant == dict(discovery("leaf", "tripwatt/leaf", "homeassistant"))
    table = drive[["time_s", *METRICS]]
    own = forecaster.model.forecast(forecaster.plan).update_since_departure(table)
    found = shown[-1]["forecast"]
    assert found["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
    assert found["soc_quantiles"] == {
        f"{p:g}": pytest.approx(own.soc_quantile(p), abs=1e-9) for p in (0.05, 0.5, 0.95)
    }
    assert found["p_arrive"] == pytest.approx(own.p_arrive(0.2), abs=1e-9)
    assert (found["reserve"], found["measured_until_s"], shown[-1]["faults"]) == (0.2, 299.0, [])
    assert published[-1]["forecast"] == found


@needs_broker
def test_a_broker_that_is_killed_costs_no_message_that_comes_after_it(
    drive: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "AGAIN_S", (0.05, 0.1))
    monkeypatch.setattr(following, "FLUSH_S", 0.3)
    notes: list[str] = []

    async def work(follower: Follower, shown: list[dict[str, Any]]) -> None:
        await subscribed(where)
        await publish(where, drive.iloc[:100])
        await until(lambda: follower.car.counts["new"] == 100)
        process.kill()
        process.wait()
        await until(lambda: notes)
        with broker(tmp_path, where.port) as (again, _):
            await subscribed(again)
            await publish(again, drive.iloc[100:])
            await until(lambda: follower.car.counts["new"] == len(drive))
            assert follower.car.observed()["time_s"].tolist() == drive["time_s"].tolist()
            notes.clear()
        await until(lambda: notes)

    with broker(tmp_path) as (where, process):
        following_car(tmp_path / "leaf", where, work, note=notes.append)
    assert all(note.startswith("127.0.0.1:") for note in notes)


@needs_broker
def test_the_command_prints_a_line_for_new_messages(drive: pd.DataFrame, tmp_path: Path) -> None:
    (tmp_path / "route.json").write_text(json.dumps([{"length_m": 9000.0, "speed_m_s": 14.0}]))
    with broker(tmp_path) as (where, _):
        command = [sys.executable, "-m", "tripwatt.cli", "live", f"{tmp_path / 'leaf'}"]
        command += ["--mqtt", f"mqtt://127.0.0.1:{where.port}", "--source", "abrp", "--topic", "leaf/tlm"]
        command += ["--plan", f"{tmp_path / 'route.json'}", "--every", "0.2", "--json"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:

            async def send() -> None:
                await subscribed(where)
                async with aiomqtt.Client(where.host, where.port) as client:
                    for message in abrp_messages(drive):
                        await client.publish("leaf/tlm", json.dumps(message), qos=1)

            asyncio.run(send())
            assert process.stdout is not None
            for line in process.stdout:
                found = json.loads(line)
                if found["messages"]["new"] == len(drive):
                    break
            process.terminate()
            process.stdout.read()
    plan = tw.read_route([{"length_m": 9000.0, "speed_m_s": 14.0}])
    with open_live_car(tmp_path / "leaf") as car:
        own = car.update(tw.load_model().forecast(plan, car.departure()))
    assert found["forecast"]["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
    assert sentence(found).startswith(
        f"leaf: {found['trip']['distance_m'] / 1000.0:.1f} km driven, 300 messages, "
    )


def test_a_forecast_is_of_what_is_known_of_the_departure(forecaster: LiveForecaster, tmp_path: Path) -> None:
    bare = tw.read_route([{"length_m": 9000.0, "speed_m_s": 14.0}])
    given = LiveForecaster(forecaster.model, bare.with_departure(tw.Departure(soc=0.5)))
    with open_live_car(tmp_path / "leaf") as car:
        unknown = given.at_departure(car)
        assert given.at_departure(car) is unknown
        car.add(Sample(NOON_S, {"displayed_soc": 0.9, "ambient_temperature_degc": -8.0}))
        known = given.at_departure(car)
        assert known.plan.departure == tw.Departure(soc=0.5, ambient_temperature_degc=-8.0)
        assert known.energy_wh > unknown.energy_wh


def test_what_cannot_be_of_the_trip_leaves_the_forecast_at_departure(
    forecaster: LiveForecaster, tmp_path: Path
) -> None:
    with open_live_car(tmp_path / "leaf") as car:
        for k in range(60):
            car.add(Sample(NOON_S + k, {"speed_m_s": 10.0, "displayed_soc": 0.3 if k < 50 else 0.9}))
        found = forecaster.document(car)
        assert found["forecast"]["measured_until_s"] == 0.0
        assert [fault["what"] for fault in found["faults"]] == ["charge rises"]
        shown = sentence(car.about(NOON_S) | found)
        assert "charge rises" in shown


def test_a_plan_that_cannot_be_forecast_is_a_fault(
    forecaster: LiveForecaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise InvalidInput(Fault("no road", "plan"))

    monkeypatch.setattr(type(forecaster.model), "forecast", refuse)
    with open_live_car(tmp_path / "leaf") as car:
        found = forecaster.document(car)
    assert found == {
        "plan": None,
        "usual_trip": None,
        "forecast": None,
        "faults": [{"what": "no road", "where": "plan"}],
    }


def test_the_plan_of_a_trip_that_has_ended_is_not_used_again(
    drive: pd.DataFrame, forecaster: LiveForecaster, tmp_path: Path
) -> None:
    with open_live_car(tmp_path / "leaf") as car:
        follower = Follower(car, TopicJoiner("ovms", ROOT), print, forecaster)
        for sample in samples_of(drive):
            car.add(sample)
        assert car.received_s is not None
        now_s = car.received_s
        follower._look_for_the_end(now_s)
        assert follower.document(now_s)["forecast"] is not None
        follower._look_for_the_end(now_s + SILENCE_S)
        assert (car.trip, forecaster.plan) == (None, None)
        assert follower.document(now_s)["forecast"] is None


def test_without_a_plan_the_road_is_that_of_the_usual_trip(
    drive: pd.DataFrame, forecaster: LiveForecaster, tmp_path: Path
) -> None:
    without = LiveForecaster(forecaster.model)
    with open_live_car(tmp_path / "leaf") as car:
        for sample in samples_of(drive):
            car.add(sample)
        assert without.document(car) == {"plan": None, "usual_trip": None, "forecast": None, "faults": []}
        assert car.received_s is not None
        car.end_when_silent(car.received_s + SILENCE_S)
        (log,) = car.logs()
        for sample in samples_of(drive.iloc[:150], NOON_S + 86_400.0):
            car.add(sample)
        found = without.document(car)
        plan = plan_from_links(links_of_trip(log)).with_departure(car.departure())
        own = car.update(forecaster.model.forecast(plan))
        assert (found["plan"], found["usual_trip"]) == ("usual", log.trip_id)
        assert found["forecast"]["energy_wh"] == pytest.approx(own.energy_wh, abs=1e-6)
        assert found["forecast"]["measured_until_s"] > 100.0
        assert without.document(car) == found


@pytest.mark.parametrize("url", ["", "host", "http://host", "mqtt://", "mqtt://host:x", "mqtt://host:99999"])
def test_a_broker_has_a_url(url: str) -> None:
    with pytest.raises(InvalidInput, match="not a broker"):
        Broker.from_url(url)


def test_a_password_is_that_of_the_url_or_the_given_one_and_is_not_shown() -> None:
    assert Broker.from_url("mqtt://me@h", "secret") == Broker("h", 1883, "me", "secret")
    assert Broker.from_url("mqtts://me:p%40ss@h:1", "secret") == Broker("h", 1, "me", "p@ss", True)
    assert "secret" not in repr(Broker.from_url("mqtt://me:secret@h"))
    with pytest.raises(InvalidInput) as caught:
        Broker.from_url("http://me:secret@h")
    assert "secret" not in str(caught.value)


@needs_broker
@pytest.mark.parametrize("killed", [False, True])
def test_trips_with_lost_late_and_doubled_messages_end_whole(tmp_path: Path, killed: bool) -> None:
    drives, forecasts = [], {}
    for seed in range(3):
        table = measured(example_trip(seed)).iloc[: 300 + 50 * seed]
        drives.append(Sent.from_table(f"car{seed}", table, seed))
        forecasts[f"car{seed}"] = tw.forecast(plan_from_samples(example_trip(seed)))
        assert len(drives[-1].messages) > len(drives[-1].table())
    for found in replay(tmp_path, drives, forecasts, killed=killed):
        assert found.difference_wh < 1e-6
        assert (found.missing, found.twice) == (0, 0)
