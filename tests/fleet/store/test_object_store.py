"""A store in an object store, by its URL, against a server that speaks S3."""

import subprocess
import sys
import time
import urllib.request

import pytest

pytest.importorskip("deltalake", reason="needs the extra tripwatt[fleet]")
pytest.importorskip("moto.server", reason="needs moto")

from tests.fleet.rows import mapped
from tests.fleet.store.test_store import CAR, drive, same
from tests.support.service_process import free_port

from tripwatt.fleet.mapping import read_rows
from tripwatt.fleet.store import Added, create_store, open_store


@pytest.fixture
def bucket(monkeypatch):
    for name in ("AWS_PROFILE", "AWS_SESSION_TOKEN"):
        monkeypatch.delenv(name, raising=False)
    port = free_port()
    # a process of its own: calls of the store hold this one's interpreter
    server = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", f"{port}"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=2.0).close()
            break
        except OSError:
            time.sleep(0.1)
    options = {
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ALLOW_HTTP": "true",
        "AWS_CONDITIONAL_PUT": "etag",
    }
    import boto3

    client = boto3.client(
        "s3",
        endpoint_url=options["AWS_ENDPOINT_URL"],
        region_name="us-east-1",
        aws_access_key_id="test",
        aws_secret_access_key="test",
    )
    client.create_bucket(Bucket="fleet")
    yield "s3://fleet/store", options, client
    server.terminate()
    server.wait(timeout=30)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_store_by_url(bucket, tmp_path):
    place, options, client = bucket
    store = create_store(place, buckets=2, options=options)
    logs = [drive(trip="A"), drive(trip="B", vehicle="V2", start=1.0)]
    assert store.add(logs, car_model=CAR) == Added(2, 0, 0)
    assert store.add(logs, car_model=CAR) == Added(0, 2, 0)
    again = open_store(place, options=options)
    found = {log.trip_id: log for log in again.logs()}
    assert all(same(log, found[log.trip_id]) for log in logs)
    rows = read_rows(mapped(again, tmp_path))
    assert sorted(rows.texts("drive").tolist()) == ["A", "B"]
    assert again.forget("V2") == 1
    assert [log.trip_id for log in again.logs()] == ["A"]
    keys = [o["Key"] for o in client.list_objects_v2(Bucket="fleet")["Contents"]]
    assert any(key.startswith("store/samples/_delta_log/") for key in keys)
