"""What is counted, for Prometheus."""

from __future__ import annotations

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

import tripwatt

SECONDS = (0.0025, 0.005, 0.01, 0.015, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 20.0)


class Metrics:
    """Counts of one service. Routes are templates and methods are known ones, so that no client makes up labels."""

    def __init__(self) -> None:
        registry = CollectorRegistry()
        self.registry = registry
        self.requests = Counter(
            "tripwatt_requests", "Requests answered.", ("route", "method", "status"), registry=registry
        )
        self.duration = Histogram(
            "tripwatt_request_seconds",
            "Time from a request's head to the end of its answer.",
            ("route",),
            buckets=SECONDS,
            registry=registry,
        )
        self.work = Histogram(
            "tripwatt_work_seconds",
            "Time that a worker computed for a job.",
            ("kind",),
            buckets=SECONDS,
            registry=registry,
        )
        self.trips = Counter("tripwatt_trips", "Trips of batches.", ("outcome",), registry=registry)
        self.running = Gauge("tripwatt_requests_running", "Requests not yet answered.", registry=registry)
        self.waiting = Gauge("tripwatt_jobs_waiting", "Jobs that wait for a worker.", registry=registry)
        self.workers = Gauge("tripwatt_workers_ready", "Workers that are ready.", registry=registry)
        self.lost = Gauge("tripwatt_workers_lost", "Workers that died since the start.", registry=registry)
        about = Gauge("tripwatt_info", "The running version.", ("version",), registry=registry)
        about.labels(tripwatt.__version__).set(1)

    def follow(self, waiting: Callable[[], int], workers: Callable[[], int], lost: Callable[[], int]) -> None:
        """Read the gauges of the workers from these."""
        self.waiting.set_function(waiting)
        self.workers.set_function(workers)
        self.lost.set_function(lost)

    def render(self) -> bytes:
        """The text that Prometheus reads."""
        return generate_latest(self.registry)
