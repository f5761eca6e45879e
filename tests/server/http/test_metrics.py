"""Names, labels and values of the metrics."""

from __future__ import annotations

from prometheus_client import generate_latest

import tripwatt
from tripwatt.server.http.metrics import Metrics


def values_of(metrics: Metrics) -> dict[str, float]:
    lines = [
        line for line in generate_latest(metrics.registry).decode().splitlines() if not line.startswith("#")
    ]
    return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines)}


def test_counters_have_their_labels() -> None:
    metrics = Metrics()
    metrics.requests.labels("/v1/forecast", "POST", "200").inc()
    metrics.trips.labels("answered").inc(3)
    found = values_of(metrics)
    assert found['tripwatt_requests_total{method="POST",route="/v1/forecast",status="200"}'] == 1.0
    assert found['tripwatt_trips_total{outcome="answered"}'] == 3.0


def test_a_new_service_has_zeros_and_its_version() -> None:
    found = values_of(Metrics())
    assert found == {
        "tripwatt_requests_running": 0.0,
        "tripwatt_jobs_waiting": 0.0,
        "tripwatt_workers_ready": 0.0,
        "tripwatt_workers_lost": 0.0,
        f'tripwatt_info{{version="{tripwatt.__version__}"}}': 1.0,
    }
