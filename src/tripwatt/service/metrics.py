"""Metrics for Prometheus."""

from __future__ import annotations

from typing import Final

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

import tripwatt

BUCKETS_S: Final = (0.0025, 0.005, 0.01, 0.015, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 20.0)


class Metrics:
    """Metrics of one service.

    Labels are templates of routes and known methods only, so that clients cannot create labels.
    """

    def __init__(self) -> None:
        registry = CollectorRegistry()
        self.registry = registry
        self.requests = Counter(
            "tripwatt_requests", "Requests with a response.", ("route", "method", "status"), registry=registry
        )
        self.duration = Histogram(
            "tripwatt_request_seconds",
            "Time from the head of a request to the end of its response.",
            ("route",),
            buckets=BUCKETS_S,
            registry=registry,
        )
        self.job_seconds = Histogram(
            "tripwatt_work_seconds",
            "Computing time of a job.",
            ("kind",),
            buckets=BUCKETS_S,
            registry=registry,
        )
        self.trips = Counter("tripwatt_trips", "Trips in batches.", ("outcome",), registry=registry)
        self.running = Gauge(
            "tripwatt_requests_running", "Requests without a complete response.", registry=registry
        )
        self.waiting = Gauge("tripwatt_jobs_waiting", "Jobs that wait for a worker.", registry=registry)
        self.workers = Gauge("tripwatt_workers_ready", "Workers that are ready.", registry=registry)
        self.lost = Gauge("tripwatt_workers_lost", "Workers lost since the start.", registry=registry)
        about = Gauge("tripwatt_info", "The running version.", ("version",), registry=registry)
        about.labels(tripwatt.__version__).set(1)

    def render(self) -> bytes:
        """Return all metrics in the text format of Prometheus."""
        return generate_latest(self.registry)
