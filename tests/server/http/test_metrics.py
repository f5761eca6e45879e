"""Names, labels, buckets and values of the metrics."""

from __future__ import annotations

import tripwatt
from tripwatt.server.http.metrics import BUCKETS_S, Metrics


def values_of(metrics: Metrics) -> dict[str, float]:
    lines = [line for line in metrics.render().decode().splitlines() if not line.startswith("#")]
    return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines)}


def test_the_buckets_of_times() -> None:
    below_a_tenth = (0.0025, 0.005, 0.01, 0.015, 0.025, 0.05)
    assert BUCKETS_S[:6] == below_a_tenth
    assert BUCKETS_S[6:] == (0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 20.0)


def test_a_time_counts_in_its_bucket_and_all_larger_ones() -> None:
    metrics = Metrics()
    metrics.duration.labels("/v1/forecast").observe(0.01)
    metrics.job_seconds.labels("forecast").observe(20.5)
    found = values_of(metrics)
    counts = [
        found[f'tripwatt_request_seconds_bucket{{le="{bound}",route="/v1/forecast"}}'] for bound in BUCKETS_S
    ]
    assert counts == [0.0] * 2 + [1.0] * 12
    assert found['tripwatt_work_seconds_bucket{kind="forecast",le="20.0"}'] == 0.0
    assert found['tripwatt_work_seconds_bucket{kind="forecast",le="+Inf"}'] == 1.0
    assert found['tripwatt_work_seconds_sum{kind="forecast"}'] == 20.5


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


def test_the_gauges_of_the_pool_ask_it() -> None:
    metrics = Metrics()
    for gauge, value in ((metrics.waiting, 3), (metrics.workers, 2), (metrics.lost, 7)):
        gauge.set(value)
    found = values_of(metrics)
    names = ("tripwatt_jobs_waiting", "tripwatt_workers_ready", "tripwatt_workers_lost")
    assert [found[name] for name in names] == [3.0, 2.0, 7.0]
