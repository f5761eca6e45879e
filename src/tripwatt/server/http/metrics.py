"""Metrics for Prometheus."""

from __future__ import annotations

from functools import partial
from typing import Final

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

import tripwatt

BUCKETS_S: Final = (0.0025, 0.005, 0.01, 0.015, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 20.0)
"""Upper ends of the classes of durations [s], up to `Limits.timeout_s`. A choice."""


class Metrics:
    """Metrics of one service.

    Labels are only templates of routes and known methods, so that clients cannot create labels.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        counter, gauge = partial(Counter, registry=self.registry), partial(Gauge, registry=self.registry)
        histogram = partial(Histogram, registry=self.registry, buckets=BUCKETS_S)
        labels = "route", "method", "status"
        self.requests = counter("tripwatt_requests", "Requests with a response.", labels)
        self.duration = histogram(
            "tripwatt_request_seconds",
            "Time from the head of a request to the end of its response.",
            ("route",),
        )
        self.job_seconds = histogram("tripwatt_work_seconds", "Computing time of a job.", ("kind",))
        self.trips = counter("tripwatt_trips", "Trips in batches.", ("outcome",))
        self.running = gauge("tripwatt_requests_running", "Requests without a complete response.")
        self.waiting = gauge("tripwatt_jobs_waiting", "Jobs that wait for a worker.")
        self.workers = gauge("tripwatt_workers_ready", "Workers that are ready.")
        self.lost = gauge("tripwatt_workers_lost", "Workers lost since the start.")
        gauge("tripwatt_info", "The running version.", ("version",)).labels(tripwatt.__version__).set(1)
